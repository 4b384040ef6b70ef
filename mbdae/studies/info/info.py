"""Versions and the back end; the card of a mechanism; sizes and equations of a textbook problem."""

from dataclasses import asdict, dataclass
from inspect import getdoc

from ... import backend
from ...data_types import JsonObject
from ...mechanism import Mechanism, ModelSource
from ...solution.problem import problem_of
from ...solution.provenance import versions
from ...solution.solution import Problem
from ...textbook.hessenberg import Hessenberg
from ...textbook.problems import TEXTBOOK
from .card import Card, card

__all__ = ["info"]


@dataclass(frozen=True)
class Installation:
    """Result of `info` without a model.

    Attributes:
        versions: versions of mbdae and of its numerical packages, by name.
        backend: ``native`` or ``python``, with the reason.
    """

    versions: dict[str, str]
    backend: str

    def to_dict(self) -> JsonObject:
        """Return JSON data."""
        return asdict(self)

    def __str__(self) -> str:
        return "\n".join([*(f"{name} {x}" for name, x in self.versions.items()), f"back end: {self.backend}"])


@dataclass(frozen=True)
class TextbookCard:
    """Result of `info` for a textbook problem.

    Attributes:
        title: title of the problem.
        ny: length of y.
        nz: length of z.
        duration: default end time of a run in s.
        exact: whether the solution is known.
        equations: the docstring of the problem; empty for one that does not come with mbdae.
    """

    title: str
    ny: int
    nz: int
    duration: float
    exact: bool
    equations: str

    def to_dict(self) -> JsonObject:
        """Return JSON data, without the equations."""
        data = asdict(self)
        del data["equations"]
        return data

    def __str__(self) -> str:
        known = "known" if self.exact else "not known"
        sizes = f"  ny {self.ny}, nz {self.nz}, t = {self.duration:g} s, exact solution {known}"
        about = [f"  {line}".rstrip() for line in self.equations.splitlines()]
        return "\n".join([self.title, sizes, "", *about, ""])


def info(problem: Problem | ModelSource | None = None) -> Card | TextbookCard | Installation:
    """Return versions and the back end, or the card of a model.

    Args:
        problem: a mechanism, a textbook problem, or the name or path of one; versions when left out.

    Returns:
        For a mechanism, at its start state: sizes, rank r of G and degrees of freedom nv - r, joints, closures, forces,
        and what is not modelled.

    Raises:
        AssemblyError: if the start cannot be assembled.
        InputError: for anything but a problem.
        UnknownNameError: for a model that does not exist, or for an unknown method in its file.
    """
    if problem is None:
        return Installation(versions(), backend.status())
    found = problem_of(problem, "info")
    return card(found) if isinstance(found, Mechanism) else _textbook(found)


def _textbook(problem: Hessenberg) -> TextbookCard:
    equations = getdoc(TEXTBOOK[problem.name]) if problem.name in TEXTBOOK else None
    sizes = len(problem.y0), len(problem.z0), problem.duration
    return TextbookCard(problem.title, *sizes, problem.exact is not None, equations or "")
