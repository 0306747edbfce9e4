"""Visible shapes, colours and extents of bodies."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..shapes import picture_of
from . import shapes

MOMENTS = 40  # number of frames that pictures must contain
SEPARATE = 50  # bodies up to which each is a node of its own


class Look(NamedTuple):
    """The drawn shape of one body, and its description."""

    body: Any  # with the fields of `pg.Body`
    links: tuple[tuple[float, float, float], ...]  # positions of its children's joints at q = 0 [m]
    pieces: tuple[shapes.Piece, ...]
    color: shapes.Color
    plain: bool = False  # drawn in the colour of its branch

    def alike(self, other: Look) -> bool:
        """Check whether both have the same appearance."""
        same = self.pieces is other.pieces or _drawn(self.pieces) == _drawn(other.pieces)
        return same and self.color == other.color


def _drawn(pieces: Sequence[shapes.Piece]) -> list[Any]:
    return [
        (p.kind, p.file, p.size, p.position, p.rotation.tobytes(), p.color, p.opacity, p.taper)
        for p in pieces
    ]


def looks(
    bodies: Sequence[Any], children: Sequence[Sequence[int]], colors: Sequence[shapes.Color],
    before: Sequence[Look] = (), plain: bool = False,
) -> list[Look]:  # fmt: skip
    """Return the appearance of the bodies by number, reusing `before` if nothing changed.

    `plain`: in the bodies' colours; of those of their shapes what is dark or light stays.
    """
    found: list[Look] = []
    for k, (body, color) in enumerate(zip(bodies, colors)):
        links = tuple(bodies[child - 1].link for child in children[k + 1])
        known = before[k] if k < len(before) else None
        same = known is not None and known.body is body and known.links == links
        if known is not None and same and known.plain == plain:
            found.append(known._replace(color=color))
            continue
        pieces = shapes.pieces(body, links)
        if plain:
            pieces = tuple(replace(piece, color=shapes.shade(piece.color)) for piece in pieces)
        found.append(Look(body, links, pieces, color, plain))
    return found


def corners(pieces: Sequence[shapes.Piece]) -> np.ndarray:
    """Return the corners of bounding boxes around pieces, (n, 3), in body axes [m]."""
    which = np.array([*itertools.product((0, 1), repeat=3)])
    found = [p.position + picture_of(p).bounds(p)[which, range(3)] @ p.rotation.T for p in pieces]
    return np.concatenate(found) if found else np.zeros((1, 3))


ROOM = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))  # 1 m, the size without a body


def extent(looks: Sequence[Look], positions: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Return the corners of the drawn bodies at these poses (n, 3) [m], or of ROOM if none."""
    found = [p + corners(look.pieces) @ r.T for look, p, r in zip(looks, positions, R)]
    return np.concatenate(found) if found else ROOM


class Track:
    """The way of a mechanism through recorded poses (n, nb, 7), and all that is seen of it.

    If the mechanism travels further than its size, pictures follow it and move the ground.
    """

    def __init__(self, looks: Sequence[Look], poses: np.ndarray, up: np.ndarray):
        self.across = 1.0 - np.asarray(up)  # takes what is along the vertical out of a vector
        self.start = poses[0, 0, :3] if poses.shape[1] else np.zeros(3)
        first = extent(looks, poses[0, :, :3], shapes.to_matrix(poses[0, :, 3:]))
        gone = (poses[:, :1, :3] - self.start) * self.across
        still = shapes.diagonal(first)
        self.travels = bool(np.linalg.norm(gone, axis=-1).max(initial=0.0) > still)
        some = poses[np.unique(np.linspace(0, len(poses) - 1, MOMENTS).astype(int))]
        every = [extent(looks, p[:, :3] - self.gone(p), shapes.to_matrix(p[:, 3:])) for p in some]
        corners = np.concatenate(every)
        self.corners = corners if np.isfinite(corners).all() else first  # (m, 3) [m]
        self.size = shapes.diagonal(self.corners)  # [m]

    def gone(self, pose: np.ndarray) -> np.ndarray:
        """Return how far a picture of bodies at `pose` (nb, 7) has followed them, (3,) [m]."""
        return (pose[0, :3] - self.start) * self.across if self.travels else np.zeros(3)
