"""Inverse dynamics: the torques that a prescribed motion takes."""
