"""Models whose rows are always there: those that every formulation and every derivative takes."""

import mbdae

SMOOTH = [name for name in mbdae.model_names() if not mbdae.load(name).switches]
