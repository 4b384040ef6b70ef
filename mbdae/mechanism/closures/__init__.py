"""Constraints: loop closures and drivers, their rows, and the selection of independent rows."""
