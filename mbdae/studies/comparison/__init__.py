"""Comparison of integrators on one mechanism."""
