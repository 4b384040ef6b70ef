"""The sub-commands ``info`` and ``models``: what there is."""

from inspect import getdoc
from typing import Any

import click

from ... import backend
from ...cli.completion import completed, problems
from ...cli.model import ChosenModel, chosen_model, set_option, start_option
from ...cli.options import as_json, emit, show
from ...discovery import model_names


@click.command()
@click.argument("model", required=False, shell_complete=completed(problems))
@start_option
@set_option
@as_json
def info(model: str | None, started: tuple[str, ...], chosen: tuple[str, ...], as_json: bool) -> None:
    """Show versions and the back end, or a model's card.

    The card has sizes, joints, closures, degrees of freedom, start, and what is not modelled; of a textbook problem
    its equations.
    """
    from ...solution.archive import versions
    from .card import card

    if model:
        found = chosen_model(model, started, chosen)
        if found.textbook:
            data, lines = _textbook(found)
        else:
            result = card(found.load())
            data, lines = result.to_dict(), [str(result)]
    else:
        data = {"versions": versions()}
        lines = [f"{name} {version}" for name, version in data["versions"].items()]
    emit({**data, "backend": backend.status()}, "\n".join([*lines, f"back end: {backend.status()}"]), as_json)


def _textbook(model: ChosenModel) -> tuple[dict[str, Any], list[str]]:
    """Sizes of a textbook problem, and what its function says of it."""
    from ...textbook.problems import TEXTBOOK

    problem: Any = model.problem()
    sizes = {"ny": len(problem.y0), "nz": len(problem.z0), "duration": problem.duration}
    known = "known" if problem.exact else "not known"
    said = f"  ny {sizes['ny']}, nz {sizes['nz']}, t = {problem.duration:g} s, exact solution {known}"
    about = [f"  {line}".rstrip() for line in (getdoc(TEXTBOOK[problem.name]) or "").splitlines()]
    return {"title": problem.title, **sizes, "exact": problem.exact is not None}, [problem.title, said, "", *about, ""]


@click.command()
@click.option("--textbook", is_flag=True, help="List textbook problems instead, for run, order and drift.")
@as_json
def models(textbook: bool, as_json: bool) -> None:
    """List the models that come with mbdae."""
    from ...mechanism import load
    from ...textbook.problems import TEXTBOOK

    if textbook:
        problems = [(name, make()) for name, make in TEXTBOOK.items()]
        show([{"name": n, "title": p.title, "ny": len(p.y0), "nz": len(p.z0)} for n, p in problems], as_json)
        return
    rows = [(name, load(name)) for name in model_names()]
    data = [
        {
            "name": n,
            "title": m.title,
            "nq": m.nq,
            "nv": m.nv,
            "ng": m.ng,
            "parameters": "; ".join(f"{p['name']}: {p['takes']}" for p in (m.source or {})["parameters"]) or None,
        }
        for n, m in rows
    ]
    show(data, as_json)
