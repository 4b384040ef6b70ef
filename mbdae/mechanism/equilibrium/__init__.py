"""Equilibrium equations, linearisation on the null space of the closures, and eigenvalues."""
