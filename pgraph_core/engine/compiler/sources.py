"""Source files of kernels, and hashes that change if the code in them does."""

from __future__ import annotations

import ast
import hashlib
import io
import os
import re
import tokenize
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from .jit import ENGINE

IMPORT = re.compile(r"^[ \t]*from (\.+)([\w.]*) import (\([^)]*\)|.*)", re.MULTILINE)
HERE = Path(__file__).parent
FORCES, LIMITS = ENGINE.parent / "forces", ENGINE.parent / "tolerances.py"
# how machine code is kept, found and called: no kernel is compiled from it
_OF_KEEPING = ("archive", "building", "calls", "clock", "loading", "optimising", "sources", "tools")
KEEPING = {HERE / f"{name}.py" for name in _OF_KEEPING}
DESCRIBING = ast.ClassDef, ast.FunctionDef, ast.Import, ast.ImportFrom
LOWERING = frozenset(HERE.glob("lowering/*.py"))  # instructions to numba for every kernel


@cache
def imported(module: Path) -> tuple[Path, ...]:
    """Compute the files that a module imports by `from .x import y`, the only form in the engine.

    For a module of forces, only files of the engine and of forces are returned, because the other
    imports of a description are not compiled.
    """
    found: list[Path] = []
    for dots, dotted, names in IMPORT.findall(module.read_text(encoding="utf-8")):
        package = module.parents[len(dots) - 1].joinpath(*filter(None, dotted.split(".")))
        inside = [package / f"{name}.py" for name in re.findall(r"\w+", names)]
        candidates = (package.with_suffix(".py"), package / "__init__.py", *inside)
        found += [path for path in candidates if path.is_file() and path not in KEEPING]
    if module.parent != FORCES:
        return tuple(found)
    return tuple(path for path in found if {ENGINE, FORCES} & {*path.parents} or path == LIMITS)


@cache
def sources(module: Path) -> frozenset[Path]:
    """Compute the files of a module, all its direct and indirect imports, and `lowering`."""
    found, new = {module, *LOWERING}, [module, *LOWERING]
    while new:
        more = set(imported(new.pop())) - found
        found |= more
        new += more
    return frozenset(found)


def hash_of(files: Iterable[Path]) -> str:
    """Return the hash of the code in files and of their paths in the package."""
    parts = sorted((name_of(path), code_hash(path)) for path in files)
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]


def name_of(path: Path) -> str:
    """Return a file's name relative to the engine, such as `../show/raster.py`."""
    return Path(os.path.relpath(path, ENGINE)).as_posix()


@cache
def digest_of(path: Path) -> str:
    """Return the hash of a file's bytes, or "" if it cannot be read."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()[:16]
    except OSError:
        return ""


CODE_OF: dict[str, str] = {}  # {hash of bytes: hash of code} as far as they are known


@cache
def code_hash(path: Path) -> str:
    """Return the hash of a file's code, without comments and docstrings."""
    digest = digest_of(path)
    if digest not in CODE_OF:
        text = code_of(text_of(path))
        CODE_OF[digest] = hashlib.sha256(text.encode()).hexdigest()[:16]
    return CODE_OF[digest]


def text_of(path: Path) -> str:
    """Return the source of a file. A force's source is reduced to the parts used by its kernels.

    Its imports are removed as well: those of kernels are in the files of `imported`.
    """
    text = path.read_text(encoding="utf-8")
    if path.parent != FORCES:
        return text
    lines = text.splitlines(keepends=True)
    for one in ast.parse(text).body:
        # a function that is decorated, or that makes such functions
        functions = [x for x in ast.walk(one) if isinstance(x, ast.FunctionDef)]
        kernel = isinstance(one, ast.FunctionDef) and any(x.decorator_list for x in functions)
        if isinstance(one, DESCRIBING) and not kernel:
            for k in range(one.lineno - 1, one.end_lineno or 0):
                lines[k] = ""
    return "".join(lines)


def code_of(source: str) -> str:
    """Return a source without comments, docstrings and spaces, which do not affect the code."""
    parts: list[str] = []
    begins, said = True, False  # a statement begins, a docstring came before
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type in (tokenize.COMMENT, tokenize.NL):
            continue
        if token.type == tokenize.STRING and begins:
            begins, said = False, True
            continue
        if token.type == tokenize.INDENT:
            parts.append("{")
        elif token.type == tokenize.DEDENT:
            parts.append("}")
        elif token.type == tokenize.NEWLINE:
            parts += [] if said else ["\n"]
            begins = True
        else:
            parts.append(token.string)
            begins = False
        said = False
    return "".join(parts)
