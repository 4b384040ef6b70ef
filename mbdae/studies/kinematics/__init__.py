"""Mechanisms of one degree of freedom: the curve of their poses over an input."""
