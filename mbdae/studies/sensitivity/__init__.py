"""Derivatives of runs: tangents, gradients and what they are made of."""
