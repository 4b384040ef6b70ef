"""Scenes: the shapes of a mechanism and the bodies that carry them."""
