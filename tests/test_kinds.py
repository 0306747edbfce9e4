"""One class for each kind of force and constraint, edits of parts, sites, warnings of models."""

import copy
import inspect
import json
import pickle
import pydoc
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from tests.worlds import KINDS, NEEDS

pytestmark = pytest.mark.quick


@pytest.mark.parametrize(("part", "kind"), KINDS)
def test_a_kind_is_made_by_its_class_and_by_that_of_the_part(part, kind):
    own = getattr(pg, kind.title().replace("_", ""))
    made = part(name="x", kind=kind, body="2", **NEEDS.get(kind, {}))
    assert type(made) is own
    assert isinstance(made, part)
    assert own(name="x", body="2", **NEEDS.get(kind, {})) == made
    assert pickle.loads(pickle.dumps(made)) == copy.deepcopy(made) == made
    assert part.model_validate(made.model_dump()) == made
    assert not hasattr(made, "no_such_field")


def test_signature_help_and_completion_show_the_fields_of_the_kind():
    assert list(inspect.signature(pg.Torsion).parameters) == [*pg.Torsion.model_fields]
    text = pydoc.render_doc(pg.Spring, renderer=pydoc.plaintext)
    assert len(text.splitlines()) < 80
    assert "stiffness: " in text
    spring = pg.Spring(name="s", body="a")
    for names in (dir(pg.Spring), dir(spring)):
        assert set(pg.Spring.model_fields) <= set(names)
        assert not any(name.startswith(("_", "model_")) for name in names)


def test_equal_parts_models_and_mechanisms_have_equal_hashes(model):
    again = pg.Model.from_json(model.to_json())
    assert len({model, again, model.edit("arm", mass=7.0)}) == 2
    assert len({pg.Spring(name="s", body="a"), pg.Spring(name="s", body="a", rest=None)}) == 1
    assert len({pg.Scenario(name="s", q={"a": 1.0}), pg.Scenario(name="s", q={"a": 2.0})}) == 2
    mech = pg.Mechanism(model)
    assert mech == pg.Mechanism(model)
    assert mech != pg.Mechanism(model.edit("arm", mass=17.0))
    assert len({mech, pg.Mechanism(model)}) == 1
    assert all("arm" in whole and "nobody" not in whole for whole in (model, mech))


def test_fields_may_be_lists_arrays_and_dictionaries():
    shape = {"kind": "sphere", "radius": 1}
    body = pg.Body(name="a", inertia=np.eye(3), com=np.zeros(3), q=0.1, shape=shape, limits=[-1, 1])
    model = pg.Model(
        bodies=[body],
        contacts=[{"name": "floor", "body": "a", "points": np.eye(3)}],
        forces=[{"name": "f", "kind": "spring", "body": "a", "point": [0, 0, 1]}],
    )
    assert model.part("f", "force") == pg.Spring(name="f", body="a", point=(0, 0, 1))
    assert len(model.part("floor", "contact").points) == 3
    lists = pg.Body(name="a", com=[0, 0, 1], axes=[[0, 1, 0]])
    arrays = pg.Body(name="a", com=np.array([0.0, 0, 1]), axes=(0, 1, 0))
    assert hash(lists) == hash(arrays)


def test_files_of_schema_1_may_name_fields_of_other_kinds():
    motion = {"name": "m", "kind": "motion", "body": "1", "other": "ground", "active": False}
    text = {
        "bodies": [{"name": "1"}, {"name": "2", "parent": "1"}],
        "constraints": [motion | {"q_of_t": {"t": [0], "value": [0]}, "point": None}],
        "forces": [{"name": "f", "body": "1", "kp": 0.0, "target": 0.3, "other": "ground"}],
    }
    model = pg.Model.from_json(json.dumps({"$schema": "pgraph-model", "schema_version": 1, **text}))
    assert [type(x) for x in (*model.constraints, *model.forces)] == [pg.Motion, pg.Motor]
    assert '"other": "ground"' in model.to_json().split('"constraints"')[1]


OFF = {"name": "other", "active": False}
RUN = {"constraints": ("tie",), "contacts": ("tie", "paw")}
RUN["switches"] = [{"t": 1, "constraint": "tie", "active": False}]


@pytest.fixture
def model() -> pg.Model:
    """A part of each kind. A contact and a pin share a name, and so do a body and a contact."""
    return pg.Model(
        bodies=(pg.Body(name="arm", tip=(1, 0, 0)), pg.Body(name="paw", parent="arm")),
        constraints=(pg.Point(name="tie", body="paw"), pg.Weld(**OFF, body="arm")),
        contacts=[pg.Contact(name=n, body="paw", points=[(0, 0, 0)]) for n in ("tie", "paw")],
        forces=(pg.Spring(name="spring", body="paw", stiffness=10, damping=1),),
        scenarios=(pg.Scenario(name="run", **RUN),),
    )


def test_parts_of_every_kind_are_added(model):
    parts = (
        pg.Body(name="leg"),
        pg.Revolute(name="c", body="arm"),
        pg.Servo(name="f", body="arm", kp=1),
        pg.Contact(name="t", body="arm", points=[(0, 0, 0)]),
        pg.Scenario(name="s"),
    )
    for part in parts:
        after = model.add(part)
        assert after.part(part.name) is part
        assert after.remove(part.name) == model
    between = model.add(pg.Motor(name="m", body="arm"))
    between = between.add(pg.Wrench(name="w", body="arm"), after="spring")
    assert [f.name for f in between.forces] == ["spring", "w", "m"]


def test_an_edit_changes_the_fields_that_it_names(model):
    new = model.edit("spring", stiffness=20)
    assert new.part("spring") == pg.Spring(name="spring", body="paw", stiffness=20, damping=1)
    assert pg.Mechanism(model).edit("spring", stiffness=20).model == new
    assert model.edit("spring", stiffness=10) is model
    assert model.edit("paw", mass=3.0).body("paw").mass == 3.0  # a body comes first
    assert model.edit("paw", kind="contact", friction=0.3).part("paw", "contact").friction == 0.3
    assert model.edit("run", t_end=5).scenario("run").t_end == 5
    torsion = model.edit("spring", kind="torsion")
    assert torsion.part("spring") == pg.Torsion(name="spring", body="paw", stiffness=10, damping=1)


def test_an_edit_of_one_of_two_parts_with_a_name_is_noticed():
    spring = pg.Spring(name="s", body="s", other_point=(0, 0, 1), stiffness=10.0)
    twins = pg.Model(bodies=[pg.Body(name="s", axes=(0, 1, 0), com=(0.5, 0, 0))], forces=[spring])
    edited = twins.edit("s", stiffness=5.0)
    assert edited.body("s").stiffness == (5.0,)
    assert edited.forces == twins.forces
    assert 'kind="force"' in edited.notices[0]
    assert twins.edit("s", mass=5.0).notices == ()  # a spring has none
    assert twins.edit("s", kind="force", stiffness=5.0).notices == ()
    with pytest.raises(pg.ModelError, match='kind="force"'):
        twins.edit("s", other_point=(0, 0, 2))  # a body has none


def test_an_edit_takes_formulas_in_every_part(model):
    model = model.replace(parameters={"k": 3.0})
    new = model.edit("spring", stiffness="=2*k")
    assert new.part("spring", "force").stiffness == 6.0
    assert new.replace(parameters={"k": 4.0}).part("spring", "force").stiffness == 8.0


def test_references_follow_a_new_name_and_go_with_a_part(model):
    new = model.edit("tie", kind="constraint", name="pin").edit("tie", name="sole")
    (run,) = new.scenarios
    assert (run.constraints, run.contacts) == (("pin",), ("sole", "paw"))
    assert [s.constraint for s in run.switches] == ["pin"]
    new = model.remove("tie", kind="constraint")
    (run,) = new.scenarios
    assert (run.constraints, run.switches) == ((), ())
    assert any("switches" in notice for notice in new.notices)
    assert model.remove(["spring", "run"]).forces == ()
    with pytest.raises(pg.ModelError, match="nobody"):
        model.remove(["spring", "nobody"])


def test_a_model_shows_as_one_line_and_as_a_drawing(model):
    assert repr(model).startswith("<Model 'model': 2 bodies, 2 constraints, 2 contacts, 1 force")
    assert "\n" not in repr(model)
    assert "<svg" in model._repr_html_()


@pytest.mark.parametrize("kind", pg.Constraint.KINDS)
def test_a_model_with_a_constraint_of_any_kind_shows_as_a_drawing(kind):
    """Some kinds act on one body, or on a sum over several."""
    part = pg.Constraint.KINDS[kind]
    bodies = [
        pg.Body(name=name, axes=(0, 0, 1), mass=1.0, tip=(1, 0, 0), link=(0, 0.3 * k, 0))
        for k, name in enumerate("12")
    ]
    tie = part.model_validate({"name": "x", "body": "2", **NEEDS.get(kind, {})})
    assert "<svg" in pg.Model(bodies=bodies, constraints=[tie])._repr_html_()


def test_a_site_is_a_frame_of_its_body_and_follows_edits():
    body = {"axes": (0, 1, 0), "mass": 1.0, "tip": (0, 0, -1), "link": (0, 0, -1)}
    model = pg.Model(
        bodies=[pg.Body(name="a", **body), pg.Body(name="b", parent="a", **body)],
        sites=[pg.Site(name="tool", body="b", point=(0.2, 0, -1), rotation=(0, 0, 0, 1))],
    )
    assert pg.Model.from_json(model.to_json()) == model
    mech, q, v = pg.Mechanism(model), np.array([0.3, -0.8]), np.array([1.0, 2.0])
    place, turn = mech.pose(q, "tool")
    origin, own = mech.pose(q, "b")
    np.testing.assert_allclose(place, origin + own @ (0.2, 0, -1))
    np.testing.assert_allclose(turn, own @ np.diag((-1, -1, 1)), atol=1e-15)
    J = mech.jacobian(q, "tool")
    np.testing.assert_allclose(J, mech.jacobian(q, "b", (0.2, 0, -1)))
    h = 1e-6
    ahead, behind = (mech.pose(q + s * h * v, "tool")[0] for s in (1, -1))
    np.testing.assert_allclose(J[3:] @ v, (ahead - behind) / (2 * h), atol=1e-8)
    found = mech.inverse_kinematics({"tool": place}, q=[0.1, -0.1])
    np.testing.assert_allclose(mech.pose(found, "tool")[0], place, atol=1e-9)
    renamed = model.edit("b", name="hand")
    assert renamed["tool"].body == "hand"
    assert renamed.edit("tool", point=(0, 0, 0))["tool"].point == (0, 0, 0)
    assert renamed.remove("hand").sites == ()
    with pytest.raises(pg.InputError, match=r"'tol'.*tool"):
        mech.pose(q, "tol")


ARM = {"name": "arm", "axes": (0, 1, 0), "tip": (1, 0, 0), "inertia": (0.01,) * 3}
SPRING = {"name": "s", "body": "arm", "stiffness": 1.0}
BALL = pg.Shape(kind="sphere", radius=0.1)
MESH = pg.Shape(kind="mesh", file="nowhere.stl")


def with_arm(fields=(), **model):
    return pg.Model(bodies=[pg.Body(**{**ARM, "shape": BALL, **dict(fields)})], **model)


@pytest.mark.parametrize(
    ("force", "fact", "mended"),
    [
        (pg.Spring(name="s", body="arm"), "stiffness", {"other_point": (0, 0, 1)}),
        (pg.Spring(**SPRING), "length", {"other_point": (0, 0, 1)}),
        (pg.Torsion(**SPRING), "axis", {"kind": "torsion", "axis": (0, 1, 0)}),
        (pg.Servo(name="s", body="arm"), "kp", pg.Servo(name="s", body="arm", kp=1.0)),
        (pg.Servo(name="s", body="arm", kp=1.0, coefficients={"fore": 1}), "among",
         pg.Servo(name="s", body="fore", kp=1.0, coefficients={"fore": 1})),
    ],
)  # fmt: skip
def test_a_force_that_does_nothing_is_a_warning(force, fact, mended):
    bodies = [pg.Body(**ARM), pg.Body(name="fore", parent="arm", link=(1, 0, 0))]
    (doubt,) = pg.Model(bodies=bodies, forces=[force]).doubts
    assert fact in doubt
    assert "'s'" in doubt
    if isinstance(mended, dict):
        mended = pg.Force(**{"kind": "spring", **SPRING, **mended})
    assert pg.Model(bodies=bodies, forces=[mended]).doubts == ()


@pytest.mark.parametrize(
    ("model", "facts"),
    [
        (with_arm({"rest": 0.5}), ("stiffness",)),
        (with_arm({"limit_restitution": 0.5}), ("limits",)),
        (with_arm({"q": 1.5, "limits": (-1, 1)}), ("0.5", "[-1.0, 1.0]")),
        (with_arm({"q": 90}), ("np.radians(90)",)),
        (with_arm({"q": 3, "limits": (-180, 180)}), ("rad",)),
        (with_arm(up="z", gravity=(0, -9.81, 0)), ("-z",)),
        (with_arm(gravity=(0, 0, -9810)), ("m/s²",)),
        (with_arm(parameters={"k": 1.0}), ("formula",)),
        (with_arm(contacts=[pg.Contact(name=n, body="arm") for n in "ab"]), ("both",)),
        (with_arm({"shape": MESH}), ("nowhere.stl",)),
        (with_arm({"mass": 1e5, "com": (0, 0, 200), "inertia": 1e9 * np.eye(3)}), ()),
    ],
)
def test_fields_without_effect_or_sense_are_warnings(model, facts):
    found = model.doubts
    assert len(found) == bool(facts)
    assert [fact for fact in facts if fact not in found[0]] == []


def test_warnings_go_with_their_reason_and_are_notices_of_a_run():
    arm = pg.Body(name="arm", axes=(0, 1, 0), com=(0, 0, -1), tip=(0, 0, -1))
    fore = pg.Body(name="fore", parent="arm", axes=(0, 1, 0), com=(0, 0, -0.2))
    model = pg.Model(bodies=[arm, fore])
    (hung,) = model.doubts
    assert [x for x in ("'fore'", "link", "'arm'", "[0.0, 0.0, -1.0]") if x not in hung] == []
    assert pg.simulate(model, t_end=0.01).notices[:1] == model.doubts
    assert model.edit("fore", link=(0, 0, -1)).doubts == ()
    assert not any(pg.Model.load(pgraph_models.path(n)).doubts for n in pgraph_models.names())


@pytest.mark.parametrize("point", [(1, 0, 0), (0, 2, 0), (0.5, 0, 0.5)])
@pytest.mark.parametrize("other", [(0, 0, 0), (0, 3, 0), (1, 0, 1)])
def test_a_spring_is_a_warning_where_it_has_no_torque(point, other):
    spring = pg.Spring(**SPRING, point=point, other_point=other, rest=0.2)
    model = pg.Model(bodies=[pg.Body(**ARM)], forces=[spring], gravity=(0, 0, 0))
    mech = pg.Mechanism(model)
    pulls = [mech.forward_dynamics([q], [0.0], [0.0])[0] for q in (0.1, 1.0, 2.5, 4.0)]
    assert bool(model.doubts) == bool(np.abs(pulls).max() < 1e-12)


@pytest.mark.parametrize("axis", np.eye(3).tolist())
def test_a_new_line_is_along_the_way_from_its_other_body(axis):
    """Wherever that body is."""
    base = pg.Body(name="base", joint="weld", link=(3, 4, 5))
    arm = pg.Body(name="arm", parent="base", tip=axis)
    assert pg.Line.begun(pg.Model(bodies=[base, arm]), "arm", "base") == {"other_axis": tuple(axis)}


@pytest.mark.parametrize("shape", [
    None, {"kind": "box", "size": (1, 1, 1)}, {"kind": "cylinder", "radius": 0.2, "length": 0.1},
    {"kind": "sphere", "radius": 0.2},
])  # fmt: skip
def test_a_new_rolling_body_has_a_radius(shape):
    ball = pg.Body(name="ball", joint="free", mass=1.0, shape=shape)
    model = pg.Model(bodies=[ball])
    new = pg.Rolling(name="new", body="ball", **pg.Rolling.begun(model, "ball", "ground"))
    assert (new.radius is None) == (shape is not None and shape["kind"] == "sphere")
    assert model.add(new).constraints == (new,)


@pytest.mark.parametrize("kind", sorted(pg.Constraint.KINDS.keys() - {"rolling"}))  # to the ground
def test_a_new_constraint_does_not_move_its_bodies(kind):
    """The fields that its class gives it hold where the bodies are."""
    model = pg.Model.serial(3).edit("1", q=0.4).edit("2", q=-0.3).edit("3", q=0.2)
    if kind == "cam":  # whose joints are side by side
        model = model.edit("3", parent="ground", link=(0.5, 0.0, 0.2))
    cls: Any = pg.Constraint.KINDS[kind]
    other = {"other": "1"} if "other" in cls.model_fields else {}
    new = cls(name="new", body="3", **other, **cls.begun(model, "3", "1"))
    mech = pg.Mechanism(model.add(new))
    q = mech.home()[0]
    assembled, *_ = mech.assemble(q)
    assert np.abs(assembled - q).max() < 1e-12
