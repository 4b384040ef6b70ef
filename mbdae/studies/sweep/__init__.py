"""Thousands of runs over values of parameters."""
