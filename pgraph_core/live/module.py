"""The kernels as WebAssembly: the packaged module, and a check that it matches the sources."""

from __future__ import annotations

import hashlib
import json
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from ..engine.compiler.archive import current
from ..engine.compiler.jit import ENGINE
from ..engine.compiler.sources import code_hash, sources

HERE = Path(__file__).parent
WASM, ABOUT = HERE / "kernels.wasm", HERE / "kernels.json"
COMMAND = "python -m pgraph_core.live"

# module below `engine`, and its kernels that the browser, or another kernel by address, calls
KERNELS: dict[str, tuple[str, ...]] = {
    "stepping.run": ("advance_run",),
    "motion": ("acceleration", "projection", "record", "constrain", "constrained_dynamics"),
    "stepping.explicit": ("semi_implicit", "runge_kutta"),
    "stepping.crossings": ("cross",),
    "stepping.moreau": ("moreau_jean",),
    "contact.contacts": ("find", "contact_forces", "record_contacts", "settle_contacts"),
    "contact.approach": ("bound_step",),
    "tree.bodies": ("poses",),
    "packing": ("pack",),
    "gait.walking": ("walking",),
}
NAMES = tuple(name for names in KERNELS.values() for name in names)


def dispatchers() -> list[Any]:
    """Return the kernels before compilation."""
    package = __name__.rsplit(".", 2)[0]
    return [
        getattr(import_module(f"{package}.engine.{module}"), name)
        for module, names in KERNELS.items()
        for name in names
    ]


@cache
def source_hash() -> str:
    """Return a hash of all kernel sources, without comments and docstrings."""
    current()  # knows the hashes of files that it was made from
    files = {path for module in KERNELS for path in sources(ENGINE / _file(module))}
    found = hashlib.sha256()
    for path in sorted(files):
        name = path.relative_to(ENGINE.parent).as_posix()
        found.update(f"{name}\n{code_hash(path)}\n".encode())
    return found.hexdigest()[:16]


def _file(module: str) -> str:
    return module.replace(".", "/") + ".py"


@cache
def about() -> dict[str, Any]:
    """Return the build record of the module, with the source hash and the compiler versions."""
    return json.loads(ABOUT.read_text(encoding="utf-8")) if ABOUT.is_file() else {}


def wasm() -> bytes:
    """The module."""
    return WASM.read_bytes()


def stale() -> str:
    """Return the reason why the module does not match the sources, or ""."""
    made = about().get("sources")
    if made == source_hash() and WASM.is_file():
        return ""
    what = "has not been made" if made is None else "is older than the kernels"
    return f"the WebAssembly module {what}; make it again: {COMMAND}"
