"""Tables of a report: components of the mechanism, ranking, data for download."""

import base64
import json
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel

from ...mechanism import Mechanism
from ...mechanism.tree.joints import file_kind
from ..comparison.comparison import SHOWN
from ..comparison.ranking import RankingEntry
from .templates import elements

if TYPE_CHECKING:
    from ..comparison.comparison import Comparison
    from .report import Report

MAX_BYTES = 2_000_000  # of an embedded file


def component_tables(mech: Mechanism) -> str:
    """Return tables of bodies, joints, closures and forces."""
    found = {
        "Bodies: mass, centre of mass in the frame of the joint, moments of inertia about it": _bodies(mech),
        "Joints, each with its parent": _joints(mech),
        "Closures and drivers": _closures(mech),
        "Forces": _forces(mech),
    }
    return elements().parts({caption: [heads, *rows] for caption, (heads, rows) in found.items() if rows})


def ranking(result: "Comparison") -> str:
    """Return methods over accuracies: the work of each for an error in q, the best of a column in bold."""
    goals, out = result.targets(), []
    for work in SHOWN:
        rankings = [{p.method: p for p in result.ranking(goal, work=work)} for goal in goals]
        best_work = [min((p.work for p in found.values() if p.work is not None), default=0.0) for found in rankings]
        rows = [
            [name, *(_cell(found[name], best) for found, best in zip(rankings, best_work, strict=True))]
            for name in result.methods
        ]
        if any(best_work):
            words = "seconds" if work == "seconds" else "linear solves"
            caption = f"Ranking: {words} for an error in q below the column heading (rad or m); -: not reached"
            out.append(elements().captioned(caption, [["method", *(f"{goal:.0e}" for goal in goals)], *rows]))
    return "".join(out)


def downloads(report: "Report") -> str:
    """Return links to files embedded in the page: the run, the comparison, and all results."""
    results = {"report.json": json.dumps(report.to_dict(), default=str).encode()}
    with tempfile.TemporaryDirectory() as folder:
        for name, result in (("run.csv", report.sol), ("comparison.csv", report.comparison)):
            if result:
                result.save(Path(folder, name))
                results[name] = Path(folder, name).read_bytes()
    files = [
        (
            name,
            f"{len(data) / 1e3:.0f}",
            "application/json" if name.endswith(".json") else "text/csv",
            base64.b64encode(data).decode() if len(data) <= MAX_BYTES else "",
        )
        for name, data in sorted(results.items())
    ]
    return elements().downloads(files)


def _bodies(mech: Mechanism) -> tuple[list[str], list[list[str]]]:
    heads = ["body of joint", "mass (kg)", "x", "y", "z (m)", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz (kg m^2)"]
    rows = []
    for i in range(1, mech.model.njoints):
        y = mech.model.inertias[i]
        upper = [y.inertia[a, b] for a, b in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
        rows.append([mech.model.names[i], *(f"{x:.5g}" for x in (y.mass, *y.lever, *upper))])
    return heads, rows


def _joints(mech: Mechanism) -> tuple[list[str], list[list[str]]]:
    rows = []
    for i in range(1, mech.model.njoints):
        joint, placement = mech.model.joints[i], mech.model.jointPlacements[i]
        parent = mech.model.names[mech.model.parents[i]] if mech.model.parents[i] else "the ground"
        rows.append([mech.model.names[i], file_kind(joint), parent, *(f"{x:.5g}" for x in placement.translation)])
    return ["joint", "kind", "on", "x", "y", "z (m)"], rows


def _closures(mech: Mechanism) -> tuple[list[str], list[list[str]]]:
    rows = []
    for c in mech.constraints:
        joined = getattr(c, "frames", None) or getattr(c, "joints", None) or (getattr(c, "joint", None) or "",)
        rows.append([c.name, getattr(c, "kind", "") or "driver", " - ".join(joined), str(c.m)])
    return ["name", "kind", "between", "rows"], rows


def _forces(mech: Mechanism) -> tuple[list[str], list[list[str]]]:
    rows = []
    for force in mech.forces:
        given: dict[str, Any] = force.model_dump(exclude_defaults=True) if isinstance(force, BaseModel) else {}
        keys = ", ".join(f"{k} = {_text(v)}" for k, v in given.items() if k not in ("name", "kind"))
        rows.append([getattr(force, "name", "") or str(force), getattr(force, "kind", "function"), keys])
    return ["name", "kind", "parameters"], rows


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_text, value)) + "]"
    return " ".join(f"{k} {_text(v)}" for k, v in value.items()) if isinstance(value, dict) else str(value)


def _cell(entry: RankingEntry, best: float) -> str:
    if entry.work is None:
        return "-"
    text = ("< " if entry.bound else "") + (f"{entry.work:.3g}" if entry.work < 100 else f"{entry.work:.0f}")
    return elements().best(text) if entry.work <= best else text
