"""Throughput of batches: what the command `stickslip bench` does. See docs/throughput.md.

`anymal_task` and `urdf_task` say what robots do, `measure` runs them in a batch, beside MuJoCo where it is installed.
"""

from __future__ import annotations

from stickslip.bench.measuring import Options, Result, measure
from stickslip.bench.tasks import TASKS, Task, anymal_task, urdf_task

__all__ = ["TASKS", "Options", "Result", "Task", "anymal_task", "measure", "urdf_task"]
