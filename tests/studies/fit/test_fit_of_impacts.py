"""Parameters of impacts from noisy measurements of a motion that bounces."""

import numpy as np
import pytest

import mbdae
from mbdae import Mechanism, Stop
from mbdae.errors import InputError

TRUE = {"stop.rod stop.lower": 0.3, "stop.rod stop.restitution": 0.7}
BOUNDS = {"stop.rod stop.lower": (0.301, 0.25, 0.35), "stop.rod stop.restitution": (0.702, 0.5, 0.9)}
SIGMA, SEEDS = 1e-3, 20


@pytest.mark.slow
def test_position_and_restitution_of_a_stop():
    """Errors over 20 seeds, in standard deviations of the fit, are those of a normal distribution."""
    sol = mbdae.solve("pendulum_on_stop", (0.0, 1.6), t_eval=np.linspace(0.0, 1.6, 33), rtol=1e-8)
    assert len(sol.impacts) == 2
    angle, errors = sol.signals("q.rod")["q.rod"], []
    for seed in range(SEEDS):
        noisy = angle + SIGMA * np.random.default_rng(seed).standard_normal(len(angle))
        data = {"t": sol.t, "q.rod": noisy}
        found = mbdae.fit("pendulum_on_stop", BOUNDS, data, sigma=SIGMA, spans=(1,), rtol=1e-6)
        errors.append([(found.values[name] - x) / found.deviations[name] for name, x in TRUE.items()])
    assert np.abs(errors).max() < 3
    assert np.abs(np.mean(errors, axis=0)).max() < 3 / np.sqrt(SEEDS)
    assert (np.abs(np.std(errors, axis=0) - 1) < 3 / np.sqrt(2 * SEEDS)).all()


@pytest.mark.slow
def test_trials_that_accumulate_bounces_are_rejected_steps():
    """Measured is a stop on which the rod comes to rest: the search ends before, without success, and tells why."""
    base = mbdae.load("pendulum_on_stop")
    resting = Mechanism(base.model, stops=[Stop(joint="rod", lower=0.3, restitution=0.5)])
    name = "stop.rod stop.restitution"
    sol = mbdae.solve(resting, (0.0, 2.5), *base.start, t_eval=np.linspace(0.0, 2.5, 26), rtol=1e-6)
    assert sol.modes[-1][1] == (1,)
    data = {"t": sol.t, "q.rod": sol.signals("q.rod")["q.rod"]}
    found = mbdae.fit("pendulum_on_stop", {name: (0.6, 0.05, 0.99)}, data, spans=(1,), rtol=1e-6)
    assert 0.5 < found.values[name] < 0.6
    assert not found.converged
    assert "steps became short by rejected trials" in found.message
    assert any("accumulation of bounces" in reason for reason in found.rejected)
    assert f"{len(found.rejected)} trials were rejected, the last: " in str(found)
    with pytest.raises(
        InputError, match=r"^'rod stop' comes to rest by an accumulation of bounces at t = .*derivative$"
    ):
        mbdae.fit("pendulum_on_stop", {name: (0.4, 0.05, 0.99)}, data, spans=(1,), rtol=1e-6)
