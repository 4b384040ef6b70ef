"""Assembly: from poor initial estimates, near the estimate, with held coordinates, and its error messages."""

import pickle

import numpy as np
import pinocchio as pin
import pytest
import scipy.linalg
from chains import random_placement, random_q, rod, tree
from linkages import bar, point

import mbdae
from mbdae.errors import AssemblyError, InputError
from mbdae.mechanism.assembly import position_search
from mbdae.mechanism.closures.closure_error import largest_error
from mbdae.mechanism.model_settings import Start
from mbdae.mechanism.variant import variant
from mbdae.studies.info.info import info

CLOSED = 1e-10


def four_bar(a=1.0, b=2.0, c=1.5, d=2.0):
    """Bars a, b from the left, c from the right at a distance d."""
    model = pin.Model()
    left, tip = rod(model, 0, pin.SE3.Identity(), a, "crank")
    rod(model, left, tip, b, "coupler")
    rod(model, 0, pin.SE3(np.eye(3), np.array([d, 0.0, 0.0])), c, "rocker")
    return mbdae.Mechanism(model, closures=[mbdae.Closure.point("coupler_tip", "rocker_tip", name="pin")])


def violation(mech, q):
    return np.abs(mech.residual(q, np.zeros(mech.nv))[0]).max()


def test_every_guess_of_a_four_bar_leads_somewhere():
    mech = four_bar()
    rng = np.random.default_rng(0)
    for _ in range(200):
        q, _ = mech.assemble(q=rng.uniform(-np.pi, np.pi, 3))
        assert violation(mech, q) < CLOSED


def test_held_coordinates_keep_their_values():
    mech = four_bar()
    rng = np.random.default_rng(1)
    for crank in np.linspace(-3, 3, 13):
        guess = dict(zip(("coupler", "rocker"), rng.uniform(-np.pi, np.pi, 2), strict=True))
        q, v = mech.assemble(q={"crank": crank}, v={"crank": 2.0}, guess=guess)
        assert violation(mech, q) < CLOSED
        assert q[0] == crank
        assert v[0] == 2.0
        assert np.abs(mech.residual(q, v)[1]).max() < CLOSED


def test_the_branch_of_the_guess_is_kept():
    """Near either of the two configurations of the loop, that one is found, also from 20 degrees away."""
    mech = four_bar()
    for elbow in (1, -1):
        reach = np.linspace(0.3, 2.5, 12)
        guess = {"coupler": -1.0 * elbow, "rocker": 1.5 * elbow}
        for crank in elbow * reach:
            q, _ = mech.assemble(q={"crank": crank}, guess=guess)
            guess = {"coupler": q[1], "rocker": q[2]}
            far, _ = mech.assemble(q={"crank": crank}, guess={"coupler": q[1] + 0.35, "rocker": q[2] - 0.35})
            np.testing.assert_allclose(far, q, atol=1e-8)


def test_assembly_is_repeatable():
    mech = four_bar()
    first, again = (mech.assemble(q={"crank": 2.0}, guess={"coupler": 3.1, "rocker": 0.0})[0] for _ in range(2))
    np.testing.assert_array_equal(first, again)


def test_an_estimate_where_newton_stalls_is_left():
    """Coupler and rocker point away from each other along a line: no direction reduces the violation to first order."""
    mech = four_bar(1.0, 1.0, 1.0, 2.0)
    guess = {"coupler": np.pi, "rocker": 0.0}
    system = mech.system()
    g, G = system.closures(mech.coordinates({"crank": 0.0, **guess})[0], 0.0)
    assert np.linalg.norm(g) == pytest.approx(3.0)
    assert np.abs(G[:, 1:].T @ g).max() < 1e-12
    q, _ = mech.assemble(q={"crank": 0.0}, guess=guess)
    assert violation(mech, q) < CLOSED


def test_random_loops_in_space_close():
    """Six random revolute joints and a ball in a loop that exists: from estimates half a radian off."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        model = tree(["revolute"] * 3 + ["spherical"] + ["revolute"] * 2, [0, 1, 2, 3, 0, 5], seed)
        q = random_q(model, rng)
        data = model.createData()
        pin.framesForwardKinematics(model, data, q)
        tip, end = data.oMi[4] * random_placement(rng), data.oMi[6]
        model.addFrame(pin.Frame("a", 4, data.oMi[4].actInv(tip), pin.FrameType.OP_FRAME))
        model.addFrame(pin.Frame("b", 6, end.actInv(tip), pin.FrameType.OP_FRAME))
        mech = mbdae.Mechanism(model, closures=[mbdae.Closure.frame("a", "b")])
        guess = pin.integrate(model, q, rng.uniform(-0.5, 0.5, model.nv))
        found, _ = mech.assemble(q=guess)
        assert violation(mech, found) < CLOSED
        start = np.linalg.norm(pin.difference(model, guess, q))
        assert np.linalg.norm(pin.difference(model, guess, found)) < 1.001 * start


@pytest.mark.parametrize("scale", [1e-9, 1e-6, 1e-3, 1e3, 1e5, 1e9])
def test_a_slider_crank_of_any_size_is_assembled(scale):
    """The block is at x = a cos phi + sqrt(b^2 - a^2 sin^2 phi), its speed is dx/dphi w."""
    a, b, phi, w = 0.1, 0.3, 1.0, 2.0
    model = pin.Model()
    crank = bar(model, 0, (0, 0), a * scale, "crank")
    bar(model, crank, (a * scale, 0), b * scale, "rod")
    block = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "block")
    model.appendBodyToJoint(block, pin.Inertia.FromSphere(1.0, 0.1 * scale), pin.SE3.Identity())
    point(model, block, (0, 0), "gudgeon")
    mech = mbdae.Mechanism(model, [mbdae.Closure.revolute("rod_tip", "gudgeon", axis=(0, 1, 0), name="pin")])
    q, v = mech.assemble(q={"crank": phi}, v={"crank": w}, guess={"rod": -1.0})
    reach = np.sqrt(b**2 - (a * np.sin(phi)) ** 2)
    assert q[2] / scale == pytest.approx(a * np.cos(phi) + reach, abs=1e-12)
    assert v[2] / scale == pytest.approx(-a * np.sin(phi) * (1 + a * np.cos(phi) / reach) * w, abs=1e-12)
    open_by = {"crank": phi, "rod": -0.1}
    with pytest.raises(InputError, match="the start is not consistent"):
        mech.point(mech.coordinates(open_by)[0], np.zeros(3))
    with pytest.raises(AssemblyError, match="pin"):
        mech.assemble(q={"crank": phi, "block": 0.5 * scale})


def test_a_loop_that_cannot_close_says_what_stays_open():
    mech = four_bar(1.0, 1.0, 0.5, 4.0)
    with pytest.raises(AssemblyError) as caught:
        mech.assemble(q={"crank": 0.0})
    text = "no consistent configuration: closure 'pin' is violated by 1.5 m (fixed: crank)"
    assert str(caught.value) == text
    assert caught.value.violation == pytest.approx(1.5, rel=0.01)
    with pytest.raises(AssemblyError, match=r"'pin' is violated by 1\.5 m \(fixed: nothing\)"):
        mech.assemble()


def test_velocities_that_contradict_a_loop_are_rejected():
    mech = four_bar()
    with pytest.raises(AssemblyError, match=r"no consistent velocity: closure 'pin' is violated by .* m/s \(fixed"):
        mech.assemble(q={"crank": 1.0}, v={"crank": 1.0, "coupler": 1.0, "rocker": 0.0})


def test_lengths_and_angles_are_distinguished():
    model = tree(["rx", "py", "free"], [0, 1, 0])
    mech = mbdae.Mechanism(
        model,
        closures=[
            mbdae.Closure.frame("tip_1", "tip_2", name="weld"),
            mbdae.Closure.coupling("py_1", "rx_0", (0.0, 0.1), name="rack"),
            mbdae.Closure.coupling("rx_0", "py_1", (0.0, 0.1), name="pinion"),
        ],
    )
    assert mech.row_units.tolist() == ["m"] * 3 + ["rad"] * 3 + ["m", "rad"]
    assert largest_error(mech, np.array([3.0, 0, 4.0, 0.2, 0, 0, 0, 0])).text == "5 m and 0.2 rad"
    found = largest_error(mech, np.array([0, 0, 0, 0, 0, 0, 2.0, 1.0]), "/s")
    assert (found.name, found.text) == ("rack", "2 m/s")
    assert largest_error(mech, np.array([0, 0, 0, 0, 0, 0, 2.0, 3.0])).text == "3 rad"


def test_a_flipped_frame_is_not_closed():
    """The axes of a revolute pair may close antiparallel; the right configuration is found from there."""
    model = tree(["free"], [0])
    mech = mbdae.Mechanism(model, closures=[mbdae.Closure.revolute("ground", "tip_0", name="hinge")])
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    ground, tip = (model.frames[model.getFrameId(n)] for n in ("ground", "tip_0"))
    flipped = ground.placement * pin.SE3(pin.exp3(np.array([np.pi, 0, 0])), np.zeros(3)) * tip.placement.inverse()
    q, _ = mech.assemble(q=pin.SE3ToXYZQUAT(flipped))
    assert violation(mech, q) < CLOSED
    pin.framesForwardKinematics(model, data, q)
    axes = [data.oMf[model.getFrameId(n)].rotation[:, 2] for n in ("ground", "tip_0")]
    assert axes[0] @ axes[1] == pytest.approx(1.0)


def test_an_open_start_with_assemble_false_is_rejected(tmp_path):
    text = """
        [[body]]
        name = "bob"
        parent = "world"
        joint = "translation"
        mass = 1.0
        [[closure]]
        name = "string"
        kind = "distance"
        frames = ["world", "bob"]
        length = 1.0
        [start]
        q = { bob = [1.25, 0.0, 0.0] }
        """
    path = tmp_path / "bob.toml"
    path.write_text(text)
    mech = mbdae.load(path)
    with pytest.raises(AssemblyError, match=r"'string' is violated by 0\.25 m \(fixed: bob\)"):
        _ = mech.start
    path.write_text(text.replace("q = {", "guess = {"))
    mech = mbdae.load(path)
    assert mech.start[0] == pytest.approx([1, 0, 0])
    shown = info(mech)
    assert shown.g_loaded == pytest.approx(0.25)
    assert "'string' violated by 0.25 m" in str(shown)
    path.write_text(text.replace("q = {", "assemble = false\nguess = {"))
    for mech in (mbdae.load(path), mbdae.load(path, assemble=False)):
        with pytest.raises(InputError, match=r"the start is not consistent: closure 'string' is violated by 0\.25 m"):
            _ = mech.start
    path.write_text(text.replace("1.25", "1.0"))
    assert mbdae.load(path, assemble=False).start[0].tolist() == [1, 0, 0]


def test_massless_bodies_are_named():
    model = pin.Model()
    for i in range(2):
        model.addJoint(i, pin.JointModelRY(), pin.SE3(np.eye(3), np.array([i, 0.0, 0.0])), f"joint{i}")
    model.addFrame(pin.Frame("tip", 2, pin.SE3(np.eye(3), np.array([1.0, 0, 0])), pin.FrameType.OP_FRAME))
    mech = mbdae.Mechanism(model, closures=[mbdae.Closure.distance("world", "tip", 1.5)])
    with pytest.raises(InputError, match="the mass matrix is singular at joint 'joint0': a body without inertia"):
        mech.assemble(guess={"joint1": 1.0}, v=np.array([1.0, 1.0]))


@pytest.mark.parametrize("kind", ["frame", "prismatic", "revolute"])
def test_two_free_bodies_are_joined_from_any_pose(kind):
    """There are no obstacles; but from one estimate in seven undamped Gauss-Newton steps end with a flipped frame."""
    model = pin.Model()
    for name in "ab":
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
        tip = pin.SE3(pin.exp3(np.array([0.3, 0.5, -0.2])), np.array([0.2, 0.1, 0.3]))
        model.addFrame(pin.Frame(f"{name}_tip", joint, tip, pin.FrameType.OP_FRAME))
    mech = mbdae.Mechanism(model, [mbdae.Closure(kind=kind, frames=("a_tip", "b_tip"), name="weld")])
    rng = np.random.default_rng(0)
    for _ in range(20):
        turns = rng.standard_normal((2, 4))
        turns /= np.linalg.norm(turns, axis=1)[:, None]
        q, _ = mech.assemble(np.concatenate([*(np.concatenate([rng.uniform(-1, 1, 3), x]) for x in turns)]))
        assert violation(mech, q) < CLOSED
        a, b = (pin.XYZQUATToSE3(x).rotation @ tip.rotation for x in (q[:7], q[7:]))
        np.testing.assert_allclose(b[:, 2], a[:, 2], atol=1e-8)


def unequal_row(N):
    """Return a row of four-bars with pivots moved by 0.05 m in turn."""
    mech = mbdae.load("n_four_bar", N=N)
    model = mech.model.copy()
    for i in range(N + 1):
        model.jointPlacements[model.getJointId(f"crank_{i}")].translation[0] += 0.05 * (-1) ** i
    guess = mech.start_values.guess
    return mbdae.Mechanism(model, mech.closures), {"q": {"crank_0": np.pi / 2}, "guess": guess}


@pytest.mark.parametrize("N", [60, 300])
def test_a_long_chain_of_unequal_loops_assembles_from_a_rough_estimate(N, monkeypatch):
    """All bars are guessed as in the row of equal ones."""
    mech, given = unequal_row(N)
    starts, search = [], position_search.gauss_newton
    monkeypatch.setattr(position_search, "gauss_newton", lambda *at: starts.append(at) or search(*at))
    q, _ = mech.assemble(**given)
    assert len(starts) <= 2, "each loop ends near its guess: no other start is tried"
    assert violation(mech, q) < CLOSED
    first = 2 * np.arcsin(0.1 / (2 * np.sqrt(1 + 0.9**2)))  # loop 1: bars of 1 m on pivots 0.9 m apart
    assert abs(q[mech.model.joints[mech.model.getJointId("crank_1")].idx_q] - (np.pi / 2 - first)) < 0.06


def test_many_velocities_are_the_nearest_ones_in_the_mass_metric():
    mech, given = unequal_row(20)
    q, wanted = mech.assemble(**given)[0], np.random.default_rng(2).normal(size=mech.nv)
    G, M = mech.at(0.0, q).G, mech.mass_matrix(q)
    null = scipy.linalg.null_space(G, rcond=1e-8)
    nearest = null @ np.linalg.solve(null.T @ M @ null, null.T @ M @ wanted)
    assert mech.assemble(q, wanted)[1] == pytest.approx(nearest, abs=1e-10)


@pytest.mark.parametrize("name", ["slider_crank", "n_four_bar?N=12"])
def test_a_start_is_that_of_a_pickled_mechanism_and_of_a_variant(name):
    """Variants share the closed position, and what closes velocities there, also with sparse rows."""
    mech = mbdae.load(name)
    joint = mech.joint_names[0]
    first = mech.assemble(v={joint: 1.5})
    for other in (pickle.loads(pickle.dumps(mech)), variant(mech, duration=2.0)):
        for speed in (1.5, -3.0):
            q, v = other.assemble(v={joint: speed})
            np.testing.assert_array_equal(q, first[0])
            np.testing.assert_allclose(v, first[1] * speed / 1.5, rtol=1e-12, atol=1e-12)
            np.testing.assert_allclose(v, mbdae.load(name).assemble(v={joint: speed})[1], rtol=1e-12, atol=1e-12)
    with pytest.raises(AssemblyError):
        mech.assemble(v=dict.fromkeys(mech.joint_names, 1.0))


def test_a_driver_of_a_speed_leaves_the_position_of_the_start():
    mech, driver = four_bar(), mbdae.Driver(joint="crank", speed=2.0)
    start = Start(q={"crank": 1.1}, v={"crank": 9.0}, guess={"coupler": -0.5, "rocker": 1.0})
    for given in (start, start.model_dump()):  # a table of its values, too
        q, v = mbdae.Mechanism(mech.model, mech.closures, drivers=[driver], start=given).start
        assert [q[0], v[0]] == pytest.approx([1.1, 2.0], abs=CLOSED)


@pytest.mark.parametrize(("start", "text"), [([0.3], r"expected Start, .* got \[0.3\]"), ({"w": {}}, "unknown key w")])
def test_a_start_that_is_no_table_is_rejected(start, text):
    with pytest.raises(mbdae.MbdaeError, match=text):
        mbdae.Mechanism(four_bar().model, start=start)
