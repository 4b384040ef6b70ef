"""A thousand runs: mbdae.sweep over threads and processes, mbdae.ensemble, diffrax's vmap, and MuJoCo's rollout.

Slider-cranks that start at other speeds of the crank take 10 s with pherk5 at rtol 1e-8; their final positions of the
slider are kept. The time of a sweep is that of the whole call, with loading, assembly and the table; ratios are those
of the times of the same executor with one worker, and of all to one thread. Tables must be equal bit for bit.

Four-bars from rest at other angles of the crank take 10 s, by mbdae.ensemble, by Dopri8 of diffrax (JAX, compiled,
vectorized over all runs) on equations that were written by hand, without stabilization (index1.py), and by RK4 in
MuJoCo's rollout, a batch of runs in C, with the settings of peers.py. The table has milliseconds of CPU per run, summed
over all threads (medians; other load of the machine affects them less than the time of the call), and the largest error
of the joint angles at the end, against mbdae at rtol 1e-12: for mbdae the difference from tighter runs of one method.

Slider-cranks take 0.1 s from other speeds of the crank, by mbdae.ensemble from starts as arrays and from start values,
and by mbdae.sweep, and with other masses of the rod and gravity: microseconds of the call per run on one and on two
threads; the ends must be equal bit for bit. All alternate with runs of the core without Python around them, the fastest
that the machine allows.

Models with modes or flexible bodies run by mbdae.solve, on one and on two threads, from starts that differ by 1e-6 of
the speeds; the ends must be equal bit for bit.

Run: python examples/benchmarks/ensembles.py [--brief]
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from time import perf_counter, process_time
from typing import Any

import numpy as np
from common import brief, digits, machine, medians, ratio, table
from index1 import STEPS, rate_in_jax
from peers import mjcf
from problems import FOUR_BAR
from runs import installed

import mbdae
from mbdae.integrate.options.options import RunOptions
from mbdae.integrate.run.core_runs import solve_in_core
from mbdae.integrate.run.run_setup import prepare_at

CORE = "the core alone"
SHORT = 0.1  # s
BY_SOLVE = {"woodpecker": 2.0, "stick_slip_slider": 5.0, "flexible_four_bar": 0.3, "pendulum_on_stop": 3.0}  # s
CASES = [(executor, workers) for executor in ("threads", "processes") for workers in (1, 2)]
SPREAD = 0.2  # rad: of the angles of the cranks of four-bars
OURS, THEIRS = (1e-5, 1e-6, 1e-8), (1e-6, 1e-8, 1e-10)  # rtol
ROLLOUTS, CHUNK = (5e-3, 1e-3), 500  # s: steps of MuJoCo; steps of a call, which returns the states of all


def main(argv: Sequence[str] | None = None) -> dict[tuple[str, int], float]:
    """Print the tables and return seconds by executor and workers."""
    short = brief(argv, __doc__)
    n, end, repeats = (8, 0.2, 1) if short else (1000, 10.0, 3)
    times = sweeps(n, end, repeats, CASES[:3] if short else CASES)
    print(machine("diffrax") + "\n")
    rows = [
        [executor, str(workers), digits(t), digits(n / t), ratio(times[executor, 1], t), ratio(times["threads", 1], t)]
        for (executor, workers), t in times.items()
    ]
    header = [f"{n} runs of {end:g} s", "workers", "seconds", "runs per second", "speed over one worker"]
    print(table([*header, "over one thread"], rows) + "\n")
    header = [f"{n} four-bars, {end:g} s", "rtol or step", "ms of CPU per run", "error, rad"]
    print(table(header, four_bars(n, end, repeats)) + "\n")
    header = [f"{16 * n} runs of {SHORT:g} s", "us per run, 1 thread", "us per run, 2 threads", "speed"]
    print(table(header, short_runs(16 * n, repeats)) + "\n")
    header = ["runs by mbdae.solve", "s each", "ms per run, 1 thread", "ms per run, 2 threads", "speed"]
    print(table(header, by_solve(max(4, n // 20), 0.01 if short else 1.0, repeats)))
    return times


def sweeps(n: int, end: float, repeats: int, cases: Sequence[tuple[str, int]]) -> dict[tuple[str, int], float]:
    """Return seconds of sweeps by executor and workers."""
    speeds = {"start.v.crank": np.linspace(4.0, 12.0, n).tolist()}
    settings = {"outputs": ["final q.slider"], "method": "pherk5", "rtol": 1e-8}
    tables: dict[tuple[str, int], list[dict[str, Any]]] = {}

    def run(executor: str, workers: int) -> float:
        started = perf_counter()
        found = mbdae.sweep("slider_crank", speeds, end, executor=executor, workers=workers, **settings)
        seconds = perf_counter() - started
        tables[executor, workers] = found.rows
        return seconds

    times = medians({key: partial(run, *key) for key in cases}, repeats)
    if any(rows != tables[cases[0]] for rows in tables.values()):
        raise RuntimeError("the tables of threads and processes differ")
    return times


def four_bars(n: int, end: float, repeats: int) -> list[list[str]]:
    """Return rows of a table: program, tolerance, milliseconds of CPU per run, largest error."""
    mech = FOUR_BAR.model()
    first, guess = FOUR_BAR.start()[0], dict(zip(mech.joint_names, FOUR_BAR.start(), strict=True))
    crank = mech.joint_names[0]
    angles = first + np.linspace(-SPREAD, SPREAD, n)
    q = np.array([mech.assemble(q={crank: x}, guess=guess)[0] for x in angles])
    at_rest = np.zeros(mech.nv)

    def ours(rtol: float, workers: int) -> np.ndarray:
        return mbdae.ensemble(mech, q, at_rest, None, (0.0, end), rtol=rtol, workers=workers).q

    reference = ours(1e-12, 2)
    programs = {("mbdae, 1 thread", rtol): partial(ours, rtol, 1) for rtol in OURS}
    programs |= {("mbdae, 2 threads", rtol): partial(ours, rtol, 2) for rtol in OURS[-1:]}
    if theirs := vectorized(q, end):
        programs |= {("diffrax Dopri8", rtol): partial(theirs, rtol) for rtol in THEIRS}
    if rolled := rollout(q, end):
        programs |= {("MuJoCo rollout, RK4", step): partial(rolled, step) for step in ROLLOUTS}
    errors = {key: np.abs(run() - reference).max() for key, run in programs.items()}

    def milliseconds(run: Callable[[], np.ndarray]) -> float:
        started = process_time()
        run()
        return (process_time() - started) / n * 1e3

    costs = medians({key: partial(milliseconds, run) for key, run in programs.items()}, repeats)
    return [[name, f"{rtol:.0e}", digits(costs[name, rtol]), f"{errors[name, rtol]:.1e}"] for name, rtol in programs]


def short_runs(n: int, repeats: int) -> list[list[str]]:
    """Return rows of a table: function, microseconds per run on one and two threads, their ratio."""
    speeds, span = np.linspace(4.0, 12.0, n), (0.0, SHORT)
    varied = {"start.v.crank": speeds, "joint.crank_pin.mass": speeds / 12, "gravity.2": -speeds}
    mech = mbdae.load("slider_crank")
    v = speeds[:, None] / mech.start[1][0] * mech.start[1]

    def by_ensemble(v: np.ndarray | None, parameters: dict[str, np.ndarray] | None, workers: int) -> np.ndarray:
        return mbdae.ensemble(mech, None, v, parameters, span, workers=workers).q

    def by_sweep(name: str, workers: int) -> np.ndarray:
        settings = {"outputs": ["final q.slider"], "executor": "threads", "workers": workers}
        return mbdae.sweep(mech, {name: varied[name].tolist()}, span, **settings)["final q.slider"]

    functions = {CORE: core_alone(mech, v, span), "mbdae.ensemble, v": partial(by_ensemble, v, None)}
    for name, values in varied.items():
        functions[f"mbdae.ensemble, {name}"] = partial(by_ensemble, None, {name: values})
        functions[f"mbdae.sweep, {name}"] = partial(by_sweep, name)
    return [[title, *times] for title, times in on_threads(functions, 1e6 / n, repeats).items()]


def core_alone(mech: mbdae.Mechanism, v: np.ndarray, span: tuple[float, float]) -> Callable[[int], np.ndarray]:
    """Return runs without Python around them, half of them by each of two threads."""
    y = np.tile(mech.point(), (len(v), 1))
    y[:, mech.nq : mech.nq + mech.nv] = v
    options, never = RunOptions.from_settings(mech, span, {}), np.zeros(1, np.uint8)
    prepared = [prepare_at(mech, options, y[0]) for _ in range(2)]

    def run(workers: int) -> np.ndarray:
        halves = [(run, part, never) for run, part in zip(prepared, np.array_split(y, 2), strict=True)]
        with ThreadPoolExecutor(workers) as pool:
            return np.vstack([found.y for found in pool.map(lambda given: solve_in_core(*given), halves)])

    return run


def by_solve(n: int, part: float, repeats: int) -> list[list[str]]:
    """Return rows of a table: model, seconds, milliseconds per run on one and two threads, their ratio.

    Args:
        n: runs of each model.
        part: of the seconds of a run.
        repeats: of each measurement.
    """
    functions, spans = {}, {name: part * seconds for name, seconds in BY_SOLVE.items()}
    for name, end in spans.items():
        mech = mbdae.load(name)
        v = mech.start[1] * (1 + 1e-6 * np.arange(n))[:, None]

        def ends(workers: int, mech: Any = mech, v: Any = v, end: float = end) -> np.ndarray:
            return mbdae.ensemble(mech, None, v, None, (0.0, end), workers=workers).q

        functions[name] = ends
    return [[name, f"{spans[name]:g}", *times] for name, times in on_threads(functions, 1e3 / n, repeats).items()]


def on_threads(
    functions: dict[str, Callable[[int], np.ndarray]], scale: float, repeats: int
) -> dict[str, tuple[str, str, str]]:
    """Return the scaled times of functions of the number of workers on one and two threads, and their ratios."""
    found = dict[tuple[str, int], np.ndarray]()

    def run(title: str, workers: int) -> float:
        started = perf_counter()
        found[title, workers] = functions[title](workers)
        return (perf_counter() - started) * scale

    keys = [(title, workers) for title in functions for workers in (1, 2)]
    times = medians({key: partial(run, *key) for key in keys}, repeats)
    for title in functions:
        if not np.array_equal(found[title, 1], found[title, 2]):
            raise RuntimeError(f"the ends of {title} on one and two threads differ")
    both = {title: (times[title, 1], times[title, 2]) for title in functions}
    return {title: (digits(one), digits(two), ratio(one, two)) for title, (one, two) in both.items()}


def vectorized(q: np.ndarray, end: float) -> Callable[[float], np.ndarray] | None:
    """Return runs of all four-bars by diffrax from joint angles q (n, 3) at rest, rtol -> joint angles at the end."""
    diffrax = installed("diffrax")
    if diffrax is None:
        return None
    import jax
    import jax.numpy as jnp

    rate, bars = rate_in_jax(FOUR_BAR, 0.0), q.shape[1]
    y0 = jnp.asarray(np.hstack([FOUR_BAR.absolute(q), np.zeros_like(q)]))

    def solve(rtol: Any, y: Any) -> Any:
        control = diffrax.PIDController(rtol=rtol, atol=rtol)
        return diffrax.diffeqsolve(
            diffrax.ODETerm(rate), diffrax.Dopri8(), 0.0, end, 1e-4 * end, y, stepsize_controller=control,
            saveat=diffrax.SaveAt(t1=True), adjoint=diffrax.ForwardMode(), throw=False, max_steps=STEPS,
        ).ys[-1]  # fmt: skip

    run = jax.jit(jax.vmap(solve, in_axes=(None, 0)))
    return lambda rtol: FOUR_BAR.relative(np.asarray(run(rtol, y0))[:, :bars])


def rollout(q: np.ndarray, end: float) -> Callable[[float], np.ndarray] | None:
    """Return runs of all four-bars by MuJoCo from joint angles q (n, 3) at rest, step -> joint angles at the end."""
    mujoco = installed("mujoco")
    if mujoco is None:
        return None
    from mujoco import rollout

    def run(step: float) -> np.ndarray:
        model = mujoco.MjModel.from_xml_string(mjcf(FOUR_BAR, step))
        data, left = mujoco.MjData(model), round(end / step)
        at = 1 + np.array([model.joint(name).qposadr[0] for name in FOUR_BAR.names])  # after the time
        states = np.zeros((len(q), 1 + model.nq + model.nv))
        states[:, at] = q
        while left:
            taken, _ = rollout.rollout(model, data, states, nstep=min(left, CHUNK))
            states, left = taken[:, -1], left - taken.shape[1]
        return states[:, at]

    return run


if __name__ == "__main__":
    main()
