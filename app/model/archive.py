"""A model and its mesh files in one file, for download and for opening again."""

from __future__ import annotations

import hashlib
import io
import posixpath
import re
import tempfile
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path, PurePosixPath

import pgraph_core as pg
from pgraph_core.errors import choices
from pgraph_core.file_kinds import ARCHIVE, KINDS, MODELS, first_element, kind_of
from pgraph_core.formats import READERS, ROOTS, read_model, write_model
from pgraph_core.formats.xacro import SUFFIX
from pgraph_core.mesh_files import FORMATS
from pgraph_core.model.files import FOLDER, FOREIGN
from pgraph_core.model.files import mesh_folder as mesh_folder

from ..core.cells import Refusal

LARGEST = 12_000_000  # [bytes] limit on the sent file
LARGEST_WITHIN = 100_000_000  # [bytes] unpacked
LARGEST_KEPT = 1_000_000_000  # [bytes] limit on all meshes received from pages
# what zipfile raises: damaged, cut, encrypted or by an unknown method, names that are no text
DAMAGED = (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, ValueError)


def packed(model: pg.Model) -> tuple[str, bytes]:
    """Return (name, content) for a download: JSON, or a zip of JSON and meshes if there are any.

    Raises FileError.
    """
    return converted(model, ".json")[:2]


def converted(model: pg.Model, suffix: str) -> tuple[str, bytes, pg.Report]:
    """Return (name, content, report) for a download in the format given by this suffix.

    One file, or with meshes a zip of it and them. Raises FileError, ModelError.
    """
    stem = re.sub(r"[^\w-]+", "_", model.name) or "model"
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        file = folder / f"{stem}{suffix}"
        report = write_model(model, file)
        if any(shape.file for body in model.bodies for shape in body.shapes):
            return f"{stem}.zip", zipped(folder), report
        return file.name, file.read_bytes(), report


def zipped(folder: Path) -> bytes:
    """Zip the files in a folder."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(folder.rglob("*")):
            if file.is_file():
                archive.write(file, file.relative_to(folder).as_posix())
    return content.getvalue()


def own(text: str) -> pg.Model:
    """Read a model that Pgraph stored on this machine. Its meshes may be located anywhere."""
    return pg.Model.from_json(text, roots=[Path.cwd().anchor])


def read_text(name: str, content: str) -> tuple[pg.Model, pg.Report]:
    """Read a model from text in another format, without the files that it refers to.

    Raises PgraphError, and Refusal for a program.
    """
    refuse_program(name)
    with tempfile.TemporaryDirectory() as place:
        file = Path(place) / Path(name).name
        file.write_text(content, encoding="utf-8")
        return read_model(file)


class Several(Refusal):
    """An archive with several models from which the user has to choose."""

    def __init__(self, members: list[str]):
        self.members = tuple(members)
        super().__init__(
            f"it holds {len(members)} model files, {choices(members)}; name one of them"
        )


def folder_of(content: bytes, keep: Path) -> Path:
    """Return the folder in `keep` that stores the files of an archive."""
    return keep / hashlib.sha256(content).hexdigest()[:16]


def refuse_program(name: str | PurePosixPath) -> None:
    """Raise Refusal for a file whose macros form a program."""
    if PurePosixPath(name).suffix.lower() == SUFFIX:
        own = PurePosixPath(name).name
        text = f"{own}: macros can execute code, which uploaded files must not do; "
        raise Refusal(f"{text}start Pgraph with it: pgraph {own}")


def unpacked(content: bytes, keep: Path, member: str = "") -> tuple[pg.Model, pg.Report]:
    """Read the model in a zip, and store its meshes in a folder in `keep`.

    A Pgraph model is at the top with its meshes in `meshes`. A model of another format may be in
    any folder with the files that it names. `member` names one of several models.
    Raises Refusal, PgraphError, OSError.
    """
    try:
        size, held, others = _contents(content)
    except DAMAGED:
        text = "it cannot be read as a zip file: damaged, incomplete or encrypted; pack it again"
        raise Refusal(text) from None
    if size > LARGEST_WITHIN:
        said = f"{size / 1e6:.0f} MB unpacked"
        raise Refusal(f"it has {said}; {LARGEST_WITHIN / 1e6:.0f} MB at most")
    models = [name for name in held if _is_model(name)] or _of_others(held)
    if not models:
        for name in sorted(others):
            refuse_program(name)
        kinds = {str(name): kind_of(name, b"") for name in (*held, *others)}
        known = [(KINDS.index(kind), name) for name, kind in kinds.items() if kind]
        if known:  # a model of another program goes before a mesh
            rank, name = min(known)
            if KINDS[rank] == ARCHIVE:
                raise Refusal(f"{name} is an archive within it; unpack that one and open it alone")
            raise Refusal(f"{name} {KINDS[rank].text}")
        for name in sorted((*held, *others)):
            if FOREIGN.get(name.suffix.lower()) == "step":
                raise Refusal(f"{name} is a CAD assembly; drop it alone, without an archive")
        raise Refusal(f"it does not contain a model; models end in {MODELS}")
    chosen = [name for name in models if str(name) == member] if member else models
    if len(chosen) != 1:
        raise Several([*map(str, models)])
    folder = folder_of(content, keep)
    if not folder.exists() and _size(keep) + size > LARGEST_KEPT:
        most = f"{LARGEST_KEPT / 1e6:.0f} MB"
        raise Refusal(f"{keep} would exceed {most}; remove files that you no longer need")
    used = {file for file in folder.rglob("*") if file.is_file()}
    try:
        for name, data in held.items():
            to = folder / name
            to.parent.mkdir(parents=True, exist_ok=True)
            to.write_bytes(data)
        model, report = read_model(folder / chosen[0], roots=[folder])
        used |= {Path(s.file).resolve() for b in model.bodies for s in b.shapes if s.file}
        return model, report
    finally:
        for name in held:
            if folder / name not in used and (folder / name).resolve() not in used:
                (folder / name).unlink(missing_ok=True)


def _size(folder: Path) -> int:
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())


def _contents(content: bytes) -> tuple[int, dict[PurePosixPath, bytes], set[PurePosixPath]]:
    """Return (unpacked bytes, models and meshes by name, other names). Large files stay packed."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        files = {PurePosixPath(item.filename): item for item in archive.infolist()}
        size = sum(item.file_size for item in files.values())
        if size > LARGEST_WITHIN:
            return size, {}, set()
        foreign = not any(_is_model(name) for name in files)
        wanted = {
            name: item
            for name, item in files.items()
            if _is_model(name) or _is_mesh(name) or (foreign and _goes_along(name))
        }
        held = {name: _unpacked(archive, item) for name, item in wanted.items()}
        return size, held, files.keys() - held.keys()


def _unpacked(archive: zipfile.ZipFile, item: zipfile.ZipInfo) -> bytes:
    """Return the content of a file. No more is unpacked than the archive says that there is."""
    with archive.open(item) as file:
        return file.read(item.file_size + 1)  # without a number, zipfile unpacks all, and then cuts


NAMED = re.compile(rb"""<(?:include|model)\s[^>]*?file\s*=\s*["']([^"']+)["']""")


def _of_others(held: Mapping[PurePosixPath, bytes]) -> list[PurePosixPath]:
    """Return models in other formats, starting with those nearest to the top level.

    A file that another one includes is a part of that one, and not each XML file is a model.
    """
    others = [n for n in held if n.suffix.lower() in READERS and first_element(held[n]) in ROOTS]
    parts = {
        posixpath.normpath(name.parent / file.decode(errors="replace"))
        for name in others
        for file in NAMED.findall(held[name])
    }
    whole = [name for name in others if posixpath.normpath(name) not in parts]
    return sorted(whole, key=lambda name: (len(name.parts), name)) or others


def _goes_along(name: PurePosixPath) -> bool:
    """Return True for a file inside the archive that a model in another format may refer to."""
    inside = not name.is_absolute() and ".." not in name.parts
    return inside and name.suffix.lower().lstrip(".") in (
        *FORMATS,
        *(suffix.lstrip(".") for suffix in READERS if suffix != SUFFIX),  # programs stay packed
        "bin",
        "mtl",
        "png",
        "vtp",  # pictures of OpenSim
    )


def _is_model(name: PurePosixPath) -> bool:
    return name.suffix == ".json" and len(name.parts) == 1


def _is_mesh(name: PurePosixPath) -> bool:
    """Return True for a mesh in the folder of `packed`, which exists only after unpacking."""
    return name.parts[:-1] == (FOLDER,) and name.suffix.lower().lstrip(".") in FORMATS
