"""Numbers of a mechanism from measurements of its motion."""
