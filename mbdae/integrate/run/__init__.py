"""A run: setup, time loop, state, diagnostics, result."""
