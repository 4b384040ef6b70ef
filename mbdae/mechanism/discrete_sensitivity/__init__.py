"""Discrete sensitivities of a mechanism: parameters by name, tangent and adjoint of stages."""
