"""Equilibria and their stability, and paths of equilibria over a load."""
