"""Equations of a mechanism at a point: their terms, derivatives, and the form in local coordinates."""
