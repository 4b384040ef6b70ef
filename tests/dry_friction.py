"""Motions with dry friction in closed form, or from one scalar equation integrated from event to event."""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

GRAVITY = 9.81


def oscillator(m, k, kinetic, static, x):
    """Return times and positions of the turning points of a block on a spring, from rest at x until it sticks."""
    t, out = 0.0, [(0.0, x)]
    while k * abs(x) > static:
        x, t = -x + np.sign(x) * 2 * kinetic / k, t + np.pi * np.sqrt(m / k)
        out.append((t, x))
    return out


class SliderCrank:
    """Crank 0.1 m, rod 0.35 m, uniform bars of 0.5 and 0.4 kg, slider 0.6 kg, torque 0.7 sin 4t; p: downward crank
    angle.

    I(p) p'' + I'(p) p'^2/2 = Q(t, p) - friction; it sticks while |Q| <= 0.40 + 2.0 |x'(p)|.
    """

    kinetic, static, slider = 0.25, 0.40, 2.0

    def terms(self, p):
        """Return inertia and its derivative, the generalized force of gravity, and x'(p)."""
        r, L, (m1, m2, m3) = 0.1, 0.35, (0.5, 0.4, 0.6)
        s, c = np.sin(p), np.cos(p)
        sb = r * s / L
        cb = np.sqrt(1 - sb * sb)
        db = r * c / (L * cb)
        ddb = (-r * s + L * sb * db * db) / (L * cb)
        x1, z1 = -r * s - L / 2 * sb * db, -r * c / 2  # of the rod's middle
        x2, z2 = -r * c - L / 2 * (cb * db * db + sb * ddb), r * s / 2
        y1, y2 = -r * s - L * sb * db, -r * c - L * (cb * db * db + sb * ddb)  # of the slider
        inertia = m1 * r * r / 3 + m2 * (x1 * x1 + z1 * z1) + m2 * L * L / 12 * db * db + m3 * y1 * y1
        derivative = 2 * (m2 * (x1 * x2 + z1 * z2) + m2 * L * L / 12 * db * ddb + m3 * y1 * y2)
        return inertia, derivative, GRAVITY * (m1 * r * c / 2 - m2 * z1), y1

    def load(self, t, p):
        """Return the generalized force Q."""
        return 0.7 * np.sin(4 * t) + self.terms(p)[2]

    def excess(self, t, p):
        """Return the load minus the limit of stiction."""
        return abs(self.load(t, p)) - self.static - self.slider * abs(self.terms(p)[3])

    def run(self, end, p=0.6):
        """Return the transitions (name, t, p), and the final angle."""
        t, v, out = 0.0, 0.0, []
        while True:
            times = np.linspace(t, end, 2000)
            k_slip = next((k for k, x in enumerate(times) if k and self.excess(x, p) > 0), None)
            if k_slip is None:
                return out, p
            t = brentq(self.excess, times[k_slip - 1], times[k_slip], (p,), xtol=1e-16, rtol=1e-15)
            out.append(("slip", t, p))
            sign = np.sign(self.load(t, p))
            while True:
                t, p, v, name = self.slide(t, p, v, sign, end)
                if name == "end":
                    return out, p
                out.append((name, t, p))
                if name == "stick":
                    v = 0.0
                    break

    def slide(self, t, p, v, sign, end):
        """Return the end (t, p, v, name) of slip: the crank stops, or the slider reverses."""
        half_turns = np.floor(p / np.pi + 1e-9 * sign)
        direction = np.sign(self.terms(p + 1e-6 * sign)[3])

        def rate(t, y):
            inertia, derivative, _, x = self.terms(y[0])
            friction = sign * self.kinetic + sign * self.slider * x * direction
            return y[1], (self.load(t, y[0]) - derivative * y[1] ** 2 / 2 - friction) / inertia

        first = t

        def stops(t, y):
            return sign * y[1] if t > first + 1e-6 else 1.0

        def turns(t, y):
            return (y[0] / np.pi - half_turns) * (half_turns + 1 - y[0] / np.pi) if t > first + 1e-6 else 1.0

        stops.terminal = turns.terminal = True
        stops.direction = turns.direction = -1
        options = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-15, "max_step": 0.01}
        sol = solve_ivp(rate, (t, end), [p, v], events=[stops, turns], **options)
        name = "stick" if len(sol.t_events[0]) else "turn" if len(sol.t_events[1]) else "end"
        p = np.pi * np.round(sol.y[0, -1] / np.pi) if name == "turn" else sol.y[0, -1]
        return sol.t[-1], p, sol.y[1, -1], name
