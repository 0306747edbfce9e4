"""Motion capture on the page: trials, their fit and moments, and scaling that can be undone."""

import base64

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.capture import view
from pgraph_app.core.edit import with_model

from .store import ME, after, answered, begun, do, notice, reply

T = np.arange(40) / 100
ANGLE = 0.5 * np.sin(4 * T)
SITES = {"hand": (0.4, 0, 0), "elbow": (0.1, 0.03, 0), "wrist": (0.3, 0, 0.04)}


def arm(**changes):
    """An arm that a hinge holds, with three sites."""
    body = pg.Body(name="arm", axes=(0, 1, 0), mass=2, com=(0.2, 0, 0), inertia=(0.01, 0.05, 0.05))
    sites = [pg.Site(name=name, body="arm", point=x) for name, x in SITES.items()]
    return pg.Model(name="arm", bodies=[body], sites=sites).replace(**changes)


def places(name: str, size: float = 1.0) -> np.ndarray:
    """The places (n, 3) of a site during the motion ANGLE [m]."""
    x, y, z = size * np.array(SITES[name])
    c, s = np.cos(ANGLE), np.sin(ANGLE)
    return np.stack((c * x + s * z, np.full(len(T), y), -s * x + c * z), 1)


def table(columns: dict[str, np.ndarray]) -> str:
    """Text of a table with a column of times."""
    head = ",".join(("t", *columns))
    rows = zip(T, *columns.values())
    return "\n".join([head, *(",".join(f"{x:.9g}" for x in row) for row in rows)])


def markers(size: float = 1.0, off: float = 0.0, **more: str) -> str:
    """A trial of the arm, whose hand is off by a distance [m]. `more` renames its markers."""
    columns = {}
    for name in SITES:
        x = places(name, size) + np.array([0, off if name == "hand" else 0, 0])
        columns |= {f"{more.get(name, name)}.{axis}": x[:, k] for k, axis in enumerate("xyz")}
    return table(columns)


def plates() -> str:
    """A plate that pushes the arm up at its hand."""
    hand = places("hand")
    force = np.tile([0.0, 0.0, 30.0], (len(T), 1))
    both = {"force_v": force, "force_p": hand}
    return table({f"{k}{axis}": x[:, i] for k, x in both.items() for i, axis in enumerate("xyz")})


def opened(state, text: str, name: str = "swing.csv"):
    """The state after a file was opened."""
    content = base64.b64encode(text.encode()).decode()
    return answered(state, do.OpenTrial(ME, name, content))


def done(state, event):
    """The state after a job has ended."""
    state = after(state, event)
    job = state.fitting or state.computing
    return after(state, do.Done(job.id, job.work(lambda *news: True)))


def test_a_fit_is_played_in_place_of_a_run_and_names_the_worst_marker():
    state = done(opened(begun(arm()), markers(off=0.003)), do.FitPose(ME))
    state = after(state, do.Scrub(ME, 0.2))
    assert state.pose.q[0] == pytest.approx(ANGLE[20], abs=1e-6)  # the error is along the hinge
    told = view.capture(state)
    assert "worst is hand with 3 mm" in told["fit"]["found"]["title"]
    assert told["sites"][0]["name"] == "hand"
    assert told["sites"][0]["most"] == pytest.approx(3)
    assert (state.t_start, state.t_end, state.instead) == (0.0, T[-1], "swing.csv")
    state = after(state, do.StepFrames(ME, 1))
    assert state.playback.time == pytest.approx(0.21)
    assert after(state, do.Play(ME)).playback.playing  # it computes no run


def test_the_next_run_takes_the_place_of_the_trial_which_comes_back_on_request():
    state = done(opened(begun(arm()), markers()), do.FitPose(ME))
    asked = after(state, do.Simulate(ME))
    run = pg.simulate(arm(), t_end=0.01)
    state = after(asked, do.Done(asked.job.id, run))
    assert state.run.result is run
    assert state.t_end == 0.01
    assert not state.instead
    assert len(view.missed(state, {"hand": np.zeros(3)})) == 0  # these distances are of the fit
    state = after(state, do.ShowTrial(ME))
    assert state.run is None
    assert state.t_end == T[-1]
    assert after(state, do.CloseTrial(ME)).run.result is run


@pytest.mark.parametrize("order", [(markers, plates), (plates, markers)])
def test_files_with_markers_and_with_plates_complete_each_other_in_any_order(order):
    state = opened(opened(begun(arm()), order[0](), "a.csv"), order[1](), "b.csv")
    assert len(state.take.trial.markers) == 3
    assert len(state.take.trial.plates) == 1
    names = dict(zip(order, ("a.csv", "b.csv")))
    assert [name for name, _ in state.take.files] == [names[markers], names[plates]]
    state = opened(state, markers(), "c.csv")  # other markers, with these plates
    assert [name for name, _ in state.take.files] == ["c.csv", names[plates]]


def test_plates_alone_have_no_motion_and_say_what_is_missing():
    state = opened(begun(arm()), plates())
    assert "markers" in view.capture(state)["missing"]


def test_markers_of_other_names_are_matched_by_hand_and_follow_a_renamed_site():
    state = opened(begun(arm()), markers(hand="RHAN"))
    told = view.capture(state)
    assert told["spare"] == "RHAN"
    assert told["sites"][-1]["name"] == "hand"
    state = after(state, do.MatchMarker(ME, 1, "hand", "RHAN"))
    assert reply(state) == ""
    assert view.capture(state)["spare"] == ""
    assert [row["label"] for row in view.capture(state)["sites"] if row["name"] == "hand"] == [
        "RHAN"
    ]
    sites = [s.model_copy(update={"name": "palm"}) if s.name == "hand" else s
             for s in state.model.sites]  # fmt: skip
    state = answered(state, do.WeighMarker(ME, 2, "hand", "3"))
    state = with_model(state, state.model.replace(sites=sites), "rename")
    assert state.take.label("palm") == "RHAN"
    assert state.take.weights == {"palm": 3.0}
    state = after(state, do.MatchMarker(ME, 3, "palm", ""))
    state = done(state, do.FitPose(ME))
    assert state.fitted.motion.markers == ("elbow", "wrist")


@pytest.mark.parametrize(
    ("event", "names"),
    [
        (lambda: do.WeighMarker(ME, 1, "hand", "-1"), ("weight", "-1", "0")),
        (lambda: do.MatchMarker(ME, 1, "hand", "nose"), ("marker", "nose")),
        (lambda: do.SetCutoff(ME, 1, "0"), ("cut-off", "0 Hz")),
        (lambda: do.SetMass(ME, 1, "-3"), ("mass", "-3")),
        (lambda: do.SetPlate(ME, 1, "floor", "arm"), ("plate", "floor")),
    ],
)
def test_a_refused_cell_says_why(event, names):
    before = opened(begun(arm()), markers())
    state = after(before, event())
    assert state.take == before.take
    assert all(name in reply(state) for name in names), reply(state)


def test_a_file_that_is_no_trial_leaves_the_one_before_and_says_why():
    before = opened(begun(arm()), markers())
    state = opened(before, "t,a\n1,x", "bad.csv")
    assert state.take is before.take
    assert "bad.csv was not opened" in notice(state)
    assert "line 2 has 'x'" in notice(state)


def test_scaling_is_one_step_and_undoing_it_brings_the_fit_back():
    state = done(opened(begun(arm()), markers(size=1.25)), do.FitPose(ME))
    fitted = state.following
    state = answered(state, do.ProposePairs(ME), do.SetMass(ME, 1, "3"), do.ScaleModel(ME))
    assert state.take.pairs == (("arm", "hand", "elbow"),)
    assert state.model.bodies[0].com[0] == pytest.approx(0.25)
    assert state.model.bodies[0].mass == pytest.approx(3)
    assert len(state.undo) == 1
    assert state.following is None
    assert view.capture(state)["fit"]["found"]["stale"]
    again = done(state, do.FitPose(ME))
    assert again.fitted.motion.residual.max() < 1e-6  # nine digits in the file
    state = after(state, do.Undo(ME))
    assert state.following is fitted
    assert state.model.bodies[0].mass == 2


def test_scaling_without_a_pair_says_what_to_choose():
    state = answered(opened(begun(arm()), markers()), do.ScaleModel(ME))
    assert "Choose two sites" in notice(state)
    assert not state.undo


def test_moments_have_bands_and_are_downloaded_as_a_table():
    noise = np.random.default_rng(0).normal(0, 0.001, (len(T), 3))
    text = markers()
    rows = [row.split(",") for row in text.splitlines()]
    for row, more in zip(rows[1:], noise):
        row[1:4] = [str(float(x) + y) for x, y in zip(row[1:4], more)]
    state = opened(begun(arm()), "\n".join(map(",".join, rows)))
    state = done(opened(state, plates(), "plates.csv"), do.FitPose(ME))
    state = after(state, do.SetPlate(ME, 1, "force", "arm"), do.SetCutoff(ME, 2, "8"))
    state = done(state, do.ComputeMoments(ME))
    found = view.capture(state)["moments"]["found"]
    (curve,) = found["curves"]
    assert curve["name"] == "arm"
    assert curve["unit"] == "N m"
    assert len(curve["y"]) == len(T)
    assert all(a < b for a, b in zip(curve["low"], curve["high"]))
    middle = (
        np.add(curve["low"], curve["high"]) / 2
    )  # of the motion, and the curve its filtered one
    assert np.abs(middle - curve["y"]).mean() < 0.2 * np.ptp(curve["y"])
    assert any("bears arm" in note for note in found["notes"])
    assert view.table(state, "moments").startswith("t [s],arm [N m],arm.low [N m]")
    assert view.table(state, "fit").startswith("t [s],arm [rad]")
    state = done(after(state, do.SetPlate(ME, 3, "force", "")), do.ComputeMoments(ME))
    (free,) = view.capture(state)["moments"]["found"]["curves"]
    lifted = np.subtract(curve["y"], free["y"])  # what 30 N at the hand take from the hinge
    assert lifted == pytest.approx(30 * 0.4 * np.cos(ANGLE), abs=1e-6)


def test_a_cancelled_fit_says_so_and_its_late_result_is_dropped():
    state = after(opened(begun(arm()), markers()), do.FitPose(ME))
    job = state.fitting
    state = after(state, do.CancelFit(ME), do.Done(job.id, job.work(lambda *news: True)))
    assert state.fitted is None
    assert state.fit_problem == "The fit was cancelled."


def test_coordinates_of_a_table_are_a_motion_without_a_fit():
    state = done(opened(begun(arm()), table({"arm": ANGLE})), do.FitPose(ME))
    assert after(state, do.Scrub(ME, 0.1)).pose.q[0] == pytest.approx(ANGLE[10])
    state = done(state, do.ComputeMoments(ME))
    found = view.capture(state)["moments"]
    assert found["no_band"]
    assert found["found"]["curves"][0]["low"] is None


def test_markers_are_drawn_between_frames_and_not_beyond_the_trial():
    trial = opened(begun(arm()), markers()).take.trial
    middle = (places("hand")[3] + places("hand")[4]) / 2
    assert view.marker_at(trial, "hand", (T[3] + T[4]) / 2) == pytest.approx(middle, abs=1e-8)
    assert not np.isfinite(view.marker_at(trial, "hand", 1.0)).any()
