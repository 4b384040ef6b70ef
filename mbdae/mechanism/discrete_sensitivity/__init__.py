"""What small changes do to a mechanism: parameters by name, slopes of stages, their tangent and adjoint."""
