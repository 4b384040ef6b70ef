"""Named points of branches in closed form: flutter of a column, grazing, and a period doubling by impacts."""

import numpy as np
import pytest
from columns import column
from impact_oscillator import GRAZING_FORCE, OMEGA, E, T, Z, impact_motion, oscillator, steady
from scipy.optimize import brentq

import mbdae

CLOCK = """
[[force]]
kind = "joint_damping"
joint = ["lower", "upper"]
damping = {damping}
[[body]]
name = "clock"
parent = "world"
joint = "prismatic"
mass = 1.0
[[driver]]
joint = "clock"
motion = {{ kind = "harmonic", amplitude = 0.1, omega = 3.0 }}
"""


def test_flutter_of_a_damped_column_is_a_neimark_sacker_bifurcation(tmp_path):
    """Ziegler, Ing.-Arch. 20 (1952): masses 2 m and m, P l/k = 41/28 + b^2/(2 m k l^2), omega^2 = 2/7 k/(m l^2).

    The period is that of a driver beside the column.
    """
    damping = 0.3
    text = column({"lower": 2.0, "upper": 1.0}, stiffness=1.0, axes="frame") + CLOCK.format(damping=damping)
    (tmp_path / "column.toml").write_text(text)
    branch = mbdae.periodic_branch(str(tmp_path / "column.toml"), "force.load.force.0", -1.4, -1.6, rtol=1e-9)
    (at,) = branch.bifurcations
    assert at.kind == "neimark-sacker"
    assert -at.value == pytest.approx(41 / 28 + damping**2 / 2, rel=1e-8)
    flutter = np.exp(1j * np.sqrt(2 / 7) * 2 * np.pi / 3)
    assert np.abs(at.motion.multipliers - flutter).min() < 1e-8
    assert [branch.points[i].motion.stability for i in (0, -1)] == ["stable", "unstable"]


def test_a_motion_without_impacts_ends_where_it_grazes_the_stop():
    """Its amplitude F/|1 - w^2 + 2 i z w| reaches the distance of the stop."""
    x, v = steady(3.5, 0.0)
    found = mbdae.periodic_branch(oscillator, "force", 3.5, 4.5, q=[x], v=[v], rtol=1e-9, start={"phase": 0.0})
    (at,) = found.bifurcations
    assert (at.kind, at.grazed) == ("grazing", "stop")
    assert at.value == pytest.approx(GRAZING_FORCE, rel=1e-9)
    assert at.value > found.values[-1]
    assert "'stop' is grazed" in str(found)
    assert found.message == "ends where 'stop' is grazed: there is no derivative beyond"
    assert np.prod(found.multipliers[-1]).real == pytest.approx(np.exp(-2 * Z * T), rel=1e-9)


@pytest.mark.slow
def test_a_motion_with_impacts_ends_where_they_graze():
    """The same force, where the speed of the impact is zero and a multiplier is infinite."""
    exact = impact_motion(0.05)
    (x, v), phase = exact.start, exact.phase + np.pi
    found = mbdae.periodic_branch(
        oscillator, "force", exact.force, 3.8, q=[x], v=[v], rtol=1e-9, start={"phase": phase}
    )
    at = found.bifurcations[-1]
    assert (at.kind, at.grazed) == ("grazing", "stop")
    assert at.value == pytest.approx(GRAZING_FORCE, rel=1e-8)
    assert np.abs(found.multipliers[-1]).max() > 1e4


@pytest.mark.slow
def test_the_impact_motion_doubles_its_period():
    """det = e^2 exp(-2 z T) = d everywhere, so a multiplier is -1 where the trace is -1 - d."""
    d = E**2 * np.exp(-2 * Z * T)
    u = brentq(lambda u: np.trace(impact_motion(u).monodromy) + 1 + d, 0.3, 1.0, xtol=1e-13)
    first, last = impact_motion(u + 0.01), impact_motion(u - 0.01)
    x, v = first.start
    found = mbdae.periodic_branch(
        oscillator, "force", first.force, last.force, q=[x], v=[v], rtol=1e-9, start={"phase": first.phase + np.pi}
    )
    (at,) = found.bifurcations
    assert at.kind == "doubling"
    assert at.value == pytest.approx(impact_motion(u).force, rel=1e-8)
    assert pytest.approx(2 * np.pi / OMEGA, rel=1e-12) == at.motion.T
