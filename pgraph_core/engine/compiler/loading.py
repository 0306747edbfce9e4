"""Sources of kernel machine code, and loading it with llvmlite alone.

The archive contains kernels in pieces. A piece contains the functions that are called by the same
kernels. Its machine code is read from the package (in wheels) or the cache of the user, or else
generated from the bitcode in the archive. Kernels that are missing in the archive are compiled by
numba.
"""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import os
import sys
import threading
import time
import uuid
from functools import cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import llvmlite.binding as llvm

from . import archive, calls, sources
from .jit import Kernel
from .lane import LANE_WIDTH

DAY = 86400  # resolution of the last use of an entry [s]
LARGEST_CACHE = 1 << 27  # size of the cache [bytes], enough for all kernels of ten versions
DIGEST = 32  # [bytes] length of a SHA-256
TOLD = 1  # [s] a longer wait says what it is for
_spent = 0.0  # [s] generating machine code in this process


class Code(NamedTuple):
    """A loaded kernel."""

    address: int  # for `caller`
    call: Any  # for Python


# -- the cache -------------------------------------------------------------------------------------


@cache
def cache_folder() -> Path | None:
    """Return $PGRAPH_CACHE, else the user's cache folder, or None if neither is writable."""
    chosen = os.environ.get("PGRAPH_CACHE")
    bases = [Path(chosen)] if chosen else []
    user = os.environ.get("XDG_CACHE_HOME") or _platform_cache()
    if os.path.isabs(user):  # a user may have no home
        bases.append(Path(user, "pgraph"))
    for base in bases:
        folder = base / "kernels"
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            return folder
    return None


def _platform_cache() -> str:
    if sys.platform == "win32":
        return os.environ.get("LOCALAPPDATA", "")
    return os.path.expanduser("~/Library/Caches" if sys.platform == "darwin" else "~/.cache")


def _file(key: str) -> Path | None:
    folder = cache_folder()
    name = hashlib.sha256(f"{key} {processor()}".encode()).hexdigest()[:32]
    return folder / f"{name}.o" if folder is not None else None


def kept(key: str) -> bytes | None:
    """Return cached machine code for this processor, or None if it is missing or damaged."""
    path = _file(key)
    with contextlib.suppress(OSError):
        content = path.read_bytes() if path is not None else b""
        digest, code = content[:DIGEST], content[DIGEST:]
        if path and digest and hashlib.sha256(code).digest() == digest:
            if time.time() - path.stat().st_mtime > DAY:
                os.utime(path)  # marks the entry as used
            return code
    return None


def keep(key: str, code: bytes) -> None:
    """Cache machine code for this processor if the cache is writable."""
    path = _file(key)
    if path is None:
        return
    part = path.with_name(f"{path.name}.{uuid.uuid4().hex[:16]}")
    try:
        part.write_bytes(hashlib.sha256(code).digest() + code)
        part.replace(path)
        _tidy(path.parent)
    except OSError:
        with contextlib.suppress(OSError):
            part.unlink()


@cache  # once per process, which adds little
def _tidy(folder: Path) -> None:
    """Remove the least recently used entries until the cache size is at most LARGEST_CACHE."""
    found = [(one.stat(), one.path) for one in os.scandir(folder) if one.is_file()]
    found.sort(key=lambda entry: entry[0].st_mtime, reverse=True)
    total = 0
    for known, path in found:
        total += known.st_size
        if total > LARGEST_CACHE:
            with contextlib.suppress(OSError):  # another process was faster
                os.unlink(path)


# -- the processor ---------------------------------------------------------------------------------


@cache
def processor() -> str:
    """Return the processor, its features and the code generator, which identify machine code."""
    return f"{llvm.get_process_triple()} {_name()} {_features()} llvmlite {version('llvmlite')}"


def _name() -> str:
    return os.environ.get("PGRAPH_PROCESSOR") or llvm.get_host_cpu_name()


def _features() -> str:
    return "" if _name() == "generic" else llvm.get_host_cpu_features().flatten()


@cache
def machine() -> Any:
    """Return the code generator for this processor."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return machine_for(llvm.get_process_triple(), _name(), _features())


def machine_for(triple: str, cpu: str, features: str) -> Any:
    """Return a code generator at its highest level, without contraction of a b + c."""
    static = "static" if triple.startswith("x86") else "default"
    return llvm.Target.from_triple(triple).create_target_machine(
        cpu=cpu, features=features, opt=3, reloc=static, codemodel="jitdefault", jit=True
    )


# -- machine code that comes with the package ------------------------------------------------------


class Level(NamedTuple):
    """A processor level with machine code in wheels."""

    arch: str  # the first word of its triple
    cpu: str  # its name in LLVM
    features: str  # processor features beyond the architecture's baseline
    lanes: int  # doubles in a lane

    def runs_here(self) -> bool:
        """Check whether the code can run on this processor."""
        arch, *_, system = llvm.get_process_triple().split("-", 2)
        here = llvm.get_host_cpu_features()
        return (
            arch == self.arch
            and system.startswith(("linux", "unknown-linux"))
            and self.lanes == LANE_WIDTH
            and all(here.get(one) for one in self.features.split())
        )


V3 = "avx2 bmi bmi2 f16c fma lzcnt movbe"
V4 = f"{V3} avx512f avx512bw avx512cd avx512dq avx512vl"
LEVELS = {  # {end of the name of its file: what its code needs}
    "x86-64-v4": Level("x86_64", "x86-64-v4", V4, 8),
    "x86-64-v3": Level("x86_64", "x86-64-v3", V3, 4),
    "aarch64": Level("aarch64", "generic", "", 4),
}


@cache
def _brought() -> archive.File | None:
    """Return the machine code shipped with the package for this processor, or None."""
    if os.environ.get("PGRAPH_PROCESSOR"):
        return None
    for name, level in LEVELS.items():
        path = archive.FILE.with_suffix(f".{name}")
        if level.runs_here() and path.exists():
            try:
                return archive.File(path)
            except archive.Unusable as error:
                _say(f"the machine code of the kernels {error}; it is generated from the archive")
    return None


def brought(piece: str) -> bytes | None:
    """Return the machine code of a piece shipped with the package, or None."""
    found = _brought()
    return found.part(piece) if found and piece in found.index["sections"] else None


# -- machine code ----------------------------------------------------------------------------------


class _Engine:
    """All machine code loaded in this process."""

    def __init__(self) -> None:
        empty = llvm.parse_assembly("")
        empty.triple = llvm.get_process_triple()
        self._engine = llvm.create_mcjit_compiler(empty, machine())
        self._loaded: set[str] = set()
        for name in (*calls.PYTHON, *calls.DATA):
            llvm.add_symbol(
                name, ctypes.cast(getattr(ctypes.pythonapi, name), ctypes.c_void_p).value
            )
        enter = archive.key("enter", sources.hash_of([Path(calls.__file__)]))
        self.add(enter, kept(enter) or self._made_enter(enter))
        self.enter = self.address(calls.ENTER)

    @staticmethod
    def _made_enter(key: str) -> bytes:
        module = llvm.parse_assembly(calls.module())
        found = object_of(module)
        keep(key, found)
        return found

    def has(self, key: str) -> bool:
        """Check whether the machine code is loaded."""
        return key in self._loaded

    def add(self, key: str, code: bytes) -> None:
        """Load machine code."""
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        self._loaded.add(key)

    def address(self, name: str) -> int:
        """Return the address of a function."""
        self._engine.finalize_object()
        return self._engine.get_function_address(name)


@cache
def engine() -> _Engine:
    """Return the engine of this process."""
    return _Engine()


def object_of(module: Any, target: Any = None) -> bytes:
    """Return the machine code of a module as an object file."""
    target = target or machine()
    module.triple, module.data_layout = target.triple, str(target.target_data)
    return target.emit_object(module)


def code_of(kernel: Kernel, variant: int) -> Code:
    """Load and return a kernel's machine code."""
    name = name_of(kernel, variant)
    found = archive.current()
    pieces = found.pieces(name)
    if pieces is None:
        symbol = name.replace(".", "_").replace("@", "_").replace(":", "_")
        key = archive.key(name, sources.hash_of(sources.sources(file_of(kernel))))
        if not engine().has(key):
            engine().add(key, kept(key) or _compiled(kernel, variant, symbol, key))
    else:
        symbol = found.symbol(name)
        for piece in pieces:
            if not engine().has(piece):
                engine().add(piece, brought(piece) or kept(piece) or _generated(piece))
    signature = kernel.signatures[variant]
    enter, words = engine().enter, engine().address(f"w_{symbol}")
    call = calls.function(kernel.__name__, signature, kernel.nogil, enter, words)
    return Code(engine().address(f"k_{symbol}"), call)


def name_of(kernel: Kernel, variant: int) -> str:
    """Return a kernel's name in caches and archives."""
    module = kernel.__module__.split("pgraph_core.")[-1]
    width = f"@{LANE_WIDTH}" if kernel.lanes else ""
    return f"{module}.{kernel.__name__}:{variant}{width}"


def file_of(kernel: Kernel) -> Path:
    """Return the file that defines a kernel."""
    return Path(kernel.py_func.__code__.co_filename)


def _generated(piece: str) -> bytes:
    """Generate machine code from the archive's bitcode and cache it."""
    global _spent
    began = time.perf_counter()
    found = object_of(llvm.parse_bitcode(archive.current().bitcode(piece)))
    keep(piece, found)
    _spent += time.perf_counter() - began
    if _spent > TOLD and sys.stderr.isatty():
        _say("kernels become machine code of this processor, once, in a few seconds")
    return found


def _compiled(kernel: Kernel, variant: int, symbol: str, key: str) -> bytes:
    """Compile machine code with numba and cache it."""
    why = archive.current().why(name_of(kernel, variant))
    if find_spec("numba") is None:
        text = (
            f"numba is not installed, and {why}; install Pgraph again, or type: pip install numba"
        )
        raise ModuleNotFoundError(text, name="numba")
    from .optimising import module_of

    _say(f"{why}; kernels are compiled, which takes a while")
    found = object_of(module_of(kernel, variant, symbol, machine()))
    keep(key, found)
    return found


_SAID: set[str] = set()
_SAYING = threading.Lock()


def _say(why: str) -> None:
    """Print a message once for all kernels concerned."""
    with _SAYING:
        if why in _SAID:
            return
        _SAID.add(why)
    print(f"pgraph: {why}.", file=sys.stderr)
