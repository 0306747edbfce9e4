"""The run panel: what to simulate, progress, and quality of the result."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

import pgraph_core as pg
from pgraph_core.fields import about, fields_of
from pgraph_core.model.checks import PARTS as MODEL_PARTS
from pgraph_core.model.settings import ADAPTIVE, AUTO, METHOD_NAMES, OF, Settings, settings_of
from pgraph_core.model.world import World
from pgraph_core.show.stage import GRID

from ..core.views import Host, Payload, Place, topic
from . import FREE_RUN, Request, Run, State
from .footfalls import prints
from .trust import drift, outcome, supported, trust

PARTS = ("derived", "request", "last_run", "job", "runs", "run_problem", "kernels", "instead")


def run(state: State) -> Payload:
    """Return the complete content of the run panel."""
    request = state.request
    return {
        "scenarios": [*([s.name, s.name] for s in state.model.scenarios), [FREE_RUN, "free run"]],
        "request": fields_of(request),
        "form": form(request, idle_step(state)),
        "keeps": keeps(state),
        "method": METHOD_NAMES[request.method].partition(" (")[0],
        "empty": not state.model.rows,
        "kernels": kernels(state),
        "job": job(state),
        "live": live(state),
        "problem": state.run_problem,
        "summary": outcome(state),
        "outdated": state.outdated,
        "continues": state.run is not None and state.live is None,
        "trust": trust(state, job(state), kernels(state), live(state)),
        "compared": compared(state),
    }


def form(request: Request, idle: str = "") -> list[Payload]:
    """Return the cells of the settings, those with a list of choices first.

    `idle` is the reason why the step of the scenario does not act, or "".
    """
    found, told = [], hints(request)
    values = settings_of(request)
    if idle:
        told["step"], values["step"] = ("automatic", idle, True), None
    for name, (placeholder, help, acts) in told.items():
        known = about(OF[name], name)
        found.append({
            "name": name, "label": known.label, "unit": known.unit, "value": values[name],
            "options": list(Settings.CHOICES.get(name, {}).items()), "placeholder": placeholder,
            "help": help, "acts": acts,
        })  # fmt: skip
    return sorted(found, key=lambda one: not one["options"])


def idle_step(state: State) -> str:
    """Return the reason why the step of the scenario does not act, as far as it is known, or ""."""
    request, last = state.request, state.last_run
    s = next((s for s in state.model.scenarios if s.name == request.scenario), None)
    if s is None or s.step is None or request.step != s.step:
        return ""
    method = request.method
    if method == AUTO and last is not None and last.request == request:
        method = last.result.header["method"]
    if method not in ADAPTIVE or (s.rtol is not None and request.rtol == s.rtol):
        return ""
    text = f"{METHOD_NAMES[method]} chooses its steps. The scenario's step, {s.step:g} s, is that "
    return f"{text}of methods with fixed steps; another number here is the size of every step"


def hints(request: Request) -> dict[str, tuple[str, str, bool]]:
    """Return placeholder, help and state of each setting."""
    usual = {name: ("auto", about(info, name).help, True) for name, info in OF.items()}
    return usual | _hints_of_steps(request)


def _hints_of_steps(request: Request) -> dict[str, tuple[str, str, bool]]:
    called = METHOD_NAMES[request.method]
    if request.method == AUTO:
        step = "Step size; empty: the method chooses"
        rtol = "Largest relative error of a step; empty: follows from the step"
        return {"step": ("auto", step, True), "rtol": ("auto", rtol, True)}
    if request.method not in ADAPTIVE:
        step = f"{called} takes steps of this size; empty: the usual one"
        rtol = f"{called} takes a step, no tolerance"
        return {"step": ("auto", step, True), "rtol": ("none", rtol, request.rtol is not None)}
    step = f"{called} chooses its steps by the tolerance; a number here is the largest one"
    rtol = "Largest relative error of a step; empty: 1e-8"
    fixed = request.step is not None and request.rtol is None
    if fixed:
        step = f"All steps of {called} are this long; empty: it chooses them by the tolerance"
        rtol = "Not used while a step is given; with both, the step is the largest one"
    return {"step": ("by error", step, True), "rtol": ("not used" if fixed else "1e-8", rtol, True)}


def keeps(state: State) -> bool:
    """Check whether the run has other settings than its scenario, which may keep them."""
    if state.set_gait is not None:
        return True
    own = map(Request.of, state.model.scenarios)
    return any(s.scenario == state.request.scenario and s != state.request for s in own)


def kernels(state: State) -> Payload | None:
    """Return the compiler's progress, or None when it is done."""
    k = state.kernels
    if k.ready:
        if not k.problem:
            return None
        return {"text": f"The fast code did not compile: {k.problem}", "fraction": -1.0}
    if not k.total:
        return {"text": "Preparing the fast code ...", "fraction": None}
    said = f"Compiling the fast code, about half a minute: {k.done} of {k.total}, {k.name}"
    return {"text": f"{said}. Editing works meanwhile.", "fraction": k.done / k.total}


def job(state: State) -> Payload | None:
    if state.job is None:
        return None
    if not state.kernels.ready:
        return {"text": "waits until the fast code is compiled", "fraction": None}
    fraction = state.job.fraction
    if not fraction:  # kernels are loading
        return {"text": "starting ...", "fraction": None}
    return {"text": f"{100 * fraction:.0f} %", "fraction": fraction}


def live(state: State) -> Payload | None:
    """Return the time of the live run and its speed relative to real time."""
    if state.live is None:
        return None
    if not state.live.parts:
        return {"text": "starting ...", "running": True}
    if state.live.over:
        return {"text": f"stopped at {state.t_end:.1f} s; its result is being assembled ..."}
    pace = "running" if state.live.running else "paused"
    slow = "" if state.live.pace > 0.95 else f", at {state.live.pace:.2g} of the playback speed"
    return {"text": f"{pace} at {state.t_end:.1f} s{slow}", "running": state.live.running}


class Measure(NamedTuple):
    """A figure of a run, with its error if one is known, or a text."""

    value: float | str
    unit: str = ""
    error: float = 0.0

    def __str__(self) -> str:
        if isinstance(self.value, str):
            return self.value
        return f"{supported(float(f'{self.value:.4g}'), self.error):g}"

    def since(self, other: Measure) -> str:
        """Return the difference from the shown figure of another run, or "" for texts."""
        if isinstance(self.value, str) or isinstance(other.value, str):
            return ""
        error = max(self.error, other.error)
        if abs(self.value - other.value) < error:
            return "0" if str(self) == str(other) else "< error"
        found = supported(float(str(self)) - float(str(other)), error)
        return f"{found:+.4g}".replace("-", "−") if found else "0"


def compared(state: State) -> Payload:
    """Return the kept runs, and a row of values (kept runs, shown run) with the difference of the
    last from the first for each measure."""
    if not state.runs:
        return {"kept": [], "changed": [], "rows": []}
    runs = [one.run for one in state.runs]
    if state.plotted is not None:
        runs.append(state.plotted)
    found = [measures(run) for run in runs]
    labels = {what: one.unit for each in found for what, one in each.items()}
    none = Measure("")
    return {
        "kept": [{"id": one.id, "name": one.name} for one in state.runs],
        "changed": [[*row, ""] for row in differences(runs)],
        "rows": [
            [f"{what} [{unit}]" if unit else what, *map(str, row), row[-1].since(row[0])]
            for what, unit in labels.items()
            for row in [[one.get(what, none) for one in found]]
        ],
    }


def measures(run: Run) -> dict[str, Measure]:
    """Return speed, steps, work and forces of a run."""
    result, model = run.result, run.model
    span, error = float(result.t[-1] - result.t[0]), float(result.error_estimate)
    found = {
        "scenario": Measure(run.request.scenario or "free run"),
        "duration": Measure(span, "s"),
    }
    if run.ended:
        found["ended"] = Measure(run.ended)
    free = [k for k, name in enumerate(result.mechanism.names) if model.body(name).floats]
    if free and span > 0:
        way = np.diff(np.asarray(result.body_pose)[:, free[0], :3], axis=0)
        way -= np.outer(way @ (up := np.asarray(GRID[model.up][1])), up)
        far = float(np.linalg.norm(way.sum(axis=0)))
        found |= {
            "distance": Measure(far, "m", error),
            "mean speed": Measure(far / span, "m/s", error / span),
        }
        if steps := len(prints(run.falls, math.inf, len(run.falls))):
            found |= {"steps": Measure(steps), "step rate": Measure(steps / span, "1/s")}
    if work := float(np.ptp(result.work)):
        doubt = float(result.energy_drift) * work
        found["work put in"] = Measure(float(result.work[-1]), "J", doubt)
    if run.usual_force:
        found["usual largest force"] = Measure(run.usual_force, "N")
    found["energy drift"] = Measure(drift(result))
    return found


# -- differences between the models and settings of compared runs ---------------------------------


MOST_ROWS = 12  # rows
LONGEST = 40  # characters of a value
SI = {"length": "m", "angle": "rad"}


def differences(runs: Sequence[Run]) -> list[list[str]]:
    """Return rows (name, value for each run) of the settings and fields in which runs differ."""
    forms = zip(*(form(run.request) for run in runs))
    rows = [[one[0]["label"].lower(), *map(_setting, one)] for one in forms]
    gaits = [gait_of(run) for run in runs]
    rows.append(["gait", *("none" if gait is None else gait.name for gait in gaits)])
    found = [row for row in rows if row[0] != "duration" and len(set(row[1:])) > 1]
    if None not in gaits:
        found += _of_fields(pg.Gait, "gait: ", gaits, but=("name", "description"))
    models = [run.model for run in runs]
    if any(model is not models[0] for model in models):
        found += _of_fields(World, "", models)
        for part in MODEL_PARTS:
            found += _of_parts(part, models)
    if len(found) <= MOST_ROWS + 1:
        return found
    return [
        *found[:MOST_ROWS],
        [f"{len(found) - MOST_ROWS} more differences", *("" for _ in runs)],
    ]


def gait_of(run: Run) -> pg.Gait | None:
    """Return the gait that a run walked with: that of its scenario, or the one set on the page."""
    scenario = next((s for s in run.model.scenarios if s.name == run.request.scenario), None)
    return run.gait or (None if scenario is None else scenario.gait)


def _setting(cell: Payload) -> str:
    """Return the value of a setting as a short text."""
    value = dict(cell["options"]).get(cell["value"], cell["value"])
    if isinstance(value, float):
        value = f"{value:g} {cell['unit']}".strip()
    return "auto" if value is None else str(value)


def _of_parts(part: str, models: Sequence[pg.Model]) -> list[list[str]]:
    """Return the rows of all parts of one kind, matched by name."""
    named = [{one.name: one for one in getattr(model, part)} for model in models]
    found = []
    for name in dict.fromkeys(name for parts in named for name in parts):
        each = [parts.get(name) for parts in named]
        if all(one is each[0] for one in each):
            continue
        if None in each or len({type(one) for one in each}) > 1:
            found.append(
                [name, *("none" if one is None else type(one).__name__.lower() for one in each)]
            )
        else:
            found += _of_fields(type(each[0]), f"{name}: ", each, but=("gait",))  # told for the run
    return found


def _of_fields(
    kind: Any, owner: str, each: Sequence[Any], but: Sequence[str] = ()
) -> list[list[str]]:
    """Return the rows of the fields of one part, or of the world, except for some."""
    found = []
    for name, info in kind.model_fields.items():
        values = [getattr(one, name) for one in each]
        if name in but or all(value == values[0] for value in values):
            continue
        known = about(info, name)
        unit = SI.get(known.unit, known.unit)
        label = f"{owner}{known.label.lower()}" + (f" [{unit}]" if unit else "")
        found.append([label, *map(_text, values)])
    return found


def _text(value: Any) -> str:
    """Return a value as a short text, or "" if it is not a number, a text or an array of
    numbers."""
    if value is None or isinstance(value, (str, bool)):
        text = "none" if value is None else str(value)
    else:
        try:
            text = ", ".join(f"{x:.4g}" for x in np.ravel(np.asarray(value, float)))
        except (TypeError, ValueError):
            text = "other"
    return text if len(text) <= LONGEST else text[: LONGEST - 1] + "…"


VIEWS = (
    Place(
        topic("run", run, *PARTS, live),
        55,
        Host("run", "run"),
        Host("trust", "trust"),
        Host("outcome", "drawer", "Accuracy", 45),
        Host("compare", "drawer", "Compare"),
    ),
)
