"""Mesh files: supported formats, size limits and conversion to geometry."""

from __future__ import annotations

import base64
import io
import json
import os
import re
import struct
import sys
from collections import Counter
from pathlib import Path
from typing import Any, TypeAlias
from urllib.parse import unquote

import numpy as np

from .errors import FileError, ModelError, PgraphError, Problem, choices, needed
from .markup import Element, Source, content_of, parse_markup, reason_of, stand_in
from .rotation import rodrigues

FORMATS = ("glb", "gltf", "obj", "off", "ply", "stl", "dae")
BEGINNING = 10_000  # bytes at the start of a file in which its format shows
GLTF = re.compile(rb'"asset"\s*:\s*\{')  # a property that all glTF files have
STL_HEAD, STL_TRIANGLE = 84, 50  # bytes of a binary STL file before and of its triangles
LARGEST_MESH = 200_000_000  # [bytes] limit on the size of a mesh file
LARGEST_COORDINATE = sys.float_info.max ** (1 / 6)  # m: inertia is of the fifth power
Scale: TypeAlias = "float | tuple[float, float, float]"
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}  # [m]


def load_mesh(file: str | Path, scale: Scale = 1.0, unit: str = "m") -> Any:
    """Load a mesh file as a single trimesh.Trimesh in metres, with its parts merged.

    `unit` is the unit of the file, and `scale` an additional factor, or one factor per axis. Raises
    FileError, ModelError.
    """
    if unit not in UNITS:
        text = f"must be one of {choices(UNITS)}, got {unit!r}"
        raise ModelError(Problem(f"mesh {file}", "unit", text))
    mesh = parsed_mesh(file)
    try:
        mesh.apply_scale(np.array(scale) * UNITS[unit])  # one that mirrors turns the faces too
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
    except Exception as error:  # damaged faces may be found only here
        raise FileError(_unreadable(file, _damage(error))) from error
    return mesh


def parsed_mesh(file: str | Path) -> Any:
    """Return the geometry of a file without any changes.

    Of the files that this one references, only the buffers of a .gltf file are opened.
    """
    trimesh = needed("trimesh")  # not before a file is opened: half a second
    where, suffix = f"mesh {file}", Path(file).suffix.lower().lstrip(".")
    if suffix not in FORMATS and os.path.isfile(file):
        text = f"meshes are not read from .{suffix} files; give one of {choices(FORMATS)}"
        raise FileError(Problem(where, "", text))
    try:
        content = content_of(file, LARGEST_MESH)
    except FileNotFoundError as error:
        raise FileError(Problem(where, "", "the file does not exist")) from error
    except (OSError, ValueError) as error:
        raise FileError(_unreadable(file, reason_of(error))) from error
    if not looks_like(suffix, content):
        why = stand_in(content) or _cut_off(suffix, content)
        text = f"cannot be read as {suffix}: its content is not a {suffix.upper()} mesh"
        raise FileError(Problem(where, "", why or text))
    try:
        if suffix == "dae":
            vertices, faces, paints = triangles(content, Path(file).name)
            mesh = trimesh.Trimesh(vertices, faces, process=False, metadata={"paints": paints})
        else:
            kind = suffix
            if suffix == "gltf":
                content, kind = glb_of(content, Path(file).absolute().parent), "glb"
            mesh = trimesh.load_mesh(io.BytesIO(content), file_type=kind, resolver=None)
        vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    except Exception as error:  # whatever a reader of a damaged file raises
        raise FileError(_unreadable(file, _damage(error))) from error
    if len(faces) == 0:
        raise FileError(Problem(where, "", "holds no faces"))
    if faces.min() < 0 or faces.max() >= len(vertices):
        text = f"has faces that name missing vertices; it has {len(vertices)} vertices"
        raise FileError(Problem(where, "", text))
    if not (np.abs(vertices) < LARGEST_COORDINATE).all():
        text = f"has coordinates that are not finite numbers below {LARGEST_COORDINATE:g}"
        raise FileError(Problem(where, "", text))
    return mesh


def looks_like(suffix: str, content: bytes) -> bool:
    """Check whether a file starts like its format, to avoid parsing other files as meshes."""
    match suffix:
        case "dae":
            return b"<COLLADA" in content[:BEGINNING]
        case "glb":
            return content[:4] == b"glTF"
        case "gltf":
            begun = content[:BEGINNING].lstrip()
            return begun.startswith(b"{") and GLTF.search(content) is not None
        case "ply":
            return content[:3] == b"ply"
        case "off":
            return re.match(rb"(\s*#[^\n]*\n)*\s*(ST)?C?N?4?n?OFF\b", content) is not None
        case "stl":
            triangles = int.from_bytes(content[80:84], "little")
            ascii_text = content.lstrip()[:5].lower() == b"solid" and b"facet" in content
            size = STL_HEAD + STL_TRIANGLE * triangles
            return ascii_text or len(content) >= size > STL_HEAD
    return bool(re.search(rb"^\s*v\s", content, re.M) and re.search(rb"^\s*f\s", content, re.M))


def glb_of(content: bytes, folder: Path) -> bytes:
    """Return a .gltf file and its buffers as one .glb file.

    Buffers are in the file itself, or in other files of its folder and below. Raises FileError.
    """
    data = json.loads(content)
    blob, starts = bytearray(), list[int]()
    for one in data.get("buffers", ()):
        starts.append(len(blob))
        blob += _buffer(one, folder)
        blob += b"\0" * (-len(blob) % 4)
        if len(blob) > LARGEST_MESH:
            text = f"its buffers have more than {LARGEST_MESH / 1e6:.0f} MB"
            raise FileError(Problem("", "", text))
    for view in data.get("bufferViews", ()):
        view["byteOffset"] = view.get("byteOffset", 0) + starts[view["buffer"]]
        view["buffer"] = 0
    data["buffers"] = [{"byteLength": len(blob)}]
    data.pop("images", None)  # not drawn
    text = json.dumps(data).encode()
    text += b" " * (-len(text) % 4)
    chunks = ((b"JSON", text), (b"BIN\0", bytes(blob)))
    body = b"".join(struct.pack("<I4s", len(part), kind) + part for kind, part in chunks)
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def _buffer(one: dict[str, Any], folder: Path) -> bytes:
    uri = str(one.get("uri", ""))
    if uri.startswith("data:"):
        return base64.b64decode(uri.partition(",")[2])
    path = (folder / unquote(uri)).resolve()
    if not (uri and path.is_relative_to(folder.resolve())):
        raise FileError(Problem("", "", f"its buffer {uri!r} is not in its folder"))
    try:
        return content_of(path, LARGEST_MESH)
    except (OSError, ValueError) as error:
        text = f"its buffer {uri!r} cannot be read: {reason_of(error)}"
        raise FileError(Problem("", "", text)) from None


def _cut_off(suffix: str, content: bytes) -> str:
    """Return the reason if a binary STL file ends before its last triangle, or ""."""
    count = int.from_bytes(content[80:84], "little")
    whole = STL_HEAD + STL_TRIANGLE * count
    if suffix != "stl" or b"\0" not in content or not STL_HEAD <= len(content) < whole:
        return ""
    there = (len(content) - STL_HEAD) // STL_TRIANGLE
    return f"is cut off: it announces {count} triangles and holds {there}; fetch it again"


def _unreadable(file: str | Path, reason: str) -> Problem:
    suffix = Path(file).suffix.lower().lstrip(".")
    return Problem(f"mesh {file}", "", f"cannot be read as {suffix}: {reason.splitlines()[0]}")


def _damage(error: Exception) -> str:
    """Return the damage to a file as described by our reader, or a general message."""
    if isinstance(error, MemoryError):
        return "it needs more memory than there is"
    return str(error) if isinstance(error, PgraphError) else "its content is damaged or cut short"


# -- COLLADA ---------------------------------------------------------------------------------------


Array = np.ndarray
PRIMITIVES = ("triangles", "polylist", "polygons", "trifans", "tristrips")
MOST_REFERENCES = 100  # nodes that name nodes
MOST_NODES = 100_000  # nodes of a scene


def triangles(content: bytes, name: str) -> tuple[Array, Array, Counter[Any]]:
    """Return vertices (n, 3) [m], faces (m, 3) and face counts by colour for the scene.

    A colour is four numbers, "texture", "undefined", or None if there is none. Raises FileError.
    """
    return _Collada(parse_markup(content, name), Source(name)).triangles()


class _Collada:
    def __init__(self, root: Element, source: Source):
        self.root, self.source = root, source
        self.named = {e.get("id"): e for e in root.inside() if e.get("id")}
        self.parts: list[tuple[Array, Array]] = []
        self.paints = Counter[Any]()
        self.count = 0

    def triangles(self) -> tuple[Array, Array, Counter[Any]]:
        """All parts together."""
        asset = self.root.first("asset")
        unit = asset.first("unit") if asset is not None else None
        metres = self.source.number(unit, "meter", 1.0)
        scene = self.root.first("scene")
        shown = scene.first("instance_visual_scene") if scene is not None else None
        top = self._target(shown) if shown is not None else None
        if top is None:
            scenes = self.root.first("library_visual_scenes")
            top = next(iter(scenes.children), None) if scenes is not None else None
        if top is not None:
            self._node(top, np.eye(4), 0)
        if not self.parts:
            return np.zeros((0, 3)), np.zeros((0, 3), np.int64), self.paints
        starts = np.cumsum([0, *(len(v) for v, _ in self.parts)])
        vertices = np.concatenate([v for v, _ in self.parts]) * metres
        faces = np.concatenate([f + s for (_, f), s in zip(self.parts, starts)])
        return vertices, faces, self.paints

    def _target(self, element: Element, field: str = "url") -> Element | None:
        return self.named.get(element.get(field).lstrip("#"))

    def _node(self, node: Element, before: Array, depth: int) -> None:
        self.count += 1
        if depth > MOST_REFERENCES:
            raise self.source.wrong(node, "", "its nodes form a cycle")
        if self.count > MOST_NODES:
            text = f"has more than {MOST_NODES} nodes, repeated ones included"
            raise self.source.wrong(node, "", text)
        turn = before.copy()
        for child in node.children:
            if child.tag in ("matrix", "translate", "rotate", "scale"):
                turn = turn @ self._transform(child)
        for child in node.children:
            target = self._target(child) if child.tag.startswith("instance_") else None
            if child.tag == "node":
                self._node(child, turn, depth + 1)
            elif child.tag == "instance_node" and target is not None:
                self._node(target, turn, depth + 1)
            elif child.tag == "instance_controller" and target is not None:
                skin = target.first("skin")
                source = self._target(skin, "source") if skin is not None else None
                self._geometry(source, turn, child)
            elif child.tag == "instance_geometry":
                self._geometry(target, turn, child)

    def _transform(self, element: Element) -> Array:
        x = self._numbers(element)
        found = np.eye(4)
        sizes = {"matrix": 16, "translate": 3, "rotate": 4, "scale": 3}
        if len(x) != sizes[element.tag]:
            text = f"must hold {sizes[element.tag]} numbers; it holds {len(x)}"
            raise self.source.wrong(element, element.tag, text)
        match element.tag:
            case "matrix":
                return x.reshape(4, 4)
            case "translate":
                found[:3, 3] = x
            case "scale":
                found[:3, :3] = np.diag(x)
            case _:
                size = float(np.linalg.norm(x[:3]))
                if size > 0.0:
                    found[:3, :3] = rodrigues(x[:3] / size, np.radians(x[3]))
        return found

    def _numbers(self, element: Element, kind: Any = float) -> Array:
        try:
            found = np.array(element.text.split(), dtype=kind)
        except (ValueError, OverflowError):
            raise self.source.wrong(element, element.tag, "must hold numbers only") from None
        return found

    def _paint(self, instance: Element, symbol: str) -> Any:
        """Return the colour of the material that a geometry instance binds to a symbol.

        The result is "undefined" if the binding or its target is missing.
        """
        for bound in instance.inside():
            if bound.tag != "instance_material" or bound.get("symbol") != symbol:
                continue
            material = self._target(bound, "target")
            effect = material.first("instance_effect") if material is not None else None
            target = self._target(effect) if effect is not None else None
            inside = target.inside() if target is not None else ()
            diffuse = next((e for e in inside if e.tag == "diffuse"), None)
            if target is None:
                break
            if diffuse is None:
                return None
            if (colour := diffuse.first("color")) is None:
                return "texture" if diffuse.first("texture") is not None else None
            numbers = self._numbers(colour)
            return (*numbers[:3].tolist(), 1.0) if len(numbers) > 2 else None
        return "undefined" if symbol else None

    def _geometry(self, geometry: Element | None, turn: Array, instance: Element) -> None:
        mesh = geometry.first("mesh") if geometry is not None else None
        if mesh is None:
            return
        for primitive in mesh.all(*PRIMITIVES):
            inputs = [*primitive.all("input")]
            vertex = next((i for i in inputs if i.get("semantic") == "VERTEX"), None)
            if vertex is None:
                continue
            points = self._points(vertex)
            stride = 1 + max(int(self.source.number(i, "offset")) for i in inputs)
            offset = int(self.source.number(vertex, "offset"))
            faces = self._faces(primitive, stride, offset)
            if len(faces) and (faces.min() < 0 or faces.max() >= len(points)):
                text = f"has faces that name missing vertices; it has {len(points)}"
                raise self.source.wrong(primitive, "", text)
            self.paints[self._paint(instance, primitive.get("material"))] += len(faces)
            self.parts.append((points @ turn[:3, :3].T + turn[:3, 3], faces))

    def _points(self, vertex: Element) -> Array:
        """Return the (n, 3) positions referenced by a VERTEX input."""
        vertices = self._target(vertex, "source")
        position = None
        if vertices is not None:
            given = (i for i in vertices.all("input") if i.get("semantic") == "POSITION")
            position = next((self._target(i, "source") for i in given), None)
        floats = position.first("float_array") if position is not None else None
        if floats is None or position is None:
            raise self.source.wrong(vertex, "source", "leads to no positions")
        technique = position.first("technique_common")
        accessor = technique.first("accessor") if technique is not None else None
        stride = max(int(self.source.number(accessor, "stride", 3.0)), 3)
        x = self._numbers(floats)
        return x[: len(x) // stride * stride].reshape(-1, stride)[:, :3]

    def _faces(self, primitive: Element, stride: int, offset: int) -> Array:
        corners: list[Array] = []
        for p in primitive.all("p"):
            x = self._numbers(p, np.int64)
            corners.append(x[: len(x) // stride * stride].reshape(-1, stride)[:, offset])
        if not corners:
            return np.zeros((0, 3), np.int64)
        if primitive.tag == "triangles":
            x = np.concatenate(corners)
            return x[: len(x) // 3 * 3].reshape(-1, 3)
        if primitive.tag == "polylist":
            counts = primitive.first("vcount")
            sizes = self._numbers(counts, np.int64) if counts is not None else np.zeros(0, int)
            if (sizes < 0).any() or sizes.sum() > len(corners[0]):
                raise self.source.wrong(primitive, "vcount", "asks for more corners than there are")
            return _fans(corners[0], sizes)
        if primitive.tag == "tristrips":
            return np.concatenate([_strip(x) for x in corners])
        return np.concatenate([_fans(x, np.array([len(x)])) for x in corners])


def _fans(corners: Array, sizes: Array) -> Array:
    """Split polygons into triangles, each polygon as a fan about its first corner."""
    first = np.cumsum(sizes) - sizes
    found: list[Array] = []
    for n in np.unique(sizes):
        if n < 3:
            continue
        polygon = corners[first[sizes == n][:, None] + np.arange(n)]
        found += [polygon[:, [0, k, k + 1]] for k in range(1, n - 1)]
    return np.concatenate(found) if found else np.zeros((0, 3), np.int64)


def _strip(x: Array) -> Array:
    """Return the triangles in a strip, reversing every second one."""
    if len(x) < 3:
        return np.zeros((0, 3), np.int64)
    faces = np.stack((x[:-2], x[1:-1], x[2:]), axis=1)
    faces[1::2] = faces[1::2, ::-1]
    return faces
