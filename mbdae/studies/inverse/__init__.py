"""Inverse dynamics: torques for a prescribed motion."""
