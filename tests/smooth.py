"""Models without mode switches and jumps, accepted by every formulation and every derivative."""

import mbdae

MODELS = {name: mbdae.load(name) for name in mbdae.model_names()}
SMOOTH = [name for name, mech in MODELS.items() if not (mech.switches or mech.resets)]
