"""The cost of one edit on the page: `python -m benchmarks.editing`.

Server: from the event to the messages for two pages; then processor time with all views of two
pages, the 3D view's included. With --page also in a real browser: from Enter to the value in the
table, digraph, properties and the 3D view of two pages (`visible.py`).
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable
from typing import Any

import pgraph_core as pg
import pgraph_models
from benchmarks.machine import machine
from pgraph_app.core.events import Event
from pgraph_app.core.state import State, initial
from pgraph_app.digraph.view import digraph
from pgraph_app.features import update
from pgraph_app.model.derived import derive
from pgraph_app.model.update import Edit, Undo
from pgraph_app.properties.view import properties
from pgraph_app.scene.update import Viewport
from pgraph_app.server import serve
from pgraph_app.session.update import Connected
from pgraph_app.table.update import Duplicate
from pgraph_app.table.view import table

SIZES = (16, 999)  # the table holds 1000, and one edit adds a body
PAGES = (1, 2)


def model_of(n: int) -> pg.Model:
    return pg.Model.load(pgraph_models.path("quadruped")) if n == 16 else pg.Model.serial(n)


def median(act: Callable[[int], object], repeats: int = 15) -> float:
    """Milliseconds of `act(k)`, the first call left out."""
    times = []
    for k in range(repeats + 1):
        start = time.perf_counter()
        act(k)
        times.append(time.perf_counter() - start)
    return 1e3 * statistics.median(times[1:])


def payloads(state: State) -> int:
    """All that an edit sends to one page, as JSON; its length."""
    shown = (table(state), digraph(state), properties(state, (state.model.bodies[0].name,)))
    return sum(len(json.dumps(part)) for part in shown)


def edits(n: int) -> dict[str, Callable[[int], Event]]:
    """A kind of edit each, different at every call."""
    model = model_of(n)
    middle, last = model.bodies[n // 2].name, model.bodies[-1].name

    def typed(body: str, field: Any, text: Callable[[int], str]) -> Callable[[int], Event]:
        return lambda k: Edit(1, k, body, field, (), text(k))

    return {
        "mass": typed(middle, "mass", lambda k: str(1 + 1e-3 * (k + 1))),
        "name": typed(middle, "name", lambda k: f"body_{k}"),
        "parent": typed(last, "parent", lambda k: model.bodies[k % (n // 2)].name),
        "dof": typed(middle, "dof", lambda k: "23"[k % 2]),
        "duplicate": lambda k: Duplicate(1, (last,), True),
    }


def server(n: int) -> dict[str, float]:
    """Milliseconds for each kind of edit: the new state, and the messages to two pages."""
    state = initial(model_of(n))
    for client in PAGES:
        state = update(state, Connected(client))
    found = {
        name: median(lambda k, make=make: payloads(update(state, make(k))))
        for name, make in edits(n).items()
    }
    return {"derive": median(lambda k: derive(state.model)), **found}


def drawn(n: int, repeats: int = 15) -> dict[str, float]:
    """Processor milliseconds for each kind of edit with all views of two pages; the least."""
    served = serve(model_of(n), port=0, open_browser=False)
    store, found = served.store, {}
    store.stop()  # events are applied here, not in its thread
    for client in PAGES:
        store._apply(Connected(client))
        store._apply(Viewport(client, 0.6, 1280.0, 0.0, False))
    for name, make in edits(n).items():
        times = []
        for k in range(repeats):
            start = time.thread_time()
            store._apply(make(k))
            times.append(time.thread_time() - start)
            store._apply(Undo(PAGES[0]))
        found[name] = 1e3 * min(times)
    served.stop()
    return found


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--page", action="store_true", help="in a browser too")
    options.add_argument("--rounds", type=int, default=7, help="edits of a kind in the browser")
    given = options.parse_args()
    print(f"{machine()}\nmilliseconds on the server, medians\n")
    for n in SIZES:
        said = "  ".join(f"{name} {ms:.2f}" for name, ms in server(n).items())
        print(f"{n:5} bodies: {said}")
    print("\nprocessor milliseconds with all views of two pages, the least of 15\n")
    for n in SIZES:
        said = "  ".join(f"{name} {ms:.1f}" for name, ms in drawn(n).items())
        print(f"{n:5} bodies: {said}", flush=True)
    if given.page:
        from .visible import VIEWPORT, measured

        print("\nmilliseconds in Chromium with SwiftShader: medians [quartiles]\n")
        for n in SIZES:
            for line in measured(n, model_of(n), VIEWPORT, given.rounds):
                print(line, flush=True)


if __name__ == "__main__":
    main()
