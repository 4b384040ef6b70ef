"""Linearization around equilibria and steady motions: modes, linear systems for control, root loci."""
