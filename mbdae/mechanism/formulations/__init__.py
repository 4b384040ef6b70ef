"""The equations of motion as a method meets them: index 2, GGL, index 1; in Python and in the compiled core."""
