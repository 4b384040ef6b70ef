"""A fit as one HTML page: values, warnings, measured against computed signals, correlations."""

import numpy as np

from ..report.page import image
from ..report.report import provenance
from ..report.templates import document, elements
from .figure import compared
from .result import Fit


def page(fit: Fit) -> str:
    """Return the page as text, in the style of `mbdae.studies.report`."""
    meta = provenance({})
    version = meta["versions"]["mbdae"]
    summary = f"{len(fit.names)} runs measured, {fit.runs} computed. mbdae {version}, {meta['date']}."
    warnings = fit.warnings or ["no warnings"]
    quality = {
        "chi-squared": f"{fit.chi2:.6g} for {fit.dof} degrees of freedom, {fit.reduced_chi2:.4g} each",
        "probability": "unknown without noise levels" if np.isnan(fit.probability) else f"{fit.probability:.3g}",
        "warnings": "\n".join(warnings),
    }
    sections = {
        "Values": _values(fit) + elements().facts(quality),
        "Signals": image(compared(fit), "measured and computed signals, and residuals"),
        "Correlations": _correlations(fit) if len(fit.values) > 1 else "",
        "Searches": _searches(fit) if len(fit.searches) > 1 else "",
        "Repeat": elements().facts({"command": meta["command"], "machine": meta["machine"]}),
    }
    return document(f"Fit of {fit.model}", summary, version, sections)


def _values(fit: Fit) -> str:
    rows = [
        [name, f"{x:.8g}", f"{d:.2g}", unit, "at its bound" if name in fit.at_bounds else ""]
        for name, (x, d, unit) in ((name, fit.displayed(name)) for name in fit.values)
    ]
    return elements().captioned("Values", [["parameter", "value", "standard deviation", "unit", ""], *rows])


def _correlations(fit: Fit) -> str:
    names = list(fit.values)
    cells = [["-" if np.isnan(x) else f"{x:+.3f}" for x in row] for row in fit.correlations]
    rows = [[n, *row] for n, row in zip(names, cells, strict=True)]
    return elements().captioned("Correlations of the parameters", [["", *names], *rows])


def _searches(fit: Fit) -> str:
    units = {name: fit.displayed(name)[2] for name in fit.values}
    named = [f"{name} ({unit})" if unit else name for name, unit in units.items()]
    headers = [*(f"{name}, start" for name in named), *named, "chi-squared", ""]
    rows = [
        [f"{fit.displayed(name, x)[0]:.6g}" for name, x in s.start.items()]
        + ([f"{fit.displayed(name, x)[0]:.6g}" for name, x in s.values.items()] or ["-"] * len(fit.values))
        + [f"{s.chi2:.6g}", "" if s.converged else s.message]
        for s in sorted(fit.searches, key=lambda s: s.chi2)
    ]
    return elements().captioned("Searches, the best first", [headers, *rows])
