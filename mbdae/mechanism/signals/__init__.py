"""Signals of a mechanism in motion: reactions, joint wrenches, contacts, efforts, momenta."""
