"""The xacro reader. The xacro package expands the macros, and the result is read as URDF.

Xacro macros can execute Python code, and the sandbox of the package is not secure. Therefore, a
file is only expanded if it is opened from Python or the terminal, and never in the browser
interface.
"""

from __future__ import annotations

import contextlib
import io
import threading
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileError, InputError, Problem, choices, nearest, needed, plain, shown
from ..fields import is_number
from ..markup import Element, parse_markup, read_markup
from ..model.files import ALLOW
from .conversion import MANIFEST, Folders

SUFFIX = ".xacro"
ONE = threading.Lock()  # the package keeps its state in its module


def expanded(
    path: Path, folders: Folders, arguments: Mapping[str, Any]
) -> tuple[Element, list[str]]:
    """Return the root of the expanded URDF file and the warnings from the expansion.

    `arguments` are the values of its `<xacro:arg>`. `$(find package)` is looked for in `folders`,
    then where ROS has it. Raises FileError, InputError for an argument that the file does not have,
    or MissingPackage if the package is not installed.
    """
    xacro = needed("xacro", "xacro")
    values = _Arguments({name: _text(name, value) for name, value in arguments.items()})
    said, missing = io.StringIO(), list[str]()
    try:
        with ONE, contextlib.redirect_stderr(said), _finding(folders, missing):
            document = xacro.process_file(str(path), mappings=values)
    except Exception as error:  # whatever an expression raises
        why = missing[-1] if missing else _why(error)
        raise FileError(Problem(path.name, "", why)) from None
    for name in arguments:
        if name not in values.asked:
            text = f"is not an <xacro:arg> of {path.name}; {nearest(name, sorted(values.asked))}"
            raise InputError(Problem("arguments", name, text))
    content = document.toprettyxml(indent=" ", encoding="utf-8")
    warnings = [line.strip() for line in plain(said.getvalue()).splitlines() if line.strip()]
    return parse_markup(content, f"{path.name}, expanded"), warnings


class _Arguments(dict[str, str]):
    """Values by name, and the names for which the file asks: it declares or reads them."""

    def __init__(self, values: Mapping[str, str]):
        super().__init__(values)
        self.asked = set[str]()

    def __contains__(self, name: object) -> bool:
        self.asked.add(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        self.asked.add(name)
        return super().__getitem__(name)


def only_macros(path: Path) -> str:
    """Return a sentence about a file that only defines macros, or "" for other files."""
    macros = [e.get("name") for e in read_markup(path).inside() if e.tag == "xacro:macro"]
    if not macros:
        return ""
    named = choices(map(shown, macros), 4)
    return f"only defines macros, {named}; load the file that includes it and uses them"


def no_arguments(path: Path) -> InputError:
    """Return the error for arguments passed to a file that takes none."""
    text = f"are of xacro files, whose names end in {SUFFIX}, got with {path.name}"
    return InputError(Problem("arguments", "", text))


def _text(name: str, value: Any) -> str:
    """Return a value in xacro's syntax. Raises InputError."""
    if isinstance(value, (bool, np.bool_)):
        return str(value).lower()
    if isinstance(value, str) or is_number(value):
        return str(value)
    text = f"must be a text or a number, got {shown(value)}"
    raise InputError(Problem("arguments", name, text))


def _why(error: Exception) -> str:
    """Return an error message for input that the package rejects."""
    text = " ".join(str(error).split()) or type(error).__name__
    if "ndefined substitution argument" in text:
        return f"{text}; {GIVE}"
    return f"xacro refuses it: {text}"


GIVE = "give its value: arguments={NAME: VALUE} in Python, --argument NAME=VALUE in the terminal"


@contextlib.contextmanager
def _finding(folders: Folders, missing: list[str]) -> Iterator[None]:
    """Make `$(find package)` search `folders` first while the context is active.

    Sentences about packages that are not found are added to `missing`.
    """
    module = needed("xacro.substitution_args", "xacro")
    of_ros = module._eval_find

    def find(package: str) -> str:
        if (found := folders.package_called(package)) is not None:
            return str(found)
        try:
            return str(folders.packages.setdefault(package, Path(of_ros(package))))
        except Exception:  # without ROS, or of a package that it does not have
            missing.append(
                f"cannot find the package {shown(package)}: no {MANIFEST} and no folder has this "
                f"name in {choices(map(str, folders.allowed))}, nor above the file; {ALLOW}"
            )
            raise module.SubstitutionException(missing[-1]) from None

    module._eval_find = module._eval_dict["find"] = find
    try:
        yield
    finally:
        module._eval_find = module._eval_dict["find"] = of_ros
