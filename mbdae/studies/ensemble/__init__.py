"""Ensembles: final states of many runs as arrays."""
