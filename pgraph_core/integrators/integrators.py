"""The integration methods as data: adding one is one entry."""

from __future__ import annotations

from importlib import import_module
from typing import Any, NamedTuple

from ..engine import stepping
from ..errors import InputError, Problem, choices
from . import tableaus
from .tableaus import Tableau

STEPPING = stepping.__name__


class Method(NamedTuple):
    """A method: its coefficients, the kernel of its step, and its use."""

    name: str
    order: int
    tableau: Tableau
    use: str  # in a few words
    step: str  # module and name of its kernel, loaded when it is first asked for
    adaptive: bool = False  # whether it can choose its steps by their error
    # safety, exponents of this error and the last one, least and largest change of the width
    controller: tuple[float, float, float, float, float] = (0.9, 0.0, 0.0, 0.2, 6.0)
    limit: float = 0.0  # largest rate x step of an oscillation that is stable; 0: any
    implicit: bool = False  # whether it solves equations
    jacobian: bool = False  # whether it does so with the Jacobian of v'

    @property
    def kernel(self) -> Any:
        """The kernel of a step."""
        module, name = self.step.split(".")
        return getattr(import_module(f"{STEPPING}.{module}"), name)

    @property
    def starts(self) -> bool:
        """Whether a step starts from v' at its start."""
        return self.name != "moreau_jean"

    @property
    def eventful(self) -> bool:
        """Whether it can go from event to event: events are located in a step of it."""
        return self.starts and not self.implicit

    @property
    def evaluations(self) -> int:
        """Evaluations of the dynamics a step."""
        return max(len(self.tableau.b), 1)


def _pi(order: int, last: float, most: float) -> tuple[float, float, float, float, float]:
    """PI control of an error that grows as h^order ([Hairer, Wanner 1996, IV.2])."""
    return 0.9, 1.0 / order - 0.75 * last, last, 0.2, most


RK4 = Method(
    "rk4",
    4,
    tableaus.rk4(),
    "smooth motion at a fixed step",
    "explicit.runge_kutta",
    limit=2.83,
)
SEMI_IMPLICIT_EULER = Method(
    "semi_implicit_euler",
    1,
    tableaus.euler(),
    "playback and long runs without drift of energy, at low accuracy",
    "explicit.semi_implicit",
    limit=2.0,
)
DOPRI5 = Method(
    "dopri5",
    5,
    tableaus.dopri5(),
    "smooth motion to three to six digits, tables with many corners",
    "explicit.runge_kutta",
    adaptive=True,
    controller=_pi(5, 0.04, 10.0),
    limit=1.0,
)
DOP853 = Method(
    "dop853",
    8,
    tableaus.dop853(),
    "smooth motion to six digits and more",
    "explicit.runge_kutta",
    adaptive=True,
    controller=_pi(8, 0.04, 6.0),
    limit=4.5,
)
RADAU5 = Method(
    "radau5",
    5,
    tableaus.radau5(),
    "stiff springs, dampers and friction, at steps that do not resolve them",
    "implicit.radau",
    adaptive=True,
    controller=_pi(4, 0.04, 8.0),
    implicit=True,
    jacobian=True,
)
ROS2 = Method(
    "ros2",
    2,
    tableaus.ros2(),
    "stiff motion for playback: one factorisation a step",
    "implicit.ros2",
    adaptive=True,
    controller=_pi(2, 0.0, 6.0),
    implicit=True,
    jacobian=True,
)
GENERALISED_ALPHA = Method(
    "generalised_alpha",
    2,
    tableaus.generalised_alpha(0.8),
    "stiff and constrained motion at a fixed step: one implicit evaluation a step",
    "alpha.generalised_alpha",
    implicit=True,
    jacobian=True,
)
GAUSS6 = Method(
    "gauss6",
    6,
    tableaus.gauss6(),
    "conservative trees for very long: symplectic, the energy stays within a bound",
    "gauss.gauss",
    limit=3.0,
    implicit=True,
)
MOREAU_JEAN = Method(
    "moreau_jean",
    1,
    tableaus.euler(),
    "rigid contacts, joint limits and impacts, many at once",
    "moreau.moreau_jean",
    limit=2.0,
)
METHODS = {
    method.name: method
    for method in (
        SEMI_IMPLICIT_EULER,
        RK4,
        DOPRI5,
        DOP853,
        GAUSS6,
        ROS2,
        GENERALISED_ALPHA,
        RADAU5,
        MOREAU_JEAN,
    )
}


def method_of(name: str, *, impulses: bool = False, touching: bool = True) -> Method:
    """The method called `name`; `impulses` says that the scene has some, `touching` contacts.

    Raises InputError with the choices.
    """
    if name not in METHODS:
        text = f"no method is called {name!r}; choose one of {choices(('auto', *METHODS))}"
        raise InputError(Problem("simulate", "method", text))
    if impulses and name != "moreau_jean" and not METHODS[name].eventful:
        text = f"{name} cannot take impulses: the scene has rigid contacts or joint limits, and it "
        text += "has no dense output to find them on; use 'moreau_jean', 'auto', or from event to "
        text += f"event {choices(m.name for m in METHODS.values() if m.eventful)}"
        raise InputError(Problem("simulate", "method", text))
    if name == "moreau_jean" and not touching:
        text = "moreau_jean is for impulses, and no contact and no limit acts here; use 'auto', or "
        text += "'semi_implicit_euler', which makes the same steps without them"
        raise InputError(Problem("simulate", "method", text))
    return METHODS[name]
