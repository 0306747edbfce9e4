"""Pictures of the bodies of OpenSim: meshes of VTK and of other formats, and solids."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileError, choices
from ..markup import read_markup
from ..mesh_files import FORMATS
from ..model.files import kept_mesh
from ..rotation import rodrigues
from .conversion import Folders, Report
from .osim_text import Array, Document, Element, Pose, turned

ONES, ZERO = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
# the turn of a cylinder, which is along z here and along y in the file
ALONG_Y = rodrigues((1.0, 0.0, 0.0), -0.5 * np.pi)
GEOMETRY = "Geometry"  # folder beside a model in which OpenSim looks for files


class Pictures:
    """Reads the pictures of bodies as shapes that do not touch."""

    def __init__(self, file: Document, report: Report, folders: Folders):
        self.file, self.report, self.folders = file, report, folders
        self.missing: dict[str, str] = {}  # file: reason

    def of(self, body: Element, poses: Mapping[str, Pose]) -> list[dict[str, Any]]:
        """Return the shapes of a body. Raises FileError for numbers that cannot be read."""
        found = list[dict[str, Any]]()
        at = poses[body.get("name")]
        for element, frame in self._held(body, at):
            shape = self._shape(element)
            if shape is None:
                continue
            turn = frame.turn @ ALONG_Y if shape["kind"] == "cylinder" else frame.turn
            pose = Pose(frame.place, turn)
            shape |= {"position": tuple(pose.place.tolist()), "rotation": pose.quaternion}
            found.append(shape | {"role": "visual"} | self._paint(element))
        return found

    def tell(self) -> None:
        """Report the pictures without a file."""
        if self.missing:
            names = choices(self.missing, 6)
            why = next(iter(self.missing.values()))
            text = f"{len(self.missing)} pictures: {names}: {why}; give the folder of these files: "
            self.report.add("left out", self.file.name, text + "roots=[...]")

    def _held(self, body: Element, at: Pose) -> Iterator[tuple[Element, Pose]]:
        """Iterate over the pictures of a body and of its frames, with their poses in our body."""
        for held in body.all("attached_geometry"):
            yield from ((x, at) for x in held.children)
        for held in body.all("components"):
            for frame in held.all("PhysicalOffsetFrame"):
                pose = at @ self.file.frame(frame.get("name"), body)[1]
                for inside in frame.all("attached_geometry"):
                    yield from ((x, pose) for x in inside.children)
        for held in body.all("VisibleObject"):  # versions before 4
            scale = self.file.numbers(held, "scale_factors", ONES)
            for one in (x for x in held.inside() if x.tag == "DisplayGeometry"):
                numbers = self.file.numbers(one, "transform", ZERO + ZERO)
                own = Pose(np.array(numbers[3:]) * scale, turned(numbers[:3]))
                yield one, at @ own

    def _shape(self, element: Element) -> dict[str, Any] | None:
        file = self.file
        match element.tag:
            case "Brick":
                halves = file.numbers(element, "half_lengths", ONES)
                return {"kind": "box", "size": tuple(2.0 * x for x in halves)}
            case "Sphere":
                return {"kind": "sphere", "radius": file.number(element, "radius", 1.0)}
            case "Ellipsoid":
                return {"kind": "ellipsoid", "radii": file.numbers(element, "radii", ONES)}
            case "Cylinder":
                radius, half = (file.number(element, x, 1.0) for x in ("radius", "half_height"))
                return {"kind": "cylinder", "radius": radius, "length": 2.0 * half}
            case "Mesh" | "DisplayGeometry":
                scale = file.numbers(element, "scale_factors", ONES)
                name = file.text(element, "mesh_file") or file.text(element, "geometry_file")
                return self._mesh(name, scale)
        return None

    def _mesh(self, name: str, scale: tuple[float, ...]) -> dict[str, Any] | None:
        found, why = self.folders.find(name.replace("\\", "/"))
        if found is None:
            found, _ = self.folders.find(f"{GEOMETRY}/{name}")
        if found is None or not all(scale):
            self.missing[name] = why or "a scale factor is 0"
            return None
        shape = {"kind": "mesh", "scale": scale if len(set(scale)) > 1 else abs(scale[0])}
        if found.suffix.lower().lstrip(".") in FORMATS:
            return shape | {"file": str(found)}
        try:
            return shape | {"file": str(kept_mesh(found.stem, *polygons_of(found)))}
        except (FileError, ValueError, IndexError) as error:
            self.missing[name] = str(error)
            return None

    def _paint(self, element: Element) -> dict[str, Any]:
        held = element.first("Appearance") or element
        colour = self.file.numbers(held, "color", ONES)
        opacity = self.file.number(held, "opacity", 1.0)
        if not all(0.0 <= x <= 1.0 for x in (*colour, opacity)):
            return {}
        return {"colour": colour, "opacity": opacity}


def polygons_of(path: Path) -> tuple[Array, Array]:
    """Return the vertices (n, 3) and triangles (m, 3) of a mesh of VTK, in the form of text.

    Raises FileError or ValueError.
    """
    if path.suffix.lower() != ".vtp":
        raise ValueError(f"meshes are not read from {path.suffix} files")
    root, points, faces, count = read_markup(path), list[Array](), list[Array](), 0
    for piece in (x for x in root.inside() if x.tag == "Piece"):
        own = _numbers(piece, "Points", "").reshape(-1, 3)
        ends = _numbers(piece, "Polys", "offsets").astype(int)
        corners = _numbers(piece, "Polys", "connectivity").astype(int)
        sizes = np.diff(ends, prepend=0)
        for size in np.unique(sizes[sizes > 2]).tolist():
            begins = (ends - sizes)[sizes == size]
            fan = corners[begins[:, None] + np.arange(size)] + count
            faces += [fan[:, (0, k, k + 1)] for k in range(1, size - 1)]
        points.append(own)
        count += len(own)
    if not faces or max(x.max() for x in faces) >= count:
        raise ValueError("it has no polygons")
    return np.concatenate(points), np.concatenate(faces)


def _numbers(piece: Element, of: str, name: str) -> Array:
    held = piece.first(of)
    for array in held.all("DataArray") if held is not None else ():
        if array.get("Name") == name or not name:
            if array.get("format", "ascii") != "ascii":
                raise ValueError("it is binary; save it as text (ascii)")
            return np.array(array.text.split(), dtype=float)
    return np.zeros(0)
