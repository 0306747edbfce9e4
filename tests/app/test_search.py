"""Searches on the page: fits, optimal numbers and what matters, by the thread that does them."""

import threading

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app import search as work_of_search
from pgraph_app.core.jobs import Worker
from pgraph_app.model.apart import answer
from pgraph_app.search import Choices, Search
from pgraph_app.search.view import choices, searches

from .store import LIMIT, ME, after, begun, do

T = np.linspace(0.0, 1.5, 76)


def pendulum(**fields):
    rod = {"mass": 1.0, "com": (0, 0, -0.4), "damping": 0.05, "q": [1.2]} | fields
    body = pg.Body(name="rod", axes=[(0, 1, 0)], inertia=np.diag([0.03, 0.03, 0.001]), **rod)
    return pg.Model(bodies=[body], gravity=(0, 0, -9.81))


def curves():
    """A measurement of the angle as text of a .csv file."""
    run = pg.simulate(pendulum(), t_eval=T, t_end=1.5, estimate=False)
    noise = 1e-3 * np.random.default_rng(0).normal(size=len(T))
    lines = [f"{t:.6g},{x:.6g}" for t, x in zip(T, run["rod"] + noise)]
    return "\n".join(["t [s],angle", *lines])


def listed(state):
    """Return the state once the numbers and curves of its model are known."""
    return after(state, do.Learned(Choices.about(state.model)))


def searched(state):
    """Return the state after its search, and all that the thread sent."""
    heard, done = [], threading.Event()

    def send(event):
        heard.append(event)
        if not isinstance(event, do.Progress):
            done.set()

    state = after(state, do.StartSearch(ME))
    assert state.search is not None, state.search_problem
    Worker(Search, Search.work, send).render(state, state)
    assert done.wait(LIMIT)
    return after(state, *heard), heard


def test_a_fit_finds_the_damping_and_is_undone():
    state = begun(pendulum(damping=0.2, q=[1.0]))
    state = after(state, do.OpenData(ME, "swing.csv", curves()))
    assert searches(listed(state))["columns"] == [["angle", ""]]
    state = after(state, do.MatchColumn(ME, 1, "angle", "rod"))
    for path in ("bodies.rod.damping.0", "bodies.rod.damping", "q.rod"):
        state = after(state, do.FreeNumber(ME, path, True))
    assert len(state.searching.free) == 2
    state, heard = searched(state)
    assert [one for one in heard if isinstance(one, do.Progress) and one.changes["curves"]]
    sent = searches(state)["found"]
    values = {row["name"]: row["found"] for row in sent["rows"]}
    damping = next(x for name, x in values.items() if "damping" in name)
    assert damping == pytest.approx(0.05, rel=0.1)
    assert values["q.rod"] == pytest.approx(1.2, abs=0.01)
    assert searches(state)["curves"][0]["data"]["t"]
    used = after(state, do.UseFound(ME))
    assert used.model.body("rod").q[0] == pytest.approx(1.2, abs=0.01)
    assert len(used.undo) == len(state.undo) + 1
    assert searches(used)["found"]["stale"]
    assert after(used, do.Undo(ME)).model == state.model


def test_numbers_have_the_units_of_their_joints_and_fields():
    slider = pg.Body(name="slider", joint="prismatic", axes=[(1, 0, 0)], damping=2.0, q=[0.1])
    free = pg.Body(name="free", joint="free", com=(0.1, 0, 0))
    servos = [pg.Servo(name=f"of {n}", body=n, kp=1.0, kd=1.0) for n in ("rod", "slider")]
    model = pendulum()
    for part in (slider, free, *servos):
        model = model.add(part)
    model = model.replace(parameters={"half": 0.5})
    units = {row["name"]: row["unit"] for row in choices(listed(begun(model)))["numbers"]}
    wanted = {
        "half": "", "q.rod": "rad", "q.slider": "m", "bodies.rod.mass": "kg",
        "bodies.rod.com.2": "m", "bodies.rod.damping": "N m s/rad",
        "bodies.slider.damping": "N s/m", "forces.of rod.kp": "N m/rad",
        "forces.of slider.kp": "N/m", "bodies.free.com.0": "m",
    }  # fmt: skip
    assert wanted.items() <= units.items()


def test_the_least_of_a_goal_keeps_its_limits():
    state = begun(pendulum())
    for event in (
        do.AskSearch(ME, "optimise"), do.SetGoal(ME, 1, "way", "peak"),
        do.SetGoal(ME, 2, "signal", "v.rod"), do.FreeNumber(ME, "q.rod", True),
        do.SetLimit(ME, 3, 0, "signal", "rod"), do.SetLimit(ME, 4, 0, "way", "max"),
        do.SetLimit(ME, 5, 0, "low", "0.5"),
    ):  # fmt: skip
        state = after(state, event)
    assert state.searching.limits == (("max", "rod", 0.5, None),)
    state, _ = searched(state)
    (row,) = searches(state)["found"]["rows"]
    assert row["found"] == pytest.approx(0.5, abs=1e-3)
    assert searches(state)["found"]["notes"]


def test_numbers_are_ranked_by_how_far_they_move_a_curve():
    state = begun(pendulum(damping=0.001))
    state = after(state, do.AskSearch(ME, "matters"), do.SetGoal(ME, 1, "signal", "rod"))
    names = [
        one["name"] for one in choices(listed(state))["numbers"] if "gravity" not in one["name"]
    ]
    for name in names:
        state = after(state, do.FreeNumber(ME, name, True))
    state, _ = searched(state)
    rows = searches(state)["found"]["rows"]
    assert [row["share"] for row in rows] == sorted((r["share"] for r in rows), reverse=True)
    place = {row["name"]: k for k, row in enumerate(rows)}
    damping = next(name for name in place if "damping" in name)
    assert place["q.rod"] < place[damping]


@pytest.mark.parametrize("kind", ["fit", "optimise", "matters"])
def test_a_search_runs_as_the_page_would_also_in_a_scenario(kind, monkeypatch):
    """Method, step and duration that were typed for a scenario hold for a search in it, too."""
    model = pendulum().add(pg.Scenario(name="swing", t_end=1.5))
    state = after(begun(model), do.SetRun(ME, 1, "method", "rk4"), do.SetRun(ME, 2, "step", "0.02"))
    state = after(state, do.SetRun(ME, 3, "t_end", "0.5"), do.AskSearch(ME, kind))
    assert state.request.scenario == "swing"
    state = after(state, do.SetGoal(ME, 4, "signal", "rod"), do.FreeNumber(ME, "q.rod", True))
    if kind == "fit":
        state = after(state, do.OpenData(ME, "swing.csv", curves()))
        state = after(state, do.MatchColumn(ME, 5, "angle", "rod"))
    runs, drawn = [], work_of_search.drawn
    monkeypatch.setattr(
        work_of_search, "drawn", lambda asked, run: runs.append(run) or drawn(asked, run)
    )
    state, _ = searched(state)
    header = runs[-1].header
    assert (header["method"], header["step"], header["scenario"]) == ("rk4", 0.02, "swing")
    assert header["t_end"] == (T[-1] if kind == "fit" else 0.5)


def test_a_search_is_cancelled_with_its_best():
    state = begun(pendulum(damping=0.2))
    state = after(
        state, do.OpenData(ME, "swing.csv", curves()), do.MatchColumn(ME, 1, "angle", "rod"),
        do.FreeNumber(ME, "q.rod", True), do.StartSearch(ME),
    )  # fmt: skip
    heard, done = [], threading.Event()

    def send(event):
        heard.append(event)
        done.set()

    searcher = Worker(Search, Search.work, send)
    cancelled = after(state, do.CancelSearch(ME))
    searcher.render(state, cancelled)
    assert done.wait(LIMIT)
    while not isinstance(heard[-1], (do.Done, do.Failed)):
        done.clear()
        assert done.wait(LIMIT)
    assert after(cancelled, *heard).search is None


@pytest.mark.parametrize(
    "events",
    [
        (),
        (do.FreeNumber(ME, "q.rod", True),),
        (do.AskSearch(ME, "optimise"), do.FreeNumber(ME, "q.rod", True)),
        (do.OpenData(ME, "x.csv", "t,angle\n0,1\n1,what"),),
        (do.OpenData(ME, "x.csv", "angle\n0\n1"),),
        (do.OpenData(ME, "x.csv", "t,angle\n0,1\n1"),),
        (do.OpenData(ME, "x.csv", ""),),
    ],
)
def test_what_is_missing_is_said(events):
    state = after(begun(pendulum()), *events, do.StartSearch(ME))
    assert state.search is None
    assert state.search_problem


def test_bounds_stay_in_order():
    state = after(begun(pendulum()), do.FreeNumber(ME, "q.rod", True))
    state = after(state, do.BoundNumber(ME, 7, "q.rod", "low", "5"))
    assert state.clients[ME].reply.text
    state = after(state, do.BoundNumber(ME, 8, "q.rod", "low", "-2"))
    assert state.searching.free[0].low == -2.0
    assert not state.clients[ME].reply.text


def test_long_curves_are_read_in_a_child_process():
    """Reading them would hold up the edits of all pages."""
    text = "t,1\n" + "\n".join(f"{k},{k / 7}" for k in range(40_000))
    state = begun(pendulum())
    now = after(state, do.OpenData(ME, "long.csv", text))
    (errand,) = now.errands
    assert errand.apart
    assert now.searching.data == {}
    done = after(now, answer(errand))
    assert (done.searching.file, len(done.searching.data["t"])) == ("long.csv", 40_000)
    assert done.errands == ()
    damaged = after(state, do.OpenData(ME, "x.csv", "t,1\n0," + "1" * 200_000))
    damaged = after(damaged, answer(*damaged.errands))
    assert "x.csv" in damaged.search_problem


def test_a_column_measures_the_curve_of_its_name_unless_another_is_chosen():
    state = after(begun(pendulum()), do.OpenData(ME, "swing.csv", curves().replace("angle", "rod")))
    assert searches(listed(state))["columns"] == [["rod", "rod"]]
    state = after(state, do.MatchColumn(ME, 1, "rod", ""))
    assert searches(listed(state))["columns"] == [["rod", ""]]


def test_a_curve_that_the_runs_no_longer_have_is_named():
    state = after(
        begun(pendulum()), do.AskSearch(ME, "matters"), do.SetGoal(ME, 1, "signal", "rod"),
        do.EditBodies(ME, 2, ("rod",), "name", (((), "bar"),)),
        do.FreeNumber(ME, "bodies.bar.mass", True),
    )  # fmt: skip
    state, _ = searched(state)
    assert state.found is None
    assert "'rod'" in state.search_problem


def test_the_thread_of_the_pages_only_draws_what_is_listed(monkeypatch):
    """Listing the numbers and curves of a large model takes a third of a second."""
    state = after(begun(pendulum()), do.Sees(ME, "search", True))
    assert Choices.wanted(state)
    known = listed(state)
    edited = after(known, do.EditBodies(ME, 1, ("rod",), "mass", (((), "2"),)))
    for each in ("choices_of", "numbers_of", "signals_of"):
        monkeypatch.setattr(work_of_search, each, None)
    assert searches(state)["waits"]
    assert choices(state)["numbers"] == []
    assert not searches(known)["waits"]
    assert searches(edited)["waits"]
    assert choices(edited) == choices(known)
    assert not Choices.wanted(after(state, do.Sees(ME, "search", False)))


def fitted(text, signal="rod"):
    """Return the state after a fit of the damping to a file with a column 'angle'."""
    state = after(begun(pendulum(damping=0.2, q=[1.2])), do.OpenData(ME, "swing.csv", text))
    (column,) = state.searching.match
    state = after(state, do.MatchColumn(ME, 1, column, signal))
    state = after(state, do.FreeNumber(ME, "bodies.rod.damping", True))
    return searched(state)[0]


def in_degrees(text, title="angle [deg]"):
    head, *rows = text.splitlines()
    pairs = [row.split(",") for row in rows]
    return "\n".join(
        [head.replace("angle", title), *(f"{t},{np.degrees(float(x)):.9g}" for t, x in pairs)]
    )


def test_the_unit_in_the_head_of_a_file_is_that_of_its_numbers():
    """Degrees were read as radians: 'converged', with a damping of 0.0033 in place of 0.037."""
    plain, degrees = fitted(curves()), fitted(in_degrees(curves()))
    assert searches(degrees)["columns"] == [["angle [deg]", "rod"]]
    rows = [searches(state)["found"]["rows"][0]["found"] for state in (plain, degrees)]
    assert rows[1] == pytest.approx(rows[0], rel=1e-4)
    shown = searches(degrees)["curves"][0]
    np.testing.assert_allclose(shown["data"]["y"][0], shown["y"][0], atol=0.01)
    found = searches(degrees)["found"]
    assert "explains 100 %" in found["title"]
    assert any("rad" in note for note in found["notes"])


def test_a_unit_of_another_kind_is_refused():
    state = fitted(in_degrees(curves(), "angle [mm]"))
    assert state.found is None
    assert all(word in state.search_problem for word in ("mm", "rad"))


def test_a_fit_whose_residuals_are_of_the_size_of_the_data_is_called_bad():
    found = searches(fitted(in_degrees(curves(), "angle")))["found"]
    assert found["title"].startswith("Bad fit")


def test_a_damping_of_zero_is_offered_and_found():
    """One had to guess a value first: the list was empty."""
    state = after(begun(pendulum(damping=0.0)), do.OpenData(ME, "swing.csv", curves()))
    assert state.model.body("rod").damping == (0.0,)
    (path,) = (p for p in listed(state).choices.found.numbers if "damping" in p)
    state = after(state, do.MatchColumn(ME, 1, "angle", "rod"), do.FreeNumber(ME, path, True))
    assert (state.searching.free[0].low, state.searching.free[0].high) == (0.0, 1.0)
    (row,) = searches(searched(state)[0])["found"]["rows"]
    assert (row["before"], row["found"]) == (0.0, pytest.approx(0.05, rel=0.1))
