"""Seeds of the runs of a sweep, those of numpy's SeedSequence, computed for all runs at once."""

import numpy as np

from ...system import Array

PARAMETER_STREAM, SEED_STREAM = 0, 1  # random streams of a run: for its parameters, and for its seed
POOL = 4  # words of 32 bits
INIT_A, MULT_A = 0x43B0D7E5, 0x931E8875  # to hash entropy
INIT_B, MULT_B = 0x8B51F9DD, 0x58F38DED  # to hash the pool
MIX_L, MIX_R = np.uint32(0xCA01F9DD), np.uint32(0x4973F715)
HALF, LAST_BIT = np.uint32(16), np.uint64(1)


def run_seeds(seed: int, n: int) -> list[int]:
    """Return the seeds of n runs, 63 bits each, from the seed of the sweep and the numbers of the runs i < n.

    They are ``SeedSequence(seed, spawn_key=(i, SEED_STREAM)).generate_state(1, np.uint64)[0] >> 1``. The spawn key is
    the last to be hashed (numpy/random/bit_generator.pyx, after M. E. O'Neill, 2015): all runs share the pool of the
    seed.
    """
    words = max(POOL, -(-seed.bit_length() // 32))
    hashed = POOL * words  # hashes that have made this pool, each with the next constants
    pool = np.tile(np.random.SeedSequence(seed).pool[:, None], n)
    for key in (np.arange(n, dtype=np.uint32), np.full(n, SEED_STREAM, np.uint32)):
        for k in range(POOL):
            pool[k] = _shifted(pool[k] * MIX_L - _hashed(key, INIT_A, MULT_A, hashed) * MIX_R)
            hashed += 1
    low, high = (_hashed(pool[k], INIT_B, MULT_B, k).astype(np.uint64) for k in range(2))
    return ((low | high << np.uint64(32)) >> LAST_BIT).tolist()


def _hashed(x: Array, first: int, factor: int, k: int) -> Array:
    """Return the hashes of words x after k others."""
    a, b = (np.uint32(first * pow(factor, i, 2**32) % 2**32) for i in (k, k + 1))
    return _shifted((x ^ a) * b)


def _shifted(x: Array) -> Array:
    return x ^ x >> HALF
