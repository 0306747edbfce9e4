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

from ..errors import FileError, InputError, Problem, needed, plain, shown
from ..markup import Element, parse_markup
from ..model.files import ALLOW
from .conversion import Folders

SUFFIX = ".xacro"
ONE = threading.Lock()  # the package keeps its state in its module


def expanded(
    path: Path, folders: Folders, arguments: Mapping[str, Any]
) -> tuple[Element, list[str]]:
    """Return the root of the expanded URDF file and the warnings from the expansion.

    `arguments` are the values of its `<xacro:arg>`. `$(find package)` is looked for in `folders`,
    then where ROS has it. Raises FileError or InputError, or MissingPackage if the package is not
    installed.
    """
    xacro = needed("xacro", "xacro")
    values = {name: _text(name, value) for name, value in arguments.items()}
    said = io.StringIO()
    try:
        with ONE, contextlib.redirect_stderr(said), _finding(folders):
            document = xacro.process_file(str(path), mappings=values)
    except Exception as error:  # whatever an expression raises
        raise FileError(Problem(path.name, "", _why(error))) from None
    content = document.toprettyxml(indent=" ", encoding="utf-8")
    warnings = [line.strip() for line in plain(said.getvalue()).splitlines() if line.strip()]
    return parse_markup(content, f"{path.name}, expanded"), warnings


def no_arguments(path: Path) -> InputError:
    """Return the error for arguments passed to a file that takes none."""
    text = f"are of xacro files, whose names end in {SUFFIX}, got with {path.name}"
    return InputError(Problem("arguments", "", text))


def _text(name: str, value: Any) -> str:
    """Return a value in xacro's syntax. Raises InputError."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (str, int, float)):
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
def _finding(folders: Folders) -> Iterator[None]:
    """Make `$(find package)` search `folders` first while the context is active."""
    module = needed("xacro.substitution_args", "xacro")
    of_ros = module._eval_find

    def find(package: str) -> str:
        if (found := folders.package_called(package)) is not None:
            return str(found)
        try:
            return of_ros(package)
        except Exception:  # without ROS, or of a package that it does not have
            text = f"cannot find the package {shown(package)} in the folders of the file; {ALLOW}"
            raise module.SubstitutionException(text) from None

    module._eval_find = module._eval_dict["find"] = find
    try:
        yield
    finally:
        module._eval_find = module._eval_dict["find"] = of_ros
