"""Surfaces that move past their bodies: belts and turntables, against closed forms."""

import math

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.rotation import matrix

from ..nights import combined
from ..worlds import ball, box

pytestmark = pytest.mark.quick

G = 9.81
AXES = {"x": (0, 1, 0), "y": (0, 0, 1), "z": (1, 0, 0)}  # a level direction for each `up`


def belt(velocity=(0, 0, 0), spin=(0, 0, 0), size=(2000, 2000, 2), **more) -> pg.Body:
    """A box welded to the ground with its top at the origin, normal to its own z."""
    shape = {"kind": "box", "size": size, "position": (0, 0, -size[2] / 2)}
    shape |= {"surface_velocity": velocity, "surface_spin": spin}
    return pg.Body(name="belt", joint="fixed", mass=1.0, shape=shape, **more)


def load(size=(0.4, 0.4, 0.1), **more) -> pg.Body:
    return box(size=size, place=(0, 0, 0), **{"q": (0, 0, size[2] / 2, 1, 0, 0, 0), **more})


def tracked(velocity) -> pg.Body:
    """A body on tracks: its own surface moves."""
    shape = {"kind": "box", "size": (0.4, 0.2, 0.1), "surface_velocity": velocity}
    return load().model_copy(update={"shape": pg.Shape(**shape)})


def world(*bodies: pg.Body, swapped: bool = False, **law) -> pg.Model:
    ends = ("belt", "b") if swapped else ("b", "belt")
    parts = reversed(bodies) if swapped else bodies
    return pg.Model(bodies=tuple(parts), contacts=[pg.Contact(name="c", body=ends[0],
                    other=ends[1], **{"friction": 0.5, **law})])  # fmt: skip


def run(model: pg.Model, t_end: float, **options) -> pg.Result:
    return pg.simulate(model, t_end=t_end, **{"step": 1e-3, "estimate": False, **options})


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("step", [1e-2, 1e-3])
@pytest.mark.parametrize(("scale", "speed", "turn"), [(1, 0.3, 0), (0.01, 3, 2), (20, 30, -1.1)])
def test_a_box_slides_until_it_travels_with_the_belt(speed, turn, scale, step, swapped):
    """a = μ g for V / μ g, over V² / 2 μ g. Half of the belt's work m V² is lost."""
    mu = 0.5
    way = np.array((math.cos(turn), math.sin(turn), 0.0))
    body = load(size=(0.4 * scale, 0.4 * scale, 0.1 * scale), mass=scale**3)
    last = 1.5 * speed / (mu * G)
    frames = 61
    found = run(world(body, belt(tuple(speed * way)), swapped=swapped, friction=mu), last,
                step=step * speed, frames=frames, method="moreau_jean")  # fmt: skip
    q, v = found["b"], found["v.b"]
    t = found.t
    slides = np.minimum(t, speed / (mu * G))
    expected = np.outer(mu * G * slides, way)
    assert np.abs(v[:, 3:] - expected).max() < 1e-9 * speed + mu * G * step * speed
    assert v[-1, 3:] == pytest.approx(speed * way, abs=1e-12 * speed)
    assert np.abs(v[:, :3]).max() < 1e-9 * speed / scale
    place = mu * G * slides**2 / 2 + speed * (t - slides)
    assert np.abs(q[:, :3] @ way - place).max() < 2 * step * speed**2
    assert np.abs(q[:, 2] - 0.05 * scale).max() < 1e-9 * scale
    work = found.work[-1] / (scale**3 * speed**2)
    assert work == pytest.approx(1.0, rel=1e-9)
    assert found.dissipation[-1] / (scale**3 * speed**2) == pytest.approx(0.5, rel=1e-9)
    assert found.energy_drift < 1e-9
    assert found.contact_slip["c"][-1] < 1e-9 * speed
    force = found.contact_force["c"][10, 3:] * (-1 if swapped else 1)
    assert force @ way == pytest.approx(mu * scale**3 * G, rel=1e-9)


@pytest.mark.parametrize("part", [0.9, 1.1])
@pytest.mark.parametrize("speed", [0.5, -2.0])
def test_an_inclined_belt_carries_what_its_friction_holds(part, speed):
    """Below the angle of friction it ends at V, above it slides down at g (sin - μ cos)."""
    mu = 0.4
    slope = math.atan(part * mu)
    turned = (math.cos(slope / 2), 0, -math.sin(slope / 2), 0)  # its x goes up
    up, normal = (
        np.array((math.cos(slope), 0, math.sin(slope))),
        np.array((-math.sin(slope), 0, math.cos(slope))),
    )
    body = load(q=(*(0.05 * normal), *turned), v=(0, 0, 0, *(speed * up)))
    found = run(world(body, belt((speed, 0, 0), rotation=turned), friction=mu), 1.0)
    excess = G * math.cos(slope) * max(math.tan(slope) - mu, 0.0)
    v = found["v.b"][-1, 3:]
    assert v @ up == pytest.approx(speed - excess, abs=1e-9)
    assert abs(v @ normal) < 1e-9
    held = found["b"][:, :3] @ up - (speed * found.t - excess * found.t**2 / 2)
    assert np.abs(held).max() < 1e-3 * excess + 1e-9


@pytest.mark.parametrize("static", [0.4, 0.6])
@pytest.mark.parametrize(("stiffness", "speed"), [(100.0, 0.1), (1e4, 0.5)])
def test_a_box_on_a_spring_sticks_to_the_belt_and_slips(stiffness, speed, static):
    """Largest stretch: that of kinetic friction and hypot((μs - μ) m g / k, V / ω)."""
    kinetic, mass = 0.4, 1.0
    rate = math.sqrt(stiffness / mass)
    spring = pg.Spring(name="s", body="b", stiffness=stiffness, rest=1.0, other_point=(-1, 0, 0.05))
    start = kinetic * mass * G / stiffness
    body = load(mass=mass, q=(start, 0, 0.05, 1, 0, 0, 0), v=(0, 0, 0, speed, 0, 0))
    model = world(body, belt((speed, 0, 0)), friction=kinetic, static_friction=static)
    half = (static - kinetic) * mass * G / stiffness
    period = 2 * half / speed + 2 * (math.pi - math.atan(half * rate / speed)) / rate
    step = period / 8000
    found = run(model.replace(forces=[spring]), 2.2 * period, step=step, frames=4001)
    stretch = found["b"][:, 0] - start
    reach = math.hypot(half, speed / rate)
    assert stretch.max() == pytest.approx(reach, rel=5e-3)
    assert found["v.b"][:, 3].max() == pytest.approx(speed, rel=5e-3)
    if half > 0.0:
        slips = found.contact_slip["c"] > 1e-6
        starts = found.t[1:][slips[1:] & ~slips[:-1]]
        assert np.diff(starts)[-1] == pytest.approx(period, rel=5e-3)
    ledger = found.energy - found.work + found.dissipation
    assert np.ptp(ledger) < 5e-3 * found.work[-1]


@pytest.mark.parametrize("rate", [0.5, -2.0])
@pytest.mark.parametrize("offset", [(0, 0, 0), (3, -1, 0)])
def test_a_ball_that_rolls_on_a_turntable_circles_at_two_sevenths(rate, offset):
    table = belt(spin=(0, 0, rate)).model_copy(update={"link": offset})
    away = 1.0
    speed, radius = 2 / 7 * rate * away, 0.1
    turn = ((rate * away - speed) / radius, 0.0, 0.0)
    place = (offset[0] + away, offset[1], radius)
    body = ball(place=(0, 0, 0), q=(*place, 1, 0, 0, 0), v=(*turn, 0, speed, 0))
    found = run(world(body, table), 3.0)
    angle = 2 / 7 * rate * found.t[-1]
    expected = np.array((math.cos(angle), math.sin(angle))) * away + offset[:2]
    assert found["b"][-1, :2] == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize("rate", [3.0, -8.0])
def test_a_turntable_takes_along_what_friction_holds(rate):
    """A box at rest in its middle ends at its spin; a ball does so by spinning friction σ."""
    found = run(world(load(), belt(spin=(0, 0, rate))), 2.0)
    assert found["v.b"][-1, 2] == pytest.approx(rate, rel=1e-9)
    assert found.work[-1] - found.dissipation[-1] == pytest.approx(
        found.energy[-1] - found.energy[0]
    )
    sigma, radius, mass = 1e-3, 0.1, 2.0
    body = ball(place=(0, 0, 0), radius=radius, q=(0, 0, radius, 1, 0, 0, 0), mass=mass)
    model = world(body, belt(spin=(0, 0, rate)), spinning_friction=sigma)
    growth = sigma * G / (0.4 * radius**2)
    t_end = 1.5 * abs(rate) / growth
    found = run(model, t_end, frames=4)
    assert abs(found["v.b"][1, 2]) == pytest.approx(growth * found.t[1], rel=1e-9)
    assert found["v.b"][-1, 2] == pytest.approx(rate, rel=1e-9)


@pytest.mark.parametrize("part", [0.8, 1.2])
def test_a_box_stays_on_a_turntable_where_friction_holds_it(part):
    rate, mu = 2.0, 0.5
    away = part * mu * G / rate**2
    body = load(size=(0.02, 0.02, 0.02), q=(away, 0, 0.01, 1, 0, 0, 0),
                v=(0, 0, rate, 0, rate * away, 0))  # fmt: skip
    found = run(world(body, belt(spin=(0, 0, rate)), friction=mu), 2.0, step=5e-4)
    distance = np.hypot(*found["b"][:, :2].T)
    if part < 1.0:
        assert np.abs(distance - away).max() < 2 * 5e-4 * rate**2 * 2.0 * away
    else:
        assert distance[-1] > 1.5 * away


@pytest.mark.parametrize(
    ("kind", "law", "velocity"),
    combined(
        ["box", "sphere", "capsule", "hull"], ["complementarity", "soft"], [(2, 0, 0), (0.3, -1, 5)]
    ),
)
def test_a_belt_does_what_a_long_body_does_that_moves(kind, law, velocity):
    """The same forces and speeds as on a slab that a prescribed motion drives. A part of the
    velocity across the surface does nothing.
    """
    shape = {
        "box": {"kind": "box", "size": (0.3, 0.2, 0.1)},
        "sphere": {"kind": "sphere", "radius": 0.05},
        "capsule": {"kind": "capsule", "radius": 0.05, "length": 0.2,
                    "rotation": (math.sqrt(0.5), 0, math.sqrt(0.5), 0)},
        "hull": {"kind": "ellipsoid", "radii": (0.1, 0.2, 0.05)},
    }[kind]  # fmt: skip
    body = pg.Body(name="b", joint="free", mass=2.0, shape=shape, derived=("inertia",),
                   q=(0, 0, 0.05, 1, 0, 0, 0))  # fmt: skip
    x, y, _ = velocity
    slab = pg.Body(
        name="belt", joint="compound", motions=(("translate", (1, 0, 0)), ("translate", (0, 1, 0))),
        mass=1.0, v=(x, y), shape={"kind": "box", "size": (2000, 2000, 2), "position": (0, 0, -1)},
    )  # fmt: skip
    drives = [
        pg.Motion(name=f"m{k}", body="belt", coordinate=k,
                  q_of_t=pg.Polynomial(coefficients=(0.0, speed)))
        for k, speed in enumerate((x, y))
    ]  # fmt: skip
    law_of = {"law": law, "friction": 0.3} | ({"stiffness": 1e6} if law == "soft" else {})
    options = {
        "complementarity": {"method": "moreau_jean"},
        "soft": {"method": "rk4", "step": 2e-5},
    }
    here = run(world(body, belt(velocity), **law_of), 0.3, **options[law])
    there = run(world(body, slab, **law_of).replace(constraints=drives), 0.3, **options[law])
    scale = math.hypot(x, y)
    assert np.abs(here["v.b"] - there["v.b"])[:, 3:].max() < 1e-6 * scale
    assert np.abs(here["b"] - there["b"])[:, :3].max() < 1e-6
    assert here.work[-1] == pytest.approx(there.work[-1], rel=1e-5)
    assert here.dissipation[-1] == pytest.approx(there.dissipation[-1], rel=1e-5)


@pytest.mark.parametrize(("method", "speed"), combined(["rk4", "dopri5", "dop853"], [0.5, -2.0]))
def test_soft_contacts_of_every_method_travel_with_the_belt(method, speed):
    """Regularised friction misses Coulomb's by (1 mm/s / slip)² / 2."""
    mu = 0.5
    t_end = 2 * abs(speed) / (mu * G)
    options = {"step": 2e-5} if method == "rk4" else {}
    model = world(load(), belt((speed, 0, 0)), law="soft", friction=mu)
    found = pg.simulate(model, t_end=t_end, method=method, estimate=False, **options)
    assert found["v.b"][-1, 3] == pytest.approx(speed, rel=5e-3)
    way = speed * t_end - math.copysign(speed**2 / (2 * mu * G), speed)
    assert found["b"][-1, 0] == pytest.approx(way, rel=5e-3)
    assert found.work[-1] == pytest.approx(speed**2, rel=5e-3)
    if method != "rk4":
        balance = found.energy - found.work + found.dissipation
        assert balance[-1] == pytest.approx(balance[0], abs=1e-6 * speed**2)


@pytest.mark.parametrize("speed", [0.4, -1.5])
def test_a_vehicle_drives_on_its_own_tracks(speed):
    """A body whose own surface moves goes the other way on the ground."""
    model = pg.Model(
        bodies=[tracked((-speed, 0, 0))], contacts=[pg.Contact(name="c", body="b", friction=0.5)]
    )
    found = run(model, 2.0)
    assert found["v.b"][-1, 3] == pytest.approx(speed, rel=1e-9)
    assert found.work[-1] == pytest.approx(speed**2, rel=1e-9)
    stepper = pg.Stepper(model, step=1e-3)
    many = pg.BatchStepper(model, 3, step=1e-3)
    for _ in range(10):
        stepper.step()
        many.step()
    assert (many.v == stepper.v).all()


def test_two_belts_that_move_as_one_do_not_slip():
    """Only the difference of two surfaces counts: one moved against the other is carried."""
    found = run(world(tracked((2, 0, 0)), belt((2, 0, 0))), 0.5)
    assert np.abs(found["v.b"]).max() < 1e-12
    found = run(world(tracked((2, 0, 0)), belt((-1, 0, 0))), 2.0)
    assert found["v.b"][-1, 3] == pytest.approx(-3.0, rel=1e-9)


def test_a_cylinder_with_a_moving_surface_drives_as_a_roller_does():
    """A spin about its axis is that of a roller: the plate on it moves at ω r."""
    rate, radius = 5.0, 0.1
    shape = {
        "kind": "cylinder",
        "radius": radius,
        "length": 4.0,
        "rotation": (math.sqrt(0.5), math.sqrt(0.5), 0, 0),
        "surface_spin": (0, 0, -rate),
    }
    rollers = [
        pg.Body(name=f"r{k}", joint="fixed", link=(0.5 * k, 0, -radius), shape=shape)
        for k in range(-2, 6)
    ]  # fmt: skip
    plate = load(size=(1.6, 0.3, 0.02))
    contacts = [pg.Contact(name=r.name, body="b", other=r.name, friction=0.5) for r in rollers]
    found = run(pg.Model(bodies=(plate, *rollers), contacts=contacts), 0.6)
    assert abs(found["v.b"][-1, 3]) == pytest.approx(rate * radius, rel=1e-6)


def test_what_cannot_take_a_moving_surface_says_so():
    with pytest.raises(pg.ModelError, match="penalty") as error:
        run(world(load(), belt((1, 0, 0)), law="penalty"), 0.1)
    assert "belt" in str(error.value)
    model = pg.Model(bodies=[tracked((1, 0, 0))], contacts=[pg.Contact(name="c", body="b")])
    with pytest.raises(pg.InputError, match="moreau_jean"):
        pg.simulate(model, t_end=0.1, method="dopri5")
    drawn = pg.Shape(kind="sphere", radius=1.0, role="visual", surface_velocity=(1, 0, 0))
    (doubt,) = pg.Model(bodies=[pg.Body(name="b", shape=drawn)]).doubts
    assert "'b'" in doubt
    with pytest.raises(pg.ModelError, match="surface_velocity"):
        pg.Shape(kind="sphere", radius=1.0, surface_velocity=(1, 2))


@pytest.mark.parametrize("plane", ["x", "y", "z"])
def test_the_mirror_image_of_a_belt_moves_the_mirrored_way(plane):
    k = "xyz".index(plane)
    shape = pg.Shape(kind="cylinder", radius=1.0, end_radius=0.5, length=2.0, rotation=(0.5,) * 4,
                     surface_velocity=(1, 2, 3), surface_spin=(4, 5, 6))  # fmt: skip
    model = pg.Model(bodies=[pg.Body(name="left", shape=shape)])
    other = model.mirror("left", plane=plane).bodies[-1].shape
    sign = np.ones(3)
    sign[k] = -1
    for name, factor in (("surface_velocity", sign), ("surface_spin", -sign)):
        a, b = matrix(shape.rotation), matrix(other.rotation)
        assert a @ getattr(shape, name) * factor == pytest.approx(b @ getattr(other, name))


def test_a_file_keeps_a_moving_surface_and_says_which_version_it_needs():
    model = pg.Model(bodies=[belt((1, 2, 3), (4, 5, 6))])
    text = model.to_json()
    assert '"schema_version": 7' in text
    assert pg.Model.from_json(text) == model
    assert '"schema_version": 1' in pg.Model(bodies=[belt(inertia=(1, 1, 1))]).to_json()


@pytest.mark.parametrize("turn", [0.006, 0.01, 0.015, 0.03])
def test_the_estimate_covers_the_creep_of_a_box_on_a_turntable(turn):
    """Of first order, where the paths of shapes that touch curve within a step and divide it."""
    radius, size = 0.2, 0.004
    speed = 0.5 * math.sqrt(G / radius)
    table = {"kind": "cylinder", "radius": 0.4, "length": 0.02, "position": (0, 0, -0.01)}
    model = world(
        pg.Body(name="belt", joint="weld", shape={**table, "surface_spin": (0, 0, speed)}),
        box(
            size=(size, size, 0.2 * size), place=(0, 0, 0),
            q=(radius, 0, 0.1 * size, 1, 0, 0, 0), v=(0, 0, speed, 0, speed * radius, 0),
        ),
        friction=1.0,
    )  # fmt: skip
    run = pg.simulate(model, t_end=1.0 / speed, step=turn / speed, frames=3)
    error = abs(math.hypot(*run["b"][-1, :2]) - radius)
    assert error < 3.0 * run.error_estimate
