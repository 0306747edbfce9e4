"""Joint motion: frames, link vectors, H and a for every body, eqs. (5)-(9)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from .. import joints
from ..errors import InputError, Problem, explained, shown
from ..joints import Motion
from ..model import Body, Model
from ..model.poses import Pose, carried, direction, displacement, elementary, poses, slide, turn
from ..rotation import Array, matrix, skew
from ..topology import Ints, Topology, find


class Joint(NamedTuple):
    """A joint at a given state in world axes, with H and a at the body's origin."""

    rotation: Array  # (3, 3) attitude of the body
    link: Array  # (3,) from the parent's origin to the body's, displacement included [m]
    omega: Array  # (3,) angular velocity of the body [rad/s]
    H: Array  # (6, dof), eqs. (6), (7)
    a: Array  # (6,), eq. (9) with R4


def bodies_of(model: Model, topology: Topology) -> list[Body]:
    """Return the rows of the table in number order."""
    return [model.bodies[row] for row in topology.row]


def q_slices(bodies: Sequence[Body]) -> list[slice]:
    """Return each body's slice of q."""
    return _slices([joints.nq(body.sequence) for body in bodies])


def v_slices(bodies: Sequence[Body]) -> list[slice]:
    """Return each body's slice of v."""
    return _slices([joints.nv(body.sequence) for body in bodies])


def _slices(sizes: list[int]) -> list[slice]:
    ends = list(accumulate(sizes))
    return [slice(end - size, end) for size, end in zip(sizes, ends)]


def frames(model: Model, topology: Topology, q: Sequence[float] | Array) -> tuple[Array, Array]:
    """Return origins (nb, 3) and rotations (nb, 3, 3) of the bodies in the world, by number."""
    bodies = bodies_of(model, topology)
    found = [Pose(np.zeros(3), np.eye(3))]  # of the ground
    for body, p, place in zip(bodies, topology.parent.tolist(), q_slices(bodies)):
        found.append(carried(found[p], body, q[place]))
    return _arrays(found[1:])


@explained
def home_poses(model: Model) -> tuple[Array, Array]:
    """Return positions and rotations of all bodies at the initial coordinates of the model.

    Parameters
    ----------
    model : Model
        The model.

    Returns
    -------
    ndarray (n, 3), ndarray (n, 3, 3)
        Origins [m] and rotations in the order of numbers, as from `frames`.

    Raises
    ------
    InputError
        If `model` is not a Model.
    """
    if not isinstance(model, Model):
        text = f"must be a pg.Model; given {shown(model)}"
        raise InputError(Problem("home_poses", "model", text))
    topology = Topology.of(model)
    bodies = bodies_of(model, topology)
    found = poses(bodies)
    return _arrays([found[body.name] for body in bodies])


def _arrays(found: Sequence[Pose]) -> tuple[Array, Array]:
    """Return the origins (nb, 3) and rotations (nb, 3, 3) of these poses."""
    position = np.array([pose.position for pose in found]).reshape(-1, 3)
    return position, np.array([pose.rotation for pose in found]).reshape(-1, 3, 3)


def axes_of_motion(motion: Motion, turned: Array, home: Array) -> Array:
    """Return H (6, dof) for one motion, from eq. (6) for a rotation and eq. (7) for a slide."""
    none = np.zeros((3, 3))
    if motion.kind in joints.AXIAL:
        h = (turned @ direction(motion, home))[:, None]
        return np.vstack((0 * h if motion.kind == "translate" else h, slide(motion) * h))
    if motion.kind == "ball":
        return np.vstack((turned, none))
    return np.block([[turned, none], [none, turned]])


def joint_motion(body: Body, rotation: Array, omega: Array, q: Array, v: Array) -> Joint:
    """Return the joint of a body whose parent has this rotation and angular velocity.

    Every motion is a step of eqs. (5) and (8) by itself; their φ, H and a are chained, so that one
    block H (6 x dof) and one a represent the whole joint.
    """
    turned, home = rotation, matrix(body.rotation)
    link = rotation @ body.link
    H, a = np.zeros((6, 0)), bias(omega, link, np.zeros(6))
    start = 0
    for motion, x in elementary(body, q):
        step = displacement(motion, turned, home, x)
        axes = axes_of_motion(motion, turned, home)
        relative = axes @ v[start : start + axes.shape[1]]
        H = np.hstack((phi(step) @ H, axes))
        a = phi(step) @ a + bias(omega, step, relative)
        link, omega = link + step, omega + relative[:3]
        turned = turned @ turn(motion, home, x)
        start += axes.shape[1]
    return Joint(turned @ home, link, omega, H, a)


def bias(omega: Array, link: Array, relative: Array) -> Array:
    """Return a from eq. (9) for any motion (R4). `relative` = H θ' is the velocity across it.

    [ω × ω_rel; ω × (ω × l) + 2 ω × l'_rel], ω of the body before the motion. The printed
    ω_j × ω_κ is the first term of a hinge; the Coriolis term 2 ω × l' is missing there.
    """
    slide = np.cross(omega, np.cross(omega, link)) + 2 * np.cross(omega, relative[3:])
    return np.concatenate((np.cross(omega, relative[:3]), slide))


# -- operators of the structure --------------------------------------------------------------------


def phi(link: Sequence[float] | Array) -> Array:
    """Return the propagation matrix φ (6, 6) of eq. (6): V at the far end of `link` = φ V."""
    shift = np.eye(6)
    shift[3:, :3] = -skew(link)
    return shift


def blocks(
    rows: Sequence[int] | Ints, columns: Sequence[int] | Ints, data: Array, shape: tuple[int, int]
) -> Any:
    """Return a sparse block matrix with `shape` blocks, and a 6x6 block at each (row, column)."""
    at, column = np.asarray(rows, dtype=np.int64), np.asarray(columns, dtype=np.int64)
    order = np.lexsort((column, at))
    start = np.searchsorted(at[order], np.arange(shape[0] + 1))
    data = np.reshape(data, (-1, 6, 6))[order]
    size = (6 * shape[0], 6 * shape[1])
    from scipy import sparse

    matrix = sparse.bsr_array((data, column[order], start), shape=size, blocksize=(6, 6)).tocsr()
    matrix.eliminate_zeros()
    return matrix


def kernel_operator(parent: Ints, link: Array) -> Any:
    """Return ε_φ = Σ e_κ φ_κ,j e_jᵀ (6 nb, 6 nb), eq. (13), of `link` (nb, 3) in world axes [m]."""
    child = np.flatnonzero(parent)
    data = np.array([phi(link[k]) for k in child])
    return blocks(child, parent[child] - 1, data, (len(parent), len(parent)))


def kernel_operator_of_pgraph(pgraph: Sequence[int] | Ints, link: Array) -> Any:
    """Build ε_φ from Pgraph alone, Fig. 6. No adjacency matrix is required or formed.

    Walk Pgraph: the entry before the first occurrence of a body is its parent.
    """
    pgraph = np.asarray(pgraph, dtype=np.int64)
    first = find(pgraph)
    inner = [i for i in first if i > 0 and pgraph[i] > 0 and pgraph[i - 1] > 0]
    rows, columns = pgraph[inner] - 1, pgraph[[i - 1 for i in inner]] - 1
    data = np.array([phi(link[k]) for k in rows])
    return blocks(rows, columns, data, (len(link), len(link)))


def propagation_operator(parent: Ints, link: Array) -> Any:
    """Return Φ = (1 - ε_φ)⁻¹, eq. (16), from products of φ along paths, as a sparse (6 nb, 6 nb)
    matrix.

    Block row κ is φ_κ,ρ(κ) times block row ρ(κ), and 1 at κ: no inverse is formed, and block
    (κ, j) is there only if j is an ancestor of κ or κ itself. O(n · depth).
    """
    paths: list[Ints] = []
    rows: list[Array] = []
    for k, p in enumerate(parent.tolist()):
        path = np.append(paths[p - 1], k) if p else np.array([k])
        ahead = phi(link[k]) @ rows[p - 1] if p else np.zeros((0, 6, 6))
        paths.append(path)
        rows.append(np.concatenate((ahead, np.eye(6)[None])))
    at = np.repeat(np.arange(len(parent)), [len(path) for path in paths])
    return blocks(at, np.concatenate(paths), np.concatenate(rows), (len(parent), len(parent)))
