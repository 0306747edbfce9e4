"""Sweeps: paths into a model, designs, metrics, processes, a cluster, interruptions."""

import json
import math
import multiprocessing
import os
import signal
import socket
import subprocess
import sys
from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy import stats
from scipy.integrate import trapezoid

import pgraph_core as pg
import pgraph_models
from pgraph_app.cli import main
from pgraph_core.simulation.paths import Path
from pgraph_core.sweeps import tasks
from pgraph_core.sweeps.sweep import points_of

from .nights import at_night

SHORT = {"t_end": 0.1, "step": 1e-3}


@pytest.fixture(autouse=True)
def schedulers_answer_soon(monkeypatch):
    monkeypatch.setattr(tasks, "ANSWER", 1)


@pytest.fixture(scope="module")
def pendulum() -> pg.Model:
    """Return a mass one metre below its hinge, with an unused parameter."""
    bob = pg.Body(name="my.bob", mass=1.0, inertia=0.01 * np.eye(3), axes=(0, 1, 0),
                  com=(0, 0, -1), tip=(0, 0, -1), q=0.1)  # fmt: skip
    steps = [{"low": (0, 0), "high": (1, 1), "height": 0.02}]
    return pg.Model(bodies=[bob], parameters={"heavy": 2.0}, ground={"steps": steps})


STANCE = {"scenario": "stance", "t_end": 0.05}, "bodies.pelvis.mass", "lumbar"
TREE = {"t_end": 0.2, "step": 1e-3, "method": "rk4"}, "bodies.3.mass", "2"


@pytest.mark.parametrize(("options", "path", "joint"), [STANCE, TREE], ids=["stance", "tree"])
def test_points_have_the_bits_of_single_runs(options, path, joint):
    """Metrics over all frames are equal too, and a point that cannot run affects no other."""
    tree = "scenario" not in options
    model = pg.Model.serial(3) if tree else pg.Model.load(pgraph_models.path("quadruped"))
    values = [7.0, -1.0, 8.0, 9.0]
    metrics = [f"final {joint}", f"max v.{joint}", f"mean {joint}", "steps", "t_end"]
    table = pg.sweep(model, {path: values}, metrics, workers=1, **options)
    wide = pg.sweep(model, {path: [7.0, 8.0, 9.0]}, metrics, workers=1, **options)
    part, field = path.split(".")[1:]
    assert table.status[1] == "REFUSED"
    for i, k in ((0, 0), (2, 1), (3, 2)):
        run = pg.simulate(model.edit(part, **{field: values[i]}), **options)
        speed = run.columns()[f"v.{joint}"]
        mean = trapezoid(run[joint], run.t) / (run.t[-1] - run.t[0])
        found = [run[joint][-1], speed.max(), mean, run.counters["steps"], run.t[-1]]
        assert [x[i] for x in table.values.values()] == found
        assert [x[k] for x in wide.values.values()] == found


def test_the_period_follows_the_length_as_its_closed_form(pendulum):
    """Small swings of a mass at l with its own inertia: T = 2 pi sqrt((m l^2 + J) / (m g l))."""

    def period(run: pg.Result) -> float:
        q, t = run["my.bob"], run.t
        at = np.flatnonzero(q[:-1] * q[1:] < 0)[:2]  # the first two passages through zero
        zeros = t[at] - q[at] * (t[at + 1] - t[at]) / (q[at + 1] - q[at])
        return 2 * (zeros[1] - zeros[0])

    lengths = [-0.3, -0.7, -1.2]
    small = pendulum.edit("my.bob", q=1e-3)
    given = {("bodies", "my.bob", "com", 2): lengths}
    table, inertia = pg.sweep(small, given, period, t_end=4.0, rtol=1e-11), 0.01
    expected = [2 * math.pi * math.sqrt((x**2 + inertia) / (9.81 * -x)) for x in lengths]
    assert table.values["period"] == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize(
    ("path", "read"),
    [
        ("bodies.my.bob.mass", lambda m: m.body("my.bob").mass),
        (("bodies", "my.bob", "com", "2"), lambda m: m.body("my.bob").com[2]),
        ("bodies.my.bob.com.0", lambda m: m.body("my.bob").com[0]),
        ("heavy", lambda m: m.parameters["heavy"]),
        ("gravity.2", lambda m: m.gravity[2]),
        ("ground.friction", lambda m: m.ground.friction),
        (("ground", "steps", 0, "height"), lambda m: m.ground.steps[0].height),
    ],
)
def test_paths_name_one_number(pendulum, path, read):
    assert read(Path(pendulum, path).set(pendulum, 0.7)) == 0.7


@pytest.mark.parametrize("samples", ["latin", "sobol", "random"])
def test_samples_fill_their_ranges_and_are_the_same_again(samples):
    values = {"a": (2.0, 4.0), "b": stats.norm(1.0, 0.1)}
    points = points_of(values, samples, 512, 5)
    assert points.shape == (512, 2)
    assert ((points[:, 0] > 2.0) & (points[:, 0] < 4.0)).all()
    assert points.mean(axis=0) == pytest.approx([3.0, 1.0], abs=0.1)
    assert points[:, 1].std() == pytest.approx(0.1, rel=0.1)
    assert (points_of(values, samples, 512, 5) == points).all()
    assert (points_of(values, samples, 512, 6) != points).any()


def test_a_grid_has_every_combination_and_a_latin_hypercube_a_point_in_each_stratum():
    points = points_of({"a": [1, 2, 3], "b": [10, 20]}, "grid", None, 0)
    assert sorted(map(tuple, points)) == [(a, b) for a in (1, 2, 3) for b in (10, 20)]
    points = points_of({"a": (0.0, 1.0), "b": (0.0, 1.0)}, "latin", 50, 1)
    for column in points.T:
        assert sorted((column * 50).astype(int)) == list(range(50))


def masses(values) -> dict:
    return {"set": {"bodies.my.bob.mass": values}}


@pytest.mark.parametrize(
    ("given", "fact"),
    [
        *(({"set": {path: [1.0]}}, fact) for path, fact in {
            "bodies.my.bob.weight": "weight.*mass", "bodies.nobody.mass": "nobody.*my.bob",
            "bodys.my.bob.mass": "bodies.NAME.FIELD", "bodies.my.bob": "my.bob",
            "bodies.my.bob.com": "bodies.my.bob.com.0", "bodies.my.bob.com.3": "com.*3",
            "bodies.my.bob.parent": "parent", "light": "light.*heavy", "gravity": "gravity.0",
            "q": "q.my.bob",
            "gravity.3": "gravity.*3", "ground.frictoin": "friction", "": "NAME", 3: "NAME",
        }.items()),
        *((masses(values), fact) for values, fact in (
            ([], "mass"), ("abc", "numbers"), ([1.0, math.nan], "finite"),
            (np.ones(20_000_000), "points"))),
        *(({**masses((1.0, 2.0)), **design}, fact) for design, fact in (
            ({"samples": "halton"}, "latin"), ({"samples": "latin"}, "points"),
            ({"samples": "latin", "n": 0}, "points"),
            ({"samples": "random", "n": 3, "seed": -1}, "seed"))),
        ({**masses((2.0, 1.0)), "samples": "random", "n": 3}, "low, high"),
        *(({"metric": metric}, "metric") for metric in ("highest my.bob", "max", 3, [], {"a": 1})),
        *(({"metric": {name: "t_end"}}, name) for name in ("heavy", "status", "reason")),
        ({"metric": ["t_end", "max nobody"]}, "nobody"),
        ({"tend": 1.0}, "tend.*t_end"),
        ({"scheduler": "tcp://127.0.0.1:1", "metric": "t_end"}, r"tcp://127\.0\.0\.1:1"),
        *(({name: value}, fact) for name, value, fact in (
            ("out", "table.txt", "table"), ("out", "none/table.csv", "table"),
            ("method", "rk46", "dopri5"), ("t_end", -1.0, "t_end"), ("scenario", "none", "none"),
            ("n", 5, "samples"), ("workers", 0, "workers"), ("workers", 2.5, "workers"),
            ("resume", True, "out="))),
        ({"set": {"heavy": [1.0], ("heavy",): [2.0]}}, "heavy"),
        ({"set": {"gravity.2": [1.0], ("gravity", 2): [2.0]}}, "twice"),
    ],
)  # fmt: skip
def test_faults_are_refused_before_the_first_run(pendulum, given, fact, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def never(run: pg.Result) -> float:
        raise AssertionError("a run was measured")

    given = {"set": {"heavy": [1.0]}, "metric": never, **SHORT, **given}
    with pytest.raises(pg.PgraphError, match=fact):
        pg.sweep(pendulum, **given)
    assert not [*tmp_path.iterdir()]


def test_an_edited_metric_is_another_sweep(pendulum, tmp_path):
    """The sweep goes on with the same function only, also where it closes over another number."""

    def metric(scale):
        return lambda run: scale * run["my.bob"][-1]

    out, values = tmp_path / "table.csv", {"bodies.my.bob.mass": [1.0, 2.0, 3.0]}

    def go(function, **options):
        return pg.sweep(pendulum, values, function, out=out, workers=1, **options, **SHORT)

    go(metric(1.0), progress=lambda fraction: fraction < 0.5)
    for other in (metric(2.0), lambda run: run["my.bob"][-1]):
        with pytest.raises(pg.PgraphError, match="another sweep"):
            go(other, resume=True)
    assert go(metric(1.0), resume=True).status == ("DONE",) * 3


@pytest.mark.parametrize("workers", [None, pytest.param(2, marks=pytest.mark.nightly)])
def test_a_script_without_a_guard_is_warned(workers, tmp_path):
    """Spawned processes run the script again, which would start processes again."""
    script = tmp_path / "script.py"
    script.write_text(
        "import numpy as np, pgraph_core as pg\n"
        "from pgraph_core.sweeps import tasks\n"
        "tasks.CHUNK = 0.0\n"
        "masses = {'bodies.2.mass': np.linspace(1, 2, 20)}\n"
        f"pg.sweep(pg.Model.serial(3), masses, 't_end', t_end=20.0, workers={workers})\n"
        "print('table')\n"
    )
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True)
    assert "__main__" in done.stderr
    assert (done.stdout, done.returncode) == (("table\n", 0) if workers is None else ("", 1))
    assert ("UserWarning" if workers is None else "InputError") in done.stderr


def test_a_point_that_fails_keeps_its_reason_and_the_others_their_values(pendulum):
    def moody(run: pg.Result) -> float:
        mass = run.mechanism.model.body("my.bob").mass
        if mass == 2.0:
            raise KeyError("no")
        return math.nan if mass == 3.0 else mass

    metrics = {"moody": moody, "end": "t_end"}
    values = [-1.0, 1.0, -1.0, 2.0, 3.0, 4.0]
    table = pg.sweep(pendulum, {"bodies.my.bob.mass": values}, metrics, **SHORT)
    assert table.status == ("REFUSED", "DONE", "REFUSED", "FAILED", "FAILED", "DONE")
    assert list(table.failed) == [0, 2, 3, 4]
    for k, fact in ((2, "mass"), (3, "KeyError"), (4, "moody")):
        assert fact in table.reason[k]
    assert table.values["moody"][[1, 5]].tolist() == [1.0, 4.0]
    assert table.values["end"][3] == SHORT["t_end"]


MASSES = {"bodies.2.mass": np.linspace(0.5, 2.0, 40), "bodies.1.mass": [1.0, 3.0]}


def chain(**options) -> pg.Sweep:
    return pg.sweep(pg.Model.serial(3), MASSES, ["final 2", "energy_drift"], t_end=1.0, **options)


@pytest.fixture(scope="module")
def alone() -> pg.Sweep:
    return chain(workers=1)


def test_processes_give_the_same_bits_also_in_a_file(alone, monkeypatch, tmp_path):
    import pandas

    started = []
    pool = tasks._by_processes
    monkeypatch.setattr(tasks, "CHUNK", 0.0)
    monkeypatch.setattr(tasks, "_by_processes", lambda *x: started.append(x) or pool(*x))
    assert chain(workers=2).to_csv() == alone.to_csv()
    assert started
    alone.save(tmp_path / "table.csv")
    read = pandas.read_csv(tmp_path / "table.csv")
    for name, column in {**alone.values, "bodies.2.mass": alone.points[:, 0]}.items():
        assert (read[name].to_numpy() == column).all()


@pytest.mark.nightly
def test_a_cluster_gives_the_same_bits_though_a_worker_dies(alone):
    import distributed

    options = {"n_workers": 4, "threads_per_worker": 1, "dashboard_address": None}
    with distributed.LocalCluster(**options) as cluster:
        client = distributed.Client(cluster)
        killed = []

        def progress(fraction: float) -> bool:
            if fraction > 0.3 and not killed:
                killed.append(next(iter(cluster.workers.values())).pid)
                os.kill(killed[0], signal.SIGKILL)
            return True

        table = chain(scheduler=client, progress=progress)
        client.close()
    assert killed
    assert table.to_csv() == alone.to_csv()


def test_a_scheduler_that_takes_the_call_and_is_silent(pendulum):
    pytest.importorskip("distributed")
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(pg.InputError, match="tcp"):
            pg.sweep(pendulum, {"heavy": [1.0]}, "t_end", scheduler=address, **SHORT)


def test_a_worker_of_another_version_is_refused(pendulum):
    task = tasks.Task(pendulum, ("heavy",), {"t_end": "t_end"}, SHORT, "0.0.1")
    with pytest.raises(pg.InputError, match=r"0\.0\.1"):
        tasks.run_points(task, [(0, (1.0,))])


def test_a_sweep_that_was_stopped_goes_on_without_computing_a_point_twice(tmp_path, alone):
    out, computed = tmp_path / "table.csv", []

    def metric(run: pg.Result) -> float:
        computed.append(run.mechanism.model.body("2").mass)
        return float(run["2"][-1])

    chain, masses = pg.Model.serial(3), {"bodies.2.mass": np.linspace(0.5, 2.0, 10)}
    ask = {"workers": 1, "out": out, "t_end": 0.2}
    first = pg.sweep(chain, masses, metric, progress=lambda fraction: fraction < 0.35, **ask)
    assert "NOT_RUN" in first.status
    assert not out.exists()
    part = tmp_path / "table.csv.part"
    header, *lines = part.read_text().splitlines(keepends=True)
    for given in ({}, {"resume": False, "scheduler": "tcp://127.0.0.1:1"}):  # resume was forgotten
        with pytest.raises(pg.InputError, match=rf"{len(lines)} .*resume=True"):
            pg.sweep(chain, masses, metric, **ask, **given)
    lost = json.loads(lines[1])["point"]
    damaged = lines[1][:20] + lines[1][30:]
    part.write_text("".join([header, lines[0], damaged, *lines[2:], '{"point": 9, "val']))
    computed.remove(masses["bodies.2.mass"][lost])
    whole = pg.sweep(chain, masses, metric, resume=True, **ask)
    assert sorted(computed) == pytest.approx(list(masses["bodies.2.mass"]))
    assert out.read_text() == whole.to_csv()
    assert not part.exists()
    with pytest.raises(pg.InputError, match=r"table\.csv\.part"):  # whatever the design
        pg.sweep(chain, {"bodies.2.mass": [1.0]}, metric, resume=True, **ask)
    assert out.read_text() == whole.to_csv()
    assert whole.to_csv() == pg.sweep(chain, masses, metric, workers=1, t_end=0.2).to_csv()


def test_a_sweep_without_a_point_leaves_no_file(pendulum, tmp_path):
    given = {"set": {"heavy": [1.0]}, "metric": "t_end", "out": tmp_path / "table.csv", **SHORT}
    with pytest.raises(pg.InputError, match="tcp"):
        pg.sweep(pendulum, **given, scheduler="tcp://127.0.0.1:1")
    assert not [*tmp_path.iterdir()]
    for begun in ('{"sweep": "of another"}\n', ""):  # killed before its first point
        (tmp_path / "table.csv.part").write_text(begun)
        pg.sweep(pendulum, **given)
    assert [x.name for x in tmp_path.iterdir()] == ["table.csv"]


def test_the_command_prints_and_writes_a_table(capsys, tmp_path):
    import pandas

    words = ["sweep", "pendulum", "--metric", "t_end", "--t-end", "0.1", "--set"]
    file = tmp_path / "t.parquet"
    assert main([*words, "bodies.rod.mass=1:2:3", "--json", "-o", str(file)]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["points"] == 3
    assert answer["table"]["bodies.rod.mass"] == [1.0, 1.5, 2.0]
    assert len(pandas.read_parquet(file)) == 3
    assert main([*words, "bodies.rod.mass=1,-1"]) == 1
    assert "1 of 2" in capsys.readouterr().err


def test_metrics_see_an_oscillation_of_one_frame_per_period():
    """A mass that swings by 0.1 m at 10 Hz for 100 s: 1001 frames show it at rest."""
    spring = (2 * np.pi * 10.0) ** 2
    body = pg.Body(name="x", joint="prismatic", axes=(1, 0, 0), mass=1.0, q=0.1, stiffness=spring)
    model = pg.Model(bodies=(body,), gravity=(0, 0, 0))
    given = model, {"bodies.x.stiffness.0": [spring]}, ["peak v.x", "range x"]
    table = pg.sweep(*given, t_end=100.0)
    assert table.values["peak v.x"][0] == pytest.approx(2 * np.pi, rel=0.02)
    assert table.values["range x"][0] == pytest.approx(0.2, rel=0.01)
    assert (table.status, table.reason) == (("DONE",), ("",))
    table = pg.sweep(*given, t_end=100.0, frames=1001)
    assert table.status == ("DONE",)
    assert "frames=" in table.reason[0]


def test_means_are_over_time_and_names_mean_what_they_mean_in_a_run():
    """A speed e^(-10 t) over 10 s has the mean 0.01, and the root mean square sqrt(0.005)."""
    damped = pg.Body(name="x", axes=(0, 0, 1), inertia=np.eye(3), damping=10.0, v=1.0)
    other = pg.Body(name="v.x", axes=(0, 0, 1), inertia=np.eye(3), q=0.3)
    given = {"bodies.x.inertia.2.2": [1.0]}, ["mean q.v.x", "final v.x", "final x"]
    run = pg.simulate(pg.Model(bodies=(damped, other)), t_end=10.0)
    table = pg.sweep(run.mechanism.model, *given, t_end=10.0)
    assert table.values["final v.x"][0] == run["v.x"][-1] == 0.3
    alone = pg.Model(bodies=(damped,))
    table = pg.sweep(alone, given[0], ["mean v.x", "rms v.x"], t_end=10.0)
    assert table.values["mean v.x"][0] == pytest.approx(0.1 / 10.0, rel=1e-3)
    assert table.values["rms v.x"][0] == pytest.approx(np.sqrt(0.05 / 10.0), rel=5e-3)


def killed(run: pg.Result, first: str = "") -> float:
    """Kill the process of a sweep at a mass of 9 kg: always, or the first time, which makes a file
    named `first`."""
    mass = run.mechanism.model.bodies[0].mass
    if mass == 9.0 and multiprocessing.parent_process() and not (first and os.path.exists(first)):
        if first:
            open(first, "x").close()
        os.kill(os.getpid(), signal.SIGKILL)
    return mass


WITH_A_KILLER = {"bodies.my.bob.mass": [*np.linspace(1, 2, 40), 9.0]}


def test_points_of_a_worker_that_is_killed_are_computed_by_another(pendulum, monkeypatch, tmp_path):
    """A chunk of work is made a point, so that even this sweep goes to processes."""
    monkeypatch.setattr(tasks, "CHUNK", 1e-6)
    metric = partial(killed, first=str(tmp_path / "killed"))
    table = pg.sweep(pendulum, WITH_A_KILLER, {"mass": metric}, **SHORT, workers=2)
    assert (tmp_path / "killed").exists()
    assert (table.values["mass"] == WITH_A_KILLER["bodies.my.bob.mass"]).all()


@pytest.mark.nightly
def test_a_point_that_kills_every_worker_ends_the_sweep(pendulum, monkeypatch):
    monkeypatch.setattr(tasks, "CHUNK", 1e-6)
    with pytest.raises(pg.InputError, match=r"workers.*stopped by the system.* points left"):
        pg.sweep(pendulum, WITH_A_KILLER, killed, **SHORT, workers=2)


ENDLESS = """
import os, signal, sys, time, multiprocessing
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background ignores it
import numpy as np, pgraph_core as pg
from pgraph_core.sweeps import tasks
tasks.CHUNK = 1e-6
def endless(run):
    if multiprocessing.parent_process():
        print("a process computes", flush=True)
        time.sleep(1e6)
    return 1.0
if __name__ == "__main__":
    masses = {"bodies.2.mass": np.linspace(1, 2, 40)}
    try:
        pg.sweep(pg.Model.serial(3), masses, {"one": endless}, t_end=0.1, workers=2)
    except KeyboardInterrupt:
        print(len(multiprocessing.active_children()), "left")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="a console sends Ctrl+C in another way there")
@pytest.mark.parametrize("how", ["ctrl_c", *at_night("kill", "ctrl_c of a terminal")])
def test_the_processes_of_a_sweep_end_with_it_whatever_they_compute(tmp_path, how):
    """Notebooks send Ctrl+C to the process alone, terminals to all. The output ends with the last
    process."""
    (script := tmp_path / "script.py").write_text(ENDLESS)
    pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, script], start_new_session=True, **pipes) as sweep:
        assert sweep.stdout is not None
        assert [sweep.stdout.readline() for _ in range(2)] == ["a process computes\n"] * 2
        send = os.killpg if how == "ctrl_c of a terminal" else os.kill
        send(sweep.pid, signal.SIGKILL if how == "kill" else signal.SIGINT)
        said = sweep.communicate()
    assert said[0] == "" if how == "kill" else said == ("0 left\n", "")


def test_a_start_is_swept_under_the_name_that_fits_take():
    model = pg.Model.serial(2).add(pg.Scenario("tilted", q={"1": 0.5}))
    short = {"metric": "final 1", "t_end": 0.01, "workers": 1}
    values = [0.2, 0.4]
    for name, path, scenario in (
        ("q.1", "bodies.1.q", None),  # the model leaves it out
        ("v.2", "bodies.2.v.0", None),
        ("q.1", "scenarios.tilted.q.1", "tilted"),
        ("q.2", "bodies.2.q", "tilted"),
    ):
        tables = [pg.sweep(model, {x: values}, scenario=scenario, **short) for x in (name, path)]
        assert np.array_equal(tables[0]["final 1"], tables[1]["final 1"])
        assert np.array_equal(tables[0][name], values)
    assert model.edit("q.2", 0.3).body("2").q == (0.3,)
    for scenario in (None, "tilted"):
        batch = pg.BatchStepper(model, 2, set={"q.1": values}, scenario=scenario)
        assert np.array_equal(batch.q, [[0.2, 0.0], [0.4, 0.0]])
