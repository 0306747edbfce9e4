"""Refused input: the model stays, and the reply names the part, the field and the value given."""

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.core import cells

from .store import ME, OTHER, after, begun, do, reply

pytestmark = pytest.mark.quick

LONG = "x" * 10_000


@pytest.fixture(scope="module")
def state():
    """Seven bodies, a distance, a scenario with a switch for another constraint."""
    model = pg.Model.serial(7).edit("4", parent="2").edit("5", parent="3").edit("6", parent="2")
    lock = pg.Constraint(name="lock", kind="point", body="7", active=False)
    model = model.add(lock).replace(parameters={"thigh": 0.3})
    state = after(begun(model, ME, OTHER), do.NewScenario(ME), do.AddSwitch(ME, "lock"))
    return after(state, do.AddPart(ME, "constraints", "distance", "3"), do.Select(ME, "1"))


def table(body, field, text, *index):
    return do.EditBodies(ME, 7, (body,), field, ((index, text),))


def form(field, text, *index):
    return do.EditBodies(ME, 7, ("2",), field, ((index, text),))


def part(field, text, *index):
    return do.EditPart(ME, 7, "constraints", "distance", field, ((index, text),))


def world(field, text, *index):
    return do.EditWorld(ME, 7, field, ((index, text),))


def paste(text, rows=(), column=0):
    return do.Paste(ME, 7, text, rows, column)


CASES = [
    (table("3", "mass", "heavy"), "'3' mass 'heavy'"),
    (table("3", "mass", "1,5"), "'3' mass '.' '1,5'"),
    (table("3", "mass", "nan"), "'3' mass 'nan'"),
    (table("3", "name", "4"), "'3' name '4'"),
    (table("3", "name", LONG), "'3' name 100 10000"),
    (table("3", "name", "ground"), "'3' name 'ground'"),
    (table("3", "parent", "5"), "'3' parent 5"),
    (table("3", "dof", "7"), "'3' dof 0 6 '7'"),
    (table("3", "com", "1", 5), "'3' centre"),
    (table("nobody", "mass", "1"), "'nobody' 1, 7"),
    (form("inertia", "1", 2, 2), "'2' inertia triangle 0.996"),
    (form("q", "1 furlong", 0), "'2' q furlong'"),
    (form("link", "", 0), "'2' link"),
    (form("mass", "=thig"), "'2' mass 'thig'"),
    (form("mass", "=1/0"), "'2' mass '=1/0' zero"),
    (form("shape_4_radius", "1"), ""),
    (do.FillFromShape(ME, 7, ("2",), "-1"), "density 0 -1"),
    (world("gravity", "x", 0), "gravity 'x'"),
    (world("name", " "), "name 1 100"),
    (part("length", "-1"), "'distance' length -1.0"),
    (part("point", "nan", 0), "Point 'nan'"),
    (part("other", "nobody"), "'distance' other 'nobody' ground, 7"),
    (part("kind", "glue"), "Kind point weld revolute distance motion"),
    (do.EditSwitch(ME, 7, 0, "value", (((), "2"),)), "2 s"),  # the run ends then
    (do.EditSwitch(ME, 7, 0, "value", (((), "soon"),)), "time 'soon'"),
    (do.EditSwitch(ME, 7, 0, "what", (((), "gap"),)), "contact"),
    (do.EditSwitch(ME, 7, 0, "constraint", (((), "gone"),)), "'gone' lock"),
    (do.EditSwitch(ME, 7, 1, "value", (((), "1"),)), ""),  # there is one switch
    *((do.NewModel(ME, 7, text), f"1 1000 '{text}'") for text in ("0", "2.5", "1001", "x")),
    (do.CountBodies(ME, 7, "1001"), "1 1000 '1001'"),
    (do.SetRun(ME, 7, "step", "-1"), "step 0 -1"),
    (do.SetRun(ME, 7, "method", "magic"), "method auto rk4 radau5"),
    (do.SetRun(ME, 7, "rtol", "1"), "tolerance 1e-15 0.1 1"),
    (do.SetReport(ME, 7, "target", "2"), "error 0 1 2"),
    *((do.MoveJoint(ME, 7, "3", 0, text), "'3' q") for text in ("", "abc", "1e400")),
    (paste("a\tnobody"), "'a' parent 'nobody'"),
    (paste("a\t1\t3 compound"), "line 1 dof '3 compound'"),
    (paste("a\t1\t1\tholonomic\tmore"), "line 1 5 4 name parent dof constraint"),
    (paste("Body\tMass\na\t1e400"), "line 1 mass '1e400'"),
    (paste("4\n4", ("2", "3")), "row 3 name '4' 2"),
    (paste("1\n2", ("3",), 1), "line 2 Body"),
    (paste(""), "Nothing"),
    (paste("b", ("nobody",)), "'nobody'"),
    (paste("\n".join(f"r{k}" for k in range(1000))), "1007 1000"),
    (paste("name;parent;weight\na;ground;1"), "weight"),
    (paste("name\tmass [lb]\na\t1"), "'lb'"),
    (paste("name\tinertia\na\t1 2"), "inertia 3"),
    (paste('name\tshape\nhub\t{"kind":"sphere","size":[1,2]}'), "'hub' shape sphere size radius"),
]  # fmt: skip


@pytest.mark.parametrize(("event", "words"), CASES)
def test_a_refusal_names_the_part_the_field_and_the_value_given(state, event, words):
    refused = after(state, event)
    assert refused.model is state.model
    assert (refused.undo, refused.redo, refused.pose) == (state.undo, state.redo, None)
    assert (refused.request, refused.reporting) == (state.request, state.reporting)
    assert refused.clients[ME].reply.serial == 7
    assert 0 < len(reply(refused)) < 400
    assert [word for word in words.split() if word not in reply(refused)] == []
    assert refused.clients[OTHER].reply is state.clients[OTHER].reply


@pytest.mark.parametrize(
    ("event", "words"),
    [
        (do.AddBody(ME, None), "1000"),
        (do.Duplicate(ME, ("3",), False), "1000"),
        (do.SetParent(ME, ("2",), "5"), "5"),
        (do.MirrorBranch(ME, "nobody", "y"), "'nobody'"),
        (do.OpenText(ME, "x.json", "{"), "x.json"),
    ],
)
def test_a_refusal_without_a_cell_is_a_notice(state, event, words):
    if "1000" in words:
        state = after(state, do.NewModel(ME, 1, "1000"))
    refused = after(state, event)
    assert refused.model is state.model
    assert refused.clients[ME].notice.bad
    assert words in refused.clients[ME].notice.text + refused.clients[ME].notice.title


def test_an_offered_repair_is_one_undo_step(state):
    refused = after(state, form("inertia", "1", 2, 2))
    assert refused.clients[ME].reply.offer
    mended = after(refused, do.Mend(ME, 7, ("2",), "inertia", (((2, 2), "1"),)))
    a, b, c = np.linalg.eigvalsh(mended.model.body("2").inertia)
    assert (a + b, c) == pytest.approx((1.0, 1.0))
    assert len(mended.undo) == len(state.undo) + 1


@pytest.mark.parametrize(
    ("text", "of", "words"),
    [
        ("1/0", "length", "zero"),
        ("9^9^9^9", "length", "large"),
        ("1,5", "length", "'.'"),
        ("", "length", "number"),
        ("15 deg", "length", "length deg angle"),
        ("3 mm", "angle", "angle mm length"),
        ("\u0661\u0662", "length", ""),  # digits of other scripts
        ("1_0", "length", ""),
    ],
)
def test_a_faulty_formula_is_refused(text, of, words):
    with pytest.raises(cells.Refusal) as refused:
        cells.quantity(text, of, cells.Display())
    assert [word for word in words.split() if word not in str(refused.value)] == []
    if not words:
        with pytest.raises(cells.Refusal):
            cells.whole(text, 0, 100)
