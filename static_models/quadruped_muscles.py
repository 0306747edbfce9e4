"""The quadruped with 24 muscles in its legs, excited as it stands and trots.

No signal returns to the muscles. Their fibres are shorter than the optimal length and pull against
each other, so that each joint is a spring and a damper, and the animal returns to its posture.
Static optimisation finds the activations of two postures: standing, and a leg lifted.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

import pgraph_core as pg
from pgraph_core.rotation import Array

from .looks import Vector, rounded
from .quadruped import FEET, HULL, STAND_GAINS, TRUNK, holding_torques, quadruped

Spot = tuple[str, float, float]  # a bone, and metres along it and ahead of it from its joint

TONE = 0.45  # the least activation of every muscle: two that pull against each other are stiff
SOFT = 0.03  # that of a lifted leg
FIBRE = 0.65  # length of the fibres at rest over the optimal one: longer ones pull harder
LIFT = {"front": (0.03, 0.03), "hind": (0.0, 0.05)}  # how far ahead and up a paw is lifted [m]
PACE = 8.0  # 2 pi over the time of a stride [1/s]
LOW, HIGH = 0.6, 0.9  # the part of a stride in the air: where a sine is as high
PHASES = {  # the part of a stride at which a paw begins to rise: two across at a time
    "left_front_paw": 0.0, "right_hind_paw": 0.0, "right_front_paw": 0.5, "left_hind_paw": 0.5,
}  # fmt: skip
BONES = {
    "fore": ("shoulder_neck_head", "humerus", "radius", "front_paw"),
    "hind": ("pelvis", "femur", "tibia", "hind_paw"),
}


class Strand(NamedTuple):
    """A muscle of a leg, from one bone over a round joint, if `round` names it, to another."""

    name: str
    leg: str
    origin: Spot
    end: Spot
    f_max: float  # N
    l_opt: float  # m
    pennation: float = 0.0  # rad
    round: str = ""  # the bone at whose joint it turns
    radius: float = 0.0  # m, below zero behind the joint


STRANDS = (
    Strand("brachiocephalicus", "fore", ("shoulder_neck_head", 0.0, 0.08),
           ("humerus", 0.08, 0.02), 2000.0, 0.07),
    Strand("latissimus", "fore", ("shoulder_neck_head", -0.05, -0.07),
           ("humerus", 0.08, -0.02), 2000.0, 0.07),
    Strand("triceps", "fore", ("humerus", 0.03, -0.03), ("radius", 0.05, -0.02),
           3500.0, 0.05, 0.2, "radius", -0.035),
    Strand("biceps", "fore", ("shoulder_neck_head", -0.01, 0.04), ("radius", 0.05, 0.02),
           2400.0, 0.06),
    Strand("carpal_flexor", "fore", ("radius", 0.02, -0.03), ("front_paw", 0.02, -0.03),
           2000.0, 0.04, 0.3),
    Strand("carpal_extensor", "fore", ("radius", 0.03, 0.03), ("front_paw", 0.03, 0.015),
           2000.0, 0.04, 0.15, "front_paw", 0.025),
    Strand("iliopsoas", "hind", ("pelvis", -0.04, 0.06), ("femur", 0.08, 0.03), 2500.0, 0.08),
    Strand("gluteus", "hind", ("pelvis", -0.06, -0.06), ("femur", 0.05, -0.04), 2000.0, 0.07),
    Strand("vasti", "hind", ("femur", 0.03, 0.03), ("tibia", 0.05, 0.02),
           3500.0, 0.06, 0.2, "tibia", 0.035),
    Strand("hamstrings", "hind", ("pelvis", 0.02, -0.09), ("tibia", 0.05, -0.015), 2000.0, 0.09),
    Strand("gastrocnemius", "hind", ("femur", 0.25, -0.01), ("hind_paw", -0.02, -0.04),
           2500.0, 0.05, 0.3),
    Strand("tibialis", "hind", ("tibia", 0.03, 0.03), ("hind_paw", 0.03, 0.015),
           2200.0, 0.045, 0.15, "hind_paw", 0.025),
)  # fmt: skip


FORE = [strand.name for strand in STRANDS if strand.leg == "fore"]


def quadruped_muscles() -> pg.Model:
    """The quadruped with planar legs and 24 muscles, which stands and trots by excitations."""
    base = _bare()
    muscles = _muscles(base)
    mech = pg.Mechanism(base.replace(forces=[f for f in muscles if f.name.startswith("left")]))
    stand = excitations(mech, ())
    lifted = excitations(mech, [foot for foot in FEET if foot.startswith("left")])
    forces = [
        edited(f, excitation=_over_time(f, stand[of_left(f.name)], lifted[of_left(f.name)]))
        for f in muscles
    ]
    scenario = pg.Scenario(
        name="step",
        description="standing for a second, then a slow trot, all by excitations over time",
        contacts=(*(foot.replace("paw", "foot") for foot in FEET), *HULL),
        t_end=6.0,
        step=5e-4,
        method="moreau_jean",
    )
    return base.replace(
        forces=(*forces, *_spine(base)), parameters={"lift": 1.0}, scenarios=(scenario,)
    )


def _bare() -> pg.Model:
    """The quadruped on its feet without forces and scenarios."""
    return quadruped().replace(name="quadruped_muscles", constraints=(), scenarios=())


def _spine(model: pg.Model) -> tuple[pg.Force, ...]:
    """Servos that hold the spine, which has no muscles."""
    kp, kd = STAND_GAINS["trunk"]
    torque = holding_torques(model.bodies)
    return tuple(
        pg.Servo(name=name, body=name, torque=rounded(torque[name]), kp=kp, kd=kd)
        for name in TRUNK
        if name in torque
    )


def _over_time(muscle: pg.Muscle, stand: float, lifted: float) -> str:
    """The excitation that stands, and in its turn that of the lifted leg."""
    side = "left" if muscle.name.startswith("left") else "right"
    leg = "front" if muscle.name.partition("_")[2] in FORE else "hind"
    turn = PHASES[f"{side}_{leg}_paw"]
    wave = f"sin({PACE:g}*(t - 1) - {turn:g}*2*pi)"
    more = rounded(round(lifted - stand, 4))
    return f"={stand:.4f} + if(t < 1, 0, lift)*{more}*smoothstep({wave}, {LOW:g}, {HIGH:g})"


def of_left(name: str) -> str:
    """Return the name of the same muscle on the left."""
    return name.replace("right_", "left_")


def excitations(mech: pg.Mechanism, lifted: Sequence[str]) -> dict[str, float]:
    """Excitations that hold the animal standing, or the legs of these feet in the air."""
    tone = SOFT if lifted else TONE
    muscles = [f for f in mech.model.forces if isinstance(f, pg.Muscle)]
    toned = [edited(f, weakest=tone) for f in muscles]
    q = _raised(mech, lifted)
    bare = pg.Mechanism(mech.model.replace(forces=()))
    rest = np.zeros(bare.nv)
    weight = bare.inverse_dynamics(q, rest, rest)
    stay = [foot for foot in FEET if foot not in lifted]
    rows = [bare.jacobian(q, foot, mech.model.body(foot).tip_point)[3:] for foot in stay]
    feet = np.vstack(rows).T
    torque = weight - feet @ np.linalg.lstsq(feet[:6], weight[:6])[0]
    legs = {f.body for f in toned} | {f.other for f in toned} - set(TRUNK)
    wanted = {name: float(torque[mech.joints[name].v][0]) for name in sorted(legs)}
    found = pg.Mechanism(mech.model.replace(forces=toned)).activations(wanted, q=q)
    if found.notices:
        raise ValueError(found.notices[0])
    return dict(found.activation)


def edited(force: pg.Muscle, **changes: object) -> pg.Muscle:
    """The muscle with changed fields."""
    return force.model_copy(update=changes)


def _raised(mech: pg.Mechanism, feet: Sequence[str]) -> Array:
    """Coordinates with these feet lifted, by the least turns of the joints."""
    q = mech.home()[0]
    for foot in feet:
        leg = [foot]
        while mech.model.body(leg[-1]).parent not in TRUNK:
            leg.append(mech.model.body(leg[-1]).parent)
        tip = mech.model.body(foot).tip_point
        at = [mech.joints[name] for name in leg]
        cells = [j.q.start for j in at]
        columns = [j.v.start for j in at]
        goal = _place(mech, q, foot, tip)[:2] + LIFT["front" if "front" in foot else "hind"]
        for _ in range(20):
            miss = goal - _place(mech, q, foot, tip)[:2]
            q[cells] += np.linalg.pinv(mech.jacobian(q, foot, tip)[3:5, columns]) @ miss
    return q


def _place(mech: pg.Mechanism, q: Array, name: str, point: Vector) -> Array:
    """A point of a body in the world."""
    at, turn = mech.pose(q, name)
    return at + turn @ point


def _muscles(model: pg.Model) -> list[pg.Muscle]:
    """The muscles of all legs, whose tendons let the fibres rest at FIBRE."""
    found = [_muscle(model, s, side) for s in STRANDS for side in ("left", "right")]
    mech = pg.Mechanism(model.replace(forces=found))
    lengths = mech.path_length(mech.home()[0])
    return [
        edited(f, l_slack=rounded(length - FIBRE * f.l_opt)) for f, length in zip(found, lengths)
    ]


def _muscle(model: pg.Model, strand: Strand, side: str) -> pg.Muscle:
    leg = strand.leg
    name = lambda bone: bone if bone in TRUNK else f"{side}_{bone}"  # noqa: E731

    def spot(place: Spot) -> Vector:
        """The point of a spot in the axes of its bone."""
        bone, along, ahead = place
        body = model.body(name(bone))
        if bone in TRUNK:
            start, way = model.body(name(BONES[leg][1])).link, np.array((0.0, -1.0))
        else:
            start, way = (0.0, 0.0, 0.0), _end(model, body)[:2]
        way = way / np.linalg.norm(way)
        x, y = along * way + ahead * np.array((-way[1], way[0]))
        return rounded(start[0] + x), rounded(start[1] + y), start[2]

    via = ()
    if strand.round:
        joint = model.body(name(strand.round))
        above = model.body(joint.parent)
        ahead = 1.0 if strand.radius > 0 else -1.0
        side_of = np.add(joint.link, (0.1 * ahead, 0.0, 0.0))
        via = (pg.Via(body=above.name, point=joint.link, radius=abs(strand.radius),
                      axis=(0, 0, 1), side=tuple(side_of)),)  # fmt: skip
    return pg.Muscle(
        name=f"{side}_{strand.name}", body=name(strand.end[0]), point=spot(strand.end),
        other=name(strand.origin[0]), other_point=spot(strand.origin), via=via,
        f_max=strand.f_max, l_opt=strand.l_opt, l_slack=0.1, pennation=strand.pennation,
        tendon="rigid",
    )  # fmt: skip


def _end(model: pg.Model, body: pg.Body) -> Array:
    """The far end of a bone in its axes."""
    ends = [b.link for b in model.bodies if b.parent == body.name]
    return np.asarray(ends[0] if ends else body.tip_point)
