"""Kinds of switches: a file for each."""
