"""Static, rolling and spinning friction in time stepping, against closed forms."""

import math

import numpy as np
import pytest

import pgraph_core as pg

from ..worlds import ball, box

pytestmark = pytest.mark.quick

G, R = 9.81, 0.1


def run(body: pg.Body, t_end: float, step: float = 1e-3, up="z", slope=0.0, **contact) -> pg.Result:
    model = pg.Model(
        up=up, bodies=[body], contacts=[pg.Contact(name="c", body="b", **contact)],
        ground=pg.Ground(slope=slope),
    )  # fmt: skip
    return pg.simulate(model, t_end=t_end, method="moreau_jean", step=step, estimate=False)


@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_rolling_friction_slows_a_ball(up):
    """v' = -5/7 g ρ/r of a ball that does not slide, until it stands."""
    rho, speed = 1e-3, 1.0
    k = "xyz".index(up)
    place, turn, go = np.zeros(3), np.zeros(3), np.zeros(3)
    place[k], go[(k + 1) % 3], turn[(k + 2) % 3] = R, speed, speed / R
    start = ball(place=(0, 0, 0), q=(*place, 1, 0, 0, 0), v=(*turn, *go))
    slowing = 5 / 7 * G * rho / R
    result = run(start, 2.0, up=up, rolling_friction=rho)
    assert result.v[-1, 3 + (k + 1) % 3] == pytest.approx(speed - 2 * slowing, rel=1e-9)
    slow = start.model_copy(update={"v": tuple(0.1 * x for x in start.v)})
    result = run(slow, 2.0, up=up, rolling_friction=rho)
    assert result.q[-1, (k + 1) % 3] == pytest.approx(0.01 / 2 / slowing, rel=1e-3)
    assert abs(result.v[-1]).max() < 1e-12


def test_spinning_friction_slows_a_ball():
    """ω' = -σ m g / I about the normal, and nothing else moves."""
    sigma = 1e-3
    result = run(ball(v=(0, 0, 10, 0, 0, 0)), 1.0, spinning_friction=sigma)
    assert result.v[-1, 2] == pytest.approx(10 - sigma * G / (0.4 * R * R), rel=1e-9)
    assert abs(result.v[-1, [0, 1, 3, 4, 5]]).max() < 1e-12
    torque = result.contact_force["c"][-1, 2]
    assert torque == pytest.approx(-sigma * G, rel=1e-9)


@pytest.mark.parametrize(("part", "rolls"), [(0.99, False), (1.01, True)])
def test_a_ball_stays_on_a_slope_below_the_angle_of_rolling_friction(part, rolls):
    """tan slope = ρ / r is where it begins to roll."""
    rho = 0.01
    slope = math.atan(part * rho / R)
    normal = np.array((-math.sin(slope), 0, math.cos(slope)))
    result = run(ball(place=R * normal), 1.0, slope=slope, rolling_friction=rho)
    assert (abs(result.v[-1, 3]) > 1e-4) == rolls


@pytest.mark.parametrize(("part", "slides"), [(0.99, False), (1.01, True)])
def test_a_block_holds_by_static_friction_and_slides_by_kinetic(part, slides):
    static, kinetic = 0.6, 0.4
    slope = math.atan(part * static)
    turn = (math.cos(slope / 2), 0, -math.sin(slope / 2), 0)
    normal = np.array((-math.sin(slope), 0, math.cos(slope)))
    block = box(size=(0.4, 0.4, 0.1), q=(*(0.05 * normal), *turn), place=(0, 0, 0))
    result = run(block, 1.0, slope=slope, friction=kinetic, static_friction=static)
    down = G * (math.sin(slope) - kinetic * math.cos(slope)) if slides else 0.0
    assert np.linalg.norm(result.v[-1, 3:]) == pytest.approx(down, rel=3e-3, abs=1e-9)


def test_a_block_that_is_pulled_by_a_spring_sticks_and_slips():
    """Period and amplitude of the stretch with two coefficients, u'' = -ω² u where it slips."""
    mass, stiffness, pull, static, kinetic = 1.0, 100.0, 0.1, 0.6, 0.4
    rate = math.sqrt(stiffness / mass)
    half = (static - kinetic) * mass * G / stiffness  # of the stretch, about that of sliding
    period = 2 * half / pull + 2 * (math.pi - math.atan(half * rate / pull)) / rate
    block = box(place=(0, 0, 0), size=(0.4, 0.4, 0.1), mass=mass, q=(0, 0, 0.05, 1, 0, 0, 0))
    start = kinetic * mass * G / stiffness
    cart = pg.Body(
        name="cart", joint="prismatic", axes=((1, 0, 0),), mass=1e9, inertia=np.eye(3),
        q=(1 + start,), v=(pull,), rotation=(1, 0, 0, 0), link=(0, 0, 0.05),
    )  # fmt: skip
    model = pg.Model(
        bodies=[block, cart],
        contacts=[pg.Contact(name="c", body="b", friction=kinetic, static_friction=static)],
        forces=[pg.Spring(name="s", body="b", other="cart", stiffness=stiffness, rest=1.0)],
    )
    times = np.linspace(0, 4, 4001)
    result = pg.simulate(
        model, t_end=4, method="moreau_jean", step=2.5e-4, frames=4001, estimate=False
    )
    slips = result.v[:, 3] > 1e-6
    starts = times[1:][slips[1:] & ~slips[:-1]]
    assert len(starts) >= 3
    assert np.diff(starts)[1:] == pytest.approx(period, rel=5e-3)
    stretch = result.q[:, 7] - result.q[:, 0] - 1 - start
    late = times > period
    assert stretch[late].max() == pytest.approx(math.hypot(half, pull / rate), rel=5e-3)
    assert stretch[late].min() == pytest.approx(-math.hypot(half, pull / rate), rel=5e-3)


def test_laws_and_methods_without_these_frictions_refuse_them():
    for fields, options, field in (
        ({"law": "soft", "rolling_friction": 1e-3}, {}, "rolling"),
        ({"law": "penalty", "spinning_friction": 1e-3}, {}, "spinning"),
        ({"static_friction": 0.9}, {"method": "dopri5"}, "friction"),
    ):
        model = pg.Model(bodies=[ball()], contacts=[pg.Contact(name="c", body="b", **fields)])
        with pytest.raises((pg.ModelError, pg.InputError), match=field):
            pg.simulate(model, t_end=0.1, **options)


def test_a_belt_that_moves_across_a_rail_takes_all_friction():
    """A body on a rail along x, on a belt along y: x' = -μ g x' / |slip|."""
    motions = ("translate", (1, 0, 0)), ("translate", (0, 0, 1))
    cart = pg.Body(name="b", joint="compound", motions=motions, mass=1.0, v=(0.01, 0.0))
    top = {"kind": "box", "size": (9, 9, 0.2)}
    belt = pg.Body(name="belt", joint="prismatic", axes=(0, 1, 0), link=(0, 0, -0.1), shape=top)
    drive = pg.Motion(name="drive", body="belt", q_of_t=pg.Polynomial(coefficients=(0.0, -5.0)))
    touch = pg.Contact(name="c", body="b", other="belt", points=((0, 0, 0),), friction=0.5)
    model = pg.Model(bodies=(cart, belt), contacts=(touch,), constraints=(drive,))
    model = model.edit("belt", v=(-5.0,))
    result = pg.simulate(model, t_end=0.5, method="moreau_jean", step=1e-3, estimate=False)
    force = result.contact_force["c"][-1, 3:]
    assert np.hypot(*force[:2]) == pytest.approx(0.5 * G, rel=1e-9)
    assert force[1] == pytest.approx(-0.5 * G, rel=1e-4)
    assert result.v[-1, 0] == pytest.approx(0.01 * np.exp(-0.5 * G / 5.0 * 0.5), rel=1e-3)


@pytest.mark.parametrize("rate", [0.01, 10.0])  # N/s
def test_a_slowly_growing_pull_breaks_away_where_static_friction_ends(rate):
    """Force decides, not speed. After the break, friction is kinetic at once."""
    mass, kinetic, static = 2.0, 0.3, 0.6
    limit, drag = static * mass * 9.81, kinetic * mass * 9.81
    body = pg.Body(
        name="b", joint="compound", motions=(("translate", (1, 0, 0)), ("translate", (0, 0, 1))),
        mass=mass, inertia=0.02 * np.eye(3),
    )  # fmt: skip
    floor = pg.Contact(
        name="c", body="b", points=((0, 0, 0),), friction=kinetic, static_friction=static
    )
    pull = pg.VectorTable(
        t=(0, 1.0), value=((limit - 0.5 * rate, 0, 0), (limit + 0.5 * rate, 0, 0))
    )
    load = pg.Wrench(name="w", body="b", force=pull)
    model = pg.Model(bodies=(body,), contacts=(floor,), forces=(load,))
    for step in (1e-3, 2.5e-4):
        run = pg.simulate(model, t_end=1.0, step=step, estimate=False)
        slides = 0.5  # s, and so long it slides
        exact = ((limit - drag) * slides**2 / 2 + rate * slides**3 / 6) / mass
        late = 3 * step * (limit - drag) / mass * slides
        assert abs(run.q[-1, 0] - exact) < late
