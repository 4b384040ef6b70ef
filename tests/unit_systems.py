"""Mechanisms and their results in other units: the same mechanism with converted values.

A quantity in SI units of dimension L^a M^b T^c is `UnitSystem.of(a, b, c)` times as large in other units. Results of
studies may change only by these factors.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from mbdae import Closure, Driver, Mechanism, Stop
from mbdae.mechanism.checked_table import HUGE
from mbdae.mechanism.forces.joint_damping import JointDamping
from mbdae.mechanism.forces.joint_pid import JointPID
from mbdae.mechanism.forces.joint_spring import JointSpring
from mbdae.mechanism.forces.joint_torque import JointTorque
from mbdae.mechanism.forces.spring_damper import SpringDamper
from mbdae.mechanism.forces.wrench import Wrench
from mbdae.mechanism.model_settings import Start
from mbdae.mechanism.time_functions.time_functions import Constant, Harmonic, Polynomial, Steps, TimeTable
from mbdae.mechanism.tree.frames import find_joint, find_joints
from mbdae.mechanism.tree.joints import PER_COORDINATE, translation_components

UNCONVERTED = ("kind", "name", "frames", "joints", "joint", "frame", "axes", "axis", "second_axis", "grip", "contact",
         "surface", "unilateral", "restitution", "limits", "interpolation", "controls")  # fmt: skip
LENGTHS = ("length", "radius", "tyre", "semi_axes", "centre", "surface_radius", "radii", "lead")


class UnitSystem(NamedTuple):
    """Number of units of length, mass and time in one metre, one kilogram and one second."""

    name: str
    length: float = 1.0
    mass: float = 1.0
    time: float = 1.0

    def of(self, length: float = 0, mass: float = 0, time: float = 0) -> float:
        """Return the factor of a dimension, given by its exponents."""
        return self.length**length * self.mass**mass * self.time**time

    @property
    def energy(self) -> float:
        """The factor of energies in J."""
        return self.of(2, 1, -2)

    def coordinates(self, mech: Mechanism) -> np.ndarray:
        """Return the factors on changes dq of coordinates, (nv,)."""
        return np.where(translation_components(mech.model), self.length, 1.0)

    def speeds(self, mech: Mechanism) -> np.ndarray:
        """Return the factors on v, (nv,)."""
        return self.coordinates(mech) / self.time

    def efforts(self, mech: Mechanism) -> np.ndarray:
        """Return the factors on forces and torques in joints, (nv,)."""
        return self.energy / self.coordinates(mech)

    def configuration(self, mech: Mechanism) -> np.ndarray:
        """Return the factors on q, (nq,)."""
        out, slides = np.ones(mech.nq), translation_components(mech.model)
        for joint in list(mech.model.joints)[1:]:
            along = slides[joint.idx_v : joint.idx_v + joint.nv]
            out[joint.idx_q : joint.idx_q + int(along.sum())] = self.length if along.any() else 1.0  # positions first
        return out

    def rows(self, mech: Mechanism) -> np.ndarray:
        """Return the factors on g, (ng,), and on G v where a row has no g."""
        return np.array([self.length if u.startswith("m") else 1.0 for u in mech.row_units])

    def multipliers(self, mech: Mechanism) -> np.ndarray:
        """Return the factors on lam, (ng,): lam (G v) is a power."""
        return self.energy / self.rows(mech)

    def mechanism(self, mech: Mechanism) -> Mechanism:
        """Return the mechanism in these units.

        Raises:
            NotImplementedError: for features of unknown dimensions.
        """
        model = self._model(mech.model)
        table = {
            "closures": [self._closure(mech, c) for c in mech.closures],
            "drivers": [self._driver(mech, d) for d in mech.drivers],
            "stops": [self._stop(mech, s) for s in mech.stops],
            "forces": [self._force(mech, f) for f in mech.forces],
            "start": self._start(mech),
        }
        if mech.clutches:
            raise NotImplementedError("clutches")
        return Mechanism(model, **table, title=mech.title, duration=mech.duration * self.time)

    def _model(self, old: pin.Model) -> pin.Model:
        if any("ModelH" in joint.shortname() for joint in old.joints):
            raise NotImplementedError("helical joints")
        model, slides = pin.Model(old), translation_components(old)
        model.gravity = pin.Motion(old.gravity.linear * self.of(1, 0, -2), np.zeros(3))
        for i, (place, body) in enumerate(zip(old.jointPlacements, old.inertias, strict=True)):
            model.jointPlacements[i] = self._place(place)
            moments = body.inertia * self.of(2, 1)
            model.inertias[i] = pin.Inertia(body.mass * self.mass, body.lever * self.length, moments)
        for i, frame in enumerate(old.frames):
            model.frames[i].placement = self._place(frame.placement)
        model.armature = old.armature * np.where(slides, self.mass, self.of(2, 1))
        for name in PER_COORDINATE:
            for joint in list(old.joints)[1:]:
                values = getattr(old, name)[joint.idx_q : joint.idx_q + joint.nq]
                if slides[joint.idx_v] and np.abs(values).max() < HUGE:  # the largest float means no limit
                    getattr(model, name)[joint.idx_q : joint.idx_q + joint.nq] = values * self.length
        return model

    def _place(self, at: pin.SE3) -> pin.SE3:
        return pin.SE3(at.rotation, at.translation * self.length)

    def _coordinate(self, mech: Mechanism, name: str | tuple[str, ...]) -> float:
        """Return the factor on the coordinates of a joint, or of several of one kind."""
        names = (name,) if isinstance(name, str) else name
        factors = {float(self.coordinates(mech)[j.idx_v]) for j in find_joints(mech.model, names)}
        (factor,) = factors
        return factor

    def _coefficients(self, mech: Mechanism, joints: tuple[str, ...], c: tuple[float, ...]) -> tuple[float, ...]:
        """Convert coefficients of q_i = c_0 + c_1 q_j + c_2 q_j^2 + ..., or of q_i = c_0 + c_1 q_j + c_2 q_k + ...."""
        first, *others = [self._coordinate(mech, joint) for joint in joints]
        divisors = [others[0] ** k for k in range(len(c))] if len(joints) == 2 else [1.0, *others]
        return tuple(x * first / factor for x, factor in zip(c, divisors, strict=True))

    def _signal(self, signal: Any, factor: float) -> Any:
        if isinstance(signal, Constant):
            return Constant(value=signal.value * factor)
        if isinstance(signal, Harmonic):
            scaled = {"amplitude": signal.amplitude * factor, "offset": signal.offset * factor}
            return Harmonic(**{**signal.model_dump(), **scaled, "omega": signal.omega / self.time})
        if isinstance(signal, Polynomial):
            powers = [x * factor / self.time**k for k, x in enumerate(signal.coefficients)]
            return Polynomial(**{**signal.model_dump(), "coefficients": tuple(powers)})
        if isinstance(signal, TimeTable | Steps):
            points = tuple((t * self.time, x * factor) for t, x in signal.points)
            return type(signal)(**{**signal.model_dump(), "points": points})
        raise NotImplementedError(type(signal).__name__)

    def _changed(self, table: Any, factors: dict[str, Any]) -> Any:
        """Multiply the values and functions of time of a table by factors, or apply functions in place of factors."""
        values: dict[str, Any] = {}
        for name in type(table).model_fields:
            value = getattr(table, name)
            if value is None or name in UNCONVERTED or value == type(table).model_fields[name].default == 0.0:
                values[name] = value
            elif name not in factors:
                raise NotImplementedError(f"{type(table).__name__}.{name}")
            else:
                values[name] = self._times(value, factors[name])
        return type(table)(**values)

    def _times(self, value: Any, factor: float | Callable[[Any], Any]) -> Any:
        if callable(factor):
            return factor(value)
        if isinstance(value, tuple):
            return tuple(self._times(x, factor) for x in value)
        return value * factor if isinstance(value, int | float) else self._signal(value, factor)

    def _closure(self, mech: Mechanism, closure: Closure) -> Closure:
        factors: dict[str, Any] = dict.fromkeys(LENGTHS, self.length) | {"rest": self.time}
        if closure.joints:
            factors["coefficients"] = lambda c: self._coefficients(mech, closure.joints, c)
        return self._changed(closure, factors)

    def _driver(self, mech: Mechanism, driver: Driver) -> Driver:
        joint = driver.joint or (driver.joints or ("",))[0]
        unit = self._coordinate(mech, joint) if joint else self.length
        factors: dict[str, Any] = {"motion": unit, "speed": unit / self.time}
        if driver.joints:
            factors["coefficients"] = lambda c: self._coefficients(mech, driver.joints, c)
        return self._changed(driver, factors)

    def _stop(self, mech: Mechanism, stop: Stop) -> Stop:
        unit = self._coordinate(mech, stop.joint or stop.joints[0])
        factors: dict[str, Any] = {"lower": unit, "upper": unit, "rest": self.time}
        if stop.joints:
            factors["coefficients"] = lambda c: self._coefficients(mech, stop.joints, c)
        return self._changed(stop, factors)

    def _force(self, mech: Mechanism, force: Any) -> Any:
        unit_f = self.of(1, 1, -2)
        if isinstance(force, SpringDamper):
            stiffness = unit_f / self.length
            factors = {"stiffness": stiffness, "damping": stiffness * self.time, "length": self.length, "force": unit_f}
            return self._changed(force, factors)
        if isinstance(force, Wrench):
            return self._changed(force, {"force": unit_f, "torque": self.energy})
        if not isinstance(force, JointSpring | JointDamping | JointTorque | JointPID):
            raise NotImplementedError(type(force).__name__)
        unit = self._coordinate(mech, force.joint)
        effort, stiffness = self.energy / unit, self.energy / unit**2
        factors = {
            "stiffness": stiffness, "rest": unit, "damping": stiffness * self.time, "torque": effort, "gear": 1.0,
            "bias": lambda b: tuple(x * f for x, f in zip(b, (effort, stiffness, stiffness * self.time), strict=True)),
        }  # fmt: skip
        if isinstance(force, JointPID):
            if force.controls != "position" or force.rate:
                raise NotImplementedError("a joint_pid of a speed, or a sampled one")
            gains = {"kp": stiffness, "ki": stiffness / self.time, "kd": stiffness * self.time}
            factors = {**gains, "reference": unit, "integral": unit * self.time}
        return self._changed(force, factors)

    def _start(self, mech: Mechanism) -> Start:
        old, q, v = mech.start_values, self.configuration(mech), self.speeds(mech)

        def table(values: dict[str, Any], factors: np.ndarray, is_velocity: bool) -> dict[str, Any]:
            out = {}
            for name, value in values.items():
                j = find_joint(mech.model, name)
                indices = slice(j.idx_v, j.idx_v + j.nv) if is_velocity else slice(j.idx_q, j.idx_q + j.nq)
                numbers = np.atleast_1d(np.asarray(value, float))
                scaled = (numbers * factors[indices][: len(numbers)]).tolist()
                out[name] = scaled if isinstance(value, tuple | list) else scaled[0]
            return out

        return Start(
            q=table(old.q, q, False), guess=table(old.guess, q, False), v=table(old.v, v, True),
            guess_v=table(old.guess_v, v, True), assemble=old.assemble,
        )  # fmt: skip


SI = UnitSystem("m, kg, s")
UNIT_SYSTEMS = (
    SI,
    UnitSystem("mm, t, s", length=1e3, mass=1e-3),
    UnitSystem("km, g, h", length=1e-3, mass=1e3, time=1 / 3600),
    UnitSystem("m, kg, Ms", time=1e-6),
    UnitSystem("m, kg, us", time=1e6),
)
