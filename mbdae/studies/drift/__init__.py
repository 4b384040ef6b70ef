"""Drift of the closures and of the energy along a run."""
