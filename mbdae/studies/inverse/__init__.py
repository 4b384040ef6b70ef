"""Inverse dynamics: actuator efforts of a prescribed motion."""
