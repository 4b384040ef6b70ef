"""Models without mode switches, accepted by every formulation and every derivative."""

import mbdae

SMOOTH = [name for name in mbdae.model_names() if not mbdae.load(name).switches]
