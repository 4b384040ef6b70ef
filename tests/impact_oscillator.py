"""A driven mass on a spring with impacts on a stop: motions with one impact per period in closed form.

    x'' + 2 z x' + x = F cos(w t + phi),   x >= -s,   v+ = -e v-

With the impact at t = 0 and T = 2 pi/w, x(0) = x(T) = -s and v(0) = -e v(T) = u are linear in F cos phi, F sin phi and
u, which determines the others.
Source: S. W. Shaw, P. J. Holmes, A periodically forced piecewise linear oscillator, J. Sound Vib. 90 (1983).
"""

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.linalg import expm

from mbdae import JointDamping, JointSpring, JointTorque, Mechanism, Stop
from mbdae.mechanism.time_functions.time_functions import Harmonic

Z, S, E, OMEGA = 0.05, 1.0, 0.8, 2.2
T = 2 * np.pi / OMEGA
A = np.array([[0.0, 1.0], [-1.0, -2 * Z]])
FLOW = expm(A * T)


def steady(force, phase):
    """Return state of the motion without impacts at t = 0: x, v of Re X exp(i w t)."""
    X = force * np.exp(1j * phase) / (1 - OMEGA**2 + 2j * Z * OMEGA)
    return np.array([X.real, (1j * OMEGA * X).real])


GRAZING_FORCE = S * abs(1 - OMEGA**2 + 2j * Z * OMEGA)


class ImpactMotion(NamedTuple):
    """A motion with one impact per period: force, phase at impact; monodromy matrix and start half a period later."""

    force: float
    phase: float
    monodromy: np.ndarray
    start: np.ndarray


def impact_motion(u):
    """Return the motion that leaves the stop at a speed u.

    With p = y_p(0) of the steady motion, FLOW (y+ - p) = y- - p, y+ = (-s, u), y- = (-s, -u/e).
    """
    after, before = np.array([-S, u]), np.array([-S, -u / E])
    p = np.linalg.solve(FLOW - np.eye(2), FLOW @ after - before)
    X = complex(p[0], -p[1] / OMEGA)
    F = X * (1 - OMEGA**2 + 2j * Z * OMEGA)
    force, phase = abs(F), float(np.angle(F))
    a_before, a_after = (force * np.cos(phase) + A[1] @ y for y in (before, after))
    jump = np.array([[-E, 0.0], [(E * a_before + a_after) / before[1], -E]])
    half = expm(A * T / 2)
    start = steady(force, phase + np.pi) + half @ (after - p)
    return ImpactMotion(force, phase, half @ jump @ half, start)


def oscillator(force, phase=0.0, **impacts):
    """Return the mechanism; the force is F cos(w t + phase); another law may replace the stop."""
    model = pin.Model()
    model.gravity.linear[:] = 0.0
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "mass")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.zeros((3, 3))), pin.SE3.Identity())
    drive = JointTorque(joint="mass", torque=Harmonic(amplitude=force, omega=OMEGA, phase=phase + np.pi / 2))
    forces = [JointSpring(joint="mass", stiffness=1.0), JointDamping(joint="mass", damping=2 * Z), drive]
    stop = {"stops": [Stop(joint="mass", lower=-S, restitution=E, name="stop")]}
    return Mechanism(model, forces=forces, **(impacts or stop))
