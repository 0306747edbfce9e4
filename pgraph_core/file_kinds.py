"""Kinds of files that are not models, identified by their content or their suffix.

Readers call this module first, so that the error message for a mesh or a file of another program
suggests a remedy, regardless of the file name.
"""

from __future__ import annotations

import re
from pathlib import PurePath
from typing import NamedTuple

from .markup import LFS, POINTER
from .mesh_files import FORMATS, looks_like

HEAD = 65536  # bytes of a file in which its first element stands
FIRST = re.compile(rb"<([A-Za-z_][\w:.-]*)")
MODELS = ".json, .urdf, .xacro, .xml (MJCF), .mjcf, .osim or .step"
MINE = ("robot", "mujoco", "OpenSimDocument")  # first elements of the models in XML that are read
BLANK = b"\xef\xbb\xbf \t\r\n"  # a byte-order mark and white space
ZIP = b"PK\3\4"
OTHERS = "which is not read; give a URDF or MJCF file of the model"
SHAPE = "which has no joints; make it the shape of a body: pg.Shape(kind='mesh', file=...)"


class FileKind(NamedTuple):
    """A kind of file, with a remedy for a user who gives it as a model."""

    suffixes: str
    text: str
    roots: str = ""  # first elements of such a file in XML
    sign: bytes = b"(?!)"  # regular expression for the start of its content


SIGNS = {  # first element and start of formats in XML and JSON
    "dae": ("COLLADA",),
    "gltf": ("", rb'\{\s*"(asset|accessors|buffers|scenes?)"'),
}
FMU = (
    "is an FMU, which is a program and no model; give the model that it was made from: an FMU of "
    "Pgraph contains it as resources/model.json. As a controller, pg.read_fmu reads it"
)
ARCHIVE = FileKind("zip", "is an archive; unpack it, or open it by the page: pgraph FILE.zip")
KINDS = (
    FileKind("", POINTER, sign=LFS),
    FileKind("sdf world", f"is SDF, {OTHERS}", "sdf gazebo"),
    FileKind("usd usda usdc usdz", f"is USD, {OTHERS}", sign=rb"#usda|PXR-USDC"),
    FileKind("proto wbt", f"is a model of Webots, {OTHERS}", sign=rb"#VRML_SIM"),
    FileKind("skel ttt ttm slx mdl mo adm cmd bvh", f"is a model of another program, {OTHERS}"),
    FileKind("mjb", "is a compiled model of MuJoCo; give the MJCF file that it was made from"),
    FileKind(
        "iges igs brep fcstd sldprt sldasm catpart catproduct ipt iam x_t x_b 3dm f3d",
        "is CAD of a kind that is not read; save it as STEP",
    ),
    *(
        FileKind(x, f"is a mesh in {x.upper()}, {SHAPE}", *SIGNS.get(x, ()))
        for x in FORMATS
    ),
    FileKind(
        "fbx 3ds blend wrl x3d ifc",
        f"is a mesh or scene of a format that is not read; convert it to {', '.join(FORMATS)}, and "
        "make it the shape of a body",
        "X3D", rb'Kaydara FBX|; FBX|#VRML V|BLENDER',
    ),
    FileKind("npz", "contains a run; use pg.Result.load"),
    FileKind(
        "c3d trc mot sto",
        "is a trial of motion capture; give it with a model: pgraph track MODEL FILE, or "
        "pg.read_trial",
        sign=rb"PathFileType",
    ),
    FileKind("fmu", FMU),
    ARCHIVE,
    FileKind(
        "png jpg jpeg gif svg mp4 pdf html htm csv tsv mat h5 yaml yml toml txt md py m pkl gz",
        f"does not contain a supported model; models end in {MODELS}", "svg html",
    ),
)  # fmt: skip


def first_element(head: bytes) -> str:
    """Return the name of the first element at the start of an XML file, or ""."""
    head = head[:HEAD].lstrip(BLANK)
    if not head.startswith(b"<"):
        return ""
    found = FIRST.search(re.sub(rb"<!--.*?-->", b"", head, flags=re.DOTALL))
    return found[1].decode() if found else ""


def is_step(content: bytes) -> bool:
    """Check whether a file begins as STEP (ISO 10303-21), and is none of a building (IFC)."""
    return content[:HEAD].lstrip(BLANK).startswith(b"ISO-10303-21") and b"IFC" not in content[:HEAD]


def is_json(content: bytes) -> bool:
    """Check whether a file begins as an object in JSON."""
    return content[:HEAD].lstrip(BLANK).startswith(b"{")


def kind_of(path: str | PurePath, content: bytes) -> FileKind | None:
    """Return the kind of a file, or None if it may be a model. The content counts first."""
    suffix = PurePath(path).suffix.lower().lstrip(".")
    by_suffix = next((kind for kind in KINDS if suffix in kind.suffixes.split()), None)
    begun = content[:HEAD].lstrip(BLANK)
    root = first_element(begun)
    if not begun or root in MINE:
        return None if root else by_suffix
    json = is_json(content)
    for kind in KINDS:
        alike = kind.suffixes in FORMATS and not (root or json)
        mesh = alike and looks_like(kind.suffixes, content)
        if mesh or root in kind.roots.split() or re.match(kind.sign, begun):
            return kind
    if json:  # possibly a Pgraph model, whatever its name
        return None
    return by_suffix or (ARCHIVE if begun.startswith(ZIP) else None)
