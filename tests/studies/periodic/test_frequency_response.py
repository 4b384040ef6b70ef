"""Branches over the frequency of a drive, whose period they follow."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import mbdae
from mbdae.errors import InputError

M, K, C, F = 1.0, 36.0, 0.4, 3.0


def oscillator(rest=(), **drive):
    body = {"name": "x", "parent": "world", "joint": "prismatic", "axis": [1, 0, 0], "mass": M}
    laws = [
        {"kind": "joint_spring", "name": "coil", "joint": "x", "stiffness": K, "damping": C},
        {"kind": "joint_torque", "name": "drive", "joint": "x", "torque": drive},
        *rest,
    ]
    return mbdae.load({"gravity": [0, 0, 0], "body": [body], "force": laws})


@pytest.mark.slow
def test_amplitude_and_multipliers_of_a_driven_oscillator():
    """x = Im(F e^(i omega t)/(k - m omega^2 + i c omega)), mu = e^(s T), T = 2 pi/omega; and no bifurcation."""
    mech = oscillator(kind="harmonic", amplitude=F, omega=5.6)
    found = mbdae.periodic_branch(mech, "force.drive.torque.omega", 5.6, 5.9, rtol=1e-7)
    assert not found.bifurcations
    assert found.values[-1] == pytest.approx(5.9, abs=1e-9)
    for omega, point in zip(found.values, found.points, strict=True):
        z = F / (K - M * omega**2 + 1j * C * omega)
        assert pytest.approx(2 * np.pi / omega, rel=1e-12) == point.motion.T
        assert [point.motion.q[0], point.motion.v[0]] == pytest.approx([z.imag, omega * z.real], abs=1e-6)
        expected = np.exp(np.roots([M, C, K]) * point.motion.T)
        np.testing.assert_allclose(np.sort_complex(point.motion.multipliers), np.sort_complex(expected), atol=1e-6)


def test_a_branch_begins_at_the_bound_of_a_parameter():
    """Without damping, x = 0 and v = omega F/(k - m omega^2) at t = 0."""
    mech = oscillator(kind="harmonic", amplitude=F, omega=4.0)
    with pytest.warns(UserWarning, match="force.coil.damping"):
        found = mbdae.periodic_branch(mech, "force.coil.damping", 0.0, 0.01, rtol=1e-7).points[0].motion
    assert [found.q[0], found.v[0]] == pytest.approx([0.0, 4.0 * F / (K - M * 16.0)], abs=1e-6)


@pytest.mark.slow
def test_tangents_are_those_of_the_response():
    """dx_0/domega of the closed form, in segments of the period, too."""
    mech = oscillator(kind="harmonic", amplitude=F, omega=5.0)
    z = F / (K - M * 25.0 + 1j * C * 5.0)
    expected = (z**2 / F * (2 * M * 5.0 - 1j * C)).imag
    for segments in (1, 2, 4):
        found = mbdae.periodic_branch(mech, "force.drive.torque.omega", 5.0, 5.01, segments=segments, rtol=1e-8)
        nodes, rest = found.points[0].tangent
        assert nodes[0, 0] / (rest[-1] * 0.01) == pytest.approx(expected, rel=1e-5)


@pytest.mark.slow
def test_a_crank_over_its_speed():
    """A slider driven by a crank at speed omega turns once in 2 pi/omega; that of a yoke on a spring is a cosine."""
    tables = {
        "gravity": [0, 0, 0],
        "body": [
            {"name": "crank", "parent": "world", "joint": "continuous", "inertia": [0.01, 0.01, 0.01, 0, 0, 0]},
            {"name": "yoke", "parent": "world", "joint": "prismatic", "axis": [1, 0, 0], "mass": 1.0},
            {"name": "load", "parent": "yoke", "joint": "prismatic", "axis": [1, 0, 0], "mass": M},
        ],
        "frame": [{"name": "pin", "parent": "crank", "xyz": [0.1, 0, 0]}],
        "closure": [{"kind": "in_line", "frames": ["yoke", "pin"], "axis": [0, 1, 0]}],
        "driver": [{"name": "motor", "joint": "crank", "motion": {"kind": "polynomial", "coefficients": [0, 3.0]}}],
        "force": [{"kind": "joint_spring", "joint": "load", "stiffness": K, "damping": C}],
    }
    found = mbdae.periodic_branch(mbdae.load(tables), "driver.motor.motion.coefficients.1", 3.0, 3.2, rtol=1e-7)
    for omega, point in zip(found.values, found.points, strict=True):
        z = 0.1 * M * omega**2 / (K - M * omega**2 + 1j * C * omega)
        assert pytest.approx(2 * np.pi / omega, rel=1e-12) == point.motion.T
        assert point.motion.q[-1] == pytest.approx(z.real, abs=1e-6)


@pytest.mark.slow
def test_a_doubled_branch_follows_the_period():
    """Half the frequency of a pendulum whose pivot moves vertically: 2 T = 4 pi/omega, and scipy comes back."""
    pivot = {"name": "pivot", "parent": "world", "joint": "prismatic", "mass": 1.0}
    rod = {"name": "rod", "parent": "pivot", "axis": [0, 1, 0], "mass": 1.0, "com": [0, 0, -1]}
    motion = {"kind": "harmonic", "amplitude": 0.1, "omega": 5.7}
    mech = mbdae.load({
        "body": [pivot, rod],
        "driver": [{"name": "shaker", "joint": "pivot", "motion": motion}],
        "force": [{"kind": "joint_damping", "joint": "rod", "damping": 0.2}],
    })  # fmt: skip
    found = mbdae.periodic_branch(mech, "driver.shaker.motion.omega", 5.7, 5.8, rtol=1e-8)
    (at,) = [b for b in found.bifurcations if b.kind == "doubling"]
    point = found.doubled(at).points[1]
    omega = point.value

    def rates(t, y):
        return [y[1], -(9.81 - 0.1 * omega**2 * np.sin(omega * t)) * np.sin(y[0]) - 0.2 * y[1]]

    start = [point.motion.q[1], point.motion.v[1]]
    end = solve_ivp(rates, (0, 4 * np.pi / omega), start, rtol=1e-10, atol=1e-12).y[:, -1]
    assert pytest.approx(4 * np.pi / omega, rel=1e-12) == point.motion.T
    assert abs(start[0]) > 1e-3
    np.testing.assert_allclose(end, start, atol=1e-6)


def test_a_driven_slider_without_a_spring():
    """Its position is free, and a symmetry: the one coordinate drifts, v = Im(F e^(i omega t)/(c + i m omega))."""
    body = {"name": "x", "parent": "world", "joint": "prismatic", "axis": [1, 0, 0], "mass": M}
    drive = {"kind": "joint_torque", "joint": "x", "torque": {"kind": "harmonic", "amplitude": F, "omega": 5.0}}
    damper = {"kind": "joint_damping", "joint": "x", "damping": C}
    found = mbdae.periodic(mbdae.load({"gravity": [0, 0, 0], "body": [body], "force": [drive, damper]}))
    assert found.v[0] == pytest.approx((F / (C + 5j * M)).imag, abs=1e-8)
    assert found.multipliers == pytest.approx([np.exp(-C / M * found.T)], abs=1e-9)


def test_frequencies_without_a_common_period_are_rejected():
    second = {"kind": "joint_torque", "joint": "x", "torque": {"kind": "harmonic", "amplitude": 1.0, "omega": 8.0}}
    mech = oscillator([second], kind="harmonic", amplitude=F, omega=4.0)
    with pytest.raises(InputError, match="no common period"):
        mbdae.periodic_branch(mech, "force.drive.torque.omega", 4.0, 6.0)


def test_the_period_of_a_function_that_a_branch_cannot_follow():
    def driven(omega: float = 5.0) -> mbdae.Mechanism:
        damper, drive = mbdae.JointDamping(joint="x", damping=C), lambda t: F * np.sin(omega * t)
        laws = [damper, mbdae.JointTorque(joint="x", torque=drive)]
        return mbdae.Mechanism(oscillator(kind="constant", value=0.0).model, forces=laws)

    with pytest.raises(InputError, match="changes with 'omega'"):
        mbdae.periodic_branch(driven, "omega", 5.0, 6.0, T=2 * np.pi / 5)
