"""Simulation in communication steps, with inputs, snapshots and derivatives of a communication step."""
