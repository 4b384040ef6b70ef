"""Atlas of integrators: all methods on many models."""
