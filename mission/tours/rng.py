"""Random numbers inside compiled loops: xorshift64*, whose state is an array, so that a search can stop and go on alike."""

import numpy as np
from numba import njit


def stream(seed: int) -> np.ndarray:
    """Return the (1,) uint64 state of the stream of `seed`."""
    return np.random.SeedSequence(seed).generate_state(1, np.uint64) | np.uint64(1)


@njit(cache=True, inline="always")
def _next(state: np.ndarray) -> np.uint64:
    x = state[0]
    x ^= x >> np.uint64(12)
    x ^= x << np.uint64(25)
    x ^= x >> np.uint64(27)
    state[0] = x
    return x * np.uint64(2685821657736338717)


@njit  # of several signatures: no cache of its own (see .ci/signatures)
def below(state: np.ndarray, n: int) -> int:
    """Return a random integer in 0..n-1."""
    return np.int64(_next(state) >> np.uint64(33)) % n  # type: ignore[return-value]


@njit(cache=True)
def uniform(state: np.ndarray) -> float:
    """Return a random number in [0, 1)."""
    return (_next(state) >> np.uint64(11)) * 1.1102230246251565e-16


@njit(cache=True)
def shuffle(state: np.ndarray, items: np.ndarray) -> None:
    """Shuffle a 1-d array in place."""
    for i in range(items.shape[0] - 1, 0, -1):
        j = below(state, i + 1)
        items[i], items[j] = items[j], items[i]
