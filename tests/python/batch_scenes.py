"""Worlds, states and comparisons that the tests of batches share."""

from __future__ import annotations

from typing import Any

import numpy as np

import stickslip as ss

MODEL = ss.load_urdf(ss.assets.path("anymal_b"))
# Knees bent, feet under the hips, front and hind legs mirrored.
STANCE = np.array(
    [{"HAA": 0.0, "HFE": 0.4, "KFE": -0.8}[name[3:]] * (1 if name[1] == "F" else -1) for name in MODEL.joint_names]
)
NUMBERS = {"float32": np.float32, "float64": np.float64}
INTEGRATORS = ("energy_safe", "semi_implicit")
OUTPUTS = ("contact_impulse", "contact_active", "status", "residual", "time")
PARAMETERS = ("kp", "kd", "friction", "gravity", "body_mass", "body_com", "body_inertia", "external_wrench")


def anymal(model: ss.Model = MODEL, height: float = 0.52, **options) -> ss.World:
    """ANYmal above the ground in its stance, held by PD control."""
    world = ss.World(**options)
    world.add_ground()
    robot = world.add_robot(model, position=(0, 0, height))
    robot.set_state(np.concatenate([robot.q[:7], STANCE]), np.zeros(robot.nu))
    robot.set_pd_gains(80.0, 2.0)
    robot.pd_target = STANCE
    return world


def box(mass: float = 2.0, **options) -> ss.World:
    """A cube of 0.2 m at rest on the ground, its center of mass off the middle."""
    builder = ss.ModelBuilder("box")
    inertia = mass * 0.2**2 / 6 * np.eye(3)
    builder.add_link("box", mass=mass, center_of_mass=(0.02, 0.01, -0.03), inertia=inertia)
    builder.add_shape("box", "box", (0.2, 0.2, 0.2))
    world = ss.World(**options)
    world.add_ground()
    world.add_robot(builder.build(), position=(0, 0, 0.1))
    return world


def arm(**options) -> ss.World:
    """Two links on a fixed base over the ground, which the second can hit."""
    builder = ss.ModelBuilder("arm")
    builder.add_link("foundation")
    for name in ("upper", "lower"):
        builder.add_link(name, mass=1.0, center_of_mass=(0.2, 0, 0), inertia=np.diag([1e-3, 1e-2, 1e-2]))
        builder.add_shape(name, "capsule", (0.03, 0.4), position=(0.2, 0, 0), orientation=(0.5**0.5, 0, 0.5**0.5, 0))
    builder.add_joint("shoulder", "revolute", "foundation", "upper", axis=(0, 1, 0), damping=0.05)
    builder.add_joint("elbow", "revolute", "upper", "lower", position=(0.4, 0, 0), axis=(0, 1, 0))
    world = ss.World(**options)
    world.add_ground()
    world.add_robot(builder.build("fixed"), position=(0, 0, 0.5))
    return world


def scattered_states(num_envs: int, seed: int = 7) -> tuple[np.ndarray, np.ndarray]:
    """q (num_envs, 19), u (num_envs, 18) of ANYmal: low and upright, high and tumbling, by turns. Row k is the same for any count."""
    q, u = np.empty((num_envs, 19)), np.empty((num_envs, 18))
    for env in range(num_envs):
        rng = np.random.default_rng([seed, env])
        wild = 1.0 if env % 2 else 0.05
        turn = np.array([1, 0, 0, 0]) + wild * rng.uniform(-1, 1, 4)
        q[env] = [
            *rng.uniform(-1, 1, 2),
            0.52 + 0.2 * wild * rng.uniform(),
            *turn / np.linalg.norm(turn),
            *STANCE + wild * rng.uniform(-0.5, 0.5, 12),
        ]
        u[env] = wild * rng.uniform(-2, 2, 18)
    return q, u


def scattered(
    num_envs: int, dtype: str = "float64", num_threads: int = 1, pin_threads: bool = False, **options
) -> ss.Batch:
    """ANYmals in `scattered_states`."""
    batch = ss.Batch(anymal(**options), num_envs, dtype, num_threads, pin_threads=pin_threads)
    batch.reset(None, *scattered_states(num_envs))
    return batch


def drive(batch: Any, step: int) -> None:
    """Targets that move with time, other ones for each environment and the same whatever the number of environments."""
    phase = np.arange(batch.num_envs)[:, None] + 0.02 * step + np.arange(batch.model.num_joints)
    batch.pd_target[:] = STANCE + 0.2 * np.sin(phase)


def run(batch: ss.Batch, steps: int, first: int = 0) -> None:
    """So many steps, driven, from step `first` on."""
    for step in range(first, first + steps, 5):
        drive(batch, step)
        batch.step(5)


def same_bits(a: np.ndarray, b: np.ndarray) -> bool:
    """Every bit, the sign of zero too."""
    return a.dtype == b.dtype and a.shape == b.shape and np.ascontiguousarray(a).tobytes() == b.tobytes()


def assert_same_bits(one: Any, two: Any, names: tuple[str, ...], rows: Any = slice(None), where: str = "") -> None:
    """These arrays of two batches, for these environments."""
    for name in names:
        a, b = getattr(one, name)[rows], getattr(two, name)[rows]
        assert a.dtype == b.dtype and a.shape == b.shape, name
        if not same_bits(a, b):
            as_bits = [x.view(f"u{x.itemsize}") for x in map(np.ascontiguousarray, (a, b))]
            at = tuple(int(i) for i in np.argwhere(as_bits[0] != as_bits[1])[0])
            raise AssertionError(f"{name}{list(at)} {where}: {a[at]!r} and {b[at]!r}")


def payload(extra: float) -> ss.Model:
    """ANYmal with so much more mass in its base [kg], the rest as it was."""
    mass = repr(MODEL.bodies[0].mass)
    text = ss.assets.path("anymal_b").read_text()
    assert text.count(f'"{mass}"') == 1
    return ss.parse_urdf(text.replace(f'"{mass}"', f'"{MODEL.bodies[0].mass + extra!r}"'))
