"""Simulated mechanisms in a browser, in real time."""
