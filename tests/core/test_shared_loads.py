"""Forces of contacts that the motion does not determine are named, others are not."""

import numpy as np
import pytest

import pgraph_core as pg

BOX = {"kind": "box", "size": (0.2, 0.2, 0.2)}


def box(name="box", z=0.1, size=1.0, **fields):
    shape = {"kind": "box", "size": tuple(size * x for x in BOX["size"])}
    return pg.Body(
        name=name, joint="free", q=(0, 0, z * size, 1, 0, 0, 0), mass=size**3, shape=shape,
        derived=("inertia",), **fields,
    )  # fmt: skip


def cart(wheels, friction=0.7):
    """A plate on as many wheels, each with a contact of its own."""
    plate = pg.Body(name="plate", joint="free", q=(0, 0, 0.15, 1, 0, 0, 0), mass=3.0,
                    inertia=np.eye(3))  # fmt: skip
    bodies, contacts = [plate], []
    for n in range(wheels):
        angle = 2 * np.pi * n / wheels + 0.3
        bodies.append(
            pg.Body(
                name=f"w{n}", parent="plate", axes=(0, 1, 0), mass=0.2, derived=("inertia",),
                link=(np.cos(angle), np.sin(angle), -0.1),
                shape={"kind": "sphere", "radius": 0.05},
            )
        )  # fmt: skip
        contacts.append(pg.Contact(name=f"c{n}", body=f"w{n}", friction=friction))
    return pg.Model(bodies=bodies, contacts=contacts)


def gripped():
    """A box between two fingers that servos press, with friction."""
    fingers = [
        pg.Body(
            name=name, joint="prismatic", axes=(side, 0, 0), mass=0.5, q=(-0.15,),
            shape={"kind": "box", "size": (0.1, 0.1, 0.1)}, inertia=np.eye(3) * 1e-3,
        )
        for name, side in (("left", 1), ("right", -1))
    ]  # fmt: skip
    contacts = [pg.Contact(name=f.name, body=f.name, other="box", friction=0.8) for f in fingers]
    drives = [pg.Motor(name=f"m {f.name}", body=f.name, torque=20.0) for f in fingers]
    return pg.Model(bodies=[*fingers, box(z=0.0)], contacts=contacts, forces=drives)


def shared(run):
    return [text for text in run.notices if "not unique" in text]


@pytest.mark.parametrize(
    ("model", "names"),
    [(cart(4), "w0 w1 w2 w3"), (cart(4, 0.0), "w0 w1 w2 w3"), (gripped(), "left right")],
)
def test_loads_that_are_not_unique_are_named(model, names):
    run = pg.simulate(model, t_end=0.1, step=1e-3)
    (text,) = shared(run)
    assert all(f"'{name}'" in text for name in names.split())
    assert "least norm" in text


FLOOR = pg.Contact(name="floor", body="box", friction=0.5)


@pytest.mark.parametrize(
    "model",
    [
        pg.Model(bodies=[box()], contacts=[FLOOR]),
        pg.Model(bodies=[box(size=100.0)], contacts=[FLOOR]),
        pg.Model(bodies=[box(v=(0, 0, 0, 1.0, 0, 0))], contacts=[FLOOR]),
        pg.Model(
            bodies=[box("a"), box("b", 0.3), box("c", 0.5)],
            contacts=[pg.Contact(name="f", body="*"), pg.Contact(name="g", body="*", other="*")],
        ),
        cart(3, 0.0),
    ],
)
def test_loads_that_are_unique_are_not_named(model):
    assert not shared(pg.simulate(model, t_end=0.1, step=1e-3))


def balls(gap, e=1.0):
    """Two balls at rest, `gap` apart, and a third one that hits the first."""
    row = [(0.0, 1.0), (0.3, 0.0), (0.5 + gap, 0.0)]
    bodies = [
        pg.Body(
            name=f"b{n}", joint="prismatic", axes=(1, 0, 0), mass=1.0, q=(x,), v=(v,),
            shape={"kind": "sphere", "radius": 0.1},
        )
        for n, (x, v) in enumerate(row)
    ]  # fmt: skip
    contacts = [
        pg.Contact(name=f"c{n}", body=f"b{n}", other=f"b{n + 1}", restitution=e, friction=0)
        for n in range(2)
    ]
    return pg.Model(bodies=bodies, contacts=contacts, gravity=(0, 0, 0))


@pytest.mark.parametrize(("gap", "e", "told"), [(0.0, 1.0, True), (1e-4, 1.0, False),
                                                (0.0, 0.5, True), (0.0, 0.0, False)])  # fmt: skip
def test_an_impact_of_several_that_touch_is_named(gap, e, told):
    run = pg.simulate(balls(gap, e), t_end=0.3, step=1e-3)
    assert any("with gaps" in text for text in run.notices) == told


@pytest.mark.parametrize(
    ("shape", "spin", "speed", "told"),
    [
        ({"kind": "cylinder", "radius": 0.1, "length": 0.2}, 5.0, 0.0, True),
        (BOX, 5.0, 0.0, True),
        (BOX, 5.0, 2.0, True),
        (BOX, 0.5, 2.0, True),
        (BOX, 0.0, 1.0, False),
        ({"kind": "sphere", "radius": 0.1}, 5.0, 0.0, False),
    ],
)
def test_a_face_that_spins_on_a_plane_is_named(shape, spin, speed, told):
    body = pg.Body(
        name="b", joint="free", q=(0, 0, 0.1, 1, 0, 0, 0), v=(0, 0, spin, speed, 0, 0), mass=1.0,
        shape=shape, derived=("inertia",),
    )  # fmt: skip
    floor = pg.Contact(name="floor", body="b", friction=0.3)
    run = pg.simulate(pg.Model(bodies=[body], contacts=[floor]), t_end=0.1, step=1e-3)
    assert any("spins on a flat face" in text for text in run.notices) == told
