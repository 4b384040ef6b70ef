"""Studies on mechanisms with one feature each: each gives a result, warns, or rejects it with a true reason.

`REFUSED` lists by feature the studies that reject it and their messages, `WARNED` those that ignore it with a warning.
All others give a result; nothing else warns.
"""

import re
import warnings
from pathlib import Path

import numpy as np
import pytest

import mbdae
from mbdae.errors import MbdaeError

BASE = """
title = "Slider-crank"
[[body]]
name = "crank"
parent = "world"
joint = "revolute"
axis = [0.0, 1.0, 0.0]
mass = 0.5
com = [0.05, 0.0, 0.0]
inertia = [1e-4, 5e-4, 5e-4, 0.0, 0.0, 0.0]
[[body]]
name = "rod"
parent = "crank"
joint = "revolute"
axis = [0.0, 1.0, 0.0]
xyz = [0.1, 0.0, 0.0]
mass = 0.4
com = [0.175, 0.0, 0.0]
inertia = [1e-4, 4e-3, 4e-3, 0.0, 0.0, 0.0]
[[body]]
name = "slider"
parent = "world"
joint = "prismatic"
axis = [1.0, 0.0, 0.0]
mass = 0.6
[[frame]]
name = "rod_tip"
parent = "rod"
xyz = [0.35, 0.0, 0.0]
[[closure]]
name = "pin"
kind = "revolute"
frames = ["rod_tip", "slider"]
axis = [0.0, 1.0, 0.0]
[[force]]
kind = "joint_torque"
name = "motor"
joint = "crank"
torque = 0.3
{}
[start]
q = {{ crank = -1.5 }}
guess = {{ rod = 1.8, slider = 0.34 }}
"""
WHEEL = """
[[body]]
name = "wheel"
parent = "world"
joint = "revolute"
axis = [0, 1, 0]
mass = 1.0
inertia = [1, 1, 1, 0, 0, 0]
"""
ON = '{ kind = "steps", points = [[0, 0], [0.035, 1]] }'
LINE = '{ kind = "polynomial", coefficients = [-1.5, 2.0] }'
PID = '[[force]]\nkind = "joint_pid"\nname = "pid"\njoint = "slider"\nkp = 100.0\nreference = 0.34\n'
FEATURES = {
    "plain": "",
    "stop": '[[stop]]\njoint = "slider"\nupper = 0.37\nrestitution = 0.5',
    "rope": (
        '[[closure]]\nname = "rope"\nkind = "distance"\nframes = ["world", "slider"]\nlength = 0.37\nunilateral = true'
    ),
    "stiction": '[[force]]\nkind = "joint_friction"\njoint = "slider"\nfriction = 1.0\nstatic = 2.0',
    "clutch": '[[clutch]]\njoint = "crank"\nname = "free wheel"',
    "ratchet": '[[clutch]]\njoint = "crank"\npitch = 0.2\nname = "pawl"',
    "command": '[[clutch]]\njoint = "crank"\nname = "lock"\nengaged = ' + ON,
    "window": (
        WHEEL + '[[closure]]\nname = "gate"\nkind = "ratio"\njoints = ["wheel", "crank"]\ncoefficients = [1.0]\n'
        'within = { joint = "crank", windows = [[-1.6, -1.2]] }'
    ),
    "rolling": (
        WHEEL + '[[closure]]\nname = "gear"\nkind = "ratio"\njoints = ["wheel", "crank"]\ncoefficients = [2.0]'
    ),
    "bearing": '[[force]]\nkind = "coulomb_friction"\nclosure = "pin"\ncoefficient = 0.2\nradius = 0.01',
    "driver": '[[driver]]\nname = "drive"\njoint = "crank"\nmotion = ' + LINE,
    "speed": '[[driver]]\nname = "drive"\njoint = "crank"\nspeed = 2.0',
    "controller": PID + "ki = 10.0",
    "sampled": PID + "rate = 100.0",
    "singular start": "# two bars of one length: their tip may stay at the crank's pivot",
    "dependent": '[[closure]]\nname = "again"\nkind = "point"\nframes = ["rod_tip", "slider"]',
}
COARSE = {  # resolution of studies
    "statics.equilibria.INPUTS": 1, "statics.equilibria.POINTS": 61, "view.sliders.POSES": 7,
    "replay.plot_panels.POINTS": 50, "replay.replay.MIN_FRAMES": 5, "replay.replay.MAX_FRAMES": 9,
    "replay.html_page.COMPRESSION_LEVEL": 0,
    "statics.continuation.MAX_STEP": 0.3, "kinematics.curve.curve_tracing.PREDICTOR_ERROR": 0.2,
}  # fmt: skip
ONE_SIDED = ("stop", "rope", "stiction", "clutch", "ratchet", "command", "window")
BEGAN = "the run began in a singular configuration"
LEFT_OUT = "statics and modes ignore "
POSES = ("kinematics", "assembly_modes", "inverse of a drive", "equilibria")
STATICS = ("equilibrium", "equilibria", "load_path", "modes", "root_locus", "linearize")
WARNED = dict.fromkeys(set(ONE_SIDED) - {"stop", "rope"}, STATICS)
GIVEN = "a driver prescribes 'crank': there is no branch of equilibria over it"
RIGID = "'Slider-crank' has no degree of freedom left: it has no modes"
NOTHING = dict.fromkeys(("modes", "root_locus", "linearize"), RIGID)
FIXED = {"equilibria": GIVEN, "load_path": "has no degree of freedom left: nothing moves with the load"}
FRICTION = "does not support coulomb_friction, of closure 'pin'"
ROLLS = "'gear' has nonholonomic rows: its position depends on the path"
REFUSED: dict[str, dict[str, str]] = {
    **{feature: {"ggl": "need formulation 'index2', got 'ggl'"} for feature in ONE_SIDED},
    "bearing": {
        **{f"inverse of a {motion}": f"^inverse dynamics {FRICTION}" for motion in ("run", "drive", "table")},
        **dict.fromkeys(("equilibrium", "modes", "root_locus", "linearize"), f"a linearization {FRICTION}"),
    },
    "rolling": dict.fromkeys((*POSES, "inverse of a table"), ROLLS),
    "driver": FIXED | NOTHING,
    "speed": FIXED | NOTHING | {"equilibria": "a driver prescribes the speed of 'crank': there is no branch of"},
    "controller": FIXED | {"equilibria": "an integrator prescribes 'crank'"},  # the slider is at the reference
    "sampled": dict.fromkeys(STATICS, "'pid' is a sampled controller: statics and modes need a continuous one"),
}
REFUSED["singular start"] = {
    **dict.fromkeys(("compare", "sensitivity", "gradient", "optimize"), BEGAN),
    "order": f"no reference for 'Slider-crank': pherk6 fails at every step size up to T = 0.02, .*{BEGAN}",
    **dict.fromkeys(
        ("kinematics", "assembly_modes", "equilibria"),
        "the closures lose rank in this pose, in which several branches intersect: start next to it",
    ),
    # on either branch the motor's 0.3 N m act against a weight of at most 9.81 |0.5 * 0.05 - 0.4 * 0.075| = 0.05 N m
    **dict.fromkeys(("equilibrium", "load_path", "modes", "root_locus", "linearize"), "no stable equilibrium found"),
}
REFUSED["window"] |= dict.fromkeys(POSES, "'gate' is active only in ranges of 'crank'")
REFUSED["window"] |= {"inverse of a table": "'gate' has nonholonomic rows: its position depends on the path"}


def singular(text: str) -> str:
    """The slider-crank with a rod as short as the crank, folded back onto it: the rod can rotate alone."""
    changes = {
        "xyz = [0.35, 0.0, 0.0]": "xyz = [0.1, 0.0, 0.0]",
        "q = { crank = -1.5 }": "q = { crank = -1.5707963267948966 }\nv = { crank = 1.0, slider = 0.2 }",
        "rod = 1.8, slider = 0.34 }": "rod = 3.141592653589793, slider = 0.0 }\nguess_v = { rod = -2.0 }",
    }
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    return text


def end_of(column: str):
    """The last value of a signal, as a cost with its derivative."""

    def cost(signals):
        x = signals[column]
        return float(x[-1]), {column: np.eye(len(x))[-1]}

    return cost


def studies(path: Path):
    """Names of studies and calls, coarse and short; those of a run use the first one's."""
    mech, mass = mbdae.load(path), "body.rod.mass"
    sol = mbdae.solve(mech, (0, 0.05), rtol=1e-5)
    assert BEGAN in sol.message if path.stem == "singular start" else sol.ended, sol.message
    file = path.with_suffix(".npz")
    sol.save(file)
    times = [0.0, 0.1, 0.2, 0.3]
    return {
        "info": lambda: mbdae.info(mech),
        "saved run": lambda: mbdae.Solution.load(file).signals(),
        "ggl": lambda: mbdae.solve(mech, (0, 0.01), rtol=1e-4, formulation="ggl", method="pherk5"),
        "drift": lambda: mbdae.drift(mbdae.Solution.load(file)),
        "compare": lambda: mbdae.compare(mech, (0, 0.02), methods=["herk3", "radau3"], rtol=[1e-3], repeats=1),
        "order": lambda: mbdae.order(mech, ["herk2"], T=0.02, steps=10),
        "kinematics": lambda: mbdae.kinematics(mech, "crank", points=9, turns=0.5),
        "assembly_modes": lambda: mbdae.assembly_modes(mech, "crank"),
        "inverse of a run": lambda: mbdae.inverse_dynamics(mech, file, "crank"),
        "inverse of a drive": lambda: mbdae.inverse_dynamics(
            mech, mbdae.kinematics(mech, "crank", span=(-1.5, -0.5), points=9), "crank", speed=1.0
        ),
        "inverse of a table": lambda: mbdae.inverse_dynamics(
            mech, {"t": times, "crank": [-1.5, -1.45, -1.4, -1.35]}, "crank"
        ),
        "equilibrium": lambda: mbdae.equilibrium(mech),
        "equilibria": lambda: mbdae.equilibria(mech, "crank", span=(-1.5, 1.7)),
        "load_path": lambda: mbdae.load_path(mech, "gravity", (1, 1.02)),
        "modes": lambda: mbdae.modes(mech),
        "root_locus": lambda: mbdae.root_locus(str(path), "gravity.2", [-9.8, -9.9]),
        "linearize": lambda: mbdae.linearize(mech, mbdae.equilibrium(mech).q, inputs="crank", outputs="q.crank"),
        "sensitivity": lambda: mbdae.sensitivity(sol, [mass], model=str(path)),
        "gradient": lambda: mbdae.gradient(sol, end_of("q.crank"), [mass], model=str(path)),
        "optimize": lambda: mbdae.optimize(
            str(path), end_of("q.slider"), {mass: 0.4}, {mass: (0.3, 0.5)}, t_span=(0, 0.02), rtol=1e-5, iterations=1
        ),
        "sweep": lambda: mbdae.sweep(
            str(path), {mass: [0.4, 0.5]}, 0.02, outputs=["q.slider"], times=3, rtol=1e-5, workers=1
        ),
        "animate": lambda: mbdae.animate(mbdae.Solution.load(file), path.with_suffix(".html")),
        "view": lambda: mbdae.view(mech),
    }


@pytest.mark.slow
@pytest.mark.parametrize("feature", FEATURES)
def test_each_study_gives_a_result_or_a_true_reason(feature, tmp_path, monkeypatch):
    for name, coarse in COARSE.items():
        monkeypatch.setattr(f"mbdae.studies.{name}", coarse)
    path = tmp_path / f"{feature}.toml"
    text = BASE.format(FEATURES[feature])
    path.write_text(singular(text) if feature == "singular start" else text)
    rejected, warned, wrong = REFUSED.get(feature, {}), WARNED.get(feature, ()), []
    for study, call in studies(path).items():
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            try:
                str(call())
                text = ""
            except MbdaeError as e:
                text = str(e)
        assert "\n" not in text
        if not (re.search(rejected[study], text) if study in rejected else not text):
            wrong.append(f"{study}: {text!r}, expected {rejected.get(study, 'an answer')!r}")
        reported = {str(w.message) for w in said}
        if study in warned and not text and not (reported and all(x.startswith(LEFT_OUT) for x in reported)):
            wrong.append(f"{study} should say what it leaves out, and said {reported or 'nothing'}")
        elif reported and study not in warned:
            wrong.append(f"{study} warns: {reported}")
    assert not wrong, "\n".join(wrong)
