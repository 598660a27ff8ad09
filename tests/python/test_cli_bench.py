"""The command `stickslip bench`: what it measures, prints, writes and returns. No test looks at a speed."""

from __future__ import annotations

import json
import platform
from pathlib import Path

import numpy as np
import pytest

from conftest import FLAIL
from stickslip import bench, cli
from stickslip.bench import episodes, measuring, tables
from stickslip.bench.tasks import TICK

ENVS = 5


@pytest.fixture
def short(monkeypatch):
    """Episodes of 100 ms, so that phases spread, resets happen and nothing takes long."""
    make_anymal, make_urdf = bench.anymal_task, bench.urdf_task

    def cut(task: bench.Task) -> bench.Task:
        return measuring.dataclasses.replace(task, episode_steps=100)

    monkeypatch.setattr("stickslip.bench.command.anymal_task", lambda name: cut(make_anymal(name)))
    monkeypatch.setattr("stickslip.bench.command.urdf_task", lambda *given: cut(make_urdf(*given)))


@pytest.fixture
def urdf(tmp_path: Path) -> Path:
    path = tmp_path / "flail.urdf"
    path.write_text(FLAIL)
    return path


def run(*arguments: object) -> int:
    return cli.main(["bench", "--envs", str(ENVS), "--threads", "1", "--steps", "50", *map(str, arguments)])


# What it prints and writes


def test_table_has_the_engines_stages_and_residuals_of_every_task(short, capsys):
    assert run("--task", "stand", "drop", "--no-mujoco") == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    for words in ("us per", "robot-steps", "real time", "dynamics", "solve", "99.99 %", "converged", "finite"):
        assert words in printed.out
    rows = [line.split() for line in printed.out.splitlines()]
    for name in ("stand", "drop"):
        assert sum(row[:1] == [name] for row in rows) == 3  # in each of the tables
    speeds = [row for row in rows if row[1:3] == ["stickslip", "float32"]]
    assert [row[4:6] for row in speeds] == [["1", str(ENVS)]] * 2


def test_without_a_task_all_of_anymals_run(monkeypatch):
    ran = []
    monkeypatch.setattr("stickslip.bench.command._measure", lambda task, options: ran.append(task.name))
    monkeypatch.setattr("stickslip.bench.command._print", lambda *given: None)
    with pytest.raises(AttributeError):  # there are no results to go on with
        run()
    assert ran == list(bench.TASKS) == ["stand", "trot", "hang", "drop", "random"]


def test_json_holds_what_the_table_shows_with_all_digits(short, tmp_path, capsys):
    path = tmp_path / "speed.json"
    assert run("--task", "random", "--dtype", "float64", "--integrator", "semi_implicit", "--json", path) == 0
    data = json.loads(path.read_text())
    assert data["integrator"] == "semi_implicit" and data["time_step_s"] == 1e-3 and data["steps_per_round"] == 10
    assert {"processor", "cores", "compiler"} <= data["machine"].keys()
    (result,) = data["results"]
    assert [result[name] for name in ("task", "dofs", "dtype", "faults")] == ["random", 18, "float64", []]
    assert result["memory_bytes"] > 0 and result["width"] >= 1
    speed = result["speed"]
    assert (speed["engine"], speed["threads"], speed["envs"]) == ("stickslip", 1, ENVS)
    assert len(speed["us_per_round"]) == measuring.ROUNDS and min(speed["us_per_round"]) > 0
    assert speed["us_per_robot_step"] == np.median(speed["us_per_round"])
    assert speed["robot_steps_per_s"] * speed["us_per_robot_step"] == pytest.approx(1e6)
    assert speed["real_time_factor"] == pytest.approx(1e-3 * speed["robot_steps_per_s"])
    assert list(result["stages_us"]) == ["dynamics", "detection", "delassus", "solve", "integrate"]
    watched = result["watched"]
    assert watched["robot_steps"] == 50 * ENVS and watched["tolerance"] == 1e-8
    quantiles = list(watched["residual_quantiles"].values())
    assert list(watched["residual_quantiles"]) == ["0.5", "0.99", "0.9999", "1"] and quantiles == sorted(quantiles)
    assert f"{speed['us_per_robot_step']:.3f}" in capsys.readouterr().out


def test_markdown_has_the_cells_of_the_table(short, capsys):
    assert run("--task", "hang", "--no-mujoco", "--markdown") == 0
    lines = capsys.readouterr().out.splitlines()
    heads = [line for line in lines if line.startswith("| task")]
    assert len(heads) == 3
    for head in heads:
        rule, row = lines[lines.index(head) + 1 : lines.index(head) + 3]
        assert head.count("|") == rule.count("|") == row.count("|") and row.startswith("| hang |")


def test_mujoco_runs_on_one_thread_and_on_as_many_as_the_batch(short, tmp_path):
    mujoco = pytest.importorskip("mujoco")
    path = tmp_path / "speed.json"
    assert run("--task", "trot", "--threads", "2", "--json", path) == 0
    (result,) = json.loads(path.read_text())["results"]
    rivals = result["mujoco"]
    assert [r["threads"] for r in rivals] == [1, 2]
    for rival in rivals:
        assert rival["engine"] == f"MuJoCo {mujoco.__version__}" and rival["envs"] == ENVS
        ratios = np.array(rival["us_per_round"]) / result["speed"]["us_per_round"]
        assert rival["ratio"] == pytest.approx(np.median(ratios))


def test_without_mujoco_it_says_how_to_compare(short, monkeypatch, capsys):
    for module in ("measuring", "command"):
        monkeypatch.setattr(f"stickslip.bench.{module}.mujoco_is_installed", lambda: False)
    assert run("--task", "stand") == 0
    printed = capsys.readouterr()
    assert "pip install mujoco" in printed.err and "MuJoCo" not in printed.out


def test_any_urdf_runs_floating_or_fixed(short, urdf, tmp_path):
    for base, dofs in (("floating", 7), ("fixed", 1)):
        path = tmp_path / f"{base}.json"
        assert run("--task", urdf, "--base", base, "--no-mujoco", "--json", path) == 0
        (result,) = json.loads(path.read_text())["results"]
        assert (result["task"], result["dofs"]) == ("flail", dofs)
        assert (result["watched"]["contacts"] > 0) == (base == "floating")


# Bad input


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--task", "walk"), ["'walk'", "stand, trot, hang, drop, random", "URDF"]),
        (("--task", "missing.urdf"), ["missing.urdf", "no such file"]),
        (("--envs", "0"), ["envs is 0", "at least 1"]),
        (("--envs", "-3"), ["envs is -3"]),
        (("--threads", "-1"), ["threads is -1"]),
        (("--steps", "0"), ["steps is 0", "at least 1"]),
        (("--json", "nowhere/speed.json"), ["nowhere", "does not exist"]),
        (("--json", "."), ["is a folder"]),
    ],
)
def test_bad_input_is_named_and_nothing_runs(arguments, words, capsys, monkeypatch):
    monkeypatch.setattr("stickslip.bench.command._measure", lambda *given: pytest.fail("it ran"))
    assert run(*arguments) == 2
    message = capsys.readouterr().err
    assert message.startswith("stickslip bench: ") and all(word in message for word in words), message


@pytest.mark.parametrize("arguments", [("--dtype", "float16"), ("--integrator", "rk4"), ("--instruction-set", "sse2")])
def test_unknown_choices_are_refused_with_those_there_are(arguments, capsys):
    with pytest.raises(SystemExit) as caught:
        run(*arguments)
    assert caught.value.code == 2
    assert arguments[1] in capsys.readouterr().err


def test_a_broken_urdf_is_named(tmp_path, capsys):
    path = tmp_path / "torn.urdf"
    path.write_text("<robot name='torn'><link")
    assert run("--task", path) == 2
    assert "torn.urdf" in capsys.readouterr().err


def test_an_instruction_set_that_is_not_there_is_named(short, capsys):
    other = "avx2" if platform.machine() in ("aarch64", "arm64") else "neon"
    assert run("--task", "stand", "--instruction-set", other) == 2
    assert other in capsys.readouterr().err


def test_what_was_not_solved_and_not_flagged_fails_the_run(short, monkeypatch, capsys):
    monkeypatch.setitem(measuring.TOLERANCE, "float32", -1.0)  # so that nothing is solved
    assert run("--task", "stand", "--no-mujoco") == 1
    assert f"{50 * ENVS} robot-steps" in capsys.readouterr().err


# Episodes


@pytest.mark.parametrize("envs", [1, 5, 16, 64])
def test_after_one_episodes_length_all_phases_are_there_once(envs):
    task = bench.anymal_task("stand")
    clock = episodes.Clock(task, envs)
    for _ in range(task.episode_steps // TICK):
        clock.begin(np.flatnonzero(clock.over()))
        clock.age += TICK
    ages = np.sort(clock.age)
    gaps = np.diff(np.append(ages, ages[0] + task.episode_steps))
    assert abs(gaps - task.episode_steps / envs).max() <= TICK
    assert (clock.episode >= 0).all() and len(set(clock.episode)) == envs


def test_neighbors_are_in_phases_that_lie_far_apart():
    task = bench.anymal_task("stand")
    clock = episodes.Clock(task, 64)
    clock.begin(np.arange(64))
    for first in range(0, 64, 16):  # the lanes of a pack
        ends = np.sort(clock.end[first : first + 16])
        assert np.diff(ends).min() >= task.episode_steps / 64


def test_plan_holds_the_targets_of_each_environments_own_episode():
    task = bench.anymal_task("random")
    clock = episodes.Clock(task, 3)
    clock.begin(np.arange(3))
    clock.age[:] = [0, 40, 0]
    clock.end[:] = [20, 5000, 5000]
    targets = episodes.plan(clock, 50, np.dtype(np.float64)).targets
    assert targets.shape == (5, 3, 12)

    def of(episode: int, number: int) -> np.ndarray:
        return task.targets(np.array([episode]), np.array([number]))[0]

    for tick in range(5):
        np.testing.assert_array_equal(targets[tick, 0], of(0, tick) if tick < 2 else of(3, tick - 2))
        np.testing.assert_array_equal(targets[tick, 1], of(1, tick + 4))
        np.testing.assert_array_equal(targets[tick, 2], of(2, tick))


def test_an_environment_that_is_still_long_enough_begins_its_next_episode():
    clock = episodes.Clock(bench.anymal_task("drop"), 2)
    clock.begin(np.arange(2))
    u = np.zeros((2, 18))
    u[1, 3] = 0.06
    for _ in range(21):
        assert not clock.over().any()
        clock.look(u)
    assert clock.over().tolist() == [True, False]


def test_starts_of_a_floating_robot_are_two_centimeters_above_the_ground(urdf):
    task = bench.urdf_task(urdf)
    q, u = task.initial_states(np.arange(4))
    assert not u.any() and len(np.unique(q[:, 7])) == 4
    robot = task.world("energy_safe").robots[0]
    for row in q:
        robot.set_state(row, np.zeros(7))
        tip = robot.frame_pose("tip").position[2] - 0.05  # the sphere's center is the frame tip
        box = robot.frame_pose("handle").position[2] - 0.05
        assert min(tip, box) == pytest.approx(0.02)


# MuJoCo's model


@pytest.mark.parametrize("name", ["stand", "hang", "flail"])
def test_mujoco_gets_the_same_robot(name, urdf):
    mujoco = pytest.importorskip("mujoco")
    from stickslip.bench import mujoco_batch

    task = bench.urdf_task(urdf) if name == "flail" else bench.anymal_task(name)
    m = mujoco_batch.compile_task(task)
    data = mujoco.MjData(m)
    robot = task.world("energy_safe").robots[0]
    rng = np.random.default_rng(0)
    for _ in range(5):
        q, u = rng.standard_normal(robot.nq), 3 * rng.standard_normal(robot.nu)
        q[3:7] /= np.linalg.norm(q[3:7])
        robot.set_state(q, u)
        data.qpos[:] = q
        data.qvel[:] = mujoco_batch.to_mujoco(task, q[None], u[None])[0]
        m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_ACTUATION
        mujoco.mj_forward(m, data)
        turn = np.eye(robot.nu)  # MuJoCo's velocities to ours
        turn[3:6, 3:6] = np.reshape(data.xmat[1], (3, 3))
        columns = np.zeros((m.nv, m.nv))
        for column, unit in zip(columns, np.eye(m.nv), strict=True):
            mujoco.mj_mulM(m, data, column, unit)
        np.testing.assert_allclose(turn @ columns.T @ turn.T, robot.mass_matrix(), atol=1e-9)
        np.testing.assert_allclose(turn @ data.qfrc_bias, robot.bias_force(), atol=1e-8)


def test_tables_say_the_same_in_both_forms():
    cells = tables.Cells(1, ("task", "us per\nstep"), [("a|b", "1.0")])
    assert tables.markdown(cells) == "| task | us per step |\n| --- | ---: |\n| a\\|b | 1.0 |"
    assert tables.rich_table(cells, "").row_count == 1
