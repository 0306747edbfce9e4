"""Flat floors made of several shapes are flat: tiles, heightfields, shapes of one body."""

import numpy as np
import pytest

import pgraph_core as pg

from ..nights import combined

SIDE = 0.2
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
DIAGONAL = (np.cos(np.pi / 8), 0.0, 0.0, np.sin(np.pi / 8))
CUBE = {"kind": "box", "size": (SIDE, SIDE, SIDE)}
SLIDERS = {  # shape, height of its origin, quaternion
    "cube": (CUBE, SIDE / 2, UPRIGHT),
    "plate": ({"kind": "box", "size": (SIDE, SIDE, SIDE / 10)}, SIDE / 20, UPRIGHT),
    "turned": (CUBE, SIDE / 2, (np.cos(0.15), 0.0, 0.0, np.sin(0.15))),
    "diagonal": (CUBE, SIDE / 2, DIAGONAL),
    "upright": ({"kind": "cylinder", "radius": SIDE / 2, "length": SIDE}, SIDE / 2, UPRIGHT),
    "puck": ({"kind": "cylinder", "radius": SIDE / 2, "length": SIDE / 5}, SIDE / 10, UPRIGHT),
    "ball": ({"kind": "sphere", "radius": SIDE / 2}, SIDE / 2, UPRIGHT),
    "lying": (
        {"kind": "capsule", "radius": SIDE / 2, "length": SIDE},
        SIDE / 2,
        (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0),
    ),
}


def tile(name, middle, size):
    """A box that is fixed to the ground, with its top at height zero."""
    link = (*middle, -size[2] / 2)
    return pg.Body(name=name, joint="weld", link=link, shape={"kind": "box", "size": size})


def field(name, x, nodes, width):
    shape = {
        "kind": "heightfield",
        "size": (width, width, 0.5),
        "heights": np.zeros((nodes, nodes)),
    }
    return pg.Body(name=name, joint="weld", link=(x, 0, 0), shape=shape)


def one_body(shapes):
    return pg.Body(name="floor", joint="weld", shapes=shapes)


def slab(x, y, wide, thick=0.2):
    size = (wide, wide, thick)
    return {"kind": "box", "size": size, "position": (x, y, -thick / 2)}


FLOORS = {
    "two tiles": [tile(f"t{x}", (x, 0), (1, 1, 0.2)) for x in (-0.5, 0.5)],
    "unlike tiles": [tile("t0", (-0.5, 0), (1, 3, 0.2)), tile("t1", (1, 0.2), (2, 1, 0.7))],
    "a grid": [
        tile(f"t{i},{j}", (0.3 * (i + 0.5), 0.3 * (j + 0.5)), (0.3, 0.3, 0.1))
        for i in range(-6, 6) for j in range(-4, 4)
    ],
    "bricks": [
        tile(f"t{i},{j}", (0.3 * (i + 0.5), 0.3 * (j + 0.5 * (i % 2))), (0.3, 0.3, 0.1))
        for i in range(-6, 6) for j in range(-4, 4)
    ],
    "shapes of one body": [one_body([slab(x, y, 1) for x in (-0.5, 0.5) for y in (-0.5, 0.5)])],
    "overlapping shapes": [one_body([slab(-0.4, 0, 1), slab(0.5, 0, 1.1, 0.5), slab(-1.3, 0, 1)])],
    "a coarse field": [field("floor", 0.0, 9, 4.0)],
    "a fine field": [field("floor", 0.0, 65, 4.0)],
    "two fields": [field(f"f{x}", x, 17, 4.0) for x in (-2.0, 2.0)],
    "a field and a tile": [field("f", -2.0, 17, 4.0), tile("t", (1, 0), (2, 2, 0.3))],
}  # fmt: skip


def slide(floor, slider, speed, angle=0.0, step=None, friction=0.0, aside=0.0, along=0.3):
    """How far a slider ends from where it should, over its way of `along` m, and its run."""
    shape, height, turn = SLIDERS[slider]
    way = np.array((np.cos(angle), np.sin(angle)))
    start = -0.55 * along * way + (0.0, aside)
    body = pg.Body(
        name="b", joint="free", q=(*start, height, *turn), v=(0, 0, 0, *(speed * way), 0),
        shape=shape, derived=("inertia",),
    )  # fmt: skip
    contact = pg.Contact(name="c", body="b", other="*", friction=friction)
    model = pg.Model(bodies=[*FLOORS[floor], body], contacts=[contact])
    t_end = along / speed
    run = pg.simulate(model, t_end=t_end, step=step, estimate=False, frames=2, method="moreau_jean")
    assert run.status.ok
    free = along - 0.5 * friction * 9.81 * t_end**2
    return np.linalg.norm(run.q[-1, :2] - start - free * way) / along, run


@pytest.mark.parametrize(("floor", "slider"), combined(FLOORS, SLIDERS))
def test_nothing_catches_at_the_seams_of_a_flat_floor(floor, slider):
    """Without friction nothing acts along the floor; what is left is rounding of 300 steps."""
    missed, run = slide(floor, slider, 1.0)
    assert missed < 1e-9
    assert abs(run.v[-1, :3]).max() < 1e-9


HOW = [
    {"speed": 3.3}, {"speed": 0.1, "along": 0.05}, {"angle": 0.4, "speed": 1.0},
    {"angle": -2.1, "speed": 0.5}, {"step": 5e-3, "speed": 1.0}, {"step": 1e-4, "speed": 3.0},
    {"aside": 0.1, "speed": 1.0}, {"aside": -0.05, "speed": 2.0},
]  # fmt: skip


@pytest.mark.parametrize(
    ("slider", "floor", "how"),
    combined(["diagonal", "puck"], ["bricks", "a fine field"], HOW),
    ids=str,
)
def test_speeds_steps_and_directions_do_not_matter(floor, slider, how):
    missed, _ = slide(floor, slider, **how)
    assert missed < 1e-9


@pytest.mark.parametrize(
    ("slider", "floor", "friction"),
    combined(
        ["cube", "plate"], ["two tiles", "bricks", "a coarse field"], [1e-12, 1e-9, 1e-3, 0.1]
    ),
)
def test_friction_slows_on_seams_as_on_one_plane(floor, slider, friction):
    """Points of a patch are loaded unlike on tiles, but all of them slide one way."""
    missed, _ = slide(floor, slider, 1.0, friction=friction)
    assert missed < 1e-9


@pytest.mark.parametrize("parts", [2, 3])
@pytest.mark.parametrize("floor", ["two tiles", "a fine field", "shapes of one body"])
def test_bodies_of_several_shapes_have_seams_too(floor, parts):
    wide = SIDE / parts
    shapes = [
        {"kind": "box", "size": (wide, SIDE, SIDE), "position": ((k + 0.5) * wide - SIDE / 2, 0, 0)}
        for k in range(parts)
    ]
    body = pg.Body(
        name="b", joint="free", q=(-0.21, 0.013, SIDE / 2, *UPRIGHT), v=(0, 0, 0, 1, 0, 0),
        shapes=shapes, inertia=np.eye(3) * SIDE**2 / 6,
    )  # fmt: skip
    contact = pg.Contact(name="c", body="b", other="*", friction=0.0)
    model = pg.Model(bodies=[*FLOORS[floor], body], contacts=[contact])
    run = pg.simulate(model, t_end=0.4, estimate=False, frames=2, method="moreau_jean")
    assert run.q[-1, 0] == pytest.approx(0.19, abs=1e-9)


# -- what stands out stops ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("floor", "deep", "curb", "turn"),
    combined(
        ["two tiles", "bricks", "shapes of one body"], [0.0, 0.2], [0.5, 0.05, 1e-3],
        [UPRIGHT, DIAGONAL],
    ),
)  # fmt: skip
def test_walls_and_curbs_on_the_floor_stop(floor, deep, curb, turn):
    """The wall stands on the floor, or reaches into it; its foot is hidden, its face is not."""
    wall = pg.Body(
        name="wall", joint="weld", link=(0.5, 0, (curb - deep) / 2),
        shape={"kind": "box", "size": (0.5, 2, curb + deep)},
    )  # fmt: skip
    body = pg.Body(
        name="b", joint="free", q=(0, 0, 0.1, *turn), v=(0, 0, 0, 1, 0, 0), mass=1.0,
        shape={"kind": "box", "size": (0.2, 0.2, 0.2)}, inertia=np.eye(3),
    )  # fmt: skip
    contact = pg.Contact(name="c", body="b", other="*", friction=0.0)
    model = pg.Model(bodies=[*FLOORS[floor], wall, body], contacts=[contact])
    run = pg.simulate(model, t_end=0.16, estimate=False, method="moreau_jean")
    half = 0.1 if turn == UPRIGHT else 0.1 * np.sqrt(2)
    assert run.q[-1, 0] == pytest.approx(0.25 - half, abs=1e-3)  # it tips a little over a curb
    assert run.v[-1, 3] < 0.1


def test_a_neighbour_that_a_body_does_not_touch_hides_nothing():
    """The body touches the second tile alone: its side face stops it."""
    tiles = FLOORS["two tiles"]
    body = pg.Body(
        name="b", joint="free", q=(-0.3, 0, -0.1, *UPRIGHT), v=(0, 0, 0, 1, 0, 0),
        shape={"kind": "box", "size": (0.2, 0.2, 0.2)}, derived=("inertia",),
    )  # fmt: skip
    contact = pg.Contact(name="c", body="b", other=tiles[1].name, friction=0.0)
    model = pg.Model(bodies=[*tiles, body], contacts=[contact], gravity=(0, 0, 0))
    run = pg.simulate(model, t_end=0.5, estimate=False, method="moreau_jean")
    assert run.q[:, 0].max() == pytest.approx(-0.1, abs=1e-6)
