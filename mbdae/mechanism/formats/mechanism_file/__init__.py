"""Mechanism files: read, checked, merged with their sources, built, and described in saved runs."""
