"""`update(state, event) -> state`: pure, and the only place where anything is decided."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import pgraph_core as pg

from . import cells, events
from .cells import Refusal
from .events import Event
from .state import (
    FREE_RUN,
    METHODS,
    Client,
    Job,
    Kernels,
    Notice,
    Playback,
    Reply,
    Request,
    Run,
    Saving,
    State,
    Step,
    derive,
    first_request,
    with_client,
)

GROUND = "ground"
UNDO_DEPTH = 200
MOST_BODIES = 1000
LONGEST_RUN = 3600.0  # [s]


def update(state: State, event: Event) -> State:
    """The state after `event`. Unfit and stale events leave it as it was, or say why."""
    match event:
        case events.Connected(client):
            return replace(state, clients={**state.clients, client: Client()})
        case events.Disconnected(client):
            left = {key: value for key, value in state.clients.items() if key != client}
            return replace(state, clients=left)
        case events.Misread(client, text):
            return _told(state, client, Notice("The page sent something unknown", text, bad=True))
        case events.Select(client, body):
            known = body is None or body in state.derived.number
            return with_client(state, client, selection=body) if known else state
        case events.Theme(client, dark):
            return with_client(state, client, dark=dark)
        case events.Viewport(client, aspect):
            return with_client(state, client, aspect=aspect)
        case events.Show(_, what, on):
            return replace(state, shown=state.shown | {what} if on else state.shown - {what})
        case events.Download(client) if client in state.clients:
            return with_client(state, client, downloads=state.clients[client].downloads + 1)
        case events.Save(client, serial, path):
            return replace(state, saving=Saving(client, serial, path, state.model))
        case events.Saved(client, serial, path, problem):
            return _saved(state, event)
        case _:
            return _update_model(state, event)


def _update_model(state: State, event: Event) -> State:
    match event:
        case events.Edit():
            return _edited(state, event)
        case events.NewModel(client, serial, text):
            return _new(state, client, serial, text)
        case events.AddBody(client, parent):
            return _added(state, client, parent)
        case events.DeleteBody(client, body, children):
            return _attempted(
                state, client, lambda: state.model.remove(body, children=children), f"delete {body}"
            )
        case events.Undo():
            return _undone(state)
        case events.Redo():
            return _redone(state)
        case events.OpenBuiltIn(client, name) if name in state.gallery:
            return _opened(state, client, name, state.gallery[name])
        case events.OpenText(client, name, content):
            return _opened(state, client, name, content)
        case _:
            return _update_run(state, event)


def _update_run(state: State, event: Event) -> State:
    match event:
        case events.SetScenario(_, scenario):
            return _scenario_chosen(state, scenario)
        case events.SetRun():
            return _request_edited(state, event)
        case events.Simulate() if state.job is None:
            job = Job(state.jobs + 1, state.model, state.request)
            paused = replace(state.playback, playing=False)
            return replace(state, job=job, jobs=job.id, run_problem="", playback=paused)
        case events.Cancel() if state.job is not None:
            return replace(state, job=None, run_problem="The simulation was cancelled.")
        case events.Progress(job, fraction) if _current(state, job) is not None:
            running = replace(state.job, fraction=fraction)  # type: ignore[type-var]
            return replace(state, job=running)
        case events.Simulated(job, result) if (done := _current(state, job)) is not None:
            return _finished(state, done, result)
        case events.Failed(job, text) if _current(state, job) is not None:
            return replace(state, job=None, run_problem=text)
        case events.Compiling(done, total, name):
            return replace(state, kernels=Kernels(done, total, name))
        case events.Compiled(problem):
            return replace(state, kernels=replace(state.kernels, ready=True, problem=problem))
        case _:
            return replace(state, playback=_played(state, event))


def _played(state: State, event: Event) -> Playback:
    playback, end = state.playback, state.t_end
    if end <= 0:
        return playback
    match event:
        case events.Play():
            start = 0.0 if playback.time >= end else playback.time
            return replace(playback, playing=True, time=start)
        case events.Pause():
            return replace(playback, playing=False)
        case events.Scrub(_, time):
            return replace(playback, time=min(max(time, 0.0), end))
        case events.StepFrames(_, frames):
            return replace(playback, playing=False, time=_frame_time(state, frames))
        case events.Speed(_, speed):
            return replace(playback, speed=speed)
        case events.Loop(_, loop):
            return replace(playback, loop=loop)
        case events.Tick(dt) if playback.playing:
            time = playback.time + dt * playback.speed
            if time < end:
                return replace(playback, time=time)
            return replace(playback, time=time % end if playback.loop else end,
                           playing=playback.loop)  # fmt: skip
        case _:
            return playback


def _frame_time(state: State, frames: int) -> float:
    """The time of the saved frame `frames` away from the one shown."""
    times = state.run.result.t if state.run is not None else [0.0]
    now = min(range(len(times)), key=lambda k: abs(float(times[k]) - state.playback.time))
    return float(times[min(max(now + frames, 0), len(times) - 1)])


def _current(state: State, job: int) -> Job | None:
    """The job under way if it is number `job`; anything else is stale."""
    return state.job if state.job is not None and state.job.id == job else None


def _finished(state: State, job: Job, result: object) -> State:
    run = Run(job.model, job.request, result)
    playback = replace(state.playback, time=0.0, playing=False)
    state = replace(state, job=None, last_run=run, playback=playback)
    return state if run.model is state.model else replace(
        state, run_problem="The model was changed while it was simulated: undo shows that run."
    )  # fmt: skip


# -- the model ---------------------------------------------------------------------------------


def _edited(state: State, event: events.Edit) -> State:
    try:
        body = state.model.body(event.body)
        model = state.model.edit(
            event.body, **cells.change(body, event.field, event.index, event.text)
        )
    except Refusal as refusal:
        sentence = f"body '{event.body}', {event.field}: {refusal}"
        return with_client(state, event.client, reply=Reply(event.serial, sentence))
    except pg.PgraphError as error:
        return with_client(state, event.client, reply=Reply(event.serial, str(error)))
    state = _with_model(state, model, f"{event.field} of {event.body}")
    state = with_client(state, event.client, reply=Reply(event.serial, ""))
    notices = " ".join(model.notices)
    return _told(state, event.client, Notice("Also changed", notices)) if notices else state


def _attempted(state: State, client: int, make, label: str) -> State:
    """`make()` as the new model, selected by `client` where it says so, or the reason why not."""
    try:
        model = make()
    except pg.PgraphError as error:
        return _told(state, client, Notice("Not done", str(error), bad=True))
    state = _with_model(state, model, label)
    notices = " ".join(model.notices)
    return _told(state, client, Notice("Also changed", notices)) if notices else state


def _added(state: State, client: int, parent: str | None) -> State:
    if len(state.model.bodies) >= MOST_BODIES:
        return _told(state, client, Notice("Not done", f"{MOST_BODIES} bodies at most", bad=True))
    model, name = state.model, _free_name(state.model)
    rod = pg.Model.serial(2).bodies[1]
    on = parent if parent in state.derived.number else GROUND
    joint = {"joint": "free"} if not model.bodies else {}
    link = model.body(on).tip or rod.link if on in state.derived.number else (0.0, 0.0, 0.0)
    new = rod.model_copy(update={"name": name, "parent": on, "link": link, **joint})
    added = _attempted(state, client, lambda: model.add(new, after=None), f"add {name}")
    return with_client(added, client, selection=name) if added is not state else state


def _free_name(model: pg.Model) -> str:
    """The next unused whole number as a name."""
    taken = {body.name for body in model.bodies}
    return next(str(k) for k in range(len(taken) + 1, 2 * len(taken) + 2) if str(k) not in taken)


def _new(state: State, client: int, serial: int, text: str) -> State:
    try:
        model = pg.Model.serial(cells.whole(text, 1, MOST_BODIES))
    except Refusal as refusal:
        return with_client(state, client, reply=Reply(serial, f"The number of bodies {refusal}"))
    state = _replaced(state, model, f"new model of {len(model.bodies)} bodies")
    return with_client(state, client, reply=Reply(serial, ""))


def _opened(state: State, client: int, name: str, content: str) -> State:
    try:
        model = pg.Model.from_json(content)
        if len(model.bodies) > MOST_BODIES:
            raise Refusal(f"it has {len(model.bodies)} bodies; {MOST_BODIES} at most")
    except (pg.PgraphError, Refusal) as error:
        return _told(state, client, Notice(f"{name} was not opened", str(error), bad=True))
    state = _replaced(state, model, f"open {name}")
    return _told(state, client, Notice(f"Opened {model.name}"))


def _replaced(state: State, model: pg.Model, label: str) -> State:
    """Another model altogether: its own request, and the camera framed on it."""
    state = _with_model(state, model, label)
    return replace(state, request=first_request(model), framed=state.framed + 1)


def _with_model(state: State, model: pg.Model, label: str) -> State:
    """`model` in place of the current one, as one undo step; nothing if it is the same."""
    if model is state.model:
        return state
    undo = (*state.undo, Step(state.model, label))[-UNDO_DEPTH:]
    return replace(_showing(state, model), undo=undo, redo=())


def _undone(state: State) -> State:
    if not state.undo:
        return state
    *undo, step = state.undo
    redo = (*state.redo, Step(state.model, step.label))
    return replace(_showing(state, step.model), undo=tuple(undo), redo=redo)


def _redone(state: State) -> State:
    if not state.redo:
        return state
    *redo, step = state.redo
    undo = (*state.undo, Step(state.model, step.label))
    return replace(_showing(state, step.model), undo=undo, redo=tuple(redo))


def _showing(state: State, model: pg.Model) -> State:
    """`model` shown: what follows from it, selections by name or row, playback at its start."""
    derived = derive(model)
    clients = {
        key: replace(client, selection=_followed(client.selection, state.model, model))
        for key, client in state.clients.items()
    }
    request = _request_for(model, state.request)
    playback = replace(state.playback, time=0.0, playing=False)
    return replace(
        state, model=model, derived=derived, clients=clients, request=request, playback=playback
    )


def _followed(name: str | None, old: pg.Model, new: pg.Model) -> str | None:
    """The body to stay selected: of the same name, else of the same row (a renamed one)."""
    if name is None or name in new.row:
        return name
    same_rows = len(old.bodies) == len(new.bodies) and name in old.row
    return new.bodies[old.row[name]].name if same_rows else None


# -- the run -----------------------------------------------------------------------------------


def _request_for(model: pg.Model, request: Request) -> Request:
    known: Mapping[str, object] = {s.name: s for s in model.scenarios}
    kept = request.scenario == FREE_RUN or request.scenario in known
    return request if kept else replace(request, scenario=FREE_RUN)


def _scenario_chosen(state: State, name: str) -> State:
    scenario = next((s for s in state.model.scenarios if s.name == name), None)
    if scenario is None:
        return replace(state, request=Request()) if name == FREE_RUN else state
    method = scenario.method if scenario.method in METHODS else "auto"
    request = Request(name, scenario.t_end, scenario.step, method)
    return replace(state, request=request)


def _request_edited(state: State, event: events.SetRun) -> State:
    try:
        request = replace(state.request, **{event.field: _request_value(event)})
    except Refusal as refusal:
        return with_client(state, event.client, reply=Reply(event.serial, str(refusal)))
    state = replace(state, request=request)
    return with_client(state, event.client, reply=Reply(event.serial, ""))


def _request_value(event: events.SetRun) -> float | str:
    if event.field == "method":
        if event.text not in METHODS:
            raise Refusal(f"The method must be one of {', '.join(METHODS)}.")
        return event.text
    said = {"t_end": "The duration", "step": "The step"}[event.field]
    try:
        value = cells.number(event.text)
    except Refusal as refusal:
        raise Refusal(f"{said} {refusal}") from None
    if not 0 < value <= LONGEST_RUN:
        raise Refusal(f"{said} must be above 0 and at most {LONGEST_RUN:g} s; given {value:g}.")
    return value


def _saved(state: State, event: events.Saved) -> State:
    state = with_client(state, event.client, reply=Reply(event.serial, event.problem))
    return state if event.problem else _told(state, event.client, Notice("Saved", event.path))


def _told(state: State, client: int, notice: Notice) -> State:
    return with_client(state, client, notice=notice)
