"""What a person is told of every kind of constraint, contact, force and cut joint (words only)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class About:
    """What a person is told of a field."""

    label: str
    unit: str = ""
    help: str = ""


# one line each: what it does, for whom chooses
KINDS: dict[str, dict[str, str]] = {
    "constraints": {
        "point": "holds a point of one body at a point of the other: 3 rows",
        "weld": "holds point and orientation, as if glued: 6 rows",
        "revolute": "a hinge: point, and one axis along the other: 5 rows",
        "prismatic": "a slider: orientation, and the point on a line: 5 rows",
        "cylindrical": "slides and turns: one axis along the other: 4 rows",
        "universal": "point, and two axes at a right angle: 4 rows",
        "distance": "a massless rod: two points a length apart: 1 row",
        "line": "the point stays on a line: 2 rows",
        "plane": "the point stays on a plane: 1 row",
        "orientation": "the orientation stays, the place is free: 3 rows",
        "gear": "one joint follows another: q = ratio × q + offset",
        "motion": "a joint follows a function of time, whatever it takes",
        "rolling": "a sphere or disc rolls without slip (nonholonomic)",
        "skate": "no velocity across a blade (nonholonomic)",
        "velocity": "a sum of joint velocities has a value (nonholonomic)",
    },
    "contacts": {
        "complementarity": "rigid: no depth, impulses in the friction cone, restitution",
        "soft": "Hunt and Crossley: k d^1.5 (1 + c d'), smooth friction",
        "penalty": "spring and damper: k d + c d', friction that sticks",
    },
    "forces": {
        "motor": "a torque or force on a joint",
        "servo": "holds or drives a joint at a target: kp, kd",
        "wrench": "a force and a torque on a body",
        "spring": "pulls two points together, with damper",
        "torsion": "turns two bodies back to an angle, with damper",
    },
    "loops": {
        "revolute": "a hinge closes the loop",
        "spherical": "a ball closes the loop",
        "universal": "a universal joint closes the loop",
        "prismatic": "a slider closes the loop",
        "cylindrical": "a sliding hinge closes the loop",
        "weld": "the loop is closed rigidly",
    },
    "limits": {"limits": "least and greatest position of a joint (unilateral)"},
}
TITLES = {
    "constraints": "Constraint",
    "loops": "Close a loop (cut joint)",
    "contacts": "Contact (unilateral)",
    "limits": "Joint limit (unilateral)",
    "forces": "Force, motor, spring",
}
WORD = {"constraints": "constraint", "contacts": "contact", "forces": "force", "loops": "loop"}

FIELDS = {
    "name": About("Name"),
    "kind": About("Kind"),
    "law": About("Law", "", "how it pushes back"),
    "body": About("Body"),
    "other": About("Other"),
    "point": About("Point", "length", "in the axes of the body; empty: its tip"),
    "other_point": About(
        "Other point", "length", "in the axes of the other; empty: where the point is at first"
    ),
    "axis": About("Axis", "", "direction in the axes of the body; empty: as at first"),
    "other_axis": About("Other axis", "", "direction in the axes of the other; empty: as at first"),
    "length": About("Length", "length", "of the rod; empty: as at first"),
    "ratio": About("Ratio", "", "q of the body = ratio × q of the other + offset"),
    "offset": About("Offset", "rad, m"),
    "coordinate": About("Coordinate", "", "which degree of freedom of the body's joint, from 0"),
    "other_coordinate": About("Other's", "", "which degree of freedom of the other's joint"),
    "curve": About("Follows", "", "how the position depends on time"),
    "sine": About("Sine", "", "mean + amplitude sin(frequency t + phase)"),
    "polynomial": About("Polynomial", "", "c0 + c1 t + c2 t² + c3 t³"),
    "table": About("Table", "", "t q; t q; ... a smooth curve through these"),
    "radius": About("Radius", "length", "empty: that of the body's shape"),
    "coefficients": About("Coefficient", "", "one a degree of freedom"),
    "value": About("Value", "rad/s, m/s", "what the sum of coefficients × v is"),
    "friction": About("Friction", "", "Coulomb's coefficient; empty: that of the ground"),
    "restitution": About("Restitution", "", "0 to 1; empty: that of the ground"),
    "points": About("Points", "length", "that touch, in the axes of the body; none: its shape"),
    "torque": About("Torque", "N m, N", "a number, or over time: t value; t value; ..."),
    "force": About("Force", "N"),
    "torque_over": About("Torque is", "", "constant, or straight lines between times"),
    "force_over": About("Force is", "", "constant, or straight lines between times"),
    "frame": About("Axes of", "", "whose axes force and torque are in"),
    "stiffness": About("Stiffness", "N/m"),
    "damping": About("Damping", "N s/m"),
    "rest": About("Rest", "", "without force; empty: as at first"),
    "kp": About("kp", "N m/rad, N/m", "torque per position off the target"),
    "kd": About("kd", "N m s/rad", "torque per velocity"),
    "target": About("Target", "rad, m", "a number, or over time: t value; t value; ..."),
    "torque_limit": About("At most", "N m, N", "largest magnitude; empty: none"),
}
UNITS_OF = {  # where a kind has another unit than FIELDS says
    ("stiffness", "torsion"): "N m/rad",
    ("damping", "torsion"): "N m s/rad",
    ("rest", "torsion"): "angle",
    ("rest", "spring"): "length",
    ("stiffness", "soft"): "N/m^1.5",
    ("damping", "soft"): "s/m",
    ("torque", "wrench"): "N m",
}
EMPTY_OF = {  # what an empty stiffness or damping of a contact means
    "stiffness": "empty: from the masses",
    "damping": "empty: from the restitution",
}
