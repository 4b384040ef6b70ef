"""Functions of time: constants, polynomials, tables, user functions, and inputs."""
