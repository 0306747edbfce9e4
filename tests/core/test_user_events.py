"""Events of the user: located to rounding, counted by direction, and what ends a run."""

from __future__ import annotations

import numpy as np
import pytest

import pgraph_core as pg

G = 9.81
METHODS = [
    {}, {"method": "dopri5"}, {"method": "rk4", "step": 1e-2}, {"method": "radau5"},
    {"method": "radau5", "step": 2e-2}, {"method": "ros2", "rtol": 1e-7},
]  # fmt: skip


def falling(**contact):
    ball = pg.Body(name="ball", joint="prismatic", axes=((0, 0, 1),), mass=1.0, q=(1.0,))
    contacts = ()
    if contact:
        contacts = (pg.Contact(name="floor", body="ball", points=((0, 0, 0),), **contact),)
    return pg.Mechanism(pg.Model(bodies=(ball,), contacts=contacts, gravity=(0, 0, -G)))


def swinging(damping=0.0):
    body = pg.Body(
        name="b", joint="prismatic", axes=((1, 0, 0),), mass=1.0, stiffness=4.0, q=(1.0,),
        damping=damping,
    )  # fmt: skip
    return pg.Mechanism(pg.Model(bodies=(body,), gravity=(0, 0, 0)))


def crossing(level, **attributes):
    def at(t, q, v):
        return q[0] - level

    at.__dict__.update(attributes)
    at.__name__ = f"at {level:g}"
    return at


@pytest.mark.parametrize("options", METHODS)
def test_a_terminal_event_ends_the_run_at_its_root(options):
    """A fall of 1 m: to rounding where the method is exact for parabolas."""
    run = pg.simulate(falling(), t_end=1.0, events=[crossing(0.0, terminal=True)], **options)
    assert run.status is pg.Status.STOPPED
    assert run.status.ok
    assert "at 0" in run.message
    exact = np.sqrt(2 / G)
    tolerance = 1e-6 if options.get("method") == "ros2" else 1e-12
    assert abs(run.t[-1] - exact) < tolerance
    assert abs(run.q[-1, 0]) < 1e-12
    assert (len(run.user_events), run.user_events[0].t) == (1, run.t[-1])
    solved = 2e-10 if options.get("method") == "radau5" else 0.0  # the equations of its steps
    assert run.error_estimate < max(10 * tolerance, solved)


@pytest.mark.parametrize("options", METHODS[:4])
@pytest.mark.parametrize("frames", [2, 1001])
def test_events_of_an_oscillation_are_where_they_are_in_closed_form(options, frames):
    """x = cos 2t at 0.5: rising and falling, and each alone."""
    level = 0.5
    events = [
        crossing(level), crossing(level, direction=1), crossing(level, direction=-1)
    ]  # fmt: skip
    given = {"rtol": 1e-11} if "step" not in options else {"step": 1e-3}
    run = pg.simulate(swinging(), t_end=10.0, events=events, frames=frames, **{**options, **given})
    first, period = np.arccos(level) / 2, np.pi
    down = np.arange(first, 10.0, period)
    up = np.arange(period - first, 10.0, period)
    for number, expected in enumerate((np.sort(np.append(up, down)), up, down)):
        found = [event.t for event in run.user_events if event.number == number]
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8)
    assert [event.t for event in run.user_events] == sorted(e.t for e in run.user_events)
    at = run.user_events[0]
    np.testing.assert_allclose(at.q[0], level, atol=1e-12)
    assert "at 0.5" in str(at)
    assert run.t[-1] == 10.0
    assert len(run.t) == frames


def test_watching_does_not_change_the_motion():
    free = pg.simulate(swinging(0.3), t_end=5.0, frames=51, rtol=1e-10)
    watched = pg.simulate(swinging(0.3), t_end=5.0, frames=51, rtol=1e-10, events=crossing(0.2))
    np.testing.assert_allclose(watched.q, free.q, rtol=0, atol=1e-9)
    assert len(watched.user_events) > 2


@pytest.mark.parametrize("options", [{}, {"rtol": 1e-8}, {"method": "rk4", "step": 1e-3}])
def test_events_between_impacts(options):
    """A ball that bounces at e = 0.5 passes 0.1 m: falling, rising, falling."""
    mech = falling(law="complementarity", restitution=0.5)
    run = pg.simulate(mech, t_end=1.2, events=[crossing(0.1)], **options)
    fall, fast = np.sqrt(2 / G), np.sqrt(2 * G)
    root = np.sqrt((0.5 * fast) ** 2 - 2 * G * 0.1)
    exact = [np.sqrt(1.8 / G), fall + (0.5 * fast - root) / G, fall + (0.5 * fast + root) / G]
    found = [event.t for event in run.user_events]
    np.testing.assert_allclose(found, exact, atol=1e-9 if options else 3e-3)


def test_a_terminal_event_after_an_impact_ends_the_run_there():
    mech = falling(law="complementarity", restitution=0.5)
    top = crossing(0.2, terminal=True, direction=1)
    run = pg.simulate(mech, t_end=1.2, events=[top], rtol=1e-9)
    assert run.status is pg.Status.STOPPED
    assert abs(run.q[-1, 0] - 0.2) < 1e-10
    assert run.v[-1, 0] > 0


def test_events_are_in_files(tmp_path):
    run = pg.simulate(swinging(), t_end=2.0, events=[crossing(0.5)])
    run.save(tmp_path / "run.npz")
    again = pg.Result.load(tmp_path / "run.npz")
    assert [tuple(e[:3]) for e in again.user_events] == [tuple(e[:3]) for e in run.user_events]
    np.testing.assert_array_equal(again.user_events[0].q, run.user_events[0].q)


def broken(t, q, v):
    raise ValueError("no luck")


@pytest.mark.parametrize(
    ("events", "says"),
    [
        ([lambda t, q, v: np.nan], "must return a finite number"),
        ([lambda t, q, v: q], "must return a finite number"),
        ([lambda t, q, v: np.ones(3)], "must return a finite number"),
        ([lambda t, q, v: "far"], "must return a finite number"),
        ([broken], "raised ValueError: no luck"),
        ([3.0], "must be a function"),
        ("stop", "must be a list of functions"),
        ([crossing(1.0, terminal=True)], "zero at the start already"),
        ([crossing(0.5, terminal="yes")], "terminal must be True or False"),
        ([crossing(0.5, direction="up")], "direction must be 1"),
        ([crossing(0.5, direction=5)], "direction must be 1"),
    ],
)
def test_events_that_do_not_fit_are_refused_in_a_sentence(events, says):
    body = pg.Body(name="b", mass=1.0, com=(0, 0, -1), q=(1.0,), stiffness=1.0)
    array = pg.Body(name="c", mass=1.0, com=(0, 0, -1))
    mech = pg.Mechanism(pg.Model(bodies=(body, array)))
    with pytest.raises(pg.InputError, match=says):
        pg.simulate(mech, t_end=2.0, events=events)


def test_a_function_that_fails_on_the_way_is_refused():
    def late(t, q, v):
        return np.nan if t > 0.5 else 1.0

    with pytest.raises(pg.InputError, match=r"gave nan at t = 0\.5"):
        pg.simulate(swinging(), t_end=1.0, events=[late])


# -- what is there for a part of a step only ------------------------------------------------------

COARSE = [{}, {"rtol": 1e-4}, {"method": "dopri5"}, {"method": "rk4", "step": 1e-2}]


@pytest.mark.parametrize("options", COARSE)
@pytest.mark.parametrize("frames", [2, 1001])
@pytest.mark.parametrize("above", [0.1, 0.01, 5e-4])
def test_a_throw_is_above_a_height_for_a_part_of_a_step(options, frames, above):
    """Both crossings, at v/g -+ above/2, and each alone."""
    body = pg.Body(name="a", mass=1.0, joint="prismatic", axes=(0, 0, 1), v=3.0)
    height = 4.5 / G - G * (above / 2) ** 2 / 2
    events = [crossing(height, direction=way) for way in (0, 1, -1)]
    given = {"frames": frames, **options}
    run = pg.simulate(
        pg.Model(bodies=[body], gravity=(0, 0, -G)), t_end=1.0, events=events, **given
    )
    first, last = 3 / G - above / 2, 3 / G + above / 2
    for number, expected in enumerate(([first, last], [first], [last])):
        found = [event.t for event in run.user_events if event.number == number]
        np.testing.assert_allclose(found, expected, atol=1e-11)


def test_events_never_contradict_the_frames():
    """16 zeros of a fast function of time within a few wide steps."""
    run = pg.simulate(falling(), t_end=1.0, events=[lambda t, q, v: np.sin(50 * t + 0.5)])
    expected = (np.pi * np.arange(1, 17) - 0.5) / 50
    np.testing.assert_allclose([e.t for e in run.user_events], expected, atol=1e-12)


@pytest.mark.parametrize("options", [{}, {"method": "rk4", "step": 1e-2}])
def test_zeros_that_are_touched_or_last_are_one_event(options):
    """Zero is touched at 0.3, or lasts from 0.4 to 0.6, or is where the run starts."""
    cases = [
        (lambda t, q, v: (t - 0.3) ** 2, [0.3]),
        (lambda t, q, v: max(0.0, t - 0.6) - max(0.0, 0.4 - t), [0.4]),
        (lambda t, q, v: t, []),
        (lambda t, q, v: (t - 0.3) ** 2 + 1e-6, []),
    ]
    for function, expected in cases:
        run = pg.simulate(falling(), t_end=1.0, events=[function], **options)
        np.testing.assert_allclose([e.t for e in run.user_events], expected, atol=1e-8)


@pytest.mark.parametrize("options", [*COARSE, {"method": "radau5"}, {"method": "rk4", "step": 0.1}])
@pytest.mark.parametrize("frames", [2, 11, 101])
@pytest.mark.parametrize("between", [1e-5, 1e-3, 0.05])
def test_a_zero_exactly_at_a_frame_hides_none_right_after_it(options, frames, between):
    """(t - 0.5) (t - 0.5 - between) is zero at a frame and once more soon after."""

    def product(t, q, v):
        return (t - 0.5) * (t - 0.5 - between)

    def rising(t, q, v):
        return product(t, q, v)

    def falling_at(t, q, v):
        return product(t, q, v)

    rising.__dict__["direction"], falling_at.__dict__["direction"] = 1, -1
    run = pg.simulate(
        falling(), t_end=1.0, events=[product, rising, falling_at], frames=frames, **options
    )
    for number, expected in enumerate(([0.5, 0.5 + between], [0.5 + between], [0.5])):
        found = [event.t for event in run.user_events if event.number == number]
        np.testing.assert_allclose(found, expected, atol=1e-11)


@pytest.mark.parametrize("options", [*METHODS, {"method": "rk4", "step": 0.5}])
@pytest.mark.parametrize("speed", [0.01, 1.0, 4.0])
def test_a_throw_from_zero_comes_back_through_it(options, speed):
    """It is zero at the start, and again at 2 v / g, however soon."""
    body = pg.Body(name="a", mass=1.0, joint="prismatic", axes=(0, 0, 1), v=speed)
    model = pg.Model(bodies=[body], gravity=(0, 0, -G))
    run = pg.simulate(model, t_end=1.0, events=[crossing(0.0)], **options)
    tolerance = 1e-6 if options.get("method") == "ros2" else 1e-10
    np.testing.assert_allclose([e.t for e in run.user_events], [2 * speed / G], atol=tolerance)
