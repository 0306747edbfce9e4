"""The quadrupeds with bodies from quadruped.csv: planar legs, or hips that also spread."""

from __future__ import annotations

import cmath
import csv
from collections.abc import Mapping, Sequence

import numpy as np

import pgraph_core as pg
from pgraph_core.rotation import Array, skew

from . import FOLDER
from .looks import COAT, Vector, animal, block, limb, rounded, segment

TRUNK = {  # its segments, and how far each turns in the push [rad]
    "pelvis": 0.06, "lumbar": -0.1, "thorax": -0.08, "shoulder_neck_head": 0.1,
}  # fmt: skip
DURATION = 0.25  # [s] duration of the push
KNOTS = 126  # knots of its tables, every 2 ms at ends of steps
HIPS = ("left_humerus", "right_humerus", "left_femur", "right_femur")
LEGS = (*HIPS, "left_radius", "right_radius", "left_tibia", "right_tibia")
HULL = (*TRUNK, *LEGS)  # bodies that may touch the ground after a fall
NECK_AND_HEAD = (  # shapes inside the drawn ones
    limb((0.11, 0.02, 0), 0.064, (0.335, 0.215, 0), 0.064, COAT),
    limb((0.335, 0.205, 0), 0.045, (0.45, 0.18, 0), 0.045, COAT),
)
FRICTION = 0.7  # friction of paws and other bodies on the ground

# Gains of the servos [N m/rad], [N m s/rad]: as stiff as RK4 takes at 1 ms with much to spare.
# The fastest mode of the standing body decays at less than 500 1/s, in both scenarios.
PUSH_GAINS = {"trunk": (800.0, 6.0), "leg": (600.0, 2.5), "paw": (400.0, 1.5)}
STAND_GAINS = {"trunk": (200.0, 3.0), "leg": (150.0, 2.0), "paw": (150.0, 1.5)}


def quadruped() -> pg.Model:
    """A quadruped of 16 bodies with planar legs. The masses and lengths are ours."""
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
    """The quadruped with hips that also spread. It trots, crawls, gallops and stands."""
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
    """Return a contact point of each paw, active in the scenarios that name it."""
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
    """Simple solids that touch, and the parts of an animal that are drawn."""
    if body.name in TRUNK:
        solid = block(body)
    else:
        end = next((b.link for b in bodies if b.parent == body.name), body.tip_point)
        solid = segment(body, end)
    solids = (solid, *NECK_AND_HEAD) if body.name == "shoulder_neck_head" else (solid,)
    plain = {"role": "collision", "end_radius": None, "colour": None}
    touching = [one.model_copy(update=plain) for one in solids]
    return body.model_copy(update={"shapes": (*touching, *drawn)})


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


# -- standing on four feet -------------------------------------------------------------------------


GRAVITY = np.array([0.0, -9.81, 0.0])  # [m/s^2]
FEET = ("left_front_paw", "right_front_paw", "left_hind_paw", "right_hind_paw")

# The push, as the end of a smooth motion from q = 0.
PELVIS = complex(0.04, 0.03)  # displacement of its origin [m]
PAW = {"front": -0.05, "hind": -0.25}  # turn of the paw itself in the world [rad]


def origins(bodies: Sequence[pg.Body]) -> dict[str, Array]:
    """Origins of the body frames at q = 0, world axes [m]."""
    found: dict[str, Array] = {"ground": np.zeros(3)}
    for body in bodies:
        found[body.name] = found[body.parent] + body.link
    return found


def path(bodies: Sequence[pg.Body], name: str) -> list[str]:
    """Names from a body to its root."""
    parent = {body.name: body.parent for body in bodies}
    names = [name]
    while parent[names[-1]] != "ground":
        names.append(parent[names[-1]])
    return names


def holding_torques(bodies: Sequence[pg.Body]) -> dict[str, float]:
    """Torques of the hinges that hold the body still at q = 0 [N m].

    tau = C - Jᵀ lam, with C the weight's share and lam the forces on the feet: those of least
    norm that leave the free root without torque and force.
    """
    at = origins(bodies)
    weight = np.zeros(6)
    feet = np.zeros((6, 3 * len(FEET)))
    for body in bodies:
        weight += _wrench(at[body.name] + body.com - at["pelvis"]) @ (body.mass * GRAVITY)
    for i, foot in enumerate(FEET):
        feet[:, 3 * i : 3 * i + 3] = _wrench(_sole(bodies, at, foot) - at["pelvis"])
    lam = (np.linalg.pinv(feet) @ -weight).reshape(-1, 3)
    torque = {body.name: 0.0 for body in bodies if body.dof == 1}
    for body in bodies:
        _share(torque, bodies, body.name, at[body.name] + body.com, body.mass * GRAVITY, at)
    for foot, force in zip(FEET, lam):
        _share(torque, bodies, foot, _sole(bodies, at, foot), force, at)
    return torque


def _wrench(arm: Array) -> Array:
    """Return the matrix (6, 3) from a force at `arm` to its wrench at the origin."""
    return np.vstack((skew(arm), np.eye(3)))


def _sole(bodies: Sequence[pg.Body], at: Mapping[str, Array], foot: str) -> Array:
    tip = next(body.tip_point for body in bodies if body.name == foot)
    return at[foot] + tip


def _share(
    torque: dict[str, float],
    bodies: Sequence[pg.Body],
    name: str,
    point: Array,
    force: Array,
    at: Mapping[str, Array],
) -> None:
    """Take off what a force on a body does about the hinges inboard of it."""
    for inboard in path(bodies, name):
        if inboard in torque:
            torque[inboard] -= float(np.cross(point - at[inboard], force)[2])


def push(bodies: Sequence[pg.Body]) -> dict[str, float]:
    """Angles of the hinges at the end of the push, all four feet in place [rad]."""
    link = {body.name: complex(*body.link[:2]) for body in bodies}
    angle = {name: turn for name, turn in TRUNK.items() if name != "pelvis"}
    heading, origin = TRUNK["pelvis"], link["pelvis"] + PELVIS
    angle |= _leg(bodies, link, origin, heading, ("left_femur", "left_tibia", "left_hind_paw"))
    for name in ("lumbar", "thorax", "shoulder_neck_head"):
        origin += link[name] * cmath.exp(1j * heading)
        heading += TRUNK[name]
    angle |= _leg(bodies, link, origin, heading, ("left_humerus", "left_radius", "left_front_paw"))
    return {b.name: angle[b.name.replace("right", "left")] for b in bodies if b.name != "pelvis"}


def _leg(
    bodies: Sequence[pg.Body],
    link: Mapping[str, complex],
    origin: complex,
    heading: float,
    names: tuple[str, str, str],
) -> dict[str, float]:
    """Angles of a leg whose girdle stands at `origin` and whose foot stays where it was."""
    upper, lower, paw = names
    at = origins(bodies)
    turn = PAW["hind" if "hind" in paw else "front"]
    sole = complex(*_sole(bodies, at, paw)[:2])
    tip = sole - complex(*at[paw][:2])
    reach = sole - tip * cmath.exp(1j * turn) - origin - link[upper] * cmath.exp(1j * heading)
    a, b = link[lower], link[paw]
    # |a + b e^{i knee}| = |reach|: the knee's bend, on the side on which it bends already.
    cosine = (abs(reach) ** 2 - abs(a) ** 2 - abs(b) ** 2) / (2 * abs(a) * abs(b))
    bend, side = cmath.acos(cosine).real, cmath.phase(b / a)
    knee = (bend if side > 0 else -bend) - side
    hip = cmath.phase(reach / (a + b * cmath.exp(1j * knee)))
    return {upper: hip - heading, lower: knee, paw: turn - hip - knee}
