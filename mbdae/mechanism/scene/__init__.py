"""Scenes: the shapes of a mechanism, and the bodies to which they are fixed."""
