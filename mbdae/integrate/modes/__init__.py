"""Guards and transitions of modes between the steps of a run: see `mbdae.mechanism.modes` for what switches."""
