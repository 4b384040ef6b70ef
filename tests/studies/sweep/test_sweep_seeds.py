"""Seeds of the runs of a sweep."""

import numpy as np
import pytest

from mbdae.studies.sweep.plan import tasks


@pytest.mark.parametrize("seed", [0, 1, 2**32, 2**128 - 1, 2**128, 3**300])
def test_seeds_are_those_of_numpy(seed):
    def of_numpy(i):
        return int(np.random.SeedSequence(seed, spawn_key=(i, 1)).generate_state(1, np.uint64)[0] >> np.uint64(1))

    assert [task.seed for task in tasks([{}] * 40, seed)] == [*map(of_numpy, range(40))]
