"""A model and its mesh files as one file: what a page downloads, and what it opens again."""

from __future__ import annotations

import hashlib
import io
import os
import re
import tempfile
import zipfile
import zlib
from pathlib import Path, PurePosixPath

import pgraph_core as pg
from pgraph_core.mesh_files import FORMATS
from pgraph_core.model.assets import FOLDER

from ..core.cells import Refusal

LARGEST = 12_000_000  # [bytes] as it is sent
LARGEST_WITHIN = 100_000_000  # [bytes] unpacked
# what zipfile raises: damaged, cut, encrypted or by an unknown method, names that are no text
DAMAGED = (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, ValueError)


def mesh_folder() -> Path:
    """Where meshes that came through a page are kept, next to what programs of this user keep."""
    home = os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share"
    return Path(home) / "pgraph" / "meshes"


def packed(model: pg.Model) -> tuple[str, bytes]:
    """(name, content) of a download: JSON, or with meshes a zip of that and them.

    Raises FileError.
    """
    stem = re.sub(r"[^\w-]+", "_", model.name) or "model"
    if not any(shape.file for body in model.bodies for shape in body.shapes):
        return f"{stem}.json", model.to_json().encode()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        model.save(folder / f"{stem}.json")
        return f"{stem}.zip", zipped(folder)


def zipped(folder: Path) -> bytes:
    """A zip of the files in a folder."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(folder.rglob("*")):
            if file.is_file():
                archive.write(file, file.relative_to(folder).as_posix())
    return content.getvalue()


def own(text: str) -> pg.Model:
    """The model in text that Pgraph kept on this machine: its meshes may lie anywhere."""
    return pg.Model.from_json(text, roots=[Path.cwd().anchor])


def unpacked(content: bytes, keep: Path) -> pg.Model:
    """The model in a zip; its meshes go to a folder of `keep`, once all of it could be read.

    Raises Refusal, PgraphError, OSError.
    """
    try:
        size, held = _contents(content)
    except DAMAGED as error:
        raise Refusal(f"it is no zip that can be read ({error}); pack it again") from None
    if size > LARGEST_WITHIN:
        said = f"{size / 1e6:.0f} MB unpacked"
        raise Refusal(f"it has {said}; {LARGEST_WITHIN / 1e6:.0f} MB at most")
    models = [name for name in held if _is_model(name)]
    if len(models) != 1:
        raise Refusal(f"it holds {len(models)} model files (.json), not one")
    folder = keep / hashlib.sha256(content).hexdigest()[:16]
    for name, data in held.items():
        to = folder / name
        to.parent.mkdir(parents=True, exist_ok=True)
        to.write_bytes(data)
    return pg.Model.load(folder / models[0])


def _contents(content: bytes) -> tuple[int, dict[PurePosixPath, bytes]]:
    """(bytes unpacked, models and meshes by name); what is too large is left packed."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        files = {PurePosixPath(item.filename): item for item in archive.infolist()}
        size = sum(item.file_size for item in files.values())
        if size > LARGEST_WITHIN:
            return size, {}
        wanted = {name: item for name, item in files.items() if _is_model(name) or _is_mesh(name)}
        return size, {name: archive.read(item) for name, item in wanted.items()}


def _is_model(name: PurePosixPath) -> bool:
    return name.suffix == ".json" and len(name.parts) == 1


def _is_mesh(name: PurePosixPath) -> bool:
    """Whether it is a mesh where `packed` puts them, and so nowhere else when it is unpacked."""
    return name.parts[:-1] == (FOLDER,) and name.suffix.lower().lstrip(".") in FORMATS
