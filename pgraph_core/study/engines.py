"""Other engines in a study: each installed peer as participants, a sentence for the others.

The builders are in the package `pgraph_peers` (folder `peers`), which depends on this one. They
are found by their entry points, when a study names an engine.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from ..errors import choices, refusal
from .errors import Motion
from .settings import Ladder, Setting
from .task import Outcome, Participant, Progress, Stopped, Task

GROUP = "pgraph.peers"  # of the entry points

Once = Callable[[float, Callable[[], bool]], Any]  # (step or tolerance, going) -> run or None


def engines_of(given: Sequence[str] | str) -> tuple[str, ...]:
    """The engines asked for. Raises InputError naming the choices."""
    names = (given,) if isinstance(given, str) else tuple(given)
    known = installed_peers() if names else {}
    for name in names:
        if known and name not in known:
            text = f"no peer is called {name!r}; choose from {choices(known)}"
            raise refusal("work_precision", "peers", text)
    return names


def installed_peers() -> dict[str, EntryPoint]:
    """The engines whose builders are installed, by name."""
    return {point.name: point for point in entry_points(group=GROUP)}


def engine_participants(
    task: Task, ladder: Ladder, names: Sequence[str]
) -> tuple[list[Participant], list[str]]:
    """(the participants of each engine that can take the motion, a sentence for each other)."""
    participants: list[Participant] = []
    if names and task.quantity != "position":
        return [], [f"other engines are compared by their positions, not by the {task.quantity}"]
    notes: list[str] = []
    found = installed_peers() if names else {}
    for name in names:
        if name not in found:
            notes.append(f"{name} is left out: the package pgraph_peers is not installed")
            continue
        peer = found[name].load()
        if not peer.installed:
            notes.append(f"{peer.label} is not installed (pip install {peer.package})")
            continue
        try:
            run = peer.run(task.mech, task.q, task.v, task.t, task.scenario, task.tau)
        except Exception as error:  # Refused, or any kind of the engine's own
            notes.append(f"{peer.label} is left out: {_first_line(error)}")
        else:
            for method, once in run.methods.items():
                settings = _settings(run.by, ladder)
                label = f"{peer.label} {method}"
                participants.append(Participant(label, settings, _runner(once), peer.label))
    return participants, notes


def _settings(by: str, ladder: Ladder) -> tuple[Setting, ...]:
    if by == "rtol":
        return tuple(Setting(rtol=rtol) for rtol in ladder.tolerances)
    return tuple(Setting(step=step) for step in ladder.steps)


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
        return Outcome(Motion(done.q), done.seconds, counters=done.counters, whole=done.seconds)

    return run


def _first_line(error: Exception) -> str:
    return (str(error).strip() or type(error).__name__).splitlines()[0]
