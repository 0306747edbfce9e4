"""Background searches: a thread that follows the state and sends events."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import pgraph_core as pg
from pgraph_core.result.columns import columns_of
from pgraph_core.search.data import measured

from ..core.events import Event
from ..run import FREE_RUN
from . import Curves, Found, Search, State
from .known import numbers_of
from .update import FoundNothing, FoundNumbers, Tried, full

REPORT = 0.15  # [s] between progress events
DRAWN = 300  # points of a drawn curve


class Searcher:
    """Runs the state's search in a thread once the kernels are ready, until it is cancelled."""

    def __init__(self, send: Callable[[Event], None]):
        self._send = send
        self._running = 0
        self._cancelled = threading.Event()

    def render(self, old: State, new: State) -> None:
        now = new.search
        if now is None and old.search is not None:
            self._cancelled.set()  # over already, or of a model that was closed
        if now is None or not new.kernels.ready:
            return
        if now.cancelled:
            self._cancelled.set()
        if now.id == self._running:
            return
        self._running, self._cancelled = now.id, threading.Event()
        args = (now, self._cancelled)
        threading.Thread(target=self._run, args=args, name="pgraph-search", daemon=True).start()

    def _run(self, now: Search, cancelled: threading.Event) -> None:
        told, trials = 0.0, 0

        def progress(said: str, run: Any) -> bool:
            nonlocal told, trials
            trials += 1
            if run is not None and time.perf_counter() - told > REPORT:
                told = time.perf_counter()
                self._send(Tried(now.id, trials, said, drawn(now, run)))
            return not cancelled.is_set()

        try:
            self._send(FoundNumbers(now.id, SEARCHES[now.asked.kind](now, progress)))
        except KeyboardInterrupt:
            self._send(FoundNothing(now.id, "The search was cancelled before its first run."))
        except pg.PgraphError as error:
            self._send(FoundNothing(now.id, str(error)))
        except Exception as error:  # said on the page: the session goes on
            self._send(FoundNothing(now.id, f"The search stopped: {type(error).__name__}: {error}"))


Progress = Callable[[str, Any], bool]


def drawn(now: Search, run: Any) -> Curves:
    """Return the curves of a run that the search looks at, thinned for drawing."""
    found, asked = columns_of(run), now.asked
    names = {s for s in asked.match.values() if s} if asked.kind == "fit" else {asked.signal}
    step = -(-len(run.t) // DRAWN)
    return {
        name: (tuple(run.t[::step].tolist()), tuple(found[name].values[::step].tolist()))
        for name in sorted(names) if name in found
    }  # fmt: skip


def settings(now: Search, data: bool = False) -> dict[str, Any]:
    """Return the arguments of `simulate`: the page's method, step and scenario."""
    request = now.request
    scenario = None if request.scenario == FREE_RUN else request.scenario
    given: dict[str, Any] = {"scenario": scenario}
    if scenario is None:
        given |= {"method": request.method, "step": request.step, "rtol": request.rtol}
        given |= {} if data else {"t_end": request.t_end}
    return given


def bounds(now: Search) -> dict[str, tuple[float, float]]:
    return {one.path: (one.low, one.high) for one in now.asked.free}


def fit(now: Search, progress: Progress) -> Found:
    """Fit the free numbers to the data."""
    asked, present = now.asked, numbers_of(now.model)
    data = {signal: asked.data[column] for column, signal in asked.match.items() if signal}
    columns, _ = measured({"t": asked.data["t"], **data})
    found = pg.fit(
        now.model, columns, bounds(now), progress=lambda values, run: progress("", run),
        **settings(now, data=True),
    )  # fmt: skip
    rows = [(path, present[path], x, found.errors[path]) for path, x in found.values.items()]
    noise = [f"{name}: residuals of {size:.2g}" for name, size in found.noise.items()]
    curves = drawn(now, found.run)
    return Found(
        asked,
        now.model,
        f"Fit, {found.message}",
        tuple(rows),
        (*found.undetermined, *noise),
        curves,
    )


def optimise(now: Search, progress: Progress) -> Found:
    """Make the goal least within the limits."""
    asked, present = now.asked, numbers_of(now.model)
    limits = {f"{way} {signal}": (low, high) for way, signal, low, high in asked.limits}
    goal = f"{asked.way} {asked.signal}"
    free = {full(path): pair for path, pair in bounds(now).items()}
    found = pg.optimise(
        now.model, goal, free, subject_to=limits,
        progress=lambda trial, run: progress(f"{goal} = {trial.objective:.4g}", run),
        **settings(now),
    )  # fmt: skip
    rows = [
        (one.path, present[one.path], x, np.nan)
        for one, x in zip(asked.free, found.values.values(), strict=True)
    ]
    title = f"Least {goal}: {found.objective:.4g}, {found.message}"
    return Found(asked, now.model, title, tuple(rows), found.active, drawn(now, found.run))


def matters(now: Search, progress: Progress) -> Found:
    """Find how far each number moves a curve, per relative change of the number."""
    asked, present = now.asked, numbers_of(now.model)
    paths = [full(one.path) for one in asked.free]
    run = pg.simulate(now.model, wrt=paths, estimate=False, **settings(now))
    progress("", run)
    by = run.gradient(lambda run: columns_of(run)[asked.signal].values)
    rows = []
    for one, slope in zip(asked.free, by.values(), strict=True):
        size = abs(present[one.path]) or 1.0
        moved = size * float(np.sqrt(np.nanmean(np.square(slope))))
        rows.append((one.path, present[one.path], present[one.path], moved))
    rows.sort(key=lambda row: -row[3])
    text = "Root mean square change of the curve, for a number that is larger by its own size."
    title = f"What moves {asked.signal}"
    return Found(asked, now.model, title, tuple(rows), (text,), drawn(now, run))


SEARCHES: dict[str, Callable[[Search, Progress], Found]] = {
    "fit": fit, "optimise": optimise, "matters": matters,
}  # fmt: skip
