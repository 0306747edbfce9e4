"""The archive of kernels shipped with the package, a file of bitcode.

A file begins with the SHA-256 digest of the rest. Then follow the length of an index in JSON, the
index, and the sections, compressed together, since code for lanes of different widths is alike.
Pieces of bitcode are named by the hash of their content.
"""

from __future__ import annotations

import hashlib
import json
import lzma
import os
import zlib
from collections.abc import Mapping
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numpy as np

from . import sources
from .jit import ENGINE

DIGEST, LENGTH_BYTES = 32, 8  # [bytes]
FORM = 3  # version of the file format
FILTERS = [{"id": lzma.FILTER_LZMA2, "preset": 9 | lzma.PRESET_EXTREME, "lc": 0, "lp": 0, "pb": 0}]
FILE = ENGINE / "kernels.archive"
COMMAND = "python -m pgraph_core.engine --archive"


def key(*parts: str) -> str:
    """The name of an entry in the cache."""
    return " ".join(parts)


class Unusable(Exception):
    """Raised for a file that is not an archive for this program, with the reason."""


def _bits(data: bytes) -> bytes:
    """Return a byte for each bit. Bitcode is a stream of bits, in which equal parts begin at any of
    them, so that it packs to three quarters of what its bytes do."""
    return np.unpackbits(np.frombuffer(data, np.uint8), bitorder="little").tobytes()


def written(index: Mapping[str, Any], sections: Mapping[str, bytes]) -> bytes:
    """Compute the bytes of an archive file."""
    places, at = {}, 0
    for name, data in sections.items():
        places[name] = (at, len(data))
        at += len(data)
    head = zlib.compress(json.dumps({"form": FORM, **index, "sections": places}).encode(), 9)
    packed = lzma.compress(_bits(b"".join(sections.values())), filters=FILTERS)
    rest = len(head).to_bytes(LENGTH_BYTES, "little") + head + packed
    return hashlib.sha256(rest).digest() + rest


class File:
    """An archive file opened for reading. Raises Unusable."""

    def __init__(self, path: Path):
        try:
            content = path.read_bytes()
        except OSError as error:
            raise Unusable(
                "is missing" if isinstance(error, FileNotFoundError) else "cannot be read"
            ) from error
        digest, rest = content[:DIGEST], content[DIGEST:]
        if hashlib.sha256(rest).digest() != digest:
            raise Unusable("is damaged")
        length = int.from_bytes(rest[:LENGTH_BYTES], "little")
        self.index = json.loads(zlib.decompress(rest[LENGTH_BYTES : LENGTH_BYTES + length]))
        if self.index.get("form") != FORM:
            raise Unusable("is of another version of Pgraph")
        self._packed = rest[LENGTH_BYTES + length :]

    def part(self, section: str, begin: int = 0, size: int | None = None) -> bytes:
        """Return a section, or `size` bytes of it."""
        at, length = self.index["sections"][section]
        end = at + length if size is None else at + begin + size
        return self._whole[at + begin : end]

    @cached_property
    def _whole(self) -> bytes:
        bits = np.frombuffer(lzma.decompress(self._packed), np.uint8)
        return np.packbits(bits, bitorder="little").tobytes()


class Archive:
    """The kernels of the package. An unusable file is treated as an empty archive."""

    def __init__(self, path: Path = FILE):
        self._path, self.problem = path, ""
        self._index: dict[str, Any] = {"kernels": {}, "pieces": {}, "files": {}}
        try:
            self._file: Any = File(path)
            if tuple(self._file.index["llvm"]) > llvm.llvm_version_info:
                made, here = (
                    ".".join(map(str, v))
                    for v in (self._file.index["llvm"], llvm.llvm_version_info)
                )
                raise Unusable(f"was made by LLVM {made}, and llvmlite here has LLVM {here}")
            self._index = self._file.index
        except Unusable as error:
            self.problem = f"the archive of kernels {error}"
        for digest, code in self._index["files"].values():
            sources.CODE_OF.setdefault(digest, code)
        self._stale = {
            name
            for name, (digest, code) in self._index["files"].items()
            if _changed(name, digest, code)
        }
        self._groups = [set(group) for group in self._index.get("groups", [])]

    def pieces(self, name: str) -> list[str] | None:
        """Return the pieces of a kernel, or None if it is missing or older than its sources."""
        known = self._index["kernels"].get(name)
        if known is None or self._stale & self._groups[known["files"]]:
            return None
        return known["pieces"]

    def symbol(self, name: str) -> str:
        """Return the symbol prefix of a kernel in its pieces."""
        return self._index["kernels"][name]["symbol"]

    def why(self, name: str) -> str:
        """Return the reason why a kernel is not read from the archive, as a clause."""
        if self.problem:
            return self.problem
        if name not in self._index["kernels"]:
            return "kernels that the archive lacks are needed"
        return "the archive of kernels is older than their sources"

    def stale(self) -> list[str]:
        """Return the names of the kernels that are older than their sources."""
        return [name for name in self._index["kernels"] if self.pieces(name) is None]

    def names(self) -> list[str]:
        """Return the names of all kernels in the archive."""
        return list(self._index["kernels"])

    def all_pieces(self, *sections: str) -> list[str]:
        """Return the names of all pieces in the given sections."""
        return [name for name, place in self._index["pieces"].items() if place[0] in sections]

    def bitcode(self, piece: str) -> bytes:
        """Return the bitcode of a piece."""
        return self._file.part(*self._index["pieces"][piece])


def _changed(name: str, digest: str, code: str) -> bool:
    path = Path(os.path.normpath(ENGINE / name))  # `sources` compares folders by these names
    here = sources.digest_of(path)
    return here != digest and (not here or sources.code_hash(path) != code)


@cache
def current() -> Archive:
    """Return the archive of this package."""
    return Archive()
