"""The integration methods as data: adding one is one entry."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .errors import InputError, Problem, choices
from .kernels import moreau, run
from .system import Array


class Method(NamedTuple):
    """An explicit Runge-Kutta tableau, or none for semi-implicit Euler."""

    name: str
    order: int
    a: Array  # (s, s)
    b: Array  # (s,)
    c: Array  # (s,)
    step: Any  # the kernel that makes a step
    use: str  # what it is for

    @property
    def evaluations(self) -> int:
        """Evaluations of the dynamics a step."""
        return max(len(self.b), 1)


RK4 = Method(
    "rk4",
    4,
    np.array(
        [[0.0, 0.0, 0.0, 0.0], [0.5, 0.0, 0.0, 0.0], [0.0, 0.5, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]
    ),
    np.array([1.0, 2.0, 2.0, 1.0]) / 6.0,
    np.array([0.0, 0.5, 0.5, 1.0]),
    run.runge_kutta,
    "smooth motion at a fixed step",
)
SEMI_IMPLICIT_EULER = Method(
    "semi_implicit_euler",
    1,
    np.zeros((0, 0)),
    np.zeros(0),
    np.zeros(0),
    run.semi_implicit,
    "playback and long runs without drift of energy, at low accuracy",
)
MOREAU_JEAN = Method(
    "moreau_jean",
    1,
    np.zeros((0, 0)),
    np.zeros(0),
    np.zeros(0),
    moreau.moreau_jean,
    "rigid contacts, joint limits and impacts, many at once",
)
METHODS = {method.name: method for method in (RK4, SEMI_IMPLICIT_EULER, MOREAU_JEAN)}


def method_of(name: str, *, impulses: bool = False) -> tuple[Method, str]:
    """The method called `name`, and why; "auto" chooses: `impulses` says that the scene has some.

    Raises InputError with the choices.
    """
    if name == "auto" and impulses:
        return MOREAU_JEAN, "moreau_jean: the scene has rigid contacts or joint limits"
    if name == "auto":
        return RK4, "rk4: the most accurate of the methods for smooth motion at a fixed step"
    if name not in METHODS:
        text = f"no method is called {name!r}; choose one of {choices(('auto', *METHODS))}"
        raise InputError(Problem("simulate", "method", text))
    if impulses and name != MOREAU_JEAN.name:
        text = f"{name} cannot take impulses: the scene has rigid contacts or joint limits; use "
        raise InputError(Problem("simulate", "method", f"{text}'moreau_jean' or 'auto'"))
    return METHODS[name], f"{name}: as asked"
