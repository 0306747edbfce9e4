"""Triangles of COLLADA files (.dae): the geometry of the scene, in metres.

Nothing but geometry is read: no images, lights, bones. The unit of the file counts; its `up_axis`
does not, as robots' files are placed by their own axes (ROS does the same).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .markup import Element, Source, parse_markup

Array = np.ndarray
PRIMITIVES = ("triangles", "polylist", "polygons", "trifans", "tristrips")
DEEPEST = 100  # nodes that name nodes


def triangles(content: bytes, name: str) -> tuple[Array, Array]:
    """(vertices (n, 3) [m], faces (m, 3)) of all geometry in the scene. Raises FileError."""
    return _Collada(parse_markup(content, name), Source(name)).triangles()


class _Collada:
    def __init__(self, root: Element, source: Source):
        self.root, self.source = root, source
        self.named = {e.get("id"): e for e in root.inside() if e.get("id")}
        self.parts: list[tuple[Array, Array]] = []
        self.count = 0

    def triangles(self) -> tuple[Array, Array]:
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
            return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
        starts = np.cumsum([0, *(len(v) for v, _ in self.parts)])
        vertices = np.concatenate([v for v, _ in self.parts]) * metres
        return vertices, np.concatenate([f + s for (_, f), s in zip(self.parts, starts)])

    def _target(self, element: Element, field: str = "url") -> Element | None:
        return self.named.get(element.get(field).lstrip("#"))

    def _node(self, node: Element, before: Array, depth: int) -> None:
        self.count += 1
        if depth > DEEPEST or self.count > 100_000:
            raise self.source.wrong(node, "", "its nodes name each other in a circle")
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
                self._geometry(self._target(skin, "source") if skin is not None else None, turn)
            elif child.tag == "instance_geometry":
                self._geometry(target, turn)

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
                found[:3, :3] = _turn(x[:3], np.radians(x[3]))
        return found

    def _numbers(self, element: Element, kind: Any = float) -> Array:
        try:
            found = np.array(element.text.split(), dtype=kind)
        except (ValueError, OverflowError):
            raise self.source.wrong(element, element.tag, "must hold numbers only") from None
        return found

    def _geometry(self, geometry: Element | None, turn: Array) -> None:
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
                text = f"has faces of vertices that are not there; it has {len(points)}"
                raise self.source.wrong(primitive, "", text)
            self.parts.append((points @ turn[:3, :3].T + turn[:3, 3], faces))

    def _points(self, vertex: Element) -> Array:
        """(n, 3) positions that a VERTEX input stands for."""
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
    """Triangles of polygons, each a fan about its first corner."""
    first = np.cumsum(sizes) - sizes
    found: list[Array] = []
    for n in np.unique(sizes):
        if n < 3:
            continue
        polygon = corners[first[sizes == n][:, None] + np.arange(n)]
        found += [polygon[:, [0, k, k + 1]] for k in range(1, n - 1)]
    return np.concatenate(found) if found else np.zeros((0, 3), np.int64)


def _strip(x: Array) -> Array:
    """Triangles of a strip; every second is wound the other way."""
    if len(x) < 3:
        return np.zeros((0, 3), np.int64)
    faces = np.stack((x[:-2], x[1:-1], x[2:]), axis=1)
    faces[1::2] = faces[1::2, ::-1]
    return faces


def _turn(axis: Array, angle: float) -> Array:
    """(3, 3) rotation about an axis of any length but zero."""
    size = float(np.linalg.norm(axis))
    if size == 0.0:
        return np.eye(3)
    x, y, z = axis / size
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
