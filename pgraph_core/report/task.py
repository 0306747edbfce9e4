"""The motion that every run of a study makes, and one run of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from ..mechanism import Mechanism
from ..result import Result
from ..simulation import simulate
from ..simulation.plan import active_constraints, fastest_rate, initial_state, touching_contacts
from ..system import Array
from .ladder import Setting

Progress = Callable[[float], Any]


class Stopped(Exception):
    """The caller's progress function said no."""


@dataclass(frozen=True)
class Task:
    """A mechanism, how it starts, what drives it, and the times at which it is looked at."""

    mech: Mechanism
    q: Array
    v: Array
    t: Array  # (n,) [s], from 0
    scenario: str | None = None
    tau: Any = None
    stabilise: str | None = "project"

    @property
    def t_end(self) -> float:
        """Duration [s]."""
        return float(self.t[-1])

    @property
    def spacing(self) -> float:
        """The shortest time between two frames [s]."""
        return float((self.t[1:] - self.t[:-1]).min())

    def until(self, count: int) -> Task:
        """The same motion over its first `count` times."""
        return replace(self, t=self.t[:count])

    def run(
        self,
        method: str,
        setting: Setting,
        progress: Progress | None = None,
        *,
        estimate: bool = False,
    ) -> Result:
        """One run; raises InputError where the method cannot take the scene."""
        options: dict[str, Any] = {**setting.options}
        return simulate(
            self.mech,
            self.q,
            self.v,
            t_end=self.t_end,
            t_eval=self.t,
            method=method,
            tau=self.tau,
            scenario=self.scenario,
            stabilise=self.stabilise,
            estimate=estimate,
            progress=progress,
            **options,
        )

    @property
    def impulses(self) -> bool:
        """Whether rigid contacts or joint limits act."""
        contacts = self.mech.contacts(touching_contacts(self.mech, self._given))
        return contacts is not None and contacts.rigid

    def fastest_rate(self) -> float:
        """Largest rate of the linearised motion at the start [1/s]; 0 where it is not known."""
        if callable(self.tau):
            return 0.0
        given = self._given
        forces = (*self.mech.model.forces, *(given.forces if given else ()))
        acting = self.mech.drives(forces), self.mech.loads(forces)
        active = active_constraints(self.mech, given)
        return fastest_rate(self.mech, acting, active, self.q, self.v)

    @property
    def _given(self) -> Any:
        return None if self.scenario is None else self.mech.model.scenario(self.scenario)


def start(mech: Mechanism, scenario: str | None, q: Any, v: Any) -> tuple[Array, Array]:
    """The initial state: the arguments, else the scenario's, else the model's."""
    given = None if scenario is None else mech.model.scenario(scenario)
    return initial_state(mech, given, q, v)
