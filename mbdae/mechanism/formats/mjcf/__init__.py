"""MJCF files, compiled by MuJoCo: bodies, equalities, actuators, keyframes, and what is left out."""
