"""Time per stage of a step, which worlds and batches measure alike."""

from __future__ import annotations

from stickslip import _core
from stickslip.reports import StageTimes


class Profiled:
    """What has a `_core` that counts the time of its stages."""

    _core: _core.World | _core.Batch

    def set_profiling(self, on: bool) -> None:
        """Counts the time of each stage of a step (a little slower)."""
        self._core.set_profiling(bool(on))

    @property
    def stage_times(self) -> StageTimes:
        """Time per stage since the last reset; of a Batch of all threads, summed, and `steps` counts robot-steps."""
        t = self._core.stage_times
        return StageTimes(t.dynamics, t.detection, t.delassus, t.solve, t.integrate, t.steps)

    def reset_stage_times(self) -> None:
        """Starts counting from zero."""
        self._core.reset_stage_times()
