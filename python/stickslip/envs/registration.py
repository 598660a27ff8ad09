"""Makes tasks known to Gymnasium."""

from __future__ import annotations

from typing import Any

import gymnasium

from stickslip.envs.single import single
from stickslip.envs.task import VectorTask

__all__ = ["register"]


def register(id: str, task_class: type[VectorTask], **kwargs: Any) -> None:
    """`gymnasium.make_vec(id, num_envs=...)` makes the task, `gymnasium.make(id)` one environment of it.

    id: "namespace/Name-v0". kwargs: arguments of the task's constructor, which the call may override.
    """
    gymnasium.register(id=id, entry_point=single(task_class), vector_entry_point=task_class, kwargs=kwargs)
