"""Optimal control of mechanisms by direct shooting."""
