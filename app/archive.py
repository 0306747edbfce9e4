"""A model and its mesh files as one file: what a page downloads, and what it opens again."""

from __future__ import annotations

import hashlib
import io
import re
import tempfile
import zipfile
from pathlib import Path, PurePosixPath

import pgraph_core as pg
from pgraph_core.schema.assets import FOLDER

from .cells import Refusal

LARGEST = 12_000_000  # [bytes] as it is sent
LARGEST_WITHIN = 100_000_000  # [bytes] unpacked
FORMATS = ("glb", "obj", "off", "ply", "stl")


def packed(model: pg.Model) -> tuple[str, bytes]:
    """(name, content) of a download: JSON, or with meshes a zip of that and them.

    Raises FileError.
    """
    stem = re.sub(r"[^\w-]+", "_", model.name) or "model"
    if not any(body.shape is not None and body.shape.file for body in model.bodies):
        return f"{stem}.json", model.to_json().encode()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        model.save(folder / f"{stem}.json")
        content = io.BytesIO()
        with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
            for file in sorted(folder.rglob("*")):
                if file.is_file():
                    archive.write(file, file.relative_to(folder).as_posix())
    return f"{stem}.zip", content.getvalue()


def unpacked(content: bytes, keep: Path) -> pg.Model:
    """The model in a zip; its meshes go to a folder of `keep`. Raises Refusal, PgraphError."""
    try:
        archive = zipfile.ZipFile(io.BytesIO(content))
        files = {PurePosixPath(item.filename): item for item in archive.infolist()}
        size = sum(item.file_size for item in files.values())
        if size > LARGEST_WITHIN:
            said = f"{size / 1e6:.0f} MB unpacked"
            raise Refusal(f"it has {said}; {LARGEST_WITHIN / 1e6:.0f} MB at most")
        models = [name for name in files if name.suffix == ".json" and len(name.parts) == 1]
        if len(models) != 1:
            raise Refusal(f"it holds {len(models)} model files (.json), not one")
        folder = keep / hashlib.sha256(content).hexdigest()[:16]
        for name, item in files.items():
            if name in models or _is_mesh(name):
                to = folder / name
                to.parent.mkdir(parents=True, exist_ok=True)
                to.write_bytes(archive.read(item))
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, OSError) as error:
        raise Refusal(f"it is no zip that can be read: {error}") from None
    return pg.Model.load(folder / models[0])


def _is_mesh(name: PurePosixPath) -> bool:
    """Whether it is a mesh where `packed` puts them, and so nowhere else when it is unpacked."""
    return name.parts[:-1] == (FOLDER,) and name.suffix.lower().lstrip(".") in FORMATS
