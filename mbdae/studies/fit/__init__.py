"""Parameter identification of a mechanism from measurements of its motion."""
