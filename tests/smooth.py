"""Models without mode switches and jumps, accepted by every formulation and every derivative."""

import mbdae

_MODELS = {name: mbdae.load(name) for name in mbdae.model_names()}
SMOOTH = [name for name, mech in _MODELS.items() if not (mech.switches or mech.resets)]
