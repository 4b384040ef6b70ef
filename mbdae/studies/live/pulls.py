"""Actions of a user on a live simulation: inputs are set, joints and a point are pulled by springs.

A spring acts through inputs of the mechanism, constant over pieces of an advance that are much shorter than its period.
So the recorded run contains all actions, and `mbdae.solve` repeats it.
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

FREQUENCY = 20.0  # frequency of the springs in rad/s, as of a hand
PIECE = 0.1  # fraction of 1/FREQUENCY: longest time over which their forces are constant
WIDE = 10.0  # half range of the slider of an input without one, or twice its value
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
        UnknownNameError: for a range of something else than an input or a joint with a slider.
        InputError: for a range that is not two increasing numbers.
    """

    def __init__(self, mechanism: Mechanism, q: Array, ranges: Mapping[str, Sequence[float]]) -> None:
        self.inputs = dict(Inputs(mechanism).original_inputs)
        self.joints = independent(mechanism, mechanism.system(), q)[:MAX_SLIDERS]
        self._hands = [name for joint in mechanism.joint_names for name in _hand(mechanism, joint)]
        hands = [
            JointTorque(name=f"hand {j}", joint=j, torque=tuple(Input(name=name) for name in _hand(mechanism, j)))
            for j in mechanism.joint_names
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

    # -- orders ----------------------------------------------------------------------------------------------------

    def check(self, order: Mapping[str, Any]) -> None:
        """Check an order of a page or a caller.

        Raises:
            UnknownNameError: for an unknown input, joint or frame.
            InputError: for values that are not finite numbers.
        """
        for key, what, known in (("input", "input", self.inputs), ("joint", "joint", self.joints)):
            if key in order:
                if order[key] not in known:
                    raise UnknownNameError(what, order[key], known)
                if key == "input" or order.get("value") is not None:
                    _finite(f"{what} {order[key]!r}", order.get("value"))
        self._check_points(order)

    def _check_points(self, order: Mapping[str, Any]) -> None:
        if "frame" in order and not self._joint_of(order["frame"]):
            movable = [n for n in frame_names(self.mechanism.model) if self._joint_of(n)]
            raise InputError(f"frame {order['frame']!r} is fixed and cannot be pulled; valid: {', '.join(movable)}")
        for point in (order[key] for key in ("point", "to") if key in order):
            if not isinstance(point, Sequence) or len(point) != len(AXES):
                raise InputError(f"a point is three numbers in m, got {point!r}")
            for x in point:
                _finite("a point", x)

    def order(self, order: Mapping[str, Any], simulator: Simulator, drawables: Mapping[str, int]) -> None:
        """Carry out an order; ``drawables`` are the joints that carry what is drawn, by name."""
        if "input" in order:
            simulator[order["input"]] = order["value"]
        elif "joint" in order:
            self._targets.pop(order["joint"], None)
            if order["value"] is not None:
                self._targets[order["joint"]] = float(order["value"])
        elif "pull" in order:
            if joint := drawables.get(order["pull"], 0):
                self._take(joint, np.array(order["point"], float), simulator.q)
        elif "frame" in order:
            q = simulator.q
            joint = self._joint_of(order["frame"])
            self._take(joint, self.mechanism.frame(q, order["frame"])[0], q)
            self._to = np.array(order["to"], float)
        elif "to" in order:
            self._to = np.array(order["to"], float)
        elif "drop" in order:
            self._point = self.line = None
        elif "release" in order:
            self.release()
        else:
            raise InputError(f"unknown order {json.dumps(order)[:60]}")

    def _take(self, joint: int, point: Array, q: Array) -> None:
        self._point, self._to = PulledPoint(self.mechanism, joint, point, q), point

    def _joint_of(self, frame: str) -> int:
        return find_frame(self.mechanism.model, frame).parentJoint

    def release(self) -> None:
        """Release all springs."""
        self._targets.clear()
        self._point = self.line = None

    # -- springs ---------------------------------------------------------------------------------------------------

    def substeps(self, dt: float) -> int:
        """Return into how many pieces an advance of dt in s is divided."""
        active = self._targets or self._point or self._acting
        return ceil(dt * FREQUENCY / PIECE) if active else 1

    def apply(self, simulator: Simulator) -> None:
        """Set the inputs by the springs at the state now."""
        acting = bool(self._targets or self._point)
        if acting or self._acting:
            tau = self._tau(simulator.q, simulator.v) if acting else np.zeros(self.mechanism.nv)
            for name, value in zip(self._hands, tau.tolist(), strict=True):
                simulator[name] = value
        self._acting = acting

    def _tau(self, q: Array, v: Array) -> Array:
        """Return the forces of springs on joints, m (w^2 (target - q) - 2 w v), and of that on the point, (nv,)."""
        out = np.zeros(self.mechanism.nv)
        inertias = joint_inertias(self.mechanism, q) if self._targets else out
        for name, target in self._targets.items():
            joint = find_joint(self.mechanism.model, name)
            off = target - value_of(q, joint)
            if joint.nq > 1:  # an angle without limits
                off = (off + np.pi) % (2 * np.pi) - np.pi
            i = joint.idx_v
            out[i] += inertias[i] * (FREQUENCY**2 * off - 2 * FREQUENCY * v[i])
        if self._point is not None:
            found = self._point.pull(q, v, self._to, FREQUENCY)
            self.line = np.array([found.point, self._to])
            out += found.tau
        return out

    # -- controls of the page --------------------------------------------------------------------------------------

    def controls(self, simulator: Simulator) -> Iterator[dict[str, Any]]:
        """Yield meshcat's commands for buttons and sliders."""
        for name, order in (("pause or play", {"play": None}), ("reset", {"reset": True})):
            yield {"type": "set_control", "name": name, "callback": f"() => live.send({json.dumps(order)})"}
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
        """Yield meshcat's commands that set the sliders to the state now."""
        values = {name: simulator[name] for name in self.inputs}
        values |= self._starts
        for name, value in values.items():
            unit = self._unit_of(name)
            command = {"type": "set_control_value", "name": slider_label(name, unit)}
            yield {**command, "value": displayed(value, unit)[0], "invoke_callback": False}

    def _unit_of(self, name: str) -> str:
        return self.inputs[name].unit if name in self.inputs else _unit(self.mechanism, name)


def _hand(mechanism: Mechanism, joint: str) -> list[str]:
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
        here, limits = value_of(q, find_joint(mechanism.model, name)), limits_of(mechanism, name)
        half = np.pi if _unit(mechanism, name) == "rad" else 0.5
        low, high = (here - half, here + half) if limits is None else limits
        out[name] = (float(low), float(high))
    return out


def _finite(what: str, value: object) -> None:
    if not is_number(value):
        raise InputError(f"{what} must be a finite number, got {value!r}")
