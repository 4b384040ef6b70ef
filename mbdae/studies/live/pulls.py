"""Interaction of a user with a live simulation: inputs are set, joints and a point are pulled by springs.

Spring forces are inputs of the mechanism, constant over substeps that are much shorter than the period of the
springs. So the recorded run contains all actions, and `mbdae.solve` repeats it.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from math import ceil
from typing import Any

import numpy as np

from ...errors import InputError, UnknownNameError, is_number
from ...integrate.simulator.simulator import Simulator
from ...mechanism import Mechanism
from ...mechanism.forces.joint_torque import JointTorque
from ...mechanism.inputs import Inputs
from ...mechanism.pulled_point import PulledPoint, joint_inertias
from ...mechanism.time_functions.input_functions import Input
from ...mechanism.tree.coordinate_units import coordinate_units
from ...mechanism.tree.frames import find_frame, find_joint, frame_names
from ...mechanism.variant import variant
from ...system import Array
from ...units import displayed
from ..view.sliders import MAX_SLIDERS, independent, limits_of, value_of
from .controls import checked_ranges, slider, slider_label

FREQUENCY = 20.0  # frequency of the springs in rad/s, similar to that of a hand
SUBSTEP = 0.1  # longest time over which spring forces are constant, as a fraction of 1/FREQUENCY
WIDE = 10.0  # smallest half range of the slider of an input without a given range; else twice its value
AXES = "xyz"


class Pulls:
    """Inputs, springs on joints, and a spring on a point of a mechanism.

    Args:
        mechanism: the mechanism.
        q: start (nq,), which is on the manifold of the closures.
        ranges: (low, high) of the sliders of inputs and joints, by name.

    Attributes:
        mechanism: a copy with inputs ``hand JOINT`` for torques and forces on joints, those of points included.
        line: the pulled point and its target (2, 3), or None.

    Raises:
        UnknownNameError: for a range whose name is not an input or a joint with a slider.
        InputError: for a range that is not two increasing numbers.
    """

    def __init__(self, mechanism: Mechanism, q: Array, ranges: Mapping[str, Sequence[float]]) -> None:
        self.inputs = dict(Inputs(mechanism).original_inputs)
        self.joints = independent(mechanism, mechanism.system(), q)[:MAX_SLIDERS]
        hand_inputs = {joint: _hand_inputs(mechanism, joint) for joint in mechanism.joint_names}
        self._hand_names = [name for names in hand_inputs.values() for name in names]
        hands = [
            JointTorque(name=f"hand {joint}", joint=joint, torque=tuple(Input(name=name) for name in names))
            for joint, names in hand_inputs.items()
        ]
        self.mechanism = variant(mechanism, forces=[*mechanism.forces, *hands], source=None)
        self._ranges = {**_default_ranges(mechanism, self.inputs, self.joints, q), **checked_ranges(ranges)}
        for name in ranges:
            if name not in self.inputs and name not in self.joints:
                raise UnknownNameError("input or joint", name, [*self.inputs, *self.joints])
        self._starts = {name: value_of(q, find_joint(mechanism.model, name)) for name in self.joints}
        self._targets: dict[str, float] = {}
        self._point: PulledPoint | None = None
        self._to, self._acting = np.zeros(3), False
        self.line: Array | None = None

    # -- requests --------------------------------------------------------------------------------------------------

    def check(self, request: Mapping[str, Any]) -> None:
        """Check a request of a page or a caller.

        Raises:
            UnknownNameError: for an unknown input, joint or frame.
            InputError: for values that are not finite numbers.
        """
        for key, known in (("input", self.inputs), ("joint", self.joints)):
            if key in request:
                if request[key] not in known:
                    kind = "input" if key == "input" else "joint with a slider"  # dependent joints have none
                    raise UnknownNameError(kind, request[key], known)
                if key == "input" or request.get("value") is not None:
                    _require_finite(f"{key} {request[key]!r}", request.get("value"))
        self._check_points(request)

    def _check_points(self, request: Mapping[str, Any]) -> None:
        if "frame" in request and not self._joint_of(request["frame"]):
            movable = [n for n in frame_names(self.mechanism.model) if self._joint_of(n)]
            raise InputError(f"frame {request['frame']!r} is fixed and cannot be pulled; valid: {', '.join(movable)}")
        for point in (request[key] for key in ("point", "to") if key in request):
            if not isinstance(point, Sequence) or len(point) != len(AXES):
                raise InputError(f"a point is three numbers in m, got {point!r}")
            for x in point:
                _require_finite("a point", x)

    def execute(self, request: Mapping[str, Any], simulator: Simulator, drawables: Mapping[str, int]) -> None:
        """Execute a request; ``drawables`` are the supporting joints of the drawn shapes, by name."""
        if "input" in request:
            simulator[request["input"]] = request["value"]
        elif "joint" in request:
            self._targets.pop(request["joint"], None)
            if request["value"] is not None:
                self._targets[request["joint"]] = float(request["value"])
        elif "pull" in request:
            if joint := drawables.get(request["pull"], 0):
                self._grasp(joint, np.array(request["point"], float), simulator.q)
        elif "frame" in request:
            q = simulator.q
            joint = self._joint_of(request["frame"])
            self._grasp(joint, self.mechanism.frame(q, request["frame"])[0], q)
            self._to = np.array(request["to"], float)
        elif "to" in request:
            self._to = np.array(request["to"], float)
        elif "drop" in request:
            self._point = self.line = None
        elif "release" in request:
            self.release()
        else:
            raise InputError(f"unknown request {json.dumps(request)[:60]}")

    def _grasp(self, joint: int, point: Array, q: Array) -> None:
        self._point, self._to = PulledPoint(self.mechanism, joint, point, q), point

    def _joint_of(self, frame: str) -> int:
        return find_frame(self.mechanism.model, frame).parentJoint

    def release(self) -> None:
        """Release all springs."""
        self._targets.clear()
        self._point = self.line = None

    # -- springs ---------------------------------------------------------------------------------------------------

    def substeps(self, dt: float) -> int:
        """Return the number of substeps of a step of dt in s."""
        active = self._targets or self._point or self._acting
        return ceil(dt * FREQUENCY / SUBSTEP) if active else 1

    def apply(self, simulator: Simulator) -> None:
        """Set the inputs to the spring forces in the current state."""
        acting = bool(self._targets or self._point)
        if acting or self._acting:
            tau = self._tau(simulator.q, simulator.v) if acting else np.zeros(self.mechanism.nv)
            for name, value in zip(self._hand_names, tau.tolist(), strict=True):
                simulator[name] = value
        self._acting = acting

    def _tau(self, q: Array, v: Array) -> Array:
        """Return generalized forces (nv,) of the springs on joints, m (w^2 (target - q) - 2 w v), and on the point."""
        out = np.zeros(self.mechanism.nv)
        inertias = joint_inertias(self.mechanism, q) if self._targets else out
        for name, target in self._targets.items():
            joint = find_joint(self.mechanism.model, name)
            error = target - value_of(q, joint)
            if joint.nq > 1:  # an angle without limits
                error = (error + np.pi) % (2 * np.pi) - np.pi
            i = joint.idx_v
            out[i] += inertias[i] * (FREQUENCY**2 * error - 2 * FREQUENCY * v[i])
        if self._point is not None:
            found = self._point.pull(q, v, self._to, FREQUENCY)
            self.line = np.array([found.point, self._to])
            out += found.tau
        return out

    # -- controls of the page --------------------------------------------------------------------------------------

    def controls(self, simulator: Simulator) -> Iterator[dict[str, Any]]:
        """Yield meshcat's commands for buttons and sliders."""
        for name, request in (("pause or play", {"play": None}), ("reset", {"reset": True})):
            yield {"type": "set_control", "name": name, "callback": f"() => live.send({json.dumps(request)})"}
        sliders = [("input", name, simulator[name]) for name in self.inputs]
        sliders += [("joint", name, self._targets.get(name, self._starts[name])) for name in self.joints]
        for kind, name, value in sliders:
            yield slider(kind, name, self._unit_of(name), value, *self._ranges[name])
        if self.joints:
            yield {
                "type": "set_control",
                "name": "release the joints",
                "callback": f"() => live.send({json.dumps({'release': True})})",
            }

    def slider_values(self, simulator: Simulator) -> Iterator[dict[str, Any]]:
        """Yield meshcat's commands that set the sliders to the current state."""
        values = {name: simulator[name] for name in self.inputs}
        values |= self._starts
        for name, value in values.items():
            unit = self._unit_of(name)
            command = {"type": "set_control_value", "name": slider_label(name, unit)}
            yield {**command, "value": displayed(value, unit)[0], "invoke_callback": False}

    def _unit_of(self, name: str) -> str:
        return self.inputs[name].unit if name in self.inputs else _unit(self.mechanism, name)


def _hand_inputs(mechanism: Mechanism, joint: str) -> list[str]:
    """Return the names of the inputs of a joint, one for each of its velocities."""
    count = find_joint(mechanism.model, joint).nv
    return [f"hand {joint}"] if count == 1 else [f"hand {joint} {k + 1}" for k in range(count)]


def _unit(mechanism: Mechanism, joint: str) -> str:
    return coordinate_units(mechanism)[f"v.{joint}"].removesuffix("/s")


def _default_ranges(
    mechanism: Mechanism, inputs: Mapping[str, Input], joints: Sequence[str], q: Array
) -> dict[str, tuple[float, float]]:
    out = {}
    for name, given in inputs.items():
        half = max(WIDE, 2 * abs(given.value))
        out[name] = (-half, half)
    for name in joints:
        value, limits = value_of(q, find_joint(mechanism.model, name)), limits_of(mechanism, name)
        half = np.pi if _unit(mechanism, name) == "rad" else 0.5
        low, high = (value - half, value + half) if limits is None else limits
        out[name] = (float(low), float(high))
    return out


def _require_finite(name: str, value: object) -> None:
    if not is_number(value):
        raise InputError(f"{name} must be a finite number, got {value!r}")
