"""Observed orders of methods against their claims."""
