"""Equilibrium equations, linearization on the null space of the closures, and eigenvalues."""
