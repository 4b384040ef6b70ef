"""Core data of the parameters of a mechanism."""

from typing import TYPE_CHECKING, Any, NamedTuple

from ...data_types import CoreData
from ...finite_differences import weights
from ..forces.force import PairElement
from ..formulations.core_description import constraints_of, laws_of
from ..tree.frames import Pair, find_frame
from ..tree.tree_terms import flexible_bodies
from .parameter_direction import Parameter
from .parameter_partials import Parameters

if TYPE_CHECKING:
    from ..._native import Parameters as NativeParameters
    from ..formulations.compiled_systems import CompiledSystem
    from ..formulations.index2 import Index2System

ParameterData = tuple[list[CoreData], list[CoreData], list[CoreData]]  # components, directions, changed elements


class ModelComponent(NamedTuple):
    """A component of a model that parameters can change.

    Attributes:
        kind: inertia, placement, frame, gravity or armature.
        id: the joint of the body or of the placement; or the index of a pair of frames.
        of_law: whether the pair belongs to a law.
        second: whether it is the pair's second frame.
    """

    kind: str
    id: int = 0
    of_law: bool = False
    second: bool = False


def bind_parameters(system: "CompiledSystem", parameters: Parameters) -> "NativeParameters":
    """Return parameters bound to the core of their mechanism.

    Raises:
        NotCompiled: for laws or rows that the core does not support.
    """
    system.expand()
    data = parameters.cached("core data", parameters.system.mode, lambda: _core_data(parameters))
    key = system.core, parameters.system.mode
    return parameters.cached("native", key, lambda: system.core.bind_parameters(len(parameters), *data))


def _core_data(parameters: Parameters) -> ParameterData:
    """Return the changed components, the change by each parameter, and perturbed laws and rows."""
    indices: dict[ModelComponent, int] = {}
    directions: list[CoreData] = []
    anchors = _anchors(parameters.system)
    for i, p in enumerate(parameters.all):
        for component, x in _changed_components(p, anchors):
            k = indices.setdefault(component, len(indices))
            directions.append({"parameter": i, "component": k, "x": x.tolist()})
    changed: list[CoreData] = []
    bodies = flexible_bodies(parameters.system.model)
    for i, (p, laws, rows) in enumerate(zip(parameters.all, parameters.laws, parameters.rows, strict=True)):
        if laws.perturbed:
            factors = weights(laws.perturbed, p.h)
            elements = [_perturbed(factors[k], ("pairs", "laws"), laws_of(x)) for k, x in laws.perturbed.items()]
            changed.append({**_element(i), "at": laws.indices.tolist(), "laws": elements})
        if rows.perturbed:
            factors = weights(p.stencil, p.h)
            keys = "pairs", "rows", "drivers"
            elements = [_perturbed(factors[k], keys, constraints_of(x)) for k, x in rows.perturbed.items()]
            changed.append({**_element(i), "at": rows.indices.tolist(), "rows": elements})
        if p.modal:
            rate_bodies = [bodies[k].with_modal(rates).core_data(p.mech.model) for k, rates in p.modal.items()]
            changed.append({**_element(i), "bodies": rate_bodies})
    for i, p in enumerate(parameters.all):  # last: these elements set velocities to 0, and laws need them
        if bodies and p.gravity.any():
            unchanged = [body.core_data(p.mech.model) for body in bodies]
            changed.append({**_element(i), "bodies": unchanged, "gravity": p.gravity.tolist()})
    return [component._asdict() for component in indices], directions, changed


def _element(parameter: int) -> CoreData:
    """Return an empty change by a parameter; if it has gravity, only the weight of the bodies changes."""
    return {"parameter": parameter, "at": [], "laws": [], "rows": [], "bodies": [], "gravity": []}


def _perturbed(weight: float, keys: tuple[str, ...], elements: tuple[list[Any], ...]) -> CoreData:
    """Return perturbed laws, or rows and drivers, whose weighted sum is a difference quotient."""
    empty: CoreData = {"pairs": [], "laws": [], "rows": [], "drivers": []}
    return {"weight": weight, **empty, **dict(zip(keys, elements, strict=True))}


def _changed_components(p: Parameter, anchors: dict[int, list[ModelComponent]]) -> list[tuple[ModelComponent, Any]]:
    """Return the components that a parameter changes, and the changes."""
    out: list[tuple[ModelComponent, Any]] = [(ModelComponent("inertia", j), x) for j, x in p.inertias.items()]
    out += [(ModelComponent("placement", j), x) for j, x in p.placements.items()]
    out += [(component, x) for i, x in p.frames.items() for component in anchors.get(i, ())]
    out += [(ModelComponent(kind), x) for kind, x in (("gravity", p.gravity), ("armature", p.armature)) if x.any()]
    return out


def _anchors(system: "Index2System") -> dict[int, list[ModelComponent]]:
    """Return the anchors of pairs that are fixed to each frame of the model."""
    model = system.model
    out: dict[int, list[ModelComponent]] = {}
    frames = list(model.frames)

    def add_frames(index: int, pair: Pair, of_law: bool) -> None:
        for a, second in ((pair.a, False), (pair.b, True)):
            out.setdefault(frames.index(find_frame(model, a.name)), []).append(
                ModelComponent("frame", index, of_law, second)
            )

    for i, (pair, _) in enumerate(system.constraints.frame_rows.values()):
        add_frames(i, pair, False)
    for i, law in enumerate([law for law, _ in system.laws.acting if isinstance(law, PairElement)]):
        add_frames(i, law.pair, True)
    return out
