"""Run FMUs in this process, whose library has sanitizers; started by test_fmu_sources.py."""

import json
import sys
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
from fmu_masters import Master, fmpy


def co_simulation(unit):
    """Steps; a state that is saved, restored and continued."""
    master = Master(unit, "cs")
    for k in range(60):
        master.step(k * 1e-2, 1e-2)
    saved = master.fmu.getFMUState()
    master.step(0.6, 1e-2)
    master.fmu.setFMUState(master.fmu.deserializeFMUState(master.fmu.serializeFMUState(saved)))
    master.step(0.6, 1e-2)
    master.fmu.freeFMUState(saved)
    return master.get(*unit.outputs)


def model_exchange(unit):
    """Steps of Euler's method, with events; derivatives."""
    master = Master(unit, "me")
    for k in range(1, 200):
        master.fmu.setTime(k * 5e-3)
        master.set_x(master.x() + 5e-3 * master.rate())
        if master.fmu.completedIntegratorStep()[0]:
            master.fmu.enterEventMode()
            master.fmu.updateDiscreteStates()
            master.fmu.enterContinuousTimeMode()
    derivatives = master.jacobian().ravel() if master.found.modelExchange.providesDirectionalDerivative else []
    return [*master.x(), *derivatives]


def results(unit):
    """Outputs of both kinds."""
    return [*co_simulation(unit), *model_exchange(unit)]


def check(data):
    """Compare results of two threads with those expected."""
    expected, one = data.pop("expected"), SimpleNamespace(**data, inputs=())
    fmpy.read_model_description(str(one.path))  # which may fail where two threads load its schema at the same time
    with ThreadPoolExecutor(2) as pool:
        first, second = pool.map(results, [one, one])
    assert np.array_equal(first, second)
    assert np.array_equal(first, expected)


if __name__ == "__main__":
    for unit in json.loads(sys.argv[1]):
        check(unit)
        print("ok")
