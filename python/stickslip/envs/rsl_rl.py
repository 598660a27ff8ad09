"""A task as the environment that rsl_rl, the trainer of the legged-robot community, expects. Needs the extra `train`.

task = gymnasium.make_vec("stickslip/AnymalFlat-v0", num_envs=1024, autoreset_mode="SameStep")
runner = rsl_rl.runners.OnPolicyRunner(RslRlVecEnv(task), config)
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

try:
    import torch
    from rsl_rl.env import VecEnv
    from tensordict import TensorDict
except ImportError as error:
    raise ImportError(
        "stickslip.envs.rsl_rl needs rsl-rl-lib and PyTorch: pip install '.[train]' in a checkout"
    ) from error

import numpy as np
from gymnasium.vector import AutoresetMode

from stickslip.envs.policy import MlpPolicy
from stickslip.envs.task import VectorTask

__all__ = ["RslRlVecEnv", "policy_of"]


class RslRlVecEnv(VecEnv):
    """Passes torch tensors to a task and back.

    task: what `gymnasium.make_vec(..., autoreset_mode="SameStep")` returns. seed: of its first episodes.
    metrics: called with the task after each step; numbers by name that rsl_rl logs, as in `{"/speed": 0.7}`.

    The observation group is "policy". Of ended episodes it logs the mean of each reward term, per second, and how many fell.
    """

    def __init__(
        self,
        task: VectorTask,
        *,
        seed: int | None = None,
        device: str = "cpu",
        metrics: Callable[[VectorTask], dict[str, float]] | None = None,
    ):
        task = getattr(task, "unwrapped", task)
        if not isinstance(task, VectorTask):
            raise TypeError(f"task is a {type(task).__name__}; a stickslip.envs.VectorTask is wanted")
        if task.autoreset_mode is not AutoresetMode.SAME_STEP:
            raise ValueError(
                f'autoreset_mode is "{task.autoreset_mode.value}"; rsl_rl expects "SameStep", say so in make_vec'
            )
        self.task, self.device, self.cfg = task, device, getattr(task, "config", {})
        self.num_envs, self.num_actions = task.num_envs, task.action_size
        self.max_episode_length = task.max_episode_steps
        self._metrics = metrics
        self._observation, _ = task.reset(seed=seed)

    @property
    def episode_length_buf(self) -> torch.Tensor:
        """(num_envs,) steps since each episode began. rsl_rl assigns random ones at first, so that episodes end at different times."""
        return torch.from_numpy(self.task.episode_steps.astype(np.int64))

    @episode_length_buf.setter
    def episode_length_buf(self, steps: torch.Tensor) -> None:
        self.task.episode_steps[:] = steps.cpu().numpy()

    def get_observations(self) -> TensorDict:
        """Group "policy": (num_envs, size)."""
        observation = torch.from_numpy(self._observation).to(self.device)
        return TensorDict({"policy": observation}, batch_size=[self.num_envs], device=self.device)

    def step(self, actions: torch.Tensor) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict[str, Any]]:
        """Observations, rewards (num_envs,), who ended (num_envs,), and "time_outs": who ended for no other reason."""
        # The task returns a new array each time: what rsl_rl stored of the last step stays.
        self._observation, rewards, terminated, truncated, infos = self.task.step(actions.detach().cpu().numpy())
        extras = {"time_outs": self._tensor(truncated), "log": self._log(terminated, infos)}
        return self.get_observations(), self._tensor(rewards), self._tensor(terminated | truncated), extras

    def _tensor(self, values: np.ndarray) -> torch.Tensor:
        return torch.from_numpy(values).to(self.device)

    def _log(self, terminated: np.ndarray, infos: dict[str, Any]) -> dict[str, float]:
        log = {} if self._metrics is None else dict(self._metrics(self.task))
        if "_final_info" in infos:
            ended, final = infos["_final_info"], infos["final_info"]
            seconds = np.maximum(final["episode_steps"][ended], 1) * self.task.step_seconds
            for name, sums in final["reward_terms"].items():
                if not name.startswith("_"):
                    log[f"/reward/{name}"] = float((sums[ended] / seconds).mean())
            log["/fallen"] = float(terminated[ended].mean())
        return log


def policy_of(runner: Any) -> MlpPolicy:
    """The mean action of what an rsl_rl runner has trained so far, without torch. Its actor must be an "MLPModel" with "elu"."""
    state = {name: value.detach().cpu().numpy() for name, value in runner.alg.get_policy().state_dict().items()}
    size = state["mlp.0.weight"].shape[1]
    mean = state.get("obs_normalizer._mean", np.zeros((1, size)))[0]
    std = state.get("obs_normalizer._std", np.ones((1, size)))[0]
    epsilon = getattr(runner.alg.get_policy().obs_normalizer, "eps", 0.0)
    layers = sorted(int(name.split(".")[1]) for name in state if name.startswith("mlp.") and name.endswith(".weight"))
    weights = [state[f"mlp.{layer}.weight"] for layer in layers]
    biases = [state[f"mlp.{layer}.bias"] for layer in layers]
    return MlpPolicy(weights, biases, mean, std + epsilon)
