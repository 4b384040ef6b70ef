"""Core data of the parameters of a mechanism."""

from typing import TYPE_CHECKING, Any

from ...finite_differences import weights
from ..forces.force import PairElement
from ..formulations.core_description import constraints_of, laws_of
from ..frames import Pair, find_frame
from .parameter_direction import Parameter
from .parameter_partials import Parameters

if TYPE_CHECKING:
    from ..._native import Parameters as NativeParameters
    from ..formulations.compiled_systems import CompiledSystem
    from ..formulations.index2 import Index2System

ModelComponent = tuple[str, int, bool, bool]  # kind, index, whether the pair of a law, and whether its second frame
CoreData = tuple[list[ModelComponent], list[Any], list[Any]]


def bind_parameters(system: "CompiledSystem", parameters: Parameters) -> "NativeParameters":
    """Bind parameters to the core of the corresponding mechanism.

    Raises:
        NotCompiled: for laws or rows that the core does not support.
    """
    system.expand()
    data = parameters.once("core data", parameters.system.mode, lambda: _core_data(parameters))
    return system.core.bind_parameters(len(parameters), *data)


def _core_data(parameters: Parameters) -> CoreData:
    """Return the changed components, the change by each parameter, and perturbed laws and rows."""
    numbers: dict[ModelComponent, int] = {}
    directions: list[tuple[int, int, list[float]]] = []
    ends = _ends(parameters.system)
    for i, p in enumerate(parameters.all):
        for component, x in _made_of(p, ends):
            directions.append((i, numbers.setdefault(component, len(numbers)), x.tolist()))
    changed: list[tuple[int, list[int], list[Any], list[Any]]] = []
    for i, (p, laws, rows) in enumerate(zip(parameters.all, parameters.laws, parameters.rows, strict=True)):
        factors = weights(p.places_beside, p.h)
        if laws.near:
            near = [(factors[k], *laws_of(x)) for k, x in laws.near.items()]
            changed.append((i, laws.at.tolist(), near, []))
        if rows.near:
            beside = [(factors[k], *constraints_of(x)) for k, x in rows.near.items()]
            changed.append((i, rows.at.tolist(), [], beside))
    return list(numbers), directions, changed


def _made_of(p: Parameter, ends: dict[int, list[ModelComponent]]) -> list[tuple[ModelComponent, Any]]:
    """Return the components that a parameter changes, and the changes."""
    out: list[tuple[ModelComponent, Any]] = [(("inertia", j, False, False), x) for j, x in p.inertias.items()]
    out += [(("place", j, False, False), x) for j, x in p.places.items()]
    out += [(component, x) for i, x in p.frames.items() for component in ends.get(i, ())]
    out += [((kind, 0, False, False), x) for kind, x in (("gravity", p.gravity), ("armature", p.armature)) if x.any()]
    return out


def _ends(system: "Index2System") -> dict[int, list[ModelComponent]]:
    """Return the ends of pairs fixed to each frame of the model."""
    model, out = system.model, {}  # type: Any, dict[int, list[ModelComponent]]
    frames = list(model.frames)

    def add_frames(number: int, pair: Pair, of_law: bool) -> None:
        for a, second in ((pair.a, False), (pair.b, True)):
            out.setdefault(frames.index(find_frame(model, a.name)), []).append(("frame", number, of_law, second))

    for i, (pair, _) in enumerate(system.constraints.frame_parts.values()):
        add_frames(i, pair, False)
    for i, law in enumerate([law for law, _ in system.laws.acting if isinstance(law, PairElement)]):
        add_frames(i, law.pair, True)
    return out
