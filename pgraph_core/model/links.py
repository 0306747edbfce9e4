"""Links that carry a model: the fragment of an address, which browsers do not send to a server.

The fragment `#m=` holds the model as JSON, deflated, in the letters of base64 for addresses.
"""

from __future__ import annotations

import base64
import binascii
import json
import re
import zlib
from typing import Any

from ..errors import FileError, InputError, Problem, choices, explained, shown
from . import files
from .model import Model

MARK = "#m="
PAGE = "http://localhost:8080/"  # address at which `pgraph` serves its page
MOST = 1_000_000  # bytes of a model in a link
SAFE = 2000  # characters of a link that chat and mail programs leave whole
ADDRESS = re.compile(r"(https?://[^#\s]*)?#m=", re.ASCII)
LETTERS = re.compile(r"[\w-]*", re.ASCII)
AGAIN = "copy the link again, or ask for the model as a file"


@explained
def link(model: Model, /, *, base: str | None = None) -> str:
    """Return a link that carries a model, and opens it in the page of Pgraph.

    The model is the fragment of the link, which no server receives. `pg.load(link)` and
    `pgraph 'LINK'` read it as well.

    Parameters
    ----------
    model : Model
        A model without mesh files.
    base : str, optional
        Address of a page of Pgraph, by default the one that `pgraph` serves on this computer.

    Returns
    -------
    str
        The link. Many chat and mail programs cut links of more than 2000 characters.

    Raises
    ------
    InputError
        If the model has mesh files or is larger than 1 MB, or the address is not valid.

    Examples
    --------
    >>> model = pg.load("pendulum")
    >>> pg.load(pg.link(model)) == model
    True
    """
    if not isinstance(model, Model):
        text = f"must be a pg.Model, got {shown(model)}"
        raise InputError(Problem("link", "model", text))
    page = PAGE if base is None else base
    if not isinstance(page, str) or not re.fullmatch(r"https?://[^#\s]+", page):
        text = f"must be an address without a fragment, such as {PAGE}, got {shown(base)}"
        raise InputError(Problem("link", "base", text))
    return page + fragment_of(model)


def fragment_of(model: Model) -> str:
    """Return the fragment of a link, with its mark. Raises InputError."""
    if with_files := _with_files(model):
        text = f"a link carries no files, and these bodies have meshes: {choices(with_files, 8)}; "
        text += "give them other shapes, or send a file that model.save or the page writes"
        raise InputError(Problem("link", "model", text))
    text = json.dumps(json.loads(model.to_json()), separators=(",", ":"))
    if len(text) > MOST:
        size = f"has {len(text) / 1e6:.2g} MB as text, and a link carries {MOST / 1e6:g} MB; "
        raise InputError(Problem("link", "model", f"{size}send a file that model.save writes"))
    packed = base64.urlsafe_b64encode(zlib.compress(text.encode(), 9))
    return MARK + packed.decode().rstrip("=")


def is_link(given: Any) -> bool:
    """Check whether a path is a link that carries a model."""
    return isinstance(given, str) and ADDRESS.match(given) is not None


def linked(given: str) -> Model:
    """Return the model of a link, or of its fragment. Raises FileError, ModelError."""
    text = given.strip().partition(MARK)[2]
    if not LETTERS.fullmatch(text) or not text:
        strange = text[LETTERS.match(text).end() :][:1]  # pyright: ignore[reportOptionalMemberAccess]
        what = f"contains {strange!r}, which no link has" if strange else "is empty"
        raise FileError(Problem("link", "", f"{what}; {AGAIN}"))
    try:
        found = _inflated(base64.urlsafe_b64decode(text + "=" * (-len(text) % 4))).decode()
    except (binascii.Error, zlib.error, UnicodeDecodeError):
        raise FileError(Problem("link", "", f"is damaged, or was cut; {AGAIN}")) from None
    data = files.parse(found, "link")
    if _names_files(data):  # before a shape opens one
        text = "names files of meshes, which a link does not carry; ask for the model as a file"
        raise FileError(Problem("link", "", text))
    return Model(**data)


def _inflated(packed: bytes) -> bytes:
    """Return the content, of at most MOST bytes. Raises zlib.error, FileError."""
    reader = zlib.decompressobj()
    found = reader.decompress(packed, MOST + 1)
    if len(found) > MOST:
        text = f"holds more than {MOST / 1e6:g} MB, which no model in a link does"
        raise FileError(Problem("link", "", f"{text}; ask for the model as a file"))
    if not reader.eof or reader.unused_data:
        raise zlib.error("it is cut, or something follows")
    return found


def _names_files(value: Any) -> bool:
    """Check whether the fields of a part, or of any part within it, name a file."""
    if isinstance(value, dict):
        return bool(value.get("file")) or any(map(_names_files, value.values()))
    return isinstance(value, list) and any(map(_names_files, value))


def _with_files(model: Model) -> list[str]:
    """Return the names of bodies with mesh files."""
    return [body.name for body in model.bodies if any(shape.file for shape in body.shapes)]
