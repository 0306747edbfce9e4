"""Loads that statics alone does not determine are those of least norm, in any order of rows."""

import numpy as np
import pytest

import pgraph_core as pg

from ..nights import combined

G = 9.81
ORDERS = [(0, 1, 2, 3), (1, 0, 3, 2), (2, 3, 0, 1), (3, 1, 0, 2)]


def ball(radius):
    return pg.Shape(kind="sphere", radius=radius)


def robot(size=1.0, friction=0.9, kd=0.05, turned=False):
    """Two driven wheels and two frictionless casters, 4.6 kg at a size of 1."""
    mass, inertia = size**3, size**5
    car = pg.Body(
        name="car", joint="free", mass=4 * mass, inertia=np.diag([0.05, 0.1, 0.1]) * inertia,
        q=(0, 0, 0.1 * size, 1, 0, 0, 0),
    )  # fmt: skip
    bodies = [car]
    sides = {"l": 0.2, "r": -0.2}
    for name in sorted(sides, reverse=turned):
        bodies.append(
            pg.Body(
                name=name, parent="car", axes=(0, 1, 0), link=(0, sides[name] * size, 0),
                mass=0.3 * mass, inertia=np.diag([8e-4, 1.5e-3, 8e-4]) * inertia,
                shape=ball(0.1 * size),
            )
        )  # fmt: skip
    for name, x in (("front", 0.2), ("rear", -0.2)):
        bodies.append(
            pg.Body(
                name=name, parent="car", joint="weld", link=(x * size, 0, -0.08 * size), mass=0,
                inertia=np.zeros((3, 3)), shape=ball(0.02 * size),
            )
        )  # fmt: skip
    contacts = [pg.Contact(name=n, body=n, friction=friction) for n in "lr"]
    contacts += [pg.Contact(name=n, body=n, friction=0) for n in ("front", "rear")]
    drives = [
        pg.SpeedServo(name=f"drive {n}", body=n, kd=kd * inertia, speed=w)
        for n, w in (("l", 2.0), ("r", 4.0))
    ]
    parts = contacts[::-1] if turned else contacts
    return pg.Model(bodies=bodies, contacts=parts, forces=drives, gravity=(0, 0, -G * size))


@pytest.mark.parametrize(
    "given", [{}, {"turned": True}, {"friction": 0.3}, {"size": 0.1}, {"kd": 0.5}], ids=str
)
def test_a_robot_with_casters_drives(given):
    """At 0.3 m/s and 0.5 rad/s, with about a quarter of the weight on every point."""
    size = given.get("size", 1.0)
    run = pg.simulate(robot(**given), t_end=3.0, step=1e-3, method="moreau_jean", estimate=False)
    v = run.v[-1, run.mechanism.joints["car"].v]
    assert np.hypot(v[3], v[4]) == pytest.approx(0.3 * size, rel=0.01)
    assert v[2] == pytest.approx(0.5, rel=0.01)
    loads = [run.contact_force[n][-1, 5] for n in ("l", "r", "front", "rear")]
    assert sum(loads) == pytest.approx(4.6 * G * size**4, rel=1e-3)
    assert min(loads) > 0.9 * max(loads)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("friction", [0.0, 0.8])
def test_loads_of_a_cart_are_those_of_least_norm(order, friction):
    """Front wheels are heavier: as a + b x over the length, left as right."""
    spots = [(0.2, 0.2, 1.0), (0.2, -0.2, 1.0), (-0.2, 0.2, 0.3), (-0.2, -0.2, 0.3)]
    bodies = [
        pg.Body(
            name="car", joint="free", mass=4, inertia=np.diag([0.05, 0.1, 0.1]),
            q=(0, 0, 0.1, 1, 0, 0, 0),
        )
    ]  # fmt: skip
    for i in order:
        x, y, mass = spots[i]
        inertia = np.diag([0.5, 1, 0.5]) * mass * 0.005
        bodies.append(
            pg.Body(
                name=f"w{i}", parent="car", axes=(0, 1, 0), link=(x, y, 0), mass=mass,
                inertia=inertia, shape=ball(0.1),
            )
        )  # fmt: skip
    contacts = [pg.Contact(name=f"c{i}", body=f"w{i}", friction=friction) for i in order]
    run = pg.simulate(pg.Model(bodies=bodies, contacts=contacts), t_end=0.2, estimate=False)
    loads = [run.contact_force[f"c{i}"][-1, 5] for i in range(4)]
    assert loads == pytest.approx([19.62, 19.62, 12.753, 12.753], rel=1e-9)


def wall(rows, gap, friction, order):
    """Rows of boxes of 0.4 x 0.2 x 0.2 m and 1 kg, each row shifted by half a box."""
    bodies = []
    for r, count in enumerate(rows):
        for c in range(count):
            x = (c - (count - 1) / 2) * (0.4 + gap)
            bodies.append(
                pg.Body(
                    name=f"b{len(bodies)}", joint="free", q=(x, 0, 0.1 + 0.2 * r, 1, 0, 0, 0),
                    shape={"kind": "box", "size": (0.4, 0.2, 0.2)}, derived=("inertia",),
                )
            )  # fmt: skip
    if order:
        np.random.default_rng(order).shuffle(bodies)
    contacts = [
        pg.Contact(name="floor", body="*", friction=friction),
        pg.Contact(name="heap", body="*", other="*", friction=friction),
    ]
    return pg.Model(bodies=bodies, contacts=contacts)


@pytest.mark.parametrize(
    ("rows", "gap", "friction"), combined([(2, 1), (3, 2), (3, 2, 1)], [0.0, 1e-3], [0.0, 0.6])
)
def test_loads_of_a_wall_are_symmetric_in_any_order(rows, gap, friction):
    """Edges coincide, so that the contact points must not depend on rounding either."""
    loads = []
    for order in range(3):
        model = wall(rows, gap, friction, order)
        run = pg.simulate(model, t_end=0.1, step=1e-3, frames=2, estimate=False)
        forces = [run.contact_force[f"floor[b{k}]"][-1, 3:] for k in range(rows[0])]
        loads.append([f[2] for f in forces])
        assert [f[0] for f in forces] == pytest.approx(
            [-f[0] for f in forces[::-1]], abs=1e-9 * sum(rows) * G
        )
        assert "not unique" in " ".join(run.notices) or not friction
    assert loads[0] == pytest.approx(loads[0][::-1], rel=1e-9)
    assert loads[1:] == [pytest.approx(loads[0], rel=1e-9)] * 2
    assert sum(loads[0]) == pytest.approx(sum(rows) * G, rel=1e-9)


def test_wheels_that_are_light_carry_their_share():
    """Wheels of 1 g at the ends and 0.3 kg in the middle: as a beam on equal springs."""
    car = pg.Body(
        name="car", joint="free", mass=1.0, inertia=np.diag([0.05, 0.1, 0.1]),
        q=(0, 0, 0.1, 1, 0, 0, 0),
    )  # fmt: skip
    bodies, masses = [car], {-0.2: 1e-3, 0.0: 0.3, 0.2: 1e-3}
    for x, mass in masses.items():
        for y in (-0.2, 0.2):
            inertia = np.diag([0.5, 1, 0.5]) * mass * 0.005
            bodies.append(
                pg.Body(
                    name=f"w{len(bodies)}", parent="car", axes=(0, 1, 0), link=(x, y, 0),
                    mass=mass, inertia=inertia, shape=ball(0.1),
                )
            )  # fmt: skip
    contacts = [pg.Contact(name=b.name, body=b.name, friction=0.5) for b in bodies[1:]]
    run = pg.simulate(pg.Model(bodies=bodies, contacts=contacts), t_end=0.1, estimate=False)
    loads = [run.contact_force[b.name][-1, 5] for b in bodies[1:]]
    assert loads == pytest.approx([sum(b.mass for b in bodies) * G / 6] * 6, rel=1e-9)


def test_boxes_at_rest_without_forces_need_no_impulses():
    """Their speeds are rounding, against which no law can be met to a tolerance."""
    rail = {"joint": "prismatic", "axes": [(1, 0, 0)], "derived": ("inertia",)}
    shape = {"kind": "box", "size": (0.1, 0.1, 0.1)}
    bodies = [
        pg.Body(name="a", mass=1.0, v=(2.0,), shape=shape, **rail),
        pg.Body(name="b", mass=10**-0.5, link=(0.15, 0, 0), shape=shape, **rail),
        pg.Body(
            name="wall", joint="weld", link=(0.3, 0, 0), shape={"kind": "box", "size": (0.1, 1, 1)}
        ),
    ]
    heap = pg.Contact(name="heap", body="*", other="*", friction=0.0, restitution=0.0)
    model = pg.Model(bodies=bodies, contacts=[heap], gravity=(0, 0, 0))
    run = pg.simulate(model, t_end=0.5, step=1e-3, estimate=False)
    assert run.counters["contact_fallbacks"] == 0
    assert abs(run.v[-1]).max() < 1e-12
