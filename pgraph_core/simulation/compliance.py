"""The fastest rates of bodies on soft and penalty contacts.

The points of a shape that touch at once act as springs and dampers in all three directions. Their
effective mass includes the rotation of the body and the inertia of its tree.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from ..contact.tables import Tables, pull_of
from ..engine import layout as at
from ..engine.arrays import Geometry
from ..engine.records import CYLINDER, PENALTY, SOFT
from ..mechanism import Mechanism
from ..packing import Array, home_of
from ..rotation import skew


class Ends(NamedTuple):
    """The points of a shape that touch at once."""

    one: float  # largest inverse effective mass of a point, in any direction [1/kg]
    total: float  # inverse mass for all of them together [1/kg]
    points: int


def fastest_contact(mech: Mechanism, contacts: Tables, q: Array) -> float:
    """Compute about the fastest rate [1/s] of soft and penalty contacts of bodies at rest in q.

    Shapes of one body touch one at a time, and bodies that touch each other have separate trees.
    """
    if not contacts.compliant:
        return 0.0
    found, laws, pull = contacts.candidates, contacts.laws, pull_of(mech.model)
    q = q[: mech.nq]  # without the states of controls
    inertia, known = mech.mass_matrix(q), dict[int, Ends]()

    def ends(i: int) -> Ends:
        if i not in known:
            known[i] = _ends(mech, contacts.geometry, i, inertia, q)
        return known[i]

    def rates() -> Iterator[float]:
        for i, pair in (*found.on_ground.tolist(), *found.members.tolist()):
            yield rate_of(laws[pair], ends(i).total, ends(i).points, pull)
        for i, k, pair in found.pairs.tolist():
            both = [one for one in (ends(i), ends(k)) if one.points]
            count = min(one.points for one in both)
            total = sum(max(x.one, x.total * count / x.points) for x in both)
            yield rate_of(laws[pair], total, count, pull)

    return max(rates(), default=0.0)


def rate_of(law: Any, mobility: float, points: int, pull: float) -> float:
    """Compute the rate [1/s] of a body on points with a soft or penalty law, damper and friction.

    `mobility` [1/kg] is the inverse effective mass of all points together.
    """
    stiffness, mass, loss = (float(law[name]) for name in ("stiffness", "mass", "loss"))
    damping, share = float(law["damping"]), mass / points
    if law["law"] == SOFT:
        load = share * pull
        depth = (load / stiffness) ** (2 / 3)
        damping += loss / np.sqrt(0.8 * pull * depth) + law["friction"] / law["creep"]
        return _fastest_root(1.5 * load / depth * mobility, damping * load * mobility)
    if law["law"] == PENALTY:
        damping += loss * np.sqrt(stiffness * share)
        return _fastest_root(stiffness * mobility, damping * mobility)
    return 0.0


def _fastest_root(squared: float, damping: float) -> float:
    """Return the largest modulus of the roots of s² + damping s + squared [1/s]."""
    return float(np.abs(np.roots((1.0, damping, squared))).max())


def _ends(mech: Mechanism, geometry: Geometry, i: int, inertia: Array, q: Array) -> Ends:
    """Return the points of shape i that touch at once, where they move most."""
    shape, system = geometry.shapes[i], mech.packed.system
    if not shape["row"]:
        return Ends(0.0, 0.0, 0)
    body = int(shape["body"])
    home, offset = home_of(system, body), system.bodies_f[body, at.OFFSET : at.OFFSET + 3]
    moves = mech.jacobian(q, mech.names[body - 1], frame="body")
    tree = np.flatnonzero(inertia[moves.any(axis=0)].any(axis=0))
    moves = moves[:, tree]
    free = moves @ np.linalg.pinv(inertia[np.ix_(tree, tree)], hermitian=True) @ moves.T
    found = Ends(0.0, 0.0, 0)
    for places in _together(geometry, shape):
        places = (places @ shape["rotation"].reshape(3, 3).T + shape["position"] - offset) @ home
        rows = np.stack([np.hstack((-skew(x), np.eye(3))) for x in places])
        one = np.linalg.eigvalsh(rows @ free @ rows.swapaxes(1, 2))[:, -1].max()
        total = np.linalg.eigvals(free @ np.einsum("nij,nik->jk", rows, rows)).real.max()
        found = max(found, Ends(float(one), float(total), len(places)), key=lambda x: x.total)
    return found


def _together(geometry: Geometry, shape: Any) -> Iterator[Array]:
    """Yield the places (n, 3) in a shape's frame that may touch at once [m]."""
    first, half = shape["first_vertex"], shape["half_extents"]
    vertices = geometry.vertices[first : first + shape["vertices"]]
    for face in geometry.faces[shape["first_face"] : shape["first_face"] + shape["faces"]]:
        ring = geometry.rings[face["first"] : face["first"] + face["corners"]]
        yield geometry.vertices[ring + first]
    if shape["kind"] == CYLINDER:
        for end in (1, -1):
            yield shape["middle"] + half * ((1, 0, end), (-1, 0, end), (0, 1, end), (0, -1, end))
    elif not shape["faces"]:
        beside = vertices if len(vertices) else shape["middle"][None]
        reach = np.full(3, shape["radius"]) if len(vertices) else half
        for way in np.vstack((np.eye(3), -np.eye(3))):
            yield beside + way * reach
