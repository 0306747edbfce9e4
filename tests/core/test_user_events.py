"""Events of the user: located to rounding, counted by direction, and terminal."""

import math

import numpy as np
import pytest

import pgraph_core as pg

G = 9.81
METHODS = [
    {}, {"method": "dopri5"}, {"method": "rk4", "step": 1e-2}, {"method": "radau5"},
    {"method": "radau5", "step": 2e-2},
]  # fmt: skip


def falling(**contact):
    ball = pg.Body(name="ball", joint="prismatic", axes=((0, 0, 1),), mass=1.0, q=(1.0,))
    floor = pg.Contact(name="floor", body="ball", points=((0, 0, 0),), **contact)
    contacts = (floor,) if contact else ()
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
    tolerance = 1e-12
    assert abs(run.t[-1] - exact) < tolerance
    assert abs(run.q[-1, 0]) < 1e-12
    assert (len(run.user_events), run.user_events[0].t) == (1, run.t[-1])
    solved = 2e-10 if options.get("method") == "radau5" else 0.0  # the equations of its steps
    assert run.error_estimate < max(10 * tolerance, solved)


@pytest.mark.parametrize(("options", "frames"), list(zip(METHODS[:4], (2, 1001, 2, 1001))))
def test_events_of_an_oscillation_have_their_closed_form(options, frames):
    """x = cos 2t at 0.5: rising and falling, and each alone."""
    level = 0.5
    events = [crossing(level, direction=way) for way in (0, 1, -1)]
    given = {"rtol": 1e-11} if "step" not in options else {"step": 1e-3}
    run = pg.simulate(swinging(), t_end=5.0, events=events, frames=frames, **{**options, **given})
    first, period = np.arccos(level) / 2, np.pi
    down = np.arange(first, 5.0, period)
    up = np.arange(period - first, 5.0, period)
    for number, expected in enumerate((np.sort(np.append(up, down)), up, down)):
        found = [event.t for event in run.user_events if event.number == number]
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8)
    assert [event.t for event in run.user_events] == sorted(e.t for e in run.user_events)
    at = run.user_events[0]
    np.testing.assert_allclose(at.q[0], level, atol=1e-12)
    assert "at 0.5" in str(at)
    assert run.t[-1] == 5.0
    assert len(run.t) == frames


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


@pytest.mark.parametrize(("direction", "impacts"), [(-1, 0), (1, 1)])
def test_a_run_that_stops_near_an_impact_lists_events_up_to_its_end(direction, impacts):
    """The ball passes 1 mm and lands within one step, and passes 1 mm again right after it."""
    stop = crossing(1e-3, terminal=True, direction=direction)
    run = pg.simulate(falling(law="complementarity", restitution=0.5), step=1e-3, events=stop)
    times = [event.t for event in run.events]
    assert times == pytest.approx([np.sqrt(2 / G)] * impacts + [run.t[-1]], abs=1e-6)


def broken(t, q, v):
    raise ValueError("no luck")


@pytest.mark.parametrize(
    ("events", "key"),
    [
        ([lambda t, q, v: np.nan], "finite"),
        ([lambda t, q, v: q], "finite"),
        ([lambda t, q, v: np.ones(3)], "finite"),
        ([lambda t, q, v: "far"], "finite"),
        ([lambda t, q, v: np.nan if t > 0.5 else 1.0], r"nan at t = 0\.5"),
        ([broken], "ValueError: no luck"),
        ([3.0], "function"),
        ("stop", "list"),
        ([crossing(1.0, terminal=True)], "zero"),
        ([crossing(0.5, terminal="yes")], "terminal"),
        ([crossing(0.5, direction="up")], "direction"),
        ([crossing(0.5, direction=5)], "direction"),
    ],
)
def test_events_that_do_not_fit_are_refused(events, key):
    body = pg.Body(name="b", inertia=(1, 1, 1), q=(1.0,), stiffness=1.0)
    array = pg.Body(name="c", com=(0, 0, -1), inertia=(1, 1, 1))
    with pytest.raises(pg.InputError, match=key):
        pg.simulate(pg.Model(bodies=(body, array)), t_end=2.0, events=events)


COARSE = [{}, {"rtol": 1e-4}, {"method": "dopri5"}, {"method": "rk4", "step": 1e-2}]


@pytest.mark.parametrize(
    ("options", "frames", "above"),
    list(zip(2 * COARSE, 2 * (2, 1001, 1001, 2), 4 * (5e-4,) + 4 * (0.1,))),
)
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


@pytest.mark.parametrize("options", [{}, {"method": "rk4", "step": 1e-2}])
def test_a_zero_that_is_touched_or_lasts_is_one_event(options):
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


SHAPES = {
    "corner": lambda x: abs(x),
    "square": lambda x: x * x,
    "fourth power": lambda x: x**4,
    "cube": lambda x: x**3,
    "fifth power": lambda x: x**5,
    "cube root": lambda x: math.copysign(abs(x) ** (1 / 3), x),
    "jump": lambda x: 1 if x > 0.0 else -1,
}


@pytest.mark.parametrize("options", [{}, {"method": "rk4", "step": 1e-2}], ids=["dop853", "rk4"])
@pytest.mark.parametrize("place", [0.5, 0.503, 0.1234567, 1 / 3])
@pytest.mark.parametrize("shape", SHAPES)
def test_zeros_of_any_shape_are_one_event(shape, place, options):
    """0.5 is at an end of a step. Flat zeros were many events, and corners none."""
    value = SHAPES[shape]
    events = [lambda t, q, v: value(q[0] - place), lambda t, q, v: abs(value(q[0] - place)) + 1e-6]
    body = pg.Body(name="a", mass=1.0, joint="prismatic", axes=(0, 0, 1), v=1.0)
    model = pg.Model(bodies=[body], gravity=(0, 0, 0))
    run = pg.simulate(model, t_end=1.0, events=events, **options)
    assert [event.number for event in run.user_events] == [0]
    assert abs(run.user_events[0].t - place) < 1e-8


SHARP = {
    "line": lambda x: x,
    "kink": lambda x: min(x, 0.01 * x),
    "cube": lambda x: x**3,
    "jump": lambda x: 1 if x > 0.0 else -1,
}


@pytest.mark.parametrize("far", [0.0, 100.0])
@pytest.mark.parametrize("shape", SHARP)
def test_an_event_of_any_shape_is_located_to_rounding_in_few_looks(shape, far):
    """Secants alone are slow at kinks and flat zeros, and bisections need 52 looks.

    Where the time is large, an instant is what rounding leaves of the time, not of the step.
    """
    body = pg.Body(name="a", mass=1.0, joint="prismatic", axes=(0, 0, 1), q=far, v=1.0)
    model = pg.Mechanism(pg.Model(bodies=[body], gravity=(0, 0, 0)))
    given = {"method": "rk4", "step": 1e-2, "t_start": far, "frames": 2, "estimate": False}
    bisections, behind, others = 52, 12, 20  # others: rates, turns, and where it has left zero
    for place in np.linspace(0.1, 0.19, 4) + 0.003:
        met = far + place
        looks = [0]

        def event(t, q, v, met=met, looks=looks):
            looks[0] += abs(q[0] - met) < 0.0075  # in its step, which begins 3 mm before it
            return SHARP[shape](q[0] - met)

        run = pg.simulate(model, t_end=far + 0.25, events=event, **given)
        assert abs(run.user_events[0].q[0] - met) <= 8 * np.finfo(float).eps * max(1.0, met)
        assert looks[0] <= bisections + behind + others


@pytest.mark.parametrize("given", [{}, {"method": "rk4", "step": 1e-2}])
def test_values_far_from_zero_are_looked_at_alike_however_many_there_are(given):
    """Each one was looked at once more in each part for each of the others."""
    counts = []
    for number in (1, 10):
        looks = [0]

        def far(t, q, v, looks=looks):
            looks[0] += 1
            return 1.0

        pg.simulate(falling(), t_end=0.4, frames=2, events=number * [far], **given)
        counts.append(looks[0] / number)
    assert counts[1] == counts[0]


@pytest.mark.parametrize("method", ["rk4", "dop853", "radau5", "gauss6"])
@pytest.mark.parametrize("later", [0.355, 0.363, 0.39])
def test_a_touch_before_another_event_in_its_step_is_found(later, method):
    events = [lambda t, q, v: (q[0] - 0.353) ** 2, lambda t, q, v: q[0] - later]
    body = pg.Body(name="a", mass=1.0, joint="prismatic", axes=(0, 0, 1), v=1.0)
    model = pg.Model(bodies=[body], gravity=(0, 0, 0))
    run = pg.simulate(model, t_end=0.6, frames=3, method=method, step=0.1, events=events)
    assert [event.number for event in run.user_events] == [0, 1]
    np.testing.assert_allclose([e.t for e in run.user_events], [0.353, later], atol=1e-8)


@pytest.mark.parametrize("method", ["rk4", "dop853"])
@pytest.mark.parametrize("k", [3, 7])
def test_a_flat_zero_between_two_crossings_of_another_event(k, method):
    """The sign after an exact zero was that at the end of the interval, and a run never ended."""
    calls = [0]

    def flat(t, q, v):
        calls[0] += 1
        assert calls[0] < 20_000
        return (q[0] - 0.511) ** k

    events = [flat, lambda t, q, v: (q[0] - 0.5109) * (q[0] - 0.5111)]
    body = pg.Body(name="a", mass=1.0, joint="prismatic", axes=(0, 0, 1), v=1.0)
    model = pg.Model(bodies=[body], gravity=(0, 0, 0))
    run = pg.simulate(model, t_end=1.0, frames=5, method=method, step=0.1, events=events)
    assert [event.number for event in run.user_events] == [1, 0, 1]


def test_corners_of_an_oscillation_are_one_event_each():
    """Some were two, 1e-12 s apart."""
    body = pg.Body(name="a", mass=1.0, joint="prismatic", axes=(0, 0, 1), v=1.0)
    events = [lambda t, q, v: abs(math.sin(20.0 * q[0] + 0.3))]
    run = pg.simulate(pg.Model(bodies=[body], gravity=(0, 0, 0)), t_end=2.0, events=events)
    expected = (np.arange(1, 13) * math.pi - 0.3) / 20.0
    np.testing.assert_allclose([e.t for e in run.user_events], expected, atol=1e-8)


@pytest.mark.parametrize(
    "value", [lambda x: max(x, 0.0), lambda x: int(x > 0.0)], ids=["ramp", "step"]
)
def test_a_value_that_leaves_zero_is_named(value):
    events = [lambda t, q, v: value(q[0] - 0.5)]
    body = pg.Body(name="a", mass=1.0, joint="prismatic", axes=(0, 0, 1), v=1.0)
    run = pg.simulate(pg.Model(bodies=[body], gravity=(0, 0, 0)), t_end=1.0, events=events)
    assert not run.user_events
    assert any("leaving zero is not an event" in text for text in run.notices)
    begins = pg.simulate(falling(), t_end=1.0, events=[lambda t, q, v: t])
    assert not any("leaving zero" in text for text in begins.notices)


@pytest.mark.parametrize("options", [{}, {"method": "dopri5"}, {"method": "rk4", "step": 0.1}])
@pytest.mark.parametrize(("frames", "between"), [(2, 1e-5), (11, 0.05), (101, 1e-3)])
def test_a_zero_exactly_at_a_frame_hides_none_right_after_it(options, frames, between):
    """(t - 0.5) (t - 0.5 - between) is zero at a frame and once more soon after."""

    def product(way):
        function = lambda t, q, v: (t - 0.5) * (t - 0.5 - between)  # noqa: E731
        function.direction = way
        return function

    events = [product(way) for way in (0, 1, -1)]
    run = pg.simulate(falling(), t_end=1.0, events=events, frames=frames, **options)
    for number, expected in enumerate(([0.5, 0.5 + between], [0.5 + between], [0.5])):
        found = [event.t for event in run.user_events if event.number == number]
        np.testing.assert_allclose(found, expected, atol=1e-11)


@pytest.mark.parametrize(
    ("options", "speed"),
    list(zip([*METHODS, {"method": "rk4", "step": 0.5}], 3 * (0.01, 4.0, 1.0))),
)
def test_a_throw_from_zero_comes_back_through_it(options, speed):
    """It is zero at the start, and again at 2 v / g, however soon."""
    body = pg.Body(name="a", mass=1.0, joint="prismatic", axes=(0, 0, 1), v=speed)
    model = pg.Model(bodies=[body], gravity=(0, 0, -G))
    run = pg.simulate(model, t_end=1.0, events=[crossing(0.0)], **options)
    np.testing.assert_allclose([e.t for e in run.user_events], [2 * speed / G], atol=1e-10)


def test_terminal_is_the_number_of_the_event_that_ends_the_run():
    """x = cos 2t passes 0 for the third time at 5 pi / 4."""
    run = pg.simulate(swinging(), t_end=9.0, events=[crossing(0.0, terminal=3)])
    assert run.status is pg.Status.STOPPED
    assert len(run.user_events) == 3
    assert abs(run.t[-1] - 1.25 * np.pi) < 1e-7
    for wrong in (-1, 2.5, "yes"):
        with pytest.raises(pg.InputError, match="terminal"):
            pg.simulate(swinging(), t_end=1.0, events=[crossing(0.0, terminal=wrong)])


@pytest.mark.parametrize("method", ["rk4", "dopri5", "moreau_jean"])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_a_zero_exactly_at_a_limit_is_one_event_for_each_hit(method, e):
    """It reaches zero and turns there. It was two events where rounding led beyond zero, and none
    in time stepping, which takes the impact a closed gap before."""
    for limit in (0.0, 0.3, -0.7):
        body = pg.Body(
            name="a", mass=1.0, joint="prismatic", axes=(1, 0, 0), q=(limit - 0.7,), v=(1.7,),
            limits=(None, limit), limit_restitution=e,
        )  # fmt: skip
        events = [crossing(limit, direction=way) for way in (0, 1, -1)]
        events.append(lambda t, q, v: v[0])  # it jumps there, to or through zero
        model = pg.Model(bodies=[body], gravity=(0, 0, 0))
        # time stepping meets the limit a closed gap before it, which is 2e-8 here
        near = 2e-8 / 1.7 if method == "moreau_jean" else 1e-9
        for step in (0.1, 0.013):
            run = pg.simulate(model, t_end=0.9, step=step, method=method, events=events)
            assert [event.number for event in run.user_events] == [0, 1, 3]
            assert [e.t for e in run.user_events] == pytest.approx([0.7 / 1.7] * 3, abs=near)


@pytest.mark.parametrize("given", [{}, {"rtol": 1e-8}, {"method": "rk4", "step": 5e-3}])
@pytest.mark.parametrize(
    ("push", "speed", "level"), [(1.2573, -1.607, 0.095), (-4.0, 2.0, -0.2), (9.0, -0.5, 0.1)]
)
def test_events_are_zeros_where_a_run_goes_on_with_limits(given, push, speed, level):
    """A slider that comes near a limit: the run goes on with it, and events keep their values."""
    slider = pg.Body(
        name="b", joint="prismatic", axes=(1, 0, 0), mass=1.0, v=(speed,), limits=(-0.35, 0.14),
        limit_restitution=0.5,
    )  # fmt: skip
    motor = pg.Motor(name="m", body="b", torque=push)
    model = pg.Model(bodies=[slider], forces=[motor], gravity=(0, 0, 0))
    run = pg.simulate(model, events=crossing(level), t_end=1.0, frames=15, **given)
    assert "began" in run.header
    assert all(abs(event.q[0] - level) < 1e-8 for event in run.user_events)
    assert (np.diff([event.t for event in run.user_events]) > 1e-6).all()


@pytest.mark.parametrize("corners", [1, 4])
@pytest.mark.parametrize("way", [0, -1, 1])
def test_a_speed_that_friction_brings_to_rest_is_one_event(corners, way):
    """It is at v / (μ g). Rounding about zero was hundreds of events, up to two steps late."""
    x = 0.1 * np.array([(1, 1, -1), (-1, 1, -1), (1, -1, -1), (-1, -1, -1)])[:corners]
    motions = [("translate", (1, 0, 0)), ("translate", (0, 0, 1))]
    box = pg.Body(
        name="b", joint="compound", motions=motions, mass=1.0, inertia=(0.1,) * 3,
        q=(0.0, 0.1), v=(0.3, 0.0),
    )  # fmt: skip
    if corners > 1:
        box = pg.Body(
            name="b", joint="free", mass=1.0, inertia=(0.1,) * 3, q=(0, 0, 0.1, 1, 0, 0, 0),
            v=(0, 0, 0, 0.3, 0, 0),
        )  # fmt: skip
    floor = pg.Contact(name="f", body="b", points=x, friction=0.3)
    model = pg.Model(bodies=[box], contacts=[floor])
    i = 0 if corners == 1 else 3
    events = [lambda t, q, v: v[i]]
    events[0].direction = way
    run = pg.simulate(model, t_end=0.15, step=1e-3, events=events, estimate=corners == 1)
    expected = [0.3 / (0.3 * 9.81)] if way < 1 else []
    assert [event.t for event in run.user_events] == pytest.approx(expected, abs=1e-6)
    assert not any("event" in str(notice) for notice in run.notices)


def wheels_beside(ball_at, restitution=0.0):
    """A falling ball beside two wheels that a clutch joins, at 0.7 and -0.5 rad/s."""
    bodies = [
        pg.Body(
            name="ball", joint="free", q=(0, 0, ball_at, 1, 0, 0, 0), mass=1.0,
            inertia=(0.004,) * 3, shape={"kind": "sphere", "radius": 0.1},
        ),
        *(
            pg.Body(name=name, link=(5, i, 0), inertia=(1, 1, 1), v=(v,))
            for i, (name, v) in enumerate({"a": 0.7, "b": -0.5}.items())
        ),
    ]  # fmt: skip
    clutch = pg.Velocity(
        name="clutch", body="a", coefficients={"a": (1,), "b": (-1,)}, active=False
    )
    floor = pg.Contact(name="floor", body="ball", restitution=restitution)
    return pg.Model(bodies=bodies, constraints=[clutch], contacts=[floor])


@pytest.mark.parametrize("start", [0.0, 1.3])
@pytest.mark.parametrize(
    "given",
    [
        {"rtol": 1e-9}, {"method": "rk4", "step": 2e-3}, {"method": "dop853", "step": 3e-3},
        {"method": "moreau_jean", "step": 2e-3},
    ],
)  # fmt: skip
@pytest.mark.parametrize("of", ["frame", "impact", "none"])
def test_an_event_a_switch_and_a_frame_or_an_impact_at_one_time(of, given, start):
    """Each acts once, whichever of them rounding puts first. Impacts are located to 1e-14 s."""
    rng = np.random.default_rng(7)
    for _ in range(4):
        height, length, frames = rng.uniform(0.02, 0.2), rng.uniform(0.4, 0.55), 101
        at = start + {
            "frame": length * 0.96, "impact": math.sqrt(2 * height / G), "none": 0.3 * length,
        }[of]  # fmt: skip
        times = np.linspace(start, start + length, frames)
        at = float(times[96]) if of == "frame" else at
        run = pg.simulate(
            wheels_beside(0.1 + height, rng.choice([0.0, 0.5])), t_start=start,
            t_end=start + length, frames=frames, switches=((at, "clutch", True),), estimate=False,
            events=[lambda t, q, v, at=at: t - at, lambda t, q, v: q[2] - 50.0], **given,
        )  # fmt: skip
        assert [abs(e.t - at) < 1e-13 for e in run.user_events] == [True]
        angle = np.where(run.t < at, 0.7 * (run.t - start), 0.7 * (at - start) + 0.1 * (run.t - at))
        assert run.q[:, 7] == pytest.approx(angle, abs=1e-12)
