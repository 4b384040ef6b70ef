"""Exported mechanisms in FMPy."""

from ctypes import c_double, c_uint

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import mbdae
from mbdae import Input, JointTorque, Mechanism
from mbdae.solution.signals import units

fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed: pip install 'mbdae[fmi]'")
from fmpy import fmi3, simulation  # noqa: E402

STEP = 1e-3


def motorized(name, hold="zero", value=0.5):
    """A model with an input torque on its first joint of one velocity, or on the first velocity of its first joint."""
    m = mbdae.load(name)
    single = [j for j in m.joint_names if sum(m.coordinate_joint(i) == j for i in range(m.nv)) == 1]
    joint, torque = (single or m.joint_names)[0], Input(name="motor", hold=hold, value=value)
    others = sum(m.coordinate_joint(i) == joint for i in range(m.nv)) - 1
    motor = JointTorque(joint=joint, torque=[torque, *[0.0] * others] if others else torque)
    return Mechanism(m.model, m.closures, [*m.forces, motor], drivers=m.drivers, start=m.start_values, title=name)


def motion_outputs(m):
    """Names of all coordinates and velocities."""
    return [n for n in units(m) if n[:2] in ("q.", "v.")]


class Master:
    """An instance of an FMU, started.

    Args:
        unit: what `mbdae.export` returned.
        kind: ``"cs"`` or ``"me"``.
        start: start values of parameters and inputs.
        early: whether a step may end early; ``update`` is then called after each internal step.
    """

    def __init__(self, unit, kind, start=None, t=0.0, early=False, update=None, initialized=True):
        self.unit, self.found = unit, fmpy.read_model_description(str(unit.path))
        self.folder = fmpy.extract(str(unit.path))
        interface = self.found.coSimulation if kind == "cs" else self.found.modelExchange
        made = fmi3.FMU3Slave if kind == "cs" else fmi3.FMU3Model
        self.fmu = made(
            guid=self.found.guid, modelIdentifier=interface.modelIdentifier, unzipDirectory=self.folder,
            instanceName="one",
        )  # fmt: skip
        self.fmu.instantiate(**({"earlyReturnAllowed": early, "intermediateUpdate": update} if update else {}))
        self.references = {x.name: x.valueReference for x in self.found.modelVariables}
        for name, x in (start or {}).items():
            self.set(name, x)
        if not initialized:
            return
        self.fmu.enterInitializationMode(startTime=t)
        self.fmu.exitInitializationMode()
        if kind == "me":
            self.fmu.updateDiscreteStates()
            self.fmu.enterContinuousTimeMode()

    def of(self, *names):
        return [self.references[name] for name in names]

    def set(self, name, x):
        self.fmu.setFloat64(self.of(name), [float(x)])

    def get(self, *names):
        return np.array(self.fmu.getFloat64(self.of(*names)))

    def step(self, t, h=STEP):
        return self.fmu.doStep(t, h)

    @property
    def n(self):
        return self.unit.states

    def x(self):
        out = (c_double * self.n)()
        self.fmu.fmi3GetContinuousStates(self.fmu.component, out, self.n)
        return np.array(out)

    def set_x(self, x):
        self.fmu.fmi3SetContinuousStates(self.fmu.component, (c_double * self.n)(*x), self.n)

    def rate(self):
        out = (c_double * self.n)()
        self.fmu.fmi3GetContinuousStateDerivatives(self.fmu.component, out, self.n)
        return np.array(out)

    def unknowns(self):
        rates = [f"der(local[{i + 1}])" for i in range(self.n)]
        return self.of(*rates, *self.unit.outputs)

    def knowns(self):
        return self.of(*(f"local[{i + 1}]" for i in range(self.n)), *self.unit.inputs)

    def _product(self, function, seed, n):
        rows, columns, out = self.unknowns(), self.knowns(), (c_double * n)()
        as_references = [(c_uint * len(x))(*x) for x in (rows, columns)]
        function(
            self.fmu.component, as_references[0], len(rows), as_references[1], len(columns),
            (c_double * len(seed))(*seed), len(seed), out, n,
        )  # fmt: skip
        return np.array(out)

    def jacobian(self):
        """Partials of derivatives and outputs with respect to states and inputs, from directional derivatives."""
        rows, columns = len(self.unknowns()), len(self.knowns())
        of = self.fmu.fmi3GetDirectionalDerivative
        return np.array([self._product(of, e, rows) for e in np.eye(columns)]).T

    def transposed(self):
        """The same, from adjoint derivatives."""
        rows, columns = len(self.unknowns()), len(self.knowns())
        return np.array([self._product(self.fmu.fmi3GetAdjointDerivative, e, columns) for e in np.eye(rows)])


def solved_by_scipy(unit, end, rtol=1e-12):
    """Times of the changes of the mode, and outputs at the end, with DOP853 as the solver of a model exchange."""
    master, t, times, after = Master(unit, "me"), 0.0, [], None
    z = (c_double * len(master.found.eventIndicators))()

    def at(s, x):
        master.fmu.setTime(s)
        master.set_x(x)

    def rate(s, x):
        at(s, x)
        return master.rate()

    known = {}  # the interpolant differs by rounding from nodes, where signs must not change

    def indicators(s, x):
        if s not in known:
            at(s, x)
            master.fmu.fmi3GetEventIndicators(master.fmu.component, z, len(z))
            known[s] = [*z, 0.5 - float(master.fmu.completedIntegratorStep()[0])]
        return known[s]

    def event(i):
        def value(s, x):
            return indicators(s, x)[i]

        value.terminal = True
        return value

    while t < end:
        stop = min(end, after or end)
        found = solve_ivp(
            rate, (t, stop), master.x(), "DOP853", rtol=rtol, atol=1e-2 * rtol, max_step=0.1,
            events=[event(i) for i in range(len(z) + 1)],
        )  # fmt: skip
        known.clear()
        t = found.t[-1]
        at(t, found.y[:, -1])
        master.fmu.enterEventMode()
        *_, changed, defined, when = master.fmu.updateDiscreteStates()
        after = when if defined else None
        if changed:
            times.append(t)
        master.fmu.enterContinuousTimeMode()
    return np.array(times), master.get(*unit.outputs)


def simulated(unit, kind, t, **settings):
    """All results of FMPy's own loop."""
    kind = {"cs": "CoSimulation", "me": "ModelExchange"}[kind]
    return simulation.simulate_fmu(str(unit.path), fmi_type=kind, stop_time=t, **settings)
