"""Every command on every kind of model that comes with mbdae, and on its saved run: a result, or a one-line error with
a true reason. Short commands run on every model.

An error is justified if a reason of `REASONS` matches whose condition holds (`model_facts`). Any other error fails the
test, as does a line on standard error that is neither a warning of mbdae nor the error.
"""

import re
import shlex
from collections.abc import Callable
from typing import NamedTuple

import pytest
from commands import call
from model_facts import SHORT, Facts, drive_of

import mbdae
from mbdae import Mechanism
from mbdae.cli.model import ChosenModel
from mbdae.errors import EquilibriumError
from mbdae.mechanism.tree.tree_terms import flexible_bodies
from mbdae.studies.comparison.reference_motion import ReferenceMotion
from mbdae.studies.order.order import order as measure_order
from mbdae.studies.statics import contacts

LIKE = {  # larger models of the kind of another one, which alone runs the long studies
    "ball_on_turntable": "snakeboard", "bicycle": "rolling_disc", "bricard": "four_bar", "heavy_top": "pendulum",
    "flyball_governor": "double_pendulum", "humanoid_stance": "dual_arm", "jansen_walker": "cam_follower",
    "n_four_bar": "four_bar", "rattleback": "chaplygin_sleigh", "slider_crank": "four_bar", "sleeping_top": "pendulum",
    "spring_four_bar": "four_bar", "stewart_platform": "dual_arm",
}  # fmt: skip
LONG = r"compare .*ggl|order|report|animate|sweep|equilibria|load-path|root-locus|fit|view"
FIGURES = ("work_precision", "drifts", "convergence", "posture", "motion")
COARSE = {  # resolution of studies
    "report.report.TOLERANCES": (1e-4, 1e-6), "view.sliders.POSES": 7, "statics.equilibria.INPUTS": 1,
    "statics.equilibria.POINTS": 61, "replay.plot_panels.POINTS": 50, "replay.replay.MIN_FRAMES": 5,
    "replay.replay.MAX_FRAMES": 9, "view.sliders.MAX_SLIDERS": 2, "replay.html_page.COMPRESSION_LEVEL": 0,
    "order.measurement.Measurement.max_solves": 3000, "statics.continuation.MAX_STEP": 0.3,
    "kinematics.curve.curve_tracing.PREDICTOR_ERROR": 0.2,
}  # fmt: skip
tightest_run, rest = ReferenceMotion.tightest, contacts.find_equilibrium_on_contacts


class Reason(NamedTuple):
    """An expected error: commands, message, and condition."""

    commands: str
    words: str
    true: Callable[[Facts], bool]


POSES = r"kinematics|inverse-dynamics .*--drive|equilibria"
REASONS = [
    Reason(r".*", r"^doubtful: not resolved: mode \d of ", lambda f: bool(flexible_bodies(f.mech.model))),
    Reason(r"fit .*gravity", r"(mass matrix is|closures' equations are) singular",  # steps too long for a vibration
           lambda f: bool(flexible_bodies(f.mech.model))),
    Reason(r"inverse-dynamics .*csv", r"cannot follow the table .* with closed loops",  # eight steps for a vibration
           lambda f: bool(flexible_bodies(f.mech.model))),
    Reason(r"equilibria", r"^flexible bodies leave more than one degree of freedom: hold",
           lambda f: bool(flexible_bodies(f.mech.model))),
    Reason(r"inverse-dynamics .*--drive", r"cannot produce the motion .* are missing", lambda f: f.free() > 1),
    Reason(r"kinematics|equilibria", r"^'.*' slides without bound: give", lambda f: f.movable == 1),
    Reason(r"fit", r"not finite|cannot be repeated: .* singular", lambda f: f.coarse == "nonfinite"),
    Reason(POSES, r"has nonholonomic rows: its position depends on the path", lambda f: bool(f.rolls)),
    Reason(POSES, r"is active only in ranges of '.*'", lambda f: bool(f.windows)),
    Reason(POSES, r"^{movable} degrees of freedom are left( \(inactive: .*\))?: hold", lambda f: f.movable > 1),
    Reason(POSES, r"^no degree of freedom is left for '.*'", lambda f: f.movable == 0),
    Reason(POSES, r"^joint '.*' has \d coordinates: only joints of one coordinate", lambda f: not f.single),
    Reason(r"equilibria", r"^a driver prescribes '.*': there is no branch",
           lambda f: bool(f.mech.drivers) and all(d.speed is None for d in f.mech.drivers)),
    Reason(r"equilibria", r"^a driver prescribes the speed of '.*': there is no branch",
           lambda f: any(d.speed is not None for d in f.mech.drivers)),
    Reason(r"solve .*--formulation|compare .*ggl", r"unilateral constraints and switches need formulation 'index2'",
           lambda f: f.switches),
    Reason(r"solve .*index1", r"^event '.*': states jump in formulations", lambda f: bool(f.mech.resets)),
    Reason(r"modes|linearize|root-locus", r"has no degree of freedom left, resting on '.*': it has no modes",
           lambda f: f.switches),
    Reason(r"inverse-dyn", r"^inverse dynamics does not support coulomb_friction", lambda f: f.regularized_interfaces),
    Reason(r"inverse-dynamics .*npz$", r"has no drivers or motors: name the joints", lambda f: not f.acts),
    Reason(r"inverse-dynamics .*csv", r"^unknown joint of one coordinate '.*'; valid", lambda f: bool(f.several)),
    Reason(r"inverse-dynamics .*csv|fit", r"times (of a motion )?must increase, got .* impact", lambda f: f.switches),
    Reason(r"modes|root-locus|linearize|load-path", r"has no degree of freedom left: (it has no modes|nothing moves)",
           lambda f: f.held == 0 or bool(f.mech.states)),  # an integrator keeps its joint at the reference
    Reason(r"modes|root-locus|linearize|equilibrium|load-path",
           r"^(no value of .* has modes: )?no stable equilibrium found in \d+ iterations: .* is unbalanced",
           lambda f: not f.rests),
]  # fmt: skip
CODES = {
    "modes": {0, 1}, "equilibrium": {0, 1, 3}, "equilibria": {0, 1}, "order": {0, 1, 3}, "fit": {0, 1, 3},
    "solve": {0, 1}, "compare": {0, 1}, "sweep": {0, 1},
}  # fmt: skip


def judged(facts: Facts, command: str, code: int, err: str) -> None:
    """Check the result of a command: exit code, lines, and the reason of an error."""
    said = [line.removeprefix("mbdae: ") for line in err.splitlines()]
    assert all(line.startswith("mbdae: ") for line in err.splitlines()), f"{command}\n{err}"
    errors = [line for line in said if not line.startswith("warning: ")]
    for line in said:
        assert not re.search(r"encountered in|Warning|Error\b|Traceback", line), f"{command}: {line}"
    if code in (0, 3) or (code == 1 and not errors):
        assert code in CODES.get(command.split()[0], {0}), f"{command}: exit {code}"
        return
    assert code in (1, 2), f"{command}: exit {code}"
    assert len(errors) == 1, f"{command}: {errors}"
    reasons = [r for r in REASONS if re.match(r.commands, command)]
    said = [r for r in reasons if re.search(r.words.replace("{movable}", str(facts.movable)), errors[0])]
    assert said, f"{command}: {errors[0]!r} is none of {[r.words for r in reasons]}"
    assert any(r.true(facts) for r in said), f"{command}: {errors[0]!r} is untrue"


def brief(name: str) -> float:
    """Span in s of studies that compute a reference or many runs: a fortieth, with the woodpecker's first impact."""
    return SHORT.get(name, 0.1) / (6 if name == "woodpecker" else 40)


def every_command(name: str, mech: Mechanism, drive: str, folder) -> list[str]:
    """The commands, coarse and short; joints of several coordinates by their first one."""
    end = SHORT.get(name, 0.1)
    part, short, joints = end / 4, brief(name), ",".join(mech.joint_names)
    signal = next(s for s in mech_signals(mech) if s.startswith(f"v.{drive}"))
    column = next(s for s in mech_signals(mech) if s.startswith(f"q.{drive}"))
    first = drive if signal == f"v.{drive}" else f"{drive}.1"  # of the inputs and outputs of a linear system
    (folder / "sweep.toml").write_text(
        f'model = "{name}"\nend = {part}\ntimes = 3\noutputs = ["{signal}"]\nworkers = 1\n'
        "[grid]\ngravity.2 = [-9.0, -9.1]\n"
    )
    return [
        f"info {name}",
        f"solve {name} -t {end} --rtol 1e-4 -o run.npz",
        f"solve {name} -t {part} --step {part / 8} -m radau3 -o run.csv",
        f"solve {name} -t {part} --rtol 1e-4 -m radau5",
        f"solve {name} -t {part} --rtol 1e-4 -m pherk5 --formulation ggl",
        f"solve {name} -t {part} --rtol 1e-4 -m dop853 --formulation index1",
        "drift run.npz",
        f"compare {name} -t {short} -m herk3 -m radau3 --rtol 1e-3 --repeats 1",
        f"compare {name} -t {short} -m ggl:herk3 --rtol 1e-3 --repeats 1",
        f"order {name} -m herk2 -t {short} --steps 10",
        "animate run.npz -o page.html",
        f"report {name} -t {short} -m herk3 --rtol 1e-3 --repeats 1 -o report.html",
        "sweep sweep.toml",
        f"equilibrium {name}",
        f"equilibria {name} --drive {drive} --from -0.5 --to 0.5",
        f"load-path {name} --load gravity --from 1 --to 1.01",
        f"modes {name}",
        f"linearize {name} --inputs {first} --outputs q.{first}",
        f"root-locus {name} gravity.2=-9:-10:2",
        f"kinematics {name} --drive {drive} --points 5 --turns 0.2",
        f"inverse-dynamics {name} run.npz",
        f"inverse-dynamics {name} run.npz -a '{joints}'",
        f"inverse-dynamics {name} run.csv -a '{joints}'",
        f"inverse-dynamics {name} --drive {drive} --speed 1 --points 5 --from 0.1 --to 0.2",
        f"fit {name} run.csv -p gravity.2=-9.9:-9.7 -s {column} --step {part / 4}",
        f"view {name} -o view.html",
    ]


def mech_signals(mech: Mechanism) -> list[str]:
    """Names of coordinates and velocities."""
    return list(mbdae.solve(mech, (0, 1e-6), method="herk2", step=1e-6).signals())


@pytest.mark.slow
@pytest.mark.parametrize("name", mbdae.model_names())
def test_each_gives_a_result_or_a_true_reason(name, tmp_path, monkeypatch):
    page, report = "mbdae.studies.report.page", "mbdae.studies.report.report"
    for module in ("mbdae.studies.fit.page", page):  # in this order: the first keeps what it imports of the second
        monkeypatch.setattr(f"{module}.image", lambda *_, **__: "")  # matplotlib takes longer than all the rest
    for figure in FIGURES:
        monkeypatch.setattr(f"{page}.{figure}", lambda *_, **__: None)
    monkeypatch.setattr(f"{page}.replay_page", lambda *_, **__: "")  # `animate` makes the same one
    orders, tightest, rests = [], {}, {}

    def tightest_once(motion, variant, rtol):
        key = motion.t_span, motion.times.tobytes(), str(variant), rtol
        if key not in tightest:
            tightest[key] = tightest_run(motion, variant, rtol)
        return tightest[key]

    monkeypatch.setattr(ReferenceMotion, "tightest", tightest_once)  # of both comparisons and the report

    def rest_once(moved, t, v, locked, q, find):
        if moved is not mech:
            return rest(moved, t, v, locked, q, find)
        key = t, v.tobytes(), locked.tobytes(), q.tobytes(), find
        if key not in rests:
            try:
                rests[key] = rest(mech, t, v, locked, q, find)
            except EquilibriumError as e:
                rests[key] = e
        if isinstance(rests[key], EquilibriumError):
            raise rests[key]
        return rests[key]

    for study in ("statics.equilibrium", "modes.operating_point"):
        monkeypatch.setattr(f"mbdae.studies.{study}.find_equilibrium_on_contacts", rest_once)  # one search for all

    def measured(mech, *_, **__):
        orders.append(measure_order(mech, ["herk2"], T=brief(name), steps=10))
        return orders[-1]

    monkeypatch.setattr("mbdae.studies.order.order.order", measured)
    monkeypatch.setattr(f"{report}.order", lambda mech, *_, **__: orders[-1] if orders else measured(mech))
    for constant, value in COARSE.items():
        monkeypatch.setattr(f"mbdae.studies.{constant}", value)
    mech = mbdae.load(name)
    for method in ("load", "problem"):  # each command would read the files of the model again, a fifth of all
        monkeypatch.setattr(ChosenModel, method, lambda self: mech)
    drive = drive_of(mech)
    facts = Facts(name, drive)
    if alike := LIKE.get(name):
        small = mbdae.load(alike)
        assert Facts(alike, drive_of(small)).kind == facts.kind
    for command in every_command(name, mech, drive, tmp_path):
        if alike and re.match(LONG, command):
            continue
        code, _, err = call(*shlex.split(command), cwd=tmp_path)
        judged(facts, command, code, err)
