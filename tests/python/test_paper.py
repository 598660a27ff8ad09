"""The report of the paper's experiments, with very few samples."""

from __future__ import annotations

import copy
import json
import math
import re

import numpy as np
import pytest

from stickslip import paper
from stickslip.cli import main
from stickslip.paper import claims, page, render, report, words
from stickslip.paper.methods import METHODS, TASKS

PICTURES = ["fig4_iterations", "fig5_stages", "fig6_laws", "fig7_penetration", "fifty_hertz"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("report")
    assert paper.run(out, settings=paper.tiny()) == 0
    return out


@pytest.fixture(scope="module")
def results(folder):
    return json.loads((folder / "results.json").read_text())


def numbers(value, path=""):
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from numbers(inner, f"{path}/{key}")
    elif isinstance(value, list):
        for k, inner in enumerate(value):
            yield from numbers(inner, f"{path}/{k}")
    elif value is None or (isinstance(value, (int, float)) and not isinstance(value, bool)):
        yield path, value


def test_every_picture_is_written(folder):
    for name in PICTURES + [f"strip_{task}" for task in TASKS]:
        assert (folder / f"{name}.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n", name


def test_page_embeds_its_pictures_and_fills_every_number(folder):
    text = (folder / "report.html").read_text(encoding="utf-8")
    assert not re.search(r'(src|href)="(?!data:|#|https://doi)', text)
    visible = re.sub(r"<style>.*?</style>|<[^>]*>", " ", text, flags=re.S)
    assert not re.search(r"\b(nan|inf|None)\b", visible)
    for key in report.EXPERIMENTS:
        assert f'id="{key}"' in text


def test_page_names_no_place(folder):
    for file in ("report.html", "results.json"):
        text = re.sub(r"base64,[A-Za-z0-9+/=]*", "", (folder / file).read_text(encoding="utf-8"))
        assert str(folder) not in text
        assert not re.search(r"(/home/|/tmp/|/root/|/usr/)", text)


def test_results_are_finite(results):
    missing = [p for p, v in numbers(results) if v is None or not math.isfinite(v)]
    # a task may have no sliding contact, an integrator no episode that survived
    assert all(p.endswith("mean_penetration") for p in missing), missing


def test_results_have_every_experiment_task_and_method(results):
    assert set(results) == {"settings", "machine", "seconds", *report.EXPERIMENTS}
    for key in ("table1", "table2", "fig5", "fig6"):
        assert list(results[key]["tasks"]) == list(TASKS)
    for key in ("table2", "fig5"):
        for task in TASKS:
            assert list(results[key]["tasks"][task]) == list(METHODS)
    assert {"processor", "compiler", "stickslip"} <= set(results["machine"])


def test_table1_has_four_methods_and_halley_and_bisection_never_fail(results):
    for task in TASKS:
        methods = results["table1"]["tasks"][task]["methods"]
        assert list(methods) == ["bisection", "golden_section", "quartic", "halley"]
        for m in methods.values():
            assert m["ns_per_solve"] > 0 and m["evaluations"] >= 1 and 0 <= m["failures"] <= 1
        assert methods["halley"]["failures"] == methods["bisection"]["failures"] == 0
        assert methods["halley"]["evaluations"] < methods["bisection"]["evaluations"]


def test_per_contact_iteration_needs_fewer_sweeps_than_pgs(results):
    for task in TASKS:
        found = results["table2"]["tasks"][task]
        assert found["bisection"]["mean"] < found["pgs"]["mean"], task
        assert found["bisection"]["p99"] < found["pgs"]["p99"], task
    for task in ("hang", "drop"):
        found = results["table2"]["tasks"][task]
        assert found["bisection"]["impacts"] > 0 and found["pgs"]["impacts"] > 0
        assert 5 * found["bisection"]["at_impact"] < found["pgs"]["at_impact"], task


def test_claims_that_are_missed_are_named(results):
    good = copy.deepcopy(results)
    for methods in (d["methods"] for d in good["table1"]["tasks"].values()):
        for m, ns in {"halley": 50, "bisection": 400, "golden_section": 800, "quartic": 500}.items():
            methods[m]["ns_per_solve"] = ns
    assert claims.missed(good) == []
    bad = copy.deepcopy(good)
    bad["table1"]["tasks"]["trot"]["methods"]["halley"] |= {"ns_per_solve": 120, "failures": 0.01}
    bad["table1"]["tasks"]["random"]["methods"]["golden_section"]["ns_per_solve"] = 300
    bad["table2"]["tasks"]["hang"]["pgs"]["at_impact"] = 4 * bad["table2"]["tasks"]["hang"]["bisection"]["at_impact"]
    bad["table2"]["tasks"]["drop"]["pgs"]["mean"] = bad["table2"]["tasks"]["drop"]["bisection"]["mean"]
    found = claims.missed(bad)
    assert [text.split(":")[0] for text in found] == [
        *["Table I, Trot"] * 3,
        "Table I, Random",
        "Table II, Drop",
        "Table II, Hang",
    ]


def test_histograms_hold_every_step(results):
    for task in TASKS:
        for m in METHODS:
            assert sum(results["table2"]["tasks"][task][m]["histogram_percent"]) == pytest.approx(100)


def test_default_keeps_hanging_feet_on_the_ground(results):
    cases = results["fig7"]["cases"]
    assert cases["energy_safe"]["max_mm"] < 0.01 < cases["bisection"]["max_mm"]
    for rows in (results["fifty_hertz"]["cases"][t]["energy_safe"] for t in ("hang", "drop")):
        assert all(r["exploded"] == 0 for r in rows)
        assert all(r["energy_growth"] < 1e-2 for r in rows)


def test_page_can_be_written_again_from_results(folder, results):
    before = (folder / "report.html").read_text(encoding="utf-8")
    report.write_page(folder, results)
    assert (folder / "report.html").read_text(encoding="utf-8") == before


def test_command_reports_a_folder_that_cannot_be_written(tmp_path, capsys):
    file = tmp_path / "file"
    file.write_text("")
    assert main(["paper", "--output", str(file / "report")]) == 1
    assert "stickslip:" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("value", "text"),
    [(0, "0"), (1234.5, "1\u202f230"), (0.0123, "0.0123"), (1.5e-7, "1.5·10<sup>−7</sup>"), (math.inf, "–")],
)
def test_numbers_read_well(value, text):
    assert words.number(value) == text


def test_tables_hold_their_cells():
    table = page.html_table(["a", "b"], [["x", "1"], ["y", "2"]], strong_rows=(1,))
    assert table.count("<td") == 4 and table.count("<th ") + table.count("<th>") == 2 and 'class="strong"' in table


@pytest.mark.parametrize("radius_b", [0.2, 0.1, 0.3])
def test_round_cone_is_hit_where_its_distance_vanishes(radius_b):
    rng = np.random.default_rng(1)
    part = render.RoundCone(np.array([0.1, 0.0, 0.0]), np.array([0.4, 0.5, 0.3]), 0.2, radius_b, (1, 1, 1))
    origin = np.array([0.0, -4.0, 0.0])
    direction = rng.normal(size=(4000, 3)) * 0.08 + [0.06, 1, 0.04]
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    t, normal = part.hit(origin, direction)
    hit = np.isfinite(t)
    assert hit.sum() > 100 and (~hit).sum() > 100
    s = np.linspace(0, 1, 4001)[:, None]
    centers, radii = part.a + s * (part.b - part.a), part.radius_a + s[:, 0] * (part.radius_b - part.radius_a)
    points = origin + t[hit, None] * direction[hit]
    distance = [(np.linalg.norm(p - centers, axis=1) - radii).min() for p in points]
    assert np.abs(distance).max() < 1e-5
    assert np.linalg.norm(normal[hit], axis=1) == pytest.approx(1)
    assert (np.einsum("ki,ki->k", normal[hit], direction[hit]) < 1e-9).all()


def test_box_is_hit_on_its_faces():
    turn = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    box = render.Box(np.zeros(3), turn, np.array([1, 2, 3.0]), (1, 1, 1))
    t, normal = box.hit(np.array([-10, 0.5, 0.5]), np.array([[1.0, 0, 0], [0, 1.0, 0]]))
    assert t[0] == pytest.approx(8) and normal[0] == pytest.approx([-1, 0, 0])
    assert np.isinf(t[1])
