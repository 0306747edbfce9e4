"""How kernels are compiled: options, and a disk cache that notices every edit of a kernel.

Numba's own cache keys a function by its own file and misses edits of helpers in others. Here a
compiled kernel is named by a hash of its module and of every engine module that this imports,
directly or not: an edit compiles only the kernels that it can change. All settings sit on the
dispatchers: code of the user that uses numba never feels them.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import pickle
import re
import uuid
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.serialize import dumps
from numba.core.sigutils import normalize_signature
from numba.core.types import unliteral

# No reference counting: kernels allocate nothing, and its atomic counts take half of their time.
# No contraction of a b + c to one rounding: every processor gives the same bits.
OPTIONS: dict[str, Any] = {"_nrt": False, "fastmath": False, "error_model": "numpy"}
ENGINE = Path(__file__).parent.parent
DIGEST = 32  # [bytes] of a SHA-256
JIT = not numba.config.DISABLE_JIT  # type: ignore[attr-defined]


IMPORT = re.compile(r"^[ \t]*from (\.+)([\w.]*) import (\([^)]*\)|.*)", re.MULTILINE)


@cache
def _imported(module: Path) -> tuple[Path, ...]:
    """The files that a module imports by `from .x import y`, the only form in the engine."""
    found: list[Path] = []
    for dots, dotted, names in IMPORT.findall(module.read_text(encoding="utf-8")):
        package = module.parents[len(dots) - 1].joinpath(*filter(None, dotted.split(".")))
        inside = [package / f"{name}.py" for name in re.findall(r"\w+", names)]
        candidates = (package.with_suffix(".py"), package / "__init__.py", *inside)
        found += [path for path in candidates if path.is_file()]
    return tuple(found)


def sources(module: Path) -> set[Path]:
    """A module's file and those of all that it imports, directly or not."""
    found, new = {module}, [module]
    while new:
        imported = set(_imported(new.pop())) - found
        found |= imported
        new += imported
    return found


@cache
def _hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@cache
def source_hash(module: Path) -> str:
    """Hash of a module, of all that it imports, directly or not, and of where they are."""
    parts = [(os.path.relpath(path, module.parent), _hash(path)) for path in sources(module)]
    text = repr((os.path.relpath(module, ENGINE), *sorted(parts)))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


@cache
def cache_folder() -> Path:
    """$PGRAPH_CACHE if set, else next to the sources, else the user's cache folder."""
    chosen = os.environ.get("PGRAPH_CACHE")
    user = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    for base in (
        *((Path(chosen),) if chosen else ()),
        ENGINE / "__pycache__",
        *((Path(user, "pgraph"),) if os.path.isabs(user) else ()),  # a user may have no home
    ):
        folder = base / f"kernels-numba-{numba.__version__}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            return folder
    return ENGINE / "__pycache__"  # nothing can be written: numba compiles at each start


class _PartLibrary(JITCodeLibrary):
    """A helper as kernels link it: optimised and turned into machine code there, not before."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        return 0  # as numba has it for what is not there

    @property
    def codegen(self) -> Any:
        return _NoEnvironment


class _NoEnvironment:
    """In the place of what would tell machine code where its Python objects are."""

    @staticmethod
    def set_env(name: str, environment: Any) -> None:
        pass


class _PartCompiler(Compiler):
    """Numba's compiler, into a `_PartLibrary`."""

    def define_pipelines(self) -> Any:
        state: Any = self.state
        state.library = _PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        return super().define_pipelines()


class _Locator(_CacheLocator):
    """Where numba finds the compiled form of one kernel."""

    def __init__(self, py_func: Callable[..., Any]):
        self._line = py_func.__code__.co_firstlineno
        self._source = Path(py_func.__code__.co_filename)

    def get_cache_path(self) -> Any:
        return str(cache_folder())

    def ensure_cache_path(self) -> None:
        """`cache_folder` made it, if it can be written."""

    def get_source_stamp(self) -> Any:
        return source_hash(self._source)

    def get_disambiguator(self) -> Any:
        return f"{self._line}-{source_hash(self._source)}"

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> _Locator:
        return cls(py_func)


class _Impl(CompileResultCacheImpl):
    _locator_classes = [_Locator]  # noqa: RUF012 (numba's own protocol)


class _Files:
    """Compiled kernels on disk: one file for each signature and processor.

    Numba's own files are an index and what it names: one that is damaged stops the program, and
    two processes may write what the other's index names. Here a file begins with the digest of
    the rest; what is damaged, or cannot be read or written, is as if it were not there.
    """

    def __init__(self, base: Path):
        self._base = base

    def _path(self, key: object) -> Path:
        name = hashlib.sha256(repr(key).encode()).hexdigest()[:16]
        return self._base.with_name(f"{self._base.name}.{name}.kernel")

    def some(self) -> bool:
        """Whether there is a file for any signature or processor."""
        return any(self._base.parent.glob(f"{self._base.name}.*.kernel"))

    def load(self, key: object) -> Any:
        """What was saved under this key; None without it."""
        with contextlib.suppress(OSError, ImportError, AttributeError):
            content = self._path(key).read_bytes()
            digest, compiled = content[:DIGEST], content[DIGEST:]
            if hashlib.sha256(compiled).digest() == digest:
                return pickle.loads(compiled)
        return None

    def save(self, key: object, data: object) -> None:
        """Keep a compiled kernel, if it can be written."""
        compiled, path = dumps(data), self._path(key)
        part = path.with_name(f"{path.name}.{uuid.uuid4().hex[:16]}")
        try:
            part.write_bytes(hashlib.sha256(compiled).digest() + compiled)
            part.replace(path)
        except OSError:
            with contextlib.suppress(OSError):
                part.unlink()


class _Cache(FunctionCache):
    _impl_class = _Impl

    def __init__(self, py_func: Callable[..., Any]):
        super().__init__(py_func)
        self._cache_file = _Files(Path(self.cache_path, self._impl.filename_base))


def _one_a_type(dispatcher: Any) -> Any:
    """Compile a helper for the types it is called with, not again for every constant."""
    if JIT:
        template = dispatcher.get_call_template
        dispatcher.get_call_template = lambda args, kws: template(
            tuple(unliteral(arg) for arg in args),
            {name: unliteral(arg) for name, arg in kws.items()},
        )
    return dispatcher


PART: dict[str, Any] = {
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "pipeline_class": _PartCompiler,
    **OPTIONS,
}


def part(function: Callable[..., Any]) -> Any:
    """A small helper, always inlined; no wrappers, so that it compiles twice as fast."""
    return _one_a_type(numba.njit(**PART, forceinline=True)(function))


def sweep(function: Callable[..., Any]) -> Any:
    """A helper that loops over rows: called, so that a kernel holds its code only once.

    Said in so many words: to numba, what an inlined helper calls is to be inlined as well.
    """
    return _one_a_type(numba.njit(**PART, forceinline=False)(function))


def inlined(function: Callable[..., Any]) -> Any:
    """A stage of one kernel, merged into it before anything is compiled."""
    return numba.njit(**PART, inline="always")(function)


def kernel(
    signature: Any, *, nogil: bool = False, later: bool = False
) -> Callable[[Callable[..., Any]], Any]:
    """A compiled function that Python calls, cached on disk; `signature` None: when first called.

    `later` keeps it out of the warm-up: it is compiled where something asks for it.

    Short kernels keep the GIL, so that a workspace is never used by two threads at once; whole
    runs release it (`nogil`) and bring their own workspace.
    """

    def compiled(function: Callable[..., Any]) -> Any:
        dispatcher: Any = numba.njit(nogil=nogil, **OPTIONS)(function)
        if JIT:
            dispatcher._cache = _Cache(function)
        if signature is not None:
            register(LATER if later else KERNELS, dispatcher, signature)
        return dispatcher

    return compiled


def register(kernels: dict[str, tuple[Any, str]], dispatcher: Any, signature: Any) -> None:
    """Keep a kernel under its name. Raises RuntimeError where another module has that name."""
    name, home = dispatcher.__name__, dispatcher.__module__
    for known in (KERNELS, LATER):
        if name in known and known[name][0].__module__ != home:
            raise RuntimeError(f"{home} and {known[name][0].__module__} both have a kernel {name}")
    kernels[name] = dispatcher, signature


def compile_kernel(name: str) -> None:
    """Compile a kernel, or load it from the disk cache.

    Numba keys its cache by what `compile` is given: types, as a call gives them, not the text.
    """
    dispatcher, signature = KERNELS.get(name) or LATER[name]
    if JIT and not dispatcher.signatures:
        types, _ = normalize_signature(signature)
        was_open, dispatcher._can_compile = dispatcher._can_compile, True
        dispatcher.compile(tuple(types))
        dispatcher._can_compile = was_open


def in_cache(dispatcher: Any) -> bool:
    """Whether a kernel has been compiled before and is on the disk."""
    return dispatcher._cache._cache_file.some()


def ready(dispatcher: Any) -> Any:
    """A kernel compiled for its signature alone: other types raise TypeError, nothing compiles.

    Python code can then try a call with what it was given, and look closer only if it fails.
    """
    if JIT and not dispatcher.signatures:
        compile_kernel(dispatcher.__name__)
    return closed(dispatcher)


def closed(dispatcher: Any) -> Any:
    """A kernel that a call does not compile: until it is `ready`, every call raises TypeError."""
    if JIT:
        dispatcher._can_compile = False  # `disable_compile` wants a signature
    return dispatcher


KERNELS: dict[str, tuple[Any, str]] = {}  # every kernel and its signature, for the warm-up
LATER: dict[str, tuple[Any, str]] = {}  # those that are not warmed up
