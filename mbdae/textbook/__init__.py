"""Textbook problems y' = f(t, y, z), 0 = g(t, y), used to verify methods."""
