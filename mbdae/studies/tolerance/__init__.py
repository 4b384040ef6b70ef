"""Tolerance analysis: effects of deviations of dimensions and of clearances."""
