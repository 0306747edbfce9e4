"""What the events do to named parameters and the formulas that use them (pure)."""

from __future__ import annotations

import re

import pgraph_core as pg
from pgraph_core.model.parameters import evaluated, names_in

from ..core import cells
from ..core.cells import Refusal
from ..core.state import State
from ..events import Event
from ..model.answering import answered, attempted
from . import events as asked


def update(state: State, event: Event) -> State | None:
    """The state after an event of the parameters; None for any other event."""
    model = state.model
    match event:
        case asked.EditParameter(client, serial, name, text):
            make = lambda: parameter_set(model, name.strip(), text)  # noqa: E731
            return answered(state, client, serial, make, f"parameter {name.strip()}")
        case asked.RenameParameter(client, serial, name, text):
            make = lambda: parameter_renamed(model, name, text.strip())  # noqa: E731
            return answered(state, client, serial, make, f"name of parameter {name}")
        case asked.DeleteParameter(client, name):
            label = f"delete parameter {name}"
            return attempted(state, client, lambda: parameter_removed(model, name), label)
    return None


def parameter_set(model: pg.Model, name: str, text: str) -> pg.Model:
    """The model with a parameter's value, which may be a sum of others. Raises Refusal."""
    others = {key: x for key, x in model.parameters.items() if key != name}
    try:
        formula = text.lstrip().startswith("=")
        value = evaluated(text, others) if formula else cells.number(text)
    except ValueError as problem:
        raise Refusal(f"parameter '{name}': {problem}") from None
    return model.replace(parameters={**model.parameters, name: value})


def parameter_renamed(model: pg.Model, old: str, new: str) -> pg.Model:
    """The model with a parameter's other name in every formula. Raises Refusal, PgraphError."""
    if new in model.parameters and new != old:
        raise Refusal(f"another parameter is named '{new}'; choose another name")
    if not new or not new.isidentifier():
        raise Refusal(f"a parameter's name is one word of letters, digits and _; given {new!r}")
    renamed = {new if key == old else key: x for key, x in model.parameters.items()}
    word = re.compile(rf"\b{re.escape(old)}\b")
    formulas = tuple(
        f.model_copy(update={"text": word.sub(new, f.text)}) if old in names_in(f.text) else f
        for f in model.formulas
    )
    return model.replace(parameters=renamed, formulas=formulas)


def parameter_removed(model: pg.Model, name: str) -> pg.Model:
    """The model without a parameter; cells that used it keep their numbers."""
    left = {key: x for key, x in model.parameters.items() if key != name}
    formulas = tuple(f for f in model.formulas if name not in names_in(f.text))
    return model.replace(parameters=left, formulas=formulas)
