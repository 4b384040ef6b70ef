"""Random drops: mechanisms that fall on contacts and stops, or stick and slip; each is determined by its number."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

import mbdae
from mbdae import Closure, CoulombFriction, JointFriction, JointTorque, Mechanism, Stop
from mbdae.mechanism.hybrid.kinds.unilateral import Unilateral
from mbdae.mechanism.hybrid.mode_point import AllRows
from mbdae.mechanism.time_functions.time_functions import Constant
from mbdae.mechanism.variant import variant

Array = np.ndarray
RESTITUTIONS = 0.0, 0.3, 0.5, 0.8, 1.0
G = 9.81


class Drop(NamedTuple):
    """A run to be computed: over `end` seconds from q, v.

    Attributes:
        kind: the mechanism.
        mechanism: with its random parameters.
        q: start, (nq,).
        v: start, (nv,).
        end: duration in s.
    """

    kind: str
    mechanism: Mechanism
    q: Array
    v: Array
    end: float


def drop(number: int) -> Drop:
    """Return a drop: the kinds take turns, all else is random."""
    kind = tuple(KINDS)[number % len(KINDS)]
    return KINDS[kind](kind, np.random.default_rng(number))


def with_restitutions(mech: Mechanism, rng: np.random.Generator) -> Mechanism:
    """Return a model with random coefficients of restitution and friction."""

    def varied(x: Any) -> Any:
        if getattr(x, "restitution", None) is not None or getattr(x, "unilateral", False):
            return x.model_copy(update={"restitution": float(rng.choice(RESTITUTIONS))})
        if isinstance(x, CoulombFriction):
            return x.model_copy(update={"coefficient": float(rng.uniform(0.05, 0.6))})
        if isinstance(x, JointTorque) and isinstance(x.torque, Constant):
            return x.model_copy(update={"torque": Constant(value=x.torque.value * float(rng.uniform(0.3, 2)))})
        if isinstance(x, JointFriction):
            friction = x.friction * float(rng.uniform(0.3, 1.5))
            return x.model_copy(update={"friction": friction, "static": friction * float(rng.choice([1.0, 1.6]))})
        return x

    parts = {name: [varied(x) for x in getattr(mech, name)] for name in ("closures", "stops", "forces")}
    return variant(mech, **parts)


def of_model(spread: float, speed: float, end: float) -> Callable[[str, np.random.Generator], Drop]:
    """Return the drops of a model: its start moved by up to `spread` rad or m, and by a speed in 1/s."""

    def make(kind: str, rng: np.random.Generator) -> Drop:
        mech = with_restitutions(mbdae.load(kind), rng)
        while True:
            given, rates = mech.start
            q = mech.manifold.integrate(given, spread * rng.uniform(-1, 1, mech.nv))
            v = rates * rng.uniform(0.5, 1.5) + speed * rng.normal(size=mech.nv)
            try:
                q, v = mech.assemble(q, v)
            except mbdae.errors.InputError:
                continue
            if open_gap(mech, q) > 0:
                return Drop(kind, mech, q, v, end)

    return make


def gaps(mech: Mechanism, *qs: Array) -> Array:
    """Return the gaps of all stops and contacts at configurations, (n, k), positive where they are open."""
    rows, contacts = AllRows(mech.system()), [x for x in mech.switches if isinstance(x, Unilateral)]
    values = (rows(0.0, q)[0] for q in qs)
    return np.array([[x.sign * g[x.row] for x in contacts] for g in values]).reshape(len(qs), -1)


def open_gap(mech: Mechanism, q: Array) -> float:
    """Return the smallest gap; infinite without contacts."""
    return float(gaps(mech, q).min(initial=np.inf))


def carried(model: pin.Model, parent: int, joint: Any, name: str, *inertia: Any) -> int:
    """Add a joint with a body and a frame of the same name."""
    j = int(model.addJoint(parent, joint, pin.SE3.Identity(), name))
    model.appendBodyToJoint(j, pin.Inertia(*inertia), pin.SE3.Identity())
    model.addFrame(pin.Frame(name, j, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return j


def empty() -> pin.Model:
    """Return a tree without bodies."""
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -G])
    return model


def body_on_contacts(kind: str, rng: np.random.Generator) -> Drop:
    """A rigid body in space with three to five corners falls on a smooth plane."""
    model, e = empty(), float(rng.choice(RESTITUTIONS))
    size = rng.uniform(0.1, 0.3, 3)
    mass = float(rng.uniform(0.5, 3))
    body = carried(model, 0, pin.JointModelFreeFlyer(), "body", mass, np.zeros(3), mass * np.diag(size**2))
    closures = []
    for k in range(int(rng.integers(3, 6))):
        place = pin.SE3(np.eye(3), size * rng.choice([-1.0, 1.0], 3) * rng.uniform(0.7, 1.3, 3))
        model.addFrame(pin.Frame(f"corner{k}", body, 0, place, pin.FrameType.OP_FRAME))
        frames, name = ("world", f"corner{k}"), f"corner{k}"
        closures.append(Closure(kind="in_plane", frames=frames, unilateral=True, restitution=e, name=name))
    mech, q = Mechanism(model, closures), pin.neutral(model)
    q[3:7] = pin.Quaternion(pin.exp3(0.5 * rng.normal(size=3))).coeffs()
    q[2] += float(rng.choice([0.01, 0.1, 0.5])) - open_gap(mech, q)
    return Drop(kind, mech, q, float(rng.choice([0.0, 0.5, 2.0])) * rng.normal(size=6), 1.0)


def rods_on_contacts(kind: str, rng: np.random.Generator) -> Drop:
    """Up to four rods, hinged to each other, fall on a smooth plane; hinges have stops."""
    model, joint, place = empty(), 0, pin.SE3(pin.utils.rotate("x", np.pi / 2), np.zeros(3))
    e, closures, stops = float(rng.choice(RESTITUTIONS)), [], []
    for k in range(int(rng.integers(2, 5))):
        length, mass = float(rng.uniform(0.3, 0.8)), float(rng.uniform(0.2, 2))
        moments = mass * length**2 / 12 * np.array([1e-2, 1.0, 1.0])
        joint = int(model.addJoint(joint, pin.JointModelPlanar() if not k else pin.JointModelRZ(), place, f"rod{k}"))
        inertia = pin.Inertia(mass, np.array([length / 2, 0, 0]), np.diag(moments))
        model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
        place = pin.SE3(np.eye(3), np.array([length, 0, 0]))
        model.addFrame(pin.Frame(f"tip{k}", joint, 0, place, pin.FrameType.OP_FRAME))
        closures.append(
            Closure(kind="in_plane", frames=("world", f"tip{k}"), unilateral=True, restitution=e, name=f"tip{k}")
        )
        if k:
            limits = {"lower": -float(rng.uniform(0.2, 1)), "upper": float(rng.uniform(0.2, 1))}
            stops.append(Stop(joint=f"rod{k}", restitution=float(rng.choice(RESTITUTIONS)), **limits))
    mech, q = Mechanism(model, closures, stops=stops), pin.neutral(model)
    turn = rng.uniform(-0.8, 0.8)
    q[2:4] = np.cos(turn), np.sin(turn)
    q[4:] = [rng.uniform(0.9 * x.lower, 0.9 * x.upper) for x in stops]
    q[1] += float(rng.choice([0.01, 0.1, 0.5])) - gaps(mech, q)[0, : len(closures)].min()
    return Drop(kind, mech, q, float(rng.choice([0.0, 0.5, 2.0])) * rng.normal(size=model.nv), 1.0)


def rods_with_friction(kind: str, rng: np.random.Generator) -> Drop:
    """A rod whose rounded ends fall on a rough floor."""
    model, radius, e = empty(), 0.01, float(rng.choice(RESTITUTIONS[:-1]))
    x = carried(model, 0, pin.JointModelPX(), "x", 0.0, np.zeros(3), np.zeros((3, 3)))
    z = carried(model, x, pin.JointModelPZ(), "z", 0.0, np.zeros(3), np.zeros((3, 3)))
    length, mass = float(rng.uniform(0.2, 0.6)), float(rng.uniform(0.3, 2))
    inertia = mass * length**2 / 3 * np.eye(3) * float(rng.uniform(0.3, 1.0))
    rod = carried(model, z, pin.JointModelRY(), "rod", mass, np.zeros(3), inertia)
    closures, forces = [], []
    for name, side in (("left", -length), ("right", length)):
        model.addFrame(pin.Frame(name, rod, 0, pin.SE3(np.eye(3), np.array([side, 0, 0])), pin.FrameType.OP_FRAME))
        more = {"grip": "longitudinal", "unilateral": True, "restitution": e}
        closures.append(Closure.rolling("world", name, radius, name=f"{name} end", **more))
        forces.append(CoulombFriction(closure=f"{name} end", coefficient=float(rng.uniform(0.05, 0.8)), exact=True))
    mech, q = Mechanism(model, closures, forces), pin.neutral(model)
    q[2] = rng.uniform(-1, 1)
    q[1] += float(rng.choice([0.01, 0.1, 0.5])) - open_gap(mech, q)
    return Drop(kind, mech, q, float(rng.choice([0.0, 0.5, 2.0])) * rng.normal(size=3), 1.0)


KINDS: dict[str, Callable[[str, np.random.Generator], Drop]] = {
    "pendulum_on_stop": of_model(1.0, 1.0, 3.0),
    "slider_crank_with_stop": of_model(1.0, 1.0, 1.5),
    "bouncing_chain": of_model(0.4, 0.7, 0.8),
    "body on contacts": body_on_contacts,
    "rods on contacts": rods_on_contacts,
    "woodpecker": of_model(0.02, 0.3, 0.2),
    "stick_slip_slider": of_model(1.0, 1.0, 1.5),
    "rod with friction": rods_with_friction,
    "ratchet": of_model(0.1, 1.0, 2.0),
    "geneva_drive": of_model(0.0, 0.0, 2.0),
}
