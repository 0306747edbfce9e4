"""Plots: the signals of a run and the payload (interface 1.8)."""

import itertools
import json
import re
from importlib.resources import files
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app import plots as data
from pgraph_app.gait.view import phases
from pgraph_app.plots.ready import ready
from pgraph_app.plots.view import PlotsView, plots, signals
from pgraph_core.show import shapes
from pgraph_core.show.notebook import pictures
from pgraph_core.show.shapes import to_matrix
from pgraph_core.study import figures

from ..core.test_cables import atwood
from ..core.test_muscles import held
from .store import ME, OTHER, after, begun, built_in, do, ran, reply

pytestmark = pytest.mark.quick


@pytest.fixture(scope="module")
def run(quadruped):
    return pg.simulate(pg.Mechanism(quadruped), scenario="stance", t_end=0.02)


def test_every_signal_is_its_column_of_the_result(run, quadruped):
    signals = {s.kind: data.curves(run, s) for s in data.of_body(quadruped, "left_tibia")}
    k = run.mechanism.topology.number("left_tibia") - 1
    assert signals["position"][1].y == run.body_pose[:, k, 1].tolist()
    assert signals["angular_acceleration"][2].y == run.body_acceleration[:, k, 2].tolist()
    assert signals["joint_torque"][2].y == run.joint_force[:, k, 2].tolist()
    assert [len(signals[kind]) for kind in ("q", "v", "vdot")] == [1, 1, 1]
    assert signals["q"][0].y == run.q[:, 6 + k].tolist()
    assert {len(c.t) for found in signals.values() for c in found} == {len(run.t)}
    found = data.of_scene(run)
    assert data.Signal("constraint_force", "left_hind_paw") in found
    assert not any(s.kind.startswith("contact") for s in found)
    force = data.curves(run, data.Signal("constraint_force", "left_hind_paw"))
    assert force[1].y == run.constraint_force["left_hind_paw"][:, 4].tolist()
    assert [c.label for c in data.curves(run, data.Signal("energy", ""))][2] == "total"
    assert data.curves(run, data.Signal("position", "nobody")) == []


def test_one_component_of_many_bodies_is_one_chart_as_figs_11_and_12(run):
    """Every body is in one chart with its own column of the run, other components on demand."""
    names = list(run.mechanism.names)
    signal = data.Signal("angular_acceleration.z", data.MANY.join(names))
    found = data.curves(run, signal)
    assert [curve.label for curve in found] == names
    for k, curve in enumerate(found):
        assert curve.y == run.body_acceleration[:, k, 2].tolist()
    assert data.components(run, signal) == ["x", "y", "z"]
    assert data.unit(run.mechanism.model, signal) == "rad/s²"
    assert data.of_several(run.mechanism.model, names[:2])[0].component == "1"
    assert data.title(data.Signal("velocity.z", "knee\nankle")) == "velocity z of 2 bodies"
    assert all(kind.unit for name, kind in data.KINDS.items() if name != data.POSES)


def ready_plots(result, *selected):
    return {one.label: one.signals for one in ready(result, selected)}


def test_figures_of_the_paper_are_ready_plots(run):
    """Figs. 10 to 13: poses, angular accelerations of all bodies about z, forces of the paws."""
    found = ready_plots(run)
    assert found["Poses"] == [data.Signal(data.POSES, "")]
    names = run.mechanism.names
    assert [signal.bodies for signal in found["Accelerations"]] == [
        list(names[:8]),
        list(names[8:]),
    ]
    assert {signal.kind for signal in found["Accelerations"]} == {"angular_acceleration.z"}
    paws = [data.Signal("constraint_force", name) for name in run.constraint_force]
    assert found["Forces"] == paws
    assert len(paws) == 4
    drives = [name for signal in found["Drives"] for name in signal.bodies]
    assert drives == [name for name, torque in run.drive_force.items() if np.any(torque)]
    one = ready_plots(run, "left_hind_paw")
    assert one["Forces"] == [data.Signal("constraint_force", "left_hind_paw")]
    assert one["Positions"] == [data.Signal("q", "left_hind_paw")]
    assert one["Accelerations"] == [data.Signal("angular_acceleration", "left_hind_paw")]
    assert ready_plots(run, "of another model") == found


def test_ready_plots_leave_out_what_is_zero_and_share_few_charts():
    fall = pg.simulate(
        pg.Model(bodies=[pg.Body(name="b", joint="free", inertia=(1, 1, 1))]), t_end=0.1
    )
    assert list(ready_plots(fall)) == [
        "Positions",
        "Velocities",
        "Accelerations",
        "Energy",
        "Poses",
    ]
    assert ready_plots(fall)["Accelerations"] == [data.Signal("acceleration", "b")]
    still = pg.simulate(pg.Model.serial(1).replace(gravity=(0, 0, 0)), t_end=0.1)
    assert list(ready_plots(still)) == ["Energy", "Poses"]
    chain = pg.simulate(pg.Model.serial(50).edit("1", axes=(0, 1, 0), v=1.0), t_end=0.01)
    charts = ready_plots(chain)["Velocities"]
    assert [len(signal.bodies) for signal in charts] == [8, 8, 8, 8]


def test_tensions_of_the_segments_of_a_rope_share_a_chart():
    run = pg.simulate(atwood(), t_end=0.05)
    names = "rope[1]\nrope[2]"
    assert ready_plots(run)["Forces"] == [data.Signal("tension", names)]
    found = data.of_scene(run)
    for kind, word, unit in (("tension", "tension", "N"), ("path_length", "length", "m")):
        signal = data.Signal(kind, names)
        assert signal in found
        assert data.title(signal) == f"{word} of rope"
        assert data.unit(run.mechanism.model, signal) == unit
        curves = data.curves(run, signal)
        assert [curve.label for curve in curves] == ["rope[1]", "rope[2]"]
        assert curves[1].y == pytest.approx(getattr(run, kind)["rope[2]"].tolist())


def test_curves_of_zeros_are_named_and_not_drawn():
    """Work and dissipated energy of a pendulum were two flat lines."""
    swing = pg.simulate(built_in("pendulum"), t_end=0.1)
    state = after(ran(begun(swing.mechanism.model), swing), do.Plot(ME, "energy", "", True))
    (chart,) = plots(state, state.clients[ME])["charts"]
    assert [curve["label"] for curve in chart["curves"]] == ["kinetic", "potential", "total"]
    assert chart["rest"] == ["work", "dissipated"]
    damped = pg.simulate(built_in("pendulum").edit("rod", damping=0.1), t_end=0.1)
    state = after(ran(state, damped), do.KeepRun(ME))
    (chart,) = plots(ran(state, swing), state.clients[ME])["charts"]
    assert chart["rest"] == ["work"]  # a kept run has some
    assert len(chart["kept"][0]["curves"]) == len(chart["curves"]) == 4
    rest = pg.simulate(pg.Model.serial(1).replace(gravity=(0, 0, 0)), t_end=0.1)
    state = after(ran(begun(rest.mechanism.model), rest), do.Plot(ME, "q", "1", True))
    (chart,) = plots(state, state.clients[ME])["charts"]
    assert (len(chart["curves"]), chart["rest"]) == (1, [])


def test_a_curve_has_its_own_unit():
    """Metres and degrees shared one axis, "[m, 1, deg]"."""
    base = pg.Body(name="base", joint="free", inertia=(1, 1, 1), v=(0, 0, 0, 1, 0, 0))
    bodies = [base, pg.Body(name="arm", parent="base", inertia=(1, 1, 1), v=2.0)]
    result = pg.simulate(pg.Model(bodies=bodies), t_end=0.1)
    (signal,) = ready_plots(result)["Positions"]
    state = after(ran(begun(result.mechanism.model), result), do.Replot(ME, (), (signal,)))
    state = after(state, do.SetDisplay(ME, "angle", "deg"))
    (chart,) = plots(state, state.clients[ME])["charts"]
    assert [(c["label"], c["unit"]) for c in chart["curves"]] == [("base", "m"), ("arm", "deg")]
    assert chart["unit"] == "m, deg"
    assert chart["title"] == "joint position of 2 bodies"
    pose = data.curves(result, data.Signal("q", "base"))
    assert [curve.unit for curve in pose] == ["m"] * 3 + ["1"] * 4


def test_a_ready_plot_takes_the_place_of_another(run, quadruped):
    state = ran(begun(quadruped), run)
    found = ready_plots(run)
    one = after(state, do.Plot(ME, "q", "lumbar", True), do.Replot(ME, (), tuple(found["Energy"])))
    every = tuple(signal for signals in found.values() for signal in signals)
    two = after(one, do.Replot(ME, every, tuple(found["Accelerations"])))
    assert two.clients[ME].plots == (("q", "lumbar"), *found["Accelerations"])
    assert after(two, do.Replot(ME, every, ())).clients[ME].plots == (("q", "lumbar"),)
    assert after(two, do.Replot(ME, (), (("nonsense", ""),))) is two


def test_six_poses_over_the_run_share_one_scale_as_fig_10(run):
    found = data.strip(run)
    assert [t for t, _ in found] == pytest.approx(np.linspace(run.t[0], run.t[-1], 6).tolist())
    pose = run.body_pose[0, :, :3], to_matrix(run.body_pose[0, :, 3:])
    alone = pictures(run.mechanism.model, [pose])[0]
    assert found[0][1].count("<polygon") == alone.count("<polygon") > 10
    assert found[0][1] != found[-1][1]
    fills = [set(re.findall(r'fill="(rgb[^"]+)"', svg)) for svg in (found[0][1], alone)]
    assert {str(c) for c in shapes.COATS[:5]} <= {fill[3:] for fill in fills[0]}  # as in 3D
    assert fills[0] != fills[1]


def test_poses_of_what_travels_follow_it():
    """A walking dog was a speck in six pictures of its whole way."""
    ball = pg.Body(name="a", joint="free", mass=1.0, v=(0, 0, 0, 100, 0, 0), shape=pg.Shape(
        kind="sphere", radius=0.1))  # fmt: skip
    result = pg.simulate(pg.Model(bodies=[ball], gravity=(0, 0, 0)), t_end=1.0)
    widths = []
    for travels in (0.0, np.array([1.0, 0.0, 0.0])):
        points = re.findall(r"([\d.]+),[\d.]+", data.strip(result, travels)[0][1])
        widths.append(np.ptp([float(x) for x in points]))
    assert widths[1] > 50 * widths[0]


@pytest.mark.parametrize(
    ("joint", "units"),
    [
        ("revolute", ("rad", "rad/s", "rad/s²")), ("prismatic", ("m", "m/s", "m/s²")),
        ("universal", ("rad", "rad/s", "rad/s²")), ("spherical", ("1", "rad/s", "rad/s²")),
        ("cylindrical", ("rad, m", "rad/s, m/s", "rad/s², m/s²")),
    ],
)  # fmt: skip
def test_units_are_those_of_the_joint(joint, units):
    model = pg.Model(bodies=(pg.Body(name="a", joint=joint),))
    assert tuple(data.unit(model, data.Signal(kind, "a")) for kind in ("q", "v", "vdot")) == units
    assert data.unit(model, data.Signal("energy", "")) == "J"


def test_undo_across_another_model_leaves_no_plots_of_it():
    old = begun(built_in("double_pendulum"))
    new = after(old, do.NewModel(ME, 1, "3"), do.Plot(ME, "q", "3", True))
    back = after(new, do.Undo(ME))
    assert new.clients[ME].plots
    assert back.model is old.model
    assert back.clients[ME].plots == after(back, do.Redo(ME)).clients[ME].plots == ()


def test_torques_of_drives_and_limits_are_plotted_in_their_units():
    model = pg.Model(
        bodies=(
            pg.Body(name="cart", joint="prismatic", mass=1, limits=((-0.001, 0.001),)),
            pg.Body(name="arm", parent="cart", com=(0.5, 0, 0), inertia=(1, 1, 1)),
        ),
        forces=(pg.Servo(name="push", body="cart", kp=90, target=1, torque_limit=20.0),
                pg.Motor(name="turn", body="arm", torque=2.0)),
    )  # fmt: skip
    result = pg.simulate(model, t_end=0.2)
    found = data.of_scene(result)
    for name, unit in (("push", "N"), ("turn", "N m")):
        signal = data.Signal("drive_force", name)
        assert signal in found
        assert data.unit(model, signal) == unit
        assert data.curves(result, signal)[0].y == result.drive_force[name].tolist()
    stop = data.Signal("limit", "cart high limit")
    assert stop in found
    assert data.curves(result, stop)[0].y == result.contacts.limit["cart high limit"].tolist()


@pytest.mark.parametrize("method", ["moreau_jean", "dop853"])
def test_torques_of_a_joint_show_when_it_hits_its_limit(method):
    """Its impulse is no torque over time: it was a zero between the frames."""
    arm = pg.Body(name="arm", axes=(0, 1, 0), com=(0.5, 0, 0), mass=1.0, inertia=(1, 1, 1),
                  limits=((-0.1, 0.1),), limit_restitution=(0.5,))  # fmt: skip
    result = pg.simulate(pg.Model(up="z", bodies=(arm,)), t_end=0.5, method=method, frames=5)
    times = [e.t for e in result.events if e.before == "free"]
    assert times
    state = ran(begun(result.mechanism.model), result)
    for kind, of, marked in (
        ("limit", "arm high limit", times), ("joint_torque", "arm", times),
        ("limit", "arm low limit", []), ("q", "arm", []),
    ):  # fmt: skip
        shown = after(state, do.Plot(ME, kind, of, True))
        chart = plots(shown, shown.clients[ME])["charts"][0]
        assert chart["impacts"] == marked
        assert chart["none"] == "" or not marked


JOINTS = ["revolute", "prismatic", "universal", "spherical", "cylindrical", "screw", "free"]


@pytest.mark.parametrize("joint", JOINTS)
@pytest.mark.parametrize(("angle", "length"), [("deg", "m"), ("deg", "mm"), ("rad", "mm")])
def test_curves_and_their_unit_are_in_the_units_of_the_page(joint, angle, length):
    """They showed rad beside cells in degrees."""
    kinds = ("joint_velocity", "joint_position")[: 1 if joint in ("spherical", "free") else 2]
    outputs = [pg.Output(name=kind, kind=kind, at="a") for kind in kinds]
    outputs += [pg.Output(name=kind, kind=kind, at="a") for kind in ("gyro", "force", "rotation")]
    bodies = (
        pg.Body(name="a", joint=joint, link=(0.1, 0, 0), com=(0.1, 0.2, 0), inertia=(1, 1, 1)),
        pg.Body(name="b", parent="a", joint="prismatic", link=(0, 0, 1)),
    )
    result = pg.simulate(pg.Model(bodies=bodies, outputs=outputs), t_end=0.05, estimate=False)
    state = ran(begun(result.mechanism.model), result)
    signals_of = [*data.of_body(result.mechanism.model, "a"), *data.of_scene(result)]
    signals_of += data.of_several(result.mechanism.model, ["a", "b"])
    mine = after(state, do.SetDisplay(ME, "angle", angle), do.SetDisplay(ME, "length", length))
    display = mine.clients[ME].display
    factors = {"rad": 180 / np.pi if angle == "deg" else 1.0, "m": 1e3 if length == "mm" else 1.0}
    for signal in signals_of:
        plotted = data.curves(result, signal)
        shown = data.curves(result, signal, display)
        si = data.unit(result.mechanism.model, signal).split(", ")
        named = data.unit(result.mechanism.model, signal, display).split(", ")
        heads = {x.partition("/")[0] for x in si}
        assert len(named) == len(si)
        for before, after_ in zip(plotted, shown, strict=True):
            some = [factors.get(head, 1.0) for head in heads]
            assert any(np.allclose(after_.y, np.multiply(before.y, f), rtol=1e-12) for f in some)
        if len(heads) == 1 and (head := heads.pop()) in factors:
            assert named[0].partition("/")[0] == {"rad": angle, "m": length}[head]
    signal = data.Signal("v", "a")
    first = data.curves(result, signal, display)[0].y
    turns = joint != "prismatic"
    assert first == pytest.approx(result.v[:, 0] * factors["rad" if turns else "m"])
    sent = []
    bridge: Any = SimpleNamespace(send=lambda client, topic, payload: sent.append((topic, payload)))
    mine = after(mine, do.Plot(ME, *signal, True))
    PlotsView(bridge).render(mine, after(mine, do.SetDisplay(ME, "length", "m")))
    assert ("plots" in dict(sent)) == (length == "mm")


def linear(colour):
    """Return a colour's linear red, green and blue (3,), by the definition of sRGB."""
    c = np.array([int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)])
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def oklab(colour):
    """Return a colour's place in a space of evenly perceived distances (Ottosson 2020), (3,)."""
    cones = np.array([
        [0.4122214708, 0.5363325363, 0.0514459929], [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]) @ linear(colour)  # fmt: skip
    return np.array([
        [0.2104542553, 0.7936177850, -0.0040720468], [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]) @ np.cbrt(cones)  # fmt: skip


@pytest.mark.parametrize(("theme", "series"), [(0, figures.SERIES), (1, figures.SERIES_DARK)])
def test_curves_have_distinct_colours_with_contrast_on_the_page_and_in_studies(theme, series):
    """Potential and dissipated energy were two browns."""
    css = (files("pgraph_app") / "core/page.css").read_text()
    assert tuple(re.findall(r"--s\d: (#\w{6})", css))[8 * theme :][:8] == series
    paper = ("#ffffff", re.findall(r"--panel: (#\w{6})", css)[0])[theme]
    light = np.array([0.2126, 0.7152, 0.0722])
    for colour in series:
        dark, bright = sorted((light @ linear(colour), light @ linear(paper)))
        assert (bright + 0.05) / (dark + 0.05) >= 4.5  # WCAG 2.2, AA
    seen = 0.02  # the least distance that is noticed
    for one, other in itertools.combinations(series, 2):
        assert np.linalg.norm(oklab(one) - oklab(other)) > 4 * seen


def test_thinning_keeps_extremes_ends_and_order():
    t = np.linspace(0, 1, 100_000)
    y = np.sin(40 * t)
    y[54_321] = 9.0
    curve = data.thinned("", t, y)
    assert len(curve.t) <= 2 * data.POINTS + 2
    assert max(curve.y) == 9.0
    assert (curve.t[0], curve.t[-1]) == (0.0, 1.0)
    assert np.all(np.diff(curve.t) > 0)
    assert data.thinned("", np.arange(3.0), np.array([1.0, np.inf, 2.0])).y == [1.0, 2.0]


def test_each_page_has_its_own_plots(run, quadruped):
    state = ran(begun(quadruped, ME, OTHER), run)
    state = after(state, do.Plot(ME, "energy", "", True), do.Plot(ME, "q", "left_tibia", True))
    assert after(state, do.Plot(ME, "nonsense", "", True)) is state
    assert state.clients[OTHER].plots == ()
    sent = plots(state, state.clients[ME])["charts"]
    assert [c["title"] for c in sent] == ["energy", "joint position of left_tibia"]
    assert json.dumps(sent, allow_nan=False)
    assert json.dumps(signals(state, state.clients[ME]), allow_nan=False)
    fewer = after(state, do.Plot(ME, "energy", "", False))
    assert [s[0] for s in fewer.clients[ME].plots] == ["q"]
    twice = after(state, do.KeepRun(ME), do.KeepRun(ME), do.NameRun(ME, 1, 2, "soft"))
    chart = plots(twice, twice.clients[ME])["charts"][0]
    assert [kept["name"] for kept in chart["kept"]] == [twice.runs[0].name, "soft"]
    assert all(kept["curves"] == chart["curves"] for kept in chart["kept"])
    assert "name" in reply(after(twice, do.NameRun(ME, 1, 1, "soft")))
    assert [kept.id for kept in after(twice, do.DropRun(ME, 1)).runs] == [2]


def test_an_inactive_constraint_has_no_force_curve():
    """An axis of 1e-12 looked like a paw that carries nothing."""
    ties = [pg.Point(name=name, body="1", active=name == "on") for name in ("on", "off")]
    model = pg.Model.serial(1).replace(constraints=ties)
    never = {"coordinate": "1", "above": 3.0}
    later = pg.Switch(constraint="off", active=True, when=never)
    result = pg.simulate(pg.Mechanism(model), t_end=0.01, frames=3, step=2e-3, switches=[later])
    state = ran(begun(model), result)
    state = after(state, *(do.Plot(ME, "constraint_force", name, True) for name in ("on", "off")))
    on, off = plots(state, state.clients[ME])["charts"]
    assert on["curves"]
    assert (on["none"], off["curves"]) == ("", [])
    assert "0" in off["none"]


def test_contacts_that_never_touched_are_listed_apart():
    """A ball that falls on the ground, and one that hangs above it."""
    ball = pg.Shape(kind="sphere", radius=0.1)
    low = pg.Body(name="low", joint="free", link=(0, 0, 0.2), shape=ball)
    high = pg.Body(name="high", joint="weld", link=(0, 0, 3), shape=ball)
    contacts = [pg.Contact(name=f"of {n}", body=n) for n in ("high", "low")]
    model = pg.Model(bodies=(low, high), contacts=contacts)
    state = ran(begun(model), pg.simulate(model, t_end=0.4))
    found = signals(state, state.clients[ME])
    kinds = {"contact_force", "contact_gap", "contact_slip"}
    assert {kind for kind, of, _ in found["of_scene"] if of == "of low"} == kinds
    assert {(kind, of) for kind, of, _ in found["idle"]} == {(kind, "of high") for kind in kinds}
    assert found["idle_title"].startswith("1 ")
    shown = phases(state.falls, state)
    assert shown["feet"] == ["of low", "of high"]  # what touches first


@pytest.fixture(scope="module")
def quadruped():
    return built_in("quadruped")


def test_states_of_muscles_and_controls_are_plotted():
    speed = pg.Filter("speed", input="=v.arm", lag=0.1)
    run = pg.simulate(held(excitation=0.3).add(speed), t_end=0.1)
    found = {s.of: s for s in data.of_scene(run) if s.kind == "state"}
    assert list(found) == ["activation.flexor", "fibre.flexor", "x.speed"]
    titles = ["activation of flexor", "fibre of flexor", "control speed"]
    assert [data.title(s) for s in found.values()] == titles
    for name, unit in (("activation.flexor", "1"), ("fibre.flexor", "m"), ("x.speed", "1")):
        (curve,) = data.curves(run, found[name])
        assert (curve.y[-1], curve.unit) == (run[name][-1], unit)
    of_muscles = next(one for one in ready(run, []) if one.label == "Muscles")
    assert [s.of for s in of_muscles.signals] == ["activation.flexor", "flexor"]
    both = data.Signal("state", data.MANY.join(("activation.flexor", "activation.flexor")))
    assert data.title(both) == "activation of 2 muscles"


def test_the_samples_of_an_imperfect_sensor_are_drawn_beside_its_readings():
    rough = pg.Imperfect(sample=0.1, quantum=0.05)
    angle = pg.Output(name="angle", kind="joint_position", at="1", imperfect=rough)
    run = pg.simulate(pg.Model.serial(1).add(angle), t_start=0.05, t_end=0.5, estimate=False)
    true, measured = data.curves(run, data.Signal("output", "angle"))
    assert (true.label, measured.label, measured.unit) == ("", "measured", "rad")
    assert measured.t[0] == pytest.approx(0.1)  # before it, no sample was taken
    np.testing.assert_allclose(np.divide(measured.y, 0.05) % 1.0 % 0.9999, 0.0, atol=1e-3)
    assert len(set(measured.y)) <= 5
