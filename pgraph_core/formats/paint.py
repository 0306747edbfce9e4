"""Colours from mesh files in COLLADA, OBJ (with its .mtl file), glTF and PLY format."""

from __future__ import annotations

import json
import re
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..markup import content_of
from ..mesh_files import LARGEST_MESH, glb_of, parsed_mesh

UNDEFINED = "undefined"  # paint of faces with a material that is not there
MOST_MATERIALS = 1_000_000  # bytes of a file of materials
Rgba = tuple[float, float, float, float]


class Seen(NamedTuple):
    """The size and colours of a mesh file."""

    size: float  # largest extent, in the units of the file
    colour: Rgba | None  # colour of most of its faces, from 0 to 1
    lost: str  # description of colours that are not drawn, or ""


def seen_in(file: Path) -> Seen:
    """Return the size and colours of a mesh file. Raises FileError, OSError."""
    mesh = parsed_mesh(file)
    size = float(np.max(mesh.extents))
    match file.suffix.lower():
        case ".dae":
            faces = mesh.metadata["paints"]
        case ".obj":
            faces = _of_obj(file)
        case ".glb":
            faces = _of_glb(content_of(file, LARGEST_MESH))
        case ".gltf":
            faces = _of_glb(glb_of(content_of(file, LARGEST_MESH), file.absolute().parent))
        case ".ply":
            faces = _of_ply(mesh)
        case _:
            faces = Counter[Any]()
    return Seen(size, *_most(faces))


LOST = {
    "texture": "its textures are not drawn",
    UNDEFINED: "it refers to undefined materials, so their faces have no colour",
}


def _most(faces: Counter[Any]) -> tuple[Rgba | None, str]:
    """Return the most common face colour and the lost properties, as described in `LOST`."""
    colours = Counter({paint: n for paint, n in faces.items() if isinstance(paint, tuple)})
    lost = [text for paint, text in LOST.items() if faces[paint]]
    if not colours:
        return None, "; ".join(lost)
    (most, _), *others = colours.most_common()
    if others:
        lost.append(
            f"it has {len(colours)} colours; the whole mesh is drawn in the most frequent one"
        )
    colour, text = within_0_and_1(most)
    return colour, "; ".join([*lost, text] if text else lost)


def within_0_and_1(colour: Any) -> tuple[Rgba, str]:
    """Return red, green, blue and opacity limited to 0 to 1, and a sentence if one was not."""
    r, g, b, a = (min(max(float(x), 0.0), 1.0) if np.isfinite(x) else 1.0 for x in colour)
    given = ", ".join(f"{x:.6g}" for x in colour)
    changed = (r, g, b, a) != tuple(colour)
    return (r, g, b, a), f"its colour {given} is limited to numbers from 0 to 1" * changed


# -- OBJ -------------------------------------------------------------------------------------------

LINES = re.compile(rb"^[ \t]*(?:(usemtl|mtllib)[ \t]+([^\r\n]+)|f[ \t])", re.MULTILINE)


def _of_obj(file: Path) -> Counter[Any]:
    """Count faces by the colour of their material. Its files are read from the mesh's folder."""
    material, materials, faces = "", dict[str, Any](), Counter[Any]()
    for line in LINES.finditer(content_of(file, LARGEST_MESH)):
        name = (line[2] or b"").decode(errors="replace").strip()
        if line[1] == b"mtllib":
            materials |= _materials(file.parent, name)
        elif line[1] == b"usemtl":
            material = name
        else:
            faces[materials.get(material, UNDEFINED) if material else None] += 1
    return faces


def _materials(folder: Path, name: str) -> dict[str, Any]:
    """Return the colours in a .mtl file next to a mesh, by material name."""
    found, at = dict[str, Any](), ""
    try:
        if Path(name).name != name or (folder / name).is_symlink():
            return {}  # only a file of the mesh's own folder is opened
        text = content_of(folder / name, MOST_MATERIALS).decode(errors="replace")
    except (OSError, ValueError):
        return {}
    for line in text.splitlines():
        word, _, rest = line.strip().partition(" ")
        try:
            match word:
                case "newmtl":
                    at = rest.strip()
                    found[at] = None
                case "Kd":
                    r, g, b = map(float, rest.split()[:3])
                    found[at] = (r, g, b, 1.0)
                case "d" | "Tr" if isinstance(found.get(at), tuple):
                    share = float(rest)
                    found[at] = (*found[at][:3], share if word == "d" else 1.0 - share)
                case "map_Kd":
                    found[at] = "texture"
        except ValueError:  # not a number, so no colour
            found[at] = UNDEFINED
    return found


# -- glTF and PLY ----------------------------------------------------------------------------------

JSON_CHUNK = 0x4E4F534A


def _of_glb(content: bytes) -> Counter[Any]:
    """Count triangle corners by the colour of their material."""
    length, kind = (int.from_bytes(content[k : k + 4], "little") for k in (12, 16))
    faces = Counter[Any]()
    try:
        data = json.loads(content[20 : 20 + length]) if kind == JSON_CHUNK else {}
        for mesh in data.get("meshes", ()):
            for part in mesh["primitives"]:
                corners = data["accessors"][part.get("indices", part["attributes"]["POSITION"])]
                material = data["materials"][part["material"]] if "material" in part else {}
                rough = material.get("pbrMetallicRoughness", {})
                paint = tuple(rough.get("baseColorFactor", (1.0,) * 4)) if material else None
                textured = "baseColorTexture" in rough
                faces["texture" if textured else _encoded(paint)] += int(corners["count"])
    except (KeyError, IndexError, TypeError, AttributeError, ValueError, RecursionError):
        return Counter({UNDEFINED: 1})  # a mesh that is read may have damaged materials
    return faces


def _encoded(colour: Any) -> Any:
    """Convert a linear colour to sRGB (IEC 61966-2-1), which all other formats use."""
    if colour is None:
        return None
    r, g, b, a = (float(x) for x in colour)
    rgb = (12.92 * x if x <= 0.0031308 else 1.055 * x ** (1 / 2.4) - 0.055 for x in (r, g, b))
    return (*rgb, a)


def _of_ply(mesh: Any) -> Counter[Any]:
    """Count corners or faces by colour."""
    if mesh.visual.kind not in ("vertex", "face"):
        return Counter()
    colours = np.asarray(getattr(mesh.visual, f"{mesh.visual.kind}_colors"))[:, :4]
    each, counts = np.unique(colours, axis=0, return_counts=True)
    return Counter(dict(zip(map(tuple, (each / 255).tolist()), counts.tolist(), strict=True)))
