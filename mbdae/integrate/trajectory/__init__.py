"""Trajectory of a run: checkpoints, and steps recomputed for discrete tangents and adjoints."""
