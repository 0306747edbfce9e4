"""Event-driven contacts at steps chosen by their error: what `rtol` asks for is what comes out."""

from __future__ import annotations

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_models.case_models import limited_pendulum

from .test_phases import (
    FEET,
    G,
    block,
    leaning_rod,
    quadruped,
    reference,
    touching,
)

METHODS = ("dopri5", "dop853")


def run(model, **options):
    """An event-driven run that reached its end."""
    done = pg.simulate(pg.Mechanism(model), **options)
    assert done.status.ok, done.message
    return done


@pytest.mark.parametrize("method", METHODS)
def test_a_ball_bounces_and_comes_to_rest_when_it_must(method):
    """All impacts to 1e-9 s and the end of infinitely many, at a loose tolerance."""
    case = reference("bouncing_ball_zeno")["0.8"]
    ball = pg.Body(name="ball", joint="prismatic", axes=((0, 0, 1),), q=(1.0,))
    model = touching(ball, restitution=0.8)
    done = run(model, t_end=case["zeno_time"] + 0.1, method=method, rtol=1e-6, frames=40)
    times = np.array([event.t for event in done.events])
    expected = np.array(case["impact_times"])
    np.testing.assert_allclose(times[: len(expected)], expected, atol=1e-9)
    assert abs(times[-1] - case["zeno_time"]) < 1e-9
    assert done.energy_drift < 1e-12
    assert done.counters["steps"] < 1.1 * done.counters["impacts"]  # parabolas are one step each
    for t, gap in zip(done.t, done.contact_gap["floor"]):  # frames between impacts, on parabolas
        since = expected[expected <= t]
        if len(since) and t < expected[-1]:
            late = t - since[-1]
            up = 0.8 ** len(since) * np.sqrt(2 * G)
            assert abs(gap - (up * late - G * late**2 / 2)) < 1e-9


def test_a_pendulum_chatters_to_rest_on_its_limit():
    case = reference("pendulum_joint_limit")
    done = run(limited_pendulum(), t_end=2.2, rtol=1e-12)
    assert done.header["method"] == "dop853"
    times = np.array([event.t for event in done.events])
    expected = np.array([impact["t"] for impact in case["impacts"]])
    assert len(times) > 25
    np.testing.assert_allclose(times[:-1], expected[: len(times) - 1], atol=1e-9)
    assert abs(times[-1] - case["zeno_time"]) < 1e-9


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("case", reference("falling_rod_stance_to_slip")["slip_events"])
def test_a_falling_rod_slips_at_the_closed_form_angle(case, method):
    done = run(leaning_rod(0.01, case["mu"]), t_end=1.4, method=method, rtol=1e-12)
    slip = done.events[0]
    assert (slip.before, slip.after) == ("stance", "slip")
    assert abs(slip.t - case["time_slip"]) < 1e-9
    assert done.energy_drift < 1e-9


@pytest.mark.parametrize("method", METHODS)
def test_a_sliding_block_stops_where_and_when_it_must(method):
    case = reference("sliding_block_coulomb")["flat"]
    done = run(block(speed=3.0), t_end=2.0, method=method, rtol=1e-8, frames=21)
    np.testing.assert_allclose(done.q[:, 0], case["x"], atol=1e-9)
    np.testing.assert_allclose(done.v[:, 3], case["v"], atol=1e-9)
    assert len(done.events) == 4
    assert all(abs(event.t - case["stop_time"]) < 1e-9 for event in done.events)


def test_a_slide_that_turns_ends_where_smaller_tolerances_say():
    """Friction follows slip that turns and dies: its last speed is no step's to resolve."""
    motions = tuple(("translate", axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1)))
    point = pg.Body(name="p", joint="compound", motions=motions, inertia=((0,) * 3,) * 3,
                    v=(0, 2, 0))  # fmt: skip
    model = touching(point, friction=0.5, ground={"slope": np.radians(20)})
    finest = run(model, t_end=2.0, method="dop853", rtol=1e-12, frames=3)
    for rtol in (1e-5, 1e-8):
        done = run(model, t_end=2.0, method="dop853", rtol=rtol, frames=3)
        assert done.events[-1].after == "stance"
        assert np.abs(done.q - finest.q).max() < 10 * rtol
        assert done.energy_drift < 10 * rtol


@pytest.mark.parametrize(("mu", "degrees", "spin"), [(1.4, 60.0, 0.0), (2.0, 60.0, 8.0)])
def test_painleves_rod_is_named_and_survived(mu, degrees, spin):
    angle, half = np.radians(degrees), 0.5
    rod = pg.Body(
        name="rod",
        joint="planar",
        axes=((1, 0, 0), (0, 0, 1), (0, 1, 0)),
        inertia=((0, 0, 0), (0, half**2 / 3, 0), (0, 0, half**2 / 3)),
        q=(-half * np.cos(angle), half * np.sin(angle), angle),
        v=(1 + half * np.sin(angle) * spin, half * np.cos(angle) * spin, spin),
    )
    done = run(touching(rod, points=((half, 0, 0),), friction=mu), t_end=0.1, rtol=1e-8)
    (notice,) = done.notices
    assert "Painlevé's case" in notice
    assert done.energy_drift < 1e-8


@pytest.mark.parametrize("depth", [1e-4, 1e-6, -1e-6])
def test_a_touch_and_go_within_one_step_is_found(depth):
    """A bob on a spring dips below the ground for a small part of a step, or stays above it."""
    rate, size = 100.0, 0.01
    bob = pg.Body(name="bob", joint="prismatic", stiffness=rate**2, rest=size - depth,
                  q=size - depth - size * np.cos(2.0), v=-size * rate * np.sin(2.0))  # fmt: skip
    floor = pg.Contact(name="floor", body="bob", points=((0, 0, 0),), restitution=0.5)
    model = pg.Model(bodies=(bob,), contacts=(floor,), gravity=(0, 0, 0))
    done = run(model, t_end=0.04, method="dop853", rtol=1e-10)
    if depth < 0:
        assert done.events == ()
        return
    hit = (2.0 - np.arccos(1 - depth / size)) / rate
    assert abs(done.events[0].t - hit) < 1e-9


# -- the quadruped ---------------------------------------------------------------------------------


def test_the_quadruped_drops_on_its_four_feet_and_stands():
    """The same events as at given steps, the ledger to the tolerance."""
    mech, q, v = quadruped(0.6, drop=0.1)
    done = pg.simulate(mech, q, v, t_end=0.5, rtol=1e-8)
    assert done.status.ok, done.message
    first = {name: next(e for e in done.events if e.contact == name) for name in FEET}
    assert all(event.cause.startswith("hit at 1.3") for event in first.values())
    assert done.energy_drift < 1e-6
    given = pg.simulate(mech, q, v, t_end=0.5, method="rk4", step=2.5e-4)
    there = {name: next(e for e in given.events if e.contact == name) for name in FEET}
    assert all(abs(first[name].t - there[name].t) < 1e-8 for name in FEET)
    np.testing.assert_allclose(done.q[-1], given.q[-1], atol=1e-5)
    assert max(-done.contact_gap[name].min() for name in FEET) < 1e-12


def trot(t_end, **options):
    mech = pg.Mechanism(pg.Model.load(pgraph_models.path("quadruped_hips")))
    done = pg.simulate(mech, scenario="trot", t_end=t_end, estimate=False, **options)
    assert done.status.ok, done.message
    return done


def test_the_trot_closes_its_ledger_and_agrees_with_given_steps():
    done = trot(0.8, rtol=1e-8)
    assert done.energy_drift < 1e-7  # the 1e-6, and a digit for other machines
    given = trot(0.8, method="rk4", step=2.5e-4)
    np.testing.assert_allclose(done.q[-1], given.q[-1], atol=5e-5)  # 1e-5 of rk4
    other = trot(0.8, rtol=1e-7, method="dopri5")
    np.testing.assert_allclose(done.q[-1], other.q[-1], atol=1e-5)
    for event in done.events[1:]:
        k = int(np.searchsorted(done.t, event.t))
        following = [e for e in done.events if e.contact == event.contact and e.t <= done.t[k]]
        assert done.phases[event.contact][k] == following[-1].after


def test_what_is_alike_on_both_sides_stays_so():
    """Feet that land in pairs, sliding: their impulses choose no side, and the trunk keeps its way.

    Which impulses act across is not unique: neither foot can move aside against the other.
    """
    mech = pg.Mechanism(pg.Model.load(pgraph_models.path("quadruped")))
    options = {"method": "rk4", "step": 2.5e-4, "estimate": False, "frames": 2}
    done = pg.simulate(mech, scenario="bound", t_end=1.85, **options)
    assert done.status.ok, done.message
    assert done.counters["impacts"] > 10
    assert np.abs(done.v[-1, [0, 1, 5]]).max() < 1e-9  # roll, yaw, aside: it was 0.1 rad/s


@pytest.mark.nightly
@pytest.mark.parametrize("gait", ["trot", "crawl"])
def test_thirty_seconds_of_a_walk_close_their_ledger(gait):
    mech = pg.Mechanism(pg.Model.load(pgraph_models.path("quadruped_hips")))
    done = pg.simulate(mech, scenario=gait, t_end=30.0, rtol=1e-8, estimate=False)
    assert done.status.ok, done.message
    assert done.energy_drift < 1e-6


# -- what the run says of itself -------------------------------------------------------------------


def test_the_estimate_is_honest():
    rod = leaning_rod(0.01, 0.3)
    t = np.linspace(0.0, 0.9, 31)
    fine = run(rod, t_end=0.9, t_eval=t, rtol=1e-13)
    for method in METHODS:
        done = run(rod, t_end=0.9, t_eval=t, rtol=1e-6, method=method)
        true = np.abs(done.q - fine.q).max()
        assert true / 10 < done.error_estimate < 100 * true


def test_a_tolerance_goes_from_event_to_event():
    """By itself, and at fixed steps of an explicit pair; what cannot, says why."""
    ball = pg.Body(name="ball", joint="prismatic", axes=((0, 0, 1),), q=(0.1,))
    model = touching(ball)
    for rtol, method in ((1e-4, "dopri5"), (1e-8, "dop853")):
        done = run(model, t_end=0.2, rtol=rtol)
        assert done.header["why"].startswith(f"{method}: rigid contacts or joint limits, to a ")
        assert done.header["why"].endswith(", from event to event of contacts and limits")
    assert run(model, t_end=0.2).header["method"] == "moreau_jean"
    fixed = run(model, t_end=0.2, method="dopri5", step=1e-2)
    assert abs(fixed.events[0].t - np.sqrt(0.2 / G)) < 1e-12
    for method in ("radau5", "ros2"):
        with pytest.raises(pg.InputError, match="no dense output to find them on"):
            run(model, t_end=0.2, method=method)
    with pytest.raises(pg.InputError, match="moreau_jean takes a step, not a tolerance"):
        run(model, t_end=0.2, method="moreau_jean", rtol=1e-6)
    stop = ball.model_copy(update={"limits": ((None, 0.2),)})
    with pytest.raises(pg.InputError, match="a penalty contact remembers where it sticks"):
        run(touching(stop, law="penalty"), t_end=0.2, rtol=1e-6)


def test_several_shapes_of_a_body_touch_where_events_are_located():
    """A dumbbell dropped flat: both its balls hit at once, and it bounces without turning."""
    ends = tuple({"kind": "sphere", "radius": 0.1, "position": (x, 0, 0)} for x in (-0.3, 0.3))
    body = pg.Body(
        name="b", joint="free", q=(0, 0, 0.6, 1, 0, 0, 0), inertia=0.1 * np.eye(3), shapes=ends
    )
    floor = pg.Contact(name="floor", body="b", restitution=0.5)
    run = pg.simulate(pg.Model(bodies=(body,), contacts=(floor,)), t_end=0.5, rtol=1e-10)
    assert run.header["method"] == "dop853"
    fall = np.sqrt(2 * 0.5 / 9.81)
    after = run.t[-1] - fall
    assert [event.t for event in run.events[:2]] == pytest.approx([fall, fall], abs=1e-12)
    high = 0.1 + 0.5 * 9.81 * fall * after - 0.5 * 9.81 * after**2
    assert run.q[-1, 2] == pytest.approx(high, abs=1e-10)
    assert np.abs(run.q[-1, 4:]).max() < 1e-10


@pytest.mark.parametrize("start", [0.6, 0.1001, 0.1])
def test_the_first_impact_without_restitution_is_an_event(start):
    """A ball that is thrown down from afar, from near by, and where it touches."""
    ball = pg.Body(
        name="b", joint="prismatic", axes=((0, 0, 1),), q=(start,), v=(-1.0,),
        inertia=np.zeros((3, 3)), shape={"kind": "sphere", "radius": 0.1},
    )  # fmt: skip
    floor = pg.Contact(name="floor", body="b", restitution=0.0)
    run = pg.simulate(pg.Model(bodies=(ball,), contacts=(floor,)), t_end=0.5, rtol=1e-9)
    (hit,) = run.events
    exact = (np.sqrt(1 + 2 * 9.81 * (start - 0.1)) - 1) / 9.81
    assert hit.t == pytest.approx(exact, abs=1e-12)
    assert (hit.before, hit.after) == ("swing", "stance")


@pytest.mark.parametrize(
    "options", [{"rtol": 1e-8}, {"method": "dopri5"}, {"method": "rk4", "step": 0.01}]
)
def test_a_joint_between_elastic_limits_hits_them_in_turn(options):
    """What has left one limit, however long the step, does not hit it where the other is hit."""
    body = pg.Body(
        name="b", inertia=np.eye(3), limits=((-3.0, 3.0),), limit_restitution=(1.0,), v=(2.0,)
    )
    run = pg.simulate(pg.Model(bodies=(body,), gravity=(0, 0, 0)), t_end=20.0, **options)
    assert run.status.ok, run.message
    assert [event.t for event in run.events] == pytest.approx(np.arange(1.5, 20, 3.0), abs=1e-10)
    assert run.q[-1, 0] == pytest.approx(2.0, abs=1e-9)


@pytest.mark.parametrize("speed", [1e-9, 1e10])
def test_limits_are_located_at_any_speed(speed):
    """Within a part of the step, not of a second: this fast, 1e-14 s are 1e-4 rad."""
    body = pg.Body(
        name="b", inertia=np.eye(3), limits=((-3.0, 3.0),), limit_restitution=(0.5,), v=(speed,)
    )
    span = 8.0 / speed
    given = {"t_end": span, "method": "rk4", "step": span / 500, "estimate": False}
    run = pg.simulate(pg.Model(bodies=(body,), gravity=(0, 0, 0)), **given)
    assert run.q[-1, 0] == pytest.approx(0.5, abs=1e-13)
