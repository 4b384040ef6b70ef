"""Benchmark of all methods on many models, the command ``atlas``."""
