"""Joints and frames of the kinematic tree, and the manifold of its configurations."""
