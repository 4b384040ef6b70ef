"""Integrators side by side on one mechanism."""
