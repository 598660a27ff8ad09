"""The command `stickslip solve`: what it prints, writes and returns, and what it says about bad input."""

from __future__ import annotations

import csv
import io
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import stickslip as ss
from stickslip import cli, compare_solvers, fclib, problems
from stickslip.compare_solvers import Record, performance_profile
from stickslip.contact import SOLVE_METHODS

STACK = problems.box_stack(1, mass_ratio=1e6)  # the sweeps stall on it
QUADRUPED = problems.quadruped_impact(0)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two problems in two files, and a file that is none."""
    inside = tmp_path / "run"
    inside.mkdir()
    fclib.save(inside / "stack.hdf5", STACK)
    fclib.save(inside / "quadruped.hdf5", QUADRUPED)
    (inside / "notes.txt").write_text("not a problem")
    return inside


def solve(*arguments: object) -> int:
    return cli.main(["solve", *map(str, arguments)])


def rows(text: str) -> list[list[str]]:
    """Cells of the rows below the first rule, those of the summary left out."""
    table = text.split("─\n", 1)[1].split("residual <=")[0]
    return [re.split(r"\s{2,}|(?<=\d) (?=\d)", line.strip()) for line in table.splitlines() if line.strip()]


def record(problem: str, method: str, time: float, solved: bool = True, relative_residual: float = 1e-9) -> Record:
    return Record(
        problem=problem,
        contacts=1,
        rank=3,
        method=method,
        law="coulomb",
        stage="sweeps",
        iterations=1,
        time=time,
        residual=relative_residual,
        relative_residual=relative_residual,
        backward_error=0.0,
        tolerance=1e-8,
        status="converged" if solved else "iteration_limit",
    )


# What it prints


def test_table_has_a_row_of_numbers_and_says_what_solved_the_problem(folder, capsys):
    assert solve(folder / "stack.hdf5") == 0
    printed = capsys.readouterr()
    s = ss.solve(STACK, tolerance=0, relative_tolerance=1e-8)
    speed = abs(STACK.free_velocity).max()
    ((file, contacts, rank, method, stage, iterations, _, residual, relative, error, status),) = rows(printed.out)
    assert [file, method, stage, status] == ["stack.hdf5", "auto", s.stage, "converged"]
    assert [int(contacts), int(rank), int(iterations)] == [16, 24, s.iterations]
    assert residual == f"{s.residual:.1e}" and relative == f"{s.residual / speed:.1e}"
    assert error == f"{s.certificate.backward_error:.1e}"
    assert printed.err == ""


def test_units_are_in_the_head_of_the_table(folder, capsys):
    solve(folder / "stack.hdf5")
    head = capsys.readouterr().out.split("─", 1)[0]
    assert "[ms]" in head and head.count("[m/s]") == 2 and "max|c|" in head


def test_all_methods_are_run_and_a_failure_is_told_by_the_exit_status(folder, capsys):
    assert solve(folder / "stack.hdf5", "--method", "all") == 1
    printed = rows(capsys.readouterr().out)
    assert printed[0][:4] == ["stack.hdf5", "16", "24", "auto"]
    assert [printed[0][3], *(row[0] for row in printed[1:])] == list(SOLVE_METHODS)  # the file is named once
    assert printed[0][-1] == "converged"
    assert printed[SOLVE_METHODS.index("per_contact")][-1] == "iteration_limit"


def test_a_folder_is_its_hdf5_files_and_several_files_have_a_summary(folder, capsys):
    assert solve(folder, "--method", "auto,per_contact") == 1
    out = capsys.readouterr().out
    assert out.index("quadruped.hdf5") < out.index("stack.hdf5") and "notes" not in out
    auto, per_contact = out.split("residual <=")[-1].splitlines()[-2:]
    assert re.search(r"auto +2 +2 \(100.0 %\) +2 \(100.0 %\) +2 \(100.0 %\) +\d", auto)
    assert re.search(r"per_contact +2 +1 \(50.0 %\) +1 \(50.0 %\) +1 \(50.0 %\) +\d", per_contact)


def test_one_file_has_no_summary(folder, capsys):
    solve(folder / "stack.hdf5", "--method", "all")
    assert "residual <=" not in capsys.readouterr().out


def test_patterns_are_spread_and_a_file_named_twice_is_solved_once(folder, capsys):
    assert solve(folder / "qu*.hdf5", folder / "quadruped.hdf5", folder.parent / "**" / "[q]*.hdf5") == 0
    assert capsys.readouterr().out.count("quadruped.hdf5") == 1


def test_generated_problems_need_no_file(capsys):
    assert solve("--family", "box_stack,mass_ratio=1e4,heavy=top,push=(1,0)", "--count", 2, "--seed", 3) == 0
    out = capsys.readouterr().out
    stack = problems.box_stack(4, mass_ratio=1e4, heavy="top", push=(1, 0))
    expected = ss.solve(stack, tolerance=0, relative_tolerance=1e-8)
    first, second = rows(out)
    assert first[0] == "box_stack,mass_ratio=1e4,heavy=top,push=(1,0) #3"
    assert second[1] == str(stack.num_contacts) and second[-4] == f"{expected.residual:.1e}"


def test_options_reach_the_solver(folder, capsys):
    assert solve(folder / "stack.hdf5", "--method", "per_contact", "--max-sweeps", 7) == 1
    assert rows(capsys.readouterr().out)[0][5] == "7"
    assert solve(folder / "stack.hdf5", "--method", "admm", "--max-iterations", 11) == 1
    assert rows(capsys.readouterr().out)[0][5] == "11"
    assert solve(folder / "stack.hdf5", "--method", "per_contact", "--tolerance", 1, "--relative-tolerance", 0) == 0
    capsys.readouterr()


def test_minimum_norm_reaches_the_solver(monkeypatch, capsys):
    given = []
    monkeypatch.setattr(
        "stickslip.compare_solvers.running.solve", lambda p, **options: given.append(options) or ss.solve(p, **options)
    )
    solve("--family", "quadruped_standing", "--count", 1, "--minimum-norm")
    assert given and all(options["minimum_norm"] is True for options in given)


def test_all_methods_under_maximum_dissipation_are_those_that_know_it(folder, capsys):
    solve(folder / "quadruped.hdf5", "--method", "all", "--law", "max_dissipation")
    printed = rows(capsys.readouterr().out)
    assert [printed[0][3], printed[1][0]] == ["auto", "per_contact"] and len(printed) == 2


def test_file_names_are_printed_as_they_are(tmp_path, capsys):
    fclib.save(tmp_path / "[red]a[0]$.hdf5", QUADRUPED)
    assert solve(tmp_path / "[red]a[0]$.hdf5", "--plot", tmp_path / "a.png") == 0
    assert rows(capsys.readouterr().out)[0][0] == "[red]a[0]$.hdf5"


def test_file_names_that_are_no_text_are_printed_all_the_same(tmp_path, capsys):
    fclib.save(tmp_path / "a.hdf5", QUADRUPED)
    (tmp_path / "a.hdf5").rename(tmp_path / "\udcff\n.hdf5")
    assert solve(tmp_path, "--csv", tmp_path / "a.csv") == 0
    assert "\\xff\\n.hdf5" in capsys.readouterr().out


def test_file_names_are_printed_where_only_ascii_can_be(tmp_path, monkeypatch):
    fclib.save(tmp_path / "Kiste-ä.hdf5", QUADRUPED)
    bytes_out = io.BytesIO()
    monkeypatch.setattr("sys.stdout", io.TextIOWrapper(bytes_out, encoding="ascii", write_through=True))
    assert solve(tmp_path) == 0
    assert b"Kiste-\\xe4.hdf5" in bytes_out.getvalue()


def test_a_narrow_terminal_folds_names_and_keeps_every_digit(folder, monkeypatch, capsys):
    solve(folder / "stack.hdf5")
    wide = capsys.readouterr().out
    for name, value in (("FORCE_COLOR", "1"), ("NO_COLOR", "1"), ("COLUMNS", "60"), ("TERM", "dumb")):
        monkeypatch.setenv(name, value)
    (folder / "stack.hdf5").rename(folder / f"{'stack' * 20}.hdf5")
    solve(folder / f"{'stack' * 20}.hdf5")
    narrow = capsys.readouterr().out
    assert "…" not in narrow and max(map(len, narrow.splitlines())) < 130
    residual = rows(wide)[0][7]
    assert residual in narrow and "converged" in narrow


def test_a_reader_that_stops_reading_is_no_error(folder, tmp_path):
    read, write = os.pipe()
    os.close(read)
    arguments = [sys.executable, "-m", "stickslip.cli", "solve", folder, "--csv", tmp_path / "a.csv"]
    result = subprocess.run(arguments, stdout=write, stderr=subprocess.PIPE, text=True)
    os.close(write)
    assert (result.returncode, result.stderr) == (0, "")
    assert len((tmp_path / "a.csv").read_text().splitlines()) == 3


# What it writes


def test_csv_holds_what_solve_reaches(folder, tmp_path, capsys):
    solve(folder, "--method", "auto", "interior_point", "--csv", tmp_path / "table.csv")
    with open(tmp_path / "table.csv", newline="", encoding="utf-8") as file:
        table = list(csv.DictReader(file))
    assert [(Path(row["file"]).name, row["method"]) for row in table] == [
        (name, method) for name in ("quadruped.hdf5", "stack.hdf5") for method in ("auto", "interior_point")
    ]
    for row in table:
        problem = fclib.load(row["file"])
        s = ss.solve(problem, method=row["method"], tolerance=0, relative_tolerance=1e-8)
        speed = abs(problem.free_velocity).max()
        assert float(row["residual"]) == s.residual and float(row["backward_error"]) == s.certificate.backward_error
        assert float(row["relative_residual"]) == s.residual / speed and float(row["tolerance"]) == 1e-8 * speed
        assert (row["status"], row["stage"], int(row["iterations"])) == (s.status, s.stage, s.iterations)
        assert int(row["contacts"]) == problem.num_contacts and row["law"] == "coulomb"
        assert int(row["rank"]) == np.linalg.matrix_rank(problem.dense_delassus(), hermitian=True)
        assert 0 < float(row["time_ms"]) < 1e4


@pytest.mark.parametrize("count", [1, 3, 6, 7])
def test_plot_is_a_picture(count, tmp_path, capsys):
    picture = tmp_path / "a.png"
    solve("--family", "box_stack", "--count", count, "--method", "all", "--plot", picture)
    with Image.open(picture) as image:
        assert image.format == "PNG" and image.width > 800 and image.height > 400
        assert len(image.convert("RGB").getcolors(1 << 20)) > 50
    assert 10_000 < picture.stat().st_size < 500_000


@pytest.mark.parametrize(("count", "drawn"), [(6, "draw_histories"), (7, "draw_profile")])
def test_more_than_six_problems_make_a_profile(count, drawn, tmp_path, monkeypatch, capsys):
    from stickslip.compare_solvers import command

    called = []
    for name in ("draw_histories", "draw_profile"):
        monkeypatch.setattr(command, name, lambda records, path, name=name: called.append((name, len(records))))
    solve("--family", "quadruped_standing", "--count", count, "--plot", tmp_path / "a.png")
    assert called == [(drawn, count)]


def test_problems_without_anything_to_solve_can_be_drawn(tmp_path, capsys):
    fclib.save(tmp_path / "still.hdf5", ss.ContactProblem(np.eye(3), np.zeros(3), [0.5]))
    assert solve(tmp_path, "--method", "all", "--plot", tmp_path / "a.png") == 0
    assert (tmp_path / "a.png").stat().st_size > 10_000


# What docs/solve.md says


def test_the_page_runs_and_names_every_option(tmp_path, monkeypatch, capsys):
    page = (Path(__file__).resolve().parents[2] / "docs" / "solve.md").read_text(encoding="utf-8")
    comparison, one_problem = re.findall(r"```python\n(.*?)```", page, flags=re.S)
    monkeypatch.chdir(tmp_path)
    exec(compile(comparison, "docs/solve.md", "exec"), {})
    assert capsys.readouterr().out.splitlines()[-2] == "auto 20 of 20"
    assert {path.name for path in tmp_path.iterdir()} == {"stacks.csv", "profile.png", "curves.png"}
    QUADRUPED.save("landing.hdf5")
    exec(compile(one_problem, "docs/solve.md", "exec"), {})
    assert capsys.readouterr().out.startswith("converged ")
    with pytest.raises(SystemExit):
        cli.main(["solve", "--help"])
    options = set(re.findall(r"--[a-z][a-z-]+", capsys.readouterr().out)) - {"--help"}
    assert options == set(re.findall(r"(?<!\w)--[a-z][a-z-]+", page))
    assert all(f"`{method}`" in page for method in SOLVE_METHODS)


# Bad input


def refused(capsys, *arguments: object) -> str:
    """The one line that bad input gets; nothing is solved."""
    assert solve(*arguments) == 2
    printed = capsys.readouterr()
    assert printed.out == "" and printed.err.count("\n") == 1 and printed.err.startswith("stickslip solve: ")
    return printed.err.removeprefix("stickslip solve: ").rstrip()


def test_nothing_to_solve_is_refused(capsys):
    assert "--family NAME" in refused(capsys)


@pytest.mark.parametrize(
    ("argument", "reason"),
    [
        ("missing.hdf5", "there is no such file"),
        ("*.none", "no file matches this pattern"),
        ("empty", "no *.hdf5 file"),
        ("run/notes.txt", "not an HDF5 file"),
    ],
)
def test_a_file_that_cannot_be_read_is_named_with_the_reason(argument, reason, folder, capsys):
    (folder.parent / "empty").mkdir()
    path = str(folder.parent / argument)
    said = refused(capsys, path)
    assert said.startswith(path) and reason in said


def test_unreadable_files_do_not_stop_the_others(folder, tmp_path, capsys):
    (folder / "broken.hdf5").write_bytes((folder / "stack.hdf5").read_bytes()[:900])
    missing = tmp_path / "missing.hdf5"
    assert solve(missing, folder, "--csv", tmp_path / "a.csv", "--plot", tmp_path / "a.png") == 2
    printed = capsys.readouterr()
    assert [row[0] for row in rows(printed.out)] == ["quadruped.hdf5", "stack.hdf5"]
    first, second = printed.err.splitlines()
    assert first.startswith(f"stickslip solve: {missing}: there is no such file")
    assert second.startswith(f"stickslip solve: {folder / 'broken.hdf5'}: ")
    assert len((tmp_path / "a.csv").read_text().splitlines()) == 3 and (tmp_path / "a.png").exists()


def test_an_oddity_of_a_file_is_told_and_is_no_failure(tmp_path, capsys):
    W = np.eye(3)
    W[0, 1] = 1e-7
    fclib.write(tmp_path / "a.hdf5", fclib.LocalProblem(W, np.array([0.0, 0.0, -1.0]), np.array([0.5])))
    assert solve(tmp_path / "a.hdf5") == 0
    printed = capsys.readouterr()
    assert "not symmetric" in printed.err and printed.err.count("\n") == 1
    assert rows(printed.out)[0][-1] == "converged"


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--method", "newton"], "--method 'newton': choose among auto, per_contact"),
        (["--method", "auto", "a.hdf5"], "files come before --method"),
        (["--law", "max_dissipation", "--method", "admm"], "use per_contact or auto for max_dissipation"),
        (["--tolerance", "-1"], "tolerance is -1"),
        (["--tolerance", "nan"], "tolerance is nan; it must be finite"),
        (["--relative-tolerance", "0"], "one of them must be positive"),
        (["--max-sweeps", "0"], "max_sweeps is 0"),
        (["--max-iterations", "-3"], "max_iterations is -3"),
        (["--family", "box_pile"], "'box_pile': family is 'box_pile'; choose one of 'quadruped_standing'"),
        (["--family", "box_stack,mass=3"], "mass is no option of box_stack; its options are num_boxes"),
        (["--family", "box_stack,mass_ratio"], "'mass_ratio' is no option"),
        (["--family", "box_stack,seed=3"], "'seed=3' is no option"),
        (["--family", "box_stack,mass_ratio=0.5"], "mass_ratio is 0.5"),
        (["--family", "box_stack,mass_ratio=much"], "mass_ratio is 'much'; a number is wanted"),
        (["--family", "box_stack", "--count", "0"], "count is 0; it must be at least 1"),
        (["--family", "box_stack", "--seed", "-1"], "seed is -1"),
        (["--plot", "no/such/folder/a.png"], "the folder no/such/folder does not exist"),
        (["--plot", "."], "--plot .: is a folder"),
        (["--plot", "a.jpeg"], "must end in one of .png"),
        (["--csv", "no/such/folder/a.csv"], "--csv no/such/folder/a.csv"),
    ],
)
def test_bad_arguments_are_named_before_anything_is_solved(arguments, reason, folder, capsys):
    assert reason in refused(capsys, folder, *arguments)


@pytest.mark.parametrize("arguments", [["--law", "newton"], ["--tolerance", "small"], ["--count", "1.5"]])
def test_words_that_are_no_values_are_refused_by_the_parser(arguments, capsys):
    with pytest.raises(SystemExit) as caught:
        solve("a.hdf5", *arguments)
    assert caught.value.code == 2 and arguments[1] in capsys.readouterr().err


def test_a_file_that_cannot_be_written_is_told_after_the_table(folder, tmp_path, monkeypatch, capsys):
    def full(records, path):
        raise OSError(28, "No space left on device", str(path))

    monkeypatch.setattr("stickslip.compare_solvers.command.write_csv", full)
    assert solve(folder, "--csv", tmp_path / "a.csv") == 2
    printed = capsys.readouterr()
    assert len(rows(printed.out)) == 2 and "No space left on device" in printed.err


# From Python


def test_run_names_problems_and_keeps_their_order():
    both = {"stack": STACK, "quadruped": QUADRUPED}
    by_name = compare_solvers.run(both, ["auto", "per_contact"])
    assert [(r.problem, r.method) for r in by_name] == [(p, m) for p in both for m in ("auto", "per_contact")]
    assert [r.solved for r in by_name] == [True, False, True, True]
    assert [r.problem for r in compare_solvers.run(iter(both.values()))] == ["0", "1"]


def test_histories_lead_to_the_residual_of_the_record():
    for r in compare_solvers.run([STACK, QUADRUPED], SOLVE_METHODS, history=True):
        best = min(r.history.residual)
        # A solved impulse may have been settled on its cones since, within the tolerance.
        assert best <= r.tolerance and r.residual <= r.tolerance if r.solved else best <= r.residual * (1 + 1e-9)
        assert (np.diff(r.history.time) >= 0).all()
    assert compare_solvers.run([STACK])[0].history is None


def test_run_refuses_what_it_cannot_tell_apart_or_solve():
    with pytest.raises(ValueError, match="the name 'a' twice"):
        compare_solvers.run([("a", STACK), ("a", STACK)])
    with pytest.raises(ValueError, match="'auto' twice"):
        compare_solvers.run([STACK], ["auto", "auto"])
    with pytest.raises(ValueError, match="methods is empty"):
        compare_solvers.run([STACK], [])
    with pytest.raises(ValueError, match="max_sweeps is 0"):
        compare_solvers.run(iter(()), max_sweeps=0)
    with pytest.raises(TypeError, match=r"problems\[1\] is a int"):
        compare_solvers.run([STACK, 3])
    with pytest.raises(TypeError, match="put it into a list"):
        compare_solvers.run(STACK)
    with pytest.raises(ValueError, match="history=True"):
        compare_solvers.draw_histories([record("a", "auto", 1.0)], "a.png")


def test_rank_counts_the_motions_that_contacts_can_tell_apart():
    assert compare_solvers.numerical_rank(STACK) == 24  # four boxes of six degrees of freedom
    assert compare_solvers.numerical_rank(ss.ContactProblem(np.zeros((3, 3)), np.zeros(3), [0.5])) == 0
    n = compare_solvers.running.LARGEST_RANKED // 3 + 1
    from scipy import sparse

    large = ss.ContactProblem(sparse.eye_array(3 * n), np.zeros(3 * n), np.zeros(n))
    assert compare_solvers.numerical_rank(large) is None


def test_profile_of_a_known_table():
    # On a the methods take 1 and 2, on b 9 and 3, on c only the second solves, on d none does.
    records = [record("a", "pgs", 1.0), record("b", "pgs", 9.0), record("c", "pgs", 1.0, solved=False)]
    records += [record("a", "admm", 2.0), record("b", "admm", 3.0), record("c", "admm", 5.0)]
    records += [record("d", name, 0.5, solved=False) for name in ("pgs", "admm")]
    profile = performance_profile(records)
    assert list(profile) == ["pgs", "admm"]
    np.testing.assert_array_equal(profile["pgs"].tau, [1, 3])
    np.testing.assert_array_equal(profile["pgs"].share, [0.25, 0.5])
    np.testing.assert_array_equal(profile["admm"].tau, [1, 2])
    np.testing.assert_array_equal(profile["admm"].share, [0.5, 0.75])


def test_profile_of_a_method_that_is_never_the_fastest_starts_at_zero():
    profile = performance_profile([record("a", "auto", 1.0), record("a", "pgs", 4.0)])
    np.testing.assert_array_equal(profile["pgs"].tau, [1, 4])
    np.testing.assert_array_equal(profile["pgs"].share, [0, 1])


def test_profile_of_a_method_that_solves_nothing_is_flat():
    profile = performance_profile([record("a", "auto", 1.0, solved=False)])
    np.testing.assert_array_equal(profile["auto"].tau, [1])
    np.testing.assert_array_equal(profile["auto"].share, [0])


def test_profile_refuses_tables_with_holes():
    with pytest.raises(ValueError, match="no 'pgs' for the problem 'b'"):
        performance_profile([record("a", "auto", 1.0), record("b", "auto", 1.0), record("a", "pgs", 1.0)])
    with pytest.raises(ValueError, match="'auto' twice for the problem 'a'"):
        performance_profile([record("a", "auto", 1.0), record("a", "auto", 1.0)])
    assert performance_profile([]) == {}


def test_summary_counts_by_residual_and_adds_all_times():
    records = [record("a", "pgs", 1.0, relative_residual=1e-9), record("b", "pgs", 2.0, relative_residual=1e-8)]
    records += [record("c", "pgs", 4.0, False, 1e-7), record("d", "pgs", 8.0, False, 2e-6)]
    (s,) = compare_solvers.summary(records)
    assert (s.method, s.problems, s.solved, s.within_1e6, s.within_1e8, s.time) == ("pgs", 4, 2, 3, 2, 15.0)


def test_shares_are_all_or_nothing_only_where_they_are():
    from stickslip.compare_solvers.table import _share

    assert [_share(n, 10_000) for n in (0, 1, 9_999, 10_000)] == [
        "0 (0.0 %)",
        "1 (0.1 %)",
        "9999 (99.9 %)",
        "10000 (100.0 %)",
    ]
