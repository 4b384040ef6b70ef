"""Lengths and other parameters of a live mechanism, set by sliders, and the paths of its points over all poses."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ...errors import InputError, MbdaeError, UnknownNameError
from ...mechanism import Mechanism
from ...mechanism.assembly.position_search import close_position
from ...mechanism.formats.mechanism_file.loaded_model import LoadedModel, parameter_value
from ...mechanism.formats.mechanism_file.parameter_units import parameter_unit
from ...mechanism.tree.frames import find_frame, find_joint, frame_paths
from ...system import Array
from ...units import displayed, unit_name
from ..figures import COLOURS
from ..kinematics.kinematics import kinematics
from ..replay.animation_tracks import TRACE, path_commands
from ..replay.threejs import node_path, set_property
from ..view.sliders import independent
from .controls import checked_ranges, slider

POSES = 121  # number of poses of a path


class Dimensions:
    """Parameters of a mechanism that sliders set, and traced frames.

    Args:
        mechanism: the mechanism, read from files if there are parameters.
        ranges: (low, high) of the sliders of parameters, by dotted name.
        traces: names of frames whose paths are drawn over the first free coordinate, with the remaining ones locked.

    Attributes:
        mechanism: the mechanism with the current values, without meshes, which do not depend on parameters.
        values: values of the parameters, by name.
        units: units of the parameters, by name; "" if unknown.

    Raises:
        UnknownNameError: for an unknown parameter or frame.
        InputError: for a mechanism that was not read from files, a parameter that is not a number, or a range that is
            not two increasing numbers.
    """

    def __init__(self, mechanism: Mechanism, ranges: Mapping[str, Sequence[float]], traces: Sequence[str]) -> None:
        self.ranges, self.traces = checked_ranges(ranges), list(traces)
        for name in self.traces:
            find_frame(mechanism.model, name)
        self.mechanism, self.values, self.units = mechanism, dict[str, float](), dict[str, str]()
        if ranges:
            self._factory = LoadedModel(mechanism)
            self.values = {name: parameter_value(self._factory, name) for name in ranges}
            self.units = {name: parameter_unit(self._factory, name) for name in ranges}
            self.mechanism = self._factory.make(self.values)

    def check(self, request: Mapping[str, Any]) -> None:
        """Require a known parameter.

        Raises:
            UnknownNameError: lists the parameters.
        """
        if "parameter" in request and request["parameter"] not in self.values:
            raise UnknownNameError("parameter with a slider", request["parameter"], self.values)

    def change(self, name: str, value: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Set a parameter; return the nearest consistent state, with the same free coordinates.

        Args:
            name: name of the parameter.
            value: new value of the parameter.
            q: current configuration, (nq,).
            v: current velocity, (nv,).

        Raises:
            AssemblyError: if the loops cannot be closed with this value.
            InputError: for an invalid value.
        """
        previous, values = self.mechanism, {**self.values, name: float(value)}
        mech = self._factory.make(values)
        names = independent(previous, previous.system(), q)
        fixed = np.array([find_joint(mech.model, joint).idx_v for joint in names], int)
        q = close_position(mech.system(), q, fixed, 0.0)
        q, v = mech.assemble(q, v)
        self.mechanism, self.values = mech, values
        return q, v

    def paths(self, q: Array, extent: float) -> Iterator[dict[str, Any]]:
        """Yield the commands that draw the paths of the traced frames, all poses from q (nq,) on.

        Raises:
            MbdaeError: as `mbdae.kinematics`, for poses that cannot be traced.
        """
        if not self.traces:
            return
        mech = self.mechanism
        free = Mechanism(mech.model, mech.closures, mech.forces, start=mech.start_values, title=mech.title)
        drive, *others = independent(mech, free.system(), q)
        found = kinematics(free, drive, hold=others, q=q, points=POSES)
        points_of = dict(zip(self.traces, frame_paths(mech.model, self.traces, found.q), strict=True))
        for i, (name, points) in enumerate(points_of.items()):
            yield from path_commands(node_path(f"path {name}"), points, COLOURS[i % len(COLOURS)], TRACE * extent)

    def paths_or_reason(self, q: Array, extent: float) -> tuple[list[dict[str, Any]], str]:
        """Return the commands of `paths`, or commands that hide the paths and the reason."""
        try:
            return list(self.paths(q, extent)), ""
        except MbdaeError as e:
            names = [node_path(f"path {name}{end}") for name in self.traces for end in ("", " line")]
            return [set_property(name, "visible", False) for name in names], f"the path is not drawn: {e}"

    def controls(self) -> Iterator[dict[str, Any]]:
        """Yield meshcat's commands for the sliders."""
        for name, (low, high) in self.ranges.items():
            yield slider("parameter", name, self.units[name], self.values[name], low, high)


def require_within(dimensions: Dimensions) -> None:
    """Require current values within the ranges of their sliders.

    Raises:
        InputError: names the parameter.
    """
    for name, (low, high) in dimensions.ranges.items():
        if not low <= dimensions.values[name] <= high:
            unit = dimensions.units.get(name, "")
            value, low, high = (displayed(x, unit)[0] for x in (dimensions.values[name], low, high))
            suffix = f" {unit_name(unit)}" if unit else ""
            raise InputError(f"{name} = {value:g}{suffix} is outside of its range, {low:g} to {high:g}{suffix}")
