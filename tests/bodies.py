"""Mechanisms of a few bodies with closures, built from tables as in a file."""

import json

import numpy as np

import mbdae


def body(name="body", joint="free", parent="world", mass=1.0, inertia=0.004, **more):
    """Return the table of a body; its inertia is one moment about all axes, or six entries."""
    moments = [inertia] * 3 + [0.0] * 3 if np.isscalar(inertia) else inertia
    return {"name": name, "parent": parent, "joint": joint, "mass": mass, "inertia": moments, **more}


def load(folder, bodies, closures, **tables):
    """Return the mechanism of bodies, closures and further tables, from a file written into a folder."""
    path = folder / "made.py"
    tables = {"body": bodies, "closure": [c.model_dump(mode="json", exclude_none=True) for c in closures], **tables}
    text = json.dumps(tables, default=float)
    path.write_text(f"import json\n\n\ndef mechanism() -> dict:\n    return json.loads({text!r})\n")
    return mbdae.load(path)
