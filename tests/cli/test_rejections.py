"""Invalid input is rejected in one line that names it and lists valid values."""

import numpy as np
import pinocchio as pin
import pytest
from chains import rod, tree

import mbdae
from mbdae import Closure, Hessenberg, JointDamping, JointSpring, JointTorque, Mechanism, SpringDamper
from mbdae.errors import AssemblyError, InputError, UnknownNameError


@pytest.fixture(scope="module")
def four_bar():
    return mbdae.load("four_bar")


def rejected(kind, call, *words):
    with pytest.raises(kind) as caught:
        call()
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message, message
    return caught.value


SOLVE = [
    ({"method": "pherk7"}, ["unknown method 'pherk7'", "did you mean", "herk1, herk2", "pherk6"]),
    ({"step": -1e-3}, ["step must be a positive number", "-0.001"]),
    ({"step": 0}, ["step must be a positive number"]),
    ({"step": np.nan}, ["step must be a positive number"]),
    ({"step": np.array([0.1])}, ["step must be a positive number"]),
    ({"first_step": -1}, ["first_step must be a positive number"]),
    ({"max_step": 0}, ["max_step must be a positive number"]),
    ({"step": True}, ["step must be a positive number", "True"]),
    ({"step": 1e-300}, ["step = 1e-300", "rounds to t"]),
    ({"max_steps": "a"}, ["max_steps must be a positive number", "'a'"]),
    ({"max_steps": np.nan}, ["max_steps must be a positive number"]),
    ({"project": np.ones(2)}, ["project is True, False or 'auto'", "array([1., 1.])"]),
    ({"rtol": "x"}, ["rtol = 'x'"]),
    ({"rtol": np.ones(2)}, ["rtol = array"]),
    ({"atol": "x"}, ["atol", "'x'"]),
    ({"formulation": "index1", "method": "RK45", "baumgarte": "ab"}, ["baumgarte is a pair", "'ab'"]),
    ({"rtol": 0}, ["rtol = 0", "at least 2.2e-14"]),
    ({"rtol": -1e-6}, ["rtol = -1e-06"]),
    ({"rtol": np.nan}, ["rtol = nan"]),
    ({"rtol": np.inf}, ["rtol = inf"]),
    ({"atol": -1.0}, ["atol", "-1.0"]),
    ({"atol": np.nan}, ["atol"]),
    ({"step": np.inf}, ["step must be a positive number", "inf"]),
    ({"first_step": np.inf}, ["first_step must be a positive number", "inf"]),
    ({"atol": np.ones(5)}, ["atol", "(5,)"]),
    ({"atol": np.ones(5), "first_step": 1e-3}, ["atol", "(5,)"]),
    ({"t_eval": [0.5, 0.2]}, ["t_eval must run from 0.0 to 1.0"]),
    ({"t_eval": [0.5, 1.2]}, ["t_eval"]),
    ({"t_eval": []}, ["t_eval"]),
    ({"t_eval": "soon"}, ["t_eval", "'soon'"]),
    ({"t_eval": [0.0, np.nan]}, ["t_eval"]),
    ({"t_span": "5 s"}, ["t_span is an end, or a start and an end", "'5 s'"]),
    ({"t_span": (0, 1, 2)}, ["t_span"]),
    ({"t_span": (0, np.inf)}, ["t_span must be finite"]),
    ({"q": np.zeros(2)}, ["q has shape (2,), expected (3,)"]),
    ({"q": {"crank": 1.0}}, ["q is an array of 3 numbers", "assemble"]),
    ({"q": [np.nan, 0, 0]}, ["q is not finite"]),
    ({"v": np.zeros((3, 1))}, ["v has shape (3, 1)"]),
]


@pytest.mark.parametrize(("options", "words"), SOLVE, ids=[str(o)[:40] for o, _ in SOLVE])
def test_arguments_of_solve(four_bar, options, words):
    arguments = {"t_span": (0, 1), **options}
    rejected(InputError, lambda: mbdae.solve(four_bar, **arguments), *words)


def test_numbers_of_numpy_are_numbers(four_bar, tmp_path):
    options = {"t_span": (np.int64(0), np.float32(0.5)), "max_steps": np.int64(1000)}
    tolerances = {"rtol": np.float32(1e-5), "atol": np.float32(1e-7), "max_step": np.int64(1)}
    for more in ({"step": np.float32(0.1)}, tolerances):
        sol = mbdae.solve(four_bar, **options, **more)
        assert sol.success
        sol.save(tmp_path / "run.npz")
        assert mbdae.Solution.load(tmp_path / "run.npz").settings == sol.settings
    assert mbdae.solve(four_bar, (0, 0.1), atol=0.0).success
    assert mbdae.solve(four_bar, (0, 0.1), atol=np.full(6, 1e-8)).success


def test_what_is_not_a_problem():
    for given in (None, 3):
        rejected(InputError, lambda x=given: mbdae.solve(x, (0, 1)), "Mechanism", "name or path", f"got {given}")
    rejected(UnknownNameError, lambda: mbdae.solve("four_bra", (0, 1)), "'four_bra'", "did you mean 'four_bar'")


@pytest.mark.parametrize("kind", ["spherical", "free", "planar", "continuous"])
def test_turns_that_vanish(kind):
    mech = Mechanism(tree([kind], [0]))
    joint = mech.joint_names[0]
    rejected(InputError, lambda: mech.assemble({joint: [0.0] * mech.nq}), repr(joint), "is not a rotation")
    rejected(InputError, lambda: mech.assemble(np.zeros(mech.nq)), "q is not on the manifold", "vanish")


def test_a_start_that_leaves_closures_open(four_bar):
    q, v = four_bar.assemble({"crank": 0.7}, {"crank": 2.0})
    assert mbdae.solve(four_bar, (0, 0.1), q, v).success
    for i in range(3):
        wrong = q.copy()
        wrong[i] += 1e-3
        rejected(InputError, lambda w=wrong: mbdae.solve(four_bar, (0, 1), w, v), "not consistent", "'pin'", "assemble")
        wrong = v.copy()
        wrong[i] += 1e-3
        rejected(InputError, lambda w=wrong: mbdae.solve(four_bar, (0, 1), q, w), "not consistent", "'pin'", "m/s")
    gap = rejected(InputError, lambda: mbdae.solve(four_bar, (0, 1), q + [0.1, 0, 0], v))
    size = np.linalg.norm(four_bar.residual(q + [0.1, 0, 0], v)[0])
    assert f"{size:.3g}" in str(gap)
    again = four_bar.assemble(q + [1e-3, 0, 0], v + [0, 1e-3, 0])  # the remedy of the message
    assert mbdae.solve(four_bar, (0, 0.1), *again).success


def test_the_worst_closure_of_a_start_is_named():
    mech = mbdae.load("andrews_squeezer")
    q, v = (x.copy() for x in mech.start)
    q[mech.joint_names.index("delta")] += 0.1  # moves K4 only
    rejected(InputError, lambda: mbdae.solve(mech, (0, 1), q, v), "'K2-K4'")


def test_a_start_off_the_manifold():
    mech = Mechanism(tree(["free", "ruby"], [0, 1]))
    q, v = pin.neutral(mech.model), np.zeros(7)
    assert mbdae.solve(mech, (0, 0.01), q, v).success
    for i in (6, 7):
        wrong = q.copy()
        wrong[i] = 2.0
        rejected(InputError, lambda w=wrong: mbdae.solve(mech, (0, 1), w, v), "quaternions")
    assert pin.isNormalized(mech.model, mech.assemble(wrong, v)[0])


def test_an_inconsistent_textbook_problem():
    problem = Hessenberg(
        f=lambda t, y, z: np.array([y[1] + z[0], -y[0]]), g=lambda t, y: y[:1] - np.sin(t), y0=(0.5, 0.0), z0=(0.0,)
    )
    rejected(InputError, lambda: mbdae.solve(problem, (0, 1)), "not consistent", "0.5")
    rejected(InputError, lambda: mbdae.solve(problem, (0, 1), np.zeros(2)), "are arguments for mechanisms")


def test_assembly(four_bar):
    both = {"crank": 1.0, "coupler": 2.0}
    error = rejected(AssemblyError, lambda: four_bar.assemble(both), "'pin' is violated", "fixed: crank, coupler")
    assert error.closure == "pin"
    assert error.violation > 0.1
    rejected(AssemblyError, lambda: four_bar.assemble(v=both), "velocity", "'pin'", "m/s")
    rejected(UnknownNameError, lambda: four_bar.assemble({"cranc": 1.0}), "unknown joint 'cranc'", "mean 'crank'")
    rejected(UnknownNameError, lambda: four_bar.assemble(v={"x": 1.0}), "valid: crank, coupler, rocker")
    rejected(InputError, lambda: four_bar.assemble({"crank": np.nan}), "'crank' takes 1 finite")
    ball = mbdae.load("ball_on_turntable")
    rejected(InputError, lambda: ball.assemble({"ball": [0, 0, 1]}), "7 finite configuration values (x, y, z, qx, ")
    rejected(InputError, lambda: ball.assemble({"table": [0, 0, 1]}), "1 finite configuration value (its angle), or 2")
    rejected(InputError, lambda: four_bar.assemble({"crank": [1.0, 2.0]}), "'crank' takes 1")
    rejected(InputError, lambda: four_bar.assemble(np.zeros(5)), "q has shape (5,)")


def test_names_of_frames_and_joints(four_bar):
    model = four_bar.model
    closure = lambda: Mechanism(model, [Closure.point("coupler_tip", "rocker_top")])  # noqa: E731
    error = rejected(UnknownNameError, closure, "unknown frame 'rocker_top'", "did you mean 'rocker_tip'", "world")
    assert error.kind == "frame"
    assert "rocker_tip" in error.valid
    forces = [
        JointDamping(joint="x", damping=1.0),
        JointSpring(joint=("crank", "x"), stiffness=1.0),
        JointTorque(joint="x", torque=1.0),
    ]
    for force in forces:
        rejected(UnknownNameError, lambda f=force: Mechanism(model, [], [f]), "unknown joint 'x'", "valid: crank")
    spring = SpringDamper(frames=("world", "x"), stiffness=1.0)
    rejected(UnknownNameError, lambda: Mechanism(model, [], [spring]), "unknown frame 'x'")
    pair = JointTorque(joint="crank", torque=(1.0, 2.0))
    rejected(InputError, lambda: Mechanism(model, [], [pair]), "1 torque value")
    rejected(InputError, lambda: Mechanism(model, [], [3.0]), "a force is", "got float")
    two = [Closure.point("coupler_tip", "rocker_tip", name="pin")] * 2
    rejected(InputError, lambda: Mechanism(model, two), "different names", "pin, pin")


def test_models_and_files():
    rejected(UnknownNameError, lambda: mbdae.load("four_bat"), "unknown model 'four_bat'", "did you mean 'four_bar'")
    rejected(InputError, lambda: mbdae.load("four_bar.toml"), "no such file")


def test_closures_written_wrongly():
    rejected(InputError, lambda: Closure.distance("a", "b", -1.0), "Closure: length", "greater than 0")
    rejected(InputError, lambda: Closure.point("a", "a"), "'a' with itself")
    rejected(InputError, lambda: Closure(kind="weld", frames=("a", "b")), "kind", "'point'")
    rejected(InputError, lambda: Closure(kind="point", frames=("a", "b"), length=1.0), "key length", "PointClosure")
    rejected(InputError, lambda: Closure.revolute("a", "b", axis=(0.0, 0.0, 0.0)), "axis must not be zero")
    rejected(InputError, lambda: Closure.revolute("a", "b", axis=(np.inf, 0.0, 0.0)), "finite")
    rejected(InputError, lambda: Closure(kind="point", frames=("a", "b"), stiffness=1.0), "unknown key stiffness")
    rejected(InputError, lambda: JointDamping(joint="a", damping=-1.0), "JointDamping: damping")


def test_a_massless_chain_is_assembled_but_does_not_move():
    model = pin.Model()
    joint, tip = rod(model, 0, pin.SE3.Identity(), 1.0, "a", mass=0.0)
    rod(model, joint, tip, 1.0, "b", mass=0.0)
    mech = Mechanism(model, [Closure.point("b_tip", "world")])
    q, v = mech.assemble({}, {"a": 1.0}, guess={"b": 3.0})
    np.testing.assert_allclose(q, [0, np.pi], atol=1e-9)
    sol = mbdae.solve(mech, (0, 1), q, v)
    assert sol.status == "singular"
    assert "joint 'a'" in sol.message


@pytest.mark.parametrize("call", [mbdae.drift, mbdae.order, mbdae.compare, mbdae.info, mbdae.report])
def test_studies_say_what_they_take(call):
    rejected(InputError, lambda: call(3), f"{call.__name__} takes a", "got 3")


def test_drift_takes_runs_and_no_names_of_models():
    rejected(InputError, lambda: mbdae.drift("four_bar"), "takes a Solution", "'four_bar'")


DAMPING, PIN = mbdae.JointDamping(joint="crank", damping=1.0), mbdae.Closure.point("a", "b")


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda mech: mech.assemble(guess=np.zeros(3)), ["guess must be a table of values by joint", "array"]),
        (lambda mech: mech.assemble(q=3), ["q must be a table of values by joint, or all of them", "got 3"]),
        (lambda mech: mbdae.load("four_bar", forces=3), ["forces are a list", "got 3"]),
        (lambda mech: mbdae.load("four_bar", forces=DAMPING), ["forces are a list", "got JointDamping("]),
        (lambda mech: mbdae.load("four_bar", forces=[mbdae.JointSpring]), ["one of Bushing", "the class JointSpring"]),
        (lambda mech: mbdae.load("four_bar", closures=PIN), ["closures are a list of", "got PointClosure("]),
        (lambda mech: mbdae.load("four_bar", drivers=[3]), ["drivers are a list of mbdae.Driver", "got 3"]),
        (lambda mech: mbdae.load("four_bar", motors=[3]), ["motors are a table of controls by name", "got [3]"]),
        (lambda mech: mbdae.Mechanism(mech.model, [DAMPING]), ["closures are a list of", "JointDamping("]),
        (lambda mech: mbdae.Mechanism("four_bar"), ["a model is a pinocchio.Model", "got 'four_bar'"]),
        (lambda mech: mbdae.solve(mech, (0, 0.01))("soon"), ["t = nan is outside"]),
        (lambda mech: mbdae.solve(mech, (0, 0.01)).resampled(0.01), ["times have the shape (m,), got ()"]),
        (lambda mech: mbdae.assembly_modes(mech, "crank", at="far"), ["must be a number", "'far'"]),
        (lambda mech: mbdae.assembly_modes(mech, "crank", most=0), ["most must be a positive number", "got 0"]),
        (lambda mech: mbdae.check_gradients(mech, steps="many"), ["steps must be a number", "'many'"]),
        (lambda mech: mbdae.load_path(mech, "weight", -1), ["from one factor to another", "got -1"]),
        (lambda mech: mbdae.load_path(mech, "weight", (0, "a")), ["from one factor to another", "'a'"]),
        (lambda mech: mbdae.inverse_dynamics(mech, ("now", *[np.zeros(3)] * 3), "crank"), ["t of a motion", "'now'"]),
    ],
)
def test_other_calls_say_what_they_take(four_bar, call, words):
    rejected(InputError, lambda: call(four_bar), *words)


def test_a_replay_says_what_it_takes(tmp_path):
    rejected(InputError, lambda: mbdae.animate("run", tmp_path / "run.html"), "takes a Solution", "'run'")
    sol, path = mbdae.solve(mbdae.load("four_bar"), (0, 0.01)), tmp_path / "run.html"
    rejected(InputError, lambda: mbdae.animate(sol, path, ghosts=sol), "ghosts are solutions by name")  # type: ignore[arg-type]
    rejected(InputError, lambda: mbdae.animate(sol, path, ghosts={"other": 3}), "ghost 'other'", "got 3")  # type: ignore[dict-item]
    rejected(InputError, lambda: mbdae.animate(sol, path, choices={"other": 3}), "choice 'other'", "got 3")  # type: ignore[dict-item]
    rejected(InputError, lambda: mbdae.animate(sol, path, signals="q.crank"), "signals are", "'q.crank'")  # type: ignore[arg-type]
    rejected(InputError, lambda: mbdae.animate(sol, path, fps="fast"), "fps must be", "'fast'")  # type: ignore[arg-type]
    for name in ("plots", "traces", "arrows"):
        rejected(InputError, lambda name=name: mbdae.animate(sol, path, **{name: 3}), f"{name} is", "got 3")
    mbdae.animate(sol, path, plots="q.crank", traces="rocker_tip", arrows="pin")
    assert path.exists()


def test_lists_of_names_say_what_they_take(four_bar):
    def compare(**more):
        return lambda: mbdae.compare(four_bar, (0, 0.1), **{"methods": ["pherk5"], "rtol": [1e-3], **more})

    rejected(UnknownNameError, compare(methods=[four_bar]), "unknown method", "valid: alpha", "DOP853")
    rejected(InputError, compare(methods=3), "methods is a list of names, got 3")
    rejected(InputError, compare(formulations=3), "formulations is a list of names, got 3")
    rejected(UnknownNameError, compare(reference=[four_bar, "radau9"]), "unknown method", "valid: alpha")
    rejected(InputError, compare(rtol=1e-3), "rtol is a list of numbers, got 0.001")
    rejected(InputError, compare(rtol=None, steps=10), "steps is a list of whole numbers, got 10")
    for wrong in ("ten", np.nan, np.inf, None, True):
        rejected(InputError, compare(rtol=None, steps=[wrong]), "steps are whole numbers of at least 1")
    rejected(InputError, lambda: mbdae.order(four_bar, 3), "methods is a list of names, got 3")  # type: ignore[arg-type]
    assert [p.method for p in compare(methods="herk3", formulations="ggl")().points] == ["ggl:herk3"]


def test_values_of_a_table_have_names():
    words = "JointSpring takes its values by name", "stiffness", "got 'crank', 3.0"
    rejected(InputError, lambda: JointSpring("crank", 3.0), *words)  # type: ignore[call-arg]


def test_an_event_is_a_function():
    rejected(InputError, lambda: mbdae.Event(3), "an event is a signal or a function", "got 3")  # type: ignore[arg-type]


def test_small_gaps_and_words_for_numbers(four_bar):
    rejected(InputError, lambda: four_bar.assemble(q={"crank": "a"}), "crank", "'a'")
    rejected(InputError, lambda: mbdae.Event(lambda t, q, v: 1.0, direction="up"), "direction", "'up'")  # type: ignore[arg-type]
    complex_force = mbdae.load("four_bar", forces=[lambda t, q, v: 1j * v])
    rejected(InputError, lambda: mbdae.solve(complex_force, (0, 1)), "expected shape (3,)")
