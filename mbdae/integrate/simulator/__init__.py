"""Simulation in advances, with inputs, snapshots and derivatives of an advance."""
