"""The files of an MJCF model, which are checked before MuJoCo opens any of them."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ..errors import FileError, Problem, shown
from ..markup import LONGEST_PATH, Element, ordinary, read_markup, stand_in
from .conversion import MISSING, Folders
from .mjcf_compiled import newer

MOST_INCLUDES = 200
MOST_COPIED = 20_000  # elements that <replicate> makes
MOST_HEIGHTS = 4_000_000  # limit on the heights of a heightfield
DIRECTORIES = ("meshdir", "texturedir", "assetdir")
ENCODINGS = {"utf-8", "us-ascii", "ascii", "iso-8859-1", "latin-1", "windows-1252"}


def _copied(element: Element, inside: bool) -> int:
    """Count the elements created by replication from `element` and its subtree."""
    inside = inside or element.tag == "replicate"
    below = sum(_copied(child, inside) for child in element.children) + inside
    return below * (_whole(element.get("count")) if element.tag == "replicate" else 1)


def _whole(text: str) -> int:
    """Parse a whole number. Return 1 for any other text, which MuJoCo rejects or ignores."""
    text = text.strip()
    return int(text) if text.isascii() and text.isdigit() and len(text) < 20 else 1


def slashed(path: str) -> str:
    """Replace backslashes with slashes, since MuJoCo treats both in the same way."""
    return path.replace("\\", "/")


def _readable(path: Path) -> Element:
    """Return the root of an XML file with an encoding that MuJoCo can read. Raises FileError.

    MuJoCo reads bytes and ignores the declared encoding. In a multi-byte encoding, a byte within a
    character can equal a quotation mark, and MuJoCo would then open a different file from the one
    that was checked.
    """
    root = read_markup(path)
    if root.tag == "mujoco" and root.encoding not in ENCODINGS:
        text = f"is in {root.encoding}, which MuJoCo does not read; save it in UTF-8"
        raise FileError(Problem(path.name, "encoding", text))
    return root


def _notable(tag: str, attributes: Iterable[str]) -> tuple[str, ...]:
    """Return the attributes of an element that are newer than MuJoCo 4.0 or whose value counts."""
    looked_at = (x for x in attributes if x in ("nrow", "quat") or x.startswith("file"))
    return (*dict.fromkeys((*newer(tag, attributes), *looked_at)),)


def _pointer(path: Path) -> str:
    """Return a message if a file stands for another one, as Git leaves it, or ""."""
    try:
        with ordinary(path) as file:
            text = stand_in(file.read(LONGEST_PATH))
    except (OSError, ValueError):
        return ""  # MuJoCo says why it cannot be read
    return text and f"{path.name} {text}"


class Files:
    """The file and its includes, checked before MuJoCo opens anything."""

    def __init__(self, path: Path, folders: Folders):
        self.folders, self.lines = folders, dict[tuple[str, str], str]()
        self.newer: list[tuple[str, str]] = []  # (place, attribute) beyond MuJoCo 4.0
        self.absent = list[Problem]()  # files that are not there, where MuJoCo may not look
        self.alike = dict[tuple[str, ...], tuple[str, ...]]()  # (tag, attributes) -> `_notable`
        root = _readable(path)
        if root.tag != "mujoco":
            do = "; give it to read_urdf" if root.tag == "robot" else ""
            text = f"holds <{root.tag}>, not the <mujoco> of an MJCF file{do}"
            raise FileError(Problem(f"{path.name}, line {root.line}", "", text))
        self.roots = [(path, root)]
        self.elements = dict[Path, list[Element]]()  # elements by file, in order
        # by the names as written, since a link is another file in MuJoCo; "" is the file itself
        self.included = {"": path}
        self._include(path, root)
        self.directories = [*dict.fromkeys(file.parent.absolute() for file, _ in self.roots)]
        for file, top in self.roots:
            for compiler in top.all("compiler"):
                for name in DIRECTORIES:
                    if given := compiler.get(name):
                        self._directory(file, compiler, name, given)
        for file, top in self.roots:
            elements = self.elements[file]
            repeats = any(element.tag == "replicate" for element in elements)
            if repeats and (count := _copied(top, False)) > MOST_COPIED:
                text = f"its <replicate> make {count:.6g} elements; {MOST_COPIED} at most"
                raise FileError(Problem(file.name, "", text))
            name = file.name
            for element in elements:
                self._look(name, element)

    def spec(self, mujoco: Any) -> Any:
        """Return MuJoCo's spec for the file, read as text if MuJoCo does not know the suffix."""
        path = self.roots[0][0].absolute()
        if path.suffix in (".xml", ".urdf"):
            return mujoco.MjSpec.from_file(str(path))
        included = {name: file.read_bytes() for name, file in self.included.items() if name}
        spec = mujoco.MjSpec.from_string(path.read_text(), include=included)
        spec.modelfiledir = str(path.parent)
        return spec

    def _include(self, file: Path, top: Element) -> None:
        """Read the files included by a file, and the models that it attaches."""
        elements = self.elements[file] = [*top.inside()]
        for element in elements:
            if element.tag not in ("include", "model") or "file" not in element.attributes:
                continue
            given = slashed(element.get("file"))
            path, why = self.folders.find(given)
            where = f"{file.name}, line {element.line}, {element.tag}"
            if path is None:
                raise FileError(Problem(where, "file", f"{shown(element.get('file'))}: {why}"))
            known = given in self.included
            if known and element.tag == "model":  # may be attached more than once
                continue
            if known:
                text = f"{shown(given)} is included twice, which MuJoCo refuses; include a copy of "
                raise FileError(Problem(where, "", f"{text}it, or a link to it"))
            if len(self.roots) > MOST_INCLUDES:
                text = f"includes more than {MOST_INCLUDES} files"
                raise FileError(Problem(where, "", text))
            self.included[given] = path
            inside = _readable(path)
            self.roots.append((path, inside))
            self._include(path, inside)

    def _directory(self, file: Path, compiler: Element, name: str, given: str) -> None:
        path = self.directories[0] / slashed(given)
        if why := self.folders.outside(path):
            where = f"{file.name}, line {compiler.line}, compiler"
            why = why if os.path.lexists(path) else "there is no such folder"
            raise FileError(Problem(where, name, f"{shown(given)}: {why}"))
        self.directories.append(path)

    def _look(self, file: str, element: Element) -> None:
        """Record the location of an element, and reject files outside the permitted folders."""
        tag, attributes = element.tag, element.attributes
        if name := attributes.get("name"):
            self.lines.setdefault((tag, name), f"{file}, line {element.line}")
        kind = (tag, *attributes)
        notable = self.alike.get(kind)
        if notable is None:
            notable = self.alike[kind] = _notable(tag, attributes)
        for key in notable:
            where = f"{file}, line {element.line}, {tag}"
            if key in newer(tag, (key,)):
                self.newer.append((where, key))
            if why := self._wrong(where, element, key, attributes[key]):
                raise FileError(Problem(where, key, why))

    def _wrong(self, where: str, element: Element, key: str, given: str) -> str:
        """Return the reason to reject an attribute that MuJoCo would accept, or ""."""
        if key == "nrow" and _whole(given) * _whole(element.get("ncol")) > MOST_HEIGHTS:
            return f"nrow times ncol must be at most {MOST_HEIGHTS}; give a coarser one"
        if key == "quat" and given and not given.strip("0+-.eE \t\n"):
            return f"must not be zero, got {shown(given)}; omit it for no rotation"
        if key.startswith("file") and element.tag != "include" and given:
            paths = [folder / slashed(given) for folder in self.directories]
            there = [path for path in paths if os.path.lexists(path)]  # False for a name too long
            if not there:
                text = (
                    f"{shown(given)}: {MISSING} in {self.directories[-1]}; put it there, or give "
                )
                self.absent.append(Problem(where, key, f"{text}its folder by meshdir, texturedir"))
            if why := next(filter(None, map(self.folders.outside, there)), ""):
                return f"{shown(given)}: {why}"
            if not there and self.folders.outside(paths[0]):  # MuJoCo may look elsewhere
                return f"{shown(given)}: {MISSING}"
            return next((text for path in there if (text := _pointer(path))), "")
        return ""
