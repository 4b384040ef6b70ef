"""Influence of tolerances and clearances on the poses of a mechanism with one degree of freedom."""

from collections.abc import Callable, Mapping, Sequence, Set

from ... import backend
from ...errors import InputError, is_number, require
from ...mechanism import Mechanism
from ...mechanism.discrete_sensitivity.parameter_partials import Parameters
from ...mechanism.formats.mechanism_file.parameter_units import parameter_units
from ...system import Array
from ..factories import MechanismFactory, Model, factory_of
from ..kinematics.curve_derivatives import CurveSignals
from ..kinematics.driven_mechanism import Hold, driven_mechanism
from ..kinematics.kinematics import kinematics
from ..kinematics.result import Kinematics
from ..sensitivity.run_parameters import named_values
from .clearances import displacements
from .dimension_patterns import expand_patterns
from .influences import influences
from .result import Tolerance, signal_units
from .second_order import hessians

__all__ = ["tolerance"]


def tolerance(
    model: Model,
    drive: str,
    signals: Sequence[str] = (),
    parameters: Mapping[str, float] | None = None,
    clearances: Mapping[str, float] | None = None,
    *,
    span: tuple[float, float] | None = None,
    turns: float = 1.0,
    hold: Hold = (),
    points: int = 73,
    q: Array | None = None,
    sigmas: float = 3.0,
    second_order: bool = False,
    values: Mapping[str, float] | None = None,
) -> Tolerance:
    """Analyse tolerances of parameters p and clearances of joints along the poses over an input u.

        do/dp = o_p - lam . g_p,   G^T lam = o_q,   |do| <= sum |do/dp_i| t_i + sum c_k |lam_k|

    The rows g(q, p, u) = 0 are those of closures, locked joints and the drive: lam are the reactions to a unit load
    along the signal o with the drive locked, so one transposed solve gives the influence of every parameter and
    clearance. A clearance c displaces a joint by a vector of length c in any direction that it locks. The statistical
    value is the root of the sum of squares of the same terms. The variance is
    sum (do/dp_i sigma_i)^2 + sum c_k^2 |lam_k|^2/r_k for normal deviations, sigma_i = t_i/sigmas, and contact in a
    uniformly distributed direction in r_k dimensions; to second order the variance has the further terms
    1/2 sum (H_ij sigma_i sigma_j)^2, and the mean shifts by 1/2 sum H_ii sigma_i^2. Loops may be spatial, and closures
    redundant.
    Source: Haug, Computer Aided Kinematics and Dynamics of Mechanical Systems (1989).

    Args:
        model: the mechanism, an argument of `mbdae.load`, or a function that returns one.
        drive: the input: a joint of one coordinate, or a driver of the mechanism.
        signals: signals of the pose: ``position.<frame>.x``, .y, .z, ``q.<joint>``; ``v.<joint>`` per unit speed of the
            input; ``holding``, the holding effort of the driver.
        parameters: tolerances t by dotted name or pattern, ``frame.rod_tip.xyz.0=5e-5``, ``joint.*.xyz.*=5e-5``: the
            value deviates by at most t. A name has precedence over patterns, and a pattern over earlier ones.
            Parameters from patterns that would violate redundant closures are omitted, and reported.
        clearances: clearances c in m by joint or closure, ``"wrist pin"=2e-5``.
        span: range of the input in rad or m; when left out, ``turns`` to both sides of the start pose.
        turns: number of full turns, if no span is given.
        hold: joints to lock in place, or at given values: joint=value.
        points: approximate number of poses of the curve.
        q: a pose on the requested branch, (nq,); the model's start when left out.
        sigmas: number of standard deviations in a tolerance: t = sigmas sigma.
        second_order: also compute mean shifts and deviations of second order in the parameters.
        values: values of the parameters; those of the model when left out.

    Raises:
        UnknownNameError: for an invalid name.
        InputError: for a tolerance that is not a positive number, parameters that would violate redundant closures, and
            as `mbdae.kinematics`.
        AssemblyError, StepError: as `mbdae.kinematics`.

    Example:
        >>> found = tolerance("slider_crank", "crank", ["position.slider_pin.x"],
        ...                   {"frame.rod_tip.xyz.0": 5e-5}, {"wrist pin": 2e-5})   # doctest: +SKIP
    """
    sizes, widths = _positive_sizes("tolerance", parameters), _positive_sizes("clearance", clearances)
    _check(sizes, widths, sigmas)
    factory = factory_of(model)
    sizes, matched = expand_patterns(factory, sizes)
    nominal = _nominal(factory, sizes, values)
    mech = model if isinstance(model, Mechanism) and values is None else factory.make(nominal)
    found = kinematics(mech, drive, span=span, turns=turns, hold=hold, points=points, q=q)

    def bind(changed: Mapping[str, float]) -> Parameters:
        return Parameters(lambda x: driven_mechanism(factory.make(x), drive, hold, found.q[0]), changed, backend.load())

    bound, left_out = _consistent(bind, nominal, matched, found)
    curve_signals = CurveSignals(found, lambda: bound)
    names = _require_signals(curve_signals, [signals] if isinstance(signals, str) else list(signals))
    tolerances = {name: sizes[name] for name in bound.values}
    H = None
    if second_order and tolerances:
        H = hessians(found, names, bind, bound.values, {name: t / sigmas for name, t in tolerances.items()})
    return Tolerance(
        found, tuple(names), signal_units(mech, names, found.unit), tolerances, widths, float(sigmas),
        influences(curve_signals, names, displacements(curve_signals, widths)), H, left_out,
        parameter_units(factory, tolerances),
    )  # fmt: skip


def _check(sizes: Mapping[str, float], widths: Mapping[str, float], sigmas: float) -> None:
    """Require tolerances or clearances, and a positive number of standard deviations.

    Raises:
        InputError: for neither, or another number.
    """
    if not (sizes or widths):
        raise InputError("give tolerances of parameters, name = tolerance, or clearances, joint or closure = clearance")
    if not (is_number(sigmas) and sigmas > 0):
        raise InputError(f"sigmas is a positive number, got {sigmas!r:.60}")


def _nominal(
    factory: MechanismFactory, sizes: Mapping[str, float], values: Mapping[str, float] | None
) -> dict[str, float]:
    """Return ``values`` of the parameters with tolerances, or without them those of the model.

    Raises:
        UnknownNameError, InputError: as `named_values`, and for names that differ from those of the tolerances.
    """
    nominal = named_values(factory, list(sizes) if values is None else values)
    if nominal.keys() != sizes.keys():
        different = ", ".join(sorted(nominal.keys() ^ sizes.keys()))
        raise InputError(f"values and tolerances have different names: {different}")
    return nominal


def _consistent(
    bind: Callable[[Mapping[str, float]], Parameters],
    nominal: Mapping[str, float],
    matched: Set[str],
    found: Kinematics,
) -> tuple[Parameters, tuple[str, ...]]:
    """Return the parameters without those from patterns that would violate redundant closures, and their names.

    Raises:
        InputError: if a parameter that is named in full would violate redundant closures.
    """
    bound, first = bind(nominal), (float(found.u[0]), found.q[0])
    left_out = tuple(name for name in bound.inconsistent(*first) if name in matched)
    if left_out:
        bound = bind({name: x for name, x in nominal.items() if name not in left_out})
    bound.require_consistent(*first)
    return bound, left_out


def _positive_sizes(kind: str, sizes: Mapping[str, float] | None) -> dict[str, float]:
    """Return tolerances or clearances by name as floats.

    Raises:
        InputError: for a size that is not a positive number.
    """
    require(sizes or {}, Mapping, f"a {kind} is name = size")
    for name, x in (sizes or {}).items():
        if not (is_number(x) and x > 0):
            raise InputError(f"the {kind} of {name!r} is a positive number, got {x!r:.60}")
    return {name: float(x) for name, x in (sizes or {}).items()}


def _require_signals(curve_signals: CurveSignals, names: Sequence[str]) -> list[str]:
    """Return the names of the signals, each of which must exist.

    Raises:
        UnknownNameError: for an unknown signal; lists the valid ones.
        InputError: without a signal, or for one that is named twice.
    """
    if not names:
        raise InputError("name at least one signal, as position.FRAME.x or q.JOINT")
    for i, name in enumerate(names):
        curve_signals[name]
        if name in names[:i]:
            raise InputError(f"signal {name!r} is named twice")
    return list(names)
