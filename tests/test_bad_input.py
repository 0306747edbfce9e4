"""Bad models and files: a refusal names the part, the field, the value given and what is allowed.

Rows go in by Python and by a file with `pgraph check`. Values of the wrong type are generated for
every field of every kind from its annotation and from what its description promises.
"""

import json
import math
import re
import types
from collections.abc import Iterator
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import numpy as np
import pytest
from pydantic import BaseModel

import pgraph_core as pg
from pgraph_app.cli import main
from pgraph_core.errors import shown
from tests.refusals import assert_names, assert_problems, refusal
from tests.worlds import WHOLE

pytestmark = pytest.mark.quick
NAN, INF = math.nan, math.inf
BASE = pg.Model.serial(3)
BEFORE = BASE.to_json()


BODIES = [
    {"name": "arm"},
    {"name": "ball", "joint": "spherical"},
    {"name": "puck", "joint": "free", "shape": {"kind": "sphere", "radius": 0.1}},
]


def row(where: str, told: Any, model: dict[str, Any]) -> tuple[dict[str, Any], list[Any]]:
    told = told if isinstance(told[0], tuple) else (told,)
    return model, [(f"{where}, {field}", *facts) for field, *facts in told]


def body(*told: Any, **fields: Any) -> Any:
    return row("body 'a'", told, {"bodies": [{"name": "a", **fields}]})


def named(*told: Any, **fields: Any) -> Any:
    """A body that is known by its row alone."""
    return row("row 1", told, {"bodies": [fields]})


def part(section: str, *told: Any, **fields: Any) -> Any:
    model = {"bodies": BODIES, section: [{"name": "x", "body": "arm", **fields}]}
    return row(f"{section[:-1]} 'x'", told, model)


def constraint(kind: str, *told: Any, **fields: Any) -> Any:
    made = part("constraints", *told, kind=kind, **fields)
    if "coefficients" in fields or kind == "velocity":
        made[0]["constraints"][0].pop("body")
    return made


def relation(*told: Any, **fields: Any) -> Any:
    model, expected = constraint("relation", *told, **{"other": "slide", **fields})
    model["bodies"] = [*model["bodies"], {"name": "slide", "joint": "prismatic"}]
    return model, expected


def cam(*told: Any, **fields: Any) -> Any:
    given = {"other": "shaft", "base_radius": 0.04, "body": "valve", **fields}
    model, expected = constraint("cam", *told, **given)
    y, z = (0, 1, 0), (0, 0, 1)
    model["bodies"] = [
        *model["bodies"],
        {"name": "shaft", "axes": [y]},
        {"name": "valve", "joint": "prismatic", "axes": [z]},
        {"name": "along", "joint": "prismatic", "axes": [y]},
        {"name": "on arm", "joint": "prismatic", "axes": [z], "parent": "arm"},
        {"name": "lever", "axes": [y], "link": (0, 0.5, 0.12)},
        {"name": "left lever", "axes": [(0, -1, 0)], "link": (0, 0, 0.12)},
    ]
    return model, expected


def lifts(*rows: Any) -> Any:
    return [{"lift": lift, "angle": angle} for lift, angle in rows]


LIFT = [{"lift": 0.01, "angle": 3.0}, {"lift": 0.0}]


def points(x: Any, value: Any = None, **more: Any) -> Any:
    return {"x": x, "value": [0.0 for _ in x] if value is None else value, **more}


def powers(*c: float) -> Any:
    return {"kind": "polynomial", "coefficients": list(c)}


def force(kind: str, *told: Any, **fields: Any) -> Any:
    return part("forces", *told, kind=kind, **fields)


def contact(*told: Any, **fields: Any) -> Any:
    return part("contacts", *told, **{"body": "puck", **fields})


def scenario(*told: Any, **fields: Any) -> Any:
    made = part("scenarios", *told, **fields)
    made[0]["scenarios"][0].pop("body")
    return made


def beam(*told: Any, **fields: Any) -> Any:
    given = {"name": "rod", "length": 1.0, "EI": 1.0, "rho_a": 1.0, **fields}
    return row("beam 'rod'", told, {"bodies": BODIES, "beams": [given]})


def model(*told: Any, **fields: Any) -> Any:
    return row("model", told, fields)


def ground(*facts: Any, **fields: Any) -> Any:
    return row("model", ("ground", *facts), {"ground": fields})


def several(fields: dict[str, Any], *told: Any) -> Any:
    return fields, told


def moments(*values: float) -> list[list[float]]:
    return np.diag(values).tolist()


NO_ANGLE = ("rotate", "translate")  # motions with an angle or a length
HINGE = ("'arm'", "1", "got")

ROWS = [
    named("name", "''", name=""),
    *(
        row(f"body {name!r}", ("name", repr(name)), {"bodies": [{"name": name}]})
        for name in (" a", "a\nb", "ground", "*")
    ),
    several({"bodies": [{"name": "a", "\n": 1}]}, ("body 'a', \n", "mass")),
    body("parent", "'tigh'", "ground", parent="tigh"),
    *(body("dof", "0", "6", f"got {dof!r}", dof=dof) for dof in (7, -1, 1.5, "2", True)),
    body("dof", "2", "'spherical'", dof=2, joint="spherical"),
    body("joint", "'hinges'", "revolute", joint="hinges", axes=(0, 1, 0)),
    body("mass", "1.5", "unit", mass="1.5 kg"),
    body("inertia", "positive semidefinite", "-1 kg", inertia=moments(-1, 1, 1)),
    body("inertia", "positive semidefinite", inertia=[[1, 2, 0], [2, 1, 0], [0, 0, 1]]),
    body("inertia", "triangle", "1 + 1 < 3", "by 1 kg m^2", inertia=moments(1, 1, 3)),
    body("inertia", "triangle", "(I, I, I)", "any_inertia=True", inertia=moments(0, 1, 0)),
    body("inertia", "symmetric", "2.0", inertia=[[1, 2, 0], [0, 1, 0], [0, 0, 1]]),
    body("inertia", "(xx, xy, xz)", inertia=[1, 2, 3, 0, 0, 0]),
    body("axes", "zero", "[0.0, 0.0, 0.0]", axes=[[0, 0, 0]]),
    body("axes", "revolute", "one axis", "[[0, 1]]", axes=[[0, 1]]),
    body("axes", "w", axes="w"),
    body("axes", "xy", axes=("xy",)),
    body("axes", "parallel", "[2.0, 0.0, 0.0]", joint="universal", axes=[[1, 0, 0], [2, 0, 0]]),
    body("q", "revolute", "1", "2", q=[1, 2]),
    body("q", "quaternion", "[0.0, 0.0, 0.0, 0.0]", dof=3, q=[0, 0, 0, 0]),
    body("v", "revolute", "1", "2", q=5.0, v=[1, 2]),
    body("masss", "did you mean mass?", *pg.Body.model_fields, masss=2),
    body("slide", "did you mean joint?", slide=[0, 0, 1]),
    body("com", "[[0.25, 0, 0]]", com=[[0.25, 0, 0]]),
    body("mass", "no parameter", "'m'", mass="=m/2"),
    body("damping", "weld", "1.0", joint="weld", damping=1),
    body("motions", "revolute", "[]", "joint='weld'", motions=[]),
    body("motions", "compound", "[]", joint="compound", motions=[]),
    *(body("limits", limits=limits) for limits in ([0], 0, False, [5], [1, 0])),
    body("shape", "'plate'", "did you mean box?", "capsule", shape={"kind": "plate"}),
    body("shape", "sphere", "radius", shape={"kind": "sphere"}),
    constraint("glue", ("kind", "'glue'", *pg.Constraint.KINDS)),
    constraint("point", "length", "'point'", "distance", length=1),
    constraint("distance", "other_point", "missing"),
    constraint("line", "other_axis", "one direction", "axis"),
    constraint("universal", "other_axis", "axis", "both", axis=[0, 0, 1]),
    constraint("gear", "other", "'ground'", "second body"),
    constraint(
        "gear", ("ratio", "zero", "'motion'", "got 0"), ("coordinate", *HINGE),
        ("other_coordinate", *NO_ANGLE), other="puck", coordinate=1, ratio=0,
    ),
    cam("motion", "missing", "segments"),
    cam("motion", "none", "two or more", motion=[]),
    cam("motion", "360 degrees", "257.831 degrees", "rest", motion=lifts((0.02, 1.5), (0.0, 3.0))),
    cam("motion", "0.02", "lift=0", motion=lifts((0.01, 3.0), (0.02, None))),
    cam("motion", "only one", "segments 0 and 1", motion=lifts((0.01, None), (0.0, None))),
    cam("motion", "nothing is left", motion=lifts((0.01, 6.5), (0.0, None))),
    cam("motion", "other than 0", "'motion'", motion=lifts((0.0, None))),
    cam("motion", "'periodic'", "'natural'", motion=points([0, 3, 6.28], [0, 1, 0])),
    cam("motion", "one turn", "2 pi", motion=points([0, 3, 6], [0, 1, 0], kind="periodic")),
    cam("motion", "must return", "0.01",
        motion=points([0, 3, 2 * np.pi], [0, 0.02, 0.01], kind="periodic")),
    cam("base_radius", "> 0", "got 0", motion=LIFT, base_radius=0),
    cam("base_radius", "missing", motion=LIFT, base_radius=None),
    cam("base_radius", "undercut", "at least", motion=lifts((0.05, 1.6), (0.0, None)),
        base_radius=0.01, follower="flat"),
    cam("eccentricity", "less than", "0.04", "got 0.05", motion=LIFT, eccentricity=0.05),
    cam("eccentricity", "flat", "leave it out", motion=LIFT, eccentricity=0.01, follower="flat"),
    cam("roller_radius", "> 0", "got 0", motion=LIFT, follower="roller", roller_radius=0),
    cam("roller_radius", "needs its radius", motion=LIFT, follower="roller"),
    cam("roller_radius", "follower='roller'", "'knife'", motion=LIFT, roller_radius=0.01),
    cam("follower", "'ball'", "knife, roller, flat", motion=LIFT, follower="ball"),
    cam("arm", "distance", motion=LIFT, arm=0.1),
    cam("distance", "slides", "leave", motion=LIFT, arm=0.1, distance=0.1),
    cam("distance", "less than 0.14", "got 0.2", motion=LIFT, arm=0.1, distance=0.2),
    cam("other", "hinge", "'puck'", motion=LIFT, other="puck"),
    cam("other", "'ground'", "second body", motion=LIFT, other="ground"),
    cam("body", "'ball'", "prismatic", motion=LIFT, body="ball"),
    cam("distance", "'lever'", "0.12", "arm", motion=LIFT, body="lever"),
    cam("distance", "0.12", "got 0.11", motion=LIFT, body="lever", distance=0.11, arm=0.1),
    cam("body", "same direction", motion=LIFT, body="left lever", distance=0.12, arm=0.1),
    cam("body", "across the axis", "0 degrees", motion=LIFT, body="along"),
    cam("body", "'ground'", "'arm'", "same body", motion=LIFT, body="on arm"),
    relation("curve", "missing", "'x'", "periodic", "polynomial"),
    relation("other", "'ground'", "second body", curve="=q", other="ground"),
    relation("other", "'arm'", "itself", curve="=q", other="arm"),
    relation("other", "'leg'", "arm, ball, puck", curve="=q", other="leg"),
    relation("coordinate", *HINGE, curve="=q", coordinate=1),
    relation("other_coordinate", *NO_ANGLE, curve="=q", other="puck", other_coordinate=4),
    relation("curve", "3.0", "expression", curve=3.0),
    relation("curve", "'cubic'", "'natural'", "'periodic'", curve=points([0, 1], kind="cubic")),
    relation("curve", "ascend", "[0.0, 2.0, 1.0]", curve=points([0, 2, 1])),
    relation("curve", "2 or more points", "got 1", curve=points([0])),
    relation("curve", "natural", "got 0", curve=points([])),
    relation("curve", "3 or more", "got 2", "gear", curve=points([0, 1], kind="periodic")),
    relation("curve", "2 coordinates and 1 values", curve={"x": [0, 1], "value": [0]}),
    relation("curve", "leave one out", "1e-11", curve=points([0, 1e-11, 1])),
    relation("curve", "too large", curve=points([0, 1e-160, 2e-160], value=[0, 1e300, 0])),
    relation("curve", "degree 1 to 7", "'motion'", "[0.3]", curve=powers(0.3)),
    relation("curve", "degree 1 to 7", "[1.0, 0.0]", curve=powers(1, 0)),
    relation("curve", "one to eight", "7, 8]", curve=powers(*range(9))),
    *(
        relation("curve", repr(f"={text}"), "corner", "smoothstep", curve=f"={text}")
        for text in ("abs(q)", "max(q, 1)", "if(q > 1, q, 1)", "q > 0", "table(q, 0, 1, 2, 3)")
    ),
    relation("curve", "q.slide", "in short q", "column 6", curve="=sin(t)"),
    relation("curve", "q.slide", "in short q", curve="=q.arm"),
    relation("curve", "q.slide", "in short q", curve="=v.slide"),
    relation("curve", "q.slide", "in short q", curve="=q.puck[1]"),
    relation("curve", "'speed'", "q", curve="=speed*q"),
    relation("curve", "m^2", "not rad", curve="=q.slide^2"),
    relation("curve", "not a valid expression", "'=sin('", curve="=sin("),
    constraint("motion", "q_of_t", "one to four", "5.0", q_of_t=powers(1, 2, 3, 4, 5)),
    constraint("motion", "q_of_t", "missing", "table", "'sine'", "'polynomial'"),
    constraint("motion", "other", "'motion'", "'ball'", other="ball", q_of_t={"kind": "sine"}),
    constraint("motion", "q_of_t", "'cosine'", "'sine'", q_of_t={"kind": "cosine"}),
    constraint("motion", "q_of_t", "amplitude", "'x'", q_of_t={"kind": "sine", "amplitude": "x"}),
    constraint("motion", "q_of_t", "ascend", "[0.0, 0.0]", q_of_t={"t": [0, 0], "value": [1, 1]}),
    constraint("rolling", "radius", "'arm'", "sphere", "> 0"),
    constraint("rolling", "radius", "'arm'", "cylinder", axis=[0, 0, 1]),
    constraint("velocity", "coefficients", "missing", value=1),
    constraint("velocity", "coefficients", "'arm'", "1", "2", coefficients={"arm": [1, 2]}),
    constraint("velocity", "coefficients", "'leg'", "arm, ball, puck", coefficients={"leg": 1}),
    constraint("velocity", "other", "'ball'", coefficients={"arm": 1}, other="ball"),
    constraint("weld", "ratio", "'weld'", "gear", ratio=2),
    constraint("point", "other", "'arm'", "itself", other="arm"),
    contact("body", "'arm'", "shape", "points", body="arm"),
    contact("points", "'*'", body="*", points=[[0, 0, 0]]),
    contact("other", "'leg'", "ground, *, arm, ball, puck", other="leg"),
    contact("other", "'arm'", "shape", other="arm"),
    contact("static_friction", "0.5", "0.4", friction=0.5, static_friction=0.4),
    contact("stiffness", "rigid", "'soft'", "'penalty'", stiffness=10),
    contact("restitution", "damping", law="soft", damping=1, restitution=0.5),
    force("motor", "stiffness", "'motor'", "spring", "torsion", stiffness=1),
    force("motor", "kp", "'servo'", kp=2),
    force("motor", "torque", "table", "[0, 0, 1]", torque=[0, 0, 1]),
    force("motor", "coordinate", "1", "got 2", coordinate=2),
    force("wrench", "torque", "three", "got 1", torque=1),
    force("wrench", "force", "2 times", "1 value", force={"t": [0, 1], "value": [[0, 0, 1]]}),
    force("spring", "other", "'arm'", "itself", other="arm"),
    force("spring", "ks", "did you mean stiffness", ks=1),
    force("spring", "via", "point 1", "'leg'", "ground, arm, ball, puck", via=[
        {"body": "leg", "point": [0, 0, 0]}]),
    force("spring", "via", "point 1 of via", "point 2 of via", "[1.0, 0.0, 0.0]", "'ball'", via=[
        {"body": "ball", "point": [1, 0, 0]}, {"body": "ball", "point": [1, 0, 0]}]),
    force("spring", "via", "'arm'", "constant", "ground", other="arm", via=[
        {"body": "arm", "point": [1, 0, 0.5]}]),
    force("spring", "via", "point", "missing", "three", via=[{"body": "ball"}]),
    force("spring", "via", "axis", "obstacle", "radius", via=[
        {"body": "ball", "point": [0, 0, 0], "axis": [0, 0, 1]}]),
    force("spring", "via", "radius", "> 0", "-1", via=[
        {"body": "ball", "point": [0, 0, 0], "radius": -1}]),
    force("spring", "via", "axis", "zero", "[0.0, 0.0, 0.0]", via=[
        {"body": "ball", "point": [0, 0, 0], "radius": 1, "axis": [0, 0, 0]}]),
    force("spring", "via", "side", "centre", "[0.0, 0.0, 0.0]", via=[
        {"body": "ball", "point": [0, 0, 0], "radius": 1, "side": [0, 0, 0]}]),
    force("spring", "via", "side", "inner", via=[
        {"body": "ball", "point": [0, 0, 0], "radius": 1, "side": [0, 0, 1], "inner": True}]),
    force("spring", "via", "inner", "obstacle", "radius", via=[
        {"body": "ball", "point": [0, 0, 0], "inner": True}]),
    force("spring", "via", "points 1 and 2", "obstacles", "inner", "between", via=[
        {"body": "ball", "point": [0, 0, 0], "radius": 1, "inner": True},
        {"body": "arm", "point": [0, 0, 0], "radius": 1}]),
    force("spring", "via", "points 1 and 2", "side", "jump", via=[
        {"body": "ball", "point": [0, 0, 0], "radius": 1, "axis": [0, 0, 1]},
        {"body": "arm", "point": [0, 0, 0], "radius": 1}]),
    force("spring", "via", "radii", "> 0", "[1.0, 0.0, 1.0]", via=[
        {"body": "ball", "point": [0, 0, 0], "radii": [1, 0, 1]}]),
    force("spring", "via", "radius", "ellipsoid", "leave", via=[
        {"body": "ball", "point": [0, 0, 0], "radius": 1, "radii": [1, 2, 1]}]),
    force("spring", "via", "rotation", "ellipsoid", "radii", via=[
        {"body": "ball", "point": [0, 0, 0], "radius": 1, "rotation": [1, 0, 0, 0]}]),
    force("spring", "via", "rotation", "zero", via=[
        {"body": "ball", "point": [0, 0, 0], "radii": [1, 2, 1], "rotation": [0, 0, 0, 0]}]),
    force("spring", "high", "via", "Strut", high=2, via=[{"body": "ball", "point": [0, 0, 0]}]),
    force("torsion", "axis", "zero", "[0.0, 0.0, 0.0]", axis=[0, 0, 0]),
    force("motor", "gear", "zero", gear=0),
    force("motor", "torque_low", "torque_limit", "2", torque_low=2, torque_limit=1),
    force("actuator", "start", "lag", "integrates", start=1),
    force("actuator", "state_low", "integrates", state_low=1),
    force("actuator", "lag", "0", lag=1, integrates=True),
    ground("slope", "pi/2", "got 2", slope=2),
    ground("uphill", "up (z)", "[0.0, 0.0, 1.0]", uphill=[0, 0, 1]),
    ground("steps", "height", "missing", steps=[{"low": [0, 0], "high": [1, 1]}]),
    ground("'tilt'", *pg.Ground.model_fields, tilt=1),
    several(
        {"ground": {"friction": 0.6}, "bodies": BODIES,
         "contacts": [{"name": "c", "body": "puck", "static_friction": 0.5}]},
        ("contact 'c', static_friction", "0.6", "0.5", "ground"),
    ),
    model("gravty", "did you mean gravity?", *pg.Model.model_fields, gravty=[0, 0, 0]),
    model("dampers", "did you mean forces?", dampers=[]),
    model("parameters", "'sin'", parameters={"sin": 1.0}),
    several({"bodies": [3]}, ("row 1", "3")),
    scenario("constraints", "'foot'", "no constraint", constraints=["foot"]),
    scenario(("t_end", "> 0", "got 0"), ("q", "'leg'", "arm"), t_end=0, q={"leg": 1}),
    scenario("method", "'rk5'", "auto", "rk4", "moreau_jean", method="rk5"),
    several(
        {"bodies": BODIES, "sites": [{"name": "t", "body": "leg"}],
         "outputs": [
             {"name": "o", "kind": "joint_position", "at": "leg"},
             {"name": "p", "kind": "joint_position", "at": "arm", "coordinate": 1},
             {"name": "q", "kind": "joint_position", "at": "ball"},
             {"name": "r", "kind": "force", "at": "ground"},
         ]},
        ("site 't', body", "'leg'"), ("output 'o', at", "'leg'"),
        ("output 'p', coordinate", "'arm'", "1"), ("output 'q', coordinate", "rotation"),
        ("output 'r', at", "ground"),
    ),
    several(
        {"bodies": BODIES, "constraints": [{"name": "pin", "body": "arm"}],
         "scenarios": [{"name": "s", "constraints": ["pin", "pin"], "switches": [
             {"t": 0.1, "constraint": "pn", "active": True},
             {"t": 0.1, "constraint": "pin", "active": True},
             {"t": 0.1, "constraint": "pin", "active": False},
         ]}]},
        ("scenario 's', constraints", "'pin'", "twice"),
        ("scenario 's', switches", "'pn'", "pin"), ("scenario 's', switches", "'pin'", "0.1 s"),
    ),
    beam("length", "> 0", "got 0", length=0),
    beam("length", "points", "none", length=None),
    beam("length", "both", points=[[1, 0, 0]]),
    beam("points", "root", length=None, points=[[0, 0, 0]]),
    beam("points", "point 2", "point 1", length=None, points=[[1, 0, 0], [1, 0, 0]]),
    beam("points", "turns back", "point 1", length=None, points=[[1, 0, 0], [0, 0, 0]]),
    beam("rotation", "unit quaternion", "[0.0, 0.0, 0.0, 0.0]", rotation=[0, 0, 0, 0]),
    beam("section", "circle, tube, rectangle", "'round'", section=["round", 1]),
    beam("section", "2 sizes", "width", "height", "[1.0]", section=["rectangle", 1]),
    beam("section", "radius", "> 0", "0.0", section=["circle", 0]),
    beam("section", "inner radius", "below", "[1.0, 2.0]", section=["tube", 1, 2]),
    beam("EI", "> 0", "[-1.0]", EI=-1),
    beam("EI", "one or two", "[1.0, 2.0, 3.0]", EI=[1, 2, 3]),
    beam("EI", "'bend_y'", "section", EI=None),
    beam("GJ", "> 0", "got 0", GJ=0),
    beam("EA", "'stretch'", "E", strains=["stretch"]),
    beam("rho_a", "mass", "density", rho_a=None),
    beam("rho_j", "inertia", "GJ", GJ=1),
    beam("section", "material", material="steel"),
    beam(("EI", "section and E", "[1.0]"), ("rho_a", "density", "1"), section=["circle", 1],
         material="steel"),
    beam("nodes", "1 to 500", "'auto'", "got 0", nodes=0),
    beam("nodes", "1 to 500", "501", nodes=501),
    beam("nodes", "1.5", nodes=1.5),
    beam("damping_ratio", "below 1", "1", damping_ratio=1),
    beam("parent", "its own parent", "'rod'", parent="rod"),
    beam("parent", "its own parent", "'rod@0.5'", parent="rod@0.5"),
    beam("parent", "'legs'", "arm", parent="legs"),
    row("beam 'arm'", [("name", "body", "rename")],
        {"bodies": BODIES, "beams": [{"name": "arm", "length": 1, "EI": 1, "rho_a": 1}]}),
    several(
        {"bodies": [{"name": "load", "parent": "rod@1.5"}],
         "beams": [{"name": "rod", "length": 1, "EI": 1, "rho_a": 1}]},
        ("beam 'rod'", "'rod@1.5'", "0", "1", "'rod@0.5'"),
    ),
    # every problem at once: of parts, of the tree, and of a body that has several
    several(
        {
            "up": "w",
            "bodies": [
                {"name": "a", "mass": -1, "inertia": moments(1, 1, 3), "dof": 9},
                {"name": "b", "parent": "b"},
                {"name": "a", "parent": "z", "axes": [[0, 0, 0]]},
            ],
            "constraints": [{"name": "k", "kind": "glue", "body": "y"}],
        },
        ("model, up", "'w'"), ("body 'a', dof", "9"), ("body 'a', mass", "-1"),
        ("body 'a', inertia", "1 + 1 < 3"), ("body 'a', axes", "zero"),
        ("constraint 'k', kind", "'glue'"), ("row 3, name", "'a'", "row 1"),
        ("body 'a', parent", "'z'", "ground, b"), ("body 'b', parent", "'b'"),
        ("constraint 'k', body", "'y'", "a, b"),
    ),
]  # fmt: skip


@pytest.mark.parametrize(("fields", "expected"), ROWS)
def test_models_are_refused_alike_by_python_and_by_file(fields, expected, tmp_path, capsys):
    problems = refusal(lambda: pg.Model(**fields), pg.ModelError).problems
    assert_problems(problems, expected)
    file = tmp_path / "model.json"
    file.write_text(json.dumps(fields))
    assert main(["check", str(file)]) == 1
    out, err = capsys.readouterr()
    assert (out, err.splitlines()) == ("", [str(p) for p in problems])
    refusal(lambda: BASE.replace(**fields))
    assert BASE.to_json() == BEFORE


def bare(kind: Any) -> Any:
    while get_origin(kind) is Annotated:
        kind = get_args(kind)[0]
    return kind


def good(kind: Any) -> Any:
    kind = bare(kind)
    inner = get_args(kind)
    if get_origin(kind) is tuple:
        return [good(x) for x in inner]
    return inner[0] if get_origin(kind) is Literal else 1.0


WRONG: dict[Any, tuple[Any, ...]] = {
    float: (NAN, INF, -INF, "2", True, 1j, b"x", [1.0], {"zz": 1}),
    int: (NAN, -1, 7, 1.5, "2", True, b"1", [1]),
    bool: ("true", 1, 0.0, [], {"zz": 1}),
    str: (3, NAN, True, ["a"], {"zz": 1}),
}


def wrong(kind: Any) -> Iterator[tuple[Any, Any]]:
    """Values that are not of a type, each with its innermost wrong part."""
    kind = bare(kind)
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        some = [bare(x) for x in inner if x is not type(None)]
        refused = [{repr(value) for value, _ in wrong(x)} for x in some]
        yield from (
            (value, leaf)
            for value, leaf in wrong(some[0])
            if all(repr(value) in each for each in refused)
        )
    elif kind in WRONG:
        yield from ((x, x) for x in WRONG[kind])
    elif origin is Literal:
        yield from ((x, x) for x in ("zz", 3, "", ["zz"]))
    elif origin is tuple and inner[1:] == (...,):
        yield from ((x, x) for x in ("w", 1j))
        yield from (([x], leaf) for x, leaf in wrong(inner[0]))
    elif origin is tuple:
        whole = [good(x) for x in inner]
        yield from ((x, x) for x in ("w", 1j, 3.0, whole[1:], [*whole, whole[0]]))
        yield from (([x, *whole[1:]], leaf) for x, leaf in wrong(inner[0]) if x != -INF)
    elif origin is dict:
        yield from ((x, x) for x in (3, "zz", [1]))
        yield from (({"2": x}, leaf) for x, leaf in wrong(inner[1]))
    elif isinstance(kind, type) and issubclass(kind, BaseModel):
        yield from ((x, x) for x in (3, "zz", [1]))
        yield {"zz": 1}, "zz"


PROMISES = {  # what a description says, and numbers that it forbids
    r">= 0": (-1,),
    r"> 0": (-1, 0),
    r"above 0": (-1, 0),
    r"from 0 to 1\b": (-0.1, 1.5),
    r"from 0 to below 1\b": (-0.1, 1),
    r"at most 1\b": (1.5,),
    r"at most 0\.5": (0.6,),
}


def forbidden(info: Any) -> Iterator[tuple[Any, Any]]:
    also: tuple[float, ...] = (3.0,) if "or one for" in (info.description or "") else ()
    if said := re.search(r"whole number from (\d+) to (\d+)", info.description or ""):
        also += tuple(x for x in WRONG[int] if type(x) is int and int(said[1]) <= x <= int(said[2]))
    yield from ((value, leaf) for value, leaf in wrong(info.annotation) if value not in also)
    for promise, numbers in PROMISES.items():
        if re.search(promise, (info.description or "").split(";")[0]):
            yield from ((x, x) for x in numbers)


def refusing(call: Any, given: str) -> tuple[pg.Problem, ...]:
    try:
        call()
    except pg.ModelError as error:
        return error.problems
    raise AssertionError(f"accepted: {given}")


@pytest.mark.parametrize("cls", WHOLE, ids=lambda cls: cls.__name__)
def test_every_field_refuses_values_of_the_wrong_type_and_size(cls):
    """The error names the field and shows the value, or what in it is wrong."""
    for field, info in cls.model_fields.items():
        for value, leaf in forbidden(info):
            given = f"{cls.__name__}({field}={value!r})"
            problems = refusing(lambda f=field, v=value: cls(**{**WHOLE[cls], f: v}), given)
            whole = [p for p in problems if p.field == field]
            if not whole:  # a list of parts: they are told by their number or name
                assert field in ("bodies", "gait", "forces") or cls is pg.Model, given
                whole = problems
            texts = [str(p) for p in whole]
            facts = (shown(value), shown(leaf), "missing", "'zz'", "zz: ")
            assert any(fact in text for fact in facts for text in texts), (given, texts)
            if get_origin(bare(info.annotation)) is Literal and field != "kind":
                assert_names(texts[0], *get_args(bare(info.annotation)))  # the choices
            assert not any("\n" in text for text in texts), given


FILES: list[tuple[bytes, str, *tuple[str, ...]]] = [  # content, place in the file, facts
    (b"", "line 1", "JSON", "column 1"),
    (b'{\n  "name": "a",\n  "bodies": [}\n', "line 3", "JSON", "column 14"),
    (b"[]", "", "JSON object", "[]"),
    (b'{"schema_version": 99, "later": 1}', "schema_version", "99", "9"),
    (b'{"schema_version": "1"}', "schema_version", "'1'", ">= 1"),
    (b'{"bodies": [{"name": "a", "mass": 1, "mass": 2}]}', "", "'mass'", "twice", "'a'"),
    (b'{"bodies": [{"mass": 1, "mass": 2}]}', "", "'mass'", "twice"),
    (b"\x89PNG\r\n\x1a\n\x00", "", "UTF-8", "byte 0"),
    (b'{"name": "\xff"}', "", "UTF-8", "byte 10"),
    (b"[" * 200_000, "", "100 levels"),
]


@pytest.mark.parametrize("content", FILES, ids=range(len(FILES)))
def test_a_file_that_is_no_model_is_named_with_the_place(content, tmp_path, capsys):
    text, place, *facts = content
    file = tmp_path / "model.json"
    file.write_bytes(text)
    error = refusal(lambda: pg.Model.load(file), pg.FileError)
    head, _, said = str(error).removeprefix(str(file)).partition(": ")
    assert head.removeprefix(", ") == place
    assert_names(said, *facts)
    assert main(["check", str(file), "--json"]) == 1
    out, err = capsys.readouterr()
    assert err == f"{error}\n"
    assert [set(p) for p in json.loads(out)["problems"]] == [{"where", "field", "text"}]


@pytest.mark.parametrize(("number", "given"), [("NaN", "nan"), ("1e999", "inf")])
def test_numbers_that_json_has_not_are_refused_by_their_field(number, given):
    text = f'{{"bodies": [{{"name": "a", "mass": {number}}}]}}'
    problems = refusal(lambda: pg.Model.from_json(text), pg.ModelError).problems
    assert_problems(problems, [("body 'a', mass", f"got {given}")])
