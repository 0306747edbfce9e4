"""Bodies of a packed model where forces need them: rows, and poses in the initial state."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import ModelError, Problem
from ..fields import GROUND
from ..forces import LOADS
from ..forces.cable import Part
from ..forces.obstacles import obstacle_of, turned_by
from ..model import Force, Model
from ..topology import Topology
from . import Array, System, home_of, joint_coordinates, point_in_row
from .cables import Segment, one_length, segments


class Placed:
    """Body poses and rows in a packed model, as required by `Places` of `forces`."""

    def __init__(
        self, model: Model, topology: Topology, packed: System, home: Sequence[Array],
        q: Array | None = None,
    ):  # fmt: skip
        """Store the model. `home` contains the body poses in the initial state, or at `q`."""
        self._q = packed.q if q is None else q
        self.body, self.number, self.packed, self._home = model.body, topology.number, packed, home
        self._model = model

    def home(self, name: str) -> Array:
        """Return the home orientation of a body as a (3, 3) matrix."""
        return home_of(self.packed, self.number(name))

    def home_of_number(self, number: int) -> Array:
        """Return the home orientation (3, 3) of a body by its number."""
        return home_of(self.packed, number)

    def coordinate_at_start(self, name: str, k: int) -> float:
        """Return coordinate k of the joint of a body in the initial state [rad, m]."""
        return float(self._q[joint_coordinates(self.packed, self.number(name))[k][1]])

    def in_row(self, name: str, point: Any) -> Array:
        """Convert a point (3,) [m] from body axes to the home axes of its row."""
        return point_in_row(self.packed, self.number(name), point)

    def at_start(self, name: str, point: Any) -> Array:
        """Return the position of a body point in the initial state (3,) [m]."""
        if name == GROUND:
            return np.array(point)
        return self._home[0][self.number(name) - 1] + self.turn_at_start(name) @ np.array(point)

    def turn_at_start(self, name: str) -> Array:
        """Return the orientation of a body in the initial state as a (3, 3) matrix."""
        return np.eye(3) if name == GROUND else self._home[1][self.number(name) - 1]

    def segments(self, cable: Any) -> list[Segment]:
        """Return the segments of a cable between the stations that hold it. Raises ModelError."""

        def refuse(text: str, field: str = "through") -> ModelError:
            return ModelError(Problem(f"{cable.word()} '{cable.name}'", field, text))

        found = segments(cable.through, cable.closed, self, self._model, self.packed, refuse)
        chains = sum(one.number == 0 for one in found)  # segments between grips
        if cable.length is not None and chains > 1:
            raise refuse(one_length(cable.own_kind(), chains), "length")
        return found

    def path_rows(self, forces: Sequence[Force]) -> list[tuple[str, range]]:
        """Return the name and the rows of each force along a path, in the order of all rows."""
        found, first = list[tuple[str, range]](), 0
        for kind in LOADS:
            for f in forces if kind.action.tension is not None else ():
                if type(f) in kind.parts:
                    end = first + len(kind.split(f, self))
                    found.append((f.name, range(first, end)))
                    first = end
        return found

    def vias(self, part: Any) -> Sequence[tuple[Any, ...]]:
        """Return the fields of VIA for each point of a row besides its two ends."""
        if isinstance(part, Part):
            return part.segment.chain.rows.tolist()
        return [_packed_via(via, self) for via in part._places]


def _packed_via(via: Any, at: Placed) -> tuple[Any, ...]:
    """Return the fields of VIA for a point or an obstacle."""
    body, given = at.number(via.body), turned_by(obstacle_of(via), at.home(via.body))
    station = 0, 0, 0.0, 0.0, 0.0
    return at.packed.row_of(body), body, at.in_row(via.body, via.point), *given.values(), *station
