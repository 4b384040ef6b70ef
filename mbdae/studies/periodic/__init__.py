"""Periodic motions: shooting, Floquet multipliers, branches over a parameter."""
