"""Other engines in a study: each installed peer as participants, a sentence for the others.

The builders are in the package `peers` of the repository, installed as `pgraph_peers`. It depends
on this one, so it is imported only if a study names an engine.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ..errors import choices
from .settings import Ladder, Setting, refusal
from .task import Outcome, Participant, Progress, Stopped, Task

ENGINES = ("mujoco", "pinocchio", "exudyn")
MISSING = "the peers' package is not installed; run from a checkout of Pgraph to compare with peers"

Once = Callable[[float, Callable[[], bool]], Any]  # (step or tolerance, going) -> run or None


def engines_of(given: Sequence[str] | str) -> tuple[str, ...]:
    """The engines asked for. Raises InputError naming the choices."""
    names = (given,) if isinstance(given, str) else tuple(given)
    for name in names:
        if name not in ENGINES:
            text = f"no peer is called {name!r}; choose from {choices(ENGINES)}"
            raise refusal("work_precision", "peers", text)
    return names


def peers_package() -> Any:
    """The package of the peers' builders, or None if it is not installed."""
    if find_spec("pgraph_peers") is not None:
        return import_module("pgraph_peers")
    found = find_spec("peers")
    checkout = Path(__file__).parents[2] / "peers" / "__init__.py"
    if found is None or found.origin is None or Path(found.origin) != checkout:
        return None  # `peers` of someone else
    return import_module("peers")


def engine_participants(
    task: Task, ladder: Ladder, names: Sequence[str]
) -> tuple[list[Participant], list[str]]:
    """(the participants of each engine that can take the motion, a sentence for each other)."""
    participants: list[Participant] = []
    notes: list[str] = []
    package = peers_package() if names else None
    if names and package is None:
        return participants, [MISSING]
    for name in names:
        peer = package.PEERS[name]
        if not package.installed(name):
            notes.append(f"{peer.label} is not installed (pip install {peer.package})")
            continue
        try:
            motion = package.exported(task.mech, task.q, task.v, task.t, task.scenario, task.tau)
            run = package.engine(name).Run(motion)
        except package.Refused as refused:
            notes.append(f"{peer.label} is left out: {refused}")
        except Exception as error:  # of another project: any kind
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
        except Exception as error:  # of another project: any kind
            return Outcome.failed(_first_line(error))
        if done is None:
            return Outcome.failed("", cancelled=True)
        return Outcome(done.q, done.seconds, counters=done.counters)

    return run


def _first_line(error: Exception) -> str:
    return (str(error).strip() or type(error).__name__).splitlines()[0]
