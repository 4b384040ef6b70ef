"""Derivatives of runs: discrete tangents and adjoint gradients."""
