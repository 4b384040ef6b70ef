"""Ensembles: end states of many runs as arrays."""
