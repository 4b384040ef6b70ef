"""Models whose rows are always there: those that every formulation steps."""

import re

import mbdae
from mbdae.mechanism.formats.library import models_directory

SWITCHES = re.compile(r"^\[\[(stop|clutch)\]\]|^(unilateral|within|static|exact) *=", re.M)
SMOOTH = [
    name
    for name in mbdae.model_names()
    if not any(SWITCHES.search(file.read_text()) for file in (models_directory() / name).glob("mechanism.*"))
]
