"""Small motions about a state of rest."""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh

from ..dynamics import Dynamics
from ..packing.system import Array
from .derivatives import force_slopes


def frequencies(mech: Dynamics, q: Array) -> Array:
    """(nv,) of small motions of the tree about q [rad/s], ascending; 0 where it would move away.

    The slow half is found from K⁻¹M, the fast half from M⁻¹K, with M⁻¹ from articulated bodies:
    each is good to 1e-12 on a chain of 1000, where one alone loses six digits of the other half.
    """
    rest = np.zeros(mech.nv)
    stiffness, mass = -force_slopes(mech, q, rest, rest)[0], mech.mass_matrix(q)
    stiffness = 0.5 * (stiffness + stiffness.T)
    try:
        root = np.linalg.cholesky(stiffness)
    except np.linalg.LinAlgError:
        return np.sqrt(np.maximum(eigh(stiffness, mass, eigvals_only=True), 0.0))
    slow = 1.0 / np.sqrt(eigh(mass, stiffness, eigvals_only=True))[::-1]
    fast = np.sqrt(eigh(_symmetric(root.T @ _flexibility(mech, q) @ root), eigvals_only=True))
    half = np.searchsorted(slow, np.sqrt(slow[0] * slow[-1]))
    return np.concatenate((slow[:half], fast[half:]))


def _flexibility(mech: Dynamics, q: Array) -> Array:
    """M⁻¹ (nv, nv), column by column."""
    rest = np.zeros(mech.nv)
    still = mech.forward_dynamics(q, rest)
    return _symmetric(
        np.array([mech.forward_dynamics(q, rest, axis) - still for axis in np.eye(mech.nv)])
    )


def _symmetric(a: Array) -> Array:
    return 0.5 * (a + a.T)
