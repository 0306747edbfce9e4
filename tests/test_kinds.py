"""One class a kind of force and constraint, and edits of parts that are no bodies."""

from __future__ import annotations

import copy
import inspect
import json
import pickle
import pydoc

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models

NEEDS = {
    "distance": {"other_point": (0, 0, 9)},
    "line": {"axis": (0, 0, 1)},
    "plane": {"axis": (0, 0, 1)},
    "gear": {"other": "1"},
    "motion": {"q_of_t": {"kind": "sine"}},
    "skate": {"axis": (0, 0, 1)},
    "velocity": {"coefficients": {"2": 1.0}},
    "coupling": {"coefficients": {"2": 1.0}},
    "tendon": {"coefficients": {"2": 1.0}},
    "drag": {"size": (1, 2, 3)},
}
KINDS = [(pg.Constraint, kind) for kind in pg.Constraint.KINDS]
KINDS += [(pg.Force, kind) for kind in pg.Force.KINDS]


@pytest.mark.parametrize(("part", "kind"), KINDS)
def test_a_kind_is_made_by_its_class_and_by_that_of_the_part(part, kind):
    own = getattr(pg, kind.title().replace("_", ""))
    made = part(name="x", kind=kind, body="2", **NEEDS.get(kind, {}))
    assert type(made) is own
    assert isinstance(made, part)
    assert own(name="x", body="2", **NEEDS.get(kind, {})) == made
    assert pickle.loads(pickle.dumps(made)) == copy.deepcopy(made) == made
    assert part.model_validate(made.model_dump()) == made


def test_a_signature_lists_the_fields_of_the_kind():
    assert str(inspect.signature(pg.Torsion)) == (
        "(*, name: str, kind: Literal['torsion'] = 'torsion', body: str, other: str = 'ground', "
        "axis: Vec3 | None = None, stiffness: Number = 0.0, damping: Number = 0.0, "
        "rest: Number = 0.0)"
    )


def test_help_and_completion_show_the_fields_and_not_pydantic():
    text = pydoc.render_doc(pg.Spring, renderer=pydoc.plaintext)
    assert len(text.splitlines()) < 80
    assert "stiffness: a number >= 0 [N/m]" in text
    spring = pg.Spring(name="s", body="a")
    for shown in (dir(pg.Spring), dir(spring)):
        assert set(pg.Spring.model_fields) <= set(shown)
        assert not any(name.startswith(("_", "model_")) for name in shown)


def test_a_default_that_hardly_fits_is_told():
    arm = pg.Body(name="arm", mass=1200, axes=(0, 1, 0), tip=(0, 0, -1))
    model = pg.Model(bodies=[arm, pg.Body(name="fore", parent="arm", com=(0, 0, -0.2))])
    heavy, hung = model.doubts
    assert all(fact in heavy for fact in ("'arm'", "1200 kg", "0.01", "inertia"))
    assert all(fact in hung for fact in ("'fore'", "link", "'arm'", "[0.0, 0.0, -1.0]"))
    assert pg.simulate(model, t_end=0.01).notices[:2] == model.doubts
    mended = model.edit("arm", inertia=np.eye(3) * 100).edit("fore", link=(0, 0, -1))
    assert mended.doubts == ()
    assert not any(pg.Model.load(pgraph_models.path(n)).doubts for n in pgraph_models.names())


def test_equal_parts_and_models_have_equal_hashes(model):
    again = pg.Model.from_json(model.to_json())
    assert len({model, again, model.edit("arm", mass=7.0)}) == 2
    assert len({pg.Spring(name="s", body="a"), pg.Spring(name="s", body="a", rest=None)}) == 1
    assert len({pg.Scenario(name="s", q={"a": 1.0}), pg.Scenario(name="s", q={"a": 2.0})}) == 2


def test_what_is_given_may_be_lists_arrays_and_dictionaries():
    body = pg.Body(
        name="a",
        axes=(0, 1, 0),
        inertia=np.eye(3),
        com=np.zeros(3),
        q=0.1,
        shape={"kind": "sphere", "radius": 1},
        limits=[-1, 1],
    )
    assert body.axes == ((0.0, 1.0, 0.0),)
    model = pg.Model(
        bodies=[body],
        contacts=[{"name": "floor", "body": "a", "points": np.eye(3)}],
        forces=[{"name": "f", "kind": "spring", "body": "a", "point": [0, 0, 1]}],
    )
    assert model.part("f", "force") == pg.Spring(name="f", body="a", point=(0, 0, 1))
    assert len(model.part("floor", "contact").points) == 3


@pytest.mark.parametrize(
    ("make", "facts"),
    [
        (
            lambda: pg.Force(name="f", kind="sprng", body="a"),
            ["force 'f', kind", "'sprng'", "one of spring, "],
        ),
        (
            lambda: pg.Spring(name="f", body="a", stifness=1),
            ["force 'f', stifness", "did you mean stiffness"],
        ),
        (
            lambda: pg.Spring(name="f", body="a", kp=1),
            ["force 'f', kp", "kind 'spring'", "kind servo"],
        ),
        (
            lambda: pg.Spring(name="f", kind="motor", body="a"),
            ["kind 'spring'", "'motor'", "a Motor"],
        ),
        (lambda: pg.Motor(name="f", body="a", kp=2), ["force 'f', kp", "use kind 'servo'"]),
        (lambda: pg.Gear(name="g", body="a"), ["constraint 'g', other", "second body", "'ground'"]),
        (lambda: pg.Plane(name="g", body="a"), ["constraint 'g', other_axis", "one direction"]),
    ],
)
def test_a_wrong_part_is_a_sentence_with_the_choices(make, facts):
    with pytest.raises(pg.ModelError) as refused:
        make()
    for fact in facts:
        assert fact in str(refused.value)


def test_files_of_schema_1_name_fields_of_other_kinds_that_say_nothing():
    text = {
        "bodies": [{"name": "1"}, {"name": "2", "parent": "1"}],
        "constraints": [
            {
                "name": "m",
                "kind": "motion",
                "body": "1",
                "other": "ground",
                "active": False,
                "q_of_t": {"t": [0], "value": [0]},
                "point": None,
            },
        ],
        "forces": [{"name": "f", "body": "1", "kp": 0.0, "target": 0.3, "other": "ground"}],
    }
    model = pg.Model.from_json(json.dumps({"$schema": "pgraph-model", "schema_version": 1, **text}))
    assert [type(x) for x in (*model.constraints, *model.forces)] == [pg.Motion, pg.Motor]
    assert '"other": "ground"' in model.to_json().split('"constraints"')[1]


@pytest.mark.parametrize("name", sorted(pgraph_models.names()))
def test_files_of_schema_1_are_saved_as_they_were(name):
    path = pgraph_models.path(name)
    model = pg.Model.load(path)
    assert pg.Model.from_json(model.to_json()) == model
    if model.to_json() != path.read_text("utf-8"):  # only by what the file writes in full
        assert json.loads(path.read_text("utf-8"))["schema_version"] == 1


@pytest.mark.parametrize(
    ("part", "field", "facts"),
    [
        (pg.Spring(name="s", body="a"), "kp", ["Spring", "'kp'", "stiffness"]),
        (pg.Motor(name="m", body="a"), "other", ["Motor", "'other'", "torque_limit"]),
        (pg.Gear(name="g", body="a", other="b"), "point", ["Gear", "'point'", "ratio"]),
    ],
)
def test_a_part_has_the_fields_of_its_own_kind_only(part, field, facts):
    assert not hasattr(part, field)
    with pytest.raises(AttributeError) as refused:
        getattr(part, field)
    assert all(fact in str(refused.value) for fact in facts)
    assert not hasattr(part, "no_such_field")


# -- add, edit, remove -----------------------------------------------------------------------------


@pytest.fixture
def model() -> pg.Model:
    """A part of each kind; the contact and the pin share a name, a paw is a body and a contact."""
    return pg.Model(
        bodies=(pg.Body(name="arm", tip=(1, 0, 0)), pg.Body(name="paw", parent="arm")),
        constraints=(
            pg.Point(name="tie", body="paw"),
            pg.Weld(name="other", body="arm", active=False),
        ),
        contacts=(
            pg.Contact(name="tie", body="paw", points=[(0, 0, 0)]),
            pg.Contact(name="paw", body="paw", points=[(0, 0, 0)]),
        ),
        forces=(pg.Spring(name="spring", body="paw", stiffness=10, damping=1),),
        scenarios=(
            pg.Scenario(
                name="run",
                constraints=("tie",),
                contacts=("tie", "paw"),
                switches=[{"t": 1, "constraint": "tie", "active": False}],
            ),
        ),
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
    between = model.add(pg.Motor(name="m", body="arm")).add(
        pg.Wrench(name="w", body="arm"), after="spring"
    )
    assert [f.name for f in between.forces] == ["spring", "w", "m"]


def test_an_edit_changes_the_fields_that_it_names(model):
    new = model.edit("spring", stiffness=20)
    assert new.part("spring") == pg.Spring(name="spring", body="paw", stiffness=20, damping=1)
    assert model.edit("spring", stiffness=10) is model
    assert model.edit("paw", mass=3.0).body("paw").mass == 3.0  # a body wins
    assert model.edit("paw", kind="contact", friction=0.3).part("paw", "contact").friction == 0.3
    assert model.edit("run", t_end=5).scenario("run").t_end == 5
    servo = model.edit("spring", kind="torsion")
    assert servo.part("spring") == pg.Torsion(name="spring", body="paw", stiffness=10, damping=1)


def test_an_edit_takes_formulas_in_every_part(model):
    model = model.replace(parameters={"k": 3.0})
    new = model.edit("spring", stiffness="=2*k")
    assert new.part("spring", "force").stiffness == 6.0
    assert new.replace(parameters={"k": 4.0}).part("spring", "force").stiffness == 8.0


def test_a_new_name_is_followed(model):
    new = model.edit("tie", kind="constraint", name="pin").edit("tie", name="sole")
    (run,) = new.scenarios
    assert (run.constraints, run.contacts) == (("pin",), ("sole", "paw"))
    assert [s.constraint for s in run.switches] == ["pin"]


def test_what_refers_to_a_removed_part_goes_too(model):
    new = model.remove("tie", kind="constraint")
    (run,) = new.scenarios
    assert (run.constraints, run.switches) == ((), ())
    assert any("switches" in notice for notice in new.notices)
    assert model.remove(["spring", "run"]).forces == ()
    with pytest.raises(pg.ModelError):
        model.remove(["spring", "nobody"])


@pytest.mark.parametrize(
    ("edit", "facts"),
    [
        (lambda m: m.edit("tie", active=False), ["'tie'", 'kind="constraint"', 'kind="contact"']),
        (lambda m: m.remove("tie"), ["'tie'", 'kind="constraint"', 'kind="contact"']),
        (lambda m: m.edit("sprnig", damping=1), ["'sprnig'", "choose one of spring, "]),
        (lambda m: m.remove("sprnig"), ["'sprnig'", "choose one of spring, "]),
        (lambda m: m.edit("spring", kind="contact", friction=1), ["contact 'spring'", "tie, paw"]),
        (
            lambda m: m.remove("spring", kind="forces"),
            ["'forces'", "body, constraint, contact, force"],
        ),
        (lambda m: m.edit("spring", dampng=1), ["force 'spring', dampng", "did you mean damping"]),
        (
            lambda m: m.edit("spring", body="nobody"),
            ["force 'spring', body", "'nobody'", "arm, paw"],
        ),
        (lambda m: m.edit("spring", stiffness=-1), ["force 'spring', stiffness", "-1", ">= 0"]),
        (
            lambda m: m.edit("other", kind="sprnig"),
            ["constraint 'other', kind", "'sprnig'", "weld"],
        ),
        (lambda m: m.add({"name": "x"}), ["Force, Scenario, Site or Output", "dict"]),
        (lambda m: m.add(pg.Motor), ["Force, Scenario, Site or Output"]),
        (lambda m: m.add(pg.Motor(name="spring", body="arm")), ["force 'spring', name", "another"]),
        (lambda m: m.add(pg.Motor(name="x", body="arm"), after="tie"), ["force 'tie'", "spring"]),
    ],
)
def test_a_wrong_edit_is_a_sentence(model, edit, facts):
    with pytest.raises(pg.ModelError) as refused:
        edit(model)
    for fact in facts:
        assert fact in str(refused.value)


def test_a_mechanism_is_edited_likewise(model):
    mech = pg.Mechanism(model).edit("spring", stiffness=20)
    assert mech.model.part("spring", "force").stiffness == 20
    assert (
        mech.edit("paw", kind="contact", friction=0.3).model.part("paw", "contact").friction == 0.3
    )


def test_a_model_shows_as_one_line(model):
    assert repr(model) == (
        "<Model 'model': 2 bodies, 2 constraints, 2 contacts, 1 force, 1 scenario; up z>"
    )
    assert "<svg" in model._repr_html_()


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
    with pytest.raises(pg.ModelError, match=r"'a'.*is the name of a body"):
        model.add(pg.Site(name="a", body="b"))
    with pytest.raises(pg.InputError, match=r"'tol'.*tool"):
        mech.pose(q, "tol")


ARM = {"name": "arm", "axes": (0, 1, 0), "tip": (1, 0, 0)}
SPRING = {"name": "s", "body": "arm", "stiffness": 1.0}


@pytest.mark.parametrize(
    ("fields", "idle", "mended"),
    [
        ({"forces": [pg.Spring(name="s", body="arm")]}, "stiffness and damping are 0",
         {**SPRING, "other_point": (0, 0, 1)}),
        ({"forces": [pg.Spring(**SPRING)]}, "length is constant",
         {**SPRING, "other_point": (0, 0, 1)}),
        ({"forces": [pg.Spring(**SPRING, point=(0, 2, 0), other_point=(1, 1, 1))]},
         "length is constant", {**SPRING, "point": (1, 2, 0), "other_point": (1, 1, 1)}),
        ({"forces": [pg.Torsion(**SPRING)]}, "does not turn about its axis",
         {**SPRING, "kind": "torsion", "axis": (0, 1, 0)}),
        ({"forces": [pg.Servo(name="s", body="arm")]}, "kp and kd are 0",
         pg.Servo(name="s", body="arm", kp=1.0)),
        ({"forces": [pg.Servo(name="s", body="arm", kp=1.0, coefficients={"fore": 1})]},
         "not among them", pg.Servo(name="s", body="fore", kp=1.0, coefficients={"fore": 1})),
    ],
)  # fmt: skip
def test_a_force_that_does_nothing_is_told(fields, idle, mended):
    bodies = [pg.Body(**ARM), pg.Body(name="fore", parent="arm", link=(1, 0, 0))]
    (doubt,) = pg.Model(bodies=bodies, **fields).doubts
    assert idle in doubt
    assert "'s'" in doubt
    if isinstance(mended, dict):
        mended = pg.Force(**{"kind": "spring", **mended})
    assert pg.Model(bodies=bodies, forces=[mended]).doubts == ()


@pytest.mark.parametrize(
    ("body", "fields", "fact"),
    [
        ({"rest": 0.5}, {}, "without stiffness"),
        ({"limit_restitution": 0.5}, {}, "without limits"),
        ({"q": 1.5, "limits": (-1, 1)}, {}, "starts 0.5 beyond its limits [-1.0, 1.0]"),
        ({"q": 90}, {}, "np.radians(90)"),
        ({}, {"up": "z", "gravity": (0, -9.81, 0)}, "does not pull along -z"),
        ({}, {"parameters": {"k": 1.0}}, "no formula uses it"),
        ({}, {"contacts": [pg.Contact(name=n, body="arm") for n in "ab"]}, "both push"),
    ],
)
def test_fields_without_effect_or_sense_are_told(body, fields, fact):
    shape = pg.Shape(kind="sphere", radius=0.1)
    (doubt,) = pg.Model(bodies=[pg.Body(**ARM, **body, shape=shape)], **fields).doubts
    assert fact in doubt


@pytest.mark.parametrize("point", [(1, 0, 0), (0, 2, 0), (0.5, 0, 0.5)])
@pytest.mark.parametrize("other", [(0, 0, 0), (0, 3, 0), (1, 0, 1)])
def test_a_spring_is_doubted_where_it_has_no_torque(point, other):
    """The doubt against the kernel: what the spring gives the joint at four angles."""
    spring = pg.Spring(**SPRING, point=point, other_point=other, rest=0.2)
    model = pg.Model(bodies=[pg.Body(**ARM)], forces=[spring], gravity=(0, 0, 0))
    mech = pg.Mechanism(model)
    pulls = [mech.forward_dynamics([q], [0.0], [0.0])[0] for q in (0.1, 1.0, 2.5, 4.0)]
    assert bool(model.doubts) == bool(np.abs(pulls).max() < 1e-12)
