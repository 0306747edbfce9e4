"""What a new user does with a run: print it, ask for a time or a joint, make a table, copy it."""

from __future__ import annotations

import copy
import csv
import io
import pickle
import subprocess
import sys

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models

from .test_cases import DOWN, mass


def double_pendulum():
    return pg.Model.load(pgraph_models.path("double_pendulum"))


def tumbling():
    inertia = np.diag([0.1, 0.2, 0.25])
    body = pg.Body(name="box", joint="free", mass=1.0, inertia=inertia, v=(1, 3.0, 0.2, 0.4, 0, 1))
    ball = pg.Body(
        name="ball", parent="box", joint="spherical", mass=0.3, com=(0, 0, 1), inertia=inertia
    )
    return pg.Model(bodies=(body, ball))


@pytest.fixture(scope="module")
def run():
    return pg.simulate(double_pendulum(), t_end=2.0, method="dop853", rtol=1e-11)


# -- a model in place of a mechanism ---------------------------------------------------------------


def test_a_model_is_simulated_as_its_mechanism():
    model = double_pendulum()
    mine, theirs = pg.simulate(model, t_end=0.1), pg.simulate(pg.Mechanism(model), t_end=0.1)
    np.testing.assert_array_equal(mine.q, theirs.q)


@pytest.mark.parametrize("given", ["double_pendulum.json", None, 3, {"bodies": ()}])
def test_other_things_than_models_are_refused_in_a_sentence(given):
    with pytest.raises(pg.InputError, match=r"pg\.Mechanism or a pg\.Model"):
        pg.simulate(given)


def test_the_name_of_a_file_is_answered_with_how_to_read_it():
    with pytest.raises(pg.InputError, match=r"Model\.load\('arm\.json'\)"):
        pg.simulate("arm.json")


# -- plans are kept --------------------------------------------------------------------------------


def test_a_second_run_gives_the_same_bits_as_the_first():
    for options in ({}, {"method": "rk4"}, {"method": "semi_implicit_euler"}, {"rtol": 1e-6}):
        mech = pg.Mechanism(double_pendulum())
        first, second = (pg.simulate(mech, t_end=0.2, **options) for _ in range(2))
        np.testing.assert_array_equal(first.q, second.q)
        assert first.error_estimate == second.error_estimate
        assert first.header == second.header


def test_the_method_is_chosen_for_the_state_of_each_run():
    """A kept plan is not used for a state at which another method suits."""
    body = mass("a", stiffness=2e4)
    mech = pg.Mechanism(pg.Model(bodies=(body, mass("b", "a", above=1.0)), **DOWN))
    slow, fast = np.zeros(2), np.array([0.0, 5e4])
    options = {"t_end": 0.02, "step": 1e-3}
    known = [pg.simulate(mech, slow, v, **options).header["method"] for v in (slow, fast, slow)]
    fresh = [
        pg.simulate(pg.Mechanism(mech.model), slow, v, **options).header["method"]
        for v in (slow, fast, slow)
    ]
    assert known == fresh


def test_options_that_are_equal_but_of_another_type_are_checked_again():
    mech = pg.Mechanism(double_pendulum())
    pg.simulate(mech, t_end=1.0, max_steps=1_000_000)
    with pytest.raises(pg.InputError, match="t_end"):
        pg.simulate(mech, t_end=True, max_steps=1_000_000)


# -- how it prints ---------------------------------------------------------------------------------


def test_a_result_prints_as_a_line(run):
    text = repr(run)
    assert len(text.splitlines()) == 1
    assert all(part in text for part in ("1001 frames", "0 to 2 s", "dop853"))


def test_a_printed_result_shows_its_notices():
    heavy = pg.Body(name="b", mass=3.0, com=(0.1, 0, 0), axes=(0, 1, 0))
    run = pg.simulate(pg.Model(bodies=[heavy]), t_end=0.1)
    assert "1 notice" in repr(run)
    assert str(run).splitlines() == [repr(run), f"  notice: {run.notices[0]}"]


def test_a_result_that_failed_prints_why():
    failed = pg.simulate(double_pendulum(), t_end=5.0, method="dopri5", max_steps=20)
    assert failed.message in repr(failed)
    assert len(repr(failed).splitlines()) == 2


# -- states in between -----------------------------------------------------------------------------


def test_a_number_gives_a_state_and_an_array_gives_states(run):
    q, v, error = run.at(0.37)
    assert (q.shape, v.shape) == ((2,), (2,))
    assert isinstance(error, float)
    many_q, many_v, errors = run.at([0.1, 0.37])
    assert (many_q.shape, many_v.shape, errors.shape) == ((2, 2), (2, 2), (2,))
    np.testing.assert_array_equal(many_q[1], q)


def test_recorded_times_give_recorded_states(run):
    q, v, error = run.at(run.t)
    np.testing.assert_array_equal(q, run.q)
    np.testing.assert_array_equal(v, run.v)
    np.testing.assert_allclose(error, run.error_estimate)


@pytest.mark.parametrize("frames", [21, 101, 1001])
@pytest.mark.parametrize("method", ["dop853", "rk4", "radau5"])
@pytest.mark.parametrize("model", [double_pendulum, tumbling])
def test_the_error_between_frames_is_estimated(model, method, frames):
    """It is no quarter of the true one, and no more than a hundred times that plus rounding."""
    mech = pg.Mechanism(model())
    t = np.linspace(0.0, 2.0, 457)
    fine = pg.simulate(mech, t_end=2.0, t_eval=t, method="dop853", rtol=1e-13)
    options = {"step": 1e-3} if method == "rk4" else {"rtol": 1e-9}
    done = pg.simulate(mech, t_end=2.0, frames=frames, method=method, **options)
    q, v, error = done.at(t)
    true = np.abs(q - fine.q).max(axis=1)
    assert true.max() < 4 * error.max() + 1e-12
    assert error.max() < 200 * true.max() + 1e-11
    assert np.abs(v - fine.v).max() < 1e4 * error.max() + 1e-9


def test_an_impact_between_frames_is_in_the_error():
    """A ball on hard ground, its bounce within an interval."""
    ball = pg.Body(name="ball", joint="free", q=(0, 0, 0.5, 1, 0, 0, 0), mass=1.0)
    floor = pg.Contact(
        name="floor", body="ball", law="complementarity", points=((0, 0, 0),), restitution=0.8
    )
    mech = pg.Mechanism(pg.Model(bodies=(ball,), contacts=(floor,)))
    fine = pg.simulate(mech, t_end=0.6, method="dop853", frames=4001)
    done = pg.simulate(mech, t_end=0.6, method="dop853", frames=31)
    q, _, error = done.at(fine.t)
    true = np.abs(q - fine.q).max(axis=1)
    assert true.max() > 1e-3
    assert (true <= error + 1e-9).all()


@pytest.mark.parametrize("t", [-0.1, 2.1, [0.5, 2.5], np.nan, "now", [[0.1]], True, [False]])
def test_times_outside_of_the_run_are_refused(run, t):
    with pytest.raises(pg.InputError, match=r"run\.at"):
        run.at(t)


# -- joints by name --------------------------------------------------------------------------------


def test_poses_are_those_of_the_whole_motion_and_ask_for_no_force(monkeypatch):
    def no_force(*_):
        raise AssertionError("a force was asked for")

    push = pg.Wrench(name="push", body="ball", force=(0.0, 1.0, 2.0))
    whole, alone = (
        pg.simulate(tumbling(), t_end=0.1, step=1e-2, method="rk4", forces=[push]) for _ in range(2)
    )
    motion = whole.body_motion
    assert whole.body_pose is motion.pose
    with monkeypatch.context() as patched:
        patched.setattr("pgraph_core.result.result.load_wrenches", no_force)
        assert alone.body_pose.tobytes() == motion.pose.tobytes()
    assert alone.body_motion == motion
    assert alone.body_motion.pose is alone.body_pose


def test_a_joint_is_asked_for_by_name(run):
    name = run.mechanism.names[1]
    np.testing.assert_array_equal(run[name], run.q[:, 1])
    done = pg.simulate(tumbling(), t_end=0.1)
    assert done["ball"].shape == (len(done.t), 4)
    assert done["box"].shape == (len(done.t), 7)


def test_an_unknown_joint_is_answered_with_near_names(run):
    name = run.mechanism.names[1]
    with pytest.raises(pg.InputError, match=f"did you mean '{name}'"):
        run[name + "x"]


def test_a_welded_body_has_no_coordinates():
    model = pg.Model(bodies=(mass("a"), pg.Body(name="lid", parent="a", joint="weld", mass=1.0)))
    with pytest.raises(pg.InputError, match="no coordinate"):
        pg.simulate(model, t_end=0.01)["lid"]


# -- tables and copies -----------------------------------------------------------------------------


def test_the_table_has_the_columns_of_the_csv(run):
    frame = pytest.importorskip("pandas") and run.to_pandas()
    units = frame.attrs["units"]
    names = [frame.index.name, *frame.columns]
    assert run.to_csv().splitlines()[0].split(",") == [f"{c} [{units[c]}]" for c in names]
    np.testing.assert_array_equal(frame.index, run.t)
    late = frame.loc[frame["t"] > 0.1]
    np.testing.assert_array_equal(late["time"], late.index)
    assert frame.set_index("t").equals(frame)


@pytest.mark.parametrize(
    ("name", "column"),
    [
        ("upper", "upper"), ("q.upper", "upper"), ("v upper", "v.upper"),
        ("kinetic energy [J]", "kinetic_energy"), ("total_energy", "energy"),
    ],
)  # fmt: skip
def test_a_name_means_a_column(run, name, column):
    frame = pytest.importorskip("pandas") and run.to_pandas()
    np.testing.assert_array_equal(frame[name], frame.loc[:, column])


def test_a_joint_s_name_means_all_its_columns_and_a_wrong_one_is_answered(tmp_path):
    pd = pytest.importorskip("pandas")
    body = pg.Body(name="energy", joint="free", mass=1.0)  # the name of a column
    still = pg.Body(name="post", joint="weld")
    out = pg.Output(name="spin", kind="gyro", at="energy")
    run = pg.simulate(pg.Model(bodies=[body, still], outputs=[out]), t_end=0.1, v=[1.0] * 6)
    frame = run.to_pandas()
    np.testing.assert_array_equal(frame["q.energy"], run.q[:, :])
    np.testing.assert_array_equal(frame["q"], run.q)
    np.testing.assert_array_equal(frame["v.energy"], run.v)
    np.testing.assert_array_equal(frame["energy"], run.energy)
    np.testing.assert_array_equal(frame["spin"], run.outputs["spin"])
    for wrong, right in (
        ("post", "q.energy.0"),
        ("spni", "spin"),
        ("spin.w", "spin.z, spin.y, spin.x"),
    ):
        with pytest.raises(KeyError, match=f"no column '{wrong}'.*{right}"):
            frame[wrong]
    again = pickle.loads(pickle.dumps(frame))
    assert type(again) is pd.DataFrame
    assert frame.equals(again)
    assert again.attrs == frame.attrs


@pytest.mark.parametrize("way", [copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_a_copy_answers_as_the_run_does(run, way):
    other = way(run)
    np.testing.assert_array_equal(other.at(0.123)[0], run.at(0.123)[0])
    np.testing.assert_array_equal(other.body_pose, run.body_pose)
    assert repr(other) == repr(run)


def test_a_pendulum_loads_no_contact_kernel_and_no_gait():
    """A fresh process that simulates a pendulum imports what it needs."""
    code = (
        "import sys, pgraph_core as pg; "
        "pg.simulate(pg.Model(bodies=[pg.Body(name='a', mass=1.0, tip=(1, 0, 0))]), t_end=0.01); "
        "print([m for m in sys.modules if m.startswith(('pgraph_core.engine.contact', "
        "'pgraph_core.contact', 'pgraph_core.gait', 'pgraph_core.study'))])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_columns_of_bodies_whose_names_look_like_columns_stay_apart():
    bodies = [
        pg.Body(name="b", joint="universal", v=(1, 2)), pg.Body(name="b.0", v=(3,)),
        pg.Body(name="v.b.0", v=(4,)),
    ]  # fmt: skip
    run = pg.simulate(pg.Model(bodies=bodies, gravity=(0, 0, 0)), t_end=0.1)
    columns = run.columns()
    assert len(columns) == 1 + 3 * 4 + 5
    for name, column in (("b.0", "v.b.0"), ("v.b.0", "v.v.b.0")):
        np.testing.assert_array_equal(columns[column], run.v[:, run.mechanism.joints[name].v][:, 0])
    np.testing.assert_array_equal(columns["q.v.b.0"], run["v.b.0"])


def test_a_run_gives_its_columns_by_name(run):
    np.testing.assert_array_equal(run["v.lower"], run.v[:, 1])
    np.testing.assert_array_equal(run["total energy"], run.energy)
    with pytest.raises(pg.InputError, match=r"run\.v"):
        run["v"]


# -- names that meet ---------------------------------------------------------------------------


def test_a_body_called_like_a_column_keeps_its_own():
    """No column is lost, whatever bodies are called."""
    paw = pg.Body(name="contact_gap.paw", tip=(1, 0, 0), q=0.25)
    floor = pg.Contact(name="paw", body="contact_gap.paw", points=[(1, 0, 0)])
    model = pg.Model(bodies=[paw, pg.Body(name="phases.paw", q=0.5)], contacts=[floor])
    columns = pg.simulate(model, t_end=0.01, estimate=False).columns()
    assert columns["q.contact_gap.paw"][0] == 0.25
    assert columns["q.phases.paw"][0] == 0.5
    assert columns["contact_gap.paw"].shape == columns["t"].shape


def test_no_head_of_a_csv_is_a_formula():
    name = "=cmd('calc')"
    run = pg.simulate(pg.Model(bodies=[pg.Body(name=name, tip=(1, 0, 0))]), t_end=0.01)
    heads = next(csv.reader(io.StringIO(run.to_csv())))
    assert f"'{name} [rad]" in heads
    assert not [head for head in heads if head[0] in "=+-@"]


def test_a_plot_takes_no_name_for_mathematics():
    pytest.importorskip("matplotlib")
    name = r"a $\frac{ $ b"
    run = pg.simulate(pg.Model(name=name, bodies=[pg.Body(name="_a", tip=(1, 0, 0))]), t_end=0.01)
    shown = run.plot("_a")
    shown.canvas.draw()
    assert [text.get_text() for text in shown.axes[0].get_legend().get_texts()] == ["_a"]


def test_a_table_with_its_time_as_index_again_is_a_copy():
    pytest.importorskip("pandas")
    run = pg.simulate(double_pendulum(), t_end=0.01, estimate=False)
    table = run.to_pandas()
    other = table.set_index("t")
    other["x"] = 0.0
    assert "x" not in table
    assert table.set_index("t", inplace=True) is None


def oscillator(hertz: float, damping: float = 0.0) -> pg.Model:
    """1 kg on a spring along x, released 0.1 m from its rest."""
    body = pg.Body(
        name="x", joint="prismatic", axes=(1, 0, 0), mass=1.0, q=0.1,
        stiffness=(2 * np.pi * hertz) ** 2, damping=damping,
    )  # fmt: skip
    return pg.Model(bodies=(body,), gravity=(0, 0, 0))


def told_of_frames(run: pg.Result) -> str:
    return next((text for text in run.notices if text.startswith("frames are too wide")), "")


def test_an_oscillation_faster_than_frames_is_told():
    """One frame a period: all frames show the same state, though the body moves by 0.2 m."""
    run = pg.simulate(oscillator(10.0), t_end=10.0, frames=101)
    assert np.ptp(run["x"]) < 1e-6
    text = told_of_frames(run)
    assert "'x'" in text
    frames = int(text.split("frames=")[1].split(",")[0])
    finer = pg.simulate(oscillator(10.0), t_end=10.0, frames=frames)
    assert np.ptp(finer["x"]) == pytest.approx(0.2, rel=0.01)
    assert not told_of_frames(finer)


@pytest.mark.parametrize(
    ("model", "options"),
    [
        (oscillator(2.0), {"t_end": 10.0, "frames": 101}),  # five frames a period
        (oscillator(200.0, 800.0), {"t_end": 1.0, "frames": 101}),  # settles before a frame
        (oscillator(500.0, 4400.0), {"t_end": 1.0, "frames": 101}),  # what is left of it swings
        (oscillator(1000.0, 250.0), {"t_end": 10.0}),
        (oscillator(10.0), {"t_end": 10.0, "frames": 2}),  # no curve
        (oscillator(0.0), {"t_end": 10.0, "step": 1e-3, "frames": 101}),  # at rest
    ],
)
def test_frames_that_show_the_motion_are_not_told(model: pg.Model, options: dict):
    assert not told_of_frames(pg.simulate(model, **options))
