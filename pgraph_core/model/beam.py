"""Flexible beams: one row of the description, which a mechanism divides into rigid segments."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self, get_args

import numpy as np
import numpy.typing as npt
from pydantic import BeforeValidator, model_validator

from ..errors import counted, shown
from ..fields import (
    GROUND,
    Described,
    Finite,
    Number,
    PerMotion,
    Quat,
    Text,
    Vec3,
    Vec3s,
    Whole,
    field,
    listed,
    name_problem,
    per_motion,
    quaternion,
    refuse,
    vector,
    vectors,
)
from ..rotation import Array
from ..tolerances import NOTABLE
from ..units import KG, NONE, PA, M, N

Strain = Literal["stretch", "twist", "bend_y", "bend_z"]
STRAINS: tuple[Strain, ...] = get_args(Strain)
SINCE = 10
AUTO = "auto"
STIFFNESS = ("section", "EI", "EA", "GJ", "rho_a", "rho_j")
MOST_SEGMENTS = 500  # more would add rounding, which grows with their rates


class Section(NamedTuple):
    """Properties of a cross-section with its width along y and its height along z."""

    area: float  # [m^2]
    bending: tuple[float, float]  # [m^4] second moments of area about y and z
    torsion: float  # [m^4] torsion constant J


def circle(radius: float) -> Section:
    return tube(radius, 0.0)


def tube(radius: float, inner: float) -> Section:
    second = math.pi / 4 * (radius**4 - inner**4)
    return Section(math.pi * (radius**2 - inner**2), (second, second), 2 * second)


def rectangle(width: float, height: float) -> Section:
    """The torsion constant is Saint-Venant's series (Timoshenko and Goodier, section 109)."""
    b, a = sorted((width, height))
    odd = np.arange(1, 200, 2)
    series = float((np.tanh(odd * (math.pi * a / (2 * b))) / odd**5).sum())
    torsion = a * b**3 / 3 * (1 - 192 * b / (math.pi**5 * a) * series)
    bending = (width * height**3 / 12, height * width**3 / 12)
    return Section(width * height, bending, torsion)


class Shaped(NamedTuple):
    """A kind of cross-section: the names of its sizes, and its properties."""

    sizes: tuple[str, ...]
    of: Callable[..., Section]


SECTIONS: Mapping[str, Shaped] = {
    "circle": Shaped(("radius",), circle),
    "tube": Shaped(("radius", "inner radius"), tube),
    "rectangle": Shaped(("width along y", "height along z"), rectangle),
}


class Material(NamedTuple):
    E: float  # [GPa] Young's modulus
    G: float  # [GPa] shear modulus
    density: float  # [kg/m^3]


MaterialName = Literal["steel", "aluminium", "titanium", "brass", "glass", "nylon"]
MATERIALS: Mapping[str, Material] = {  # usual values of alloys, which differ by a few percent
    "steel": Material(210, 81, 7850), "aluminium": Material(70, 26, 2700),
    "titanium": Material(114, 43, 4430), "brass": Material(105, 39, 8500),
    "glass": Material(70, 29, 2500), "nylon": Material(3, 1, 1140),
}  # fmt: skip

Entry = Text | Finite
SectionOf = Annotated[tuple[Entry, ...], BeforeValidator(listed)]
_section_in: Callable[[Sequence[str | float] | None], SectionOf | None] = listed
_vectors: Callable[[npt.ArrayLike | Sequence[npt.ArrayLike]], Vec3s] = vectors


class Stiff(NamedTuple):
    """The numbers of a beam per length, None where it does not deform."""

    EA: float | None  # [N]
    EI: tuple[float, float] | None  # [N m^2] about y and z
    GJ: float | None  # [N m^2]
    rho_a: float  # [kg/m]
    rho_i: tuple[float, float, float]  # [kg m] rotary inertia about the axis, y and z

    def of(self, strain: Strain) -> float | None:
        """Return the stiffness against a strain."""
        bends = self.EI or (None, None)
        return {"stretch": self.EA, "twist": self.GJ, "bend_y": bends[0], "bend_z": bends[1]}[
            strain
        ]


class Beam(Described):
    """A flexible beam, fixed to its parent at one end, which bends, twists and may stretch.

    Its axis begins at `link` along x, turned by `rotation`, or leads through `points`. A section
    with a material, or `EI`, `GJ`, `EA` and `rho_a`, say how stiff and heavy it is. A mechanism
    divides it into `nodes` segments with springs between them, and runs estimate the error of this
    in `run.space_error`. Other parts name the beam for its tip, or a place along it: "rod@0.5".

    Examples
    --------
    >>> import pgraph_core as pg
    >>> rod = pg.Beam(name="rod", length=1.0, section=("circle", 0.01), material="steel")
    >>> round(rod.stiff.EI[0])
    1649
    >>> model = pg.Model(beams=[rod], bodies=[pg.Body(name="load", parent="rod", joint="weld")])
    >>> pg.Mechanism(model).nv
    60
    """

    SINCE: ClassVar[int] = SINCE
    FOLLOWERS: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "points": ("length",),
        **dict.fromkeys(("section", "material", "E", "G", "density"), STIFFNESS),
    }

    name: Text = field("a non-empty string", label="Name")
    parent: Text = field(
        "the name of a body, or 'ground'", default=GROUND, label="Parent", since=SINCE,
        help="body that holds its root",
    )  # fmt: skip
    link: Vec3 = field(
        "three finite numbers [x, y, z] from the parent's origin [m]",
        converter=vector, default=(0.0, 0.0, 0.0), label="Link vector", dim=M, role="point",
        since=SINCE, help="position of its root on the parent",
    )  # fmt: skip
    rotation: Quat = field(
        "a unit quaternion [w, x, y, z] in the parent's axes",
        converter=quaternion, default=(1.0, 0.0, 0.0, 0.0), label="Orientation", role="frame",
        since=SINCE, help="orientation of its axes; x leads along a straight beam",
    )  # fmt: skip
    length: Number | None = field(
        "a length > 0 [m] along x, or give points", default=None, gt=0, dim=M, since=SINCE,
        help="length of a straight beam",
    )  # fmt: skip
    points: Vec3s = field(
        "points [x, y, z] [m] through which its axis leads from its root, in its axes",
        converter=_vectors, default=(), dim=M, role="point", since=SINCE,
        help="further points of its axis, joined by straight pieces",
    )  # fmt: skip
    section: SectionOf | None = field(
        "('circle', radius), ('tube', radius, inner radius) or ('rectangle', width along y, height "
        "along z) [m]",
        converter=_section_in, default=None, dim=M, since=SINCE, help="shape and sizes",
    )  # fmt: skip
    material: MaterialName | None = field(
        f"one of {', '.join(MATERIALS)}", default=None, since=SINCE,
        help="gives E, G and density where they are left out",
    )  # fmt: skip
    E: Number | None = field(
        "a number > 0 [Pa]", default=None, gt=0, dim=PA, label="E", since=SINCE,
        help="Young's modulus",
    )  # fmt: skip
    G: Number | None = field(
        "a number > 0 [Pa]", default=None, gt=0, dim=PA, label="G", since=SINCE,
        help="shear modulus",
    )  # fmt: skip
    density: Number | None = field(
        "a number > 0 [kg/m^3]", default=None, gt=0, dim=KG / M**3, since=SINCE
    )
    EA: Number | None = field(
        "a number > 0 [N]", default=None, gt=0, dim=N, label="EA", since=SINCE,
        help="stiffness against stretch; without it the length stays",
    )  # fmt: skip
    EI: PerMotion = field(
        "one or two numbers > 0 [N m^2], about y and z",
        converter=per_motion, default=(), dim=N * M**2, label="EI", since=SINCE,
        help="bending stiffness about y and z",
    )  # fmt: skip
    GJ: Number | None = field(
        "a number > 0 [N m^2]", default=None, gt=0, dim=N * M**2, label="GJ", since=SINCE,
        help="stiffness against twist; without it the beam does not twist",
    )  # fmt: skip
    rho_a: Number | None = field(
        "a number > 0 [kg/m]", default=None, gt=0, dim=KG / M, label="Mass per length", since=SINCE
    )
    rho_j: Number | None = field(
        "a number > 0 [kg m]", default=None, gt=0, dim=KG * M, since=SINCE,
        label="Inertia per length", help="moment of inertia about the axis per length",
    )  # fmt: skip
    strains: tuple[Strain, ...] = field(
        f"a list of {', '.join(map(repr, STRAINS))}",
        converter=listed, default=(), since=SINCE,
        help="how it deforms; default: it bends, and twists if GJ is known",
    )  # fmt: skip
    damping_ratio: Number = field(
        "a number from 0 to below 1", default=0.0, ge=0, lt=1, dim=NONE, since=SINCE,
        help="of its lowest mode with a free tip; damping is proportional to stiffness",
    )  # fmt: skip
    nodes: Whole | Literal["auto"] = field(
        f"a whole number from 1 to {MOST_SEGMENTS}, or 'auto'", default=20, label="Segments",
        since=SINCE, help="number of segments",
    )  # fmt: skip
    tolerance: Number = field(
        "a number > 0", default=1e-3, gt=0, dim=NONE, since=SINCE,
        help="error in space over the length that 'auto' meets",
    )  # fmt: skip

    @model_validator(mode="before")
    @classmethod
    def _given(cls, data: Any) -> Any:
        """Leave out fields that are None."""
        if not isinstance(data, dict):
            return data
        return {key: value for key, value in data.items() if value is not None or key == "name"}

    @model_validator(mode="after")
    def _sound(self) -> Self:
        found = name_problems(self)
        found += axis_problems(self)
        found += section_problems(self.section)
        found += nodes_problems(self.nodes)
        if len(self.EI) > 2 or any(not x > 0 for x in self.EI):
            text = "must be one or two numbers > 0 [N m^2], about y and z, got "
            found.append(("EI", text + shown(self.EI)))
        refuse(found)
        refuse(stiffness_problems(self))
        return self

    def at(self, place: float) -> str:
        """Return the name of a place along the beam, from 0 at its root to 1 at its tip."""
        return f"{self.name}@{place!r}"

    @property
    def axis(self) -> Array:
        """The points (k, 3) of its axis in its own axes [m]."""
        further = self.points or ((self.length, 0.0, 0.0),)
        return np.array(((0.0, 0.0, 0.0), *further), float)

    @property
    def extent(self) -> float:
        """The length of its axis [m]."""
        return float(np.linalg.norm(np.diff(self.axis, axis=0), axis=1).sum())

    @property
    def properties(self) -> Section | None:
        """The properties of its section, or None."""
        return section_of(self.section)

    @property
    def stiff(self) -> Stiff:
        """The stiffnesses, the mass and the inertias per length."""
        one, known = self.properties, constants_of(self)
        E, G, density = known.E, known.G, known.density
        EI = self.EI * (3 - len(self.EI)) if self.EI else None
        EA, GJ, rho_a = self.EA, self.GJ, self.rho_a or 0.0
        about = (1.0, 0.5, 0.5)
        if one is not None:
            EI = EI or (None if E is None else (E * one.bending[0], E * one.bending[1]))
            EA = EA or (None if E is None else E * one.area)
            GJ = GJ or (None if G is None else G * one.torsion)
            rho_a = rho_a or (density or 0.0) * one.area
            y, z = (x / sum(one.bending) for x in one.bending)
            about = (1.0, y, z)
        own = 0.0 if one is None else rho_a / one.area * sum(one.bending)
        i, y, z = (x * (self.rho_j or own) for x in about)
        return Stiff(EA, None if EI is None else (EI[0], EI[1]), GJ, rho_a, (i, y, z))

    @property
    def deforms(self) -> tuple[Strain, ...]:
        """The strains of its segments, in the order of their motions."""
        if self.strains:
            return tuple(x for x in STRAINS if x in self.strains)
        stiff = self.stiff
        wanted = {"twist": stiff.GJ, "bend_y": stiff.EI, "bend_z": stiff.EI, "stretch": self.EA}
        return tuple(x for x in STRAINS if wanted[x] is not None)

    @property
    def lowest_frequency(self) -> float:
        """The lowest frequency [rad/s] of its strains with a fixed root and a free tip, straight.

        It is β² √(EI / ρA L⁴) of bending with cos β cosh β = -1, and π/2 √(k / m L²) of stretch and
        twist.
        """
        stiff, length, found = self.stiff, self.extent, list[float]()
        for strain in self.deforms:
            k = stiff.of(strain) or math.inf
            if strain.startswith("bend"):
                found.append((1.875104068711961 / length) ** 2 * math.sqrt(k / stiff.rho_a))
            else:
                mass = stiff.rho_a if strain == "stretch" else stiff.rho_i[0]
                found.append(math.pi / 2 / length * math.sqrt(k / mass))
        return min(found)


def constants_of(beam: Beam) -> Any:
    """Return E, G and density of a beam, each None if unknown."""
    usual = MATERIALS.get(beam.material or "")
    given = (beam.E, beam.G, beam.density)
    known = (None,) * 3 if usual is None else (usual.E * 10**9, usual.G * 10**9, usual.density)
    return Material(*(x if x is not None else y for x, y in zip(given, known)))  # type: ignore[arg-type]


def section_of(given: Sequence[Any] | None) -> Section | None:
    """Return the properties of a valid section, or None for none."""
    return None if given is None else SECTIONS[given[0]].of(*given[1:])


# -- checks ----------------------------------------------------------------------------------------

Found = list[tuple[str, str]]


def name_problems(beam: Beam) -> Found:
    found: Found = [("name", text)] if (text := name_problem(beam.name)) else []
    if "@" in beam.name:
        text = f"must not contain '@', which stands before a place along it, got {beam.name!r}"
        found.append(("name", text))
    if not 0.5 < math.hypot(*beam.rotation) < 2:
        text = f"must be a unit quaternion [w, x, y, z], got {shown(beam.rotation)}"
        found.append(("rotation", text))
    return found


def axis_problems(beam: Beam) -> Found:
    """Return problems with the axis: none, two, or one that stands still or turns back."""
    if (beam.length is None) == (not beam.points):
        text = "a length [m] or points are needed for the axis, "
        return [("length", text + ("got both; leave one out" if beam.points else "got none"))]
    steps = np.diff(beam.axis, axis=0)
    sizes = np.linalg.norm(steps, axis=1)
    if not sizes.min() > NOTABLE * sizes.sum():
        k = int(sizes.argmin())
        text = f"point {k + 1} is where point {k} is" if k else "the first point is at the root"
        return [("points", f"{text}; leave it out or move it")]
    unit = steps / sizes[:, None]
    turns = (unit[1:] * unit[:-1]).sum(axis=1)
    if len(turns) and turns.min() < NOTABLE - 1:
        k = int(turns.argmin()) + 1
        return [("points", f"the axis turns back at point {k}; move it, or use two beams")]
    return []


def section_problems(given: Sequence[Any] | None) -> Found:
    """Return problems with the kind and the sizes of a section."""
    if given is None:
        return []
    if not given or given[0] not in SECTIONS:
        first = shown(given[0]) if given else "nothing"
        return [("section", f"must begin with one of {', '.join(SECTIONS)}, got {first}")]
    kind, sizes = given[0], given[1:]
    names = SECTIONS[kind].sizes
    if len(sizes) != len(names) or any(isinstance(x, str) for x in sizes):
        text = f"a {kind} has {counted(len(names), 'size')} [m], {' and '.join(names)}, got "
        return [("section", text + shown(tuple(sizes)))]
    least = [0.0 if kind == "tube" and k else None for k in range(len(sizes))]
    small = [n for n, x, low in zip(names, sizes, least) if x < 0 or (low is None and x == 0)]
    if small:
        return [("section", f"the {small[0]} of a {kind} must be > 0 [m], got {shown(sizes)}")]
    if kind == "tube" and not sizes[1] < sizes[0]:
        text = f"the inner radius of a tube must be below its radius, got {shown(sizes)}"
        return [("section", text)]
    return []


def nodes_problems(nodes: int | str) -> Found:
    if nodes == AUTO or (isinstance(nodes, int) and 1 <= nodes <= MOST_SEGMENTS):
        return []
    text = f"must be a whole number from 1 to {MOST_SEGMENTS}, or 'auto', got {shown(nodes)}"
    return [("nodes", text)]


def stiffness_problems(beam: Beam) -> Found:
    """Return problems with stiffnesses and masses that are lacking or given twice."""
    known, one, found = constants_of(beam), beam.properties, list[tuple[str, str]]()
    stiff = beam.stiff
    for name, constant, of in (("EI", "E", "E"), ("EA", "E", "E"), ("GJ", "G", "G")):
        if one is not None and getattr(known, of) is not None and getattr(beam, name):
            text = f"follows from the section and {constant}, got {shown(getattr(beam, name))} too"
            found.append((name, f"{text}; leave one of them out"))
    if one is not None and known.density is not None and beam.rho_a is not None:
        text = f"follows from the section and the density, got {shown(beam.rho_a)} too"
        found.append(("rho_a", f"{text}; leave one of them out"))
    if found:
        return found
    if one is None and (beam.material or beam.E or beam.G or beam.density):
        text = "is needed with a material, E, G or a density, or give EI, GJ and rho_a instead"
        return [("section", text)]
    if not stiff.rho_a > 0:
        text = "a beam needs a mass: give rho_a [kg/m], or a section with a density or a material"
        return [("rho_a", text)]
    lacking = [x for x in beam.strains if stiff.of(x) is None]
    lacking += [] if beam.strains or stiff.EI else ["bend_y"]
    if lacking:
        own = {"stretch": ("EA", "E"), "twist": ("GJ", "G")}.get(lacking[0], ("EI", "E"))
        text = f"is needed for '{lacking[0]}': give it, or a section with a material or {own[1]}"
        return [(own[0], text)]
    if "twist" in beam.deforms and not stiff.rho_i[0] > 0:
        text = "a beam that twists needs an inertia about its axis: give rho_j [kg m], a section, "
        return [("rho_j", f"{text}or leave GJ out")]
    return []
