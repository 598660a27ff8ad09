"""World and Robot as Python sees them: what they return, and what they say about bad input."""

from __future__ import annotations

import copy
import gc
import pickle
import warnings

import numpy as np
import pytest

import stickslip as ss

MESH = """
<robot name="statue">
  <link name="statue">
    <inertial><mass value="2"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><mesh filename="statue.stl"/></geometry></collision>
  </link>
</robot>
"""


def resting_ball(model: ss.Model, **options) -> tuple[ss.World, ss.Robot]:
    world = ss.World(**options)
    world.add_ground()
    return world, world.add_robot(model, position=(0, 0, 0.1))


def everything(world: ss.World) -> tuple:
    """All that a failing call must not change."""
    robots = [
        (r.name, r.q.tobytes(), r.u.tobytes(), r.generalized_force.tobytes(), r.pd_target.tobytes(), str(r.pd_gains))
        for r in world.robots
    ]
    return world.time, world.save_state(), robots


# Building


def test_default_world_has_the_documented_options() -> None:
    world = ss.World()
    assert (world.time, world.time_step, world.integrator) == (0.0, 1e-3, "energy_safe")
    assert world.gravity.tolist() == [0, 0, -9.81]
    assert world.robots == [] and world.contacts == []
    assert world.step() == ss.StepStatus.OK


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"time_step": 0}, "time_step"),
        ({"time_step": -1e-3}, "time_step"),
        ({"time_step": float("nan")}, "time_step"),
        ({"gravity": (0, 0)}, r"gravity has shape \(2,\)"),
        ({"gravity": (0, 0, float("inf"))}, r"gravity\[2\]"),
        ({"integrator": "euler"}, "integrator is 'euler'; choose one of 'energy_safe', 'semi_implicit'"),
        ({"method": "newton"}, "method is 'newton'; choose one of 'auto', 'per_contact', 'pgs'"),
        ({"law": "viscous"}, "law is 'viscous'; choose one of 'coulomb', 'max_dissipation'"),
        ({"single_contact": "guess"}, "'halley', 'bisection', 'golden_section', 'quartic'"),
        ({"tolerance": -1.0}, "tolerance"),
        ({"max_sweeps": -1}, "max_sweeps"),
        ({"max_sweeps": 2**40}, "max_sweeps is 1099511627776; it must be at most"),
        ({"alpha": float("nan")}, "alpha"),
        ({"max_substeps": 0}, "max_substeps"),
    ],
)
def test_bad_options_are_named(options: dict, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        ss.World(**options)


def test_options_of_a_wrong_type_are_type_errors() -> None:
    with pytest.raises(TypeError, match="time_step is 'fast'"):
        ss.World(time_step="fast")
    with pytest.raises(TypeError, match=r"max_sweeps is 1\.5"):
        ss.World(max_sweeps=1.5)


@pytest.mark.parametrize("act", [copy.copy, copy.deepcopy, pickle.dumps])
def test_copies_are_refused_with_advice(ball: ss.Model, act) -> None:
    world, robot = resting_ball(ball)
    with pytest.raises(TypeError, match="neither copied nor pickled; make another one .* save_state"):
        act(world)
    with pytest.raises(TypeError, match="belongs to its World and can be neither copied nor pickled"):
        act(robot)


def test_second_ground_is_refused() -> None:
    world = ss.World()
    world.add_ground(height=0.5)
    with pytest.raises(ValueError, match="ground"):
        world.add_ground()


def test_robot_from_a_file_knows_its_size() -> None:
    robot = ss.World().add_robot(ss.assets.path("anymal_b"), position=(0, 0, 0.6))
    assert (robot.nq, robot.nu, robot.num_joints, len(robot.joint_names)) == (19, 18, 12, 12)
    assert robot.mass == pytest.approx(robot.model.mass)
    assert robot.q[:7].tolist() == [0, 0, 0.6, 1, 0, 0, 0]
    assert "LF_FOOT" in robot.frame_names
    fixed = ss.World().add_robot(str(ss.assets.path("anymal_b")), base="fixed", position=(0, 0, 0.6))
    assert (fixed.nq, fixed.nu) == (12, 12)
    assert fixed.frame_pose(fixed.model.body_names[0]).position.tolist() == [0, 0, 0.6]


def test_orientation_is_normalized(ball: ss.Model) -> None:
    robot = ss.World().add_robot(ball, orientation=(2, 0, 0, 2))
    np.testing.assert_allclose(robot.q[3:], [0.5**0.5, 0, 0, 0.5**0.5], rtol=0, atol=1e-15)


def test_names_are_made_unique_but_not_taken_twice(ball: ss.Model) -> None:
    world = ss.World()
    names = [world.add_robot(ball).name for _ in range(3)]
    assert names[0] == "ball" and len(set(names)) == 3
    with pytest.raises(ValueError, match="ball"):
        world.add_robot(ball, name="ball")


@pytest.mark.parametrize(
    ("arguments", "error", "says"),
    [
        ({"robot": "missing.urdf"}, FileNotFoundError, "missing.urdf"),
        ({"robot": 3}, TypeError, "robot is a int"),
        ({"position": (0, 0)}, ValueError, r"position has shape \(2,\)"),
        ({"position": (0, 0, float("nan"))}, ValueError, r"position\[2\] is nan"),
        ({"orientation": (0, 0, 0, 0)}, ValueError, "orientation"),
        ({"orientation": (1, 0, 0)}, ValueError, r"orientation has shape \(3,\)"),
        ({"base": "fixed"}, ValueError, "base is 'fixed', but the model 'ball' was made with base='floating'"),
        ({"robot": "ANYMAL", "base": "flying"}, ValueError, "'floating' or 'fixed'"),
    ],
)
def test_failing_add_robot_leaves_the_world_as_it_was(ball: ss.Model, arguments: dict, error: type, says: str) -> None:
    world = ss.World()
    world.add_robot(ball)
    before = everything(world)
    arguments = {"robot": ball, **arguments}
    if arguments["robot"] == "ANYMAL":
        arguments["robot"] = ss.assets.path("anymal_b")
    with pytest.raises(error, match=says):
        world.add_robot(**arguments)
    assert everything(world) == before


def test_malformed_description_names_the_file(tmp_path) -> None:
    file = tmp_path / "broken.urdf"
    file.write_text("<robot name='broken'><link")
    world = ss.World()
    with pytest.raises(ValueError, match="broken.urdf"):
        world.add_robot(file)
    assert world.robots == []


def test_shapes_without_contact_are_named_once_in_a_warning() -> None:
    world = ss.World()
    with pytest.warns(UserWarning, match=r"take part in no contact.*statue/0 \(mesh\)"):
        world.add_robot(ss.parse_urdf(MESH))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(UserWarning):
            world.add_robot(ss.parse_urdf(MESH))
    assert len(world.robots) == 1


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"friction": -0.1}, "friction"),
        ({"friction": float("nan")}, "friction"),
        ({"restitution": 1.5}, "restitution"),
        ({"restitution": -0.5}, "restitution"),
        ({"restitution_threshold": -1.0}, "restitution_threshold"),
    ],
)
def test_bad_material_pairs_are_refused(values: dict, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        ss.World().set_material_pair("rubber", "ice", **values)


def test_friction_comes_from_the_pair_of_materials(ball: ss.Model) -> None:
    world = ss.World()
    world.set_material_pair("ice", "rubber", friction=0.05)
    world.add_ground(material="ice")
    world.add_robot(ball, position=(0, 0, 0.1), material="rubber")
    world.add_robot(ball, position=(1, 0, 0.1), material="felt")
    world.step(3)
    assert {c.robot: c.friction for c in world.contacts} == {world.robots[0].name: 0.05, world.robots[1].name: 0.8}


# State and control


def test_arrays_are_copies_that_refuse_element_assignment(flail: ss.Model) -> None:
    world = ss.World()
    robot = world.add_robot(flail, position=(0, 0, 1))
    q = robot.q
    world.step(10)
    assert q[2] == 1.0 and robot.q[2] < 1.0
    for values in (robot.q, robot.u, robot.generalized_force, robot.pd_target, *robot.pd_gains):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 1.0


def test_state_that_was_set_is_the_state(flail: ss.Model) -> None:
    robot = ss.World().add_robot(flail)
    q = np.array([1, 2, 3, 0.5, 0.5, 0.5, 0.5, 0.7])
    robot.set_state(q, np.arange(7.0))
    np.testing.assert_array_equal(robot.q, q)
    np.testing.assert_array_equal(robot.u, np.arange(7.0))


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda r: r.set_state(np.zeros(3), r.u), r"q has shape \(3,\); it must be \(8,\)"),
        (lambda r: r.set_state(r.q, np.zeros((7, 1))), r"u has shape \(7, 1\); it must be \(7,\)"),
        (lambda r: r.set_state(np.full(8, np.nan), r.u), r"q\[0\] is nan"),
        (lambda r: r.set_state(np.where(np.arange(8) < 7, 0.0, 0.3), r.u), "quaternion"),
        (lambda r: r.set_state(r.q, np.where(np.arange(7) == 4, np.inf, 1.0)), r"u\[4\] is inf"),
        (lambda r: setattr(r, "generalized_force", np.zeros(6)), "generalized_force has shape"),
        (lambda r: setattr(r, "generalized_force", np.full(7, np.nan)), r"generalized_force\[0\] is nan"),
        (lambda r: setattr(r, "generalized_force", 0.0), "generalized_force has shape"),
        (lambda r: setattr(r, "pd_target", [1, 2]), "pd_target has shape"),
        (lambda r: setattr(r, "pd_target", ["left"]), "pd_target: not an array of numbers"),
        (lambda r: r.set_pd_gains(-1.0, 0.0), "kp"),
        (lambda r: r.set_pd_gains(1.0, [-1.0]), "kd"),
        (lambda r: r.set_pd_gains([1.0, 2.0], 0.0), r"kp has shape \(2,\); it must be \(1,\)"),
        (lambda r: r.set_pd_gains(1.0, float("nan")), "kd"),
        (lambda r: r.forward_dynamics(np.zeros(3)), "tau has shape"),
        (lambda r: r.jacobian("toe"), "tip"),
        (lambda r: r.frame_pose("toe"), "toe"),
        (lambda r: r.delassus(["elbow"], [[0, 0, 0]]), "elbow"),
        (lambda r: r.delassus([7], [[0, 0, 0]]), "7 is not a body"),
        (lambda r: r.delassus([0], [0, 0, 0]), "points has shape"),
    ],
)
def test_bad_arguments_are_named_and_change_nothing(flail: ss.Model, call, says: str) -> None:
    world = ss.World()
    robot = world.add_robot(flail, position=(0, 0, 1))
    robot.set_state(robot.q, np.arange(7.0))
    robot.generalized_force = np.ones(7)
    robot.set_pd_gains(2.0, 1.0)
    robot.pd_target = [0.3]
    before = everything(world)
    with pytest.raises(ValueError, match=says):
        call(robot)
    assert everything(world) == before


def test_control_reaches_the_joint(flail: ss.Model) -> None:
    world = ss.World(gravity=(0, 0, 0))
    robot = world.add_robot(flail)
    robot.set_pd_gains(5.0, 1.0)
    robot.pd_target = [0.5]
    world.step(5000)
    assert robot.q[7] == pytest.approx(0.5, abs=1e-3)
    assert [gains.tolist() for gains in robot.pd_gains] == [[5.0], [1.0]]


def test_dynamics_quantities_fit_together(flail: ss.Model) -> None:
    robot = ss.World().add_robot(flail)
    robot.set_state([0, 0, 1, 0.5, 0.5, 0.5, 0.5, 0.7], np.arange(7.0))
    mass, bias, tau = robot.mass_matrix(), robot.bias_force(), np.arange(7.0)
    np.testing.assert_allclose(mass, mass.T, rtol=0, atol=1e-15)
    np.testing.assert_allclose(mass @ robot.forward_dynamics(tau) + bias, tau, rtol=0, atol=1e-10)
    np.testing.assert_allclose(robot.kinetic_energy, 0.5 * robot.u @ mass @ robot.u, rtol=1e-13)
    np.testing.assert_allclose(robot.potential_energy, robot.mass * 9.81 * robot.center_of_mass[2], rtol=1e-13)
    jacobian = robot.jacobian("tip")
    assert jacobian.shape == (6, 7)
    np.testing.assert_allclose(jacobian[:3, :3], np.eye(3), rtol=0, atol=1e-15)
    point = robot.frame_pose("tip").position
    expected = jacobian[:3] @ np.linalg.solve(mass, jacobian[:3].T)
    np.testing.assert_allclose(robot.delassus(["swipple"], [point]), expected, rtol=0, atol=1e-12)


# Running


def test_free_fall_is_the_sum_of_its_steps(ball: ss.Model) -> None:
    # Semi-implicit Euler: u_n = -g n dt, z_n = z_0 - g dt^2 n (n + 1) / 2.
    world = ss.World(integrator="semi_implicit")
    robot = world.add_robot(ball, position=(0, 0, 5))
    world.step(100)
    assert robot.u[2] == pytest.approx(-9.81 * 0.1, rel=1e-13)
    assert robot.q[2] == pytest.approx(5 - 9.81e-6 * 100 * 101 / 2, rel=1e-13)
    assert world.time == pytest.approx(0.1, rel=1e-12)


def test_contacts_and_solve_info_describe_the_last_step(ball: ss.Model) -> None:
    world, robot = resting_ball(ball)
    world.step(20)
    (contact,) = world.contacts
    assert (contact.robot, contact.body, contact.shape, contact.point) == ("ball", "ball", "ball/0", 0)
    assert contact.friction == 0.8
    np.testing.assert_allclose(contact.normal, [0, 0, 1])
    np.testing.assert_allclose(contact.impulse, [0, 0, robot.mass * 9.81 * 1e-3], rtol=0, atol=1e-6)
    np.testing.assert_allclose(contact.velocity, 0, atol=1e-6)
    np.testing.assert_allclose(contact.position[:2], robot.q[:2], atol=1e-6)
    assert abs(contact.gap) < 1e-4
    info = world.solve_info
    assert info == robot.solve_info
    assert (info.status, info.contacts, info.substeps) == (ss.StepStatus.OK, 1, 1)
    assert 0 <= info.residual < 1e-8


def test_next_contact_problem_is_the_one_that_is_solved(ball: ss.Model) -> None:
    world, robot = resting_ball(ball, integrator="semi_implicit")
    robot.set_state([0, 0, 0.0999, 1, 0, 0, 0], [0.2, 0, -0.1, 0, 0, 0])
    problem = robot.next_contact_problem()
    impulse = ss.solve(problem, tolerance=1e-12).impulse
    world.step()
    np.testing.assert_allclose(impulse[2], robot.contacts[0].impulse[2], rtol=1e-6)


def test_replay_of_a_saved_state_is_equal_to_the_bit() -> None:
    world = ss.World()
    world.add_ground()
    robot = world.add_robot(ss.assets.path("anymal_b"), position=(0, 0, 0.7))
    robot.set_pd_gains(60.0, 2.0)
    world.step(150)
    blob = world.save_state()

    def run() -> list[bytes]:
        states = []
        for _ in range(200):
            world.step()
            states.append(robot.q.tobytes() + robot.u.tobytes())
        return states

    first = run()
    world.load_state(blob)
    assert world.save_state() == blob
    assert run() == first
    assert world.contacts, "the replay never touched the ground, so it showed little"


@pytest.mark.parametrize("blob", [b"", b"nonsense", b"\0" * 4096])
def test_foreign_blobs_are_refused_and_change_nothing(flail: ss.Model, blob: bytes) -> None:
    world = ss.World()
    world.add_robot(flail)
    world.step(3)
    before = everything(world)
    with pytest.raises(ValueError):
        world.load_state(blob)
    with pytest.raises(ValueError):
        world.load_state(before[1][:-1])
    with pytest.raises(TypeError, match="blob is a str"):
        world.load_state("state")
    assert everything(world) == before


def test_state_of_other_robots_is_refused(ball: ss.Model, flail: ss.Model) -> None:
    one, two = ss.World(), ss.World()
    one.add_robot(ball)
    two.add_robot(flail)
    with pytest.raises(ValueError):
        one.load_state(two.save_state())


@pytest.mark.parametrize(
    ("steps", "error"), [(-1, ValueError), (2**31, ValueError), (1.5, TypeError), ("2", TypeError)]
)
def test_steps_are_counted_in_whole_numbers(ball: ss.Model, steps, error: type) -> None:
    world, _ = resting_ball(ball)
    with pytest.raises(error, match="steps"):
        world.step(steps)
    assert world.time == 0.0


def test_no_steps_change_nothing(ball: ss.Model) -> None:
    world, _ = resting_ball(ball)
    before = everything(world)
    assert world.step(0) == ss.StepStatus.OK
    assert everything(world) == before


def test_overflow_raises_and_keeps_the_last_finite_state(ball: ss.Model) -> None:
    world = ss.World()
    calm = world.add_robot(ball, position=(0, 0, 5))
    wild = world.add_robot(ball, position=(5, 0, 5))
    force = np.zeros(6)
    force[3:] = 1e308  # on an inertia of 0.01 kg m^2: beyond the largest number
    wild.generalized_force = force
    with pytest.raises(ss.StepError, match=wild.name) as caught:
        world.step(100)
    assert caught.value.robots == [wild.name]
    assert isinstance(caught.value, FloatingPointError)
    assert np.isfinite(wild.q).all() and np.isfinite(wild.u).all()
    assert np.isfinite(calm.q).all() and calm.u[2] < 0
    wild.generalized_force = np.zeros(6)
    wild.set_state([5, 0, 5, 1, 0, 0, 0], np.zeros(6))
    assert world.step(10) == ss.StepStatus.OK


def test_robot_keeps_its_world_alive(ball: ss.Model) -> None:
    robot = ss.World().add_robot(ball, position=(0, 0, 2))
    gc.collect()
    assert robot.q[2] == 2.0
    assert robot.model.name == "ball"


def test_profiling_counts_steps_only_while_it_is_on(ball: ss.Model) -> None:
    world, _ = resting_ball(ball)
    world.step(5)
    assert world.stage_times.steps == 0
    world.set_profiling(True)
    world.step(5)
    times = world.stage_times
    assert times.steps == 5 and times.solve >= 0 and times.dynamics > 0
    world.reset_stage_times()
    assert world.stage_times.steps == 0
