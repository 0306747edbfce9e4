"""Tableaus of Runge-Kutta methods, with error weights and polynomials for dense output.

Numbers of DOPRI5 from [Hairer, Norsett, Wanner 1993, II.5, II.6 and their code].
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..packing.system import Array
from .dop853 import DOP853_A, DOP853_D, DOP853_E, DOP853_THIRD


class Tableau(NamedTuple):
    """y(t + θ h) = y + h Σ k_i p_i(θ), the stages k_i at t + c_i h.

    A step takes the first s stages, s the length of `b`; stage s is the slope at its end, and
    those after it serve dense output alone.
    """

    a: Array  # (S, S)
    b: Array  # (s,)
    c: Array  # (S,)
    error: Array  # (1 or 2, s or s + 1) weights of error estimates; empty without one
    dense: Array  # (S, degree) coefficients of p_i: θ, θ², ...; empty without dense output


NONE = np.zeros((0, 0))


def _square(rows: Sequence[dict[int, float]], size: int) -> Array:
    """Sparse rows as an array, whose last rows they are."""
    found = np.zeros((size, size))
    for r, row in enumerate(rows, start=size - len(rows)):
        found[r, list(row)] = list(row.values())
    return found


def euler() -> Tableau:
    """Semi-implicit Euler needs no tableau."""
    return Tableau(NONE, np.zeros(0), np.zeros(0), NONE, NONE)


def rk4() -> Tableau:
    """The classical method of order 4."""
    b = np.array([1.0, 2.0, 2.0, 1.0]) / 6.0
    return Tableau(
        _square(({0: 0.5}, {1: 0.5}, {2: 1.0}), 4), b, np.array([0.0, 0.5, 0.5, 1.0]), NONE, NONE
    )


def dopri5() -> Tableau:
    """Order 5 with an error estimate of order 4 and dense output of order 4."""
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
    """Order 8 with error estimates of orders 5 and 3 and dense output of order 7."""
    a = _square(DOP853_A, 16)
    third = np.zeros(12)
    third[[0, 8, 11]] = DOP853_THIRD
    error = np.array([_square(DOP853_E, 12)[-1], a[12, :12] - third])
    return Tableau(
        a,
        a[12, :12].copy(),
        a.sum(axis=1),
        error,
        _interpolant(a[12], 12, _square(DOP853_D, 16)[-4:]),
    )


def _interpolant(b: Array, end: int, d: Array) -> Array:
    """p_i in powers of θ, of Hermite's cubic between both ends and the terms of `d`.

    y + θ (Δ + (1 - θ) (h k_0 - Δ + θ (2 Δ - h (k_0 + k_end) + (1 - θ) (h d_0 k + θ ...)))),
    Δ = h Σ b_i k_i.
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
    """Radau IIA of order 5: collocation at `c`."""
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
    """(7, 3): T and T⁻¹ that make A⁻¹ diagonal, its real and a complex eigenvalue.

    A⁻¹ = T Λ T⁻¹; as a complex number, the second and third of T⁻¹ z are multiplied by the
    complex eigenvalue ([Hairer, Wanner 1996, IV.8]).
    """
    values, vectors = np.linalg.eig(np.linalg.inv(a))
    real, pair = np.argmin(np.abs(np.imag(values))), np.argmax(np.imag(values))
    u = vectors[:, pair]
    t = np.column_stack((np.real(vectors[:, real]), np.real(u), -np.imag(u)))
    last = [np.real(values[real]), np.real(values[pair]), np.imag(values[pair])]
    return np.vstack((t, np.linalg.inv(t), last))


def ros2() -> Tableau:
    """Linearly implicit, order 2 with any Jacobian, L-stable ([Verwer et al. 1999])."""
    return Tableau(NONE, np.array([1.5, 0.5]), np.array([0.0, 1.0]), NONE, NONE)


def gauss6() -> Tableau:
    """Gauss collocation of three stages, order 6, symplectic ([Hairer et al. 2006, II.1.3])."""
    r = np.sqrt(15.0)
    a = np.array(
        [
            [5 / 36, 2 / 9 - r / 15, 5 / 36 - r / 30],
            [5 / 36 + r / 24, 2 / 9, 5 / 36 - r / 24],
            [5 / 36 + r / 30, 2 / 9 + r / 15, 5 / 36],
        ]
    )
    c = np.array([0.5 - r / 10, 0.5, 0.5 + r / 10])
    return Tableau(a, np.array([5.0, 8.0, 5.0]) / 18.0, c, NONE, NONE)


def generalised_alpha(radius: float) -> Tableau:
    """(α_m, α_f, β, γ) for a spectral radius at infinity ([Chung, Hulbert 1993, eqs. 17 to 25])."""
    mass, force = (2.0 * radius - 1.0) / (radius + 1.0), radius / (radius + 1.0)
    gamma = 0.5 - mass + force
    a = np.array([[mass, force, 0.25 * (1.0 - mass + force) ** 2, gamma]])
    return Tableau(a, np.array([1.0]), np.array([0.0, 1.0]), NONE, NONE)
