"""Connections and forces that a page draws beside bodies, as faces for pictures and films."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from pgraph_core.rotation import frame_of
from pgraph_core.show import shapes

from ..run import Playback, Run
from . import SHOWN_AT_FIRST, State, marks, ties
from .overlays import HEAD, JOINING, LOAD, SHAFT

if TYPE_CHECKING:
    from pgraph_core.show.pictures import Beside

FORCE = (11, 125, 99)  # the colour of forces in the page's light theme

Solid = tuple[np.ndarray, np.ndarray, Any, float]  # corners (m, 3, 3), normals, colour, opacity


def drawn_beside(
    run: Run, shown: frozenset[str] = SHOWN_AT_FIRST
) -> Callable[[float, np.ndarray], Beside]:
    """Return a function of a time [s] and the poses (nb, 7) that gives the faces of what `shown`
    names besides bodies."""
    from pgraph_core.show.pictures import Beside  # compiles kernels of its own

    def beside(time: float, pose: np.ndarray) -> Beside:
        playback = Playback(time=time)
        state = State(run.model, last_run=run, request=run.request, shown=shown, playback=playback)
        return Beside.of(list(_solids(state, pose[:, :3], shapes.to_matrix(pose[:, 3:]))))

    return beside


def _solids(state: State, positions: np.ndarray, R: np.ndarray) -> Iterator[Solid]:
    if "joining" in state.shown:
        for kind, found in ties.joinings(state, positions, R).items():
            make, color, opacity = JOINING[kind]
            turns = shapes.to_matrix(found.wxyz)
            for k, (at, turn, size) in enumerate(zip(found.at, turns, found.size)):
                own = color if found.colors is None else found.colors[k]
                yield _placed(make, at, turn, size, own, 1.0 if opacity is None else opacity)
        yield from _arrows(marks.loads(state, positions, R), state.derived.size, LOAD)
    if "forces" in state.shown:
        found = marks.arrows(marks.pushes(state, positions, R), marks.scale(state))
        yield from _arrows(found, state.derived.size, FORCE)


def _arrows(arrows: np.ndarray, size: float, color: Any) -> Iterator[Solid]:
    """Yield shafts and heads of arrows (n, 2, 3), as wide as those of the page."""
    for tail, tip in arrows:
        if (length := float(np.linalg.norm(tip - tail))) == 0.0:
            continue
        turn, (shaft, wide, tall) = frame_of((tip - tail) / length), (SHAFT, *HEAD)
        head = min(tall * size, length)
        middle = tail + (tip - tail) * (1.0 - head / length) / 2.0
        thick = (2 * shaft * size, 2 * shaft * size, length - head)
        yield _placed(_cylinder, middle, turn, np.array(thick), color, 1.0)
        back = turn @ np.diag([1.0, -1.0, -1.0])  # the cone widens from its apex
        widths = np.array((2 * wide * size, 2 * wide * size, head))
        yield _placed(shapes.cone, tip, back, widths, color, 1.0)


def _cylinder() -> Any:
    return shapes.unit("cylinder")


def _placed(
    make: Callable[[], Any], at: np.ndarray, turn: np.ndarray, size: np.ndarray, color: Any,
    opacity: float,
) -> Solid:  # fmt: skip
    corners, normals = _unit(make)
    scaled = normals / np.where(size > 0, size, 1.0)
    scaled /= np.maximum(np.linalg.norm(scaled, axis=-1, keepdims=True), 1e-300)
    return at + (corners * size) @ turn.T, scaled @ turn.T, color, opacity


@cache
def _unit(make: Callable[[], Any]) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners (m, 3, 3) and their normals of a unit solid."""
    solid = make()
    return np.asarray(solid.vertices)[solid.faces], np.asarray(solid.vertex_normals)[solid.faces]
