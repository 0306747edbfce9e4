"""The stability map: every verdict, its text, and the axes that it varies."""

import dataclasses
import itertools
import json
import re
import threading
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pgraph_core as pg
from pgraph_core.study import stability
from pgraph_core.study.axes import AXES, first_axis
from pgraph_core.study.map import Cell, Verdict, judged
from pgraph_core.study.reference import KnownMotion

from ..worlds import built_in
from .rescaling import rescaled
from .test_cases import DOWN, mass, worst
from .test_methods import slider_crank, stiff_pendulum

STIFFNESSES = (1e2, 1e4, 1e6, 1e8)
STEPS = (1e-1, 1e-2, 1e-3)
METHODS = ("semi_implicit_euler", "rk4", "dopri5", "dop853", "gauss6", "radau5")


def one_cell(mech, q=None, **options):
    (cell,) = pg.stability_map(mech, q, **options).cells
    return cell


@pytest.fixture(scope="module")
def stiff():
    mech, q = stiff_pendulum(1e6)
    return pg.stability_map(mech, q, values=STIFFNESSES, steps=STEPS, t_end=1.0)


def exact(k, t):
    """Return (θ, r) of the stiff pendulum by SciPy. From 1e8 on the rod is rigid to 1e-7."""

    def slope(_, y):
        theta, r, dtheta, dr = y
        turning = (-9.81 * np.sin(theta) - 2 * dr * dtheta) / r
        return dtheta, dr, turning, r * dtheta**2 + 9.81 * np.cos(theta) - k * (r - 1.0)

    def rigid(_, y):
        return y[1], -9.81 * np.sin(y[0])

    if k >= 1e8:
        found = solve_ivp(rigid, (0, t[-1]), (1.0, 0.0), "DOP853", t, rtol=1e-12, atol=1e-12)
        return found.y[0], np.ones_like(t)
    start = (1.0, 1.0 + 9.81 * np.cos(1.0) / k, 0.0, 0.0)
    return solve_ivp(slope, (0.0, t[-1]), start, "DOP853", t, rtol=1e-8, atol=1e-10).y[:2]


def test_no_cell_is_bounded_wrong_and_silent(stiff):
    """Every cell that is called OK is right, by equations that this package does not know."""
    t = np.linspace(0.0, 1.0, 21)
    found = {(c.value, c.method, c.step) for c in stiff.cells}
    assert found == set(itertools.product(STIFFNESSES, METHODS, STEPS))
    expected = {k: exact(k, t) for k in STIFFNESSES}
    right = [cell for cell in stiff.cells if cell.status == "OK"]
    assert len(right) > 20
    for cell in right:
        options = {"method": cell.method, "step": cell.step, "estimate": False}
        run = pg.simulate(*stiff_pendulum(cell.value), t_end=1.0, t_eval=t, **options)
        theta, r = expected[cell.value]
        error = max(worst(run.q[:, 0], theta), worst(1.0 + run.q[:, 1], r))
        assert error < 1.1 * stiff.target, cell


def test_every_verdict_has_its_numbers(stiff):
    """RK4 grows within ten steps if rate times step is ten or more. Its limit is 2.83."""
    for cell in stiff.cells:
        assert isinstance(cell.status, Verdict)
        assert cell.text
        if cell.status == "UNSTABLE":
            assert cell.body == "a"
            assert cell.time <= 1.0
        if cell.status == "INACCURATE" and cell.step_needed is not None:
            assert cell.step_needed < cell.step
    fast = [c for c in stiff.cells if c.method == "rk4" and c.step * np.sqrt(c.value) >= 9.999]
    assert len(fast) == 6
    for cell in fast:
        assert cell.status == "UNSTABLE"
        assert cell.time <= 10 * cell.step + 1e-12, cell
        assert cell.step_limit == pytest.approx(2.83 / np.sqrt(cell.value), rel=0.1)
        assert "radau5" in cell.text


def test_the_limit_of_rk4_is_where_it_is_predicted():
    """Bisect the step, with the fast mode excited so that it can grow."""
    mech, q = stiff_pendulum(1e4)
    low, high, predicted = 1e-2, 6e-2, np.nan
    for _ in range(5):
        step = np.sqrt(low * high)
        options = {"values": [1e4], "methods": ["rk4"], "steps": [step], "t_end": 5.0}
        cell = one_cell(mech, q + np.array([0.0, 1e-6]), **options)
        predicted = cell.step_limit
        low, high = (low, step) if cell.status == "UNSTABLE" else (step, high)
    assert predicted == pytest.approx(np.sqrt(low * high), rel=0.2)


def test_semi_implicit_euler_is_inaccurate_and_the_step_it_names_does(stiff):
    wanted = (1e2, "semi_implicit_euler", 1e-2)
    cell = next(c for c in stiff.cells if (c.value, c.method, c.step) == wanted)
    assert cell.status == "INACCURATE"
    assert cell.order == pytest.approx(1.0, abs=0.3)
    mech, q = stiff_pendulum(1e2)
    options = {"values": [1e2], "methods": [cell.method], "t_end": 1.0}
    assert one_cell(mech, q, steps=[cell.step_needed / 1.2], **options).status == "OK"


def test_a_step_that_is_advised_was_run_or_is_called_a_prediction(stiff):
    """The largest accurate step of the method below that of the cell, or by the order."""
    right = {(c.value, c.method, c.step) for c in stiff.cells if c.status == "OK"}
    kinds = {True: 0, False: 0}
    for cell in stiff.cells:
        own = [s for s in STEPS if s < cell.step and (cell.value, cell.method, s) in right]
        if cell.status == "OK":
            continue
        said = re.findall(r"use a step of ([\d.e+-]+) s", cell.text)
        assert [float(x) for x in said] == own[:1], cell
        predicted = "was not run" in cell.text
        assert not (own and predicted)
        assert np.isfinite(cell.step_needed) == bool(own or predicted)
        if np.isfinite(cell.step_needed) and not own:
            assert cell.step_needed < min(STEPS)
        kinds[bool(own)] += 1
    assert min(kinds.values()) > 0


def test_a_map_without_an_accurate_run_names_the_closest():
    mech, q = stiff_pendulum(1e2)
    given = {"values": [1e2], "methods": ["semi_implicit_euler"], "t_end": 1.0}
    found = pg.stability_map(mech, q, steps=[1e-1, 1e-2], **given)
    assert "semi_implicit_euler at a step of 0.01 s comes closest: error" in found.advice
    assert "was not run" in found.advice


def test_a_run_that_gains_and_loses_energy_is_inaccurate_and_does_not_grow():
    """A four-bar linkage beyond the step that its fastest rate predicts as the limit: the error of
    semi-implicit Euler is 4e-4 of the motion, of the second order in some mechanisms, and its
    energy is bounded.
    """
    model = AXES["mass_ratio"].applied(pg.load("four_bar"), 1e-3)
    mech, given = pg.Mechanism(model), {"scenario": "turn", "t_end": 10.0, "estimate": False}
    t = stability.times_of(10.0, 0.01)
    run, half = (
        pg.simulate(mech, method="semi_implicit_euler", step=h, t_eval=t, **given)
        for h in (1e-2, 5e-3)
    )
    known = pg.simulate(mech, method="dop853", rtol=1e-11, t_eval=t, **given)
    half = dataclasses.replace(half, q=known.q + 0.95 * (half.q - known.q))  # order above 2
    motion = KnownMotion(known, 1e-9, "dop853", 649.0, float(np.ptp(known.potential_energy)))
    cell = judged(
        Cell(1e-3, "semi_implicit_euler", 0.01, Verdict.OK, ""), 1e-3, mech, run, half, motion
    )
    assert cell.step > 3 * cell.step_limit
    assert (cell.status, cell.order) == ("INACCURATE", pytest.approx(2.0, abs=0.1))


def test_lost_energy_is_damping_and_too_many_steps_are_slow():
    """A spring whose period the step does not resolve, under way: Radau takes its energy."""
    mech, q = stiff_pendulum(1e4)
    options = {"values": [1e4], "methods": ["radau5"], "steps": [0.02], "t_end": 1.0}
    cell = one_cell(mech, q + np.array([0.0, 0.02]), **options)
    assert cell.status == "DAMPED"
    assert cell.energy_lost > 0.01
    cell = one_cell(*stiff_pendulum(1e6), values=[1e6], methods=["rk4"], steps=[1e-9])
    assert (cell.status, cell.evaluations) == ("SLOW", 4_000_000_000)  # it is not run


def test_constraints_that_are_left_are_drift():
    q = np.array([0.5, -0.5 - np.arcsin(0.4 * np.sin(0.5)), 0.0])
    q[2] = 0.2 * np.cos(0.5) + 0.5 * np.sqrt(1 - (0.4 * np.sin(0.5)) ** 2)
    options = {"axis": "step", "methods": ["semi_implicit_euler"], "values": [2e-2], "t_end": 1.0}
    assert one_cell(slider_crank(), q, stabilise=None, **options).status == "DRIFT"
    assert one_cell(slider_crank(), q, **options).status != "DRIFT"


def test_a_refused_run_has_failed_with_a_reason():
    """A penalty contact remembers, which steps to events cannot undo."""
    floor = pg.Contact(name="floor", body="b", law="penalty", points=((0, 0, 0),))
    contacts = floor, pg.Contact(name="rail", body="b", points=((0.1, 0, 0),))
    model = pg.Model(
        bodies=(pg.Body(name="b", joint="free", inertia=(0.01,) * 3),), contacts=contacts
    )
    cell = one_cell(model, axis="step", values=[1e-3], methods=["rk4"], t_end=0.01)
    assert cell.status == "FAILED"
    assert "penalty" in cell.text or "floor" in cell.text


def test_a_motion_that_nobody_knows_is_never_called_right():
    """A double pendulum that tumbles until two runs to the last digit differ."""
    mech = pg.Mechanism(pg.Model(bodies=(mass("a"), mass("b", "a", above=1.0)), **DOWN))
    options = {"axis": "speed", "values": [3.0], "methods": ["dop853"], "steps": [1e-3]}
    assert one_cell(mech, t_end=60.0, **options).status != "OK"


def test_a_map_is_text_json_and_a_picture(tmp_path):
    options = {"values": [1e4, 1e8], "methods": ["rk4", "radau5"], "steps": [1e-2]}
    small = pg.stability_map(*stiff_pendulum(1e6), t_end=0.5, **options)
    assert all(value in str(small) for value in ("10000", "1e+08", "rk4", "radau5"))
    for suffix in ("json", "svg", "html"):
        small.save(tmp_path / f"map.{suffix}")
    data = json.loads(small.to_json())
    assert json.loads((tmp_path / "map.json").read_text()) == data
    assert [c["status"] for c in data["cells"]] == ["OK", "OK", "UNSTABLE", "OK"]
    svg, html = ((tmp_path / f"map.{x}").read_text() for x in ("svg", "html"))
    assert svg.count("<rect") == len(small.cells) + len({c.status for c in small.cells})
    assert "<svg" in html
    assert "http" not in html.replace("http://www.w3.org/2000/svg", "")


def test_a_map_tells_its_progress_and_can_be_stopped():
    mech, q = stiff_pendulum(1e6)
    seen: list[float] = []
    options = {"values": [1e2, 1e3], "methods": ["rk4"], "steps": [1e-2, 1e-3], "t_end": 1.0}
    found = pg.stability_map(mech, q, progress=lambda x: seen.append(x) or x < 0.6, **options)
    assert seen == sorted(seen)
    assert not found.complete
    assert len(found.cells) < 4


def test_the_own_value_of_a_model_is_marked_and_the_best_method_comes_first():
    mech, q = stiff_pendulum(2.5e5)
    found = pg.stability_map(mech, q, steps=[1e-2], t_end=0.5)
    assert found.own == 2.5e5
    assert 2.5e5 in found.values
    right = [sum(c.status == "OK" for c in found.cells if c.method == m) for m in found.methods]
    assert right == sorted(right, reverse=True)
    assert found.methods[:2] == ("radau5", "gauss6")  # always accurate, the cheaper one first
    ((method, step),) = re.findall(r"^Take (\w+) at a step of (\S+) s", found.advice)
    assert method == found.methods[0]
    best = [c for c in found.cells if (c.method, c.step) == (method, float(step))]
    assert any((c.value, c.status) == (2.5e5, "OK") for c in best)


@pytest.mark.parametrize(
    ("options", "facts"),
    [
        ({"axis": "mood"}, "axis.*'mood'.*stiffness"), ({"values": ()}, "values"),
        ({"values": [1.0, float("nan")]}, "values.*nan"), ({"steps": [0.0]}, "steps.*> 0"),
        ({"axis": "step", "steps": [1e-3]}, "steps.*'step'"), ({"t_end": -1.0}, r"t_end.*-1\.0"),
        ({"target": 0.0}, r"target.*0\.0"), ({"methods": ()}, "methods.*semi_implicit_euler"),
        ({"methods": ["rk5"]}, "methods.*rk5.*rk4"), ({"axis": "friction"}, "axis.*friction"),
    ],
)  # fmt: skip
def test_bad_input(options, facts):
    mech, q = stiff_pendulum(1e6)
    with pytest.raises(pg.InputError, match=f"stability_map.*{facts}"):
        pg.stability_map(mech, q, **options)


def sprung():
    spring = pg.Force(name="s", kind="spring", body="b", stiffness=50.0, rest=0.2)
    bodies = (mass("a", stiffness=200.0, q=(0.1,)), mass("b", "a", above=1.0, v=(2.0,)))
    return pg.Model(bodies=bodies, forces=(spring,), **DOWN)


def touching():
    contact = pg.Contact(name="c", body="a", law="soft", points=((0, 0, 0),))
    return pg.Model(
        bodies=(pg.Body(name="a", joint="free", inertia=(0.01,) * 3),), contacts=(contact,)
    )  # fmt: skip


MODELS = {"contact_stiffness": touching, "friction": touching}


@pytest.mark.parametrize("name", AXES)
def test_every_usual_value_makes_a_valid_model_and_leaves_the_old_one(name):
    model = MODELS.get(name, sprung)()
    before = model.to_json()
    for value in AXES[name].values:
        pg.Mechanism(AXES[name].applied(model, value))
    assert model.to_json() == before


@pytest.mark.parametrize("name", [n for n in AXES if n not in ("step", "speed")])
def test_an_axis_that_a_model_has_not_is_refused(name):
    model = pg.Model(bodies=(pg.Body(name="a", joint="weld", inertia=np.zeros((3, 3))),))
    with pytest.raises(pg.InputError):
        pg.stability_map(model, axis=name, methods=["rk4"], steps=[1e-2])


def test_axes_change_their_numbers_and_keep_the_rest():
    """Forces at the start, ratios of masses."""
    made = AXES["stiffness"].applied(sprung(), 2e6)
    a = made.body("a")
    assert a.stiffness == (2e6,)
    assert a.stiffness[0] * a.q[0] == pytest.approx(200.0 * 0.1)
    assert made.forces[0].stiffness == pytest.approx(50.0 * 1e4)
    made = AXES["mass_ratio"].applied(sprung(), 1e-9)
    assert made.body("b").mass / made.body("a").mass == pytest.approx(1e-9)


def test_numbers_that_follow_from_shapes_are_varied_like_given_ones():
    box = pg.Shape(kind="box", size=(1.0, 0.1, 0.1))
    steel = {"shape": box, "density": 7850.0, "derived": ("mass", "com", "inertia")}
    bodies = (pg.Body(name="a", **steel), pg.Body(name="b", parent="a", link=(1, 0, 0), **steel))
    model = plain = pg.Model(bodies=bodies)
    for body in bodies:
        numbers = {"mass": body.mass, "com": body.com, "inertia": body.inertia}
        plain = plain.edit(body.name, derived=(), density=None, **numbers)
    derived, own = (AXES["mass_ratio"].applied(m, 1e-9).body("b") for m in (model, plain))
    assert derived.mass == own.mass > 0
    assert (derived.com, derived.inertia) == (own.com, own.inertia)
    assert first_axis(model) == first_axis(plain) == "mass_ratio"


@pytest.mark.parametrize("unit", ["length", "mass", "time"])
def test_no_threshold_has_a_unit(unit):
    """The same mechanism in other units: the same verdicts, errors alike."""
    top = pg.Body(name="top", joint="spherical", mass=2.0, com=(0.1, 0, 0.4),
                  inertia=np.diag([0.2, 0.3, 0.1]), v=(1.0, 0.0, 6.0))  # fmt: skip
    bob = mass("bob", "top", damping=0.01, stiffness=2.0)
    model, cells = pg.Model(bodies=(top, bob), **DOWN), []
    for factor in (1e-9, 1.0, 1e9):
        pace, scaled = factor if unit == "time" else 1.0, rescaled(model, **{unit: factor})
        given = {"values": [1e-2 * pace], "methods": ["rk4"], "t_end": 0.3 * pace}
        cells += pg.stability_map(scaled, axis="step", **given).cells
    errors = [cell.error for cell in cells]
    assert len({cell.status for cell in cells}) == 1
    np.testing.assert_allclose(errors, errors[1], rtol=1e-3)


@pytest.mark.parametrize("factors", [(3.0, 1.0, 1.0), (1.0, 5.0, 1.0), (1.0, 1.0, 7.0)])
def test_a_rescaled_model_moves_the_same(factors):
    """Angles as they were, slides and times as many times as large: dimensional analysis."""
    length, weight, time = factors
    slide = pg.Body(name="s", joint="prismatic", axes=((0, 1, 0),), mass=2.0, stiffness=30.0,
                    damping=0.4, rest=0.1, v=(0.5,))  # fmt: skip
    forces = (pg.Motor(name="m", body="s", torque=0.7),
              pg.Servo(name="servo", body="a", kp=3.0, kd=0.2, target=0.4),
              pg.Spring(name="spring", body="a", stiffness=20.0, damping=0.1, rest=0.3),
              pg.Force(name="push", kind="wrench", body="a", force=(1.0, 2.0, 0.0)))  # fmt: skip
    model = pg.Model(bodies=(slide, mass("a", "s", damping=0.05)), forces=forces, **DOWN)
    scaled = rescaled(model, length=length, mass=weight, time=time)
    runs = [
        pg.simulate(pg.Mechanism(m), t_end=0.5 * t, step=0.01 * t, method="rk4", estimate=False)
        for m, t in ((model, 1.0), (scaled, time))
    ]
    np.testing.assert_allclose(runs[1].q, runs[0].q * (length, 1.0), rtol=1e-10, atol=1e-12)
    energy = runs[0].energy * weight * (length / time) ** 2
    np.testing.assert_allclose(runs[1].energy, energy, rtol=1e-9)


def test_every_shape_of_a_body_is_rescaled():
    box = {"kind": "box", "size": (0.1, 0.2, 0.4), "position": (0.1, 0.0, 0.2)}
    ball = {"kind": "sphere", "radius": 0.3, "role": "collision", "colour": "#ff0000"}
    rod = {"kind": "capsule", "radius": 0.1, "length": 0.5, "role": "visual"}
    derived = ("mass", "com", "inertia", "tip")
    body = pg.Body(name="a", shapes=(box, ball, rod), density=500, derived=derived)
    scaled = rescaled(pg.Model(bodies=[body]), length=2.0, mass=3.0).body("a")
    sizes = [s.size or (s.radius, s.length) for s in scaled.shapes]
    assert sizes == [(0.2, 0.4, 0.8), (0.6, None), (0.2, 1.0)]
    assert scaled.shape == scaled.shapes[0]
    assert scaled.shapes[0].position == (0.2, 0.0, 0.4)
    assert [s.role for s in scaled.shapes] == ["both", "collision", "visual"]
    assert scaled.shapes[1].colour == (1.0, 0.0, 0.0)
    assert scaled.mass == pytest.approx(3 * body.mass, rel=1e-14)  # from density and volume
    np.testing.assert_allclose(scaled.inertia, 12 * np.array(body.inertia), rtol=1e-13, atol=1e-13)


def test_an_interruption_stops_the_runs_of_the_other_threads():
    begun = threading.Event()

    def interrupt(share: float) -> None:
        begun.wait(60)
        raise KeyboardInterrupt

    work = stability.Work(interrupt)

    def run() -> bool:
        begun.set()
        return work.stopped.wait(60)

    with ThreadPoolExecutor(2) as pool:
        short, long = pool.submit(work.goes_on), pool.submit(run)
        with pytest.raises(KeyboardInterrupt):
            list(work.finished([short, long], [0.5, 0.5]))
    assert long.result()
    assert not work.goes_on()


def test_a_map_ends_in_time_and_says_which_runs_are_missing(monkeypatch):
    """Short runs come first. The clock says that the time is over after the first cell."""
    clock, honest = [0.0], stability.judged

    def judged(*given):
        clock[0] = 1e3
        return honest(*given)

    monkeypatch.setattr(stability, "judged", judged)
    monkeypatch.setattr(stability, "time", SimpleNamespace(perf_counter=lambda: clock[0]))
    mech, q = stiff_pendulum(1e4)
    options = {"values": [1e4], "methods": ["rk4", "radau5"], "t_end": 1.0, "threads": 1}
    seen: list[pg.StabilityMap] = []
    steps = (1e-3, 1e-1)
    found = pg.stability_map(mech, q, within=60, steps=steps, partial=seen.append, **options)
    assert found.complete
    done = [(c.method, c.step) for c in found.cells if c.status != "NOT_RUN"]
    assert done == [("rk4", 1e-1)]
    assert len(found.cells) == 4
    assert all("60 s" in c.text for c in found.cells if c.status == "NOT_RUN")
    assert "Out of time after 1 of 4 runs" in found.advice
    (part,) = seen
    assert (len(part.cells), part.complete) == (1, False)
    assert "   U" in str(part)  # in its own column, with a space for what is not known yet
    with pytest.raises(pg.InputError, match=r"within.*-1"):
        pg.stability_map(mech, q, within=-1, **options)


def test_a_cell_at_fault_loses_no_other_cell(monkeypatch):
    honest = stability.judged

    def judged(cell, *given):
        return honest(cell, *given) if cell.method == "radau5" else 1 // 0

    monkeypatch.setattr(stability, "judged", judged)
    mech, q = stiff_pendulum(1e4)
    options = {"values": [1e4], "methods": ["rk4", "radau5"], "steps": [1e-3], "t_end": 0.1}
    bad, good = pg.stability_map(mech, q, **options).cells
    assert (bad.status, good.status) == ("FAILED", "OK")
    assert "ZeroDivisionError" in bad.text


@pytest.mark.parametrize(("half", "facts"), [
    (np.inf, "half of the step ended early"), (1e-14, "half of the step has error 1.0e-14"),
])  # fmt: skip
def test_an_order_that_is_not_known_is_said_in_words(half, facts):
    """The run at half of the step failed, or is as accurate as the reference."""
    model = built_in("pendulum").model
    mech, t = pg.Mechanism(model), np.linspace(0.0, 0.1, 5)
    known, whole, other = (
        pg.simulate(mech, t_end=0.1, t_eval=t, method="rk4", step=0.01) for _ in range(3)
    )
    whole = dataclasses.replace(whole, q=whole.q + 0.1)
    status = pg.Status.DONE if np.isfinite(half) else pg.Status.NOT_FINITE
    moved = other.q + (half if np.isfinite(half) else 0.0)
    other = dataclasses.replace(other, q=moved, status=status)
    motion = KnownMotion(known, 1e-12, "known", 1.0, 1.0)
    cell = judged(Cell(1.0, "rk4", 0.01, Verdict.OK, ""), 1e-3, mech, whole, other, motion)
    assert cell.status != "OK"
    assert facts in cell.text


def test_a_refused_axis_lists_those_that_apply():
    facts = r"friction varies contacts.*choose one of speed, step$"
    with pytest.raises(pg.InputError, match=facts):
        pg.stability_map(built_in("pendulum").model, axis="friction")


def test_gaits_and_switches_of_a_scenario_act_in_a_map():
    """A pendulum that is released at 0.5 s, and legs whose gait holds them up."""
    lock = pg.Constraint(name="lock", kind="weld", body="a", active=True)
    off = pg.Scenario(name="off", switches=[{"t": 0.5, "constraint": "lock", "active": False}])
    bob = mass("a", q=(1.0,))
    model = pg.Model(bodies=(bob,), constraints=(lock,), scenarios=(off,), **DOWN)
    held, duration = stability.in_scenario(model, "off")
    assert (len(held.scenarios[0].switches), duration) == (1, 1.0)
    given = {"axis": "step", "values": [1e-2], "methods": ["rk4"]}
    assert one_cell(model, scenario="off", **given).status == "OK"
    trot = built_in("quadruped_hips").model
    kept, _ = stability.in_scenario(trot, "trot")
    assert kept.scenarios[0].gait == trot.scenario("trot").gait
    assert any(kept.body(b.name).q != b.q for b in trot.bodies)  # the gait's own start


@pytest.mark.parametrize(("accuracy", "fact"), [(2e-3, "known to 2.0e-03"), (np.inf, "not known")])
def test_a_motion_that_is_not_known_is_said_in_words(accuracy, fact):
    """A sentence said that it was known to inf only."""
    motion = KnownMotion(SimpleNamespace(), accuracy, "dop853", 1.0, 1.0)
    assert fact in motion.known
    assert "inf" not in motion.known
