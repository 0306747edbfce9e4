"""A fuzz test of page events: no exception, no invalid state, and an answer to each serial."""

import json
import os
import random
import traceback
from collections import Counter

import pytest

import pgraph_core as pg
from pgraph_app.core.events import FromPage, from_page, page_events
from pgraph_app.features import State

from .store import ME, after, begun, built_in, do

EXPLORE = bool(os.environ.get("PGRAPH_EXPLORE"))
TEXTS = [
    "", "0", "1", "-1", "2.5", "1e308", "-1e308", "1e-320", "1e400", "nan", "inf", "1/0", "0/0",
    "9" * 400, "2 t", "=l", "x", "ground", "<b>&", "\x00", "🦿", "__proto__", "a\tb\n1\t2",
    "a" * 3000, "..", "friction", "slope", "box", "hinge", "[1, 2]", "{}", "true", "rotate",
    "1 2 3", "1,2,3", "45 deg", "90", "99999 deg",
]  # fmt: skip
NUMBERS = [0, 1, -1, 2, 0.5, 1e308, -1e308, 1e-320, 12, 1000, 3.7, 1e17]


def texts_of(state: State) -> list[str]:
    """Names and kinds that mean something in this model, and hostile ones."""
    model = state.model
    parts = (model.bodies, model.constraints, model.contacts, model.forces, model.scenarios)
    return [*TEXTS, *(part.name for some in parts for part in some), *pg.Body.model_fields]


def value(rng: random.Random, schema: dict, whole: dict, texts: list[str]):
    """Something that fits a JSON schema, as far as types go."""
    if "$ref" in schema:
        return value(rng, whole["$defs"][schema["$ref"].split("/")[-1]], whole, texts)
    if "anyOf" in schema:
        return value(rng, rng.choice(schema["anyOf"]), whole, texts)
    if "enum" in schema:
        return rng.choice(schema["enum"])
    if "const" in schema:
        return schema["const"]
    match schema.get("type"):
        case "string":
            return rng.choice(texts)[: schema.get("maxLength", 10**6)]
        case "integer":
            low, high = schema.get("minimum", -(10**6)), schema.get("maximum", 10**6)
            return min(max(rng.choice([0, 1, 2, 3, -1, 10, rng.randint(low, high)]), low), high)
        case "number":
            low, high = schema.get("minimum", -1e308), schema.get("maximum", 1e308)
            return min(max(rng.choice(NUMBERS), low), high)
        case "boolean":
            return rng.random() < 0.5
        case "null":
            return None
        case "array":
            if "prefixItems" in schema:
                return [value(rng, one, whole, texts) for one in schema["prefixItems"]]
            few = rng.randint(schema.get("minItems", 0), min(schema.get("maxItems", 3), 4))
            return [value(rng, schema.get("items", {}), whole, texts) for _ in range(few)]
        case "object":
            fields = schema.get("properties", {})
            return {name: value(rng, one, whole, texts) for name, one in fields.items()}
    return rng.choice(texts)


def message(rng: random.Random, state: State) -> str:
    name = rng.choice(list(page_events()))
    schema = page_events()[name].json_schema()
    fields = value(rng, schema, schema, texts_of(state))
    del fields["client"]
    fields["seen"] = state.version
    return json.dumps({"event": name, **fields})


def answered(state: State, event: FromPage) -> bool:
    """Check whether the page has the answer to an event with a serial, or it is being written."""
    page = state.clients[ME]
    given = [one.serial for one in (page.reply, page.hint, state.saving) if one is not None]
    return event.serial in given


def faults(model: pg.Model, seed: int, events: int) -> Counter:
    """The last lines of the exceptions that random events raise, with how often."""
    rng, found = random.Random(seed), Counter()
    gallery = {name: built_in(name).to_json() for name in ("pendulum", "four_bar")}
    start = begun(model, gallery=gallery)
    state, read = start, 0
    for _ in range(events):
        text = message(rng, state)
        event = from_page(ME, text)
        read += not isinstance(event, do.Misread)
        try:
            state = after(state, event)
            assert pg.Model.from_json(state.model.to_json()) == state.model
            assert getattr(event, "serial", 0) <= 0 or answered(state, event), "no answer"
        except Exception:
            lines = traceback.format_exc().splitlines()
            found[f"{text[:300]} -> {lines[-1][:200]} at {lines[-3:-2]}"] += 1
            state = start
        if len(state.model.bodies) > 60:
            state = start
    assert read > 0.8 * events  # else it tries nothing
    return found


def switched(field: str, text: str):
    return do.EditSwitch(ME, 1, 0, field, (((), text),))


NEW = do.NewScenario(ME), do.AddSwitch(ME, None)
CAUGHT = {
    "a switch that waits for what there is not": [
        *NEW,
        do.EditSwitch(ME, 1, 0, "what", (((), "rest"),)),
    ],
    "a name for a switch that waits for a time": [
        *NEW,
        do.EditSwitch(ME, 1, 0, "watched", (((), "a"),)),
    ],
    "an initial value without its row": [NEW[0], do.EditScenario(ME, 1, "q", (((0,), "5"),))],
    "a sixth number of a ground step": [
        do.EditWorld(ME, 1, "steps", (((), ""),)),
        do.EditWorld(ME, 2, "steps", (((0, 10), "1"),)),
    ],
    "a motion without its number": [do.Check(ME, 0, ("3",), "motions", (((), "x"),))],
    "a grip on a body of a model that reaches too far": [
        do.EditBodies(ME, 1, ("8",), "link", (((0,), "1e308"),)),
        do.EditBodies(ME, 1, ("9",), "link", (((0,), "1e308"),)),
        do.SetGizmo(ME, "com"),
        do.Gripped(ME, "8", "com", (1, 1, 0), True),
    ],
}


@pytest.mark.parametrize("what", CAUGHT)
def test_what_a_fuzz_test_found_stays_fixed(what):
    rod = pg.Distance(name="rod", body="12", point=(0, 0, 0), other_point=(0, 0, 0), length=5.0)
    state = after(begun(pg.Model.serial(12).add(rod)), *CAUGHT[what])
    assert pg.Model.from_json(state.model.to_json()) == state.model
    assert len(state.model.bodies) == 12


@pytest.mark.parametrize("name", ["quadruped_hips", "four_bar", "rolling_disc"])
def test_no_event_raises(name):
    seed = random.SystemRandom().randrange(10**9) if EXPLORE else 1
    assert faults(built_in(name), seed, 20_000 if EXPLORE else 100) == {}, seed
