"""Common parts of public values: version-tagged pickles and equality."""

from __future__ import annotations

import hmac
import math
import os
import secrets
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import fields
from functools import cache
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any, ClassVar, NoReturn, cast

import numpy as np
from numpy.typing import NDArray

from .errors import (
    InputError,
    NameLookupError,
    Problem,
    Suggests,
    choices,
    nearest_first,
    shown,
)


@cache
def installed() -> str:
    """Return the installed version of Pgraph."""
    return version("pgraph-dynamics")


class Portable(Suggests):
    """A mixin that makes `pickle` and `copy` keep the state returned by `__getstate__`.

    The pickle names its version before anything else. Another version raises InputError when it
    reads that, before it meets classes or fields that it does not have.
    """

    def __reduce_ex__(self, protocol: Any) -> tuple[Any, ...]:
        kind = type(self)
        return _empty, (installed(), kind.__module__, kind.__qualname__), self.__getstate__()


# -- snapshots: bytes of one object, read by another of the same kind and options -----------------
# Kernels trust the numbers of a snapshot, so only one that this user saved is taken.

SUM = 32  # bytes: of the seal that follows the name of the kind
KEY = "snapshots.key"  # file of the user's cache folder


@cache
def _key_in(folder: Path | None) -> bytes:
    """Return the user's secret key, made when it is first needed.

    If no folder is writable, the key of the current process is used.
    """
    made = secrets.token_bytes(SUM)
    if folder is None:
        return made
    path, draft = folder / KEY, folder / f"{KEY}.{secrets.token_hex(8)}"
    try:
        if not path.exists():
            with open(os.open(draft, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600), "wb") as file:
                file.write(made)
            with suppress(FileExistsError):
                os.link(draft, path)  # the first of several processes creates the key
            draft.unlink()
        return path.read_bytes() or made
    except OSError:
        return made


def stated(words: Iterable[str], body: bytes) -> bytes:
    """Return the content of a snapshot: the version, the words and the state bytes."""
    head = "\n".join((installed(), *words)).encode()
    return b"".join((len(head).to_bytes(4, "little"), head, body))


def sealed(kind: str, content: bytes, folder: Path | None) -> bytes:
    """Return a snapshot of a `kind`, sealed with the user's key from `folder`."""
    magic = _magic(kind)
    return magic + hmac.digest(_key_in(folder), magic + content, "sha256") + content


def unsealed(kind: str, snapshot: Any, folder: Path | None) -> memoryview:
    """Return the content of a sealed snapshot. Raises InputError for other bytes."""
    magic = _magic(kind)
    data = bytes(snapshot) if isinstance(snapshot, (bytes, bytearray)) else b""
    seal, content = data[len(magic) :][:SUM], memoryview(data)[len(magic) + SUM :]
    if not data.startswith(magic):
        text = f"must be bytes of {kind}.save, got {shown(snapshot)}"
    elif not hmac.compare_digest(
        seal, hmac.digest(_key_in(folder), magic + bytes(content), "sha256")
    ):
        text = "is damaged, or was saved by another user or on another machine"
        if folder is not None:
            text += f"; to accept the snapshots of that user, copy their file {KEY} to {folder}"
    else:
        return content
    raise InputError(Problem(f"{kind}.restore", "snapshot", text))


def opened(
    kind: str, content: bytes | memoryview, key: str, arrays: Sequence[Any]
) -> tuple[list[str], memoryview]:
    """Return (words after the key, state of the arrays) from the content of a snapshot.

    Raises InputError for the content of another version or key.
    """
    end = 4 + int.from_bytes(content[:4], "little")
    written, *words = bytes(content[4:end]).decode(errors="replace").split("\n")
    size = sum(array.nbytes for array in arrays)
    if written != installed():
        text = f"was saved by Pgraph {written}, and Pgraph {installed()} is running"
    elif words[:1] != [key] or len(content) - end != size:
        text = "is of another mechanism, method, step or scenario, or of other options"
    else:
        return words[1:], memoryview(content)[end:]
    raise InputError(Problem(f"{kind}.restore", "snapshot", text))


def put_back(state: memoryview, arrays: Iterable[Any]) -> None:
    """Copy consecutive bytes back into the given arrays."""
    place = 0
    for array in arrays:
        view = array.reshape(-1).view(np.uint8)
        view[:] = np.frombuffer(state, np.uint8, array.nbytes, place)
        place += array.nbytes


class Snapshots(Portable, ABC):
    """A mixin for objects that save and restore all that their next steps depend on."""

    GIVEN: ClassVar[tuple[str, ...]]  # attributes that it is made from

    def save(self) -> bytes:
        """Save all that the next steps depend on, so that `restore` continues bit for bit."""
        return sealed(type(self).__name__, self._content(), self._folder())

    def _content(self) -> bytes:
        return stated(self._words(), b"".join(array.tobytes() for array in self._memory()))

    def restore(self, snapshot: bytes) -> None:
        """Restore a snapshot of the same mechanism, method, step size and options.

        Only snapshots of the same user are accepted, because kernels do not validate their
        contents.

        Parameters
        ----------
        snapshot : bytes
            Result of `save`.

        Raises
        ------
        InputError
            If the data was not created by `save` of an equivalent object. Nothing is changed.
        """
        self._restore(unsealed(type(self).__name__, snapshot, self._folder()))

    def _restore(self, content: bytes | memoryview) -> None:
        memory = self._memory()
        words, state = opened(type(self).__name__, content, self._words()[0], memory)
        self._resume(words, state, memory)

    @abstractmethod
    def _folder(self) -> Path | None:
        """Return the folder of the user's key."""

    @abstractmethod
    def _words(self) -> tuple[str, ...]:
        """Return a hash of the constructor arguments, and snapshot data other than numbers."""

    @abstractmethod
    def _memory(self) -> list[Any]:
        """Return the arrays that steps read before writing to them."""

    @abstractmethod
    def _resume(self, words: list[str], state: memoryview, memory: list[Any]) -> None:
        """Continue from the words and the numbers of a snapshot."""

    @abstractmethod
    def _renew(self) -> None:
        """Construct the remaining attributes from the constructor arguments."""

    def __getstate__(self) -> dict[str, Any]:
        return {name: self.__dict__[name] for name in self.GIVEN} | {"snapshot": self._content()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        snapshot = state.pop("snapshot")
        vars(self).update(state)
        self._renew()
        self._restore(snapshot)


def _magic(kind: str) -> bytes:
    return f"pgraph {kind} ".encode()


def _empty(written: str, module: str, name: str) -> Any:
    """Create an instance without state, for `pickle`. Raises InputError for other versions."""
    if written != installed():
        text = (
            f"was written by Pgraph {written}, and Pgraph {installed()} is running; use "
            f"{written} to read it, or save the model to a JSON file there and load that here"
        )
        raise InputError(Problem(f"pickle of a {name}", "", text))
    kind: Any = import_module(module)
    for part in name.split("."):
        kind = getattr(kind, part)
    return kind.__new__(kind)


class Unportable:
    """A mixin for objects that hold memory addresses in this process and cannot be pickled."""

    def __reduce_ex__(self, protocol: Any) -> Any:
        text = "holds memory addresses and cannot be pickled or copied; send its Mechanism instead"
        raise TypeError(f"a {type(self).__name__} {text}")


class ReadOnly(dict[str, Any]):
    """A read-only dictionary. Changing it raises InputError, which suggests an alternative."""

    def __init__(self, entries: Mapping[str, Any], where: str, instead: str):
        super().__init__(entries)
        self._told = where, instead

    def _refused(self, *args: Any, **named: Any) -> NoReturn:
        where, instead = self._told
        field = repr(args[0]) if args and isinstance(args[0], str) else ""
        raise InputError(Problem(where, field, f"is not changed in place; {instead}"))

    __setitem__ = __delitem__ = __ior__ = _refused  # pyright: ignore[reportAssignmentType]
    clear = pop = popitem = setdefault = update = _refused  # pyright: ignore[reportAssignmentType]

    def __missing__(self, key: Any) -> NoReturn:
        """Raise NameLookupError, which lists the names."""
        text = f"has no entry {shown(key)}; choose one of {choices(nearest_first(str(key), self))}"
        raise NameLookupError(Problem(self._told[0], "", text))

    def __reduce__(self) -> Any:
        return ReadOnly, (dict(self), *self._told)


def keep_unchanged(arrays: Iterable[Any]) -> None:
    """Make arrays read-only."""
    for array in arrays:
        if isinstance(array, np.ndarray):
            array.flags.writeable = False


def jsonable(value: Any) -> Any:
    """Convert nested values to plain ones for JSON, with None for numbers that are not finite."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): jsonable(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [jsonable(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if isinstance(value, (str, int, float, bool, type(None))) else str(value)


# -- equality of values that hold arrays ---------------------------------------------------------


def same(a: Any, b: Any) -> bool:
    """Check whether two values or containers are equal, with nan = nan and list = tuple."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        a, b = np.asarray(a), np.asarray(b)
        floats = all(x.dtype.kind in "fc" for x in (a, b))  # others have no nan
        return bool(np.array_equal(a, b, equal_nan=floats))
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, (list, tuple)) and isinstance(b, (list, tuple)):
        return len(a) == len(b) and all(map(same, a, b))
    return bool(a == b or (a != a and b != b))


class EqualByFields:
    """A mixin for dataclasses with arrays. Fields are compared unless they have `compare=False`.

    Arrays can change, so there is no hash.
    """

    def __eq__(self, other: object) -> bool:
        """Compare the fields, treating nan as equal to nan."""
        if type(self) is not type(other):
            return NotImplemented
        names = [field.name for field in fields(cast("Any", self)) if field.compare]
        return all(same(getattr(self, name), getattr(other, name)) for name in names)

    __hash__ = None  # pyright: ignore[reportAssignmentType]


MOST_DIMENSIONS = 8  # lists within lists: no argument has so many dimensions


def array_of(given: Any) -> NDArray[Any]:
    """Return a value as an array, without copying an existing array. Raises TypeError, ValueError.

    NumPy would follow recursive lists through 64 levels, which takes 2^64 steps if a list contains
    itself twice.
    """
    inner, depth = given, 0
    while isinstance(inner, (list, tuple)) and inner:
        inner, depth = inner[0], depth + 1
        if depth > MOST_DIMENSIONS:
            raise ValueError("the lists are nested too deeply")
    found = np.asarray(given)
    if found.dtype.kind in "mM":  # NumPy would count days or nanoseconds
        raise TypeError("dates and durations are not numbers")
    return found
