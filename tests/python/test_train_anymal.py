"""The training example: the policy beside it walks, its pictures are drawn, training writes what it promises."""

from __future__ import annotations

import argparse
import json
import runpy
import sys
from pathlib import Path
from typing import Any

import pytest

import stickslip as ss

if not hasattr(ss, "Batch"):
    pytest.skip("needs stickslip.Batch", allow_module_level=True)
pytest.importorskip("gymnasium")

SCRIPT = Path(__file__).parents[2] / "examples" / "train_anymal.py"


@pytest.fixture(scope="module")
def example() -> dict[str, Any]:
    return runpy.run_path(str(SCRIPT))


@pytest.fixture(scope="module")
def policy(example: dict[str, Any]) -> Any:
    return example["MlpPolicy"].load(example["TRAINED"])


def test_the_policy_beside_it_walks_at_commanded_speeds_without_falls(example: dict[str, Any], policy: Any) -> None:
    result = example["evaluate"](policy, example["make_task"](500, "NextStep", noise=False), seed=5)
    assert result["velocity_error"] < 0.25 and result["yaw_error"] < 0.25 and result["fallen"] <= 0.05, result


def test_a_fall_counts(example: dict[str, Any], policy: Any) -> None:
    task = example["make_task"](4, "NextStep", noise=False)
    begin = task.begin_episodes

    def begin_with_one_on_its_back(envs: Any) -> None:
        begin(envs)
        task.batch.q[1, 2:7] = 0.3, 0.0, 1.0, 0.0, 0.0

    task.begin_episodes = begin_with_one_on_its_back
    assert example["evaluate"](policy, task, seed=0)["fallen"] == 0.25


def test_replay_draws_without_torch(example: dict[str, Any], policy: Any, tmp_path: Path) -> None:
    from PIL import Image

    example["replay"](policy, tmp_path, frames_per_second=1)
    with Image.open(tmp_path / "walk.webp") as animation:
        assert animation.n_frames == round(sum(seconds for seconds, _ in example["SHOW"]))
    with Image.open(tmp_path / "walk.png") as picture:
        assert picture.width > 4 * 320
    assert "torch" not in sys.modules or "rsl_rl" in sys.modules, "only another test may have loaded it"


def test_training_writes_policy_checkpoint_and_curve(example: dict[str, Any], tmp_path: Path) -> None:
    pytest.importorskip("rsl_rl")
    args = argparse.Namespace(envs=32, minutes=0.05, threads=1, seed=0, output=tmp_path)
    trained = example["train"](args)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["curve.json", "curve.png", "model.pt", "policy.npz"]
    curve = json.loads((tmp_path / "curve.json").read_text())
    assert len(curve["training"]) >= 1 and len(curve["exams"]) >= 1
    assert curve["training"][0][2] == pytest.approx(32 * 24 / 1e6, abs=1e-4)
    loaded = example["MlpPolicy"].load(tmp_path / "policy.npz")
    assert (loaded.weights[0] == trained.weights[0]).all()
