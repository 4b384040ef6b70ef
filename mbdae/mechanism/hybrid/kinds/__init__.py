"""Kinds of switches, one file per kind."""
