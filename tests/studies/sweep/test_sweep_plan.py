"""Values and seeds of the runs of a sweep."""

import numpy as np
import pytest
from scipy.stats import norm

import mbdae
from mbdae.studies.sweep.plan import planned_runs


@pytest.mark.parametrize("seed", [0, 1, 2**32, 2**128 - 1, 2**128, 3**300])
def test_seeds_are_those_of_numpy(seed):
    def of_numpy(i):
        return int(np.random.SeedSequence(seed, spawn_key=(i, 1)).generate_state(1, np.uint64)[0] >> np.uint64(1))

    (runs,) = planned_runs([{}] * 40, seed)
    assert runs.seeds == [*map(of_numpy, range(40))]


def tasks(parameters, seed=0):
    found = [task for runs in planned_runs(parameters, seed) for task in runs.tasks()]
    return sorted(found, key=lambda task: task.run)


def values(parameters, seed=0):
    return [task.values for task in tasks(parameters, seed)]


def test_grids_and_lists():
    grid = {"a": [1, 2], "b": {"from": 0.0, "to": 1.0, "n": 3}}
    assert values(grid) == [{"a": a, "b": b} for a in (1, 2) for b in (0.0, 0.5, 1.0)]
    runs = [{"a": np.float64(1.5)}, {"b": (1, 2)}, {"a": 2}]
    assert values(runs) == [{"a": 1.5}, {"b": [1.0, 2.0]}, {"a": 2}]
    assert [len(x) for x in planned_runs(runs, 0)] == [2, 1]


def test_random_values_belong_to_the_run_and_the_seed():
    def sample(n):
        return mbdae.Random(n, {"a": {"distribution": "normal", "loc": 3.0, "scale": 0.1}, "b": norm(0, 1), "c": 7})

    few, many, other = values(sample(5)), values(sample(400)), values(sample(5), seed=1)
    assert few == many[:5]
    assert few != other
    a, b = (np.array([run[name] for run in many]) for name in "ab")
    assert abs(a.mean() - 3.0) < 0.02
    assert 0.09 < a.std() < 0.11
    assert abs(np.corrcoef(a, b)[0, 1]) < 0.15
    assert {run["c"] for run in many} == {7}
    assert len({task.seed for task in tasks(sample(400))}) == 400


class Spawning:
    """A distribution that draws from a spawned stream."""

    def rvs(self, random_state):
        return random_state.spawn(2)[1].normal() + random_state.bit_generator.seed_seq.generate_state(3)[2]


@pytest.mark.parametrize("seed", [0, 2**32, 2**128, 3**300])
def test_random_values_are_those_of_numpy(seed):
    drawn = {
        "a": {"distribution": "integers", "low": 0, "high": 100},  # half a word: the other half is kept for the next
        "b": {"distribution": "integers", "low": 0, "high": 100},
        "c": {"distribution": "choice", "a": ["x", "y", "z"]},
        "d": {"distribution": "gamma", "shape": 2.0},
        "e": Spawning(),
    }

    def of_numpy(i):
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(i, 0)))
        a, b = rng.integers(low=0, high=100), rng.integers(low=0, high=100)
        return {"a": a, "b": b, "c": rng.choice(["x", "y", "z"]), "d": rng.gamma(2.0), "e": Spawning().rvs(rng)}

    assert values(mbdae.Random(20, drawn), seed) == [*map(of_numpy, range(20))]


def test_random_plans_hash_the_seed_for_all_runs_at_once(monkeypatch):
    """Hashing takes most of the time of a plan if each run does it."""
    made, sequence = [], np.random.SeedSequence
    monkeypatch.setattr(np.random, "SeedSequence", lambda *a, **k: made.append(a) or sequence(*a, **k))
    assert len(values(mbdae.Random(100, {"a": {"distribution": "normal"}}), 5)) == 100
    assert made == [(5,), (5,)]
