"""Parameters of an environment act as those of a world or model that has them; wrenches as generalized forces."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss
from batch_of_worlds import BatchOfWorlds
from batch_scenes import (
    INTEGRATORS,
    MODEL,
    NUMBERS,
    OUTPUTS,
    PARAMETERS,
    anymal,
    arm,
    assert_same_bits,
    box,
    payload,
    same_bits,
    scattered,
    scattered_states,
)

# Reading and keeping


@pytest.mark.parametrize("dtype", NUMBERS)
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_reading_parameters_changes_no_bit(dtype: str, integrator: str) -> None:
    batch, plain = (scattered(9, dtype, integrator=integrator) for _ in range(2))
    batch.step(40)
    plain.step(40)
    for name in PARAMETERS:
        setattr(batch, name, getattr(batch, name).copy())
        assert getattr(batch, name).shape[0] == 9
    batch.step(100)
    plain.step(100)
    assert_same_bits(batch, plain, ("q", "u", *OUTPUTS))


def test_parameters_stay_through_resets_and_snapshots() -> None:
    batch = ss.Batch(anymal(), 3)
    blob = batch.save_state()
    batch.friction = 0.1
    batch.pd_target = 0.5
    batch.reset()
    batch.load_state(blob)
    assert (batch.friction == np.float32(0.1)).all() and (batch.pd_target == 0.5).all()


# Masses


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_mass_is_that_of_a_model_with_such_a_mass(integrator: str) -> None:
    extra = [-3.0, 0.0, 5.0]
    batch = ss.Batch(anymal(integrator=integrator), 3, "float64")
    batch.body_mass[:, 0] += extra
    batch.step(300)
    for env, mass in enumerate(extra):
        world = anymal(payload(mass), integrator=integrator)
        world.step(300)
        assert same_bits(batch.q[env], world.robots[0].q), mass
        assert same_bits(batch.u[env], world.robots[0].u), mass
    # The heavier, the deeper it stands against its springs.
    assert batch.q[0, 2] > batch.q[1, 2] + 1e-4 > batch.q[2, 2] + 2e-4


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_inertia_and_center_of_mass_are_those_of_a_model_that_has_them(integrator: str) -> None:
    inertia, center = np.diag([0.02, 0.03, 0.04]), (0.01, -0.02, 0.03)

    def single(**properties) -> ss.World:
        builder = ss.ModelBuilder("body")
        builder.add_link("body", mass=2.0, **properties)
        builder.add_shape("body", "box", (0.3, 0.2, 0.1))
        world = ss.World(integrator=integrator)
        world.add_ground()
        robot = world.add_robot(builder.build(), position=(0, 0, 0.15))
        robot.set_state(robot.q, [0.5, 0, 0, 1, 2, 3])
        return world

    batch = ss.Batch(single(inertia=0.01 * np.eye(3)), 3, "float64")
    batch.body_inertia[1] = inertia[np.triu_indices(3)]
    batch.body_com[2] = center
    worlds = [
        single(inertia=0.01 * np.eye(3)),
        single(inertia=inertia),
        single(inertia=0.01 * np.eye(3), center_of_mass=center),
    ]
    for _ in range(30):
        batch.step(10)
        for env, world in enumerate(worlds):
            world.step(10)
            assert same_bits(batch.q[env], world.robots[0].q), env
    assert batch.contact_active.all(axis=0).any() and np.ptp(batch.q, axis=0).max() > 0.01


# Gravity, friction and gains


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_gravity_is_that_of_a_world_that_has_it(integrator: str) -> None:
    gravities = [(0, 0, -9.81), (0, 0, -1.62), (1.5, -0.5, -9), (0, 0, 0)]
    batch = ss.Batch(anymal(integrator=integrator), 4, "float64")
    batch.gravity = gravities
    batch.step(300)
    for env, gravity in enumerate(gravities):
        world = anymal(integrator=integrator, gravity=gravity)
        world.step(300)
        assert same_bits(batch.q[env], world.robots[0].q), gravity


@pytest.mark.parametrize("dtype", NUMBERS)
def test_box_slides_where_gravity_leans_more_than_friction_holds(dtype: str) -> None:
    # On a slope of angle a: at rest up to tan a = mu, else acceleration g (sin a - mu cos a).
    slope = np.array([0.1, 0.2, 0.3, 0.3, 0.3, 0.4])
    mu = np.array([0.5, 0.5, 0.5, 0.2, 0.0, 0.35])
    batch = ss.Batch(box(), 6, dtype)
    batch.gravity = 9.81 * np.stack([np.sin(slope), np.zeros(6), -np.cos(slope)], axis=1)
    batch.friction = mu[:, None]
    batch.step(200)
    # In contact, u lacks half a step of gravity (`Robot.mechanical_energy`): 199.5 steps of 1 ms.
    expected = 9.81 * np.maximum(0, np.sin(slope) - mu * np.cos(slope)) * 0.1995
    np.testing.assert_allclose(batch.u[:, 0], expected, rtol=1e-4, atol=1e-6)
    assert (expected[:3] == 0).all() and (expected[3:] > 0.1).all()


def test_gains_and_friction_have_the_bits_of_worlds() -> None:
    batch, worlds = ss.Batch(anymal(), 4, "float64"), BatchOfWorlds(anymal, 4)
    for b in (batch, worlds):
        b.reset(None, *scattered_states(4))
        b.kp = [[40.0], [60.0], [80.0], [0.0]]
        b.kd = [[0.5], [1.0], [2.0], [0.0]]
        b.friction = [[0.0], [0.2], [0.8], [1.5]]
    for _ in range(30):
        batch.step(10)
        worlds.step(10)
        assert_same_bits(batch, worlds, ("q", "u", *OUTPUTS))


# Wrenches


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_wrench_on_the_base_is_a_generalized_force(integrator: str) -> None:
    # About the base origin: force f, torque t + c x f with c the center of mass, turned with the body. One step, so that c stays.
    rng = np.random.default_rng(3)
    wrench = rng.uniform(-50, 50, (8, 6))
    wrenches, forces = (scattered(8, integrator=integrator) for _ in range(2))
    wrenches.external_wrench[:, 0] = wrench
    for env in range(8):
        robot = anymal().robots[0]
        robot.set_state(*(x[env] for x in scattered_states(8)))
        arm = robot.frame_pose("base").rotation @ MODEL.bodies[0].center_of_mass
        f, t = wrench[env, :3], wrench[env, 3:]
        forces.generalized_force[env, :6] = [*f, *(t + np.cross(arm, f))]
    wrenches.step()
    forces.step()
    np.testing.assert_allclose(wrenches.u, forces.u, rtol=0, atol=1e-9)
    forces.reset(None, *scattered_states(8))
    forces.generalized_force = 0
    forces.step()
    assert (np.abs(wrenches.u - forces.u).max(axis=1) > 1e-4).all()


def test_wrench_on_a_link_acts_through_its_jacobian() -> None:
    body = MODEL.body_index("RH_THIGH")
    wrench = np.array([30.0, -20.0, 10.0, 4.0, -5.0, 6.0])
    wrenches, forces = scattered(6), scattered(6)
    wrenches.external_wrench[:, body] = wrench
    for env in range(6):
        robot = anymal().robots[0]
        robot.set_state(*(x[env] for x in scattered_states(6)))
        arm = robot.frame_pose("RH_THIGH").rotation @ MODEL.bodies[body].center_of_mass
        moment = np.concatenate([wrench[:3], wrench[3:] + np.cross(arm, wrench[:3])])
        forces.generalized_force[env] = robot.jacobian("RH_THIGH").T @ moment
    wrenches.step()
    forces.step()
    np.testing.assert_allclose(wrenches.u, forces.u, rtol=0, atol=1e-9)


def test_wrench_on_a_fixed_base_moves_nothing() -> None:
    plain, pulled = (ss.Batch(arm(integrator="energy_safe"), 3, "float64") for _ in range(2))
    for batch in (plain, pulled):
        batch.kp[:], batch.kd[:] = 0.0, 0.0
    pulled.external_wrench[:, 0] = 100.0
    plain.step(100)
    pulled.step(100)
    assert_same_bits(plain, pulled, ("q", "u", *OUTPUTS))
