"""Versions, the card of a mechanism, sizes of a textbook problem."""
