"""Random numbers with one stream per environment.

What an environment draws depends on its seed and on how much it drew before, never on the number of environments or on what
others draw. Each stream is SplitMix64 (Steele, Lea and Flood, OOPSLA 2014): a counter through a mixing function, so that a whole
batch draws with a few NumPy operations and without a generator object per environment.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["RandomStreams"]

_STEP = np.uint64(0x9E3779B97F4A7C15)  # 2^64 over the golden ratio, odd: the counter visits every value once
_WORD = 2**64 - 1

Envs = NDArray[np.int64] | slice


def _mix(x: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Scrambles 64 bits, one to one; overwrites x."""
    x ^= x >> np.uint64(30)
    x *= np.uint64(0xBF58476D1CE4E5B9)
    x ^= x >> np.uint64(27)
    x *= np.uint64(0x94D049BB133111EB)
    x ^= x >> np.uint64(31)
    return x


def _hash(seed: int) -> NDArray[np.uint64]:
    """64 bits (1,) of a seed of any size."""
    state = np.zeros(1, np.uint64)
    while True:
        state += np.uint64(seed & _WORD)
        state = _mix(state + _STEP)
        seed >>= 64
        if not seed:
            return state


def _first(seed: int, num_envs: int) -> NDArray[np.uint64]:
    """Where the streams of (seed, 0), (seed, 1), ... begin."""
    index = np.arange(1, num_envs + 1, dtype=np.uint64)
    return _mix(_mix(index * _STEP + _hash(seed)))


class RandomStreams:
    """One stream of random numbers per environment. `envs` says who draws: indices (k,), or slice(None) for all."""

    def __init__(self, num_envs: int):
        self._state = np.zeros(num_envs, np.uint64)

    def seed(self, seed: int, envs: Envs = slice(None)) -> None:
        """Environment i begins the stream of (seed, i); seed >= 0."""
        self._state[envs] = _first(seed, len(self._state))[envs]

    def seed_each(self, seeds: Sequence[int | None], envs: NDArray[np.int64]) -> None:
        """Environment i begins the stream of (seeds[i], 0), as if it were alone; None: it goes on with its stream."""
        for env in envs:
            if seeds[env] is not None:
                self._state[env] = _first(seeds[env], 1)[0]

    def bits(self, envs: Envs, count: int) -> NDArray[np.uint64]:
        """(k, count) 64 random bits each."""
        state = self._state[envs]
        drawn = _mix(state[:, None] + np.arange(1, count + 1, dtype=np.uint64) * _STEP)
        self._state[envs] = state + np.uint64(count * int(_STEP) & _WORD)
        return drawn

    def uniform(self, envs: Envs, low: ArrayLike, high: ArrayLike, count: int | None = None) -> NDArray[np.float32]:
        """(k, count), or (k,) without a count: float32 from low to high; the bounds are numbers or (count,)."""
        n = 1 if count is None else count
        halves = self.bits(envs, (n + 1) // 2).view(np.uint32)[:, :n]  # two numbers from 64 bits
        unit = (halves >> np.uint32(8)).astype(np.float32)
        unit *= np.float32(2.0**-24)  # 24 bits: exact in float32
        low = np.asarray(low, np.float32)
        unit *= np.asarray(high, np.float32) - low
        unit += low
        return unit[:, 0] if count is None else unit

    def normal(self, envs: Envs, scale: ArrayLike = 1.0, count: int | None = None) -> NDArray[np.float32]:
        """(k, count), or (k,) without a count: float32, mean zero, standard deviation `scale`, a number or (count,).

        Goes through logarithm and cosine: the last bits may differ between machines.
        """
        n = 1 if count is None else count
        draw = self.uniform(envs, 0.0, 1.0, 2 * n)
        radius = np.sqrt(-2.0 * np.log1p(-draw[:, :n]))  # of 1 - draw, which is never zero
        value = radius * np.cos(np.float32(2.0 * np.pi) * draw[:, n:]) * np.asarray(scale, np.float32)
        return value[:, 0] if count is None else value

    def integers(self, envs: Envs, low: int, high: int, count: int | None = None) -> NDArray[np.int64]:
        """(k, count), or (k,) without a count: integers in low ... high - 1; high - low is at most 2^31."""
        top = self.bits(envs, 1 if count is None else count) >> np.uint64(33)
        value = (top * np.uint64(high - low) >> np.uint64(31)).astype(np.int64) + low
        return value[:, 0] if count is None else value
