"""Optimization of mechanism parameters: an interface to `scipy.optimize`, with exact gradients."""
