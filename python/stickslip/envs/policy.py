"""Trained policies without the library that trained them: a multilayer perceptron in NumPy."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["MlpPolicy"]

Array = NDArray[np.float32]


class MlpPolicy:
    """Actions of observations: linear layers with ELU between them, on observations that are shifted and scaled.

    weights: (out, in) of each layer; biases: (out,) of each. mean, std: (observation size,), std > 0.
    """

    def __init__(self, weights: Sequence[ArrayLike], biases: Sequence[ArrayLike], mean: ArrayLike, std: ArrayLike):
        self.weights = [np.array(w, np.float32) for w in weights]
        self.biases = [np.array(b, np.float32) for b in biases]
        self.mean, self.std = np.array(mean, np.float32), np.array(std, np.float32)
        self._check()

    @property
    def observation_size(self) -> int:
        """Numbers that it sees."""
        return len(self.mean)

    @property
    def action_size(self) -> int:
        """Numbers that it returns."""
        return len(self.biases[-1])

    def __call__(self, observations: ArrayLike) -> Array:
        """(k, action size) of (k, observation size), each row by itself, to the bit; or one row of one row."""
        rows = np.asarray(observations, np.float32)
        x = (np.atleast_2d(rows) - self.mean) / self.std
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            if k:
                x = np.where(x > 0, x, np.expm1(np.minimum(x, 0)))
            # Not `@`: BLAS would start threads, which get into the way of a batch's own, and its bits vary with k.
            x = np.einsum("ki,oi->ko", x, weight) + bias
        return x.reshape(*rows.shape[:-1], self.action_size)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes a .npz file."""
        layers = {f"weight{k}": w for k, w in enumerate(self.weights)} | {
            f"bias{k}": b for k, b in enumerate(self.biases)
        }
        np.savez_compressed(path, mean=self.mean, std=self.std, **layers)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> MlpPolicy:
        """Reads what `save` wrote. ValueError for another kind of file."""
        with np.load(path, allow_pickle=False) as file:
            missing = {"mean", "std", "weight0", "bias0"} - set(file.files)
            if missing:
                raise ValueError(f"{os.fspath(path)}: not a policy, it has no {', '.join(sorted(missing))}")
            count = sum(name.startswith("weight") for name in file.files)
            weights, biases = ([file[f"{kind}{k}"] for k in range(count)] for kind in ("weight", "bias"))
            return cls(weights, biases, file["mean"], file["std"])

    def _check(self) -> None:
        sizes = [len(self.mean), *(len(b) for b in self.biases)]
        if len(self.weights) != len(self.biases) or self.mean.shape != self.std.shape:
            raise ValueError(
                f"{len(self.weights)} weights, {len(self.biases)} biases, mean {self.mean.shape}, std {self.std.shape}"
            )
        for k, weight in enumerate(self.weights):
            if weight.shape != (sizes[k + 1], sizes[k]):
                raise ValueError(f"weight {k} has shape {weight.shape}; it must be {(sizes[k + 1], sizes[k])}")
        if not np.all(self.std > 0):
            raise ValueError("std must be positive")
