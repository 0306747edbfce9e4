"""What bad input is answered with, word for word: which part, which field, what, and what would do.

Each row goes in twice: through Python, and through a file and `pgraph check`.
"""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.cli import main

pytestmark = pytest.mark.fast

FIELDS = (
    "name, parent, joint, axes, motions, link, rotation, mass, com, inertia, tip, q, v, "
    "stiffness, damping, rest, friction, armature, limits, limit_restitution, shape, "
    "shapes, density, derived, any_inertia"
)
KINDS = "weld, revolute, prismatic, cylindrical, universal, spherical, planar, free, compound"
CONSTRAINTS = (
    "point, weld, revolute, prismatic, cylindrical, universal, distance, line, plane, "
    "orientation, gear, motion, rolling, skate, velocity, coupling"
)
TORQUE = "a number or a table over time [N m, N]"
MASS = "must be a finite number >= 0 [kg]"
INERTIA = "must be a symmetric 3x3 matrix of finite numbers about the centre of mass [kg m^2]"


def diag(*moments: float) -> list[list[float]]:
    return np.diag(moments).tolist()


# (the fields of a body, the sentence)
BODIES: list[tuple[dict[str, Any], str]] = [
    # names
    ({"name": ""}, "row 1, name: must be text that is not empty; given ''"),
    ({"name": "  "}, "row 1, name: must be text that is not empty; given '  '"),
    ({"name": 3}, "row 1, name: must be text that is not empty; given 3"),
    ({"name": None}, "row 1, name: must be text that is not empty; given None"),
    ({}, "row 1, name: is missing; give text that is not empty"),
    ({"name": " a"}, "body ' a', name: must not start or end with a space; given ' a'"),
    (
        {"name": "a\nb"},
        r"body 'a\nb', name: must be text on one line, without control characters; given 'a\nb'",
    ),
    (
        {"name": "ground"},
        "body 'ground', name: 'ground' is the name of the ground; choose another",
    ),
    # parents
    (
        {"name": "a", "parent": "tigh"},
        "body 'a', parent: no body is named 'tigh'; choose one of ground",
    ),
    (
        {"name": "a", "parent": "a"},
        "body 'a', parent: a body cannot be its own parent; given 'a'; choose another, or ground",
    ),
    (
        {"name": "a", "parent": 2},
        "body 'a', parent: must be the name of a body, or 'ground'; given 2",
    ),
    # dof and joint
    ({"name": "a", "dof": 7}, "body 'a', dof: must be a whole number from 0 to 6; given 7"),
    ({"name": "a", "dof": -1}, "body 'a', dof: must be a whole number from 0 to 6; given -1"),
    ({"name": "a", "dof": 1.5}, "body 'a', dof: must be a whole number from 0 to 6; given 1.5"),
    ({"name": "a", "dof": "2"}, "body 'a', dof: must be a whole number from 0 to 6; given '2'"),
    ({"name": "a", "dof": True}, "body 'a', dof: must be a whole number from 0 to 6; given True"),
    (
        {"name": "a", "dof": 2, "joint": "spherical"},
        "body 'a', dof: 2 disagrees with joint 'spherical'; give one of the two",
    ),
    (
        {"name": "a", "joint": "hinge"},
        f"body 'a', joint: must be one of {KINDS}, or give dof 0 to 6; given 'hinge'; "
        "did you mean revolute?",
    ),
    # mass
    ({"name": "a", "mass": -1}, f"body 'a', mass: {MASS}; given -1"),
    ({"name": "a", "mass": math.nan}, f"body 'a', mass: {MASS}; given nan"),
    ({"name": "a", "mass": math.inf}, f"body 'a', mass: {MASS}; given inf"),
    ({"name": "a", "mass": "2"}, f"body 'a', mass: {MASS}; given '2'"),
    ({"name": "a", "mass": True}, f"body 'a', mass: {MASS}; given True"),
    # inertia
    (
        {"name": "a", "inertia": diag(-1, 1, 1)},
        "body 'a', inertia: must be positive semidefinite; "
        "its smallest principal moment is -1 kg m^2",
    ),
    (
        {"name": "a", "inertia": [[1, 2, 0], [2, 1, 0], [0, 0, 1]]},
        "body 'a', inertia: must be positive semidefinite; "
        "its smallest principal moment is -1 kg m^2",
    ),
    (
        {"name": "a", "inertia": diag(1, 1, 3)},
        "body 'a', inertia: breaks the triangle inequality: "
        "principal moments 1 + 1 < 3 by 1 kg m^2; no rigid body has it",
    ),
    (
        {"name": "a", "inertia": [[1, 2, 0], [0, 1, 0], [0, 0, 1]]},
        "body 'a', inertia: must be symmetric; "
        "given [[1.0, 2.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]",
    ),
    ({"name": "a", "inertia": diag(math.nan, 1, 1)}, f"body 'a', inertia: {INERTIA}; given nan"),
    ({"name": "a", "inertia": 1}, f"body 'a', inertia: {INERTIA}; given 1"),
    # axes
    (
        {"name": "a", "axes": [[0, 0, 0]]},
        "body 'a', axes: a direction must not be zero; given [0.0, 0.0, 0.0]",
    ),
    (
        {"name": "a", "axes": [[0, 1]]},
        "body 'a', axes: a revolute joint takes one axis [x, y, z]; given [[0, 1]]",
    ),
    (
        {"name": "a", "axes": [[0, math.inf, 1]]},
        "body 'a', axes: a revolute joint takes one axis [x, y, z]; given [[0, inf, 1]]",
    ),
    (
        {"name": "a", "joint": "universal", "axes": [[1, 0, 0], [2, 0, 0]]},
        "body 'a', axes: two successive directions are parallel; "
        "given [1.0, 0.0, 0.0] and [2.0, 0.0, 0.0]; turn one of them",
    ),
    # the initial state
    ({"name": "a", "q": [1, 2]}, "body 'a', q: a revolute joint has 1 number; given 2"),
    (
        {"name": "a", "dof": 3, "q": [0, 0, 0, 0]},
        "body 'a', q: needs a unit quaternion [w, x, y, z]; given [0.0, 0.0, 0.0, 0.0]",
    ),
    (
        {"name": "a", "v": math.nan},
        "body 'a', v: must be one finite number a degree of freedom [rad/s, m/s]; given nan",
    ),
    # other fields
    (
        {"name": "a", "masss": 2},
        f"body 'a', masss: no such field; did you mean mass? choose from {FIELDS}",
    ),
    (
        {"name": "a", "link": [1, 2]},
        "body 'a', link: must be three finite numbers [x, y, z] from the parent's origin [m]; "
        "given [1, 2]",
    ),
    (
        {"name": "a", "stiffness": -3},
        "body 'a', stiffness: must be >= 0; given [-3.0]",
    ),
    (
        {"name": "a", "joint": "weld", "damping": 1},
        "body 'a', damping: a weld has no motion; given [1.0]",
    ),
    (
        {"name": "a", "shape": {"kind": "ball"}},
        "body 'a', shape: kind must be one of box, sphere, ellipsoid, cylinder, capsule, mesh, "
        "heightfield; given 'ball'; did you mean sphere?",
    ),
    ({"name": "a", "shape": {"kind": "sphere"}}, "body 'a', shape: a sphere needs radius"),
    (
        {"name": "a", "shape": {"kind": "box", "size": [1, 0, 1]}},
        "body 'a', shape: a box's edges must be > 0 [m]; given [1.0, 0.0, 1.0]",
    ),
]

ARM = {"name": "arm"}

# (the fields of a model, its sentences)
MODELS: list[tuple[dict[str, Any], list[str]]] = [
    (
        {"bodies": [ARM, ARM]},
        ["row 2, name: 'arm' is already the name of row 1; choose another"],
    ),
    (
        {
            "bodies": [
                {"name": "a", "parent": "c"},
                {"name": "b", "parent": "a"},
                {"name": "c", "parent": "b"},
            ]
        },
        ["body 'a', parent: closes a cycle: a -> c -> b -> a; tie one of them to the ground"],
    ),
    ({"bodies": 3}, ["model, bodies: must be a list; given 3"]),
    ({"bodies": [3]}, ["row 1: must be an object with fields; given 3"]),
    ({"up": "w"}, ["model, up: must be 'x', 'y' or 'z'; given 'w'"]),
    (
        {"gravity": [0, math.nan, 0]},
        ["model, gravity: must be three finite numbers [x, y, z] [m/s^2]; given nan"],
    ),
    (
        {"gravty": [0, 0, 0]},
        [
            "model, gravty: no such field; did you mean gravity? choose from name, up, gravity, "
            "ground, parameters, bodies, constraints, contacts, forces, scenarios, sites, outputs, "
            "formulas"
        ],
    ),
    (
        {"bodies": [ARM], "constraints": [{"name": "foot", "body": "leg"}]},
        ["constraint 'foot', body: no body is named 'leg'; choose one of arm"],
    ),
    (
        {"bodies": [ARM], "constraints": [{"name": "foot", "body": "arm", "other": "arm"}]},
        ["constraint 'foot', other: a body cannot be constrained to itself; given 'arm' twice"],
    ),
    (
        {"bodies": [ARM], "forces": [{"name": "m", "body": "arm", "coordinate": 2}]},
        ["force 'm', coordinate: the joint of 'arm' has 1 degrees of freedom; given 2"],
    ),
    (
        {"bodies": [ARM], "forces": [{"name": "m", "body": "arm", "torque": math.inf}]},
        [f"force 'm', torque: must be {TORQUE}; given inf"],
    ),
    (
        {
            "bodies": [ARM],
            "forces": [{"name": "m", "body": "arm", "torque": {"t": [0, 0], "value": [1, 1]}}],
        },
        ["force 'm', torque: the times t must ascend; given [0.0, 0.0]"],
    ),
    (
        {"bodies": [ARM], "scenarios": [{"name": "s", "constraints": ["foot"]}]},
        ["scenario 's', constraints: no constraint is named 'foot'; the model has no constraint"],
    ),
    (
        {"bodies": [ARM], "scenarios": [{"name": "s", "t_end": 0, "q": {"leg": 1}}]},
        [
            "scenario 's', t_end: must be a duration > 0 [s]; given 0",
            "scenario 's', q: no body is named 'leg'; choose one of arm",
        ],
    ),
    (  # every problem at once, of parts, of the tree, and of a body that has several
        {
            "up": "w",
            "bodies": [
                {"name": "a", "mass": -1, "inertia": diag(1, 1, 3), "dof": 9},
                {"name": "b", "parent": "b"},
                {"name": "a", "parent": "z", "axes": [[0, 0, 0]]},
            ],
            "constraints": [{"name": "k", "kind": "glue", "body": "y"}],
        },
        [
            "model, up: must be 'x', 'y' or 'z'; given 'w'",
            "body 'a', dof: must be a whole number from 0 to 6; given 9",
            f"body 'a', mass: {MASS}; given -1",
            "body 'a', inertia: breaks the triangle inequality: "
            "principal moments 1 + 1 < 3 by 1 kg m^2; no rigid body has it",
            "body 'a', axes: a direction must not be zero; given [0.0, 0.0, 0.0]",
            f"constraint 'k', kind: must be one of {CONSTRAINTS}; given 'glue'",
            "row 3, name: 'a' is already the name of row 1; choose another",
            "body 'a', parent: no body is named 'z'; choose one of ground, b",
            "body 'b', parent: a body cannot be its own parent; given 'b'; "
            "choose another, or ground",
            "constraint 'k', body: no body is named 'y'; choose one of a, b",
        ],
    ),
]

EVERY = [({"bodies": [body]}, [sentence]) for body, sentence in BODIES] + MODELS


@pytest.mark.parametrize(("fields", "sentences"), EVERY)
def test_sentence_through_python(fields: dict[str, Any], sentences: list[str]):
    with pytest.raises(pg.ModelError) as refused:
        pg.Model(**fields)
    assert str(refused.value).split("\n") == sentences
    assert [str(p) for p in refused.value.problems] == sentences


@pytest.mark.parametrize(("fields", "sentences"), EVERY)
def test_sentence_through_a_file(fields: dict[str, Any], sentences: list[str], tmp_path, capsys):
    file = tmp_path / "model.json"
    file.write_text(json.dumps(fields))
    assert main(["check", str(file)]) == 1
    out, err = capsys.readouterr()
    assert (out, err.splitlines()) == ("", sentences)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"name": "2"}, "body '1', name: '2' is already the name of row 2; choose another"),
        ({"name": ""}, "body '1', name: must be text that is not empty; given ''"),
        ({"mass": -2}, f"body '1', mass: {MASS}; given -2"),
        ({"parent": "9"}, "body '1', parent: no body is named '9'; choose one of ground, 2, 3"),
        (
            {"parent": "3"},
            "body '1', parent: closes a cycle: 1 -> 3 -> 2 -> 1; tie one of them to the ground",
        ),
        ({"dof": 9}, "body '1', dof: must be a whole number from 0 to 6; given 9"),
        (
            {"masss": 1},
            f"body '1', masss: no such field; did you mean mass? choose from {FIELDS}, dof",
        ),
    ],
)
def test_sentence_of_a_refused_edit(change: dict[str, Any], sentence: str):
    with pytest.raises(pg.ModelError) as refused:
        pg.Model.serial(3).edit("1", **change)
    assert str(refused.value) == sentence


def test_sentences_of_names_that_are_not_there():
    model = pg.Model.serial(2)
    known = "no body has this name; choose one of 1, 2"
    for call in (model.body, model.edit, model.remove):
        with pytest.raises(pg.ModelError) as refused:
            call("9")
        assert str(refused.value) == f"body '9': {known}"
    with pytest.raises(pg.ModelError) as refused:
        model.scenario("swing")
    assert str(refused.value) == "scenario 'swing': is not there; the model has no scenario"


# (the bytes of a file, the sentence after its path)
FILES: list[tuple[bytes, str]] = [
    (b"", ", line 1: not JSON: Expecting value at column 1; give a model file of Pgraph"),
    (b"a,b\n1,2\n", ", line 1: not JSON: Expecting value at column 1; give a model file of Pgraph"),
    (
        b'{\n  "name": "a",\n  "bodies": [}\n',
        ", line 3: not JSON: Expecting value at column 14; give a model file of Pgraph",
    ),
    (b"[]", ": must hold a JSON object with the fields of a model; given []"),
    (b"3", ": must hold a JSON object with the fields of a model; given 3"),
    (
        b'{"schema_version": 4}',
        ", schema_version: is 4, newer than 3, the newest known; update Pgraph",
    ),
    (
        b'{"schema_version": 99, "later": 1}',
        ", schema_version: is 99, newer than 3, the newest known; update Pgraph",
    ),
    (b'{"schema_version": "1"}', ", schema_version: must be a whole number >= 1; given '1'"),
    (b'{"schema_version": 0}', ", schema_version: must be a whole number >= 1; given 0"),
    (
        b'{"bodies": [{"name": "a", "mass": 1, "mass": 2}]}',
        ": field 'mass' is given twice in one object named 'a'; keep one of them",
    ),
    (b"\x89PNG\r\n\x1a\n\x00", ": not text in UTF-8 (byte 0); give a model file of Pgraph"),
    (b'{"name": "\xff"}', ": not text in UTF-8 (byte 10); give a model file of Pgraph"),
    (b"[" * 200_000, ": no model: its brackets nest too deeply; 100 levels at most"),
]


@pytest.mark.parametrize(("content", "sentence"), FILES, ids=range(len(FILES)))
def test_sentence_of_a_bad_file(content: bytes, sentence: str, tmp_path: Path, capsys):
    file = tmp_path / "model.json"
    file.write_bytes(content)
    with pytest.raises(pg.FileError) as refused:
        pg.Model.load(file)
    assert str(refused.value) == f"{file}{sentence}"
    assert main(["check", str(file), "--json"]) == 1
    out, err = capsys.readouterr()
    assert err == f"{file}{sentence}\n"
    assert [set(p) for p in json.loads(out)["problems"]] == [{"where", "field", "text"}]


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ('{"bodies": [{"name": "a", "mass": NaN}]}', f"body 'a', mass: {MASS}; given nan"),
        ('{"bodies": [{"name": "a", "mass": -Infinity}]}', f"body 'a', mass: {MASS}; given -inf"),
        ('{"bodies": [{"name": "a", "mass": 1e999}]}', f"body 'a', mass: {MASS}; given inf"),
        (
            '{"bodies": [{"name": "a", "mass": 1' + "0" * 5000 + "}]}",
            f"body 'a', mass: {MASS}; given inf",
        ),
    ],
)
def test_numbers_that_json_has_not_are_refused_by_their_field(content: str, sentence: str):
    with pytest.raises(pg.ModelError) as refused:
        pg.Model.from_json(content)
    assert str(refused.value) == sentence


def test_an_attribute_that_nothing_reads_is_refused():
    model = pg.Model.serial(1)
    mech, stepper = pg.Mechanism(model), pg.Stepper(model)
    run, batch = pg.simulate(mech, t_end=0.01), pg.BatchStepper(mech, 2)
    for value, names in {
        mech: ("gravity", "q", "nq", "nonsense"),
        stepper: ("dt", "q", "tau", "status", "gravity"),
        batch: ("q", "step_size", "threads"),
    }.items():
        for name in names:
            with pytest.raises(pg.InputError, match=f"{type(value).__name__}, {name}: ") as found:
                setattr(value, name, 1)
            assert isinstance(found.value, AttributeError)
    with pytest.raises(pg.InputError, match="Result, q: "):
        run.q = run.v

    class Robot(pg.Mechanism):
        def __init__(self, model):
            self.early = 2.0
            super().__init__(model)
            self.gain = 3.0

    assert (Robot(model).early, Robot(model).gain) == (2.0, 3.0)


TWINS = pg.Model(
    bodies=[pg.Body(name="s", axes=(0, 1, 0), com=(0.5, 0, 0), tip=(1, 0, 0))],
    forces=[pg.Spring(name="s", body="s", other_point=(0, 0, 1), stiffness=10.0)],
    contacts=[pg.Contact(name="floor", body="s", points=[(0, 0, 0)])],
)
ROD = pg.Model(bodies=TWINS.bodies)


def test_an_edit_of_one_of_two_with_a_name_says_which_it_was():
    edited = TWINS.edit("s", stiffness=5.0)
    assert edited.body("s").stiffness == (5.0,)
    assert edited.forces == TWINS.forces
    assert 'kind="force"' in edited.notices[0]
    assert TWINS.edit("s", mass=5.0).notices == ()  # a spring has none
    assert TWINS.edit("s", kind="force", stiffness=5.0).notices == ()
    with pytest.raises(pg.ModelError, match='kind="contact"'):
        TWINS.edit("floor", name="s").edit("s", active=False)


@pytest.mark.parametrize(
    ("wrong", "facts"),
    [
        (lambda: setattr(TWINS.bodies[0], "masss", 0), ["did you mean mass"]),
        (lambda: delattr(TWINS, "gravity"), ["gravity"]),
        (lambda: pg.Model(TWINS.bodies), ["bodies=[...]"]),
        (lambda: pg.Body(name="a", inertia=[1, 1, 1]), ["given [1, 1, 1]"]),
        (lambda: pg.Body(name="a", com={1, 2, 3}), ["com", "{1, 2, 3}"]),
        (lambda: pg.Body(name="a", com=("=l", 0, 0)), ["model.edit(name"]),
        (lambda: pg.Contact(name="c", body="a", active="no"), ["true or false"]),
        (lambda: pg.Switch(t=1.0, constraint="c", active="yes"), ["true or false"]),
        (lambda: pg.Mechanism(ROD).inverse_kinematics({"s": (0, 0)}), ["three numbers"]),
        (lambda: pg.home_poses(1), ["home_poses"]),
        (lambda: pg.Stepper(ROD, step=0), ["Stepper, step"]),
        (lambda: pg.Stepper(ROD).switch("x", True), ["there is none"]),
        (lambda: pg.simulate(ROD, t_end=0.1, tau=lambda t, q, v: [0, 0]), ["returned shape (2,)"]),
        (lambda: pg.simulate(ROD, t_end=0.1, events=lambda t, q, v: q[0] > 1), ["crosses zero"]),
        (lambda: ROD.save("model.yaml"), [".json"]),
        (lambda: pg.underfoot(ROD, friction=-1), ["friction"]),
        (lambda: pg.Spring(body="rod"), ["pg.Spring(body='rod'", "name"]),
        (lambda: pg.Body(name="a", slide=(0, 0, 1)), ["joint='prismatic', axes="]),
        (lambda: pg.Body(name="a", axes="-y"), ["write (0, -1, 0)"]),
        (lambda: pg.Body(name="a", mass=None), ["mass", "given None"]),
        (lambda: pg.Body(name="a", com=[[0.25, 0, 0]]), ["given [[0.25, 0, 0]]"]),
        (lambda: pg.Body(name="a", rotation=np.eye(3)), ["as_quat(scalar_first=True)"]),
        (lambda: pg.Model(bodies=[pg.Body(name="a", parent="world")]), ["did you mean ground"]),
        (lambda: ROD.add(pg.Spring), ["pg.Spring(name="]),
        (lambda: ROD.add(pg.Velocity(name="c", body="a", coefficients={"b": [1]})), ["'c'", "'b'"]),
        (lambda: pg.Switch(constraint="c", active=True, when={"above": 1}), ["switch, when"]),
        (lambda: pg.write_urdf(ROD, "u.txt"), [".urdf"]),
        (lambda: pg.simulate(ROD, t_end=0.1, progress=lambda: None), ["progress", "fraction"]),
        (lambda: list(ROD), ["model.bodies"]),
    ],
)  # fmt: skip
def test_what_a_stranger_tried_says_what_to_write(wrong, facts):
    with pytest.raises(pg.PgraphError) as refused:
        wrong()
    for fact in facts:
        assert fact in str(refused.value)


def test_a_refused_joint_hides_what_follows_from_it():
    with pytest.raises(pg.ModelError) as refused:
        pg.Body(name="a", joint="hinge", axes=(0, 1, 0))
    assert [(p.field, "revolute" in p.text) for p in refused.value.problems] == [("joint", True)]


def test_a_model_and_its_mechanism_have_the_names_of_their_parts():
    name, mech = ROD.bodies[0].name, pg.Mechanism(ROD)
    for whole in (ROD, mech):
        assert name in whole
        assert "nobody" not in whole
    assert mech == pg.Mechanism(ROD)
    assert mech != pg.Mechanism(ROD.edit(name, mass=17.0))
    assert len({mech, pg.Mechanism(ROD)}) == 1
    for tried, cure in (("M", "mass_matrix"), ("rnea", "inverse_dynamics"), ("q", "home()")):
        assert not hasattr(mech, tried)
        assert tried not in dir(mech)
        with pytest.raises(AttributeError, match=re.escape(cure)):
            getattr(mech, tried)


def test_a_mesh_that_is_not_there_is_doubted():
    shape = pg.Shape(kind="mesh", file="nowhere.stl")
    assert "nowhere.stl" in " ".join(pg.Model(bodies=[pg.Body(name="a", shape=shape)]).doubts)


def test_a_run_is_saved_as_its_suffix_says_and_does_not_change(tmp_path):
    run = pg.simulate(ROD, t_end=0.1, frames=3)
    run.save(tmp_path / "run.csv")
    assert (tmp_path / "run.csv").read_text() == run.to_csv()
    for name, write in (("run.foo", run.save), ("run.gif", run.to_html)):
        with pytest.raises(pg.FileError, match=name):
            write(tmp_path / name)
    with pytest.raises(ValueError, match="read-only"):
        run.q[0, 0] = 1.0
    with pytest.raises(pg.InputError, match=r"'0\.05'"):
        run.at("0.05")
    with pytest.raises(AttributeError, match=r"run\.show"):
        run.animate  # noqa: B018


def test_degrees_and_gravity_in_millimetres_are_doubted():
    swings = pg.Body(name="a", q=90, limits=(-180, 180))
    found = pg.Model(bodies=[swings], gravity=(0, 0, -9810)).doubts
    for fact, text in zip(("m/s²", "rad"), found, strict=True):
        assert fact in text
    tower = pg.Body(name="a", mass=1e5, com=(0, 0, 200), inertia=1e9 * np.eye(3))
    assert pg.Model(bodies=[tower]).doubts == ()


def test_a_compiled_torque_that_does_not_fit_says_how():
    numba = pytest.importorskip("numba")
    wrong, raises = (
        numba.njit(lambda t, q, v: np.zeros(3)),
        numba.njit(lambda t, q, v: q / int(t * 0)),
    )
    assert "3 torques" in pg.simulate(ROD, t_end=0.1, tau=wrong).message
    assert "raised" in pg.simulate(ROD, t_end=0.1, tau=raises).message
