"""Shapes, materials and poses in a URDF file, and the faults that are found while it is read."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ..errors import FileError, PgraphError, choices, shown
from ..markup import Element, Source, reason_of
from ..mesh_files import FORMATS
from ..model import Shape
from ..model.shape import mass_properties_of
from ..rotation import Quaternion, frame_of, matrix, multiply, quaternion_of
from ..shapes import KINDS
from .conversion import Folders, MeshSize, Report
from .paint import Rgba, Seen, seen_in, within_0_and_1

Value = TypeVar("Value")
ZERO = (0.0, 0.0, 0.0)
Z = (0.0, 0.0, 1.0)
DIMENSIONS = {name: kind.attributes for name, kind in KINDS.items()}


class Shapes:
    """Reads the shapes of links, and keeps faults and the report."""

    def __init__(self, name: str, folders: Folders):
        self.source, self.folders, self.report = Source(name), folders, Report(name)
        self.faults: list[PgraphError] = []
        self.given = Source(name, self.faults)  # for numbers that are needed
        self.looked_at: dict[Path, Seen] = {}
        self.sizes: dict[MeshSize, None] = {}
        self.hulls = 0  # collision meshes, which touch by their convex hulls

    # -- faults: all are found before the file is refused ----------------------------------------

    def _noted(self, otherwise: Value, read: Callable[..., Value], *given: Any) -> Value:
        """Return read(*given), or `otherwise` if it fails. Errors are reported at the end."""
        try:
            return read(*given)
        except PgraphError as fault:
            self.faults.append(fault)
            return otherwise

    def _wrong(self, element: Element, field: str, text: str, what: str) -> None:
        self.faults.append(self.source.wrong(element, field, text, what))

    def _pose(self, element: Element, what: str) -> tuple[tuple[float, ...], Quaternion]:
        """Return the position and quaternion from <origin>. Raises FileError in a visual."""
        origin = element.first("origin")
        numbers = (self.source if element.tag == "visual" else self.given).numbers
        xyz = numbers(origin, "xyz", ZERO, what)
        if origin is not None and "quat_xyzw" in origin.attributes:  # URDF 1.2
            x, y, z, w = numbers(origin, "quat_xyzw", (0.0, 0.0, 0.0, 1.0), what)
            return xyz, upright((w, x, y, z))
        rpy = numbers(origin, "rpy", ZERO, what)
        if origin is not None and max(map(abs, rpy)) > 4 * math.pi:
            text = f"rpy {shown(rpy)} is many turns: is it in degrees? URDF has radians"
            self.report.add("warning", self.source.at(origin, what), text)
        return xyz, quaternion_of_rpy(rpy)

    def _shapes(self, link: Element, what: str, name: str) -> list[dict[str, Any]]:
        """Return the shapes of a link. Identical visual and collision shapes are merged."""
        shapes: list[dict[str, Any]] = []
        for role in ("visual", "collision"):
            for element in link.all(role):
                try:
                    shape = self._shape(element, what, name, role)
                except FileError as error:
                    if role == "collision":
                        self.faults.append(error)
                    else:  # a visual shape has no effect on motion
                        where = self.source.at(element, what)
                        self.report.add("left out", where, f"a visual: {_fault(error)}", part=name)
                    continue
                if shape is None:
                    continue
                twin = next((s for s in shapes if self._same(s, shape)), None)
                if role == "collision" and twin is not None:
                    twin["role"] = "both"
                else:
                    shapes.append({**shape, "role": role})
        return shapes

    def _same(self, a: dict[str, Any], b: dict[str, Any]) -> bool:
        keys = (a.keys() | b.keys()) - {"role", "colour", "opacity"}
        return a["role"] == "visual" and all(a.get(k) == b.get(k) for k in keys)

    def _shape(self, element: Element, what: str, name: str, role: str) -> dict[str, Any] | None:
        geometry = element.first("geometry")
        solid = next(iter(geometry.children), None) if geometry is not None else None
        where, acts = self.source.at(element, what), role == "collision"
        if solid is None:
            self.report.add("left out", where, f"a {role} without geometry", part=name)
            return None
        lengths = self._lengths(solid, what)
        if zero := next((field for field, x in lengths.items() if np.min(x) == 0), ""):
            text = f"a {role} of {zero} 0, which is not a solid"
            self.report.add("left out", where, text, acts=acts, part=name)
            return None
        position, rotation = self._pose(element, what)
        shape: dict[str, Any] = {"position": position, "rotation": rotation}
        if role == "visual" and (colour := self._colour(element)):
            shape["colour"], shape["opacity"] = colour[:3], colour[3]
        match solid.tag:
            case kind if lengths:
                shape |= {"kind": kind, **lengths}
            case "mesh":
                found = self._mesh(solid, what, name, acts, "colour" in shape)
                return found | shape if found else None
            case "plane":
                return shape | self._plane(solid, position, rotation, where, name, what)
            case other:
                text = f"a {role} of kind <{other}>, which URDF does not have"
                self.report.add("left out", where, text, acts=acts, part=name)
                return None
        return shape

    def _lengths(self, solid: Element, what: str) -> dict[str, Any]:
        """Return the dimensions of a box, sphere, cylinder or capsule, with 0 as a placeholder."""
        found: dict[str, Any] = {}
        for field in DIMENSIONS.get(solid.tag, ()):
            count = 3 if field == "size" else 1
            given = self.source.numbers(solid, field, (-1.0,) * count, what)
            if min(given) < 0:
                wanted = "three numbers" if count == 3 else "a number"
                text = f"must be {wanted} > 0 [m], got {shown(solid.get(field))}"
                raise self.source.wrong(solid, field, text, what)
            found[field] = given if count == 3 else given[0]
        return found

    def _plane(
        self, solid: Element, position: Any, rotation: Any, where: str, name: str, what: str
    ) -> dict[str, Any]:
        """Return a box with a face that represents a plane, as in Bullet."""
        normal = np.array(self.source.numbers(solid, "normal", Z, what))
        if not 1e-9 < np.linalg.norm(normal) < 1e9:
            raise self.source.wrong(solid, "normal", "must not be zero", what)
        normal /= np.linalg.norm(normal)
        turn = multiply(rotation, quaternion_of(frame_of(normal)))
        text = "a plane, which URDF does not have, is a box 1 m thick and 100 m wide"
        self.report.add("approximated", where, text, part=name)
        below = np.array(position) - matrix(turn)[:, 2] / 2
        return {
            "kind": "box", "size": (100.0, 100.0, 1.0),
            "position": tuple(below.tolist()), "rotation": turn,
        }  # fmt: skip

    def _mesh(
        self, solid: Element, what: str, name: str, acts: bool, painted: bool
    ) -> dict[str, Any] | None:
        given, where = solid.get("filename"), self.source.at(solid, what)
        path, why = self.folders.find(given)
        if path is None:
            file = Path(given.replace("\\", "/")).name
            end = "; a stand-in is drawn" if file and not acts else ""
            text = f"mesh {shown(given)}: {why}{end}"
            self.report.add("left out", where, text, acts=acts, part=name)
            return {"kind": "mesh", "file": str(self.folders.here / file)} if end else None
        if path.suffix.lower().lstrip(".") not in FORMATS:
            text = f"mesh {shown(given)}: {path.suffix} files are not read; give {choices(FORMATS)}"
            self.report.add("left out", where, text, acts=acts, part=name)
            return None
        if len(solid.get("scale").split()) == 1:
            scale = (self.source.number(solid, "scale", 1.0, what),) * 3
            text = f"mesh {shown(given)}: its one scale holds for all three directions"
            self.report.add("converted", where, text, part=name)
        else:
            scale = self.source.numbers(solid, "scale", (1.0, 1.0, 1.0), what)
        if not all(1e-9 < abs(x) < 1e9 for x in scale):
            text = f"must be three numbers that are not zero, got {shown(scale)}"
            raise self.source.wrong(solid, "scale", text, what)
        mesh: dict[str, Any] = {"kind": "mesh", "file": str(path)}
        if (seen := self._seen(path, given, where, name, acts)) is not None:
            self.sizes[MeshSize(where, name, given, seen.size * max(map(abs, scale)))] = None
            if not (acts or painted) and seen.colour is not None:
                mesh["colour"], mesh["opacity"] = seen.colour[:3], seen.colour[3]
            if not (acts or painted) and seen.lost:
                text = f"mesh {shown(given)}: {seen.lost}"
                self.report.add("approximated", where, text, part=name)
        if scale != (1.0, 1.0, 1.0):
            mesh["scale"] = scale[0] if len(set(scale)) == 1 and scale[0] > 0 else scale
        if acts:
            mesh["hull"] = "convex"
            self.hulls += 1
        return mesh

    def _seen(self, path: Path, given: str, where: str, name: str, acts: bool) -> Seen | None:
        """Return the size and colour of a mesh, or None after reporting that it cannot be read."""
        try:
            if path not in self.looked_at:
                self.looked_at[path] = seen_in(path)
            return self.looked_at[path]
        except (FileError, OSError) as error:
            why = _fault(error) if isinstance(error, FileError) else reason_of(error)
            text = f"mesh {shown(given)}: {why}; a stand-in is drawn"
            self.report.add("left out", where, text, acts=acts, part=name)
            return None

    def _of_density(
        self, link: Element, what: str, name: str, shapes: Sequence[Mapping[str, Any]]
    ) -> dict[str, Any]:
        """Return the mass properties of a link with a <density> of its collision shapes, as in
        SAPIEN, or {} for other links. Raises ModelError or FileError."""
        inertial = link.first("inertial")
        given = inertial.first("density") if inertial is not None else None
        if inertial is None or given is None or inertial.first("mass") is not None:
            return {}
        where = self.source.at(given, what)
        density = self.given.number(given, "value", 0.0, what)
        solid = [Shape(**shape) for shape in shapes if shape["role"] != "visual"]
        if density <= 0 or not solid:
            text = f"its density of {density:g} kg/m^3, which needs a collision shape, or is 0"
            self.report.add("left out", where, text, acts=True, part=name)
            return {}
        mass, com, inertia = mass_properties_of(solid, density)
        text = f"its density of {density:g} kg/m^3 gives {mass:.6g} kg for its collision shapes"
        self.report.add("converted", where, text, part=name)
        return {"mass": float(mass), "com": tuple(com.tolist()), "inertia": inertia}

    def _look(self, robot: Element, links: Iterable[Element]) -> None:
        """Read the colours of all materials. If a name occurs in several links, the first one is
        used."""
        owners = (robot, *(visual for link in links for visual in link.all("visual")))
        materials = (m for owner in owners for m in owner.all("material") if m.children)
        self.looks = {material: self._rgba(material) for material in materials}
        self.colours: dict[str, Rgba | None] = {}
        for material, rgba in self.looks.items():
            name = material.get("name")
            self.colours[name] = self.colours.get(name) or rgba

    def _rgba(self, material: Element) -> Rgba | None:
        """Return the colour of a material, or None after reporting its loss, since colours do not
        affect the motion."""
        colour, where = material.first("color"), self.source.at(material, "material")
        if material.first("texture") is not None:
            self.report.add("left out", where, f"the texture of {shown(material.get('name'))}")
        if colour is None:
            return None
        if "rgba" not in colour.attributes:
            self.report.add("left out", where, "a <color> without rgba, which holds no colour")
            return None
        try:
            rgba = self.source.numbers(colour, "rgba", (1.0, 1.0, 1.0, 1.0), "material")
        except FileError as error:
            self.report.add("left out", where, _fault(error))
            return None
        found, text = within_0_and_1(rgba)
        if text:
            self.report.add("approximated", where, text)
        return found

    def _colour(self, visual: Element) -> Rgba | None:
        """Return the colour of a visual. A name that no material has is reported once."""
        material = visual.first("material")
        if material is None:
            return None
        name = material.get("name")
        if name and name not in self.colours and not material.children:
            self.colours[name] = None
            text = f"the colour {shown(name)}, which is not defined by any material of the file"
            self.report.add("left out", self.source.at(material, "material"), text)
        return self.looks.get(material) or self.colours.get(name)


def _fault(error: FileError) -> str:
    """Return the field and message of the first problem in an error, without its location."""
    problem = error.problems[0]
    return f"{problem.field} {problem.text}" if problem.field else problem.text


def quaternion_of_rpy(rpy: Iterable[float]) -> Quaternion:
    """Return the quaternion for Rz(yaw) Ry(pitch) Rx(roll) from fixed-axis angles [rad]."""
    roll, pitch, yaw = (x / 2 for x in rpy)
    x = (math.cos(roll), math.sin(roll), 0.0, 0.0)
    y = (math.cos(pitch), 0.0, math.sin(pitch), 0.0)
    z = (math.cos(yaw), 0.0, 0.0, math.sin(yaw))
    return upright(multiply(z, multiply(y, x)))


def upright(q: Sequence[float]) -> Quaternion:
    """Return the quaternion of the same rotation whose largest component is positive."""
    most = max(map(abs, q))
    sign = next(math.copysign(1.0, x) for x in q if abs(x) > most - 1e-9)
    w, x, y, z = (sign * x + 0.0 for x in q)
    return (w, x, y, z)
