"""Formulations of the equations of motion: index 2, GGL and index 1; in Python and in the compiled core."""
