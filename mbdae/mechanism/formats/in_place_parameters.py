"""Parameters written in place: they change values in the core, not the geometry, so that runs share a workspace."""

from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import Mapping, Sequence
from math import nan
from typing import Any

import numpy as np

from ...backend import load
from ...data_types import Columns, CoreData
from ...errors import MbdaeError
from ...system import Array
from ...tolerances import COINCIDENT
from ..checked_table import HUGE
from ..equations.characteristic_length import linkage_lengths
from ..forces import FMU, bind_forces, named_force
from ..forces.elements import ForceElements
from ..formulations.core_description import laws_of, samplers_of
from ..formulations.workspace_pool import WorkspacePool
from ..mechanism import Mechanism
from ..tree.tree_terms import copy_model, flexible_bodies
from ..variant import SWITCHED, variant
from .body_tables import Body
from .mechanism_file.build import body_inertia
from .mechanism_file.loaded_model import joint_entry
from .mechanism_file.table_entries import first_key, with_entries
from .mechanism_file.template import Template

INERTIAL = ("mass", "com", "inertia")  # keys of bodies
ASYMMETRIC = {"mass": 2.0, "com": (0.1, 0.2, 0.3), "inertia": (3.0, 4.0, 5.0, 0.1, 0.2, 0.3)}
UPPER = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))  # entries of an inertia in the core
VALUE_KEYS = ("a", "offset")  # keys of the values of a law in the core
Values = Mapping[str, Any]


class _ParametrizedElement(ABC):
    """Gravity, a body or the forces of a mechanism: values in the core that parameters determine.

    Attributes:
        paths: paths within its table, by parameter.
        locations: locations of the values in the core, see `native/run/in_place_parameters.hpp`.
        entries: indices of the values that are entries of the table, by path.
    """

    entries: Mapping[str, int] = {}

    def __init__(self, locations: list[CoreData]) -> None:
        self.locations, self.paths = locations, dict[str, str]()

    @abstractmethod
    def evaluate(self, values: Values) -> list[float] | None:
        """Return the core values for values of parameters; None if the core data also change otherwise.

        Raises:
            MbdaeError: for invalid values.
        """

    def rows(self, columns: Columns, valid: Values) -> Array:
        """Return the core values (k, n) of k runs; nan where `evaluate` fails; it must succeed for ``valid`` values."""
        if set(self.paths.values()) <= self.entries.keys():
            found = {self.entries[path]: [*map(_number, columns[name])] for name, path in self.paths.items()}
            out = np.tile(self._row(valid), (len(next(iter(found.values()))), 1))
            for i, column in found.items():
                out[:, i] = column
            return out
        names = [*self.paths]
        rows = zip(*(columns[name] for name in names), strict=True)
        return np.array([self._row(dict(zip(names, row, strict=True))) for row in rows], float)

    def _row(self, values: Values) -> list[float]:
        try:
            found = self.evaluate(values) or []
        except MbdaeError:
            found = []
        return [*map(_number, found)] if len(found) == len(self.locations) else [nan] * len(self.locations)

    def changed(self, table: Any, values: Values) -> Any:
        """Return a copy of a table with values of parameters."""
        return with_entries(table, {name: (path, values[name]) for name, path in self.paths.items()})


def _location(kind: str, owner: int, i: int) -> CoreData:
    return {"kind": kind, "of": owner, "i": i}


def _number(x: object) -> float:
    """Return a number of a table; nan if it is invalid."""
    return x if type(x) in (int, float) and abs(x) <= HUGE else nan  # type: ignore[arg-type, return-value]


class _Gravity(_ParametrizedElement):
    entries: Mapping[str, int] = {str(i): i for i in range(3)}

    def __init__(self, gravity: Array) -> None:
        super().__init__([_location("gravity", 0, i) for i in range(3)])
        self.gravity = tuple(gravity.tolist())

    def evaluate(self, values: Values) -> list[float] | None:
        return list(self.changed(self.gravity, values))


class _BodyInertia(_ParametrizedElement):
    entries: Mapping[str, int] = {"mass": 0, **{f"com.{i}": 1 + i for i in range(3)}}

    def __init__(self, owner: str, body: Body, joint: int) -> None:
        super().__init__([_location("body", joint, i) for i in range(10)])
        self.owner, self.body, self.joint = owner, body, joint

    def evaluate(self, values: Values) -> list[float] | None:
        found = body_inertia(self.changed(self.body, values))
        return None if found is None else [found.mass, *found.lever.tolist(), *(float(found.inertia[i]) for i in UPPER)]


class _Forces(_ParametrizedElement):
    """All values of all laws, since linear laws are combined; ``paths`` begin with the index of a force."""

    def __init__(self, mech: Mechanism) -> None:
        self.mech, self.data = mech, mech.make_workspace()
        bound = bind_forces(mech.forces, mech.model, self.data)
        self.laws, self.states = [law for law, _ in bound.bound], bound.states()
        self.structure, laws = _structure_and_values(bound)
        super().__init__([_location("law", k, i) for k, law in enumerate(laws) for i in range(len(law))])

    def evaluate(self, values: Values) -> list[float] | None:
        laws, groups = list(self.laws), defaultdict[int, dict[str, tuple[str, Any]]](dict)
        for name, path in self.paths.items():
            index, _, key = path.partition(".")
            groups[int(index)][name] = key, values[name]
        for i, entries in groups.items():
            force: Any = named_force(with_entries(self.mech.forces[i], entries), i)
            laws[i] = force.bind(self.mech.model, self.data)
        bound = ForceElements(laws, self.mech.model)
        structure, found = _structure_and_values(bound)
        same = structure == self.structure and bound.states() == self.states
        return [x for law in found for x in law] if same else None


def _structure_and_values(laws: ForceElements) -> tuple[Any, list[list[float]]]:
    """Return the structure, core data without values of laws, and the values of each law."""
    pairs, found = laws_of(laws)
    numbers = [[*map(float, law.get("a", ())), float(law.get("offset", 0.0))] for law in found]
    structure = [{key: x for key, x in law.items() if key not in VALUE_KEYS} for law in found]
    return (pairs, structure, samplers_of(laws)), numbers


class InPlaceParameters:
    """Parameters of a mechanism that are written in place: they determine gravity, inertias of bodies, or forces.

    Attributes:
        mech: a copy of the mechanism, into whose core they are written: it belongs to one thread.
        locations: locations of the values in the core.
        bodies: elements with inertias.
    """

    def __init__(self, mech: Mechanism, elements: Sequence[_ParametrizedElement], values: Values) -> None:
        self.mech, self.elements, self.values = mech, elements, values
        self.locations = [x for element in elements for x in element.locations]
        self.bodies = [element for element in elements if isinstance(element, _BodyInertia)]
        self.largest = max(linkage_lengths(mech), default=0.0) / COINCIDENT

    def rows(self, columns: Columns) -> Array:
        """Return the core values (k, n) for the parameters in k runs; nan where a new mechanism must be created.

        A new mechanism reports errors of invalid values, and is needed for values that change the structure.
        """
        found = [element.rows(columns, self.values) for element in self.elements]
        valid = np.ones(len(found[0]), bool)
        for element, x in zip(self.elements, found, strict=True):
            valid &= np.isfinite(x).all(axis=1)
            if isinstance(element, _BodyInertia):  # its size must not determine the characteristic length
                with np.errstate(all="ignore"):
                    radii = np.sqrt(np.abs(x[:, 4:]).max(axis=1) / x[:, 0])
                size = np.maximum(np.linalg.norm(x[:, 1:4], axis=1), radii)
                valid &= (x[:, 0] > 0) & ((size < self.largest) | (size == 0))
        return np.where(valid[:, None], np.hstack(found), nan)


def in_place_parameters(template: Template, names: Sequence[str], values: Values) -> InPlaceParameters | None:
    """Return parameters that can be written in place; None if a parameter also changes other data.

    Args:
        template: a mechanism and its parameters.
        names: names of the parameters that vary, without start values.
        values: values of all parameters, for which the mechanism can be created.

    Raises:
        UnknownNameError, InputError: as `Template.make`.
    """
    if any(a != b and a.startswith(f"{b}.") for a in values for b in values):
        return None
    made = template.make(values)
    mech = variant(made, model=copy_model(made.model))
    mech.workspaces = WorkspacePool(mech)  # not shared with variants, which other threads would bind
    elements = _elements(template, mech, names, values)
    if not elements:
        return None
    out = InPlaceParameters(mech, elements, values)
    if out.bodies and not _has_mass_matrices_in_core(made):
        return None
    first = out.rows({name: [values[name]] for name in names})
    return out if np.isfinite(first).all() and _are_single_bodies(template, out, values) else None


def _elements(
    template: Template, mech: Mechanism, names: Sequence[str], values: Values
) -> list[_ParametrizedElement] | None:
    """Return the elements that parameters determine; None if a parameter also changes other data."""
    bodies = _bodies(template, mech, values)
    found: dict[str, _ParametrizedElement] = {}
    for name in names:
        table, _, path = name.partition(".")
        if table == "gravity":
            found.setdefault(table, _Gravity(mech.gravity)).paths[name] = path
        elif table == "force" and (force_path := _path_of_force(mech, name)):
            (found[table] if table in found else found.setdefault(table, _Forces(mech))).paths[name] = force_path
        elif name not in template.parameters and (owner := next((x for x in bodies if name in bodies[x].paths), "")):
            found[owner] = bodies[owner]
        else:
            return None
    return [*found.values()]


def _path_of_force(mech: Mechanism, name: str) -> str:
    """Return the index of a force and the path within it; "" for a force with modes or user functions."""
    i, path = first_key(mech.forces, name.partition(".")[2], name)
    unsupported = callable(mech.forces[int(i)]) or isinstance(mech.forces[int(i)], (*SWITCHED, FMU))
    return "" if unsupported else f"{i}.{path}"


def _bodies(template: Template, mech: Mechanism, values: Values) -> dict[str, _BodyInertia]:
    """Return the bodies with inertia parameters, by the prefix of the names of their parameters."""
    out, spec = dict[str, _BodyInertia](), template.spec(values)
    for name in values:
        table, _, path = name.partition(".")
        if table == "joint":
            body, rest = joint_entry(spec, path)
        elif table == "body":
            i, rest = first_key(spec.file.body, path, name)
            body = spec.file.body[int(i)]
        else:
            continue
        joint, owner = path.removesuffix(f".{rest}"), name.removesuffix(f".{rest}")
        if rest.partition(".")[0] in INERTIAL and mech.model.existJointName(joint):
            element = out.setdefault(owner, _BodyInertia(owner, body, mech.model.getJointId(joint)))
            element.paths[name] = rest
    return out


def _has_mass_matrices_in_core(mech: Mechanism) -> bool:
    native = load()
    return native is not None and not flexible_bodies(mech.model) and mech.workspaces.supported_by(native)


def _are_single_bodies(template: Template, found: InPlaceParameters, values: Values) -> bool:
    """Return whether the joints carry only the bodies whose inertia parameters change, in their frames.

    The inertia of a joint is a sum of transformed inertias; this checks that it equals that of a single test body
    without symmetries.
    """
    owners = [element.owner for element in found.bodies]
    if not owners:
        return True
    given = {name: x for name, x in values.items() if not any(name in element.paths for element in found.bodies)}
    given |= {f"{owner}.{key}": x for owner in owners for key, x in ASYMMETRIC.items()}
    made = template.make(given).model
    expected = body_inertia(Body(name="body", parent="", **ASYMMETRIC))
    return all(made.inertias[element.joint] == expected for element in found.bodies)
