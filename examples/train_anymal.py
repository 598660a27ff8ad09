"""ANYmal learns to walk at commanded speeds: PPO of rsl_rl on a laptop's cores, from scratch in less than 20 minutes.

pip install '.[train]' in a checkout
python examples/train_anymal.py              trains, evaluates, and writes policy, learning curve and pictures
python examples/train_anymal.py --replay     evaluates and draws the policy that lies beside this file; needs no PyTorch

docs/training.md explains it and shows what comes out.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import io
import json
import os
import time
from pathlib import Path
from types import SimpleNamespace

# Before PyTorch: its threads would spin where the batch's, or other programs, could work.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

import gymnasium
import numpy as np

from stickslip.envs import AnymalFlat, AnymalFlatConfig, LocomotionState, rewards
from stickslip.envs.commands import Commands
from stickslip.envs.policy import MlpPolicy

TRAINED = Path(__file__).with_name("anymal_flat_policy.npz")  # what came out of this script

# The task. Its default rewards suit hundreds of millions of steps on a GPU. These lead to a trot with a few million: a wide kernel around
# the commanded velocity gives standing robots a slope to follow, weak penalties leave room to try, three terms say what a trot looks like.


def moves(state: LocomotionState) -> np.ndarray:
    """(n,) bool: it is told to go or to turn."""
    return np.square(state.commands).sum(axis=1) > 0.1**2


def trot_or_stand(state: LocomotionState) -> np.ndarray:
    """1 on two diagonal feet, or on all four where the robot is told to stand; else 0."""
    left_front, left_hind, right_front, right_hind = state.foot_contact.T
    trot = (left_front == right_hind) & (right_front == left_hind) & (left_front != right_front)
    stand = left_front & left_hind & right_front & right_hind
    return np.where(moves(state), trot, stand).astype(np.float32)


def fidgeting(state: LocomotionState) -> np.ndarray:
    """Distance of the joints from the stance where the robot is told to stand [rad]."""
    return rewards.joint_deviation(state) * ~moves(state)


def spread_legs(state: LocomotionState) -> np.ndarray:
    """Sum of squares of the hip abductions [rad^2]."""
    return np.square(state.joint_position[:, ::3]).sum(axis=1)


REWARDS = {
    "track_linear_velocity": (1.0, functools.partial(rewards.track_linear_velocity, variance=0.5)),
    "track_it_closely": (0.2, functools.partial(rewards.track_linear_velocity, variance=0.05)),
    "track_yaw_rate": (0.5, rewards.track_yaw_rate),
    "vertical_velocity": (-1.0, rewards.vertical_velocity),
    "roll_pitch_rate": (-0.02, rewards.roll_pitch_rate),
    "orientation": (-1.0, rewards.orientation),
    "base_height": (-20.0, functools.partial(rewards.base_height, target=0.48)),
    "joint_torque": (-1e-5, rewards.joint_torque),
    "joint_acceleration": (-1e-7, rewards.joint_acceleration),
    "action_rate": (-0.005, rewards.action_rate),
    "feet_air_time": (1.0, functools.partial(rewards.feet_air_time, wanted=0.25)),
    "trot_or_stand": (0.2, trot_or_stand),
    "fidgeting": (-0.2, fidgeting),
    "spread_legs": (-0.3, spread_legs),
}
COMMANDS = Commands(standing=0.1)  # and up to 1 m/s forward, back, left, right; 1 rad/s


def make_task(num_envs: int, autoreset_mode: str, *, noise: bool = True, threads: int = 0) -> AnymalFlat:
    """Random friction and payload, and pushes, are those of the default task."""
    config = AnymalFlatConfig(rewards=REWARDS, commands=COMMANDS, observation_noise=noise)
    task = gymnasium.make_vec(
        "stickslip/AnymalFlat-v0", num_envs=num_envs, autoreset_mode=autoreset_mode, config=config, num_threads=threads
    )
    return task.unwrapped


def velocity_errors(task: AnymalFlat) -> tuple[np.ndarray, np.ndarray]:
    """Of each robot: how far its horizontal velocity is from the commanded one [m/s], and its yaw rate [rad/s]."""
    state = task.state
    linear = state.commands[:, :2] - state.base_linear_velocity[:, :2]
    return np.hypot(linear[:, 0], linear[:, 1]), np.abs(state.commands[:, 2] - state.base_angular_velocity[:, 2])


# Training

NETWORK = {"class_name": "MLPModel", "hidden_dims": [128, 128], "activation": "elu", "obs_normalization": True}
PPO = {
    "num_steps_per_env": 24,
    "save_interval": 10**9,  # this script saves
    "check_for_nan": False,  # the task looks for them
    "obs_groups": {"actor": ["policy"], "critic": ["policy"]},
    "actor": NETWORK | {"distribution_cfg": {"class_name": "GaussianDistribution", "init_std": 0.8}},
    "critic": NETWORK,
    "algorithm": {
        "class_name": "PPO",
        "num_learning_epochs": 5,
        "num_mini_batches": 4,
        "learning_rate": 1e-3,
        "schedule": "adaptive",
        "desired_kl": 0.01,
        "entropy_coef": 0.005,
        "gamma": 0.99,
        "lam": 0.95,
    },
}


def train(args: argparse.Namespace) -> MlpPolicy:
    """Learns until the time is over; writes policy, checkpoint of rsl_rl and learning curve."""
    from stickslip.envs.rsl_rl import RslRlVecEnv, policy_of  # first: it says what to install

    args.output.mkdir(parents=True, exist_ok=True)
    import torch
    from rsl_rl.runners import OnPolicyRunner

    torch.manual_seed(args.seed)
    curve = Curve(args.envs)
    task = make_task(args.envs, "SameStep", threads=args.threads)
    if args.threads:
        torch.set_num_threads(args.threads)
    env = RslRlVecEnv(task, seed=args.seed, metrics=curve.collect)
    with contextlib.redirect_stdout(io.StringIO()):  # it prints its networks
        runner = OnPolicyRunner(env, PPO)
    examinee = make_task(128, "NextStep", noise=False, threads=args.threads)
    print(f"{args.envs} robots in training, {task.batch.instruction_set}, {task.batch.num_threads} threads")
    while curve.minutes < args.minutes:
        runner.learn(1, init_at_random_ep_len=curve.iterations == 0)
        curve.end_iteration()
        if curve.exam_is_due(args.minutes / 24):
            curve.add_exam(evaluate(policy_of(runner), examinee, seed=1))
            print(curve.last_line(), flush=True)
    policy = policy_of(runner)
    policy.save(args.output / "policy.npz")
    runner.save(str(args.output / "model.pt"))
    curve.save(args.output / "curve.json")
    plot(json.loads((args.output / "curve.json").read_text()), args.output / "curve.png")
    return policy


class Curve:
    """How training went, by wall-clock time, exams included, since the curve was made."""

    def __init__(self, num_envs: int):
        self._num_envs, self._begin = num_envs, (time.perf_counter(), time.process_time())
        self._errors: list[float] = []
        # Rows: wall-clock time [min], time of all cores [min], million robot-steps, and then
        self.training: list[list[float]] = []  # mean velocity error with exploration [m/s]
        self.exams: list[list[float]] = []  # that without exploration [m/s], share of falls

    @property
    def minutes(self) -> float:
        """Since the curve was made."""
        return (time.perf_counter() - self._begin[0]) / 60

    @property
    def iterations(self) -> int:
        """Done so far."""
        return len(self.training)

    def collect(self, task: AnymalFlat) -> dict[str, float]:
        """After each step of the task."""
        self._errors.append(float(velocity_errors(task)[0].mean()))
        return {}

    def end_iteration(self) -> None:
        """Averages what was collected."""
        self.training.append([*self._now(self.iterations + 1), float(np.mean(self._errors))])
        self._errors.clear()

    def exam_is_due(self, every: float) -> bool:
        """A minute or whatever `every` is [min] is over."""
        return self.minutes >= every * len(self.exams)

    def add_exam(self, result: dict[str, float]) -> None:
        """What `evaluate` found."""
        self.exams.append([*self._now(self.iterations), result["velocity_error"], result["fallen"]])

    def last_line(self) -> str:
        """For the terminal."""
        minutes, core_minutes, steps, error, fallen = self.exams[-1]
        return (
            f"{minutes:5.1f} min ({core_minutes:4.1f} of cores)  {steps:5.1f} M robot-steps  "
            f"error {error:.3f} m/s  {fallen:5.1%} fall"
        )

    def save(self, path: Path) -> None:
        """Writes JSON."""
        rows = {"training": self.training, "exams": self.exams}
        path.write_text(json.dumps({k: [[round(x, 4) for x in row] for row in v] for k, v in rows.items()}))

    def _now(self, iterations: int) -> tuple[float, float, float]:
        steps = iterations * PPO["num_steps_per_env"] * self._num_envs
        return self.minutes, (time.process_time() - self._begin[1]) / 60, steps / 1e6


def plot(curve: dict[str, list[list[float]]], path: Path) -> None:
    """Tracking error and falls over minutes of training."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    minutes, core_minutes, steps, error = np.transpose(curve["training"])
    exam_minutes, _, _, exam_error, fallen = np.transpose(curve["exams"])
    figure, (top, bottom) = pyplot.subplots(
        2, 1, figsize=(6.4, 4.8), sharex=True, height_ratios=(2, 1), layout="constrained"
    )
    top.plot(minutes, error, color="0.7", label="training, with exploration noise")
    top.plot(exam_minutes, exam_error, "o-", color="C0", markersize=3, label="policy, 128 episodes of 20 s")
    top.axhline(0.25, color="C3", linewidth=1, linestyle="--", label="goal")
    top.set(ylabel="mean velocity error [m/s]", ylim=(0, None))
    top.legend(frameon=False)
    bottom.plot(exam_minutes, 100 * fallen, "o-", color="C0", markersize=3)
    bottom.axhline(5, color="C3", linewidth=1, linestyle="--")
    bottom.set(
        ylabel="falls [%]",
        xlabel=f"wall-clock time [min]; in all {steps[-1]:.1f} million robot-steps, {core_minutes[-1]:.1f} min of cores",
        ylim=(0, 100),
        xlim=(0, None),
    )
    figure.savefig(path, dpi=150)
    pyplot.close(figure)


# Evaluation and replay


def evaluate(policy: MlpPolicy, task: AnymalFlat, seed: int) -> dict[str, float]:
    """One episode of 20 s of each robot, commands drawn anew every 10 s, the time after such a change included.

    velocity_error [m/s], yaw_error [rad/s]: means over time and robots, until a robot falls. fallen: share of the episodes.
    """
    observations, _ = task.reset(seed=seed)
    up = np.ones(task.num_envs, bool)
    sums = np.zeros(3)
    for _ in range(task.max_episode_steps):
        observations, _, terminated, _, _ = task.step(policy(observations))
        up &= ~terminated
        linear, yaw = velocity_errors(task)
        sums += linear[up].sum(), yaw[up].sum(), up.sum()
    linear, yaw, count = sums
    return {"velocity_error": linear / count, "yaw_error": yaw / count, "fallen": 1 - up.mean()}


SHOW = [  # seconds, command
    (1.0, (0.0, 0.0, 0.0)),
    (2.5, (1.0, 0.0, 0.0)),
    (2.0, (0.8, 0.0, 1.0)),
    (2.0, (0.0, 0.7, 0.0)),
    (1.5, (-0.7, 0.0, 0.0)),
]


def replay(policy: MlpPolicy, output: Path, frames_per_second: int = 10) -> None:
    """One robot follows `SHOW`; writes an animation and a strip of pictures."""
    from concurrent.futures import ThreadPoolExecutor

    from PIL import Image

    from stickslip.paper.render import render
    from stickslip.paper.robot_view import Shot
    from stickslip.paper.strips import strip

    task = make_task(1, "NextStep", noise=False, threads=1)
    observations, _ = task.reset(seed=3)
    shots, every = [], round(1 / frames_per_second / task.step_seconds)
    commands = [command for seconds, command in SHOW for _ in range(round(seconds / task.step_seconds))]
    for step, command in enumerate(commands):
        task.commands[:] = command
        observations, *_ = task.step(policy(observations))
        if step % every == 0:
            shots.append(Shot.of(still(task), distance=2.8, look_up=0.32))
    with ThreadPoolExecutor() as pool:
        frames = list(pool.map(lambda shot: Image.fromarray(render(shot.parts, shot.camera, 320, 213)), shots))
    colors = strip(frames[::8]).quantize(256, Image.Quantize.FASTOCTREE)  # the same for all, or they would flicker
    animation = [frame.quantize(palette=colors, dither=Image.Dither.NONE) for frame in frames]
    every_ms = 1000 // frames_per_second
    animation[0].save(output / "walk.gif", save_all=True, append_images=animation[1:], duration=every_ms, loop=0)
    chosen = np.linspace(0, len(frames) - 1, 4).round().astype(int)
    strip([frames[k] for k in chosen], [f"{k / frames_per_second:.1f} s" for k in chosen]).save(output / "walk.png")


def still(task: AnymalFlat) -> SimpleNamespace:
    """Robot 0 of the batch as something that can be drawn, forces of its feet included."""
    robot, batch = task.robot, task.batch
    robot.set_state(batch.q[0], batch.u[0])
    contacts = [
        SimpleNamespace(position=robot.frame_pose(point.shape.split("/")[0]).position, impulse=impulse.astype(float))
        for point, impulse in zip(batch.contact_points, batch.contact_impulse[0], strict=True)
        if "FOOT" in point.shape
    ]
    shown = SimpleNamespace(
        q=robot.q, frame_pose=robot.frame_pose, contacts=contacts, solve_info=SimpleNamespace(substeps=1)
    )
    return SimpleNamespace(robot=shown, world=task.world)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--replay", nargs="?", const=TRAINED, type=Path, metavar="POLICY", help="a policy.npz; no training"
    )
    parser.add_argument("--minutes", type=float, default=20, help="of training (%(default)s)")
    parser.add_argument("--envs", type=int, default=512, help="robots (%(default)s)")
    parser.add_argument("--threads", type=int, default=0, help="0: one per core")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--episodes", type=int, default=1000, help="of the evaluation (%(default)s)")
    parser.add_argument("--output", type=Path, default=Path("train_anymal"), help="folder (%(default)s)")
    args = parser.parse_args()
    args.output.mkdir(parents=True, exist_ok=True)
    policy = MlpPolicy.load(args.replay) if args.replay else train(args)
    result = evaluate(policy, make_task(args.episodes, "NextStep", noise=False, threads=args.threads), seed=2)
    print(
        f"{args.episodes} episodes of 20 s: velocity error {result['velocity_error']:.3f} m/s, "
        f"yaw rate error {result['yaw_error']:.3f} rad/s, {result['fallen']:.1%} fall"
    )
    replay(policy, args.output)
    print(f"pictures: {args.output / 'walk.gif'}, {args.output / 'walk.png'}")


if __name__ == "__main__":
    main()
