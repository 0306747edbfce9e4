"""Loads that statics alone does not determine are those of least norm, in any order of rows."""

import numpy as np
import pytest

import pgraph_core as pg

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
