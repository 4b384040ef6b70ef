"""Linear dependence of the exported data of a mechanism on its parameters."""

from collections.abc import Callable, Mapping, Sequence
from types import ModuleType
from typing import NamedTuple

import numpy as np

from ...data_types import CoreData
from ...errors import InputError
from ...mechanism import Mechanism
from ...mechanism.formats.mechanism_file.loaded_model import LoadedModel, parameter_value
from ...mechanism.inputs import Inputs
from ...system import Array
from ...tolerances import SAME_STATE, SOLUTION_ROUNDING
from .core_file import core_data, native_system, values_by_path

STEPS = (0.25, 0.5)  # changes that verify linear dependence, as fractions of the parameter, or of 1 if it is 0
CONSTANT = ("tolerances", "order", "probe")  # data that keep their values when parameters change

Path = tuple[str, ...]
ValuesByPath = dict[Path, object]


class ParameterPartials(NamedTuple):
    """Value of a parameter, and partial derivatives of the exported data with respect to it.

    Attributes:
        value: value of the parameter.
        partials: partial derivatives, by the paths of the data.
    """

    value: float
    partials: dict[Path, float]

    def core_data(self) -> CoreData:
        """Core data."""
        return {"value": self.value, "effects": [{"path": list(p), "by": x} for p, x in self.partials.items()]}


def parameter_partials(
    inputs: Inputs, names: Sequence[str], native: ModuleType, start_of: Callable[[Mechanism], Array]
) -> dict[str, ParameterPartials]:
    """Return the values and partials of parameters, by their dotted names.

    Args:
        inputs: inputs of the mechanism.
        names: names of the parameters.
        native: the compiled core.
        start_of: returns the mode and the point at which a simulation begins, which must not depend on the parameters.

    Raises:
        UnknownNameError: for an unknown name.
        InputError: for parameters on which the data do not depend linearly, singly or jointly, or on which the start
            depends.
    """
    if not names:
        return {}
    template = LoadedModel(inputs.original)
    values = {name: parameter_value(template, name) for name in names}

    def data(changed: Mapping[str, float]) -> ValuesByPath:
        made = inputs.replaced(inputs.user_inputs, template.make({**values, **changed}))
        found = values_by_path(core_data(native_system(made, native)))
        return {path: x for path, x in found.items() if not any(key in CONSTANT for key in path[:2])}

    nominal, out, shifts, start = data({}), {}, {}, start_of(inputs.original)
    for name, value in values.items():
        first, second = (step * (abs(value) or 1.0) for step in STEPS)
        changed, check = data({name: value + first}), data({name: value + second})
        partials = _partials(name, nominal, changed, first)
        _require_linear(name, nominal, check, {path: second * x for path, x in partials.items()})
        changed_start = start_of(template.make({**values, name: value + first}))
        if np.abs(changed_start - start).max() > SAME_STATE * (1 + np.abs(start).max()):
            text = f"parameter {name!r} changes the start, by assembly or an impact: it cannot be exported"
            raise InputError(text)
        out[name], shifts[name] = ParameterPartials(value, partials), first
    if len(names) > 1:
        total: dict[Path, float] = {}
        for name, parameter in out.items():
            for path, x in parameter.partials.items():
                total[path] = total.get(path, 0.0) + shifts[name] * x
        _require_linear(", ".join(names), nominal, data({n: values[n] + d for n, d in shifts.items()}), total)
    return out


def _partials(name: str, nominal: ValuesByPath, changed: ValuesByPath, change: float) -> dict[Path, float]:
    """Return the partial derivatives of the numbers that change.

    Raises:
        InputError: if keys, or values that are not numbers, change.
    """
    if nominal.keys() != changed.keys():
        raise InputError(f"parameter {name!r} changes the structure of the mechanism: it cannot be exported")
    out = {}
    for path, x in nominal.items():
        y = changed[path]
        if x == y:
            continue
        if not (isinstance(x, int | float) and isinstance(y, int | float)):
            raise InputError(f"parameter {name!r} changes the structure of the mechanism: it cannot be exported")
        out[path] = (y - x) / change
    return out


def _require_linear(name: str, nominal: ValuesByPath, changed: ValuesByPath, changes: Mapping[Path, float]) -> None:
    for path, x in nominal.items():
        if not isinstance(x, int | float) or isinstance(x, bool):
            continue
        y, expected = float(changed[path]), x + changes.get(path, 0.0)  # type: ignore[arg-type]
        size = max(abs(x), abs(y), abs(changes.get(path, 0.0)))
        if not np.isclose(y, expected, rtol=0.0, atol=SOLUTION_ROUNDING * size):
            raise InputError(f"the mechanism does not depend linearly on parameter {name}: it cannot be exported")
