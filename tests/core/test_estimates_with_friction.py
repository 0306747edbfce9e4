"""The error estimate where the impulse solver or friction limits the accuracy of a run."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import pgraph_core as pg

from ..nights import combined

NONE = np.zeros((3, 3))


def wedge_and_ball(ratio, size, slope, turned):
    """A ball of `ratio` times the mass on a wedge that slides on the ground, without friction."""
    g = 10.0 * size
    normal = np.array([np.sin(slope), 0.0, np.cos(slope)])
    turn = (np.cos(0.5 * slope), 0, np.sin(0.5 * slope), 0)
    shape = {
        "kind": "box", "size": (40 * size, 4 * size, size), "rotation": turn,
        "position": tuple((-0.5 * size * normal).tolist()),
    }  # fmt: skip
    line = {"joint": "compound", "inertia": NONE}
    wedge = pg.Body(
        name="w", joint="prismatic", axes=((1, 0, 0),), mass=1.0, inertia=NONE, shape=shape
    )
    ball = pg.Body(
        name="b", motions=(("translate", (1, 0, 0)), ("translate", (0, 0, 1))), mass=ratio,
        q=tuple((size * normal[[0, 2]]).tolist()), shape={"kind": "sphere", "radius": size}, **line,
    )  # fmt: skip
    pair = pg.Contact(name="c", body="b", other="w", friction=0.0, restitution=0.0)
    bodies = (ball, wedge) if turned else (wedge, ball)
    model = pg.Model(bodies=bodies, contacts=(pair,), gravity=(0, 0, -g))
    sine, cosine = np.sin(slope), np.cos(slope)
    whole = 1.0 + ratio * sine**2
    back, down = -ratio * g * sine * cosine / whole, g * sine * (1.0 + ratio) / whole
    return model, (back, down * cosine + back, -down * sine)


@pytest.mark.parametrize(
    ("turned", "ratio", "size", "step"),
    combined([False, True], [1e4, 1.0, 1e-4], [1.0, 1e-4], [1e-3, 1e-4]),
)
def test_the_error_of_the_impulse_solver_is_in_the_estimate(turned, ratio, size, step):
    """It does not shrink with the step: a light wedge under a heavy ball."""
    model, accelerations = wedge_and_ball(ratio, size, 0.5, turned)
    run = pg.simulate(model, t_end=0.3, step=step)
    off = 0.0
    for q, start, a in zip(
        (run["w"], *run["b"].T), (0.0, *model.body("b").q), accelerations, strict=True
    ):
        off = max(off, np.abs(q - start - 0.5 * a * run.t**2).max())
    assert off < 10 * run.error_estimate + 1e-12 * size


def pushed_back_and_forth(share, w, mass, t):
    """(place, speed) of a box at times t; friction is `share` of the largest push, in units of it.

    By phases: it slips until its speed is zero, and sticks until the push exceeds friction.
    """
    place, speed, begin, way = 0.0, 0.0, np.arcsin(share) / w, 1.0
    times, states = [0.0, begin], [(0.0, 0.0, 0.0), (0.0, 0.0, 1.0)]

    def flown(s, since, x, v, way):
        """Place and speed of slip in the direction `way` since a time."""
        u = np.cos(w * since) - np.cos(w * s)
        rate = v + (u / w - way * share * (s - since)) / mass
        far = (np.sin(w * since) - np.sin(w * s)) / w**2 + np.cos(w * since) * (s - since) / w
        return x + v * (s - since) + (far - 0.5 * way * share * (s - since) ** 2) / mass, rate

    while begin < t[-1]:
        grid = begin + np.linspace(1e-3, 2.0, 4000) * np.pi / w
        rates = way * flown(grid, begin, place, speed, way)[1]
        k = int(np.argmax(rates < 0.0))
        low = grid[k - 1] if k else begin + 1e-9 / w
        slip = (begin, place, speed, way)
        end = brentq(lambda s, slip=slip: flown(s, *slip)[1], low, grid[k], xtol=1e-15)
        place, speed = float(flown(end, begin, place, speed, way)[0]), 0.0
        push = np.sin(w * end)
        states.append((place, 0.0, 0.0))
        times.append(end)
        if abs(push) <= share:  # it sticks until the push is strong enough, either way
            turns = np.arcsin(share) + np.pi * np.arange(0, 2 * w * t[-1])
            begin = float(turns[turns > w * end][0] / w)
            states.append((place, 0.0, float(np.sign(np.sin(w * begin)))))
            times.append(begin)
        else:
            begin, states[-1] = end, (place, 0.0, float(np.sign(push)))
        way = states[-1][2]
    found = np.zeros(len(t))
    for (a, b), (x, v, way) in zip(pairwise([*times, np.inf]), states):
        now = (t >= a) & (t < b)
        found[now] = flown(t[now], a, x, v, way)[0] if way else x
    return found


@pytest.mark.parametrize(
    ("share", "rtol", "size"),
    combined([0.2, 0.5, 0.9], [1e-6, 1e-8, 1e-10], [1.0, 1e-3]),
)
def test_event_driven_friction_that_turns_many_times(share, rtol, size):
    """A box that is pushed back and forth slips, sticks and slips the other way."""
    mass, w, push = 2.0, 7.0, 5.0 * size
    mu = share * push / (mass * 10.0 * size)
    box = pg.Body(
        name="b", joint="compound", mass=mass, inertia=NONE,
        motions=(("translate", (1, 0, 0)), ("translate", (0, 0, 1))),
    )  # fmt: skip
    floor = pg.Contact(name="c", body="b", points=((0, 0, 0),), friction=mu, restitution=0.0)
    model = pg.Model(bodies=(box,), contacts=(floor,), gravity=(0, 0, -10.0 * size))
    run = pg.simulate(
        model, t_end=3.0, rtol=rtol, tau=sine_push(push, w), frames=101, estimate=True
    )
    known = push * pushed_back_and_forth(share, w, mass, run.t)
    off = np.abs(run.q[:, 0] - known).max()
    assert off < 10 * run.error_estimate + 1e-12 * size, (off, run.error_estimate)


@cache  # compiled once
def sine_push(size, w):
    from numba import njit

    @njit
    def push(t, q, v):
        return np.array([size * np.sin(w * t), 0.0])

    return push


@cache
def oscillation(rate, friction, creep, times):
    """Return the places of a mass of 1 kg at these times."""
    return solve_ivp(
        lambda _, y: (y[1], -(rate**2) * y[0] - friction * y[1] / np.hypot(y[1], creep)),
        (0.0, times[-1]), (0.0, 1.0), "DOP853", times, rtol=1e-13, atol=1e-16 / rate,
        max_step=0.01 / rate,
    ).y[0]  # fmt: skip


@pytest.mark.parametrize(
    ("stiffness", "friction", "options"),
    combined(
        [1e2, 1e4, 1e6], [1e-4, 1e-3, 1e-1],
        [{}, {"rtol": 1e-6}, {"method": "radau5", "rtol": 1e-8}],
    ),
)  # fmt: skip
def test_joint_friction_of_a_fast_oscillator(stiffness, friction, options):
    """f v / sqrt(v^2 + c^2), c = 1e-3 m/s, whose bend is narrow in time."""
    rate, creep = np.sqrt(stiffness), 1e-3
    body = pg.Body(
        name="b", joint="prismatic", inertia=NONE, stiffness=(stiffness,), v=(1.0,),
        friction=(friction,),
    )  # fmt: skip
    run = pg.simulate(
        pg.Model(bodies=(body,), gravity=(0, 0, 0)), t_end=30.0 / rate, frames=101, **options
    )
    off = np.abs(run.q[:, 0] - oscillation(rate, friction, creep, tuple(run.t.tolist()))).max()
    assert off < 10 * run.error_estimate + 1e-11 / rate


@pytest.mark.parametrize(("method", "frames"), combined(["rk4", "semi_implicit_euler"], [2, 51]))
def test_joint_friction_that_stops_a_slider_anywhere_in_a_step(method, frames):
    """At 20 phases of a step: the estimate is not below a tenth of the error.

    Over the way of the slide, any friction f has the motion of one slider: f x(f t).
    """
    slide = solve_ivp(
        lambda _, y: (y[1], -y[1] / np.hypot(y[1], 1e-3)), (0.0, 4.0), (0.0, 2.0), "Radau",
        rtol=1e-10, atol=1e-13, dense_output=True,
    ).sol  # fmt: skip
    for phase in np.linspace(0.025, 0.975, 20):
        stop = (30 + phase) * 0.02
        body = pg.Body(name="b", joint="prismatic", inertia=NONE, v=(2.0,), friction=(2.0 / stop,))
        run = pg.simulate(
            pg.Model(bodies=(body,), gravity=(0, 0, 0)), t_end=1.0, frames=frames, step=0.02,
            method=method,
        )  # fmt: skip
        known = slide(2.0 / stop * run.t)[0] * stop / 2.0
        off = np.abs(run.q[:, 0] - known).max()
        assert off < 10 * run.error_estimate + 1e-7, (phase, off, run.error_estimate)


@pytest.mark.parametrize(
    "options",
    [{}, {"rtol": 1e-6}, {"method": "radau5", "rtol": 1e-8}, {"method": "rk4", "step": 2e-3}],
)
@pytest.mark.parametrize(("friction", "push"), [(0.3, 1.0), (0.01, 1.0)])  # it never sticks
def test_the_estimate_has_the_error_of_regularised_friction(options, friction, push):
    """A slider that a push turns again and again, beside exact friction by a comparison."""
    force, sticks = f"={push}*cos(2*t)", f" - {friction}*if(v.m > 0, 1, -1)"
    slider = pg.Body(name="m", joint="prismatic", mass=1.0, inertia=NONE, friction=(friction,))
    runs = []
    for body, text, given in (
        (slider, force, options),
        (slider.model_copy(update={"friction": (0.0,)}), force + sticks, {"rtol": 1e-11}),
    ):
        motor = pg.Motor(name="f", body="m", torque=text)
        model = pg.Model(bodies=(body,), forces=(motor,), gravity=(0, 0, 0))
        runs.append(pg.simulate(model, t_end=10.0, frames=51, **given))
    error = np.abs(runs[0].q - runs[1].q).max()
    assert error < 4.0 * runs[0].error_estimate
