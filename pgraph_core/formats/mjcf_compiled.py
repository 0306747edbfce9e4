"""MuJoCo's compiled model, as seen by the MJCF readers."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from ..errors import needed
from ..rotation import matrix
from .conversion import Report

Array = np.ndarray
FREE, BALL, SLIDE, HINGE = range(4)  # mjtJoint
MINVAL = 1e-15  # kg, kg m²: MuJoCo's mjMINVAL, below which a mass or an inertia is none
GREY = (0.5, 0.5, 0.5, 1.0)  # the colour that MuJoCo gives a geom without one


class Geom(NamedTuple):
    """The numbers in a geom that define a shape."""

    kind: int
    group: int
    size: list[float]
    quat: list[float]
    rgba: tuple[float, ...] | None  # colour of the geom or its material, from 0 to 1


class Compiled:
    """MuJoCo's compiled model. Tables are cached because every attribute access creates a new
    array."""

    def __init__(self, model: Any):
        self.model = model

    def __getattr__(self, name: str) -> Any:
        return vars(self).setdefault(name, getattr(self.model, name))

    @cached_property
    def home(self) -> Any:
        """MuJoCo's data with positions and axes in the file's initial pose."""
        mujoco = needed("mujoco", "mjcf")
        data = mujoco.MjData(self.model)
        mujoco.mj_kinematics(self.model, data)
        return data

    @cached_property
    def inertias(self) -> Array:
        """The inertia of each body about its centre of mass in its own axes (nbody, 3, 3)."""
        axes = np.array([matrix(quat) for quat in self.body_iquat.tolist()])
        found = (axes * self.body_inertia[:, None]) @ axes.swapaxes(1, 2)
        return (found + found.swapaxes(1, 2)) / 2

    @cached_property
    def colours(self) -> Array:
        """The colour of each geom or of its material as in the file, NaN without one."""
        plain = (self.geom_rgba == np.array(GREY, np.float32)).all(axis=1)
        own, material = np.where(plain[:, None], np.nan, self.geom_rgba), self.geom_matid
        of_material = plain & (material >= 0)
        own[of_material] = self.mat_rgba[material[of_material]]
        return own

    @cached_property
    def geoms(self) -> list[Geom]:
        """The geoms, indexed by number."""
        own = np.clip(self.colours, 0.0, 1.0)
        for k, mean in self.textured.items():
            own[self.geom_matid == k, :3] *= mean
        colours = zip(np.isnan(own[:, 0]).tolist(), own.tolist(), strict=True)
        rgba = (None if none else tuple(one) for none, one in colours)
        tables = (self.geom_type, self.geom_group, self.geom_size, self.geom_quat)
        return [*map(Geom, *(table.tolist() for table in tables), rgba)]

    @cached_property
    def textured(self) -> dict[int, Array]:
        """The mean texture colour (3,) for each material with a texture."""
        role = int(needed("mujoco", "mjcf").mjtTextureRole.mjTEXROLE_RGB)
        found: dict[int, Array] = {}
        for k, t in enumerate(self.mat_texid[:, role].tolist()):
            if t >= 0 and self.tex_nchannel[t] >= 3:
                count, channels = (
                    int(self.tex_height[t] * self.tex_width[t]),
                    int(self.tex_nchannel[t]),
                )
                first = int(self.tex_adr[t])
                pixels = self.tex_data[first : first + count * channels].reshape(count, channels)
                found[k] = pixels[:, :3].mean(axis=0) / 255
        return found

    @cached_property
    def touching(self) -> list[bool]:
        """A flag for each geom that is True if it may touch anything, by its masks or in a pair."""
        able = (self.geom_contype != 0) | (self.geom_conaffinity != 0)
        for geoms in (self.pair_geom1, self.pair_geom2):
            able[geoms[self.pair_dim > 0]] = True
        return able.tolist()

    @property
    def belts(self) -> set[int]:
        """The geoms whose surface moves."""
        return self.set_in("geom_surfacevel")

    @cached_property
    def _set(self) -> dict[str, set[int]]:
        return {}

    def set_in(self, table: str) -> set[int]:
        """Return the indices of nonzero entries in a table that some MuJoCo versions lack."""
        if table not in self._set:
            rows = getattr(self, table, np.zeros(0))
            found = np.flatnonzero(rows.any(axis=tuple(range(1, rows.ndim))))
            self._set[table] = set(found.tolist())
        return self._set[table]


class Group(NamedTuple):
    """Joints of one MuJoCo body with a common anchor, which form one body here."""

    name: str
    joints: tuple[int, ...]
    pivot: Array  # position in the body's axes
    last: bool  # whether the body's mass and shapes are here


class Reading(Protocol):
    """The interface of the body reader."""

    m: Compiled
    path: Path
    report: Report
    names: list[str]  # names of bodies by MuJoCo's numbers
    pivot: Array  # (nbody, 3) our origins in their axes
    gravity: Array  # (3,) that acts [m/s^2]
    groups: list[list[Group]]
    planes: set[int]  # geoms that are the ground
    place_of_joint: dict[int, tuple[str, int]]  # body and degree of freedom
    freedoms: dict[str, int]  # degrees of freedom of the joint of each body

    def where(self, tag: str, name: str) -> str:
        """Return the location of an element in its file."""
        ...

    def left_out(self, tag: str, name: str, text: str, *, acts: bool = True) -> None:
        """Report that an element has no equivalent."""
        ...

    def solid(self, g: int) -> dict[str, Any] | None:
        """Convert a geom to a shape of its body."""
        ...


# -- the MJCF attributes that the reader supports, as of MuJoCo 4.0 --------------------------------


ACTUATORS = (
    "general", "motor", "position", "velocity", "intvelocity", "orientation", "pid", "damper",
    "cylinder", "muscle", "adhesion", "dcmotor",
)  # fmt: skip


def _rows(file: Path) -> dict[str, frozenset[str]]:
    """Return the attributes by element, from a file with lines "element: attribute attribute"."""
    rows = (row.split(": ") for row in file.read_text(encoding="utf-8").splitlines())
    known = {tag: frozenset[str](names.split()) for tag, names in rows}
    actuator = known.pop("actuator")
    return known | dict.fromkeys(ACTUATORS, actuator)


# attributes by element, without elements that have no effect on motion
KNOWN = _rows(Path(__file__).with_name("mjcf_schema.txt"))


def newer(tag: str, attributes: Iterable[str]) -> list[str]:
    """Return the attributes of an element that do not exist in MuJoCo 4.0."""
    known = KNOWN.get(tag)
    return [] if known is None or known.issuperset(attributes) else sorted(set(attributes) - known)
