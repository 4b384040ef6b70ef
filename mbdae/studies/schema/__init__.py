"""JSON Schemas of user files, for completion and validation in editors."""
