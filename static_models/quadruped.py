"""The quadrupeds: bodies from quadruped.csv, four feet on the ground; hips that also spread."""

from __future__ import annotations

import csv

import pgraph_core as pg

from . import FOLDER
from .looks import animal
from .shapes import Vector, block, limb, rounded
from .stance import FEET, holding_torques, push

TRUNK = ("pelvis", "lumbar", "thorax", "shoulder_neck_head")
DURATION = 0.25  # of the push [s]
KNOTS = 126  # of its tables, at ends of steps: every 2 ms
HIPS = ("left_humerus", "right_humerus", "left_femur", "right_femur")
LEGS = (*HIPS, "left_radius", "right_radius", "left_tibia", "right_tibia")
HULL = (*TRUNK, *LEGS)  # what lies on the ground after a fall
FRICTION = 0.7  # of the paws' soles on the ground, and of the rest

# Gains of the servos [N m/rad], [N m s/rad]: as stiff as RK4 takes at 1 ms with much to spare.
# The fastest mode of the standing body decays at less than 500 1/s, in both scenarios.
PUSH_GAINS = {"trunk": (800.0, 6.0), "leg": (600.0, 2.5), "paw": (400.0, 1.5)}
STAND_GAINS = {"trunk": (200.0, 3.0), "leg": (150.0, 2.0), "paw": (150.0, 1.5)}


def quadruped() -> pg.Model:
    """Sixteen bodies, a free root, hinges about z, y up; values plausible, not the paper's."""
    with (FOLDER / "quadruped.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    names = ["ground", *(row["name"] for row in rows)]
    bodies = [_body(row, names[int(row["parent"])]) for row in rows]
    drawn = animal(bodies)
    feet = {body.name: _foot(body) for body in bodies if body.name in FEET}
    return pg.Model(
        name="quadruped",
        up="y",
        bodies=tuple(_with_shapes(body, bodies, drawn[body.name]) for body in bodies),
        constraints=[feet[name] for name in FEET],
        contacts=(*_soles(bodies), *_hull(bodies)),
        scenarios=(_stance(bodies), _stand(bodies), _walk("bound", 10.0)),
    )


def quadruped_hips() -> pg.Model:
    """The quadruped whose legs also spread: hips turn about x, then z; nothing else differs."""
    walks = tuple(_walk(name, 10.0) for name in ("trot", "crawl", "gallop", "stand"))
    model = quadruped().replace(name="quadruped_hips", constraints=(), scenarios=walks)
    for hip in HIPS:
        model = model.edit(hip, joint="universal").edit(hip, axes=((1, 0, 0), (0, 0, 1)))
    return model


def _walk(name: str, t_end: float) -> pg.Scenario:
    gait = pg.gaits()[name]
    return pg.Scenario(
        name=name,
        description=gait.description,
        constraints=(),
        contacts=(*(fall.foot for fall in gait.feet), *HULL),
        gait=gait,
        t_end=t_end,
        step=1e-3,
    )


def _soles(bodies: list[pg.Body]) -> tuple[pg.Contact, ...]:
    """A point of each paw that may touch the ground; they act in scenarios that name them."""
    tips = {body.name: body.tip_point for body in bodies}
    return tuple(
        pg.Contact(
            name=foot.replace("paw", "foot"),
            body=foot,
            points=(tips[foot],),
            friction=FRICTION,
            active=False,
        )
        for foot in FEET
    )


def _hull(bodies: list[pg.Body]) -> tuple[pg.Contact, ...]:
    """The shapes of trunk and legs over the ground, under the names of their bodies."""
    return tuple(
        pg.Contact(name=body.name, body=body.name, friction=FRICTION, active=False)
        for body in bodies
        if body.name in HULL
    )


def _body(row: dict[str, str], parent: str) -> pg.Body:
    xx, yy, zz, xy = (float(row[key]) for key in ("Ixx", "Iyy", "Izz", "Ixy"))
    return pg.Body(
        name=row["name"],
        parent=parent,
        joint="free" if parent == "ground" else "revolute",
        link=_vector(row, "link"),
        mass=float(row["mass"]),
        com=_vector(row, "com"),
        inertia=((xx, xy, 0), (xy, yy, 0), (0, 0, zz)),
        tip=_vector(row, "tip") if row["tip_x"] else None,
    )


def _vector(row: dict[str, str], name: str) -> Vector:
    return float(row[f"{name}_x"]), float(row[f"{name}_y"]), float(row[f"{name}_z"])


def _with_shapes(body: pg.Body, bodies: list[pg.Body], drawn: tuple[pg.Shape, ...]) -> pg.Body:
    """One simple solid that touches, and the parts of an animal that are drawn."""
    if body.name in TRUNK:
        solid = block(body)
    else:
        solid = limb(body, next((b.link for b in bodies if b.parent == body.name), body.tip_point))
    solid = solid.model_copy(update={"role": "collision"})
    return body.model_copy(update={"shapes": (solid, *drawn)})


def _foot(body: pg.Body) -> pg.Constraint:
    return pg.Constraint(name=body.name, body=body.name, point=body.tip_point)


def _stance(bodies: list[pg.Body]) -> pg.Scenario:
    goal = push(bodies)
    return pg.Scenario(
        name="stance",
        description="a push on four feet: the spine flexes and the legs extend",
        forces=_servos(bodies, PUSH_GAINS, {name: _smooth(goal[name]) for name in goal}),
        constraints=FEET,
        t_end=DURATION,
        step=1e-3,
        method="rk4",
    )


def _stand(bodies: list[pg.Body]) -> pg.Scenario:
    return pg.Scenario(
        name="stand",
        description="standing still: holding torques and a soft posture control",
        forces=_servos(bodies, STAND_GAINS, {}),
        constraints=FEET,
        t_end=1.0,
        step=1e-3,
        method="rk4",
    )


def _servos(
    bodies: list[pg.Body], gains: dict[str, tuple[float, float]], target: dict[str, pg.Table]
) -> tuple[pg.Force, ...]:
    """One servo a hinge, which also holds the weight."""
    torque = holding_torques(bodies)
    servos = []
    for name in torque:
        kp, kd = gains["trunk" if name in TRUNK else "paw" if "paw" in name else "leg"]
        servo = pg.Force(
            name=name,
            kind="servo",
            body=name,
            torque=rounded(torque[name]),
            kp=kp,
            kd=kd,
            target=target.get(name, 0.0),
        )
        servos.append(servo)
    return tuple(servos)


def _smooth(goal: float) -> pg.Table:
    """From 0 to `goal` along s = 3 x² - 2 x³, at rest at both ends."""
    x = [i / (KNOTS - 1) for i in range(KNOTS)]
    return pg.Table(
        t=tuple(rounded(DURATION * s) for s in x),
        value=tuple(rounded(goal * s * s * (3 - 2 * s)) for s in x),
    )
