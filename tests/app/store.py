"""The state of the page in tests without a browser: events sent to it, and helpers to read it."""

import io
import time
import zipfile
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import strategies as st

import pgraph_core as pg
import pgraph_models
from pgraph_app.core.events import Event, kinds
from pgraph_app.features import initial, places, update
from pgraph_app.model.apart import answer
from pgraph_app.run import Kernels

ME, OTHER = 1, 2
LIMIT = 120.0  # [s] for a state that must come; only reached when something is broken
places()  # a page sees only views that have a place on it
do: Any = SimpleNamespace(**{kind.__name__: kind for kind in kinds()})  # all events, by name


def begun(model: pg.Model, *clients: int, compiled: bool = True, **fields: Any) -> Any:
    """Return the state of a model that these pages (one: ME) look at."""
    state = replace(initial(model, **fields), kernels=Kernels(ready=compiled))
    return after(state, *(do.Connected(client) for client in clients or (ME,)))


def after(state: Any, *happened: Event) -> Any:
    """Return the state after these events."""
    for event in happened:
        state = update(state, event)
    return state


def answered(state: Any, *happened: Event) -> Any:
    """Return the state after these events, each with its errands done."""
    for event in happened:
        state = update(state, event)
        for errand in state.errands:
            state = update(state, answer(errand))
    return state


def ran(state: Any, result: Any) -> Any:
    """Return the state after a simulation with this result."""
    asked = update(state, do.Simulate(ME))
    return update(asked, do.Done(asked.job.id, result))


def reply(state: Any, client: int = ME) -> str:
    """Return the text next to the cell that the page typed into, or ""."""
    return state.clients[client].reply.text


def notice(state: Any, client: int = ME) -> str:
    """Return the title and text of the page's notice, or ""."""
    shown = state.clients[client].notice
    return f"{shown.title}: {shown.text}" if shown else ""


@cache
def built_in(name: str) -> pg.Model:
    """Return a model of the gallery."""
    return pg.Model.load(pgraph_models.path(name))


def until(true: Callable[[], Any], what: str, seconds: float = LIMIT) -> Any:
    """Wait for a truthy value and return it. Fail with a description of the missing value."""
    begin = time.monotonic()
    while not (value := true()):
        if (waited := time.monotonic() - begin) > seconds:
            pytest.fail(f"after {seconds:g} s still not: {what}")
        time.sleep(min(0.01 + 0.1 * waited, 0.1))  # a look at a page costs as much as a picture
    return value


@st.composite
def trees(draw: Any, most: int = 60, near: int | None = None) -> tuple[int, ...]:
    """Parents by number: a forest of 1..most bodies, children `near` their parents."""
    n = draw(st.integers(1, most))
    chosen = [draw(st.integers(0 if near is None else max(0, k - near), k)) for k in range(n)]
    return tuple(chosen)


def seven() -> pg.Model:
    """Return the seven bodies of fig. 1."""
    return pg.Model.serial(7).edit("4", parent="2").edit("5", parent="3").edit("6", parent="2")


def zipped(*files: tuple[str, bytes]) -> bytes:
    """Return a zip archive of these files."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as made:
        for name, data in files:
            made.writestr(name, data)
    return content.getvalue()
