"""Mechanisms of one freedom: the curve of their poses over an input."""
