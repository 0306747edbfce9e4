"""Events that a page may send, every field at random: never an exception, never a bad state."""

from __future__ import annotations

import json
import os
import random
import traceback
from collections import Counter

import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_app.core.events import Misread, from_page, page_events
from pgraph_app.core.state import State, initial
from pgraph_app.features import update
from pgraph_app.session.update import Connected

EXPLORE = bool(os.environ.get("PGRAPH_EXPLORE"))
ME = 1
TEXTS = [
    "", "0", "1", "-1", "2.5", "1e308", "-1e308", "1e-320", "1e400", "nan", "inf", "1/0", "0/0",
    "9" * 400, "2 t", "=l", "x", "ground", "<b>&", "\x00", "🦿", "__proto__", "a\tb\n1\t2",
    "a" * 3000,
    "..", "/dev/null", "friction", "slope", "box", "sphere", "hinge", "[1, 2]", "{}", "true",
    "rotate", "translate", "1 2 3", "1,2,3", "45 deg", "90", "99999 deg",
]  # fmt: skip
NUMBERS = [0, 1, -1, 2, 0.5, 1e308, -1e308, 1e-320, 12, 1000, 3.7, 1e17]


def texts_of(state: State) -> list[str]:
    """Names and kinds that mean something in this model, and hostile ones."""
    model = state.model
    parts = (model.bodies, model.constraints, model.contacts, model.forces, model.scenarios)
    return [
        *TEXTS,
        *(part.name for some in parts for part in some),
        *pg.Body.model_fields,
    ]


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
    fields["seen"] = state.renamed
    return json.dumps({"event": name, **fields})


def faults(model: pg.Model, seed: int, events: int) -> Counter:
    """The last lines of the exceptions that random events raise, with how often."""
    rng, found = random.Random(seed), Counter()
    gallery = {
        name: pgraph_models.path(name).read_text("utf-8") for name in ("pendulum", "four_bar")
    }
    start = update(initial(model, gallery), Connected(ME))
    state, read = start, 0
    for _ in range(events):
        text = message(rng, state)
        event = from_page(ME, text)
        read += not isinstance(event, Misread)
        try:
            state = update(state, event)
            assert pg.Model.from_json(state.model.to_json()) == state.model
        except Exception:
            lines = traceback.format_exc().splitlines()
            found[f"{text[:300]} -> {lines[-1][:200]} at {lines[-3:-2]}"] += 1
            state = start
        if len(state.model.bodies) > 60:
            state = start
    assert read > 0.8 * events  # else it tries nothing
    return found


CAUGHT = {
    "a switch that waits for what there is not": [
        {"event": "NewScenario"},
        {"event": "AddSwitch", "constraint": None},
        {"event": "EditSwitch", "serial": 1, "number": 0, "field": "what", "text": "rest"},
    ],
    "a name to watch for a switch that waits for a time": [
        {"event": "NewScenario"},
        {"event": "AddSwitch", "constraint": None},
        {"event": "EditSwitch", "serial": 1, "number": 0, "field": "watched", "text": "inertia"},
    ],
    "an initial value without its row": [
        {"event": "NewScenario"},
        {"event": "EditScenario", "serial": 1, "field": "q", "entries": [[[0], "5"]]},
    ],
    "a sixth number of a ground step": [
        {"event": "EditWorld", "serial": 1, "field": "steps", "entries": [[[], ""]]},
        {"event": "EditWorld", "serial": 2, "field": "steps", "entries": [[[0, 10], "1"]]},
    ],
    "a motion without its number": [
        {
            "event": "Check",
            "serial": 0,
            "bodies": ["3"],
            "field": "motions",
            "entries": [[[], "x"]],
        },
    ],
    "a grip on a body of a model that reaches too far": [
        {"event": "Edit", "serial": 1, "body": "8", "field": "link", "index": [0], "text": "1e308"},
        {"event": "Edit", "serial": 1, "body": "9", "field": "link", "index": [0], "text": "1e308"},
        {"event": "SetGizmo", "what": "com"},
        {"event": "Gripped", "body": "8", "what": "com", "vector": [1, 1, 0], "done": True},
    ],
}


@pytest.mark.parametrize("what", CAUGHT)
def test_what_was_caught_stays_mended(what):
    model = pg.Model.serial(12)
    rod = pg.Distance(name="rod", body="12", point=(0, 0, 0), other_point=(0, 0, 0), length=5.0)
    model = model.add(rod)
    state = update(initial(model), Connected(ME))
    for fields in CAUGHT[what]:
        event = from_page(ME, json.dumps(fields))
        assert not isinstance(event, Misread), event
        state = update(state, event)


@pytest.mark.parametrize("name", ["quadruped_hips", "four_bar", "rolling_disc"])
def test_no_event_raises(name):
    model = pg.Model.load(pgraph_models.path(name))
    seed = random.SystemRandom().randrange(10**9) if EXPLORE else 1
    assert faults(model, seed, 20_000 if EXPLORE else 600) == {}, seed
