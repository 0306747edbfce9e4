"""Simulation settings, background runs, live runs and the compiler (pure)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal, TypeVar

import numpy as np

import pgraph_core as pg
from pgraph_core.model.scenario import AUTO, METHOD_NAMES
from pgraph_core.simulation.options import ADAPTIVE

from ..core import cells
from ..core.cells import Refusal
from ..core.events import Event, FromPage, OfServer, Text, TypedText
from ..core.jobs import News, started
from . import FREE_RUN, KeptRun, Kernels, Live, Request, Run, Simulation, State, run_on
from .footfalls import changes, since

LONGEST_RUN = 3600.0  # [s]
LEAST_RTOL, LARGEST_RTOL = 1e-15, 0.1
MOST_FRAMES = 36_000  # limit on the frames of a live run (ten minutes), older ones are dropped
TOGETHER, TWICE = 32, 2  # number of parts joined into one, and levels of joining
MOST_FALLS = 36_000  # and of the changes of feet
MOST_KEPT = 5  # runs beside the present one

S = TypeVar("S", bound=State)

# -- settings ----------------------------------------------------------------------------------


class SetScenario(TypedText):
    scenario: Text

    def taken(self, state: State) -> State:
        """Choose a scenario with its own settings, or a free run with the current settings."""
        name = self.scenario
        scenario = next((s for s in state.model.scenarios if s.name == name), None)
        if scenario is not None:
            asked = Request(name, scenario.t_end, scenario.step, scenario.method)
            state = replace(state, request=asked)
        elif name == FREE_RUN:
            state = replace(state, request=Request())
        return state


class SetRun(TypedText):
    """Change the duration, step, tolerance or method."""

    field: Literal["t_end", "step", "rtol", "method"]
    text: Text

    def taken(self, state: State) -> State:
        changed = {self.field: _value(self.field, self.text)}
        if self.field == "method":  # settings of the other kind of method do not apply
            was, now = (method in ADAPTIVE for method in (state.request.method, self.text))
            changed |= {} if was == now else {"step": None}
            changed |= {} if now or self.text == AUTO else {"rtol": None}
        return replace(state, request=replace(state.request, **changed))


def _value(field: str, text: str) -> float | str | None:
    if field == "method":
        if text not in METHOD_NAMES:
            raise Refusal(f"The method must be one of {', '.join(METHOD_NAMES)}.")
        return text
    if field != "t_end" and not text.strip():
        return None
    name = {"t_end": "The duration", "step": "The step", "rtol": "The tolerance"}[field]
    value = cells.named_number(name, text)
    if field == "rtol":
        if not LEAST_RTOL <= value <= LARGEST_RTOL:
            between = f"between {LEAST_RTOL:g} and {LARGEST_RTOL:g}"
            raise Refusal(f"{name} must lie {between}; given {value:g}.")
    elif not 0 < value <= LONGEST_RUN:
        raise Refusal(f"{name} must be above 0 and at most {LONGEST_RUN:g} s; given {value:g}.")
    return value


# -- runs in the background --------------------------------------------------------------------


def idle(state: State) -> bool:
    """Return True if no simulation is running."""
    return state.job is None and state.going is None


def asked(state: S, before: Any, gait: pg.Gait | None = None) -> S:
    """Start a simulation, optionally from the end of `before` or with another gait."""
    paused = replace(state.playback, playing=False, preview=False)
    state = replace(state, playback=paused)
    return started(state, Simulation, state.request, before, gait, state.framed)


class Cancel(FromPage):
    """Stop the simulation."""

    def applied(self, state: State) -> State:
        if state.job is None:
            return state
        return replace(state, job=None, run_problem="The simulation was cancelled.")


class KeepRun(FromPage):
    """Keep the run under a name to compare it with later ones."""

    def applied(self, state: State) -> State:
        if state.live is not None or (run := state.run) is None:
            return state
        count = max((one.id for one in state.runs), default=0) + 1
        kept = KeptRun(count, f"{run.request.scenario or 'free run'} {count}", run)
        return replace(state, runs=(*state.runs, kept)[-MOST_KEPT:])


class NameRun(TypedText):
    """Rename a kept run."""

    kept: int
    text: Text

    def taken(self, state: State) -> State:
        name = self.text.strip()
        if not name or any(one.name == name and one.id != self.kept for one in state.runs):
            raise Refusal("must be a name that no other kept run has")
        named = [replace(one, name=name) if one.id == self.kept else one for one in state.runs]
        return replace(state, runs=tuple(named))


class DropRun(FromPage):
    """Discard a kept run."""

    kept: int

    def applied(self, state: State) -> State:
        return replace(state, runs=tuple(one for one in state.runs if one.id != self.kept))


class Compiling(Event):
    """Progress report: the compiler has finished `done` of `total` kernels."""

    done: int
    total: int
    name: str

    def applied(self, state: State) -> State:
        return replace(state, kernels=Kernels(self.done, self.total, self.name))


class Compiled(Event):
    problem: str = ""

    def applied(self, state: State) -> State:
        return replace(state, kernels=replace(state.kernels, ready=True, problem=self.problem))


# -- the live run ------------------------------------------------------------------------------


def go_live(state: S, here: bool = False) -> S:
    """Start a live run from the initial state, or from the displayed state if `here`."""
    start = None
    if here and (run := state.run) is not None:
        t = np.asarray(run.result.t)
        k = int(np.abs(t - state.playback.time).argmin())
        start = float(t[k]), np.asarray(run.result.q[k]), np.asarray(run.result.v[k])
    live = Live(state.jobs + 1, state.request, start)
    playback = replace(state.playback, time=start[0] if start else 0.0, playing=False)
    return replace(state, live=live, jobs=live.id, playback=playback, run_problem="")


class GoLiveHere(OfServer):
    """Start a live run at the state of the run that is shown."""

    def applied(self, state: State) -> State:
        return go_live(state, here=True) if idle(state) else state


class Advanced(News):
    """The live run has advanced by one part, at `pace` relative to the requested speed.

    A part that does not fit the run is dropped.
    """

    collapses = True
    part: Any
    pace: float

    def heard(self, state: State, work: Live) -> State:
        part = self.part
        if work.over or tuple(part.mechanism.names) != state.derived.names or not len(part.t):
            return state
        parts, joined = grown(work, part)
        work = replace(
            work,
            parts=parts,
            joined=joined,
            taken=work.taken + 1,
            pace=self.pace,
            falls=(*work.falls, *changes(part, work.falls))[-MOST_FALLS:],
        )
        return at_its_end(state, work) if work.running else replace(state, live=work)


def grown(live: Live, part: Any) -> tuple[tuple[Any, ...], tuple[int, ...]]:
    """Append a part and count how often each was joined. The latest parts are joined in groups."""
    parts, joined = [*live.parts, part], [*live.joined, 0]
    while joined[-1] < TWICE and joined[-TOGETHER:] == [joined[-1]] * TOGETHER:
        parts[-TOGETHER:] = [pg.joined(parts[-TOGETHER:])]
        joined[-TOGETHER:] = [joined[-1] + 1]
    frames = sum(len(one.t) for one in parts)
    while frames - len(parts[0].t) >= MOST_FRAMES:
        frames -= len(parts.pop(0).t)
        joined.pop(0)
    return tuple(parts), tuple(joined)


def at_its_end(state: S, live: Live) -> S:
    """Show the live run at its latest time."""
    time = float(live.parts[-1].t[-1]) if live.parts else 0.0
    return replace(state, live=live, playback=replace(state.playback, time=time))


class Stuck(News):
    """The live run cannot continue."""

    text: str
    fell: float | None = None  # [s]

    def heard(self, state: State, work: Live) -> State:
        how = f"it fell at t = {self.fell:.3g} s" if self.fell is not None else "it could not go on"
        return state if work.over else replace(stopped(state, how), run_problem=self.text)


class StopLive(FromPage):
    """End the live run and keep it."""

    def applied(self, state: State) -> State:
        return stopped(state)


def stopped(state: State, how: str = "stopped by hand") -> State:
    """Stop the live run at once. `joined` follows with the joined parts after a moment."""
    live = state.going
    if live is None:
        return state
    over = replace(live, running=False, over=True, ended=how)
    return replace(state, live=over if live.parts else None)


class Joined(News):
    """The parts of a stopped live run have been joined into a run."""

    run: Run | None
    framed: int = 0  # `State.framed` when it was stopped
    problem: str = ""  # why there is no run

    def heard(self, state: State, work: Live) -> State:
        if self.run is None:
            return replace(state, live=None, run_problem=self.problem)
        run = run_on(self.run, self.run.model, state.model)
        return replace(state, live=None, last_run=run, run_framed=self.framed)


def joined(state: State) -> Joined:
    """Store the run that results from a live run that has just been stopped."""
    live = state.live
    assert live is not None
    walked = tuple(since(live.falls, state.t_start))  # seconds of work after a long run
    run = Run(state.model, live.request, pg.joined(live.parts), walked, live.ended)
    return Joined(live.id, run, state.framed)
