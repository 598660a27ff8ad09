"""Policies in NumPy: what they compute, files, errors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("gymnasium")
from stickslip.envs.policy import MlpPolicy


def small_policy() -> MlpPolicy:
    random = np.random.default_rng(0)
    weights = [random.normal(size=(4, 3)), random.normal(size=(2, 4))]
    biases = [random.normal(size=4), random.normal(size=2)]
    return MlpPolicy(weights, biases, mean=[1.0, 2.0, 3.0], std=[1.0, 0.5, 2.0])


def test_it_is_layers_with_elu_between_on_scaled_observations() -> None:
    policy, x = small_policy(), np.array([0.3, -2.0, 5.0])
    hidden = policy.weights[0] @ ((x - policy.mean) / policy.std) + policy.biases[0]
    assert (hidden < 0).any() and (hidden > 0).any(), "both branches of ELU are seen"
    hidden = np.array([h if h > 0 else np.exp(h) - 1 for h in hidden])
    np.testing.assert_allclose(policy(x), policy.weights[1] @ hidden + policy.biases[1], rtol=1e-5)
    assert (policy.observation_size, policy.action_size) == (3, 2)


def test_rows_are_independent_to_the_bit() -> None:
    policy = small_policy()
    x = np.random.default_rng(1).normal(size=(5, 3)) * 100
    actions = policy(x)
    assert actions.shape == (5, 2) and actions.dtype == np.float32
    np.testing.assert_array_equal(actions, [policy(row) for row in x])
    assert np.isfinite(policy([-1e30, 1e30, 0.0])).all(), "what is far out does not overflow in exp"


def test_files_give_the_same_bits_back(tmp_path: Path) -> None:
    policy, x = small_policy(), np.ones((2, 3))
    policy.save(tmp_path / "policy.npz")
    np.testing.assert_array_equal(MlpPolicy.load(tmp_path / "policy.npz")(x), policy(x))


def test_other_files_and_shapes_are_named(tmp_path: Path) -> None:
    np.savez(tmp_path / "other.npz", mean=np.zeros(3))
    with pytest.raises(ValueError, match=r"other\.npz: not a policy, it has no bias0, std, weight0"):
        MlpPolicy.load(tmp_path / "other.npz")
    with pytest.raises(ValueError, match=r"weight 1 has shape \(2, 5\); it must be \(2, 4\)"):
        MlpPolicy([np.ones((4, 3)), np.ones((2, 5))], [np.ones(4), np.ones(2)], np.zeros(3), np.ones(3))
    with pytest.raises(ValueError, match="std must be positive"):
        MlpPolicy([np.ones((2, 3))], [np.ones(2)], np.zeros(3), [1.0, 0.0, 1.0])
    with pytest.raises(ValueError, match="2 weights, 1 biases"):
        MlpPolicy([np.ones((2, 3)), np.ones((2, 2))], [np.ones(2)], np.zeros(3), np.ones(3))
