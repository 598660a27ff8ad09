"""Gymnasium environments on `stickslip.Batch`; importing this package registers them.

    import gymnasium, stickslip.envs
    envs = gymnasium.make_vec("stickslip/AnymalFlat-v0", num_envs=4096)

docs/envs.md describes them, docs/write_your_own_task.md how to make another one.
"""

try:
    import gymnasium
    from gymnasium.vector import AutoresetMode
except ImportError as error:
    raise ImportError("stickslip.envs needs Gymnasium 1.1 or newer: pip install '.[gym]' in a checkout") from error

from stickslip.envs import commands, observations, randomization, rewards, terminations
from stickslip.envs.anymal_flat import AnymalFlat, AnymalFlatConfig
from stickslip.envs.locomotion_state import LocomotionState
from stickslip.envs.registration import register
from stickslip.envs.single import SingleTask, single
from stickslip.envs.streams import RandomStreams
from stickslip.envs.task import VectorTask

__all__ = [
    "AnymalFlat",
    "AnymalFlatConfig",
    "AutoresetMode",
    "LocomotionState",
    "RandomStreams",
    "SingleTask",
    "VectorTask",
    "commands",
    "observations",
    "randomization",
    "register",
    "rewards",
    "single",
    "terminations",
]

# By name, so that a specification can be saved and sent to other processes.
gymnasium.register(
    id="stickslip/AnymalFlat-v0",
    entry_point="stickslip.envs.anymal_flat:AnymalFlatEnv",
    vector_entry_point="stickslip.envs.anymal_flat:AnymalFlat",
)
