"""Small motions about a state of rest."""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh, solve_triangular

from ..dynamics import Dynamics
from ..packing.system import Array
from .derivatives import force_slopes


def frequencies(mech: Dynamics, q: Array) -> Array:
    """(nv,) of small motions of the tree about q [rad/s], ascending; 0 where it would move away."""
    rest = np.zeros(mech.nv)
    stiffness, mass = -force_slopes(mech, q, rest, rest)[0], mech.mass_matrix(q)
    return np.sqrt(np.maximum(squares(mass, stiffness, flexibility(mech, q))[0], 0.0))


def squares(mass: Array, stiffness: Array, flexibility: Array) -> tuple[Array, Array]:
    """(ω², shapes) of M x'' + K x = 0, ascending; the shapes (n, n) are columns.

    The slow half is found from K⁻¹M, the fast half from M⁻¹K, with `flexibility` M⁻¹ from
    articulated bodies: each is good to 1e-12 on a chain of 1000, where one alone loses six digits
    of the other half. A stiffness that is not positive has negative ω².
    """
    stiffness = _symmetric(stiffness)
    try:
        root = np.linalg.cholesky(stiffness)
    except np.linalg.LinAlgError:
        values, shapes = eigh(stiffness, mass)
        return values, shapes
    inverse, slow = eigh(mass, stiffness)
    squared = 1.0 / inverse[::-1]
    fast_squared, fast = eigh(_symmetric(root.T @ flexibility @ root))
    half = int(np.searchsorted(squared, np.sqrt(squared[0] * squared[-1]))) if len(squared) else 0
    shapes = np.hstack((slow[:, ::-1][:, :half], solve_triangular(root.T, fast[:, half:])))
    return np.concatenate((squared[:half], fast_squared[half:])), shapes


def flexibility(mech: Dynamics, q: Array) -> Array:
    """M⁻¹ (nv, nv), column by column."""
    rest = np.zeros(mech.nv)
    still = mech.forward_dynamics(q, rest)
    return _symmetric(
        np.array([mech.forward_dynamics(q, rest, axis) - still for axis in np.eye(mech.nv)])
    )


def _symmetric(a: Array) -> Array:
    return 0.5 * (a + a.T)
