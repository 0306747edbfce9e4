"""Models of cases that nobody needs to look at: point masses on rods without mass, blocks, rods."""

from __future__ import annotations

import math

import pgraph_core as pg

from .looks import Vector

NONE = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
Y_UP = {"gravity": (0.0, -9.81, 0.0), "up": "y"}


def mass(
    name: str, parent: str = "ground", *, m: float = 1.0, length: float = 1.0, above: float = 0.0,
    q: float = 0.0,
) -> pg.Body:  # fmt: skip
    """A point mass on a rod without mass, hinged about z, hanging down at q = 0."""
    return pg.Body(
        name=name, parent=parent, link=(0, -above, 0), mass=m, com=(0, -length, 0), inertia=NONE,
        q=(q,),
    )  # fmt: skip


def pendulum(length: float = 1.0, m: float = 1.0, q: float = -math.pi / 2) -> pg.Model:
    return pg.Model(bodies=(mass("a", m=m, length=length, q=q),), **Y_UP)


def double_pendulum(ratio: float, first: float, second: float) -> pg.Model:
    """Return a pendulum with angles from the vertical and a tip of `ratio` kg."""
    tip = mass("b", "a", m=ratio, above=1.0, q=second - first)
    return pg.Model(bodies=(mass("a", q=first), tip), **Y_UP)


def chain(n: int) -> pg.Model:
    """1 m and 1 kg in n links, straight at 45 degrees."""
    part = 1 / n
    bodies = [mass("1", m=part, length=part, q=math.pi / 4)]
    for i in range(2, n + 1):
        bodies.append(mass(str(i), str(i - 1), m=part, length=part, above=part))
    return pg.Model(bodies=tuple(bodies), **Y_UP)


def spring_pendulum(stiffness: float) -> pg.Model:
    """A bob on a spring that would be a rod of 1 m, stretched by its weight at 1 rad."""
    bob = pg.Body(
        name="bob",
        joint="compound",
        motions=(("rotate", (0, 0, 1)), ("translate", (0, -1, 0))),
        com=(0, -1, 0),
        inertia=NONE,
        q=(1.0, 9.81 * math.cos(1.0) / stiffness),
        stiffness=(0.0, stiffness),
    )
    return pg.Model(bodies=(bob,), **Y_UP)


def bouncing_ball(restitution: float) -> pg.Model:
    ball = pg.Body(name="ball", joint="prismatic", axes=((0, 0, 1),), q=(1.0,))
    return _touching(ball, restitution=restitution)


def limited_pendulum() -> pg.Model:
    """A rod that falls on the stop of its joint."""
    rod = pg.Body(
        name="rod",
        axes=((0, 1, 0),),
        com=(0, 0, -0.5),
        inertia=((1 / 12, 0, 0), (0, 1 / 12, 0), (0, 0, 0)),
        q=(1.5,),
        limits=((0.5, None),),
        limit_restitution=(0.6,),
    )
    return pg.Model(bodies=(rod,))


def block(slope: float = 0.0, speed: float = 0.0) -> pg.Model:
    """A box on a plane that rises along x by `slope`, friction 0.3."""
    half = 0.05
    body = pg.Body(
        name="block",
        joint="free",
        q=(
            -half * math.sin(slope), 0.0, half * math.cos(slope),
            math.cos(slope / 2), 0.0, -math.sin(slope / 2), 0.0,
        ),
        v=(0, 0, 0, speed, 0, 0),
        shape=pg.Shape(kind="box", size=(0.2, 0.2, 2 * half)),
    )  # fmt: skip
    return _touching(body, points=(), friction=0.3, slope=slope)


def block_on_a_spring() -> pg.Model:
    cart = pg.Body(
        name="cart",
        joint="compound",
        motions=(("translate", (1, 0, 0)), ("translate", (0, 0, 1))),
        inertia=NONE,
        q=(0.5, 0.0),
        stiffness=(100, 0),
    )
    return _touching(cart, friction=0.3)


def sliding_rod() -> pg.Model:
    """A slender rod of 1 m, inclined by its last coordinate."""
    body = pg.Body(
        name="rod",
        joint="planar",
        axes=((1, 0, 0), (0, 0, 1), (0, 1, 0)),
        inertia=((0, 0, 0), (0, 1 / 12, 0), (0, 0, 1 / 12)),
    )
    return pg.Model(bodies=(body,))


def _touching(
    body: pg.Body,
    *,
    points: tuple[Vector, ...] = ((0.0, 0.0, 0.0),),
    slope: float = 0.0,
    friction: float = 0.0,
    restitution: float = 0.0,
) -> pg.Model:
    floor = pg.Contact(
        name="floor", body=body.name, points=points, friction=friction, restitution=restitution
    )
    return pg.Model(bodies=(body,), contacts=(floor,), ground=pg.Ground(slope=slope))
