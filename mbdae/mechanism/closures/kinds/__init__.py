"""Kinds of closures, one file each, with keys, rows and preconditions."""
