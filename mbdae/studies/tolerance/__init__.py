"""Equilibria, what holds them, and how they move with a load."""
