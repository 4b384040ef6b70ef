"""Solutions in files: .npz holds everything and can be read again, .csv is a table of named columns."""

import csv
import json
import sys
import warnings
import zlib
from importlib.metadata import version
from pathlib import Path
from tokenize import TokenError
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

import numpy as np

from .errors import InputError
from .files import write_whole
from .mechanism import Singular, describe, restore

if TYPE_CHECKING:
    from .solution import Solution

FORMAT = 1
SUFFIXES = (".npz", ".csv")
DAMAGE = (
    OSError, ValueError, KeyError, EOFError, TypeError, AttributeError, RuntimeError, BadZipFile, zlib.error, TokenError
)  # fmt: skip


def versions() -> dict[str, str]:
    """Versions of mbdae and of what computes for it."""
    return {name: version(name) for name in ("mbdae", "pin", "numpy", "scipy")}


def write(sol: "Solution", path: str | Path) -> None:
    """Write a solution as .npz without pickles, or its `mbdae.columns.signals` as .csv.

    Raises:
        InputError: for a textbook problem, whose functions cannot be written, or an unwritable path.
    """
    if Path(path).suffix not in SUFFIXES:
        raise InputError(f"a solution is saved as {' or '.join(SUFFIXES)}, got {str(path)!r}")
    if Path(path).suffix == ".csv":
        _write_csv(sol.signals(), path)
        return
    meta = {
        "format": FORMAT,
        "mechanism": describe(sol.mechanism),
        "settings": sol.settings,
        "stats": sol.stats,
        "status": sol.status,
        "message": sol.message,
        "singular": [x.to_dict() for x in sol.singular],
        "in_use": sol.in_use,
        "versions": versions(),
        "command": sys.argv,
    }
    ts, ys, zs = sol.steps or (sol.t[:0], sol.y[:0], sol.z_own[:0])
    arrays = {"t": sol.t, "y": sol.y, "z_own": sol.z_own, "steps_t": ts, "steps_y": ys, "steps_z": zs}
    with write_whole(path) as temporary:
        np.savez_compressed(temporary, allow_pickle=False, meta=np.array(json.dumps(meta)), **arrays)


def _write_csv(columns: dict[str, np.ndarray], path: str | Path) -> None:
    with write_whole(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(columns)
        table.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))


def read(path: str | Path) -> dict[str, Any]:
    """Read a .npz file; returns the arguments of `mbdae.Solution`. A file of another mbdae is read with a warning.

    Raises:
        InputError: for a file that is missing, damaged, of another kind, or of a newer format.
    """
    try:
        with Path(path).open("rb") as stream, np.load(stream, allow_pickle=False) as file:
            data = {name: file[name] for name in file.files}
        meta = json.loads(str(data.pop("meta")))
        _check_version(path, meta)
        mechanism = restore(meta["mechanism"])
        width = mechanism.nq + mechanism.nv + len(mechanism.states) + 1
        for t, y, z in (("t", "y", "z_own"), ("steps_t", "steps_y", "steps_z")):
            _check_arrays(data[t], data[y], data[z], width)
        if not {"method", "dense_order"} <= meta["settings"].keys():
            raise ValueError("the settings of the run are missing")
        steps = (data["steps_t"], data["steps_y"], data["steps_z"]) if len(data["steps_t"]) else None
        arrays = {name: data[name] for name in ("t", "y", "z_own")}
        rest = {name: meta[name] for name in ("status", "message", "stats", "settings")}
        listed = [{**x, **{key: tuple(x[key]) for key in ("q", "v", "closures")}} for x in meta.get("singular", ())]
        passed = [Singular(**x) for x in listed]
        in_use = [(int(i), tuple(int(k) for k in rows)) for i, rows in meta.get("in_use", ())]
        if any(not 0 <= k < mechanism.ng for _, rows in in_use for k in rows):
            raise ValueError("rows in use that the mechanism does not have")
        return {"problem": mechanism, **arrays, **rest, "steps": steps, "singular": passed, "in_use": in_use}
    except InputError:
        raise
    except FileNotFoundError:
        raise InputError(f"no such file: {path}") from None
    except DAMAGE as e:
        reason = f"{type(e).__name__}: {str(e).splitlines()[0]}" if str(e) else type(e).__name__
        raise InputError(f"{path} is damaged or not a solution written by mbdae ({reason})") from None


def _check_arrays(t: np.ndarray, y: np.ndarray, z: np.ndarray, width: int) -> None:
    """Refuse what is not numbers for each time: t (n,), y (n, width), z (n, nz)."""
    if any(x.dtype.kind != "f" for x in (t, y, z)):
        raise ValueError("expected arrays of real numbers")
    if t.ndim != 1 or y.shape != (len(t), width) or z.ndim != 2 or len(z) != len(t):
        raise ValueError(f"arrays have shapes {t.shape}, {y.shape} and {z.shape}, expected (n,), (n, {width}), (n, nz)")


def _check_version(path: str | Path, meta: dict[str, Any]) -> None:
    written, here = meta["versions"]["mbdae"], version("mbdae")
    if meta["format"] != FORMAT:
        other = f"{path} was written by mbdae {written} in format {meta['format']}"
        raise InputError(f"{other}; this is mbdae {here}, which reads format {FORMAT}")
    if written != here:
        warnings.warn(f"{path} was written by mbdae {written}, and this is mbdae {here}", stacklevel=4)
