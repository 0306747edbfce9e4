"""Background measurement for reports: a thread that follows the state and sends events."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import pgraph_core as pg

from ..core.events import Event
from ..run import FREE_RUN
from . import Analysis, State
from .update import Measured, Measuring, NotMeasured

REPORT = 0.1  # [s] between progress events
ROUNDS = 3  # rounds of timing, few because a page waits
LONGEST = 0.5  # [s] limit on the computing time of a run
HORIZON = 1.0  # [s] limit on the motion of a map, which makes hundreds of runs


class Analyst:
    """Runs the state's analysis in a thread once the kernels are ready, until it is cancelled."""

    def __init__(self, send: Callable[[Event], None]):
        self._send = send
        self._running = 0
        self._cancelled = threading.Event()

    def render(self, old: State, new: State) -> None:
        now = new.analysis
        if now is None and old.analysis is not None:
            self._cancelled.set()  # over already, or of a model that was closed
        if now is None or not new.kernels.ready:
            return
        if now.cancelled:
            self._cancelled.set()
        if now.id == self._running:
            return
        self._running, self._cancelled = now.id, threading.Event()
        args = (now, self._cancelled)
        threading.Thread(target=self._run, args=args, name="pgraph-report", daemon=True).start()

    def _run(self, now: Analysis, cancelled: threading.Event) -> None:
        said = 0.0

        def progress(fraction: float) -> bool:
            nonlocal said
            if time.perf_counter() - said > REPORT:
                said = time.perf_counter()
                self._send(Measuring(now.id, float(fraction)))
            return not cancelled.is_set()

        try:
            self._send(Measured(now.id, MEASURES[now.kind](now, progress)))
        except pg.PgraphError as error:
            self._send(NotMeasured(now.id, str(error)))
        except Exception as error:  # said on the page: the session goes on
            self._send(NotMeasured(now.id, f"The report stopped: {type(error).__name__}: {error}"))


def settings(now: Analysis) -> dict[str, Any]:
    """Scenario and duration."""
    scenario = None if now.request.scenario == FREE_RUN else now.request.scenario
    duration = now.reporting.t_end or now.request.t_end
    return {"scenario": scenario, "t_end": duration, "target": now.reporting.target}


def precision(now: Analysis, progress: Callable[[float], bool]) -> object:
    """Measure error versus run time for all suitable methods."""
    mech = pg.Mechanism(now.model)
    return pg.work_precision(
        mech, rounds=ROUNDS, longest=LONGEST, progress=progress, **settings(now)
    )


def stability(now: Analysis, progress: Callable[[float], bool]) -> object:
    """Test the stability of the methods over the first part of the run."""
    given = settings(now)
    given["t_end"] = now.reporting.t_end or min(given["t_end"], HORIZON)
    return pg.stability_map(now.model, axis=now.reporting.axis or None, progress=progress, **given)


MEASURES = {"precision": precision, "stability": stability}
