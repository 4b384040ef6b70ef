"""Models without mode switches and jumps, for which all formulations and derivatives are available."""

from shared import shared_model

import mbdae

MODELS = {name: shared_model(name) for name in mbdae.model_names()}
SMOOTH = [name for name, mech in MODELS.items() if not (mech.switches or mech.resets)]
