"""Integration methods as data, with their Butcher tableaus. The kernels perform the steps.

Coefficients of DOPRI5 and DOP853: [Hairer, Norsett, Wanner 1993, II.5, II.6 and their code].
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .engine import stepping
from .errors import InputError, Problem, choices, no_method
from .model.settings import ADAPTIVE

Array: TypeAlias = NDArray[np.float64]
STEPPING = stepping.__name__


class Tableau(NamedTuple):
    """The tableau for y(t + θ h) = y + h Σ k_i p_i(θ), with the stages k_i at t + c_i h.

    A step uses the first s stages, where s is the length of `b`. Stage s is the slope at the end of
    the step, and later stages are only used for dense output.
    """

    a: Array  # (S, S)
    b: Array  # (s,)
    c: Array  # (S,)
    error: Array  # (1 or 2, s or s + 1) weights of error estimates, empty without one
    dense: Array  # (S, degree) coefficients of p_i: θ, θ², ..., empty without dense output


class Method(NamedTuple):
    """An integration method, with its coefficients, step kernel and application."""

    name: str
    order: int
    tableau: Tableau
    use: str  # purpose in a few words
    step: str  # module and name of its kernel, loaded when it is first asked for
    # safety, exponents of this error and the last one, least and largest change of the width
    controller: tuple[float, float, float, float, float] = (0.9, 0.0, 0.0, 0.2, 6.0)
    limit: float = 0.0  # rate x step of an oscillation up to which steps hold it, 0 for damped ones
    damped: float = 0.0  # the same for damped oscillations, if it is smaller
    by_old_velocity: bool = False  # True if v' uses the velocity at the start of a step only
    stable: bool = False  # True if stable beyond this limit, where oscillations are inaccurate
    implicit: bool = False  # True if it solves equations
    jacobian: bool = False  # whether it does so with the Jacobian of v'
    # True if a step takes impulses, so that the forces of a frame are means since the last one. The
    # scene must have some: contacts, limits or friction of joints, whose dampers are implicit
    time_stepping: bool = False

    @property
    def kernel(self) -> Any:
        """The step kernel."""
        module, name = self.step.split(".")
        return getattr(import_module(f"{STEPPING}.{module}"), name)

    def matrix_rows(self, nv: int) -> int:
        """Return the rows of the real workspace of an implicit method."""
        return int(import_module(f"{STEPPING}.{self.step.split('.')[0]}").matrix_rows(nv))

    @property
    def of_duals(self) -> Any:
        """The kernel that repeats a step with derivatives."""
        module, name = self.step.split(".")
        if module == "explicit":
            return import_module(f"{STEPPING}.duals").explicit_of_duals
        where = "moreau_duals" if module == "moreau" else "implicit_duals"
        return getattr(import_module(f"{STEPPING}.{where}"), f"{name}_of_duals")

    @property
    def adaptive(self) -> bool:
        """Return True if the method can choose its steps by their error."""
        return self.name in ADAPTIVE

    @property
    def gain(self) -> float:
        """The factor by which half the step reduces the error."""
        return 2.0**self.order

    @property
    def starts(self) -> bool:
        """Return True if a step requires v' at its start."""
        return not self.time_stepping

    @property
    def explicit(self) -> bool:
        """Return True if a step follows from slopes alone, without equations or impulses."""
        return not (self.implicit or self.time_stepping)

    @property
    def plain(self) -> bool:
        """Return True if an explicit method has no error by which to choose its steps."""
        return self.explicit and not self.adaptive

    @property
    def eventful(self) -> bool:
        """Return True if the method supports event location within a step."""
        return self.explicit

    @property
    def evaluations(self) -> int:
        """The number of dynamics evaluations per step."""
        return max(len(self.tableau.b), 1)


def _pi(order: int, last: float, most: float) -> tuple[float, float, float, float, float]:
    """Return the gains of PI control for an error as h^order ([Hairer, Wanner 1996, IV.2])."""
    return 0.9, 1.0 / order - 0.75 * last, last, 0.2, most


# -- tableaus: of Runge-Kutta methods, with error weights and polynomials for dense output ---------

NONE = np.zeros((0, 0))


def _square(rows: Sequence[Mapping[Any, float]], size: int) -> Array:
    """Return a square array whose last rows are the given sparse rows {column: value}."""
    found = np.zeros((size, size))
    for r, row in enumerate(rows, start=size - len(rows)):
        found[r, [int(column) for column in row]] = list(row.values())
    return found


def euler() -> Tableau:
    """Create an empty tableau, since semi-implicit Euler does not need one."""
    return Tableau(NONE, np.zeros(0), np.zeros(0), NONE, NONE)


def rk4() -> Tableau:
    """Return the tableau of the classical fourth-order method."""
    b = np.array([1.0, 2.0, 2.0, 1.0]) / 6.0
    return Tableau(
        _square(({0: 0.5}, {1: 0.5}, {2: 1.0}), 4), b, np.array([0.0, 0.5, 0.5, 1.0]), NONE, NONE
    )


def dopri5() -> Tableau:
    """Create a tableau of order 5 with an error estimate of order 4 and dense output of order 4."""
    a = _square(
        (
            {0: 1 / 5},
            {0: 3 / 40, 1: 9 / 40},
            {0: 44 / 45, 1: -56 / 15, 2: 32 / 9},
            {0: 19372 / 6561, 1: -25360 / 2187, 2: 64448 / 6561, 3: -212 / 729},
            {0: 9017 / 3168, 1: -355 / 33, 2: 46732 / 5247, 3: 49 / 176, 4: -5103 / 18656},
            {0: 35 / 384, 2: 500 / 1113, 3: 125 / 192, 4: -2187 / 6784, 5: 11 / 84},
        ),
        7,
    )
    fourth = [5179 / 57600, 0.0, 7571 / 16695, 393 / 640, -92097 / 339200, 187 / 2100, 1 / 40]
    d = [
        -12715105075 / 11282082432,
        0.0,
        87487479700 / 32700410799,
        -10690763975 / 1880347072,
        701980252875 / 199316789632,
        -1453857185 / 822651844,
        69997945 / 29380423,
    ]
    return Tableau(
        a,
        a[6, :6].copy(),
        np.array([0.0, 0.2, 0.3, 0.8, 8 / 9, 1.0, 1.0]),
        (a[6] - fourth)[None],
        _interpolant(a[6], 6, np.array([d])),
    )


def dop853() -> Tableau:
    """Create a tableau of order 8 with errors of orders 5 and 3 and dense output of order 7."""
    known = json.loads((Path(__file__).parent / "dop853.json").read_text(encoding="utf-8"))
    a, third = _square(known["a"], 16), np.zeros(12)
    third[[0, 8, 11]] = known["third"]
    error = np.array([_square(known["e"], 12)[-1], a[12, :12] - third])
    return Tableau(
        a,
        a[12, :12].copy(),
        a.sum(axis=1),
        error,
        _interpolant(a[12], 12, _square(known["d"], 16)[-4:]),
    )


def _interpolant(b: Array, end: int, d: Array) -> Array:
    """Return the coefficients of p_i in powers of θ, given by the cubic Hermite interpolant and the
    terms in `d`.

    The polynomial is y + θ (Δ + (1 - θ) (h k_0 - Δ + θ (2 Δ - h (k_0 + k_end)
    + (1 - θ) (h d_0 k + θ ...)))) with Δ = h Σ b_i k_i.
    """
    unit = np.eye(len(b))
    parts = [b, unit[0] - b, 2 * b - unit[end] - unit[0], *d]
    powers = np.zeros((len(b), len(parts) + 1))
    for n in range(len(parts) - 1, -1, -1):
        powers[:, 0] += parts[n]
        shifted = np.roll(powers, 1, axis=1)
        powers = shifted if n % 2 == 0 else powers - shifted
    return powers[:, 1:].copy()


def radau5() -> Tableau:
    """Return the tableau of Radau IIA of order 5, with collocation at `c`."""
    r = np.sqrt(6.0)
    a = np.array(
        [
            [(88 - 7 * r) / 360, (296 - 169 * r) / 1800, (-2 + 3 * r) / 225],
            [(296 + 169 * r) / 1800, (88 + 7 * r) / 360, (-2 - 3 * r) / 225],
            [(16 - r) / 36, (16 + r) / 36, 1 / 9],
        ]
    )
    error = np.array([[-13 - 7 * r, -13 + 7 * r, -1.0]]) / 3.0
    c = np.array([(4 - r) / 10, (4 + r) / 10, 1.0])
    return Tableau(_decoupled(a), a[2].copy(), c, error, NONE)


def _decoupled(a: Array) -> Array:
    """Return (7, 3) rows of T, T⁻¹ and the eigenvalues of A⁻¹ = T Λ T⁻¹.

    As a complex number, the second and third of T⁻¹ z are multiplied by the complex eigenvalue
    ([Hairer, Wanner 1996, IV.8]).
    """
    values, vectors = np.linalg.eig(np.linalg.inv(a))
    real, pair = np.argmin(np.abs(np.imag(values))), np.argmax(np.imag(values))
    u = vectors[:, pair]
    t = np.column_stack((np.real(vectors[:, real]), np.real(u), -np.imag(u)))
    last = [np.real(values[real]), np.real(values[pair]), np.imag(values[pair])]
    return np.vstack((t, np.linalg.inv(t), last))


def gauss6() -> Tableau:
    """Return three-stage Gauss collocation, symplectic, order 6 ([Hairer et al. 2006, II.1.3])."""
    r = np.sqrt(15.0)
    a = np.array(
        [
            [5 / 36, 2 / 9 - r / 15, 5 / 36 - r / 30],
            [5 / 36 + r / 24, 2 / 9, 5 / 36 - r / 24],
            [5 / 36 + r / 30, 2 / 9 + r / 15, 5 / 36],
        ]
    )
    c = np.array([0.5 - r / 10, 0.5, 0.5 + r / 10])
    both = np.vstack((a, _decoupled(a)))
    return Tableau(both, np.array([5.0, 8.0, 5.0]) / 18.0, c, NONE, NONE)


# -- methods ---------------------------------------------------------------------------------------


SEMI_IMPLICIT = 2.0 * (np.sqrt(2.0) - 1.0)  # rate x step of critical damping, the least limit

METHODS = {
    method.name: method
    for method in (
        Method(
            "semi_implicit_euler", 1, euler(),
            "playback and long runs without drift of energy, at low accuracy",
            "explicit.semi_implicit", limit=2.0, damped=SEMI_IMPLICIT, by_old_velocity=True,
        ),
        Method(
            "rk4", 4, rk4(), "smooth motion at a fixed step",
            "explicit.runge_kutta", limit=2.83,
        ),
        Method(
            "dopri5", 5, dopri5(),
            "smooth motion to three to six digits, tables with many corners",
            "explicit.runge_kutta", controller=_pi(5, 0.04, 10.0), limit=1.0,
        ),
        Method(
            "dop853", 8, dop853(), "smooth motion to six digits and more",
            "explicit.runge_kutta", controller=_pi(8, 0.04, 6.0), limit=4.5,
        ),
        Method(
            "gauss6", 6, gauss6(),
            "conservative trees for very long: symplectic, the energy stays within a bound",
            "gauss.gauss", limit=3.0, stable=True, implicit=True,
        ),
        Method(
            "radau5", 5, radau5(),
            "stiff springs, dampers and friction, at steps that do not resolve them",
            "implicit.radau", controller=_pi(4, 0.04, 8.0), implicit=True,
            jacobian=True,
        ),
        Method(
            "moreau_jean", 1, euler(), "rigid contacts, joint limits and impacts, many at once",
            "moreau.moreau_jean", limit=2.0, damped=SEMI_IMPLICIT, time_stepping=True,
        ),
    )
}  # fmt: skip
CHOICES = "rk4", "dopri5", "dop853", "radau5", "moreau_jean"  # methods that "auto" chooses
RK4, DOPRI5, DOP853, RADAU5, MOREAU_JEAN = (METHODS[name] for name in CHOICES)


def method_of(name: str, *, impulses: bool = False, touching: bool = True) -> Method:
    """Return the method `name` for a scene with `impulses` or `touching` contacts.

    Raises InputError with the choices.
    """
    if name not in METHODS:
        raise InputError(Problem("simulate", "method", no_method(name, ("auto", *METHODS))))
    method = METHODS[name]
    if impulses and not (method.time_stepping or method.eventful):
        text = f"{name} cannot take impulses: the scene has rigid contacts or joint limits, and it "
        text += "has no dense output to find them on; use 'moreau_jean', 'auto', or from event to "
        text += f"event {choices(m.name for m in METHODS.values() if m.eventful)}"
        raise InputError(Problem("simulate", "method", text))
    if method.time_stepping and not touching:
        text = f"{name} is for impulses, and no contact, limit or joint friction acts here; "
        text += "use 'auto', or 'semi_implicit_euler', which also takes fixed steps of order 1"
        raise InputError(Problem("simulate", "method", text))
    return method
