"""A report as one HTML page: text, tables, figures and the replay, without external resources."""

import base64
import json
from typing import TYPE_CHECKING

from markupsafe import Markup

from ...units import displayed, quantity, unit_name
from .. import figures
from ..comparison.figure import work_precision
from ..comparison.tables import comparison_rows
from ..drift.figure import drifts
from ..method_variant import run_labels
from ..order.figure import convergence
from ..replay.figure import posture
from ..replay.html_page import inline_frame
from ..replay.replay import page as replay_page
from ..replay.replay import playback_speed
from ..solve.figure import motion
from .report_tables import actuator_table, component_tables, downloads, ranking
from .templates import document, elements

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .report import Report

SECTIONS = ("Model", "Parts", "Run", "Drift", "Orders", "Ranking", "Comparison", "Repeat", "Data")


def page(report: "Report") -> str:
    """Return the page as text."""
    writers = (_model, _parts, _run, _drift, _orders, _ranking, _comparison, _repeat, downloads)
    bodies = {name: write(report) for name, write in zip(SECTIONS, writers, strict=True)}
    c, meta = report.card, report.meta
    backend = f"{report.sol.stats['backend']} back end on {meta['machine']}"
    summary = f"Degrees of freedom: {c.dof}. mbdae {meta['versions']['mbdae']}, {backend}, {meta['date']}."
    summary += f" Stopped by the user {report.without}." if report.missing else ""
    return document(c.title, summary, meta["versions"]["mbdae"], bodies)


def _parts(report: "Report") -> str:
    return component_tables(report.sol.mechanism)


def _ranking(report: "Report") -> str:
    return ranking(report.comparison) if report.comparison and report.comparison.points else ""


def _model(report: "Report") -> str:
    c = report.card
    note = "Reactions of dependent rows are not unique: lam has minimum norm." if c.ng > c.rank else ""
    picture = image(posture(report.sol), "the mechanism at the start of the run", small=True)
    return picture + elements().facts(c.facts()) + elements().note(note)


def _run(report: "Report") -> str:
    sol = report.sol
    speed = playback_speed(sol)
    ended, counts = map(str.strip, str(sol).splitlines())
    replay = Markup(inline_frame(replay_page(sol, fps=30.0, speed=speed), 660))
    text = elements().run(run_labels(sol)[1], ended, counts, speed)
    return text + replay + image(motion(sol), "motion over time") + actuator_table(sol)


def _drift(report: "Report") -> str:
    if not report.drifts:
        return ""
    headers = ["method", "max |g|", "|g| at the end", "max |G v|", f"energy error ({unit_name('J')})", "relative",
             f"work ({unit_name('J')})"]  # fmt: skip
    rows = [
        [h.label, *map(d.formatted, ("g_max", "g_end", "Gv_max")), f"{displayed(d.energy_error, 'J')[0]:.1e}"]
        + [f"{d.energy_relative:.1e}", f"{displayed(d.work_end, 'J')[0]:.4g}"]
        for h, d in zip([d.history for d in report.drifts], report.drifts, strict=True)
    ]
    picture = image(drifts([d.history for d in report.drifts]), "drift of the closures and of the energy over time")
    return elements().captioned("Largest drift of the closures and of the energy", [headers, *rows]) + picture


def _orders(report: "Report") -> str:
    study = report.orders
    if study is None:
        return ""
    marks = {"holds": "holds", "misses": "fails"}
    headers, *body = study.cells()
    rows = [
        [name, *(elements().verdict(c, marks.get(s.verdict, "")) for c, s in zip(cells, row, strict=True))]
        for (name, *cells), row in zip(body, study.orders.values(), strict=True)
    ]
    end = quantity(study.T, "s", "g")
    caption = f"Observed (claimed) orders with fixed steps, T = {end}; an observed order may be 0.2 below its claim"
    remarks = elements().note("; ".join(study.remarks()))
    return elements().captioned(caption, [headers, *rows]) + remarks + image(convergence(study), "convergence")


def _comparison(report: "Report") -> str:
    result = report.comparison
    if result is None or not result.points:
        return ""
    headers, rows = comparison_rows(result)
    text = elements().comparison(result.trust, result.computed_by)
    picture = image(work_precision(result), "work-precision diagram")
    return text + picture + elements().ranking() + elements().captioned("Every run", [headers, *rows])


def _repeat(report: "Report") -> str:
    meta = report.meta
    known = {
        "command": meta["command"],
        "parameters": json.dumps(meta["parameters"]),
        "versions": ", ".join(f"{name} {number}" for name, number in meta["versions"].items()),
        "machine": meta["machine"],
        "date": meta["date"],
    }
    description = json.dumps(report.mechanism, indent=1)
    return elements().facts(known) + elements().details("The mechanism as it was read", description)


def image(figure: "Figure", caption: str, *, small: bool = False) -> str:
    """Return a figure as HTML with its caption; ``small`` for a width that fits a phone."""
    return elements().image(base64.b64encode(figures.svg(figure)).decode(), caption, small)
