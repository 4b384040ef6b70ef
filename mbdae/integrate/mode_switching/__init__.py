"""Guards and transitions of modes between the steps of a run: see `mbdae.mechanism.hybrid` for what switches."""
