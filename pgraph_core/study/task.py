"""Tasks for a study: settings, the motion that every run computes, and the participants.

Builders of other engines are in the package `pgraph_peers` (folder `peers`), which depends on this
one. Their entry points are looked up when a study names an engine.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import EntryPoint, entry_points
from typing import Any, NamedTuple

import numpy as np

from ..dynamics.scene import contact_tables
from ..errors import choices, no_method, refusal, shown
from ..fields import is_number
from ..integrators import METHODS, Method, method_of
from ..mechanism import Mechanism
from ..model import Scenario
from ..model.settings import LEAST_RTOL
from ..packing import Array
from ..result import Result, Status
from ..simulation import simulate
from ..simulation.options import positive
from ..simulation.plan import active_constraints, touching_contacts
from ..simulation.rates import fastest_rate
from ..simulation.start import initial_state

RUNGS = 8
TOLERANCES = tuple(10.0**-k for k in range(2, 13))
# [s] for a map or report, which with the start of a program takes less than a minute
MAP_WITHIN = 45
MOST_SETTINGS = 64  # limit on the settings of one method


class Setting(NamedTuple):
    """A step size or a tolerance for one run."""

    step: float | None = None  # [s]
    rtol: float | None = None
    max_steps: int | None = None

    def __str__(self) -> str:
        if self.step is not None:
            return f"step {self.step:.4g} s"
        return f"rtol {self.rtol:.0e}"

    @property
    def options(self) -> dict[str, Any]:
        """The keyword arguments for `simulate`."""
        return {k: v for k, v in self._asdict().items() if v is not None}


class Ladder(NamedTuple):
    """The settings for all methods, coarsest first."""

    steps: tuple[float, ...]  # [s]
    tolerances: tuple[float, ...]

    @classmethod
    def of(cls, task: Any, steps: Any, tolerances: Any, rate: float) -> Ladder:
        """Use the given settings, or the default ones for a `Task`: h0 2^-k and 10^-k.

        h0 is a whole fraction of a frame, short enough for the fastest `rate` [1/s] of the motion.
        A stiff scene stays stiff: h0 is at least a hundredth of a frame. Raises InputError.
        """
        parts = min(max(1.0, np.ceil(task.spacing * rate)), 100.0)
        rungs = tuple(task.spacing / float(parts) * 0.5**k for k in range(RUNGS + 1))
        if steps is not None:
            rungs = _rungs("steps", steps, task.t_end / 1e8, task.t_end)
        usual = TOLERANCES
        if tolerances is not None:
            usual = _rungs("tolerances", tolerances, LEAST_RTOL, 0.1)
        return cls(rungs, usual)

    def settings(self, method: Method) -> tuple[Setting, ...]:
        """Return the settings at which to run `method`."""
        return self.of_kind("rtol" if method.adaptive else "step")

    def of_kind(self, kind: str) -> tuple[Setting, ...]:
        """Return the settings of a kind, "step" or "rtol"."""
        if kind == "rtol":
            return tuple(Setting(rtol=rtol) for rtol in self.tolerances)
        return tuple(Setting(step=step) for step in self.steps)


def _rungs(field: str, given: Any, least: float, most: float) -> tuple[float, ...]:
    """Validate the steps or tolerances for `work_precision` and sort them in descending order."""
    values = (
        tuple(given) if isinstance(given, Iterable) and not isinstance(given, str) else (given,)
    )
    if len(values) > MOST_SETTINGS:
        text = f"are {len(values)} settings of each method; give {MOST_SETTINGS} at most"
        raise refusal("work_precision", field, text)
    if not values or not all(is_number(x) and least <= float(x) <= most for x in values):
        text = f"must be one number or more, each within {least:g} and {most:g}, got {given!r}"
        raise refusal("work_precision", field, text)
    return tuple(sorted({float(x) for x in values}, reverse=True))


def methods_of(call: str, given: Any, *, impulses: bool, suited: bool) -> tuple[str, ...]:
    """Return the requested methods, or the default ones. Raises InputError listing the choices.

    `suited`: also refuses methods that cannot take the scene.
    """
    if given is None:
        return tuple(
            name
            for name, method in METHODS.items()
            if (impulses and method.eventful) or method.time_stepping == impulses
        )
    names = (given,) if isinstance(given, str) else tuple(given)
    if not names:
        raise refusal(call, "methods", f"give at least one of {choices(METHODS)}")
    for name in names:
        if name == "auto" or name not in METHODS:
            raise refusal(call, "methods", no_method(name, METHODS))
        method_of(name, impulses=impulses and suited)
    return tuple(dict.fromkeys(names))


# -- checks ----------------------------------------------------------------------------------------


def time_limit(call: str, within: Any) -> None:
    """Check the limit on the time of a map or report [s]. Raises InputError."""
    if within != math.inf:
        positive("within", within, unit=" [s], or infinite", call=call)


def finite_numbers(call: str, field: str, given: Any) -> tuple[float, ...]:
    """Return unique finite numbers in their given order. Raises InputError if there are none."""
    try:
        found = tuple(float(x) for x in given)
    except (TypeError, ValueError):
        found = ()
    if not found or not all(map(np.isfinite, found)):
        text = f"must be finite numbers, at least one, got {shown(given)}"
        raise refusal(call, field, text)
    return tuple(dict.fromkeys(found))


GROUP = "pgraph.peers"  # group of the entry points of peers
Progress = Callable[[float], Any]
Once = Callable[[float, Callable[[], bool]], Any]  # (step or tolerance, going) -> run or None


class Stopped(Exception):
    """Raised when the caller's progress function returns False."""


@dataclass(frozen=True)
class Task:
    """A mechanism, its initial state, its inputs, and the times at which motions are compared."""

    mech: Mechanism
    q: Array | None  # None: the model's own
    v: Array | None
    t: Array  # (n,) [s], from 0
    scenario: str | None = None
    tau: Any = None
    stabilise: str | None = "project"
    asked: float = 0.0  # requested duration, which the times may not reach [s]

    @property
    def t_end(self) -> float:
        """Duration [s]."""
        return float(self.t[-1])

    @property
    def spacing(self) -> float:
        """The smallest time between two frames [s]."""
        return float((self.t[1:] - self.t[:-1]).min())

    def until(self, count: int) -> Task:
        """Return the same motion, restricted to its first `count` times."""
        return replace(self, t=self.t[:count])

    def run(
        self,
        method: str,
        setting: Setting,
        progress: Progress | None = None,
        *,
        estimate: bool = False,
    ) -> Result:
        """Simulate the task once. Raises InputError if the method does not support the scene."""
        return simulate(
            self.mech,
            self.q,
            self.v,
            t_end=self.t_end,
            method=method,
            tau=self.tau,
            scenario=self.scenario,
            stabilise=self.stabilise,
            estimate=estimate,
            progress=progress,
            **self._times,
            **setting.options,
        )

    @property
    def _times(self) -> dict[str, Any]:
        """Evenly spaced times are replaced by the number of frames, so that the mechanism can reuse
        its plan."""
        even = np.linspace(0.0, self.t_end, len(self.t))
        return {"frames": len(self.t)} if np.array_equal(even, self.t) else {"t_eval": self.t}

    @property
    def impulses(self) -> bool:
        """True if rigid contacts or joint limits are active."""
        contacts = contact_tables(self.mech.packed, touching_contacts(self.mech, self._given))
        return contacts is not None and contacts.rigid

    @property
    def touching(self) -> bool:
        """True if contacts are active."""
        return bool(touching_contacts(self.mech, self._given))

    def rate(self) -> float:
        """Return the fastest rate of the linearised motion at the start [1/s], or 0 if unknown."""
        if callable(self.tau):
            return 0.0
        given = self._given
        forces = (*self.mech.model.forces, *(given.forces if given else ()))
        acting = self.mech.packed.drives(forces), self.mech.packed.loads(forces)
        q, v = initial_state(self.mech, given, self.q, self.v)
        return fastest_rate(self.mech, acting, active_constraints(self.mech, given), q, v)

    def rate_at(self, states: list[tuple[Array, Array]]) -> float:
        """Return the fastest rate over several states (q, v) [1/s], 0 with contacts."""
        if contact_tables(self.mech.packed, touching_contacts(self.mech, self._given)) is not None:
            return 0.0
        return max(replace(self, q=q, v=v).rate() for q, v in states)

    @property
    def _given(self) -> Scenario | None:
        return None if self.scenario is None else self.mech.model.scenario(self.scenario)


class Outcome(NamedTuple):
    """The result of one run by Pgraph or a peer in a study."""

    q: Array  # (n, nq) Pgraph's coordinates up to the end of the run
    seconds: float  # processor time of the whole call, of a peer that of its steps
    ok: bool = True
    reason: str = ""  # why not
    counters: Mapping[str, int] = {}
    estimate: float = np.nan  # the run's own error estimate [rad, m]
    energy_drift: float = np.nan
    drift: tuple[float, float] = (np.nan, np.nan)  # constraint drift of positions, velocities
    cancelled: bool = False

    @classmethod
    def of(cls, run: Result, seconds: float) -> Outcome:
        """Extract the outcome from a run."""
        ok = run.status.ok
        drift = run.constraint_drift.max(axis=0, initial=0.0) if len(run.t) else np.full(2, np.nan)
        return cls(
            run.q,
            seconds,
            ok,
            "" if ok else run.message,
            run.counters,
            run.error_estimate,
            run.energy_drift if ok else np.nan,
            (float(drift[0]), float(drift[1])),
            run.status is Status.CANCELLED,
        )

    @classmethod
    def failed(cls, reason: str, seconds: float = 0.0, *, cancelled: bool = False) -> Outcome:
        """Return the outcome for a run without states."""
        return cls(np.zeros((0, 0)), seconds, False, reason, cancelled=cancelled)


class Participant(NamedTuple):
    """One curve in the diagram: a method of Pgraph or of a peer, with all its settings."""

    name: str  # "rk4", "MuJoCo rk4"
    settings: tuple[Setting, ...]
    run: Callable[[Setting, Progress, bool], Outcome]  # (setting, progress, with an estimate)
    peer: str = ""  # "" for ours


def own_participant(task: Task, name: str, settings: tuple[Setting, ...]) -> Participant:
    """Create the participant for one of Pgraph's methods."""

    def run(setting: Setting, progress: Progress, estimate: bool) -> Outcome:
        began = time.thread_time()
        found = task.run(name, setting, progress, estimate=estimate)
        return Outcome.of(found, time.thread_time() - began)

    return Participant(name, settings, run)


def start(mech: Mechanism, scenario: str | None, q: Any, v: Any) -> tuple[Array, Array]:
    """Return the initial state from the arguments, the scenario or the model, in that order."""
    given = None if scenario is None else mech.model.scenario(scenario)
    q, v = initial_state(mech, given, q, v)
    return q[: mech.nq], v[: mech.nv]  # runs find the states of controls themselves


# -- other engines: installed peers as participants, a sentence for the others ---------------------


def engines_of(given: Sequence[str] | str) -> tuple[str, ...]:
    """Return the requested engines. Raises InputError listing the choices."""
    names = (given,) if isinstance(given, str) else tuple(given)
    known = installed_peers() if names else {}
    for name in names:
        if known and name not in known:
            text = f"no peer is named {name!r}; choose from {choices(known)}"
            raise refusal("work_precision", "peers", text)
    return names


def installed_peers() -> dict[str, EntryPoint]:
    """Return the engines with an installed builder, keyed by name."""
    return {point.name: point for point in entry_points(group=GROUP)}


def engine_participants(
    task: Task, ladder: Ladder, names: Sequence[str]
) -> tuple[list[Participant], list[str]]:
    """Return participants of engines that can run the motion, and messages of the others."""
    participants: list[Participant] = []
    notes: list[str] = []
    found = installed_peers() if names else {}
    for name in names:
        if name not in found:
            notes.append(f"{name} is omitted because the package pgraph_peers is not installed")
            continue
        peer = found[name].load()
        if not peer.installed:
            notes.append(f"{peer.label} is not installed (pip install {peer.package})")
            continue
        try:
            run = peer.run(task.mech, task.q, task.v, task.t, task.scenario, task.tau)
        except Exception as error:  # Refused, or any kind of the engine's own
            notes.append(f"{peer.label} is omitted: {_first_line(error)}")
        else:
            for method, once in run.methods.items():
                label, settings = f"{peer.label} {method}", ladder.of_kind(run.by)
                participants.append(Participant(label, settings, _runner(once), peer.label))
    return participants, notes


def _runner(once: Once) -> Callable[[Setting, Progress, bool], Outcome]:
    def run(setting: Setting, progress: Progress, _: bool) -> Outcome:
        number = setting.rtol if setting.step is None else setting.step
        try:
            done = once(number or 0.0, lambda: progress(0.0) is not False)
        except Stopped:
            raise
        except Exception as error:  # any kind of the engine's own
            return Outcome.failed(_first_line(error))
        if done is None:
            return Outcome.failed("", cancelled=True)
        return Outcome(done.q, done.seconds[1], counters=done.counters)

    return run


def _first_line(error: Exception) -> str:
    return (str(error).strip() or type(error).__name__).splitlines()[0]
