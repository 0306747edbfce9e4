"""Classics of the field that are good to look at; their references are in `cases`."""

from __future__ import annotations

import math

import pgraph_core as pg

from .looks import DARK, STEEL, Vector, bar, chain, hub, racket, rounded, spots
from .loops import rod


def heavy_top(height: float = 1.2) -> pg.Model:
    """A wheel at the end of a bar that turns about its end, 1400 times a minute."""
    top = pg.Body(
        name="top",
        joint="spherical",
        link=(0, 0, height),
        mass=15.0,
        com=(0, 1, 0),
        inertia=diagonal(0.234375, 0.46875, 0.234375),
        v=(0.0, 150.0, -4.61538),
        shape=pg.Shape(
            kind="cylinder",
            radius=0.25,
            length=0.1,
            position=(0, 1, 0),
            rotation=(0.707106781, -0.707106781, 0, 0),
        ),
    )
    axle = hub((0, 1, 0), 0.025, 1.08, STEEL, at=(0, 0.54, 0))
    top = top.model_copy(update={"shapes": (*top.shapes, axle, *spots((0, 1, 0), 0.17, 0.104))})
    return pg.Model(
        name="heavy top",
        bodies=(top,),
        scenarios=(_scenario("spin", "its weight makes it go round instead of down", 2.0, 1e-4),),
    )


def tennis_racket() -> pg.Model:
    """A body that turns about its middle axis, free of gravity: it turns over again and again."""
    sides = [math.sqrt(6.0 * (6.0 - 2.0 * x)) for x in (1.0, 2.0, 3.0)]
    body = pg.Body(
        name="racket",
        joint="free",
        inertia=diagonal(1.0, 2.0, 3.0),
        v=(0.01, 5.0, 0.01, 0.0, 0.0, 0.0),
        shape=pg.Shape(
            kind="box", size=_vector(0.2 * max(side, 0.1) for side in sides), role="collision"
        ),
    )
    body = body.model_copy(update={"shapes": (*body.shapes, *racket())})
    return pg.Model(
        name="tennis racket",
        gravity=(0, 0, 0),
        bodies=(body,),
        scenarios=(_scenario("turn", "turns over every five seconds", 20.0),),
    )


def spherical_pendulum(height: float = 1.2) -> pg.Model:
    """A pendulum on a ball joint; its inertia makes it swing as a point mass at 1 m does."""
    inertia, tilt = 0.05, 1.0
    body = pg.Body(
        name="pendulum",
        joint="spherical",
        link=(0, 0, height),
        mass=1.0 / (1.0 - inertia),
        com=(0, 0, inertia - 1.0),
        inertia=diagonal(inertia, inertia, inertia),
        tip=(0, 0, -1),
        q=(math.cos(tilt / 2), 0.0, -math.sin(tilt / 2), 0.0),
        v=(math.sin(2 * tilt), 0.0, 2 * math.sin(tilt) ** 2),
        shape=bar((0, 0, -1), radius=0.03),
    )
    return pg.Model(
        name="spherical pendulum",
        bodies=(body,),
        scenarios=(_scenario("swing", "swings round, up and down", 10.0),),
    )


def skate() -> pg.Model:
    """A blade on an inclined plane: it does not slip sideways, and does not run down either."""
    body = pg.Body(
        name="skate",
        joint="planar",
        inertia=diagonal(0.1, 0.1, 0.1),
        v=(0.0, 0.0, 2.0),
        shape=pg.Shape(kind="box", size=(0.4, 0.02, 0.1), colour=STEEL),
    )
    boot = chain(DARK, ((-0.1, 0, 0.22), 0.055), ((-0.12, 0, 0.1), 0.05), ((0.12, 0, 0.085), 0.036))
    body = body.model_copy(update={"shapes": (*body.shapes, *boot)})
    blade = pg.Constraint(name="blade", kind="skate", body="skate", point=(0, 0, 0), axis=(0, 1, 0))
    return pg.Model(
        name="skate on a slope",
        gravity=(9.81 / 2, 0, -9.81 * math.sqrt(0.75)),
        bodies=(body,),
        constraints=(blade,),
        scenarios=(_scenario("glide", "a cycloid across the slope", 10.0),),
    )


def falling_rod(friction: float = 0.3) -> pg.Model:
    """A rod that stands on rough ground, leans, falls, and slips."""
    lean = 0.01
    body = pg.Body(
        name="rod",
        joint="planar",
        axes=((1, 0, 0), (0, 0, 1), (0, 1, 0)),
        inertia=diagonal(1 / 12, 1 / 12, 0),
        q=(0.5 * math.sin(lean), 0.5 * math.cos(lean), lean),
        shape=pg.Shape(kind="capsule", radius=0.02, length=0.96),
    )
    tip = pg.Contact(name="tip", body="rod", points=((0, 0, -0.5),), friction=friction)
    return pg.Model(
        name="falling rod",
        bodies=(body,),
        contacts=(tip,),
        scenarios=(_scenario("fall", "its tip slips backwards before it lands", 1.3),),
    )


def four_bar_windows(windows: int = 10) -> pg.Model:
    """Windows of equal rods side by side, which are all flat at once, twice a turn."""
    bodies, loops = [], []
    for i in range(windows + 1):
        bodies.append(rod(f"crank {i}", (0, 1, 0), link=(i, 0, 0), v=-1.0))
        if i < windows:
            link: Vector = (0, 1, 0)
            bodies.append(rod(f"coupler {i}", (1, 0, 0), parent=f"crank {i}", link=link, v=1.0))
            loop = pg.Constraint(
                name=f"loop {i}",
                body=f"coupler {i}",
                other=f"crank {i + 1}",
                point=(1, 0, 0),
                other_point=(0, 1, 0),
            )
            loops.append(loop)
    return pg.Model(
        name=f"{windows} four-bar windows",
        up="y",
        bodies=tuple(bodies),
        constraints=tuple(loops),
        scenarios=(_scenario("turn", "passes positions in which each could fold", 10.0),),
    )


def diagonal(x: float, y: float, z: float) -> tuple[Vector, Vector, Vector]:
    return ((x, 0, 0), (0, y, 0), (0, 0, z))


def _vector(parts: object) -> Vector:
    x, y, z = (rounded(part) for part in parts)  # type: ignore[attr-defined]
    return (x, y, z)


def _scenario(name: str, description: str, t_end: float, step: float = 1e-3) -> pg.Scenario:
    return pg.Scenario(name=name, description=description, t_end=t_end, step=step, method="rk4")
