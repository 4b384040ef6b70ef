"""The solvers of work_precision.py: set-up, and one run of each. The settings are described in that script.

A solver is a function of a problem that returns a function of a tolerance or step size, or None if the program is not
installed. That function runs once and returns a `Run`; only the solver's loop is timed.
"""

from collections.abc import Callable
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np
import pinocchio as pin
from common import backends
from index1 import with_casadi, with_diffrax
from planar import Bar, Equations, Problem
from problems import DOUBLE_PENDULUM, pendulum_model
from runs import SAMPLES, Array, Run, Runner, installed
from scipy.integrate import solve_ivp

import mbdae


def order(problem: Problem, mech: mbdae.Mechanism) -> list[int]:
    """Positions of the bars' angles in q."""
    return [mech.joint_names.index(name) for name in problem.names]


def with_mbdae(problem: Problem, method: str, project: bool = False, cut: bool = False, **options: Any) -> Runner:
    """Methods of mbdae with step-size control."""
    mech = pendulum_model(cut=True) if cut else problem.model()
    at = order(problem, mech)
    start = dict(zip(problem.names, problem.start(), strict=True))
    if cut:
        start |= {"x": float(np.cos(start["upper"])), "z": float(np.sin(start["upper"]))}
        start["lower"] += start["upper"]
    q0, v0 = np.array([start[name] for name in mech.joint_names]), np.zeros(mech.nv)

    def run(rtol: float) -> Run | None:
        settings = {"method": method, "project": project and mech.ng > 0, "rtol": rtol, "atol": rtol, **options}
        sol = mbdae.solve(mech, (0, problem.end), q0, v0, **settings)
        if not sol.success:
            return None
        q = sol.q[-1][at].copy()
        if cut:
            q[1] -= q[0]
        g = max(np.abs(mech.residual(q, v)[0]).max() for q, v in zip(sol.q, sol.v, strict=True)) if mech.ng else 0.0
        return Run(sol.stats["seconds"], q, float(g))

    return run


def with_pinocchio(problem: Problem, baumgarte: float) -> Runner:
    """Scipy's DOP853 on `pin.constraintDynamics`; baumgarte in 1/s."""
    mech = problem.model()
    model, data, at, n = mech.model, mech.model.createData(), order(problem, mech), mech.nv
    contacts = pin.StdVec_RigidConstraintModel()
    for closure in mech.closures:
        ends = [model.frames[model.getFrameId(name)] for name in closure.frames]
        sides = [x for f in ends for x in (f.parentJoint, f.placement)]
        contact = pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, model, *sides, pin.ReferenceFrame.LOCAL)
        contact.m_baumgarte_parameters.Kp, contact.m_baumgarte_parameters.Kd = baumgarte**2, 2 * baumgarte
        contacts.append(contact)
    datas = pin.StdVec_RigidConstraintData()
    for contact in contacts:
        datas.append(contact.createData())
    pin.initConstraintDynamics(model, data, contacts, datas)
    proximal = pin.ProximalSettings(1e-12, 1e-10, 10)
    spring, eq, tau = problem.spring, Equations(problem), np.zeros(n)
    tau[at[0]] = problem.torque
    k = at[problem.names.index(spring[0])] if spring else 0

    def rate(t: float, y: Array) -> Array:
        q, v = y[:n], y[n:]
        if spring:
            arm = spring[1] * complex(np.cos(q[k]), np.sin(q[k]))
            d = spring[2] - eq.spring[1] - arm
            pull = spring[3] * (1 - spring[4] / abs(d)) * d
            tau[k] = arm.real * pull.imag - arm.imag * pull.real
        if not mech.ng:
            return np.concatenate([v, pin.aba(model, data, q, v, tau)])
        return np.concatenate([v, pin.constraintDynamics(model, data, q, v, tau, contacts, datas, proximal)])

    y0 = np.zeros(2 * n)
    y0[at] = problem.start()

    def run(rtol: float) -> Run | None:
        started = perf_counter()
        sol = solve_ivp(rate, (0, problem.end), y0, method="DOP853", rtol=rtol, atol=rtol)
        seconds = perf_counter() - started
        q = sol.y[:n][at].T
        return Run(seconds, q[-1], problem.gap(problem.absolute(q))) if sol.success else None

    return run


def with_solve_dae(problem: Problem) -> Runner | None:
    """Radau of solve_dae on the GGL form in absolute angles."""
    package = installed("solve_dae.integrate")
    if package is None:
        return None
    eq = Equations(problem, cut=("lower",) if problem is DOUBLE_PENDULUM else ())
    n, bars = eq.n, len(problem.bars)
    q0 = np.zeros(n)
    q0[:bars] = problem.absolute(problem.start())
    if eq.cut:
        q0[bars:] = np.cos(q0[0]), np.sin(q0[0])
    vdot, lam = eq.acceleration(q0, np.zeros(n))
    none = np.zeros(2 * eq.nc)
    y0, yp0 = np.concatenate([q0, np.zeros(n), none, none]), np.concatenate([np.zeros(n), vdot, none, lam])

    def run(rtol: float) -> Run | None:
        settings = {"method": "Radau", "rtol": rtol, "atol": rtol, "jac": eq.ggl_partials}
        started = perf_counter()
        sol = package.solve_dae(eq.ggl, (0, problem.end), y0, yp0, **settings)
        seconds = perf_counter() - started
        if not sol.success:
            return None
        g = float(np.abs(eq.B @ eq.e(sol.y[:n])[0] + eq.B0).max())
        return Run(seconds, problem.relative(sol.y[:bars, -1]), g)

    return run


def mjcf(problem: Problem, step: float) -> str:
    """The mechanism in MuJoCo's language, in its x-y plane."""

    def text(z: complex) -> str:
        return f"{z.real:.17g} {z.imag:.17g} 0"

    def body(b: Bar) -> str:
        sites = "".join(f'<site name="{b.name} {k}" pos="{text(z)}"/>' for k, z in marks if k.split()[1] == b.name)
        inside = "".join(body(child) for child in problem.bars if child.parent == b.name)
        return (
            f'<body pos="{text(b.hinge)}"><joint name="{b.name}" axis="0 0 1"/>{sites}<inertial pos="{text(b.com)}" '
            f'mass="{b.mass}" diaginertia="{b.inertia / 2} {b.inertia / 2} {b.inertia}"/>{inside}</body>'
        )

    marks = [
        (f"{i}{s} {n}", z) for i, (a, x, b, y) in enumerate(problem.pins) for s, n, z in (("a", a, x), ("b", b, y))
    ]
    pins = "".join(
        f'<connect site1="{a} {i}a {a}" site2="{b} {i}b {b}"/>' for i, (a, _, b, _) in enumerate(problem.pins)
    )
    ground = tendon = ""
    if problem.spring:
        name, at, anchor, stiffness, length = problem.spring
        marks.append((f"spring {name}", at))
        ground = f'<site name="anchor" pos="{text(anchor)}"/>'
        ends = f'<site site="{name} spring {name}"/><site site="anchor"/>'
        tendon = f'<tendon><spatial stiffness="{stiffness}" springlength="{length}">{ends}</spatial></tendon>'
    bodies = "".join(body(b) for b in problem.bars if b.parent is None)
    return f"""<mujoco><compiler angle="radian" boundmass="0" boundinertia="0"/>
<default><equality solref="{2 * step} 1" solimp="0.9999 0.9999 0.001"/></default>
<option timestep="{step}" integrator="RK4" gravity="0 {-problem.gravity} 0" iterations="100" tolerance="1e-14">
<flag contact="disable"/></option>
<worldbody>{ground}{bodies}</worldbody><equality>{pins}</equality>{tendon}</mujoco>"""


def with_mujoco(problem: Problem) -> Runner | None:
    """RK4 of MuJoCo with a solref of two steps."""
    mujoco = installed("mujoco")
    if mujoco is None:
        return None

    def run(step: float) -> Run | None:
        m = mujoco.MjModel.from_xml_string(mjcf(problem, step))
        d = mujoco.MjData(m)
        at = [m.joint(name).qposadr[0] for name in problem.names]
        d.qpos[at] = problem.start()
        d.qfrc_applied[at[0]] = problem.torque
        chunk, seen = round(problem.end / step / SAMPLES), []
        started = perf_counter()
        for _ in range(SAMPLES):
            mujoco.mj_step(m, d, chunk)
            seen.append(d.qpos[at])
        seconds = perf_counter() - started
        q = np.array(seen)
        return Run(seconds, q[-1], problem.gap(problem.absolute(q))) if np.isfinite(q).all() else None

    return run


def with_exudyn(problem: Problem, sparse: bool = False) -> Runner | None:
    """Generalized alpha of Exudyn as the trapezoidal rule on index 2; every hinge is a joint."""
    exu = installed("exudyn")
    if exu is None:
        return None
    from exudyn_model import plane, settings

    def run(step: float) -> Run | None:
        mbs, sensors = plane(exu, problem)
        s = settings(exu, problem.end, step)
        if sparse:
            s.linearSolver.solverType = exu.LinearSolverType.EigenSparse
        s.solution.sensors.writePeriod = problem.end / SAMPLES
        started = perf_counter()
        mbs.SolveDynamic(s)
        seconds = perf_counter() - started
        turned = np.array([mbs.GetSensorStoredData(i)[:, 3] for i in sensors]).T
        theta = problem.absolute(problem.start()) + turned
        return Run(seconds, problem.relative(theta[-1]), problem.gap(theta))

    return run


TUNED = {"four-bar": 10.0}  # 1/s: the fastest of several; 100 1/s for the others
SOFT = 10.0  # 1/s: Baumgarte's alpha of the equations with index 1
METHODS = {"pherk5": {}, "pherk5, projected": {"project": True}, "pherk6, projected": {"project": True}}
METHODS |= {"herk5, projected": {"project": True}, "radau5": {}, "pherk5, GGL": {"formulation": "ggl"}}
ADAMS = {"linear_multistep_method": "adams", "nonlinear_solver_iteration": "functional"}
Maker = Callable[[Problem], Runner | None]


def backend_of(problem: Problem, **settings: Any) -> str:
    """The fastest back end that has a method in a formulation."""
    mech = problem.model()
    try:
        mbdae.solve(mech, (0, 1e-6), step=1e-6, backend=backends()[-1], **settings)
    except mbdae.errors.InputError:
        return "python"
    return backends()[-1]


def ours(problem: Problem) -> dict[str, tuple[Maker, bool]]:
    """Methods of mbdae; those not in the compiled core are labelled so."""
    out: dict[str, tuple[Maker, bool]] = {}
    fast = backends()[-1]
    for name, options in METHODS.items():
        settings = {"method": name.split(",")[0], **options}
        if "formulation" in settings and not problem.pins:
            continue
        backend = backend_of(problem, **settings)
        title = name if backend == fast else f"{name}, in Python"
        out[title] = partial(with_mbdae, backend=backend, **settings), False
    if problem is DOUBLE_PENDULUM:
        cut = partial(with_mbdae, method="pherk5", project=True, cut=True, backend=fast)
        out["pherk5, projected, elbow cut"] = cut, False
    if fast != "python":
        slow = partial(with_mbdae, method="pherk5", project=True, backend="python")
        out["pherk5, projected, in Python"] = slow, False
    return out


def solvers(problem: Problem) -> dict[str, tuple[Maker, bool]]:
    """Return by name: the factory of the runner, and whether it takes steps instead of tolerances."""
    out = ours(problem)
    out["DOP853 on Pinocchio"] = partial(with_pinocchio, baumgarte=100.0), False
    if problem.title in TUNED:
        alpha = TUNED[problem.title]
        out[f"DOP853 on Pinocchio, alpha = {alpha:g}"] = partial(with_pinocchio, baumgarte=alpha), False
    return out | {
        "diffrax Dopri8": (partial(with_diffrax, alpha=SOFT), False),
        "casadi CVODES": (partial(with_casadi, solver="cvodes", alpha=SOFT, **ADAMS), False),
        "casadi IDAS": (partial(with_casadi, solver="idas", alpha=SOFT), False),
        "solve_dae Radau": (with_solve_dae, False),
        "MuJoCo RK4": (with_mujoco, True),
        "Exudyn": (with_exudyn, True),
    }
