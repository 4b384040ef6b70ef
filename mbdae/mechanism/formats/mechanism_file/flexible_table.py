"""Flexible bodies of mechanism files: beams from keys, other bodies from files."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ....errors import InputError, UnknownNameError
from ...allowed_paths import AllowedPaths
from ...flexible import ModalBody, beam
from ...flexible.modal_data import modal_body_from_data, read_modal_data
from ..body_tables import BEAM, Flexible


def with_data(tables: Sequence[Flexible], path: Path) -> tuple[Flexible, ...]:
    """Return tables with the data of the files they name.

    Saved runs contain the data, not the files; ``path`` is the path of the mechanism file.

    Raises:
        InputError: for a missing or invalid file.
    """
    if not tables:
        return ()
    paths = AllowedPaths.from_model_file(path)
    return tuple(
        x.model_copy(update={"data": read_modal_data(paths.find(x.file))}) if x.file and x.data is None else x
        for x in tables
    )


def modal_body_of(table: Flexible) -> ModalBody:
    """Return the body of a table.

    Raises:
        UnknownNameError: for unknown ends, plane or load.
        InputError: for invalid numbers.
    """
    if table.data is not None:
        return modal_body_from_data(table.data, table.name, table.modes, table.damping)
    given = {name: x for name in BEAM if (x := getattr(table, name)) is not None}
    if not table.polar_moment and _rotates_about_x(table):
        given["polar_moment"] = float(np.broadcast_to(given["second_moment"], 2).sum())
    try:
        return beam(**given, nodes=table.nodes or None)
    except UnknownNameError as e:
        raise UnknownNameError(f"{e.kind} of flexible body {table.name!r}:", e.name, e.valid) from None
    except InputError as e:
        text = str(e).removeprefix("flexible body: ").removeprefix("beam: ")
        raise InputError(f"flexible body {table.name!r}: {text}") from None


def _rotates_about_x(table: Flexible) -> bool:
    """Return whether rotations of the joint have a component about the axis of the beam, which needs inertia."""
    return table.joint in ("free", "spherical") or (table.joint == "revolute" and table.axis[0] != 0)
