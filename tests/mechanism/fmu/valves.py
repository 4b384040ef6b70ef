"""Mechanisms with inputs that an FMU sets: a cylinder, a motor, a driver; and their exact discrete systems."""

import numpy as np
import pinocchio as pin
from scipy.linalg import expm
from test_fmu_motion import END, KD, KP, LAG, MASS, NUMBERS, REFERENCE, STEP, cart, drive

from mbdae import Driver, Input, Mechanism, SpringDamper

KEEP = np.exp(-STEP / LAG)  # of the state of the valve in a step
SLOW = {"kp": 3.0, "kd": 0.0}


def valve(path, target="valve", **changes):
    """An FMU that sets an input by the position and the speed of the cart."""
    return drive(path, **({"outputs": {"torque": target}, "name": "motor"} | changes))


def framed(*forces, drivers=()):
    """A cart with a piston, and a frame of the world behind it."""
    m = cart()
    for name, body, x in (("anchor", 0, -3.0), ("piston", 1, 0.0)):
        m.model.addFrame(pin.Frame(name, body, 0, pin.SE3(np.eye(3), np.array([x, 0, 0])), pin.FrameType.OP_FRAME))
    return Mechanism(m.model, forces=forces, drivers=drivers, start=m.start_values, title="cart")


def cylinder(path, hold, *others, **changes):
    """A cart that a force from the world pushes, as the valve lets it."""
    force = SpringDamper(frames=("anchor", "piston"), force=Input(name="valve", hold=hold, value=1.5))
    return framed(force, valve(path, **changes), *others)


def driven(path, hold="first"):
    """A cart whose speed is the output of the FMU."""
    driver = Driver(joint="cart 0", speed=Input(name="valve", hold=hold, value=1.0), name="belt")
    return framed(valve(path, parameters=NUMBERS | SLOW), drivers=[driver])


def exact(A, b, hold, x, u=1.5, kp=KP, kd=KD):
    """States at the instants of x' = A x + b u with the valve, u constant or linear in each step, by exponentials."""
    n, state, rate, demand, out = len(x), 0.0, 0.0, None, [np.array(x)]
    block = np.zeros((n + 2, n + 2))  # of (x, u, u')
    block[:n, :n], block[:n, n], block[n, n + 1] = A, b, 1.0
    over = expm(block * STEP)
    for _ in range(round(END / STEP)):
        x = out[-1]
        state = 0.0 if demand is None else KEEP * state + (1 - KEEP) * demand
        demand = kp * (REFERENCE - x[0]) - kd * (x[1] if n > 1 else 0.0)
        u, rate = (state, 0.0) if hold == "zero" else (u, (state - u) / STEP)
        moved = over @ np.concatenate([x, [u, rate]])
        out.append(moved[:n])
        u = moved[n]
    return np.array(out)


def at_instants(sol, values, after=False):
    """Rows of a table at the instants, just before or just after their jumps."""
    pick = -1 if after else 0
    nodes = [np.flatnonzero(np.abs(sol.t - k * STEP) < 1e-9)[pick] for k in range(round(sol.t[-1] / STEP) + 1)]
    return values[nodes]


FREE = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([0.0, 1 / MASS])
