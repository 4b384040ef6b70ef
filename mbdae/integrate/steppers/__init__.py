"""Steppers of a run: fixed steps, controlled steps, scipy's solvers, or the compiled core."""
