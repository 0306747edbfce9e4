"""The library of the kernels for each platform: where it is, and whether it matches the sources.

A library does not depend on a model. It consists of the live kernels, made from the archive, and of
the C files in the folder `c`.
"""

from __future__ import annotations

import hashlib
import json
import lzma
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from ..engine.compiler.archive import current
from ..engine.compiler.jit import KERNELS, LATER
from ..engine.compiler.loading import name_of
from ..errors import InputError, Problem, choices
from ..live import module

HERE = Path(__file__).parent
SOURCES, LIBRARIES = HERE / "c", HERE / "libraries"
ABOUT = LIBRARIES / "about.json"
COMMAND = "python -m pgraph_core.native"

# kernels that others call by address, in the order of LINKED in c/image.c
LINKED = (
    "acceleration", "projection", "record", "constrain", "semi_implicit", "runge_kutta", "cross",
    "moreau_jean", "find", "contact_forces", "record_contacts", "settle_contacts", "bound_step",
    "walking",
)  # fmt: skip
# kernels that C calls, with arguments in words
CALLED = (
    "advance_run", "projection", "constrained_dynamics", "bound_step", "pack", "followed",
    "motion_and_forces", "as_quaternions", "read_sensors", "load_wrenches",
)  # fmt: skip


class Platform(NamedTuple):
    """A platform with a library."""

    triple: str  # LLVM's name of the platform
    zig: str  # target of the linker
    file: str  # name of the library
    fmi2: str  # its folder in FMI 2.0
    tested: bool = True  # whether tests run it


PLATFORMS = {  # by their names in FMI 3.0
    "x86_64-linux": Platform(
        "x86_64-unknown-linux-gnu", "x86_64-linux-gnu.2.17", "pgraph.so", "linux64"
    ),
    "aarch64-linux": Platform(
        "aarch64-unknown-linux-gnu", "aarch64-linux-gnu.2.17", "pgraph.so", "aarch64-linux", False
    ),
    "x86_64-windows": Platform(
        "x86_64-pc-windows-gnu", "x86_64-windows-gnu", "pgraph.dll", "win64", False
    ),
    "x86_64-darwin": Platform(
        "x86_64-apple-macosx11.0", "x86_64-macos.11.0", "pgraph.dylib", "darwin64", False
    ),
    "aarch64-darwin": Platform(
        "arm64-apple-macosx11.0", "aarch64-macos.11.0", "pgraph.dylib", "aarch64-darwin", False
    ),
}


def kernels() -> dict[str, Any]:
    """Return the kernels of a library by name."""
    from ..engine import drives, motion, packing  # noqa: F401
    from ..engine.tree import bodies, sensors  # noqa: F401

    module.dispatchers()
    known = {**LATER, **KERNELS}
    return {name: known[name] for name in dict.fromkeys((*LINKED, *CALLED))}


@cache
def kernels_digest() -> str:
    """Return eight letters that identify the kernels of a library, from those of the archive."""
    found, archive = hashlib.sha256(), current()
    for name, one in kernels().items():
        found.update(f"{name} {' '.join(archive.pieces(name_of(one, 0)) or ())}\n".encode())
    return found.hexdigest()[:8]


@cache
def digest() -> str:
    """Return the hash of all that libraries are made from."""
    found = hashlib.sha256(kernels_digest().encode())
    for path in sorted(SOURCES.glob("*.[ch]")):
        found.update(path.name.encode() + path.read_bytes())
    return found.hexdigest()[:16]


@cache
def about() -> dict[str, Any]:
    """Return the build record of the libraries."""
    return json.loads(ABOUT.read_text(encoding="utf-8")) if ABOUT.is_file() else {}


def stale(platform: str) -> str:
    """Return the reason why a library does not match the sources, or ""."""
    made = about().get("sources", {}).get(platform)
    if made == digest() and packed_file(platform).is_file():
        return ""
    what = "has not been made" if made is None else "is older than the kernels or the C files"
    return f"the library for {platform} {what}; make it again: {COMMAND} {platform}"


def packed_file(platform: str) -> Path:
    """Return the path of the compressed libraries for the processors of a platform."""
    return LIBRARIES / f"{platform.partition('-')[0]}.xz"


def packed(libraries: Mapping[str, bytes]) -> bytes:
    """Return libraries for one kind of processor as a file. Much of their code is the same."""
    head = json.dumps({name: len(code) for name, code in libraries.items()}).encode()
    content = head + b"\n" + b"".join(libraries.values())
    return lzma.compress(content, preset=9 | lzma.PRESET_EXTREME)


@cache
def unpacked(path: Path) -> dict[str, bytes]:
    """Return the libraries in a file, by platform."""
    if not path.is_file():
        return {}
    head, _, content = lzma.decompress(path.read_bytes()).partition(b"\n")
    found, at = dict[str, bytes](), 0
    for name, size in json.loads(head).items():
        found[name] = content[at : at + size]
        at += size
    return found


def library(platform: str) -> bytes:
    """Return the library of a platform. Raises InputError if the package has none."""
    if platform not in PLATFORMS:
        text = f"must be one of {choices(PLATFORMS)}, got {platform!r}"
        raise InputError(Problem("export", "platforms", text))
    if reason := stale(platform):
        raise InputError(Problem("export", "platforms", reason))
    return unpacked(packed_file(platform))[platform]


def here() -> str:
    """Return the platform of this process, or "" if it has no library."""
    import platform
    import sys

    arch = {"AMD64": "x86_64", "arm64": "aarch64"}.get(platform.machine(), platform.machine())
    system = {"win32": "windows"}.get(sys.platform, sys.platform)
    return name if (name := f"{arch}-{system}") in PLATFORMS else ""
