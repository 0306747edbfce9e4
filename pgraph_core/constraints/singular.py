"""Singular positions that a run passed: what its dips were, in words, at next to no cost.

The kernels keep the places where pivots fell far below their largest
(`engine/constraints/dips.py`). Here the smallest eigenvalue of Ω that is not always zero is
followed along the velocity from there: at a singular position it touches zero, as the square of the
distance.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..engine import layout as at
from ..engine import motion
from ..engine.constraints.proximal import FACTORED
from ..engine.stepping import run
from ..system import Array
from .null_rows import named, standing_for

if TYPE_CHECKING:
    from ..mechanism.scene import Scene

NULL = 1e-8  # of the mean of Ω's diagonal: an eigenvalue that is zero
TOUCHES = 1e-6  # of it: a position as good as singular, a thousandth of a radian away
REACH = 1.5  # times the way between two evaluations: how far the nearest place can be
LOOKS = 3  # parabolas through the eigenvalue
AWAY = 0.05  # rad, m: from a singular position to a place that is none
LISTED = 4
SHARE = 1e-2  # of the largest: an entry of a direction that is null but for a thousandth


Instant = tuple[float, Array, Array]  # t, q, v


class Passed(NamedTuple):
    """A singular position on the way of a run."""

    t: float
    rows: tuple[str, ...]  # what says nothing new only there


class _Look:
    """Ω of a scene's constraints at places along a velocity."""

    def __init__(self, scene: Scene, t: float, q: Array, v: Array):
        self.scene, self.t, self.q, self.v = scene, t, q, v
        self.rows = int(scene.space.dips[0, at.DIP_ROWS])

    def eigen(self, tau: float) -> tuple[Array, Array]:
        """(values over the mean diagonal, vectors) of Ω a time tau on, constraints met."""
        q, v = self.q.copy(), self.v.copy()
        run.move(self.scene.mech.tree[0], q, v, tau)
        for _ in range(2):  # onto the constraints, and Ω there
            self.scene.space.vectors[FACTORED, 2] = 0.0
            motion.projection(self.scene.held, self.t + tau, q, v, 1)
        omega = self.scene.space.omega[: self.rows, : self.rows]
        values, vectors = np.linalg.eigh(omega)
        return values * self.rows / np.trace(omega), vectors

    def only_there(self, tau: float, usual: Array) -> Passed | None:
        """The position a time tau on, if rows are null there beside the `usual` combinations."""
        values, vectors = self.eigen(tau)
        count = int((values < TOUCHES).sum())
        if count <= usual.shape[1]:
            return None
        always = standing_for(usual.T)
        rows = [r for r in standing_for(vectors[:, :count].T, SHARE) if r not in always]
        return Passed(self.t + tau, tuple(named(self.scene, rows)))

    def lowest(self, width: float, nulls: int) -> float:
        """When within `width` eigenvalue number `nulls` is smallest."""
        middle, step = 0.0, width
        for _ in range(LOOKS):
            a, b, c = (float(self.eigen(middle + x)[0][nulls]) for x in (-step, 0.0, step))
            bend = a - 2 * b + c
            if not bend > 0:
                break
            middle = float(np.clip(middle + step * (a - c) / (2 * bend), -width, width))
            step *= 0.25
        return middle


def passed(scene: Scene) -> list[Passed]:
    """Singular positions among the first dips of the active constraints, each once."""
    found: list[Passed] = []
    nq, nv = scene.mech.nq, scene.mech.nv
    for dip in scene.space.dips[1:]:
        if dip[at.DIP_DEPTH] > 0:
            q, v = np.split(dip[at.DIP_STATE : at.DIP_STATE + nq + nv].copy(), [nq])
            look, apart = _Look(scene, float(dip[at.DIP_TIME]), q, v), float(dip[at.DIP_APART])
            place = _touched(look, REACH * apart)
            if place and not any(abs(place.t - other.t) <= apart for other in found):
                found.append(place)
    return found


def _touched(look: _Look, width: float) -> Passed | None:
    """The singular position within `width` of a dip's deepest place; None where there is none."""
    fastest = float(np.max(np.abs(look.v), initial=0.0))
    if fastest == 0.0 or look.rows == 0:
        return None
    around = [look.eigen(sign * max(width, AWAY / fastest)) for sign in (-1.0, 1.0)]
    values, usual = min(around, key=lambda eigen: int((eigen[0] < NULL).sum()))
    nulls = int((values < NULL).sum())
    if nulls == len(values):
        return None
    tau = look.lowest(width, nulls)
    return look.only_there(tau, usual[:, :nulls])


def _began(scene: Scene, start: Instant, end: Instant) -> Passed | None:
    """The initial position, where rows are null that are not at the end of the run."""
    values, usual = _Look(scene, *end).eigen(0.0)
    return _Look(scene, *start).only_there(0.0, usual[:, values < TOUCHES])


def singular_notice(scene: Scene, start: Instant, end: Instant, redundant: bool) -> str:
    """What a person should know of the singular positions that a run passed; "" if none.

    `start` and `end` are those of the run; `redundant`: whether rows were at the start.
    """
    dips = int(scene.space.dips[0, at.DIP_COUNT])
    places = passed(scene) if dips else []
    if not places:
        began = _began(scene, start, end) if redundant else None
        where = "the run began at a singular position"
    else:
        began = places[0]
        most = "at least " if dips >= at.DIPS else ""
        many = f", the first of {most}{len(places)}," if len(places) > 1 else ""
        where = f"at t = {began.t:.4g} s the run passed a singular position{many} or close by one"
    if began is None:
        return ""
    listed = ", ".join(began.rows[:LISTED]) + (" ..." if len(began.rows) > LISTED else "")
    return (
        f"{where}: {listed} {'says' if len(began.rows) < 2 else 'say'} nothing new there, so that "
        "more than one motion leads on; it took the one that its velocity or rounding was on, and "
        "its error estimate may be too low"
    )
