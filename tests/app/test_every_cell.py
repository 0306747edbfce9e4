"""Every cell of every form: typed text is taken and shown, or refused with a sentence.

The forms are those that pages get, and each text takes the way of a page's message. A text that
is taken is in the model, in its file, in the form, and in one undo step. A refused
one changes nothing.
"""

import json
from typing import Any

import pytest

import pgraph_core as pg
from pgraph_app.constraints import KINDS
from pgraph_app.constraints.view import form
from pgraph_app.core.cells import Display
from pgraph_app.core.events import from_page
from pgraph_app.properties.view import properties
from pgraph_app.run.view import form as settings_form
from pgraph_app.scenario.view import scenario
from pgraph_core.joints import DEFAULT

from ..test_shape_kinds import SAMPLES
from .store import ME, after, begun, do, notice

NUMBERS = ("0.5", "=thigh/2", "-3e-2")
TEXTS = ("", "x", "1 2 3", "0 0; 1 0.5", "=sin(t)", "ground")
VALUES = {"0.5": 0.5, "=thigh/2": "=thigh/2", "-3e-2": -0.03}


def scene() -> pg.Model:
    """Return two arms side by side on the ground, the second one with a slider."""
    model = pg.Model.serial(4).edit("3", parent="ground", link=(0.3, 0.0, 0.4))
    model = model.edit("4", joint="prismatic", axes=(1, 0, 0))
    model = model.edit("2", shape={"kind": "sphere", "radius": 0.05})
    return model.replace(parameters={"thigh": 0.3})


def with_part(part: str, kind: str) -> Any:
    """Return the state after a new part on the second body, whose form is open."""
    body = "3" if kind == "cam" else "2"
    state = after(begun(scene()), do.AddPart(ME, part, kind, body))
    if part == "contacts" and state.clients[ME].picking:
        state = after(state, do.PickName(ME, "ground"))
    if state.clients[ME].picking:
        state = after(state, do.Select(ME, "1" if part == "loops" or kind == "cam" else "3"))
    return after(state, do.EndWay(ME)) if state.clients[ME].picking else state


def said(event: str, serial: int, **fields: Any) -> Any:
    """Return an event as the page sends it."""
    return from_page(ME, json.dumps({"event": event, "serial": serial, **fields}))


def typed(state: Any, ask: dict[str, Any], fields: list[Any], again: Any) -> list[str]:
    """Type into each cell of a form, and return what went wrong.

    `ask` holds the fields of the event besides field and entries, and `again(state)` the form.
    """
    found = []
    for f in fields:
        for i, c in enumerate(f["cells"]):
            kind = c.get("kind") or f["kind"]
            options = c.get("options") or f["options"] or ()
            choices = [o[0] if isinstance(o, (tuple, list)) else o for o in options]
            texts = (*choices, "nobody") if kind in ("choice", "names") else (*NUMBERS, *TEXTS)
            for serial, text in enumerate(map(str, texts), 1):
                entries = [[c["index"], text]]
                event = said(**ask, serial=serial, field=f["field"], entries=entries)
                where = f"{f['field']} {c['index']} {text!r}"
                try:
                    problem = judged(state, after(state, event), serial, text, (f, i, kind), again)
                except Exception as error:
                    problem = f"{type(error).__name__}: {error}"
                if problem:
                    found.append(f"{where}: {problem}")
    return found


def judged(old: Any, new: Any, serial: int, text: str, at: Any, again: Any) -> str:
    """Return what is wrong with the state after a text, or ""."""
    reply = new.clients[ME].reply
    if reply is None or reply.serial != serial:
        return "no answer"
    if reply.text:
        assert new.model is old.model
        return "" if " " in reply.text else f"is refused with {reply.text!r}"
    assert pg.Model.from_json(new.model.to_json()) == new.model
    if new.model is not old.model:
        assert after(new, do.Undo(ME)).model == old.model
    f, i, kind = at
    now = next((x for x in again(new) if same(x, f)), None)
    if kind != "number" or now is None or i >= len(now["cells"]):
        return ""
    shows = now["cells"][i]["value"]
    if not isinstance(shows, (int, float, str)):
        return f"shown as {shows!r}"
    if text not in VALUES:
        return ""
    if shows == VALUES[text] or (
        isinstance(shows, float) and shows == pytest.approx(VALUES[text], rel=1e-12)
    ):
        return ""
    return f"taken, and shown as {shows!r}"


def same(one: Any, other: Any) -> bool:
    return key(one) == key(other)


def key(field: Any) -> Any:
    return field["field"], [c["index"] for c in field["cells"]]


def fields_of(groups: list[Any]) -> list[Any]:
    """Return the fields that are typed into. The density of a shape is asked for by a button."""
    return [f for g in groups for f in g["fields"] if f["field"] != "density"]


def some(cases: list[Any], *usual: str) -> list[Any]:
    """Return all cases. Those that `usual` does not name run at night."""
    night = pytest.mark.nightly
    named = {" ".join(case) if isinstance(case, tuple) else case.name: case for case in cases}
    assert set(usual) <= named.keys()
    return [
        pytest.param(
            *(case if isinstance(case, tuple) else (case,)),
            id=name,
            marks=() if name in usual else night,
        )
        for name, case in named.items()
    ]


PARTS = [(part, kind) for part in KINDS if part != "limits" for kind in KINDS[part]]
OFTEN = (
    "forces servo", "forces actuator", "controls pid", "constraints rope", "constraints distance",
    "contacts soft", "sites site",
)  # fmt: skip


@pytest.mark.parametrize(("part", "kind"), some(PARTS, *OFTEN))
def test_every_cell_of_a_part_takes_or_refuses_a_text(part, kind):
    state = with_part(part, kind)
    assert state.clients[ME].opened, notice(state)
    of, name = state.clients[ME].opened

    def again(now: Any) -> list[Any]:
        item = next((x for x in getattr(now.model, of) if x.name == name), None)
        return [] if item is None else fields_of(form(now, Display(), of, item))

    ask = {"event": "EditPart", "part": of, "name": name}
    assert "\n".join(typed(state, ask, again(state), again)) == ""


def test_every_cell_of_the_imperfections_of_a_sensor_takes_or_refuses_a_text():
    noisy = pg.Imperfect(sample=0.01, density=1e-3)
    gyro = pg.Output(name="gyro", kind="gyro", at="2", imperfect=noisy)
    state = begun(scene().add(gyro))

    def again(now: Any) -> list[Any]:
        groups = form(now, Display(), "outputs", now.model.outputs[0])
        return fields_of([g for g in groups if g["title"] == "Imperfections"])

    assert len(again(state)) == len(pg.Imperfect.model_fields)
    ask = {"event": "EditPart", "part": "outputs", "name": "gyro"}
    assert "\n".join(typed(state, ask, again(state), again)) == ""
    typing = said("EditPart", 1, part="outputs", name="gyro", field="imperfect_sample",
                  entries=[[[], ""]])  # fmt: skip
    exact = after(state, typing)
    assert exact.model.outputs[0].imperfect is None
    assert [f["field"] for f in again(exact)] == ["imperfect_sample"]


def test_every_cell_of_the_world_takes_or_refuses_a_text():
    state = begun(scene())

    def again(now: Any) -> list[Any]:
        return fields_of(properties(now, ())["groups"])

    assert "\n".join(typed(state, {"event": "EditWorld"}, again(state), again)) == ""


TRACK = pg.Track(points=[(0, 0, 0), (1, 0, 0.5), (2, 0, 0)])
JOINTED = [
    pg.Body(name=f"of {kind}", joint=kind, **({"track": TRACK} if kind == "curve" else {}))
    for kind in DEFAULT
]
SHAPED = [
    pg.Body(name=f"with {shape['kind']} {k}", shape=shape)
    for k, shape in enumerate(SAMPLES)
    if shape["kind"] != "mesh"
]


@pytest.mark.parametrize(
    "body", some([*JOINTED, *SHAPED], "of compound", "with capsule 6", "with heightfield 8")
)
def test_every_cell_of_a_body_takes_or_refuses_a_text(body):
    model = scene().replace(bodies=(*scene().bodies, body))
    state = after(begun(model), do.Select(ME, body.name))

    def again(now: Any) -> list[Any]:
        return fields_of(properties(now, (now.model.bodies[-1].name,))["groups"])

    ask = {"event": "EditBodies", "bodies": [body.name]}
    assert "\n".join(typed(state, ask, again(state), again)) == ""


def of_scenario(now: Any, part: str, k: int) -> list[Any]:
    """Return the fields of the settings, the start, or a row of the others."""
    rows = scenario(now, Display())[part]
    groups = rows if part in ("form", "start", "active") else rows[k]["form"] if rows[k:] else []
    return fields_of(groups)


@pytest.mark.parametrize(
    ("part", "k", "ask"),
    [
        ("form", 0, {"event": "EditScenario"}),
        ("start", 0, {"event": "EditScenario"}),
        ("active", 0, {"event": "EditScenario"}),
        ("switches", 0, {"event": "EditSwitch", "number": 0}),
        ("drives", 0, {"event": "EditDrive", "name": "servo"}),
        ("drives", 1, {"event": "EditDrive", "name": "motor"}),
    ],
)
def test_every_cell_of_a_scenario_takes_or_refuses_a_text(part, k, ask):
    model = scene().add(pg.Contact(name="floor", body="2"))
    model = model.add(pg.Distance(name="rod", body="2", other_point=(0, 0, 9), active=False))
    state = after(begun(model), do.NewScenario(ME), do.AddSwitch(ME, "rod"))
    state = after(state, *(do.AddDrive(ME, kind, "1") for kind in ("servo", "motor")))
    state = after(state, do.EditScenario(ME, 1, "bodies", (((), "1"),)))
    fields = of_scenario(state, part, k)
    assert fields
    assert "\n".join(typed(state, ask, fields, lambda now: of_scenario(now, part, k))) == ""


def test_every_setting_of_a_run_takes_or_refuses_a_text():
    state = begun(scene())
    for one in settings_form(state.request):
        texts = [value for value, _ in one["options"]] + [*NUMBERS, *TEXTS]
        for serial, text in enumerate(texts, 1):
            new = after(state, said("SetRun", serial, field=one["name"], text=text))
            reply = new.clients[ME].reply
            assert reply is not None
            assert reply.serial == serial, (one["name"], text)
            assert (new.request == state.request) or not reply.text
