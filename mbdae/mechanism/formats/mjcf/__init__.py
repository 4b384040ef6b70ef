"""MJCF files, compiled by MuJoCo: bodies, equalities, actuators, keyframes, and unsupported features."""
