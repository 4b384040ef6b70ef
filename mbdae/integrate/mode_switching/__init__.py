"""Guards and mode transitions between the steps of a run: see `mbdae.mechanism.hybrid` for the switches."""
