"""Stops of a mechanism that come from the joint limits of its files."""

from collections.abc import Iterator, Sequence

import numpy as np
import pinocchio as pin

from ..errors import InputError
from .closures.unilateral_constraint import Stop
from .tree.frames import find_joint, joint_names


def resolve_stops(model: pin.Model, stops: Sequence[Stop]) -> tuple[Stop, ...]:
    """Return the stops with the joint limits of the model.

    Raises:
        UnknownNameError: for an unknown joint.
        InputError: for a joint without limits, with limits in the wrong order, or an unbounded one.
    """
    out = tuple(resolved for stop in stops for resolved in (_joint_limits(model, stop) if stop.limits else (stop,)))
    for stop in out:
        for name in stop.between:
            joint = find_joint(model, name)
            if (joint.nq, joint.nv) != (1, 1):
                what = "has an unbounded angle" if joint.nv == 1 else f"has {joint.nv} coordinates"
                raise InputError(f"stop {stop.name!r}: joint {name!r} {what}; a stop needs one bounded coordinate")
    return out


def _joint_limits(model: pin.Model, stop: Stop) -> Iterator[Stop]:
    names = stop.between or joint_names(model)
    has_limits = False
    for name in names:
        joint = find_joint(model, name)
        if (joint.nq, joint.nv) != (1, 1):
            continue
        lower, upper = (float(x[joint.idx_q]) for x in (model.lowerPositionLimit, model.upperPositionLimit))
        given = {key: x for key, x in (("lower", lower), ("upper", upper)) if np.abs(x) < np.finfo(float).max}
        if lower > upper:
            raise InputError(f"joint {name!r} has limits in the wrong order: {lower:g} to {upper:g}")
        if not given or lower == upper:
            continue
        has_limits = True
        title = f"{stop.name} {name}" if stop.name and not stop.joint else stop.name or f"{name} stop"
        rest = {"restitution": stop.restitution, "rest": stop.rest}
        yield Stop(joint=name, name=title, **given, **rest)
    if not has_limits:
        subject = f"joint {stop.joint!r} has" if stop.joint else "the joints have"
        raise InputError(f"stop with limits = true: {subject} none in the source; give lower and upper")
