"""Steppers of a run: fixed steps, controlled steps, solvers of other libraries, or the compiled core."""
