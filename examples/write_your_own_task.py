"""ANYmal jumps: a task of your own in one file, NumPy on whole batches (docs/write_your_own_task.md)."""

import gymnasium
import numpy as np

import stickslip as ss
from stickslip.envs import VectorTask, register

STANCE = np.array([0.0, 0.4, -0.8, 0.0, -0.4, 0.8] * 2, np.float32)  # hip, thigh, knee; front and hind, left and right


class AnymalJump(VectorTask):
    """Jump as high as you can, and do not fall over."""

    episode_seconds = 2.0
    action_limit = 2.0

    def make_world(self):
        world = ss.World(self.time_step)
        world.add_ground()
        robot = world.add_robot(ss.assets.path("anymal_b"))
        robot.set_state(np.concatenate([[0, 0, 0.5, 1, 0, 0, 0], STANCE]), np.zeros(robot.nu))
        robot.set_pd_gains(100.0, 2.0)
        return world

    def setup(self):
        self.highest = np.zeros(self.num_envs, np.float32)  # of the base in this episode [m]

    def begin_episodes(self, envs):  # indices of the environments whose episode begins
        q = np.tile(self.robot.q, (len(envs), 1))
        q[:, 7:] += self.random.uniform(envs, -0.05, 0.05, 12)
        self.batch.reset(envs, q=q)
        self.highest[envs] = q[:, 2]

    def apply(self, actions):
        self.batch.pd_target = STANCE + 0.5 * actions

    def observe(self):
        q, u = self.batch.q, self.batch.u
        return np.concatenate([q[:, 2:7], q[:, 7:] - STANCE, 0.1 * u, self.highest[:, None]], axis=1)

    def rewards(self):  # terms by name: an episode's info has their sums
        rise = np.maximum(self.batch.q[:, 2] - self.highest, 0.0)
        self.highest += rise
        return {"height": 10.0 * rise, "effort": -1e-3 * np.square(self.actions).sum(axis=1)}

    def terminations(self):
        x, y = self.batch.q[:, 4], self.batch.q[:, 5]  # of the base quaternion
        return {"fell": 1.0 - 2.0 * (x * x + y * y) < 0.5}  # z axis of the base against the vertical


register("examples/AnymalJump-v0", AnymalJump)


def crouch_and_stretch(step):
    """A jump without feedback: the same action for all environments."""
    bend = 0.6 if step < 20 else -0.6 if step < 30 else 0.0
    return np.float32(bend) * np.array([0, 1, -2, 0, -1, 2] * 2, np.float32)


def check():
    envs = gymnasium.make_vec("examples/AnymalJump-v0", num_envs=64)
    envs.reset(seed=0)
    for step in range(envs.max_episode_steps):
        actions = np.tile(crouch_and_stretch(step), (64, 1))
        *_, truncated, infos = envs.step(actions)
    heights = 0.5 + infos["reward_terms"]["height"] / 10.0
    print(
        f"bases rose to {heights.min():.2f} ... {heights.max():.2f} m; {truncated.sum()} of {envs.num_envs} still stand"
    )
    assert truncated.all() and heights.min() > 0.6


if __name__ == "__main__":
    check()
