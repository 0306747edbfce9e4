"""Classic mechanisms and closed loops of the field, whose references are in `cases`."""

from __future__ import annotations

import math

import numpy as np

import pgraph_core as pg

from .looks import DARK, STEEL, Vector, bar, chain, hub, racket, rounded, spots

PLANAR = "y"  # planar mechanisms stand in the xy plane


def four_bar() -> pg.Model:
    """A parallelogram of equal rods. Twice per turn it is flat and could fold."""
    bodies = (
        rod("left crank", (0, 1, 0)),
        rod("coupler", (1, 0, 0), parent="left crank", link=(0, 1, 0)),
        rod("right crank", (0, 1, 0), link=(1, 0, 0)),
    )
    loop = pg.Constraint(
        name="loop",
        body="coupler",
        other="right crank",
        point=(1, 0, 0),
        other_point=(0, 1, 0),
    )
    v: dict[str, tuple[float, ...]] = {b.name: (-1.0,) for b in bodies}
    v["coupler"] = (1.0,)
    turns = pg.Scenario(
        name="turn",
        description="swings through the flat position, where the velocity keeps the branch",
        v=v,
        t_end=10.0,
        step=1e-3,
        method="rk4",
    )
    return _planar("four-bar linkage", bodies, (loop,), turns)


def slider_crank() -> pg.Model:
    """Crank, connecting rod and slider on spatial joints: three rows of the loop are redundant."""
    theta = 0.5
    beta = math.asin(0.4 * math.sin(theta))
    place = rounded(0.2 * math.cos(theta) + 0.5 * math.cos(beta), 15)
    bodies = (
        rod("crank", (0.2, 0, 0), q=theta),
        rod("rod", (0.5, 0, 0), parent="crank", link=(0.2, 0, 0), mass=2.0, q=-beta - theta),
        pg.Body(
            name="slider",
            joint="prismatic",
            axes=((1, 0, 0),),
            mass=3.0,
            inertia=_matrix(np.diag([0.005, 0.005, 0.005])),
            q=(place,),
            shape=pg.Shape(kind="box", size=(0.12, 0.08, 0.08)),
        ),
    )
    pin = pg.Constraint(
        name="pin",
        kind="revolute",
        body="rod",
        other="slider",
        point=(0.5, 0, 0),
        other_point=(0, 0, 0),
        axis=(0, 0, 1),
        other_axis=(0, 0, 1),
    )
    turns = pg.Scenario(
        name="turn",
        description="a constant torque of 4 N m spins it up through its dead points",
        forces=(pg.Force(name="motor", body="crank", torque=4.0),),
        t_end=2.0,
        step=1e-4,
        method="rk4",
    )
    return _planar("slider-crank", bodies, (pin,), turns)


def bricard() -> pg.Model:
    """Six hinges, five rods: by counting it cannot move, by its proportions it can."""
    places = np.array(
        [(0, 0, 0), (1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1), (0, 0, 1)], dtype=float
    )
    axes: list[Vector] = [(0, 1, 0), (0, 0, 1), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 0)]
    bodies: list[pg.Body] = []
    for i in range(5):
        along = places[i + 1] - places[i]
        link = places[i] - places[i - 1] if i else places[0]
        bodies.append(_square_rod(f"rod {i + 1}", along, link, axes[i], i))
    loop = pg.Constraint(
        name="loop",
        kind="revolute",
        body="rod 5",
        point=_vector(places[5] - places[4]),
        other_point=_vector(places[5]),
        axis=axes[5],
        other_axis=axes[5],
    )
    fall = pg.Scenario(
        name="fall", description="let go at rest", t_end=10.0, step=1e-3, method="rk4"
    )
    return _planar("Bricard's six hinges", tuple(bodies), (loop,), fall)


def _square_rod(name: str, along: np.ndarray, link: np.ndarray, axis: Vector, i: int) -> pg.Body:
    """1 m, 1 kg, 0.1 m square: about itself and across it."""
    across = (1 + 0.01) / 12
    inertia = across * np.eye(3) + (0.02 / 12 - across) * np.outer(along, along)
    return pg.Body(
        name=name,
        parent=f"rod {i}" if i else "ground",
        axes=(axis,),
        link=_vector(link),
        com=_vector(along / 2),
        inertia=_matrix(inertia),
        tip=_vector(along),
        shape=bar(_vector(along), radius=0.05),
    )


def andrews() -> pg.Model:
    """Andrews' squeezing mechanism: seven bodies, three loops that meet in one point."""
    e, rr, d, ss, zt, u, zf = 0.02, 0.007, 0.028, 0.035, 0.04, 0.04, 0.02
    a, b = (-0.06934, -0.00227, 0), (-0.03635, 0.03273, 0)
    bodies = (
        _plate("K1", "ground", (0, 0, 0), 0.04325, 2.194e-6, (0.00092, 0), (rr, 0)),
        _plate("K2", "K1", (rr, 0, 0), 0.00365, 4.410e-7, (-0.0115, 0), (-d, 0)),
        _plate("K3", "ground", b, 0.02373, 5.255e-6, (0.01043, -0.01874), (0, -ss)),
        _plate("K5", "ground", a, 0.07050, 1.169e-5, (0.02308, 0.00916), (zt, 0)),
        _plate("K4", "K5", (zt, 0, 0), 0.00706, 5.667e-7, (0, 0.01421 - e), (0, -e)),
        _plate("K7", "ground", a, 0.05498, 1.912e-5, (-0.00449, -0.01228), (0, -u)),
        _plate("K6", "K7", (0, -u, 0), 0.00706, 5.667e-7, (zf - 0.01421, 0), (zf, 0)),
    )
    q = {
        "K1": -0.0617138900142764496,
        "K2": 0.0,
        "K3": 0.455279819163070380,
        "K4": 0.222668390165885885,
        "K5": 0.487364979543842550,
        "K6": -0.222668390165885885,
        "K7": 1.23054744454982119,
    }
    loops = tuple(
        pg.Constraint(
            name=f"{name} at K2",
            body=name,
            other="K2",
            point=_body(bodies, name).tip,
            other_point=(-d, 0, 0),
        )
        for name in ("K3", "K4", "K6")
    )
    forces = (
        pg.Force(name="motor", body="K1", torque=0.033),
        pg.Force(
            name="spring",
            kind="spring",
            body="K3",
            point=(0.02, -0.018, 0),
            other_point=(0.014, 0.072, 0),
            stiffness=4530.0,
            rest=0.07785,
        ),
    )
    spin = pg.Scenario(
        name="spin",
        description="the motor turns the crank two and a half times in 0.03 s",
        t_end=0.03,
        step=1e-5,
        method="rk4",
    )
    return pg.Model(
        name="Andrews' squeezer",
        up=PLANAR,
        gravity=(0, 0, 0),
        bodies=tuple(body.model_copy(update={"q": (q[body.name],)}) for body in bodies),
        constraints=loops,
        forces=forces,
        scenarios=(spin,),
    )


def _body(bodies: tuple[pg.Body, ...], name: str) -> pg.Body:
    return next(body for body in bodies if body.name == name)


def _plate(
    name: str,
    parent: str,
    link: Vector,
    mass: float,
    inertia: float,
    com: tuple[float, float],
    tip: tuple[float, float],
) -> pg.Body:
    """A flat body that moves in the plane, hinged about z."""
    return pg.Body(
        name=name,
        parent=parent,
        link=link,
        mass=mass,
        com=(*com, 0),
        inertia=_matrix(np.diag([inertia / 2, inertia / 2, inertia])),
        tip=(*tip, 0),
        shape=bar((*tip, 0), radius=0.001),
    )


def rolling_disc() -> pg.Model:
    """A coin that rolls and wobbles: three degrees of freedom, five places."""
    r, theta = 0.5, 1.4
    up = np.array([0, math.cos(theta), math.sin(theta)])  # from the contact to the centre
    omega = np.array([0.1, 0.3 * math.sin(theta), -4.0])  # along heading, `up` and the axis
    turn = np.column_stack(([1, 0, 0], up, [0, -math.sin(theta), math.cos(theta)]))
    w = turn @ omega
    disc = pg.Body(
        name="disc",
        joint="free",
        inertia=_matrix(np.diag([r * r / 4, r * r / 4, r * r / 2])),
        q=(*(rounded(x, 15) for x in r * up), math.cos(theta / 2), math.sin(theta / 2), 0, 0),
        v=tuple(rounded(x, 15) for x in (*w, *np.cross(w, r * up))),
        tip=(0, 0, 0),
        shapes=(
            pg.Shape(kind="cylinder", radius=r, length=0.02),
            *spots((0, 0, 1), 0.68 * r, 0.022),
        ),
    )
    rolls = pg.Constraint(
        name="rolls", kind="rolling", body="disc", point=(0, 0, 0), axis=(0, 0, 1), radius=r
    )
    roll = pg.Scenario(
        name="roll",
        description="wobbles along a wavy line without slipping",
        t_end=4.0,
        step=1e-3,
        method="rk4",
    )
    return pg.Model(name="rolling disc", bodies=(disc,), constraints=(rolls,), scenarios=(roll,))


def rod(
    name: str,
    end: Vector,
    *,
    parent: str = "ground",
    link: Vector = (0, 0, 0),
    mass: float = 1.0,
    q: float = 0.0,
    v: float = 0.0,
) -> pg.Body:
    """A uniform slender rod from its hinge about z to `end`."""
    along = np.array(end, dtype=float)
    inertia = mass / 12 * (along @ along * np.eye(3) - np.outer(along, along))
    return pg.Body(
        name=name,
        parent=parent,
        link=link,
        mass=mass,
        com=_vector(along / 2),
        inertia=_matrix(inertia),
        tip=end,
        q=(q,),
        v=(v,),
        shape=bar(end, radius=0.03),
    )


def _vector(x: np.ndarray) -> Vector:
    return (rounded(x[0], 15), rounded(x[1], 15), rounded(x[2], 15))


def _matrix(x: np.ndarray) -> tuple[Vector, Vector, Vector]:
    return (_vector(x[0]), _vector(x[1]), _vector(x[2]))


def _planar(
    name: str,
    bodies: tuple[pg.Body, ...],
    constraints: tuple[pg.Constraint, ...],
    scenario: pg.Scenario,
) -> pg.Model:
    return pg.Model(
        name=name, up=PLANAR, bodies=bodies, constraints=constraints, scenarios=(scenario,)
    )


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
    sides = (math.sqrt(6.0 * (6.0 - 2.0 * k)) for k in (1.0, 2.0, 3.0))
    x, y, z = (rounded(0.2 * max(side, 0.1)) for side in sides)
    body = pg.Body(
        name="racket",
        joint="free",
        inertia=diagonal(1.0, 2.0, 3.0),
        v=(0.01, 5.0, 0.01, 0.0, 0.0, 0.0),
        shape=pg.Shape(kind="box", size=(x, y, z), role="collision"),
    )
    body = body.model_copy(update={"shapes": (*body.shapes, *racket())})
    return pg.Model(
        name="tennis racket",
        gravity=(0, 0, 0),
        bodies=(body,),
        scenarios=(_scenario("turn", "turns over every five seconds", 20.0),),
    )


def spherical_pendulum(height: float = 1.2) -> pg.Model:
    """A pendulum on a ball joint. Its inertia makes it swing like a point mass at 1 m."""
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


def _scenario(name: str, description: str, t_end: float, step: float = 1e-3) -> pg.Scenario:
    return pg.Scenario(name=name, description=description, t_end=t_end, step=step, method="rk4")
