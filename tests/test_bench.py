"""`pgraph bench`: every benchmark yields finite figures at its smallest size, and tables of them.

No test looks at a time: how fast something is belongs to the benchmarks, not to the tests.
"""

import csv
import json
import math

import pytest

import pgraph_app.cli.study
from benchmarks import benchmarks, table
from benchmarks.measure import Effort, compared, in_turns
from pgraph_app.cli import main

KNOWN = benchmarks()
SLOW = {  # compile, start other programs, or take more than a second
    "accelerations", "batches", "building", "contact_solvers", "derivatives", "figures",
    "first_use", "fits", "gaits", "inverse", "steps", "sweeps", "work_precision",
}  # fmt: skip
QUICK = Effort(quick=True)


def found(ratio: float = 3.0, cpu: str = "a CPU") -> dict:
    """Return the results of one benchmark."""
    rows = [
        {"case": "stance", "by": by, "per": "call", "seconds": seconds, "low": 1e-6, "high": 2e-6,
         "ratio": part, "agrees": agrees}
        for by, seconds, part, agrees in (
            ("pgraph", 1e-6, None, "peer 1e-9"), ("peer", ratio * 1e-6, ratio, ""),
        )
    ]  # fmt: skip
    return {"machine": {"cpu": cpu, "cores": 2}, "benchmarks": {"accelerations": rows}}


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=pytest.mark.nightly) if n in SLOW else n for n in KNOWN],
)
def test_smallest_size_yields_finite_figures(name):
    one = KNOWN[name]
    if one.lacks:
        pytest.skip(f"needs {', '.join(one.lacks)}")
    rows = list(one.rows(QUICK))
    assert rows
    for row in rows:
        numbers = [x for x in row.values() if isinstance(x, (int, float))]
        assert all(math.isfinite(x) for x in numbers), row
        assert all(row[x] > 0.0 for x in ("seconds", "ratio") if row.get(x) is not None), row
    about = {"machine": {"cpu": "a CPU"}, "benchmarks": {name: rows}}
    for write in table.WRITERS.values():
        assert str(rows[0].get("case", "")) in write(about)


def test_ratios_are_taken_within_a_round(monkeypatch):
    """The machine becomes ten times slower in the second round, for both sides."""
    monkeypatch.setattr("benchmarks.measure.repeats", lambda call, shortest: 1)
    times = {"ours": iter([1.0, 10.0, 1.0]), "peer": iter([3.0, 30.0, 3.0])}
    sides = {side: lambda x=x: next(x) for side, x in times.items()}
    ours, peer = compared(
        Effort(), "case", sides, per_call=2, clocked=set(sides), rounds=3, agrees="1e-9"
    )
    assert (ours["ratio"], peer["ratio"]) == (None, 3.0)
    assert (ours["seconds"], peer["seconds"]) == (0.5, 1.5)
    assert (ours["agrees"], peer["agrees"]) == ("1e-9", "")


def test_every_side_has_a_sample_per_round():
    calls = []
    sides = {"a": lambda: calls.append("a"), "b": lambda: calls.append("b")}
    seconds = in_turns(sides, rounds=4, shortest=1e-9)
    assert {side: len(x) for side, x in seconds.items()} == {"a": 4, "b": 4}


def test_tables_keep_every_figure(tmp_path):
    assert json.loads(table.in_json(found())) == found()
    (tmp_path / "a.csv").write_text(table.in_csv(found()))
    with (tmp_path / "a.csv").open() as file:
        ours, peer = csv.DictReader(file)
    assert (ours["benchmark"], ours["ratio"], peer["ratio"]) == ("accelerations", "", "3.0")
    (cells,) = table.tables(found()["benchmarks"]["accelerations"])
    assert cells[1][:3] == ["stance", "pgraph", "call"]
    assert cells[2][:2] == ["", "peer"]


@pytest.mark.parametrize(("ratio", "many"), [(3.0, 0), (2.4, 0), (2.0, 1)])
def test_a_ratio_that_fell_by_a_quarter_is_named(ratio, many):
    wrong = table.fallen(found(ratio), found())
    assert len(wrong) == many
    assert all("peer" in sentence for sentence in wrong)
    assert len(table.fallen(found(ratio), found(cpu="another"))) == 2 * many


def test_without_a_name_the_benchmarks_are_listed(capsys):
    assert main(["bench", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)["benchmarks"]
    assert [x["name"] for x in listed] == list(KNOWN)
    assert all(x["what"] and x["minutes"] > 0 for x in listed)


def test_one_is_run_and_written_to_a_file(tmp_path, capsys):
    file = tmp_path / "a.json"
    assert main(["bench", "contact_search", "--quick", "-o", str(file)]) == 0
    assert "contact_search" in capsys.readouterr().out
    earlier = json.loads(file.read_text())
    for row in earlier["benchmarks"]["contact_search"]:
        row["ratio"] = row["ratio"] and 1e-9  # every ratio has risen since
    file.write_text(json.dumps(earlier))
    assert main(["bench", "contact_search", "--quick", "--against", str(file)]) == 0


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["nothing"], "'nothing'"),
        (["steps", "-o", "a.png"], "'a.png'"),
        (["steps", "--against", "none.json"], "'none.json'"),
    ],
)
def test_wrong_words_are_named(words, named, capsys):
    assert main(["bench", *words]) == 1
    assert named in capsys.readouterr().err


def test_a_peer_that_is_not_installed_is_named(monkeypatch, capsys):
    monkeypatch.setattr("benchmarks.machine.distributions", lambda name: ())
    assert main(["bench"]) == 0
    assert "mujoco" in capsys.readouterr().out.splitlines()[-1]
    assert main(["bench", "learning"]) == 0
    assert "gymnasium" in capsys.readouterr().out


def test_outside_a_clone_there_are_no_benchmarks(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(pgraph_app.cli.study, "ROOT", tmp_path)
    assert main(["bench"]) == 1
    assert "clone" in capsys.readouterr().err
