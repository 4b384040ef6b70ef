"""Mechanism files: reading, checks, merging with sources, building of models, and descriptions in saved runs."""
