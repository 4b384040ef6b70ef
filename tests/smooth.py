"""Models without mode switches and jumps, accepted by every formulation and every derivative."""

from shared import shared_model

import mbdae

MODELS = {name: shared_model(name) for name in mbdae.model_names()}
SMOOTH = [name for name, mech in MODELS.items() if not (mech.switches or mech.resets)]
