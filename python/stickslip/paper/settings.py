"""How much each experiment samples."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Settings:
    """Sample counts; `Settings()` is the quick report, a few minutes on two cores."""

    name: str = "quick"
    slip_samples: int = 20_000  #: sliding contacts per task for Table I
    slip_max_steps: int = 200_000  #: and how long to look for them
    single_rounds: int = 7  #: timings of each method in Table I; the median counts
    timed_steps: int = 20_000  #: per task and method for Table II
    timed_rounds: int = 5
    recorded_steps: int = 20_000  #: per task and method for Fig. 4 and the sweeps of Table II
    profiled_steps: int = 10_000  #: per task and method for Fig. 5
    law_steps: int = 20_000  #: per task for Fig. 6, of which every
    law_stride: int = 5  #: -th problem is solved with both laws
    hang_seconds: float = 20.0  #: of Fig. 7 [s]
    large_steps: tuple[float, ...] = (1e-3, 5e-3, 10e-3, 20e-3)  #: [s]
    hang_episodes: tuple[int, ...] = (2, 5, 10, 20)  #: per large step
    drop_episodes: tuple[int, ...] = (10, 50, 100, 200)
    episode_seconds: dict[str, float] = field(default_factory=lambda: {"hang": 20.0, "drop": 5.0})
    frames: int = 6  #: per task
    frame_size: tuple[int, int] = (400, 330)


def quick() -> Settings:
    """Minutes."""
    return Settings()


def full() -> Settings:
    """The paper's counts: 100,000 contacts per task, 100,000 steps, 5 runs."""
    return Settings(
        name="full",
        slip_samples=100_000,
        slip_max_steps=4_000_000,
        single_rounds=15,
        timed_steps=100_000,
        timed_rounds=5,
        recorded_steps=100_000,
        profiled_steps=100_000,
        law_steps=100_000,
        law_stride=5,
        hang_episodes=(20, 20, 20, 100),
        drop_episodes=(100, 300, 500, 1000),
        frame_size=(640, 528),
    )


def tiny() -> Settings:
    """Seconds: enough to see that every part runs."""
    return Settings(
        name="tiny",
        slip_samples=300,
        slip_max_steps=20_000,
        single_rounds=3,
        timed_steps=500,
        timed_rounds=1,
        recorded_steps=4_000,
        profiled_steps=500,
        law_steps=2_000,
        law_stride=40,
        hang_seconds=1.0,
        large_steps=(5e-3, 20e-3),
        hang_episodes=(1, 1),
        drop_episodes=(1, 2),
        episode_seconds={"hang": 3.0, "drop": 3.0},
        frames=2,
        frame_size=(60, 50),
    )
