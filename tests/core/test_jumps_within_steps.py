"""The estimate sees forces that jump within a step, wherever in it they do.

Motions of closed form, over all phases of a step, sizes, slopes and steps.
"""

from math import gamma, tan
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.dynamics.states import differences

from ..nights import combined

PHASES = np.linspace(0.0125, 0.9875, 40)
SIZES = [1.0, 1e-6, 1e6]
NONE = np.zeros((3, 3))


def assert_honest(runs, floor, small=10.0):
    """No estimate is below a fifth of the error; few are above ten times it, by lucky phases."""
    ratios = []
    for run, known, size in runs:
        off = np.maximum(*differences(run.mechanism.packed, run.q, known)).max()
        assert off <= 5.0 * run.error_estimate + floor * size, (off, run.error_estimate)
        if off > floor * size:
            ratios.append(run.error_estimate / off)
    assert len(ratios) < 4 or np.mean(np.array(ratios) < small) > 0.75


def incline(size, slope, share, step, t_turn, **options):
    """A block that is thrown up and slides down again from t_turn on; `share` of it is friction."""
    g, way = 10.0 * size, np.array([np.cos(slope), np.sin(slope)])
    mu = share * tan(slope)
    up, down = g * (way[1] + mu * way[0]), g * (way[1] - mu * way[0])
    v0 = up * t_turn
    block = pg.Body(
        name="b", joint="compound", motions=(("translate", (1, 0, 0)), ("translate", (0, 0, 1))),
        inertia=NONE, v=tuple((v0 * way).tolist()),
    )  # fmt: skip
    floor = pg.Contact(name="c", body="b", points=((0, 0, 0),), friction=mu)
    model = pg.Model(
        bodies=(block,), ground=pg.Ground(slope=slope), contacts=(floor,), gravity=(0, 0, -g)
    )
    run = pg.simulate(model, t_end=0.5, step=step, **options)
    rising = np.minimum(run.t, t_turn)
    x = v0 * rising - 0.5 * up * rising**2 - 0.5 * down * (run.t - rising) ** 2
    return run, np.outer(x, way), np.abs(x).max()


@pytest.mark.parametrize(("size", "share", "frames"), combined(SIZES, [0.1, 0.5, 0.9], [2, 101]))
def test_slip_that_turns_within_a_step(size, share, frames):
    step = 0.005
    assert_honest(
        (
            incline(size, 0.4, share, step, (first + phase) * step, frames=frames)
            for first in (0, 50)
            for phase in PHASES[::4]
        ),
        1e-9,
    )


@pytest.mark.parametrize(("size", "mu"), combined(SIZES, [0.1, 0.5, 1.3]))
def test_slip_that_ends_within_a_step(size, mu):
    """A ball that slides until it rolls [as of billiards: 5/7 of the speed is left]."""
    step, runs = 0.005, []
    for phase in PHASES[::2]:
        g, stop = 10.0 * size, (31 + phase) * step
        v0 = 3.5 * mu * g * stop
        ball = pg.Body(
            name="b", joint="free", inertia=np.eye(3) * (0.4 * size**2), v=(0, 0, 0, v0, 0, 0),
            q=(0, 0, size, 1, 0, 0, 0), shape={"kind": "sphere", "radius": size},
        )  # fmt: skip
        floor = pg.Contact(name="c", body="b", friction=mu, restitution=0.0)
        model = pg.Model(bodies=(ball,), contacts=(floor,), gravity=(0, 0, -g))
        run = pg.simulate(model, t_end=0.5, step=step, frames=51)
        slid = np.minimum(run.t, stop)
        rolled = 5 / 7 * v0 * (run.t - slid)
        half = 0.5 / size * (1.25 * mu * g * slid**2 + rolled)
        known = np.zeros((len(slid), 7))
        known[:, 0], known[:, 2] = v0 * slid - 0.5 * mu * g * slid**2 + rolled, size
        known[:, 3], known[:, 5] = np.cos(half), np.sin(half)
        runs.append((run, known, np.ptp(known[:, 0]) + 1.0))
    assert_honest(runs, 1e-8)


@pytest.mark.parametrize(("e", "size", "limited"), combined([0.3, 0.5, 1.0], SIZES, [False, True]))
def test_slow_impacts_within_a_step(e, size, limited):
    """The last bounces of a ball, or those of a slider on a limit that it has just reached."""
    g, step, runs = 10.0 * size, 0.002, []
    for phase in PHASES[::2]:
        height = 0.5 * g * ((20 + phase) * step) ** 2
        fields: dict[str, Any] = {"shape": {"kind": "sphere", "radius": size}}
        if limited:
            fields = {"limits": ((size, None),), "limit_restitution": (e,)}
        body = pg.Body(
            name="b", joint="prismatic", axes=(0, 0, 1), inertia=NONE, q=(size + height,), **fields
        )
        floor = pg.Contact(name="c", body="b", restitution=e, friction=0.0)
        contacts = () if limited else (floor,)
        model = pg.Model(bodies=(body,), contacts=contacts, gravity=(0, 0, -g))
        run = pg.simulate(model, t_end=0.25, step=step, frames=126, method="moreau_jean")
        runs.append((run, size + bounces(run.t, height, g, e)[:, None], height))
    assert_honest(runs, 1e-7, np.inf)


def bounces(t, height, g, e):
    """Heights (n,) of a ball that is dropped and bounces; it comes to rest for e < 1."""
    x, rise = np.zeros(len(t)), 0.0
    place, begin, end = height, 0.0, np.sqrt(2 * height / g)
    while begin < t[-1] and end > begin + 1e-12 * t[-1]:
        now = (t >= begin) & (t < end)
        x[now] = place + rise * (t[now] - begin) - 0.5 * g * (t[now] - begin) ** 2
        rise = e * (g * (end - begin) - rise)
        place, begin, end = 0.0, end, end + 2 * rise / g
    return x


@pytest.mark.parametrize(
    ("size", "g", "low", "method"),
    combined(
        [1e-9, 1e-3, 1.0, 1e3, 1e9], [1e-9, 1e-3, 10.0, 1e6], [0.0, 1.0, 1e3], ["rk4", "dop853"]
    ),
)
def test_a_limit_is_hit_when_it_is_reached_whatever_its_size(size, g, low, method):
    """At 1e-9 m or 1e9 m, and at a limit far from zero."""
    g, height, low = g * size, 0.7 * size, low * size
    body = pg.Body(
        name="b", joint="prismatic", axes=(0, 0, 1), inertia=NONE, q=(low + height,),
        limits=((low, None),), limit_restitution=(0.8,),
    )  # fmt: skip
    fall = np.sqrt(2 * height / g)
    steps: Any = {"step": 3.0 * fall / 500} if method == "rk4" else {"rtol": 1e-10}
    run = pg.simulate(
        pg.Model(bodies=(body,), gravity=(0, 0, -g)), t_end=2.4 * fall, method=method, **steps
    )
    off = np.abs(run.q[:, 0] - low - bounces(run.t, height, g, 0.8)).max()
    assert off < 1e-10 * (size + low)
    assert off < 10 * run.error_estimate + 1e-12 * (size + low)


HALF = np.sqrt(np.pi) * gamma(1.4) / gamma(0.9)  # of Hertz's impact, in depths and speeds of it


@pytest.mark.parametrize(
    ("method", "size", "law"),
    combined(["dopri5", "dop853", "radau5"], SIZES, ["soft", "penalty"]),
)
def test_the_borders_of_soft_contacts_end_steps(method, size, law):
    """A ball flies into a wall that gives, and out again: the error follows the tolerance."""
    deep, speed, gap = 0.05 * size, 3.0 * size, 0.4 * size
    ball = pg.Body(
        name="b", joint="prismatic", axes=(0, 0, -1), inertia=NONE, v=(speed,),
        q=(-size - gap,), shape={"kind": "sphere", "radius": size},
    )  # fmt: skip
    stiffness = (1.25 * speed**2 / deep**2.5) if law == "soft" else (speed / deep) ** 2
    wall = pg.Contact(name="c", body="b", law=law, damping=0.0, friction=0.0, stiffness=stiffness)
    model = pg.Model(bodies=(ball,), contacts=(wall,), gravity=(0, 0, 0))
    half = (HALF if law == "soft" else 0.5 * np.pi) * deep / speed
    out = gap / speed + 2 * half
    for rtol in 10.0 ** -np.arange(4.0, 11.0, 0.75):
        run = pg.simulate(model, t_end=2 * out, method=method, rtol=rtol, frames=51)
        after = run.t > out
        off = np.abs(run.q[after, 0] + size + speed * (run.t[after] - out)).max() / size
        assert off < 3 * rtol + 1e-12, (rtol, off)
        assert off < 5 * run.error_estimate / size + 1e-12, (rtol, off)


def test_time_stepping_knows_its_error_where_a_penalty_contact_touches_within_a_step():
    # Its steps do not end at the touch, where the damper's force jumps. Two runs whose steps it
    # divides alike miss the same part of it, so a third one begins its steps elsewhere.
    ball = pg.Body(
        name="ball", joint="prismatic", axes=[(0, 0, 1)], q=(0.5,),
        shape=pg.Shape(kind="sphere", radius=0.1),
    )  # fmt: skip
    floor = pg.Contact(name="floor", body="ball", law="penalty", stiffness=1e4, damping=20.0)
    model = pg.Model(bodies=[ball], contacts=[floor])
    given = {"t_end": 0.6, "frames": 7}
    true = pg.simulate(model, method="rk4", step=1e-5, estimate=False, **given).q
    for step in np.linspace(1e-3, 2e-3, 21):
        run = pg.simulate(model, method="moreau_jean", step=step, **given)
        error = np.abs(run.q - true).max()
        assert error < 5.0 * run.error_estimate, step  # 24 and 64 times, by two runs
