"""Tables of a report: components of the mechanism, ranking, data for download."""

import base64
import json
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from ...mechanism import Mechanism
from ...mechanism.checked_table import Table
from ...mechanism.closures.constraints import spec_kind
from ...mechanism.tree.joints import file_kind
from ...solution.solution import Solution
from ...solution.work_columns import elements_with_power, total_works
from ...tabular import rounded_zero
from ...units import displayed, unit_name
from ..comparison.comparison import SHOWN
from ..comparison.ranking import RankingEntry
from .parameter_text import parameter_texts
from .templates import elements

if TYPE_CHECKING:
    from ..comparison.comparison import Comparison
    from .report import Report

MAX_BYTES = 2_000_000  # size of an embedded file


def component_tables(mech: Mechanism) -> str:
    """Return tables of bodies, joints, closures and forces."""
    found = {
        "Bodies: mass, centre of mass in the frame of the joint, moments of inertia about it": _bodies(mech),
        "Joints, each with its parent": _joints(mech),
        "Closures and drivers": _closures(mech),
        "Forces": _forces(mech),
    }
    return elements().parts({caption: [headers, *rows] for caption, (headers, rows) in found.items() if rows})


def ranking(result: "Comparison") -> str:
    """Return a table of the work of each method for an error in q, with the best of each column in bold."""
    errors, out = result.targets(), []
    for work in SHOWN:
        rankings = [{p.method: p for p in result.ranking(error, work=work)} for error in errors]
        best_work = [min((p.work for p in found.values() if p.work is not None), default=0.0) for found in rankings]
        rows = [
            [name, *(_cell(found[name], best) for found, best in zip(rankings, best_work, strict=True))]
            for name in result.methods
        ]
        if any(best_work):
            unit_of_work = "seconds" if work == "seconds" else "linear solves"
            unit = " or ".join(unit_name(result.unit("q")).split(", "))
            caption = f"Ranking: {unit_of_work} for an error in q below the column heading ({unit}); -: not reached"
            shown = (displayed(error, result.unit("q"))[0] for error in errors)
            out.append(elements().captioned(caption, [["method", *(f"{error:.0e}" for error in shown)], *rows]))
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


def actuator_table(sol: Solution) -> str:
    """Return a table of power and work of forces and drivers over a run; "" if there are none."""
    names = elements_with_power(sol.mechanism)
    if not names:
        return ""
    found, works = sol.statistics([f"power.{name}" for name in names]), total_works(sol)
    duration, rows = abs(float(sol.nodes[0][-1] - sol.nodes[0][0])), []
    for name in names:
        power, sums = f"power.{name}", found.integrals[f"power.{name}"]
        values = (found.minimum[power].value, found.maximum[power].value, sums.mean)
        scale = abs(found.peak(power).value)
        work = displayed(rounded_zero(works[name], scale * duration), "J")[0]
        rows.append([name, *(f"{displayed(rounded_zero(x, scale), 'W')[0]:.5g}" for x in values), f"{work:.5g}"])
    headers = ["name", "least power", "largest power", f"mean ({unit_name('W')})", f"work ({unit_name('J')})"]
    return elements().captioned("Power and work of forces and drivers on the mechanism", [headers, *rows])


def _bodies(mech: Mechanism) -> tuple[list[str], list[list[str]]]:
    mass, length, inertia = map(unit_name, ("kg", "m", "kg m^2"))
    headers = ["body of joint", f"mass ({mass})", "x", "y", f"z ({length})", "Ixx", "Iyy", "Izz", "Ixy", "Ixz"]
    headers.append(f"Iyz ({inertia})")
    rows = []
    for i in range(1, mech.model.njoints):
        y = mech.model.inertias[i]
        upper = [y.inertia[a, b] for a, b in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
        numbers = zip((y.mass, *y.lever, *upper), ["kg"] + 3 * ["m"] + 6 * ["kg m^2"], strict=True)
        rows.append([mech.model.names[i], *(f"{displayed(x, unit)[0]:.5g}" for x, unit in numbers)])
    return headers, rows


def _joints(mech: Mechanism) -> tuple[list[str], list[list[str]]]:
    rows = []
    for i in range(1, mech.model.njoints):
        joint, placement = mech.model.joints[i], mech.model.jointPlacements[i]
        parent = mech.model.names[mech.model.parents[i]] if mech.model.parents[i] else "the ground"
        position = displayed(placement.translation, "m")[0]
        rows.append([mech.model.names[i], file_kind(joint), parent, *(f"{x:.5g}" for x in position)])
    return ["joint", "kind", "on", "x", "y", f"z ({unit_name('m')})"], rows


def _closures(mech: Mechanism) -> tuple[list[str], list[list[str]]]:
    rows = [[c.name, spec_kind(c), " - ".join(c.between), str(c.m)] for c in mech.constraints]
    return ["name", "kind", "between", "rows"], rows


def _forces(mech: Mechanism) -> tuple[list[str], list[list[str]]]:
    rows = []
    for force in mech.forces:
        given = parameter_texts(mech, force) if isinstance(force, Table) else {}
        keys = ", ".join(f"{k} = {text}" for k, text in given.items() if k not in ("name", "kind"))
        rows.append([getattr(force, "name", "") or str(force), getattr(force, "kind", "function"), keys])
    return ["name", "kind", "parameters"], rows


def _cell(entry: RankingEntry, best: float) -> str:
    if entry.work is None:
        return "-"
    text = ("< " if entry.bound else "") + (f"{entry.work:.3g}" if entry.work < 100 else f"{entry.work:.0f}")
    return elements().best(text) if entry.work <= best else text
