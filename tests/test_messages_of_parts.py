"""What bad constraints, contacts, forces and grounds are answered with, word for word.

Each row goes in twice: through Python, and through a file and `pgraph check`.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import pgraph_core as pg
from pgraph_app.cli import main

pytestmark = pytest.mark.fast

BODIES = [
    {"name": "arm"},
    {"name": "ball", "joint": "spherical"},
    {"name": "puck", "joint": "free", "shape": {"kind": "sphere", "radius": 0.1}},
]

# (the fields of a constraint beside its name, what is said after "constraint 'c'")
CONSTRAINTS: list[tuple[dict[str, Any], list[str]]] = [
    (
        {"body": "arm", "kind": "point", "length": 1},
        ["length: means nothing to kind 'point'; it belongs to kind distance"],
    ),
    (
        {"body": "arm", "kind": "revolute", "axis": [0, 0, 0]},
        ["axis: a direction must not be zero; given [0.0, 0.0, 0.0]"],
    ),
    (
        {"body": "arm", "kind": "distance"},
        [("other_point: is missing; give three finite numbers in the axes of `other` [m]")],
    ),
    (
        {"body": "arm", "kind": "distance", "other_point": [0, 0, 1], "length": 0},
        ["length: must be a length > 0 [m]; left out: as in the initial state; given 0"],
    ),
    (
        {"body": "arm", "kind": "line"},
        [
            (
                "other_axis: a line constraint takes one direction along the line: other_axis "
                "in the axes of `other`, or axis as `body` has it at first"
            )
        ],
    ),
    (
        {"body": "arm", "kind": "plane", "axis": [0, 0, 1], "other_axis": [0, 0, 1]},
        [
            (
                "other_axis: a plane constraint takes one direction normal to the plane: "
                "other_axis in the axes of `other`, or axis as `body` has it at first"
            )
        ],
    ),
    (
        {"body": "arm", "kind": "universal", "axis": [0, 0, 1]},
        ["other_axis: a universal constraint takes both axis and other_axis, or none"],
    ),
    (
        {"body": "arm", "kind": "orientation", "point": [0, 0, 1]},
        ["point: means nothing to kind 'orientation'; leave it out"],
    ),
    (
        {"body": "arm", "kind": "gear"},
        ["other: a gear needs a second body, whose joint it follows; given 'ground'"],
    ),
    (
        {"body": "arm", "kind": "gear", "other": "ball"},
        [
            (
                "other_coordinate: needs a rotate or translate motion; a ball or free one has "
                "no single angle; use kind 'orientation' or 'velocity'"
            )
        ],
    ),
    (
        {"body": "arm", "kind": "gear", "other": "puck", "coordinate": 1, "ratio": 0},
        [
            "ratio: must not be zero; use kind 'motion' to hold a joint; given 0",
            "coordinate: the joint of 'arm' has 1 degrees of freedom; given 1",
            (
                "other_coordinate: needs a rotate or translate motion; a ball or free one has "
                "no single angle; use kind 'orientation' or 'velocity'"
            ),
        ],
    ),
    (
        {"body": "arm", "kind": "motion"},
        [
            (
                "q_of_t: is missing; give a table over time, or {'kind': 'sine' or "
                "'polynomial', ...} [rad, m]"
            )
        ],
    ),
    (
        {"body": "arm", "kind": "motion", "other": "ball", "q_of_t": {"t": [0], "value": [1]}},
        ["other: means nothing to kind 'motion'; leave it out; given 'ball'"],
    ),
    (
        {"body": "arm", "kind": "motion", "q_of_t": {"kind": "cosine"}},
        [
            (
                "q_of_t: must be a table over time, or {'kind': 'sine' or 'polynomial', ...} "
                "[rad, m]; given {'kind': 'cosine'}"
            )
        ],
    ),
    (
        {"body": "arm", "kind": "motion", "q_of_t": {"kind": "sine", "amplitude": "x"}},
        ["q_of_t: amplitude must be a finite number [rad, m]; given 'x'"],
    ),
    (
        {"body": "arm", "kind": "motion", "q_of_t": {"t": [0, 0], "value": [1, 1]}},
        ["q_of_t: the times t must ascend; given [0.0, 0.0]"],
    ),
    (
        {
            "body": "arm",
            "kind": "motion",
            "q_of_t": {"kind": "polynomial", "coefficients": [1, 2, 3, 4, 5]},
        },
        [
            (
                "q_of_t: coefficients must be one to four finite numbers, that of t^0 first; "
                "given [1, 2, 3, 4, 5]"
            )
        ],
    ),
    (
        {"body": "ball", "kind": "motion", "q_of_t": {"kind": "sine"}},
        [
            (
                "coordinate: needs a rotate or translate motion; a ball or free one has no "
                "single angle; use kind 'orientation' or 'velocity'"
            )
        ],
    ),
    (
        {"body": "arm", "kind": "motion", "coordinate": 3, "q_of_t": {"kind": "sine"}},
        ["coordinate: the joint of 'arm' has 1 degrees of freedom; given 3"],
    ),
    (
        {"body": "arm", "kind": "rolling"},
        [
            (
                "radius: a rolling sphere needs its radius: 'arm' has no sphere as its shape; "
                "give a radius > 0 [m]"
            )
        ],
    ),
    (
        {"body": "arm", "kind": "rolling", "axis": [0, 0, 1], "radius": -1},
        [
            "radius: must be a radius > 0 [m]; left out: that of the body's shape; given -1",
            (
                "radius: a rolling disc needs its radius: 'arm' has no cylinder as its shape; "
                "give a radius > 0 [m]"
            ),
        ],
    ),
    (
        {"body": "arm", "kind": "skate"},
        [("axis: is missing; give a direction [x, y, z] that is not zero, in the axes of `body`")],
    ),
    (
        {"kind": "velocity", "value": 1},
        [
            "coefficients: is missing; give body name -> numbers, one a degree of freedom of its "
            "joint"
        ],
    ),
    (
        {"kind": "velocity", "coefficients": {"arm": [1, 2], "leg": 1, "ball": [0, 0, 1]}},
        [
            "coefficients: the joint of 'arm' takes 1 number; given 2",
            "coefficients: no body is named 'leg'; choose one of arm, ball, puck",
        ],
    ),
    (
        {"kind": "velocity", "coefficients": {"arm": 0}},
        [
            "coefficients: at least one must differ from zero",
        ],
    ),
    (
        {"kind": "velocity", "coefficients": {"arm": 1}, "other": "ball"},
        ["other: means nothing to kind 'velocity'; leave it out; given 'ball'"],
    ),
    (
        {"body": "arm", "kind": "weld", "ratio": 2},
        ["ratio: means nothing to kind 'weld'; it belongs to kind gear"],
    ),
]
# (the fields of a contact beside its name, what is said after "contact 't'")
CONTACTS: list[tuple[dict[str, Any], list[str]]] = [
    ({"body": "arm"}, ["body: 'arm' has no shape to touch with; give it a shape, or points"]),
    (
        {"body": "*", "points": [[0, 0, 0]]},
        ["points: belong to one body; name it instead of '*' (every body)"],
    ),
    (
        {"body": "puck", "other": "puck"},
        ["other: a body cannot be in contact with itself; given 'puck' twice"],
    ),
    (
        {"body": "puck", "other": "leg"},
        ["other: no body is named 'leg'; choose one of ground, *, arm, ball, puck"],
    ),
    (
        {"body": "puck", "other": "arm"},
        ["other: 'arm' has no shape to touch with; give it a shape"],
    ),
    (
        {"body": "puck", "law": "hard"},
        ["law: must be one of soft, penalty, complementarity; given 'hard'"],
    ),
    (
        {"body": "puck", "friction": -1},
        [("friction: must be Coulomb's coefficient >= 0; left out: that of the ground; given -1")],
    ),
    (
        {"body": "puck", "restitution": 1.5},
        [("restitution: must be a number from 0 to 1; left out: that of the ground; given 1.5")],
    ),
    (
        {"body": "puck", "friction": 0.5, "static_friction": 0.4},
        ["static_friction: must be at least the kinetic friction 0.5; given 0.4"],
    ),
    (
        {"body": "puck", "rolling_friction": -1e-3},
        [
            (
                "rolling_friction: must be a length >= 0 [m]: torque against rolling over normal "
                "force; left out: the ground's; given -0.001"
            )
        ],
    ),
    (
        {"body": "puck", "stiffness": 10},
        ["stiffness: means nothing to a rigid contact; use law 'soft' or 'penalty'"],
    ),
    (
        {"body": "puck", "law": "soft", "damping": 1, "restitution": 0.5},
        [("restitution: damping says how much of the velocity comes back; give one of the two")],
    ),
]
# (the fields of a force beside its name, what is said after "force 'f'")
FORCES: list[tuple[dict[str, Any], list[str]]] = [
    (
        {"body": "arm", "kind": "pull"},
        [
            "kind: must be one of motor, servo, speed_servo, actuator, tendon, wrench, spring, "
            "torsion, drag; given 'pull'"
        ],
    ),
    (
        {"body": "arm", "kind": "motor", "stiffness": 1},
        [
            "stiffness: means nothing to kind 'motor'; it belongs to kind tendon or spring or "
            "torsion"
        ],
    ),
    (
        {"body": "arm", "kind": "motor", "torque": [0, 0, 1]},
        [("torque: must be a number or a table over time [N m, N]; given [0, 0, 1]")],
    ),
    (
        {"body": "arm", "kind": "wrench", "torque": 1},
        [
            (
                "torque: must be three finite numbers [x, y, z] or a table of them over time "
                "[N m]; given 1"
            )
        ],
    ),
    (
        {"body": "arm", "kind": "wrench", "kp": 1},
        ["kp: means nothing to kind 'wrench'; it belongs to kind servo or actuator"],
    ),
    (
        {"body": "arm", "kind": "wrench", "force": [0, 0]},
        [
            (
                "force: must be three finite numbers [x, y, z] or a table of them over time "
                "[N]; given [0, 0]"
            )
        ],
    ),
    (
        {"body": "arm", "kind": "wrench", "force": {"t": [0, 1], "value": [[0, 0, 1]]}},
        ["force: needs one value a time, at least one; given 2 times, 1 values"],
    ),
    (
        {"body": "arm", "kind": "wrench", "frame": "tip"},
        ["frame: must be 'world' or 'body': the axes of torque and force; given 'tip'"],
    ),
    (
        {"body": "arm", "kind": "spring", "other": "arm"},
        ["other: a body cannot be tied to itself; given 'arm' twice"],
    ),
    (
        {"body": "arm", "kind": "spring", "other": "leg", "rest": -1},
        [
            "rest: must be a length >= 0 without force [m]; left out: as in the initial state; "
            "given -1",
            "other: no body is named 'leg'; choose one of ground, arm, ball, puck",
        ],
    ),
    (
        {"body": "arm", "kind": "torsion", "axis": [0, 0, 0], "damping": -1},
        [
            "damping: must be a number >= 0 [N m s/rad]; given -1",
            "axis: a direction must not be zero; given [0.0, 0.0, 0.0]",
        ],
    ),
]
# (the fields of a model, what is said)
MODELS: list[tuple[dict[str, Any], list[str]]] = [
    (
        {"ground": {"slope": 2}},
        [
            (
                "model, ground: slope must be an angle within -pi/2 to pi/2 by which it rises "
                "[rad]; given 2"
            )
        ],
    ),
    (
        {"ground": {"friction": -1}},
        [
            (
                "model, ground: friction must be Coulomb's coefficient >= 0 of contacts that "
                "give none; given -1"
            )
        ],
    ),
    (
        {"ground": {"uphill": [0, 0, 1]}},
        [
            (
                "model, ground: uphill must have a part that is not along up (z); given [0.0, "
                "0.0, 1.0]"
            )
        ],
    ),
    (
        {"ground": {"steps": [{"low": [0, 0], "high": [0, 1], "height": 1}]}},
        [
            (
                "model, ground: a step's low must be less than its high; given [0.0, 0.0] and "
                "[0.0, 1.0]"
            )
        ],
    ),
    (
        {"ground": {"steps": [{"low": [0, 0], "high": [1, 1]}]}},
        [
            (
                "model, ground: steps: height is missing; give a finite number: how far it "
                "lies above the plane [m]"
            )
        ],
    ),
    (
        {"ground": {"tilt": 1}},
        [
            (
                "model, ground: has no field 'tilt'; choose from slope, uphill, friction, "
                "static_friction, rolling_friction, spinning_friction, restitution, steps"
            )
        ],
    ),
    (
        {"ground": {"friction": 0.6, "static_friction": 0.5}},
        [("model, ground: static_friction must be at least the kinetic friction 0.6; given 0.5")],
    ),
    (
        {
            "ground": {"friction": 0.6},
            "bodies": [{"name": "b", "shape": {"kind": "sphere", "radius": 1}}],
            "contacts": [{"name": "c", "body": "b", "static_friction": 0.5}],
        },
        [
            (
                "contact 'c', static_friction: must be at least the kinetic friction 0.6; "
                "given 0.5, and the friction is the ground's; give friction as well"
            )
        ],
    ),
    (
        {"bodies": [{"name": "arm"}], "scenarios": [{"name": "s", "method": "rk5"}]},
        [
            (
                "scenario 's', method: no method is called 'rk5'; choose one of auto, rk4, "
                "semi_implicit_euler, dopri5, dop853, gauss6, ros2, generalised_alpha, radau5, "
                "moreau_jean"
            )
        ],
    ),
    (
        {
            "bodies": [
                {"name": "puck", "joint": "free", "shape": {"kind": "sphere", "radius": 0.1}}
            ],
            "contacts": [{"name": "t", "body": "puck"}],
            "scenarios": [{"name": "s", "contacts": ["u"]}],
        },
        ["scenario 's', contacts: no contact is named 'u'; choose one of t"],
    ),
    (
        {"bodies": [{"name": "*"}]},
        ["body '*', name: '*' stands for every body in contacts; choose another"],
    ),
]


def in_model(field: str, name: str, rows: list[tuple[dict[str, Any], list[str]]]) -> list[Any]:
    """The rows as models with one part each, and whole sentences."""
    where = f"{field[:-1]} '{name}'"
    return [
        (
            {"bodies": BODIES, field: [{"name": name, **part}]},
            [f"{where}, {sentence}" for sentence in sentences],
        )
        for part, sentences in rows
    ]


EVERY = [
    *in_model("constraints", "c", CONSTRAINTS),
    *in_model("contacts", "t", CONTACTS),
    *in_model("forces", "f", FORCES),
    *MODELS,
]


@pytest.mark.parametrize(("fields", "sentences"), EVERY)
def test_sentence_through_python_and_a_file(
    fields: dict[str, Any], sentences: list[str], tmp_path: Path, capsys: pytest.CaptureFixture
):
    with pytest.raises(pg.ModelError) as refused:
        pg.Model(**fields)
    assert [str(p) for p in refused.value.problems] == sentences
    file = tmp_path / "model.json"
    file.write_text(json.dumps(fields))
    assert main(["check", str(file)]) == 1
    out, err = capsys.readouterr()
    assert (out, err.splitlines()) == ("", sentences)
