"""More impacts in one time step than a person would guess: all are located, or the run says so."""

import math

import numpy as np
import pytest

import pgraph_core as pg

from ..nights import combined

RADIUS = 0.1


def right_or_told(run, exact, floor=1e-9):
    """Whether a run is right within its estimate, or says that impacts were taken at once."""
    error = float(np.abs(run.q - exact).max())
    return error < 10 * run.error_estimate + floor or any("impacts" in x for x in run.notices)


def rattling(speed, room=1e-3, restitution=1.0, start=3e-4):
    body = pg.Body(
        name="b", joint="prismatic", axes=((1, 0, 0),), limits=((0.0, room),), q=(start,),
        v=(speed,), limit_restitution=(restitution,),
    )  # fmt: skip
    return pg.Model(bodies=(body,), gravity=(0, 0, 0))


def folded(x, room):
    """x between two mirrors."""
    x = np.mod(x, 2 * room)
    return np.where(x > room, 2 * room - x, x)


@pytest.mark.parametrize(
    ("speed", "step"), combined([1.0, 40.0, -65.0, 100.0, 333.0, 2000.0], [1e-3, 3e-4, 1e-2])
)
def test_a_slider_between_elastic_limits(speed, step):
    """At 100 m/s and 1 mm, 100 impacts a millisecond; its place is known at each of them."""
    run = pg.simulate(rattling(speed), t_end=20 * step, step=step)
    exact = folded(3e-4 + speed * run.t, 1e-3)[:, None]
    floor = 1e-12 + 2e-13 * abs(speed) * run.t[-1] / 1e-3  # a gap of 1e-10 of the range is closed
    assert right_or_told(run, exact, floor)
    assert run.energy == pytest.approx(run.energy[0], rel=1e-9)
    if abs(speed) * step / 1e-3 < 990:
        assert float(np.abs(run.q - exact).max()) < floor


@pytest.mark.parametrize("room", [1e-6, 1e-3, 1.0])
def test_scales_of_the_room_do_not_matter(room):
    speed = 100.0 * room / 1e-3
    run = pg.simulate(rattling(speed, room, start=0.3 * room), t_end=0.02, step=1e-3)
    exact = folded(0.3 * room + speed * run.t, room)[:, None]
    assert float(np.abs(run.q - exact).max()) < 1e-6 * room


def row(places, masses, speeds, restitution, wall=None):
    """Balls on a line, each against the next; the first one's limit is a wall."""
    bodies = tuple(
        pg.Body(
            name=f"b{n}", joint="prismatic", axes=((1, 0, 0),), mass=m, q=(x,), v=(v,),
            shape={"kind": "sphere", "radius": RADIUS},
            limits=((wall, None),) if n == 0 and wall is not None else (),
            limit_restitution=(1.0,),
        )
        for n, (x, m, v) in enumerate(zip(places, masses, speeds))
    )  # fmt: skip
    contacts = tuple(
        pg.Contact(
            name=f"c{n}", body=f"b{n}", other=f"b{n + 1}", restitution=restitution, friction=0
        )
        for n in range(len(places) - 1)
    )
    return pg.Model(bodies=bodies, contacts=contacts, gravity=(0, 0, 0))


@pytest.mark.parametrize(("ratio", "count"), [(1, 3), (16, 12), (100, 31), (1e4, 314), (1e6, 3141)])
def test_galperins_billiard_counts_digits_of_pi(ratio, count):
    """In (sqrt m x, sqrt M y) it is a straight line that mirrors fold into a wedge.

    The wall is where the light ball's left side is at 0; distances are between surfaces.
    """
    x, gap, speed = 0.5, 0.5, -1.0
    model = row((x, x + 2 * RADIUS + gap), (1.0, ratio), (0.0, speed), 1.0, wall=0.0)
    run = pg.simulate(model, t_end=3.0)
    wedge = math.atan(math.sqrt(1.0 / ratio))  # between the mirrors x = y and x = 0
    light, heavy = x, (x + gap + speed * run.t) * math.sqrt(ratio)
    far, angle = np.hypot(light, heavy), np.arctan2(light, heavy)
    inside = np.abs(np.mod(angle + wedge, 2 * wedge) - wedge)  # folded, from the mirror x = 0
    exact = np.stack((far * np.sin(inside), far * np.cos(inside) / math.sqrt(ratio)), axis=1)
    exact[:, 1] += 2 * RADIUS
    assert math.ceil(math.pi / wedge) - 1 == count or ratio == 1
    assert right_or_told(run, exact, 1e-7)


def collided(places, masses, speeds, restitution, t):
    """Places of balls of no size on a line at times t, from impact to impact."""
    x, v, m = (np.array(a, dtype=float) for a in (places, speeds, masses))
    now, found, count = 0.0, [], 0
    for until in t:
        while True:
            closing = v[:-1] - v[1:]
            gaps = x[1:] - x[:-1]
            with np.errstate(divide="ignore", invalid="ignore"):
                times = np.where(closing > 0, np.maximum(gaps, 0.0) / closing, np.inf)
            k = int(np.argmin(times))
            if now + times[k] > until:
                break
            now, x, count = now + times[k], x + times[k] * v, count + 1
            push = (1 + restitution) * closing[k] * m[k] * m[k + 1] / (m[k] + m[k + 1])
            v[k] -= push / m[k]
            v[k + 1] += push / m[k + 1]
            assert count < 100_000
        x, now = x + (until - now) * v, until
        found.append(x.copy())
    return np.array(found), count


@pytest.mark.parametrize("gap", [1e-6, 1e-4])
@pytest.mark.parametrize(
    ("masses", "restitution"),
    [((1, 2, 3, 1, 2, 3, 1), 1.0), ((5, 1, 4, 1, 3, 1, 2), 0.9), ((1, 3, 2, 5, 1, 4, 2), 0.5)],
)
def test_balls_in_a_row(masses, restitution, gap):
    """Hit by the first: tens to hundreds of impacts within a tenth of a millisecond."""
    n = len(masses)
    places = [0.0, *(0.05 + gap * k for k in range(n - 1))]
    speeds = [1.0, *[0.0] * (n - 1)]
    model = row([x + 2 * RADIUS * k for k, x in enumerate(places)], masses, speeds, restitution)
    run = pg.simulate(model, t_end=0.2)
    exact, count = collided(places, masses, speeds, restitution, run.t)
    assert count > n
    assert right_or_told(run, exact + 2 * RADIUS * np.arange(n), 1e-7)


def tipping(spin):
    """A box on an edge, of which a face lands."""
    a, c, tilt = 0.35, 0.12, 0.5
    edge = 0.5 * (a * math.sin(tilt) + c * math.cos(tilt))
    body = pg.Body(
        name="b", joint="free", mass=1.0, derived=("inertia",),
        shape={"kind": "box", "size": (a, a, c)},
        q=(0, 0, edge, math.cos(0.5 * tilt), math.sin(0.5 * tilt), 0, 0),
        v=(0, spin * math.sin(tilt), spin * math.cos(tilt), 0.3, 0.2, 0),
    )  # fmt: skip
    floor = pg.Contact(name="g", body="b", friction=0.2, restitution=0.3)
    return pg.Model(bodies=(body,), contacts=(floor,))


@pytest.mark.parametrize("step", [2e-3, 1e-3, 5e-4])
@pytest.mark.parametrize("spin", [0.5, 2.0])
def test_a_spinning_box_that_tips_lands_with_all_corners_of_a_face(spin, step):
    """Errors of earlier steps would let one corner land first, which turns the box."""
    model = tipping(spin)
    given = {"t_end": 0.35, "frames": 36, "method": "moreau_jean"}
    run = pg.simulate(model, step=step, **given)
    fine = pg.simulate(model, step=6.25e-5, estimate=False, **given)
    assert np.abs(run.q - fine.q).max() < 1e-3
    assert run.error_estimate < 1e-3


@pytest.mark.parametrize("step", [4e-3, 2e-3])
def test_the_landing_of_a_face_does_not_depend_on_its_time_within_a_step(step):
    """Corners at rest open or close by the error of a step, about 1e-5 m/s, when others land.

    A corner that opened was without the law of restitution, so that three corners of four took
    the impulse, and their friction turned the box by 0.04 rad/s more or less.
    """
    turns = []
    for share in (0.0, 0.2, 0.4, 0.6, 0.8):
        times = np.append(0.0, np.arange(share * step, 0.18, step))
        given = {"t_eval": np.unique(times), "method": "moreau_jean", "step": step}
        run = pg.simulate(tipping(0.5), estimate=False, **given)
        turns.append(np.interp(0.175, run.t, run.v[:, 2]))
    assert np.ptp(turns) < 1e-3


ROD = {"mass": 1.0, "inertia": np.eye(3) * 0.01}
ROD |= {"shape": {"kind": "box", "size": (0.4, 0.1, 0.1)}}


@pytest.mark.parametrize("speed", [60.0, 45.0])
def test_fast_balls_among_all_bodies_hit_when_their_gap_closes(speed):
    """Elastic balls of one mass exchange their speeds.

    More bodies than are paired, and two jointed rods that overlap and turn fast among them. After
    the last impact of a step, a ball would still pass through its thickness in the rest of it.
    """
    lanes, span = 11, 0.02
    ball = {"joint": "free", "derived": ("inertia",)}
    ball |= {"shape": {"kind": "sphere", "radius": 0.05}}
    gaps = 0.2 + 0.013 * np.arange(lanes)
    bodies = [
        pg.Body(name="upper", q=(0, -5, 0, 1, 0, 0, 0), v=(0, 0, 40, 0, 0, 0), joint="free", **ROD),
        pg.Body(name="lower", parent="upper", axes=(0, 0, 1), link=(0.2, 0, 0), v=(-90.0,), **ROD),
    ]
    for k, gap in enumerate(gaps):
        far, fast = gap + 2 * 0.05, (0, 0, 0, speed, 0, 0)
        bodies.append(pg.Body(name=f"a{k}", q=(0, 3 * k, 0, 1, 0, 0, 0), v=fast, **ball))
        bodies.append(pg.Body(name=f"b{k}", q=(far, 3 * k, 0, 1, 0, 0, 0), **ball))
    every = pg.Contact(name="all", body="*", other="*", restitution=1.0)
    model = pg.Model(bodies=bodies, contacts=[every], gravity=(0, 0, 0))
    run = pg.simulate(model, t_end=span, step=0.01, method="moreau_jean", estimate=False)
    way = speed * span
    for k, gap in enumerate(gaps):
        assert run[f"a{k}"][-1, 0] == pytest.approx(min(way, gap), abs=1e-9)
        assert run[f"b{k}"][-1, 0] - 2 * 0.05 == pytest.approx(max(way, gap), abs=1e-9)
