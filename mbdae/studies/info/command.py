"""Sub-commands ``info`` and ``models``."""

from collections.abc import Mapping
from typing import Any

import click

from ... import backend
from ...cli.completion import completed, problems
from ...cli.model import chosen_model, set_option, start_option
from ...cli.options import SHARED
from ...cli.output import emit, print_table
from ...discovery import model_names
from ...errors import InputError


@click.command()
@click.argument("model", required=False, shell_complete=completed(problems))
@start_option
@set_option
@SHARED["units"]
@SHARED["json"]
def info(model: str | None, started: tuple[str, ...], chosen: tuple[str, ...], as_json: bool) -> None:
    """Show versions and the back end, or a model's card.

    The card has sizes, joints, closures, degrees of freedom, start, and what is not modelled; for a textbook problem
    its equations.
    """
    from .info import info as study

    found = study(chosen_model(model, started, chosen).problem() if model else None)
    used = backend.status()
    emit({**found.to_dict(), "backend": used}, f"{found}\nback end: {used}" if model else str(found), as_json)


@click.command()
@click.option("--textbook", is_flag=True, help="List textbook problems instead, for solve, order and drift.")
@SHARED["json"]
def models(textbook: bool, as_json: bool) -> None:
    """List the models that come with mbdae."""
    from ...textbook.problems import TEXTBOOK

    if textbook:
        problems = [(name, make()) for name, make in TEXTBOOK.items()]
        print_table([{"name": n, "title": p.title, "ny": len(p.y0), "nz": len(p.z0)} for n, p in problems], as_json)
        return
    print_table([_row(name, as_json) for name in model_names()], as_json)


def _row(name: str, as_json: bool) -> dict[str, Any]:
    """Return the sizes of a model; instead of its title, the reason why it cannot be loaded here."""
    from ...mechanism import load
    from .card import card

    try:
        m = load(name)
    except InputError as e:  # robots of a package that is not installed
        return {"name": name, "title": str(e)} | dict.fromkeys(("nq", "nv", "ng", "dof", "parameters"))
    sizes = {"nq": m.nq, "nv": m.nv, "ng": m.ng, "dof": card(m).dof}
    return {"name": name, "title": m.title, **sizes, "parameters": _parameters(m.source or {}, as_json) or None}


def _parameters(source: Mapping[str, Any], complete: bool) -> str:
    """Return the names of parameters, with their valid values if ``complete``."""
    listed = [(p["name"], p["takes"]) for p in source["parameters"]]
    return "; ".join(f"{name}: {takes}" for name, takes in listed) if complete else ", ".join(n for n, _ in listed)
