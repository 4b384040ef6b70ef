"""Assembly analysis: configurations and velocities that satisfy the constraints."""
