"""`pgraph bench`: its arithmetic, its gate and its tables; no time is asserted."""

from __future__ import annotations

import ast
import json
import math

import numpy as np
import pytest

import pgraph_app.cli.verify
import pgraph_core as pg
import pgraph_models
from pgraph_app.cli import main
from pgraph_app.cli.verify import part

compare, construction, gate, lean, machine, report, scenes, suite, timing = map(
    part,
    ["compare", "construction", "gate", "lean", "machine", "report", "scenes", "suite", "timing"],
)
building, dynamics, runs, touching = map(part, ("building", "dynamics", "runs", "touching"))
Case, Timed = timing.Case, timing.Timed
BASELINE = {"cpu": "old", "ratios": {"a: peer": 4.0, "b: peer": 2.0}}


def timed(**seconds: list[float]):
    case = Case("dynamics", {side: lambda: None for side in seconds}, goals={"peer": 2.0})
    return Timed(case, seconds)


def found(ratio: float = 3.0, absent: tuple[str, ...] = ()) -> dict:
    """What a run of the suite would give."""
    times = timed(pgraph=[1e-6] * 3, peer=[ratio * 1e-6] * 3)
    return {
        "quick": True,
        "machine": {"cpu": "a CPU", "cores": 2},
        "absent": list(absent),
        "rows": list(suite.rows(times)),
        "scaling": {"exponent": (1.0, 1.01, 1.02), "goal": 1.1},
        "notes": [],
        "not_measured": ["a peer"],
    }


# -- arithmetic ----------------------------------------------------------------------------------


def test_ratios_are_taken_within_a_round():
    """The machine slows down tenfold in the second round: the ratio does not see it."""
    times = timed(pgraph=[1.0, 10.0, 1.0], peer=[3.0, 30.0, 3.0])
    assert times.ratio("peer") == (3.0, 3.0, 3.0)


def test_spread_is_quartiles_and_median():
    assert timing.spread([5.0, 1.0, 3.0, 2.0, 4.0]) == (2.0, 3.0, 4.0)
    assert timing.spread([7.0]) == (7.0, 7.0, 7.0)


def test_every_side_is_sampled_once_a_round():
    calls = {"pgraph": 0, "peer": 0}

    def counted(side: str):
        def call() -> float:
            calls[side] += 1
            return 0.5

        return call

    sides = {side: counted(side) for side in calls}
    case = Case("c", sides, per_call=5, clocked=frozenset(calls))
    (times,) = timing.measure([case], rounds=4, shortest=1e-9)
    assert {side: len(values) for side, values in times.seconds.items()} == dict.fromkeys(calls, 4)
    assert times.quartiles("peer") == (0.1, 0.1, 0.1)
    assert min(calls.values()) >= 4


def test_long_calls_are_warmed_up_once():
    calls = []
    assert timing.repeats(lambda: calls.append(sum(range(1000))), shortest=1e-12) == 1
    assert len(calls) == 1


def test_the_exponent_is_the_slope_of_the_logarithms():
    seconds = {f"n = {n}": [1e-8 * n**1.5, 3e-8 * n**1.5] for n in (10, 100, 1000)}
    times = Timed(Case("chains", {side: lambda: None for side in seconds}), seconds)
    assert suite.scaling(times)["exponent"] == pytest.approx((1.5, 1.5, 1.5))
    assert all(row["ratio"] is None for row in suite.rows(times))


@pytest.mark.parametrize(("full", "met"), [(1.04e-6, "met"), (1.06e-6, "not met")])
def test_what_a_scene_lacks_may_cost_at_most_its_limit(full: float, met: str):
    """Ours is the second side there: the ratio is how much longer it takes than without."""
    sides = {"without": lambda: None, "pgraph": lambda: None}
    times = Timed(
        Case("lacks", sides, at_most={"pgraph": 1.05}), {"without": [1e-6], "pgraph": [full]}
    )
    lines = report.goal_lines(found() | {"rows": list(suite.rows(times))})
    assert next(lines) == ("lacks", "pgraph", "<= 1.05", f"{1e6 * full:.3f}", met)
    assert gate.ratios(suite.rows(times)) == {}


def test_branches_that_a_scene_cannot_take_are_taken_out():
    source = """
def f(rows, const, work, k, h):
    kind = kind_of(rows, k)
    if kind == ROTATE:
        d = 1.0 / (pivot_of(work, k) + armature_of(const, k))
    elif kind <= TRANSLATE:
        d = 2.0
    else:
        d = 3.0
    return d
"""
    left = {
        kinds: ast.unparse(ast.fix_missing_locations(lean.Without(set(kinds)).visit(tree)))
        for kinds in ((0,), (0, 3))
        for tree in [ast.parse(source)]
    }
    assert "if" not in left[0,]
    assert "armature" not in left[0,]
    assert "d = 3.0" in left[0, 3]
    assert "if kind == ROTATE" in left[0, 3]


def test_kernels_without_what_a_scene_lacks_give_the_same_numbers():
    """Hinges alone: the case itself refuses to time what differs by more than 1e-12."""
    case = lean.dynamics(scenes.scene("chain of 3", pg.Model.serial(3)), 1)
    assert float(case.agreement) < 1e-12


def test_what_disagrees_is_not_timed():
    assert scenes.differ(np.ones(3), np.ones(3), 1e-9, "x") == "0e+00"
    for wrong in (2.0, math.nan):
        with pytest.raises(SystemExit, match="x: the results differ by"):
            scenes.differ(np.ones(3), np.array([1.0, 1.0, wrong]), 1e-9, "x")


# -- gate ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("ratio", "falls"), [(3.01, False), (2.99, True), (40.0, False)])
def test_a_fall_of_a_quarter_is_named(ratio: float, falls: bool):
    fallen = gate.fallen({"a: peer": ratio, "new: peer": 0.1}, BASELINE["ratios"])
    assert bool(fallen) == falls
    if falls:
        assert fallen == ["a: peer: the ratio fell from 4 to 2.99"]


def test_another_cpu_is_said_where_something_fell():
    assert gate.verdict({"a: peer": 1.0}, BASELINE, "new")[-1] == (
        "the baseline was made on old, this is new"
    )
    assert gate.verdict({"a: peer": 4.0}, BASELINE, "new") == []


def test_an_update_keeps_what_was_not_measured_on_the_same_cpu():
    assert gate.updated(BASELINE, "old", {"a: peer": 5.0})["ratios"] == {
        "a: peer": 5.0,
        "b: peer": 2.0,
    }
    assert gate.updated(BASELINE, "new", {"a: peer": 5.0}) == {
        "cpu": "new",
        "ratios": {"a: peer": 5.0},
    }


def test_the_baseline_is_read_as_it_was_written(tmp_path):
    path = tmp_path / "baseline.json"
    assert gate.load(path)["ratios"] == {}
    gate.save(BASELINE, path)
    assert gate.load(path) == BASELINE


def test_the_committed_baseline_holds_ratios_and_its_cpu():
    baseline = gate.load()
    assert baseline["cpu"]
    assert baseline["ratios"]
    assert all(value > 0 for value in baseline["ratios"].values())


# -- tables --------------------------------------------------------------------------------------


def test_the_table_of_the_terminal():
    lines = report.text(found()).splitlines()
    assert lines[0] == "measured on a CPU, cores 2"
    assert lines[3].split() == ["dynamics", "pgraph", "1", "us", "1", "us", "-", "1", "us"]
    assert lines[4].split()[-5:] == ["3", "3", "-", "3", "2"]
    assert "goals met: 2 of 2 that were measured" in lines
    assert "not measured: a peer" in lines


def test_a_missed_goal_is_said():
    assert "not met: dynamics, peer (1.5)" in report.text(found(ratio=1.5))
    assert "| dynamics | peer | >= 2 | 1.5 | not met |" in report.markdown(found(ratio=1.5))
    assert "| dynamics | peer | >= 2 | 3 | met |" in report.markdown(found())


def test_absent_peers_are_said():
    assert "not installed, so not compared: mujoco, pin" in report.text(
        found(absent=("mujoco", "pin"))
    )


@pytest.mark.parametrize(
    ("seconds", "unit", "shown"),
    [
        (1.5e-6, "call", "1.5 us"),
        (0.0213, "call", "21.3 ms"),
        (2.0, "model", "2 s"),
        (2e-7, "instance-step", "5 M/s"),
    ],
)
def test_amounts(seconds: float, unit: str, shown: str):
    assert report.amount(seconds, unit) == shown


# -- the command ---------------------------------------------------------------------------------


@pytest.fixture
def measured(monkeypatch):
    """The command without its measurement: no peer is there, and nothing takes time."""
    monkeypatch.setattr(machine, "find_spec", lambda name: None)
    monkeypatch.setattr(suite, "measured", lambda quick: found(absent=tuple(machine.absent())))


@pytest.mark.usefixtures("measured")
def test_without_peers_the_command_says_so(capsys):
    assert main(["bench", "--quick"]) == 0
    assert "not installed, so not compared: mujoco, pin, drake, exudyn" in capsys.readouterr().out


@pytest.mark.usefixtures("measured")
def test_json_is_one_object(capsys):
    assert main(["bench", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["rows"][1]["ratio"] == pytest.approx([3, 3, 3])


@pytest.mark.usefixtures("measured")
@pytest.mark.parametrize(("then", "code"), [(3.0, 0), (5.0, 1)])
def test_the_gate(monkeypatch, tmp_path, capsys, then: float, code: int):
    gate.save({"cpu": "a CPU", "ratios": {"dynamics: peer": then}}, tmp_path / "baseline.json")
    monkeypatch.setattr(gate.load, "__defaults__", (tmp_path / "baseline.json",))
    assert main(["bench", "--gate"]) == code
    wrong = "dynamics: peer: the ratio fell from 5 to 3\n" if code else ""
    assert capsys.readouterr().err == wrong


def test_outside_a_checkout_there_are_no_benchmarks(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(pgraph_app.cli.verify, "ROOT", tmp_path)
    assert main(["bench"]) == 1
    error = capsys.readouterr().err
    assert error.startswith("pgraph bench: ")
    assert "run it in a checkout" in error


# -- construction --------------------------------------------------------------------------------


def test_values_and_characters_of_a_file_are_counted(tmp_path):
    count = construction.written
    (tmp_path / "a.xml").write_text('<a b="1 2 3">\n  <c d="x"/> </a>')
    assert count(tmp_path / "a.xml") == (4, 23)
    (tmp_path / "a.json").write_text('{"name": "a", "link": [0, 0, 1]}')
    assert count(tmp_path / "a.json") == (4, 27)
    (tmp_path / "a.py").write_text('"""Not counted."""\nx = f(2, "b")  # nor this\n')
    assert count(tmp_path / "a.py") == (2, 10)


def test_cells_of_the_page_are_what_differs_from_its_default_table():
    assert construction.cells("double_pendulum") == 1  # how many bodies
    assert construction.cells("fig1_tree") == 4  # and the parents of 4, 5 and 6


def test_the_files_of_our_formats_are_the_built_in_machines():
    built = pg.Mechanism(pg.Model.load(pgraph_models.path("quadruped")))
    ours = construction.mechanism("quadruped")
    q, _ = built.home()
    assert ours.names == built.names
    assert np.array_equal(ours.mass_matrix(q), built.mass_matrix(q))
    assert construction.mechanism("fig1_tree").pgraph.tolist() == [1, 2, 3, 4, 2, 5, 2, 6, 7]


# -- two trees -------------------------------------------------------------------------------------


def test_two_trees_take_turns_and_a_row_that_one_lacks_says_why():
    row = "forward_dynamics, quadruped"
    (found,) = compare.compared(machine.ROOT, machine.ROOT, [row], 2)
    assert found["problem"] == ""
    assert 0.2 < found["ratio"] < 5.0
    _, shown = compare.lines([found])
    assert shown[:4] == (row, *shown[1:3], f"{found['ratio']:.3f}")
    missing = {"row": "a", "problem": "old: AttributeError: no such name"}
    assert compare.lines([missing])[1][-1] == missing["problem"]


# -- every case ------------------------------------------------------------------------------------

SMALL = {  # each kind of case of the suite, on small models
    "one call": lambda: dynamics.one_call(dynamics.quadruped_tree(), "one call", goals={}),
    "native loop": lambda: dynamics.native_loop(dynamics.quadruped_tree(), "a", 2, compiling=False),
    "back ends": lambda: dynamics.back_ends(dynamics.quadruped_tree()),
    "derivatives": lambda: dynamics.derivatives(scenes.scene("chain", pg.Model.serial(5))),
    "stance, run": lambda: dynamics.stance_run(),
    "stance, call": lambda: dynamics.stance_call(),
    "chains": lambda: dynamics.chains(10),
    "lean steps": lambda: lean.steps(scenes.scene("tree", scenes.binary_tree(7), 0.2), 5),
    "steps": lambda: runs.steps(scenes.scene("chain", pg.Model.serial(5), 0.2), "rk4", 5),
    "batch": lambda: runs.batch(scenes.scene("chain", pg.Model.serial(5), 0.2), 1, 4, 5),
    "whole call": lambda: runs.whole_call(estimate=False, number=5),
    "whole call, estimate": lambda: runs.whole_call(estimate=True, chaotic=True, number=5),
    "one step": lambda: runs.one_step(),
    "walking": lambda: runs.walking(),
    "balls": lambda: touching.balls(27, 0.98),
    "columns": lambda: building.from_columns(dynamics.quadruped_tree(), goal=1.0, small=True),
    "construction": lambda: building.construction(dynamics.quadruped_tree(), goal=1.0, small=True),
    "text": lambda: building.from_text(dynamics.quadruped_tree()),
    "parent": lambda: building.parent_changed(),
    "mass": lambda: building.mass_changed(),
}


@pytest.mark.parametrize("kind", SMALL)
def test_every_side_of_a_case_can_be_called(kind: str):
    case = SMALL[kind]()
    assert case.sides
    for call in case.sides.values():
        call()
