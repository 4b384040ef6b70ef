"""Seeds of the runs of a sweep, those of numpy's SeedSequence, computed for all runs at once."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.random.bit_generator import ISpawnableSeedSequence

from ...system import Array

PARAMETER_STREAM, SEED_STREAM = 0, 1  # random streams of a run: for its parameters, and for its seed
POOL = 4  # number of words of 32 bits in the entropy pool
PCG64_WORDS = 4  # number of words of 64 bits in the state of PCG64
INIT_A, MULT_A = 0x43B0D7E5, 0x931E8875  # constants that hash entropy
INIT_B, MULT_B = 0x8B51F9DD, 0x58F38DED  # constants that hash the pool
MIX_L, MIX_R = np.uint32(0xCA01F9DD), np.uint32(0x4973F715)
HALF, LAST_BIT = np.uint32(16), np.uint64(1)


def run_seeds(seed: int, n: int) -> list[int]:
    """Return the seeds of n runs, 63 bits each, from the seed of the sweep and the run numbers i < n.

    They are ``SeedSequence(seed, spawn_key=(i, SEED_STREAM)).generate_state(1, np.uint64)[0] >> 1``.
    """
    return (_states(seed, SEED_STREAM, n, 1)[:, 0] >> LAST_BIT).tolist()


def run_generators(seed: int, n: int) -> Iterator[np.random.Generator]:
    """Yield ``numpy.random.default_rng(SeedSequence(seed, spawn_key=(i, PARAMETER_STREAM)))`` of n runs i < n."""
    for i, state in enumerate(_states(seed, PARAMETER_STREAM, n, PCG64_WORDS)):
        known: Any = _KnownState(state, seed, (i, PARAMETER_STREAM))  # numpy accepts it, its type annotations do not
        yield np.random.Generator(np.random.PCG64(known))


class _KnownState(ISpawnableSeedSequence):
    """A SeedSequence whose state for PCG64 is known, (4,): computing it for each run alone takes ten times as long."""

    def __init__(self, state: Array, seed: int, spawn_key: tuple[int, int]) -> None:
        self.state, self.seed, self.spawn_key = state, seed, spawn_key
        self.sequence: np.random.SeedSequence | None = None

    def generate_state(self, n_words: int, dtype: Any = np.uint32) -> Array:
        known = (n_words, dtype) == (PCG64_WORDS, np.uint64)
        return self.state if known else self._full_sequence().generate_state(n_words, dtype)

    def spawn(self, n_children: int) -> list[Any]:
        return self._full_sequence().spawn(n_children)

    def _full_sequence(self) -> np.random.SeedSequence:
        self.sequence = self.sequence or np.random.SeedSequence(self.seed, spawn_key=self.spawn_key)
        return self.sequence


def _states(seed: int, stream: int, n: int, words: int) -> Array:
    """Return ``SeedSequence(seed, spawn_key=(i, stream)).generate_state(words, np.uint64)`` of runs i < n, (n, words).

    The spawn key is the last to be hashed (numpy/random/bit_generator.pyx, after M. E. O'Neill, 2015): all runs share
    the pool of the seed.
    """
    hashes = POOL * max(POOL, -(-seed.bit_length() // 32))  # number of hashes in the pool of the seed
    pool = np.tile(np.random.SeedSequence(seed).pool[:, None], n)
    for key in (np.arange(n, dtype=np.uint32), np.full(n, stream, np.uint32)):
        for k in range(POOL):
            pool[k] = _xor_shift(pool[k] * MIX_L - _hash(key, INIT_A, MULT_A, hashes) * MIX_R)
            hashes += 1
    halves = [_hash(pool[k % POOL], INIT_B, MULT_B, k).astype(np.uint64) for k in range(2 * words)]
    return np.column_stack([low | high << np.uint64(32) for low, high in zip(halves[::2], halves[1::2], strict=True)])


def _hash(x: Array, first: int, factor: int, k: int) -> Array:
    """Return the hashes of words x, with the constants after k earlier hashes."""
    a, b = (np.uint32(first * pow(factor, i, 2**32) % 2**32) for i in (k, k + 1))
    return _xor_shift((x ^ a) * b)


def _xor_shift(x: Array) -> Array:
    return x ^ x >> HALF
