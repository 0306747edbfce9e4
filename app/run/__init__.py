"""Simulation on the page: request, progress and result of a run."""

from __future__ import annotations

import bisect
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self, TypeVar

import numpy as np

import pgraph_core as pg
from pgraph_core.fields import about
from pgraph_core.model.settings import ADAPTIVE, AUTO, OF, Settings

from ..core import cells, state
from ..core.cells import Refusal
from ..core.events import Event, FromPage, OfServer, Text, TypedText
from ..core.jobs import Job, News, Report, Work, cancelled, started
from ..core.state import Client as Client
from ..core.state import Names
from .footfalls import Change, changes, since
from .runs import FREE_RUN, Request, Run, first_request


@dataclass(frozen=True)
class Simulation(Job):
    """A simulation in progress."""

    NAME, FIELD, PROBLEM = "simulation", "job", "run_problem"
    request: Request
    before: Any = None  # the result that this one goes on from
    gait: pg.Gait | None = None  # replaces the gait of its scenario
    framed: int = 0  # `State.framed` at the request

    def work(self, progress: Report) -> Any:
        """Return the run, joined to the one before it."""
        before, start, state = self.before, 0.0, (None, None)
        if before is not None:
            start, state = float(before.t[-1]), (before.q[-1], before.v[-1])
        mech = pg.Mechanism(self.model)
        run = pg.simulate(
            mech,
            *state,
            t_start=start,
            t_end=start + self.request.t_end,
            tau=None if self.gait is None else pg.Controller(mech, self.gait),
            progress=progress,
            **self.request.options(self.model),
            **self.request.recorded,
        )
        return run if before is None or len(run.t) == 0 else pg.joined((before, run))

    def ended(self, state: State, result: Any) -> State:
        """Show the run of a simulation."""
        if not len(result.t):  # nothing to play or to keep
            why = result.message or result.status.value
            return replace(state, run_problem=f"There is no run to show: {why}.")
        start = 0.0 if self.before is None else float(self.before.t[-1])
        plays = self.model is state.model and len(result.t) > 1
        unseen = not any(page.aspect for page in state.clients.values())
        stale = "The model was changed during the simulation; undo shows that run."
        playback = replace(state.playback, time=start, playing=False, preview=plays, unseen=unseen)
        return replace(
            state,
            live=None,
            last_run=Run(self.model, self.request, result, gait=self.gait),
            run_framed=self.framed,
            playback=playback,
            run_problem="" if self.model is state.model else stale,
        )


@dataclass(frozen=True)
class KeptRun:
    """A named earlier run that is shown together with the current one."""

    id: int
    name: str
    run: Run


@dataclass(frozen=True)
class Live(Work):
    """A live run, which plays while it is computed and follows edits of the model."""

    FIELD = "live"
    request: Request
    start: tuple[float, np.ndarray, np.ndarray] | None = None  # (t, q, v); None: the scenario's
    running: bool = True
    parts: tuple[Any, ...] = ()  # consecutive results, of which old ones are joined
    joined: tuple[int, ...] = ()  # number of joins in each part
    taken: int = 0  # parts so far
    pace: float = 1.0  # its speed over the one asked for
    falls: tuple[Change, ...] = ()  # changes of its feet
    over: bool = False  # stopped: its parts are shown until they are joined
    ended: str = ""  # description of the end

    def part_at(self, time: float) -> Any:
        """Return the part that contains `time`, or the last one."""
        k = bisect.bisect_left(self.parts, time, key=lambda part: part.t[-1])
        return self.parts[min(k, len(self.parts) - 1)]


@dataclass(frozen=True)
class Kernels:
    """Progress of the compilation: `done` of `total` kernels, with `name` in progress."""

    done: int = 0
    total: int = 0
    name: str = ""
    ready: bool = False
    problem: str = ""


@dataclass(frozen=True)
class Playback:
    """The displayed moment of a run, and how it moves on."""

    time: float = 0.0  # [s]
    playing: bool = False
    preview: bool = False  # True while a new run is shown once, until a person takes over
    unseen: bool = False  # the preview waits at its beginning for the first page that has a 3D view
    speed: float = 1.0
    loop: bool = True
    held: bool = False  # a person holds the slider

    @property
    def moves(self) -> bool:
        """True if time is advancing."""
        return self.playing or (self.preview and not self.unseen)

    @property
    def rests(self) -> bool:
        """True if one moment is shown, and not a motion."""
        return not (self.moves or self.held)


@dataclass(frozen=True)
class State(state.State):
    """Running, kept and displayed runs."""

    request: Request = field(default_factory=Request)
    last_run: Run | None = None
    run_framed: int = 0  # `framed` when it was made
    job: Simulation | None = None
    live: Live | None = None
    runs: tuple[KeptRun, ...] = ()  # earlier ones, shown together with this one
    run_problem: str = ""  # why the last job gave no result
    kernels: Kernels = field(default_factory=Kernels)
    playback: Playback = field(default_factory=Playback)

    def opened(self, before: Any) -> Self:
        at_start = replace(self.playback, time=0.0, playing=False, preview=False)
        return replace(
            super().opened(before),
            last_run=before.last_run,  # not of this model, even if it is the same once more
            playback=self.playback if self.live else at_start,
            request=first_request(self.model),
            run_problem="",
            runs=(),
        )

    def followed(self, before: Any, names: Names) -> Self:
        old, new, request = before.model, self.model, self.request
        if all(s.name != request.scenario for s in new.scenarios):
            request = request.unchecked_copy({"scenario": FREE_RUN})
        stays = self.live or (before.run is not None and same_motion(old, new))
        at_start = replace(self.playback, time=0.0, playing=False, preview=False)
        return replace(
            super().followed(before, names),
            last_run=self.last_run and run_on(self.last_run, old, new),
            live=self.live and _live_on(self.live, old, new),
            request=request,
            playback=self.playback if stays else at_start,
        )

    @property
    def going(self) -> Live | None:
        """The live run, or None if it was stopped."""
        return None if self.live is None or self.live.over else self.live

    @property
    def run(self) -> Run | None:
        """The run to play: the live run's part at this time, or the last run of this model."""
        if self.live is not None:
            live = self.live
            part = live.part_at(self.playback.time) if live.parts else None
            return None if part is None else Run(self.model, live.request, part)
        run = self.last_run
        return run if run is not None and run.model is self.model else None

    @property
    def earlier(self) -> Run | None:
        """The last run if the model was edited since, or None if another model was opened."""
        last = self.last_run
        gone = last is None or self.live is not None or self.run is not None
        return None if gone or self.run_framed != self.framed else last

    @property
    def set_gait(self) -> pg.Gait | None:
        """The gait set on the page, which replaces the gait of the scenario, or None."""
        return None

    @property
    def outdated(self) -> str:
        """Why Play computes another run than the last one, or "" if it plays that one."""
        if self.earlier is not None:
            return "The model was edited since this run"
        run = None if self.live is not None else self.run
        asked = self.request, self.set_gait
        if run is None or ((run.request, run.gait) == asked and not run.ended):
            return ""
        return "This is a live run" if run.ended else "The settings of the run were changed"

    @property
    def whole(self) -> pg.Model:
        run = self.run
        return super().whole if run is None else run.whole

    @property
    def plotted(self) -> Run | None:
        """The run used for plots, which is the current run or the run before the last edits."""
        return self.run or self.earlier

    @property
    def falls(self) -> tuple[Change, ...]:
        """The foot phase changes in the run to play."""
        if self.live is not None:
            return self.live.falls
        return self.run.falls if self.run is not None else ()

    @property
    def t_end(self) -> float:
        """The end time of the run to play [s], or 0 if there is none."""
        if self.live is not None:
            return float(self.live.parts[-1].t[-1]) if self.live.parts else 0.0
        return float(self.run.result.t[-1]) if self.run is not None else 0.0

    @property
    def t_start(self) -> float:
        """The start time of the run to play [s]."""
        if self.live is not None:
            return float(self.live.parts[0].t[0]) if self.live.parts else 0.0
        return float(self.run.result.t[0]) if self.run is not None else 0.0

    @property
    def instead(self) -> str:
        """The name of the trial that is played in place of a run, or ""."""
        return ""

    @property
    def travels(self) -> np.ndarray:
        """An array (3,) with 1 for each axis along which the played motion travels, else 0."""
        return np.zeros(3) if self.run is None else self.run.travels

    @property
    def instants(self) -> Sequence[float]:
        """The recorded times of the run to play [s]."""
        if self.live is not None:
            return sorted({float(t) for part in self.live.parts for t in part.t})
        return () if self.run is None else np.asarray(self.run.result.t).tolist()

    @property
    def moves(self) -> bool:
        return self.playback.moves

    def ticked(self, dt: float) -> Self:
        playback, start, end = self.playback, self.t_start, self.t_end
        if not playback.moves or end <= start:
            return self
        time = playback.time + dt * playback.speed
        if playback.preview:
            shown = replace(playback, time=min(time, end), preview=time < end)
        elif time < end:
            shown = replace(playback, time=time)
        else:
            again = start + (time - end) % (end - start) if playback.loop else end
            shown = replace(playback, time=again, playing=playback.loop)
        return replace(self, playback=shown)

    @property
    def ready(self) -> bool:
        return self.kernels.ready

    @property
    def scenario(self) -> str:
        return self.request.scenario


# -- runs that an edit leaves valid ----------------------------------------------------------------


def run_on(run: Run, old: pg.Model, new: pg.Model) -> Run:
    """Carry a run over to the new model if an edit changed only names or appearance."""
    return moved(run, new) if run.model is old and same_motion(old, new) else run


def moved(run: Run, new: pg.Model) -> Run:
    """Return a run as one of another model with the same motion."""
    result = run.result
    if hasattr(result, "mechanism"):
        result = replace(result, mechanism=pg.Mechanism(new))
    return replace(run, model=new, result=result)


def same_motion(old: pg.Model, new: pg.Model) -> bool:
    """Check whether two models have the same motion, ignoring body names and visual shapes."""
    if old is new:
        return True
    if len(old.bodies) != len(new.bodies):
        return False
    alike = old
    for a, b in zip(old.bodies, new.bodies):
        if a is not b and a.name != b.name:
            if b.name in alike.row:
                return False
            alike = alike.edit(a.name, name=b.name)
    others = [field for field in pg.Model.model_fields if field not in ("bodies", "name")]
    return all(getattr(alike, field) == getattr(new, field) for field in others) and all(
        a is b or _bare(a) == _bare(b) for a, b in zip(alike.bodies, new.bodies)
    )


def _bare(body: pg.Body) -> pg.Body:
    """Return a body without its purely visual parts."""
    touching = tuple(s.unchecked_copy({"role": "collision", "colour": None}) for s in body.touching)
    return body.unchecked_copy({"shapes": touching})


def _live_on(live: Live, old: pg.Model, new: pg.Model) -> Live:
    """Continue the live run after an edit of the model, or restart it if the joints have
    changed."""

    def joints(model: pg.Model) -> list[tuple[str, str, int]]:
        return [(body.name, body.parent, len(body.q)) for body in model.bodies]

    return live if joints(old) == joints(new) else replace(live, parts=(), joined=(), falls=())


# -- simulation settings, background runs, live runs and the compiler (pure) -----------------------


MOST_FRAMES = 36_000  # limit on the frames of a live run (ten minutes), older ones are dropped
TOGETHER, TWICE = 32, 2  # number of parts joined into one, and levels of joining
MOST_FALLS = 36_000  # and of the changes of feet
KEPT_RUNS = 5  # runs beside the present one

S = TypeVar("S", bound=State)

# -- settings ----------------------------------------------------------------------------------


class SetScenario(TypedText):
    scenario: Text

    def taken(self, state: State) -> State:
        """Choose a scenario with its own settings, or a free run with the current settings."""
        name = self.scenario
        scenario = next((s for s in state.model.scenarios if s.name == name), None)
        if scenario is not None:
            state = replace(state, request=Request.of(scenario))
        elif name == FREE_RUN:
            state = replace(state, request=Request())
        return state


class SetRun(TypedText):
    """Change a setting of the run."""

    field: Text
    text: Text

    def taken(self, state: State) -> State:
        changed = {self.field: typed(state.request, self.field, self.text)}
        if self.field == "method":  # settings of the other kind of method do not apply
            was, now = (method in ADAPTIVE for method in (state.request.method, self.text))
            changed |= {} if was == now else {"step": None}
            changed |= {} if now or self.text == AUTO else {"rtol": None}
        return replace(state, request=state.request.unchecked_copy(changed))


def typed(request: Request, name: str, text: str) -> Any:
    """Return the value of a setting typed on the page, None for an empty text. Raises Refusal."""
    known = about(OF[name], name).label.lower() if name in OF else ""
    if not known:
        raise Refusal("no run has this setting")
    value: str | float | None = text.strip() or None
    if value and name not in Settings.CHOICES:
        value = cells.named_number(f"The {known}", text)
        value = int(value) if value.is_integer() else value
    try:
        return getattr(request.model_copy(update={name: value}), name)
    except pg.ModelError as error:
        raise Refusal(f"The {known}: {error.problems[0].text}.") from None


# -- runs in the background --------------------------------------------------------------------


def idle(state: State) -> bool:
    """Check whether no simulation is running."""
    return state.job is None and state.going is None


def asked(state: S, before: Any) -> S:
    """Start a simulation, optionally from the end of `before`."""
    paused = replace(state.playback, playing=False, preview=False)
    state = replace(state, playback=paused)
    return started(state, Simulation, state.request, before, state.set_gait, state.framed)


class Cancel(FromPage):
    """Stop the simulation and keep its run up to there, or drop it at the second time."""

    def applied(self, state: State) -> State:
        if state.job is None:
            return state
        if state.ready and not state.job.cancelled:
            return cancelled(state, Simulation)
        return replace(state, job=None, run_problem="The simulation was cancelled.")


class KeepRun(FromPage):
    """Keep the run under a name to compare it with later ones."""

    def applied(self, state: State) -> State:
        if state.live is not None or (run := state.run) is None:
            return state
        count = max((one.id for one in state.runs), default=0) + 1
        kept = KeptRun(count, f"{run.request.scenario or 'free run'} {count}", run)
        return replace(state, runs=(*state.runs, kept)[-KEPT_RUNS:])


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
    """Append a segment and count how often each one was joined. The latest parts are joined in
    groups."""
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
    """Stop the live run and keep the result."""

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
