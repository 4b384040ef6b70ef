"""A report as one HTML page: text, tables, figures and the replay, without external resources."""

import base64
import json
import re
from html import escape
from importlib.resources import files
from typing import TYPE_CHECKING

from .. import figures
from ..comparison.figure import work_precision
from ..comparison.tables import comparison_rows
from ..drift.drift import names_of_run
from ..drift.figure import drifts
from ..order.figure import convergence
from ..replay.figure import posture
from ..replay.html_page import frame
from ..replay.replay import pace
from ..replay.replay import page as replay_page
from ..solve.figure import motion
from .report_tables import captioned, downloads, parts, ranking

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


def document(title: str, summary: str, version: str, sections: dict[str, str]) -> str:
    """Return a page of all non-empty sections, HTML by heading, with a table of contents."""
    shown = {name: body for name, body in sections.items() if body}
    filling = {
        "version": version,
        "title": escape(title),
        "summary": escape(summary),
        "contents": "".join(f'<a href="#{name}">{name}</a>' for name in shown),
        "sections": "\n".join(f'<h2 id="{name}">{name}</h2>\n{body}' for name, body in shown.items()),
    }
    template = files(__package__).joinpath("report.htm").read_text("utf-8")
    return re.sub(r"{{(\w+)}}", lambda key: filling[key[1]], template)


def _parts(report: "Report") -> str:
    return parts(report.sol.mechanism)


def _ranking(report: "Report") -> str:
    return ranking(report.comparison) if report.comparison and report.comparison.points else ""


def _model(report: "Report") -> str:
    c = report.card
    note = "<p>Reactions of dependent rows are not unique: lam is the one of minimum norm.</p>" if c.ng > c.rank else ""
    picture = image(posture(report.sol), "the mechanism at the start of the run", small=True)
    return picture + facts(c.facts()) + note


def _run(report: "Report") -> str:
    sol = report.sol
    speed = pace(sol)
    slow = f" The replay runs at {speed:.2g} of real time." if speed < 1 else ""
    ended, counts = map(str.strip, str(sol).splitlines())
    text = f"<p>{escape(names_of_run(sol)[1])}: {escape(ended)}. {counts} back end.{slow}</p>"
    return text + frame(replay_page(sol, fps=30.0, speed=speed), 660) + image(motion(sol), "motion over time")


def _drift(report: "Report") -> str:
    if not report.drifts:
        return ""
    heads = ["method", "max |g|", "|g| at the end", "max |G v|", "energy error (J)", "relative", "work (J)"]
    rows = [
        [h.label, f"{d.g_max:.1e}", f"{d.g_end:.1e}", f"{d.Gv_max:.1e}", f"{d.energy_error:.1e}"]
        + [f"{d.energy_relative:.1e}", f"{d.work_end:.4g}"]
        for h, d in zip([d.history for d in report.drifts], report.drifts, strict=True)
    ]
    picture = image(drifts([d.history for d in report.drifts]), "drift of the closures and of the energy over time")
    return captioned("Largest drift of the closures and of the energy", heads, rows) + picture


def _orders(report: "Report") -> str:
    study = report.orders
    if study is None:
        return ""
    marks = {"holds": "holds", "misses": "fails"}
    heads, *body = study.cells()
    rows = [
        [name, *(f'<span class="{marks.get(s.verdict, "")}">{c}</span>' for c, s in zip(cells, row, strict=True))]
        for (name, *cells), row in zip(body, study.orders.values(), strict=True)
    ]
    caption = f"Observed (claimed) orders with fixed steps, T = {study.T:g} s; a slope holds at the claim less 0.2"
    excuse = f'<p class="note">{escape("; ".join(study.remarks()))}</p>' if study.remarks() else ""
    return captioned(caption, heads, rows, safe=True) + excuse + image(convergence(study), "convergence")


def _comparison(report: "Report") -> str:
    result = report.comparison
    if result is None or not result.points:
        return ""
    heads, rows = comparison_rows(result)
    text = (
        f"<p>Errors are the largest differences over common times to {escape(result.trust)}; "
        f"what is below five times that is marked &lt; and not known. All runs: {escape(result.computed_by)}.</p>"
    )
    ranking = "<li>Each point is one run; the section Ranking reads the work to an accuracy between them.</li>"
    picture = image(work_precision(result), "work-precision diagram")
    return text + picture + f'<ul class="note">{ranking}</ul>' + captioned("Every run", heads, rows)


def _repeat(report: "Report") -> str:
    meta = report.meta
    known = {
        "command": meta["command"],
        "parameters": json.dumps(meta["parameters"]),
        "versions": ", ".join(f"{name} {number}" for name, number in meta["versions"].items()),
        "machine": meta["machine"],
        "date": meta["date"],
    }
    whole = escape(json.dumps(report.mechanism, indent=1))
    return facts(known) + f"<details><summary>The mechanism as it was read</summary><pre>{whole}</pre></details>"


def facts(known: dict[str, str]) -> str:
    """Return facts as a table of two columns."""
    rows = (f"<tr><td>{escape(k)}</td><td>{escape(v).replace(chr(10), '<br>')}</td></tr>" for k, v in known.items())
    return f'<table class="facts">{"".join(rows)}</table>'


def image(figure: "Figure", words: str, *, small: bool = False) -> str:
    """Return a figure as HTML with its caption; a small one fits on a phone."""
    data = base64.b64encode(figures.svg(figure)).decode()
    width = ' class="small"' if small else ""
    picture = f'<div class="wide"><img{width} alt="{escape(words)}" src="data:image/svg+xml;base64,{data}"></div>'
    return f"<figure>{picture}<figcaption>{escape(words[:1].upper() + words[1:])}.</figcaption></figure>"
