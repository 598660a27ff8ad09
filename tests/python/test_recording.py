"""Worlds that write the contact problems they meet."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip import fclib


def dropped_anymal(**options) -> tuple[ss.World, ss.Robot]:
    """Falls for 60 steps of 1 ms, then has its feet on the ground."""
    world = ss.World(**options)
    world.add_ground()
    robot = world.add_robot(ss.assets.path("anymal_b"), position=(0, 0, 0.6))
    robot.set_pd_gains(60.0, 2.0)
    return world, robot


def two_balls(ball: ss.Model) -> ss.World:
    world = ss.World()
    world.add_ground()
    world.add_robot(ball, position=(0, 0, 0.1), name="left")
    world.add_robot(ball, position=(1, 0, 0.1), name="a/b c")
    return world


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_recorded_problem_solves_to_the_recorded_velocity(tmp_path: Path) -> None:
    world, robot = dropped_anymal()
    world.step(120)
    world.record_contact_problems(tmp_path)
    world.step(5)
    files = sorted(tmp_path.iterdir())
    assert len(files) == 5
    for path in files:
        recorded = fclib.read(path)
        problem = fclib.load(path)
        solution = ss.solve(problem, tolerance=1e-12)
        assert solution.converged and problem.num_contacts == 4
        np.testing.assert_allclose(solution.velocity, recorded.solution.u, rtol=0, atol=1e-9)
        np.testing.assert_allclose(ss.residual(problem, recorded.solution.r), 0, atol=1e-8)
    last = recorded.solution
    np.testing.assert_array_equal(last.r, np.concatenate([contact.impulse for contact in robot.contacts]))
    assert last.r[2::3].sum() == pytest.approx(robot.mass * 9.81 * 1e-3, rel=0.5), "the feet carry the robot"


def test_the_texts_say_what_was_recorded(tmp_path: Path) -> None:
    world, robot = dropped_anymal(time_step=2e-3, law="max_dissipation", integrator="semi_implicit")
    world.record_contact_problems(tmp_path)
    while not world.contacts:
        world.step()
    step = round(world.time / 2e-3) - 1
    assert names(tmp_path) == ["problem000000_robot0_anymal_b.hdf5"]
    recorded = fclib.read(tmp_path / names(tmp_path)[0])
    assert recorded.title.startswith(f"anymal_b, step {step}, t = 0.")
    for text in (
        f"stickslip {ss.__version__}",
        "integrator semi_implicit",
        "robot 0, anymal_b",
        "time step 0.002",
        "law max_dissipation",
        "method auto",
        f"residual {robot.solve_info.residual:.3g} m/s",
        ": converged",
    ):
        assert text in recorded.description
    assert float(recorded.description.split("from t = ")[1].split(" s")[0]) == pytest.approx(step * 2e-3)


@pytest.mark.parametrize("integrator", ["energy_safe", "semi_implicit"])
def test_recording_changes_no_bit_of_the_simulation(tmp_path: Path, integrator: str) -> None:
    plain, _ = dropped_anymal(integrator=integrator)
    recorded, _ = dropped_anymal(integrator=integrator)
    recorded.record_contact_problems(tmp_path, every=3)
    for _ in range(10):
        assert plain.step(20) == recorded.step(20)
        assert plain.save_state() == recorded.save_state()
        assert plain.solve_info == recorded.solve_info
        assert str(plain.contacts) == str(recorded.contacts)
    assert len(names(tmp_path)) > 30, "it hardly recorded, so it showed little"


def test_every_counts_the_steps_that_have_contacts(tmp_path: Path) -> None:
    world, robot = dropped_anymal()
    world.record_contact_problems(tmp_path / "deep" / "er", every=5)
    world.step(50)
    assert names(tmp_path / "deep" / "er") == [], "no contact, no file"
    first = None
    for _ in range(40):
        world.step()
        if first is None and robot.contacts:
            first = round(world.time * 1e3) - 1
    files = names(tmp_path / "deep" / "er")
    titles = [fclib.read(tmp_path / "deep" / "er" / name).title for name in files]
    assert [int(title.split("step ")[1].split(",")[0]) for title in titles] == list(range(first, 90, 5))
    assert files == [f"problem{k:06d}_robot0_anymal_b.hdf5" for k in range(len(files))]


def test_steps_taken_at_once_are_recorded_one_by_one(tmp_path: Path) -> None:
    worlds = [dropped_anymal()[0] for _ in range(2)]
    for world, folder in zip(worlds, ("once", "single"), strict=True):
        world.record_contact_problems(tmp_path / folder)
    worlds[0].step(80)
    for _ in range(80):
        worlds[1].step()
    assert names(tmp_path / "once") == names(tmp_path / "single") != []
    for name in names(tmp_path / "once"):
        assert (tmp_path / "once" / name).read_bytes() == (tmp_path / "single" / name).read_bytes()


def test_none_stops_recording(tmp_path: Path, ball: ss.Model) -> None:
    world = two_balls(ball)
    world.record_contact_problems(tmp_path)
    world.step(2)
    assert len(names(tmp_path)) == 4
    world.record_contact_problems(None)
    world.step(2)
    assert len(names(tmp_path)) == 4


def test_each_robot_gets_a_file_whatever_its_name(tmp_path: Path, ball: ss.Model) -> None:
    world = two_balls(ball)
    world.record_contact_problems(tmp_path)
    world.step()
    assert names(tmp_path) == ["problem000000_robot0_left.hdf5", "problem000000_robot1_a_b_c.hdf5"]
    assert fclib.read(tmp_path / "problem000000_robot1_a_b_c.hdf5").title == "a/b c, step 0, t = 0 s"


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    "pattern", ["", "{number}.hdf5", "[a]/{robot}/{number:3d}.hdf5", "{time:.3f}/{number:02d}_{step}.hdf5"]
)
def test_recording_the_same_steps_again_replaces_no_file(tmp_path: Path, pattern: str) -> None:
    world, _ = dropped_anymal()
    world.step(100)
    state = world.save_state()
    before: dict[Path, bytes] = {}
    for again in range(3):
        world.load_state(state)
        if again < 2:  # the last time it is the same recording that goes on
            world.record_contact_problems(tmp_path / pattern)
        world.step(6)
        after = contents(tmp_path)
        assert len(after) == len(before) + 6
        assert {path: after[path] for path in before} == before
        before = after


def test_numbers_go_on_after_the_largest_that_is_there(tmp_path: Path, ball: ss.Model) -> None:
    for name in ("problem000007_robot3_x.hdf5", "problem1_robot0_left.hdf5", "problem000099_robot0.hdf5", "notes9.txt"):
        (tmp_path / name).write_text("")
    world = two_balls(ball)
    world.record_contact_problems(tmp_path)
    world.step()
    (tmp_path / "problem000009_robot1_a_b_c.hdf5").write_text("of somebody else")
    world.step()
    numbers = [name[:13] for name in names(tmp_path) if name.endswith("left.hdf5") and name > "problem000001"]
    assert numbers == ["problem000008", "problem000010", "problem1_robo"]
    assert (tmp_path / "problem000009_robot1_a_b_c.hdf5").read_text() == "of somebody else"


@pytest.mark.parametrize("integrator", ["energy_safe", "semi_implicit"])
def test_the_recorded_problem_is_the_one_that_moved_the_robot(tmp_path: Path, integrator: str) -> None:
    world, robot = dropped_anymal(integrator=integrator, time_step=4e-3)
    world.record_contact_problems(tmp_path)
    substeps = []
    for _ in range(30):
        expected = robot.next_contact_problem()
        world.step()
        if not robot.contacts:
            continue
        recorded = fclib.load(tmp_path / f"problem{len(substeps):06d}_robot0_anymal_b.hdf5")
        np.testing.assert_array_equal(recorded.dense_delassus(), expected.delassus)
        np.testing.assert_array_equal(recorded.free_velocity, expected.free_velocity)
        np.testing.assert_array_equal(recorded.friction, expected.friction)
        substeps.append(robot.solve_info.substeps)
        if len(substeps) == 5:
            robot.set_state(
                robot.q, np.concatenate([robot.u[:3], [0, 0, 100], robot.u[6:]])
            )  # too fast for one substep
    assert len(substeps) >= 6 and (max(substeps) > 1) == (integrator == "energy_safe")


def test_a_recorded_step_is_computed_once(tmp_path: Path, ball: ss.Model) -> None:
    calls = []

    class Core:
        def __getattr__(self, name: str) -> object:
            calls.append(name)
            return getattr(core, name)

    world = two_balls(ball)
    world.record_contact_problems(tmp_path)
    core, world._core = world._core, Core()
    world.step()
    assert len(names(tmp_path)) == 2
    assert calls.count("step") == 1 and "next_contact_problem" not in calls


def test_a_pattern_names_files_and_folders(tmp_path: Path, ball: ss.Model) -> None:
    world = two_balls(ball)
    world.record_contact_problems(tmp_path / "{robot}" / "{number:03d}_{step}_{time:.4f}.h5", every=2)
    world.step(3)
    assert names(tmp_path) == ["a_b_c", "left"]
    assert names(tmp_path / "left") == ["000_0_0.0000.h5", "001_2_0.0020.h5"]


def test_a_pattern_that_does_not_tell_robots_apart_is_refused(tmp_path: Path, ball: ss.Model) -> None:
    world = two_balls(ball)
    world.record_contact_problems(tmp_path / "{number}.hdf5")
    with pytest.raises(ValueError, match=r"0.hdf5: is the file of left and of a/b c .* put \{robot\} or \{index\}"):
        world.step()


@pytest.mark.parametrize(
    ("pattern", "says"),
    [
        ("{robot}_{step}.hdf5", r"files of different steps would have the same name; put \{number\} into it"),
        (
            "{number}_{shape}.hdf5",
            r"unknown field 'shape'.*\{number\}, \{step\}, \{index\}, \{robot\}, \{time\}, as in",
        ),
        ("{number", "path is .*pattern has the fields"),
        ("number}", "path is .*pattern has the fields"),
        ("{number:08q}", "path is .*pattern has the fields"),
        ("{number:.1e}", r"\{number:.1e\} is not a width, as in \{number:06d\}"),
        ("{number:06d}_{number:x}", r"\{number:x\} is not a width"),
        ("{}", "path is .*pattern has the fields"),
        ("{step.nothing}", "path is .*pattern has the fields"),
    ],
)
def test_bad_patterns_are_refused_at_once(tmp_path: Path, pattern: str, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        ss.World().record_contact_problems(tmp_path / pattern)


@pytest.mark.parametrize(
    ("every", "error", "says"),
    [
        (0, ValueError, "every is 0; it must be at least 1"),
        (-1, ValueError, "every is -1"),
        (1.5, TypeError, "every is 1.5; an integer is wanted"),
    ],
)
def test_every_must_be_a_positive_number_of_steps(tmp_path: Path, every, error: type, says: str) -> None:
    with pytest.raises(error, match=says):
        ss.World().record_contact_problems(tmp_path, every=every)
    assert names(tmp_path) == []


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(NotADirectoryError, match="file: is a file; give a folder"):
        ss.World().record_contact_problems(tmp_path / "file")
    with pytest.raises(TypeError, match="path is a int"):
        ss.World().record_contact_problems(7)


def test_a_bad_call_leaves_the_recording_as_it_was(tmp_path: Path, ball: ss.Model) -> None:
    world = two_balls(ball)
    world.record_contact_problems(tmp_path)
    with pytest.raises(ValueError):
        world.record_contact_problems(tmp_path / "other", every=0)
    world.step()
    assert len(names(tmp_path)) == 2


def test_an_overflow_is_reported_as_without_recording(tmp_path: Path, ball: ss.Model) -> None:
    messages = []
    for record in (False, True):
        world = two_balls(ball)
        if record:
            world.record_contact_problems(tmp_path)
        world.step()
        world.robots[0].generalized_force = [0, 0, 0, 1e308, 1e308, 1e308]
        with pytest.raises(ss.StepError, match="left") as error:
            world.step(10)
        messages.append((str(error.value), world.time))
    assert messages[0] == messages[1]
