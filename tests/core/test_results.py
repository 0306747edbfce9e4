"""Results: printed, read at times and by joints, as tables, copied."""

import csv
import io
import pickle

import numpy as np
import pytest

import pgraph_core as pg

from ..nights import combined
from ..worlds import ball, built_in, on_ground
from .test_cases import DOWN, mass


def double_pendulum():
    return built_in("double_pendulum").model


def tumbling():
    inertia = np.diag([0.1, 0.2, 0.25])
    body = pg.Body(name="box", joint="free", mass=1.0, inertia=inertia, v=(1, 3.0, 0.2, 0.4, 0, 1))
    held = {"parent": "box", "joint": "spherical", "com": (0, 0, 1)}
    ball = pg.Body(name="ball", mass=0.3, inertia=inertia, **held)
    return pg.Model(bodies=(body, ball))


@pytest.fixture(scope="module")
def run():
    return pg.simulate(double_pendulum(), t_end=2.0, method="dop853", rtol=1e-11)


def test_an_option_that_only_equals_one_of_an_earlier_run_is_refused():
    mech = pg.Mechanism(double_pendulum())
    pg.simulate(mech, t_end=1.0)
    with pytest.raises(pg.InputError, match="t_end"):
        pg.simulate(mech, t_end=True)


def test_the_method_is_chosen_for_the_state_of_each_run():
    body = mass("a", stiffness=2e4)
    mech = pg.Mechanism(pg.Model(bodies=(body, mass("b", "a", above=1.0)), **DOWN))
    slow, fast = np.zeros(2), np.array([0.0, 5e4])
    options = {"t_end": 0.02, "step": 1e-3}
    for v in (slow, fast, slow):
        fresh = pg.Mechanism(mech.model)
        known, new = (pg.simulate(m, slow, v, **options).header for m in (mech, fresh))
        assert known["method"] == new["method"]


def test_a_result_prints_its_facts_and_notices(run):
    text = repr(run)
    assert len(text.splitlines()) == 1
    assert all(part in text for part in ("1001 frames", "0 to 2 s", "dop853"))
    failed = pg.simulate(double_pendulum(), t_end=5.0, method="dopri5", max_steps=20)
    assert failed.message in repr(failed)
    heavy = pg.Body(name="b", com=(0.1, 0, 0), axes=(0, 1, 0), rest=(0.5,))
    warned = pg.simulate(pg.Model(bodies=[heavy]), t_end=0.1)
    assert "1 notice" in repr(warned)
    assert warned.notices[0] in str(warned)


def test_states_are_read_at_any_time_of_the_run(run):
    q, v, error = run.at(0.37)
    assert (q.shape, v.shape, type(error)) == ((2,), (2,), float)
    many = run.at([0.1, 0.37])
    assert [x.shape for x in many] == [(2, 2), (2, 2), (2,)]
    np.testing.assert_array_equal(many[0][1], q)
    for found, recorded in zip(run.at(run.t), (run.q, run.v, run.error_at)):
        np.testing.assert_allclose(found, recorded, rtol=1e-15, atol=0)


@pytest.mark.parametrize(
    ("model", "method", "frames"),
    combined([double_pendulum, tumbling], ["dop853", "rk4", "radau5"], [21, 1001]),
)
def test_the_error_between_frames_is_estimated(model, method, frames):
    mech, t = pg.Mechanism(model()), np.linspace(0.0, 2.0, 457)
    fine = pg.simulate(mech, t_end=2.0, t_eval=t, rtol=1e-13)
    options = {"step": 1e-3} if method == "rk4" else {"rtol": 1e-9}
    q, v, error = pg.simulate(mech, t_end=2.0, frames=frames, method=method, **options).at(t)
    true = np.abs(q - fine.q).max()
    assert true < 4 * error.max() + 1e-12
    assert error.max() < 200 * true + 1e-11
    assert np.abs(v - fine.v).max() < 1e4 * error.max() + 1e-9


def test_an_impact_between_frames_is_in_the_error():
    mech = pg.Mechanism(on_ground(ball(place=(0, 0, 0.6)), restitution=0.8))
    fine = pg.simulate(mech, t_end=0.6, method="dop853", frames=4001)
    done = pg.simulate(mech, t_end=0.6, method="dop853", frames=31)
    q, _, error = done.at(fine.t)
    true = np.abs(q - fine.q).max(axis=1)
    assert true.max() > 1e-3
    assert (true <= error + 1e-9).all()


@pytest.mark.parametrize(("frames", "after"), [(2, 0), (3, 1), (4, 1), (11, 9)])
def test_an_impact_at_any_place_of_any_interval_is_in_the_error(frames, after):
    """A mass falls from 1 m to its limit. Until its next impact, its motion has a closed form."""
    kept = {"joint": "prismatic", "axes": (0, 0, 1), "limits": [(0, None)]}
    body = pg.Body(name="b", q=(1.0,), limit_restitution=0.9, **kept)
    mech = pg.Mechanism(pg.Model(bodies=[body]))
    hit = np.sqrt(2 / 9.81)
    for place in np.linspace(0.03, 0.97, 11):
        run = pg.simulate(mech, t_end=hit * (frames - 1) / (after + place), frames=frames)
        t = np.linspace(*run.t[after : after + 2], 50)
        t = t[t < 2.8 * hit]
        q, _, error = run.at(t)
        true = np.where(
            t < hit, 1 - 4.905 * t**2, (0.9 * 9.81 * hit - 4.905 * (t - hit)) * (t - hit)
        )
        assert (np.abs(q[:, 0] - true) <= error + 1e-9).all()


@pytest.mark.parametrize("t", [-0.1, 2.1, [0.5, 2.5], np.nan, "now", [[0.1]], True, [False]])
def test_times_outside_of_the_run_are_refused(run, t):
    with pytest.raises(pg.InputError, match=r"run\.at"):
        run.at(t)


def test_joints_and_columns_are_read_by_name(run):
    name = run.mechanism.names[1]
    np.testing.assert_array_equal(run[name], run.q[:, 1])
    np.testing.assert_array_equal(run["v.lower"], run.v[:, 1])
    np.testing.assert_array_equal(run["total energy"], run.energy)
    done = pg.simulate(tumbling(), t_end=0.1)
    assert [done[x].shape[1] for x in ("ball", "box")] == [4, 7]
    for wrong, words in ((name + "x", f"mean {name}, v.{name}"), ("v", r"run\.v")):
        with pytest.raises(pg.InputError, match=words):
            run[wrong]


def test_the_table_has_the_columns_of_the_csv(run):
    pytest.importorskip("pandas")
    frame = run.to_pandas()
    units = frame.attrs["units"]
    names = [frame.index.name, *frame.columns]
    assert run.to_csv().splitlines()[0].split(",") == [f"{c} [{units[c]}]" for c in names]
    np.testing.assert_array_equal(frame.index, run.t)
    late = frame.loc[frame["t"] > 0.1]
    np.testing.assert_array_equal(late["time"], late.index)
    other = frame.set_index("t")
    assert other.equals(frame)
    other["x"] = 0.0
    assert "x" not in frame
    assert frame.set_index("t", inplace=True) is None
    for name, column in (
        ("upper", "upper"), ("q.upper", "upper"), ("v upper", "v.upper"),
        ("kinetic energy [J]", "kinetic_energy"), ("total_energy", "energy"),
    ):  # fmt: skip
        np.testing.assert_array_equal(frame[name], frame.loc[:, column])


def test_columns_of_bodies_are_the_motion_of_their_frames():
    run = pg.simulate(tumbling(), t_end=0.2)
    arrays = {
        "position": run.body_pose[:, :, :3],
        "velocity": run.body_velocity[:, :, 3:],
        "angular_velocity": run.body_velocity[:, :, :3],
        "acceleration": run.body_acceleration[:, :, 3:],
        "angular_acceleration": run.body_acceleration[:, :, :3],
        "joint_force": run.joint_force[:, :, 3:],
        "joint_torque": run.joint_force[:, :, :3],
    }
    columns, plain = run.columns(bodies=True), run.columns()
    assert len(columns) == len(plain) + 3 * len(arrays) * len(run.mechanism.names)
    for kind, values in arrays.items():
        for k, name in enumerate(run.mechanism.names):
            np.testing.assert_array_equal(run[f"{kind}.{name}"], values[:, k])
            np.testing.assert_array_equal(columns[f"{kind}.{name}.z"], values[:, k, 2])
    assert run.to_csv(bodies=True).partition("\n")[0].count(",") == len(columns) - 1
    with pytest.raises(pg.InputError, match=r"position\.box"):
        run.plot("position.boxx")


def test_a_joint_s_name_means_all_its_columns():
    pd = pytest.importorskip("pandas")
    body = pg.Body(name="energy", joint="free", inertia=(0.01,) * 3)  # the name of a column
    still = pg.Body(name="post", joint="weld")
    out = pg.Output(name="spin", kind="gyro", at="energy")
    run = pg.simulate(pg.Model(bodies=[body, still], outputs=[out]), t_end=0.1, v=[1.0] * 6)
    frame = run.to_pandas()
    expected = {"q.energy": run.q, "q": run.q, "v.energy": run.v, "energy": run.energy}
    for name, values in (expected | {"spin": run.outputs["spin"]}).items():
        np.testing.assert_array_equal(frame[name], values)
    for wrong, right in (("post", "q.energy.0"), ("spni", "spin"), ("spin.w", "spin.z")):
        with pytest.raises(KeyError, match=f"'{wrong}'.*{right}"):
            frame[wrong]
    again = pickle.loads(pickle.dumps(frame))
    assert type(again) is pd.DataFrame
    assert frame.equals(again)
    assert again.attrs == frame.attrs


def test_columns_of_bodies_named_like_columns_stay_apart():
    solid = {"inertia": (0.01, 0.01, 0.01)}
    bodies = [pg.Body(name=name, v=v, **solid) for name, v in (("b.0", 3), ("v.b.0", 4))]
    bodies.insert(0, pg.Body(name="b", joint="universal", v=(1, 2), **solid))
    run = pg.simulate(pg.Model(bodies=bodies, gravity=(0, 0, 0)), t_end=0.1)
    columns = run.columns()
    assert len(columns) == 1 + 3 * 4 + 5
    for name, column in (("b.0", "v.b.0"), ("v.b.0", "v.v.b.0")):
        np.testing.assert_array_equal(columns[column], run.v[:, run.mechanism.joints[name].v][:, 0])
    np.testing.assert_array_equal(columns["q.v.b.0"], run["v.b.0"])
    paw = pg.Body(name="contact_gap.paw", tip=(1, 0, 0), q=0.25, inertia=(0.01,) * 3)
    floor = pg.Contact(name="paw", body="contact_gap.paw", points=[(1, 0, 0)])
    model = pg.Model(
        bodies=[paw, pg.Body(name="phases.paw", q=0.5, inertia=(0.01,) * 3)], contacts=[floor]
    )
    columns = pg.simulate(model, t_end=0.01, estimate=False).columns()
    assert columns["q.contact_gap.paw"][0] == 0.25
    assert columns["q.phases.paw"][0] == 0.5
    assert columns["contact_gap.paw"].shape == columns["t"].shape


@pytest.mark.parametrize("name", ["=cmd('calc')", r"a $\frac{ $ b"])
def test_names_are_neither_formulas_nor_mathematics(name):
    pytest.importorskip("matplotlib")
    model = pg.Model(name=name, bodies=[pg.Body(name=n, com=(1, 0, 0)) for n in (name, "_a")])
    run = pg.simulate(model, t_end=0.01)
    heads = next(csv.reader(io.StringIO(run.to_csv())))
    assert f"{name} [rad]" in [head.removeprefix("'") for head in heads]
    assert not [head for head in heads if head[0] in "=+-@"]
    shown = run.plot("_a")
    shown.canvas.draw()
    assert [text.get_text() for text in shown.axes[0].get_legend().get_texts()] == ["_a"]


def oscillator(hertz: float, damping: float = 0.0) -> pg.Model:
    """1 kg on a spring along x, released 0.1 m from its rest."""
    body = pg.Body(
        name="x", joint="prismatic", axes=(1, 0, 0), mass=1.0, q=0.1,
        stiffness=(2 * np.pi * hertz) ** 2, damping=damping,
    )  # fmt: skip
    return pg.Model(bodies=(body,), gravity=(0, 0, 0))


def wide_frames(run: pg.Result) -> list[str]:
    return [text for text in run.notices if "frames=" in text]


def test_an_oscillation_faster_than_frames_is_reported():
    """One frame a period: all frames show the same state, though the body moves by 0.2 m."""
    run = pg.simulate(oscillator(10.0), t_end=10.0, frames=101)
    assert np.ptp(run["x"]) < 1e-6
    (text,) = wide_frames(run)
    assert "'x'" in text
    frames = int(text.split("frames=")[1].split(",")[0])
    finer = pg.simulate(oscillator(10.0), t_end=10.0, frames=frames)
    assert np.ptp(finer["x"]) == pytest.approx(0.2, rel=0.01)
    assert not wide_frames(finer)


@pytest.mark.parametrize(
    ("model", "options"),
    [
        (oscillator(2.0), {"t_end": 10.0, "frames": 101}),  # five frames a period
        (oscillator(200.0, 800.0), {"t_end": 1.0, "frames": 101}),  # settles before a frame
        (oscillator(1000.0, 250.0), {"t_end": 10.0}),
        (oscillator(10.0), {"t_end": 10.0, "frames": 2}),  # no curve
        (oscillator(0.0), {"t_end": 10.0, "step": 1e-3, "frames": 101}),  # at rest
    ],
)
def test_frames_that_show_the_motion_are_not_reported(model: pg.Model, options: dict):
    assert not wide_frames(pg.simulate(model, **options))


def test_names_of_a_file_stay_in_the_order_of_the_run(tmp_path):
    ball = {"joint": "free", "shape": pg.Shape(kind="sphere", radius=0.1)}
    bodies = [pg.Body(name=x, q=(2 * i, 0, 0.1, 1, 0, 0, 0), **ball) for i, x in enumerate("cab")]
    contacts = [pg.Contact(name=f"floor_{body.name}", body=body.name) for body in bodies]
    run = pg.simulate(pg.Model(bodies=bodies, contacts=contacts), t_end=0.1)
    run.save(tmp_path / "run.npz")
    same = pg.Result.load(tmp_path / "run.npz")
    assert list(same.contacts.force) == list(run.contacts.force)
    assert list(same.columns()) == list(run.columns())


def test_a_run_has_its_model_and_names_what_makes_films(tmp_path):
    model = pg.Model(bodies=(pg.Body(name="a", axes=(0, 1, 0), mass=1.0, com=(1, 0, 0)),))
    run = pg.simulate(model, t_end=0.01)
    assert run.model == model
    with pytest.raises(pg.FileError, match="to_film"):
        run.save(tmp_path / "run.mp4")


def test_the_torque_of_a_constraint_has_columns_unless_it_is_a_point():
    arm = pg.Body(name="arm", axes=[(0, 1, 0)], mass=1, com=(0, 0, -1), inertia=(1, 1, 1), q=(0.5,))
    held = pg.Motion(name="hold", body="arm", q_of_t="=0.5")
    run = pg.simulate(pg.Model(bodies=[arm]).add(held), t_end=0.1)
    weight = 9.81 * np.sin(0.5)
    assert abs(run["constraint_torque.hold.y"][-1]) == pytest.approx(weight, rel=1e-6)
    assert "constraint_torque.hold.x" in run.columns()
    pinned = pg.Point(
        name="pin",
        body="arm",
        point=(0, 0, -1),
        other_point=(-0.479425538604203, 0, -0.8775825618903728),
    )
    run = pg.simulate(pg.Model(bodies=[arm]).add(pinned), t_end=0.1)
    assert not any(name.startswith("constraint_torque") for name in run.columns())
