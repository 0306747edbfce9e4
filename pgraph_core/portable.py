"""Shared parts of public values: pickles tagged with their version, and equality."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import fields
from functools import cache
from hashlib import sha256
from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, NoReturn, cast

import numpy as np

from . import words
from .errors import InputError, Problem, shown


@cache
def installed() -> str:
    """The version of Pgraph that runs."""
    return version("pgraph-dynamics")


class Portable:
    """A mixin: `pickle` and `copy` keep the state that `__getstate__` gives.

    The pickle names its version before anything else. Another version raises InputError when it
    reads that, before it meets classes or fields that it does not have.
    """

    def __reduce_ex__(self, protocol: Any) -> tuple[Any, ...]:
        kind = type(self)
        return _empty, (installed(), kind.__module__, kind.__qualname__), self.__getstate__()

    def __dir__(self) -> Iterable[str]:
        """Without names that only say what to write instead."""
        kinds = type(self).__mro__
        hints = {n for kind in kinds for n, x in vars(kind).items() if isinstance(x, Elsewhere)}
        return sorted(set(super().__dir__()) - hints)


# -- snapshots: bytes of one object, read by another of the same kind and options -----------------

SUM = 16  # bytes: of the digest that follows the name of the kind


def sealed(kind: str, words: Iterable[str], body: bytes) -> bytes:
    """A snapshot of a `kind`: its digest, the version that runs, words, and the state in bytes."""
    head = "\n".join((installed(), *words)).encode()
    rest = b"".join((len(head).to_bytes(4, "little"), head, body))
    return b"".join((_magic(kind), sha256(rest).digest()[:SUM], rest))


def unsealed(
    kind: str, snapshot: Any, key: str, arrays: Sequence[Any]
) -> tuple[list[str], memoryview]:
    """(words after the key, the state of these arrays) of what `sealed` gave.

    Raises InputError for bytes that it did not give, or gave for another key.
    """
    magic, start = _magic(kind), len(_magic(kind)) + SUM
    data = bytes(snapshot) if isinstance(snapshot, (bytes, bytearray)) else b""
    end = start + 4 + int.from_bytes(data[start : start + 4], "little")
    text, words = "", list[str]()
    if not data.startswith(magic):
        text = f"must be bytes of {kind}.save; given {shown(snapshot)}"
    elif data[len(magic) : start] != sha256(memoryview(data)[start:]).digest()[:SUM]:
        text = "is damaged: its bytes are not those that were saved"
    else:
        written, *words = data[start + 4 : end].decode(errors="replace").split("\n")
        size = sum(array.nbytes for array in arrays)
        if written != installed():
            text = f"was saved by Pgraph {written}, and Pgraph {installed()} is running"
        elif words[:1] != [key] or len(data) - end != size:
            text = "is of another mechanism, method, step or scenario, or of other options"
    if text:
        raise InputError(Problem(f"{kind}.restore", "snapshot", text))
    return words[1:], memoryview(data)[end:]


def put_back(state: memoryview, arrays: Iterable[Any]) -> None:
    """The bytes of arrays, one after the other, into these arrays."""
    place = 0
    for array in arrays:
        view = array.reshape(-1).view(np.uint8)
        view[:] = np.frombuffer(state, np.uint8, array.nbytes, place)
        place += array.nbytes


def _magic(kind: str) -> bytes:
    return f"pgraph {kind} ".encode()


class Hinting(Portable):
    """A portable value that says where to find what other programs have as a method.

    Not for what inner loops ask: a class with `__getattr__` gives every attribute more slowly.
    """

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Ours, or where to find what others have as an attribute. Raises AttributeError."""
            if ours := SAME.get(type(self).__name__, {}).get(name):
                return getattr(self, ours)
            inherited = getattr(super(), "__getattr__", None)
            if inherited is not None:
                with suppress(AttributeError):
                    return inherited(name)
            raise NoAttribute(self, name)


class NoAttribute(AttributeError):
    """A missing attribute, whose text is made only when read, because `hasattr` needs none."""

    def __init__(self, value: Any, name: str):
        super().__init__(name=name, obj=value)

    def __str__(self) -> str:
        kind, name = type(self.obj).__name__, str(self.name)
        hint = _elsewhere(kind, name) or _of_this(self.obj, name)
        text = f"a {kind} has no '{name}'; {hint}" if hint else ""
        return text or f"'{kind}' object has no attribute '{name}'"

    def __reduce__(self) -> Any:
        return AttributeError, (str(self),)


class Elsewhere:
    """An attribute by another program's name, of a class without `__getattr__`.

    It is ours where that is the same; else it says what to write.
    """

    def __init__(self, name: str):
        self._name = name

    def __get__(self, value: object, kind: type) -> Any:
        """Raises AttributeError, which says what to write."""
        name = self._name
        if ours := SAME.get(kind.__name__, {}).get(name):
            return getattr(kind if value is None else value, ours)
        text = f"a {kind.__name__} has no '{name}'; {_elsewhere(kind.__name__, name)}"
        raise AttributeError(text, name=name, obj=value)


SAME: dict[str, dict[str, str]] = {  # class -> other programs' names of attributes: ours
    "Mechanism": {
        **dict.fromkeys(("M", "crba"), "mass_matrix"),
        **dict.fromkeys(("nle", "bias"), "bias_force"),
        **dict.fromkeys(("rnea", "id"), "inverse_dynamics"),
        **dict.fromkeys(("aba", "fd"), "forward_dynamics"),
        **dict.fromkeys(("fk", "forward_kinematics"), "pose"),
        "ik": "inverse_kinematics", "com": "centre_of_mass", "dof": "nv",
    },
    "Result": {
        **dict.fromkeys(("to_dataframe", "to_df"), "to_pandas"),
        "time": "t", "qpos": "q", "qvel": "v", "qd": "v", "qdd": "vdot", "qacc": "vdot",
    },
    "Stepper": {"time": "t", "qpos": "q", "qvel": "v", "qacc": "vdot"},
    "BatchStepper": {"time": "t", "qpos": "q", "qvel": "v"},
    "Sweep": dict.fromkeys(("to_dataframe", "to_df"), "to_pandas"),
}  # fmt: skip

_MODEL_HAS = {
    "names": "write [body.name for body in model.bodies], or list(model.row)",
    "to_dict": "write model.to_json(), or model.model_dump()",
    "rename": "write model.edit(name, name='new')",
    "step": "write pg.Stepper(model)",
    "run": "write pg.simulate(model, ...)",
    "nq": "write pg.Mechanism(model).nq",
    "nv": "write pg.Mechanism(model).nv",
    "mass": "write model['arm'].mass for the body 'arm'",
    "to_csv": "write model.to_json(); runs and sweeps have to_csv",
    "joints": "a joint is fields of its body: model['arm'].joint",
    "plot": "write model.to_image('model.png'), or pg.simulate(model).plot()",
    "show": "write model.to_image('model.png'), or pg.simulate(model).show()",
}
_MECH_HAS = {
    "mass": "write mech.mass_matrix(q), or sum(body.mass for body in mech.model.bodies)",
    "coriolis": "write mech.bias_force(q, v)",
    "acceleration": "write mech.forward_dynamics(q, v, tau)",
    "kinematics": "write mech.pose(q, 'arm')",
    **dict.fromkeys(
        ("eigenfrequencies", "natural_frequencies", "frequencies", "modes", "eigenvalues"),
        "write mech.linearise().frequencies [rad/s], .eigenvalues or .modes",
    ),
    **dict.fromkeys(("frame", "transform"), "write mech.pose(q, 'arm')"),
    "total_mass": "write sum(body.mass for body in mech.model.bodies)",
    "forward_dynamics_derivatives": "write mech.forward_derivatives(q, v, tau)",
    **dict.fromkeys(("q", "v", "q0", "state"), "it keeps no state: q, v = mech.home()"),
    "gravity": "write mech.model.gravity, or mech.bias_force(q, 0 * v) for its torques",
    "bodies": "write mech.model.bodies, or mech.names",
    "step": "write pg.Stepper(mech)",
    "run": "write pg.simulate(mech, ...)",
    "kinetic_energy": "write mech.energy(q, v)[0]",
    "potential_energy": "write mech.energy(q, v)[1]",
}
_PART_HAS = {
    "edit": "write model.edit(name, field=value), or part.model_copy(update={'field': value})",
    "replace": "write model.edit(name, field=value), or part.model_copy(update={'field': value})",
    "to_dict": "write part.model_dump()",
}
_TABLE_HAS = dict.fromkeys(
    ("x", "y", "data", "results", "array", "metric", "metrics", "columns"),
    "columns are table['max knee'], all of them table.values",
) | {
    **dict.fromkeys(
        ("failures", "errors", "reasons"), "table.failed are their numbers, table.reason says why"
    ),
    **dict.fromkeys(("best", "argmin", "argmax"), "write table['max knee'].argmax()"),
}
_RUN_HAS = {
    "animate": "write run.show(), or run.to_html('run.html')",
    "animation": "write run.show(), or run.to_html('run.html')",
    "y": "the states are run.q and run.v",
    "x": "the states are run.q and run.v",
    "success": "write run.status.ok",
    "to_mat": "write run.save('run.mat')",
    "to_json": "write run.save('run.npz'), run.to_csv() or run.to_pandas()",
    "names": "the names of bodies are run.mechanism.names; run['knee'] is a joint over time",
    "final_state": "the last state is run.q[-1], run.v[-1]",
    "to_dict": "write run.columns()",
    "model": "write run.mechanism.model",
    "values": "the states are run.q and run.v; run['knee'] is a joint over time",
    **dict.fromkeys(("position", "positions", "pose"), "write run.body_pose[:, k], or run['knee']"),
    **dict.fromkeys(("angle", "angles", "keys"), "write run['knee']; run.columns() has all names"),
    **dict.fromkeys(("compare", "diff"), "write run['knee'] - other['knee'], or run == other"),
    "metric": "write run['knee'].max(), or pg.sweep(model, {...}, 'max knee')",
}
_STEPPER_HAS = {
    **dict.fromkeys(
        ("run", "simulate", "advance"),
        "write st.step(n=1000), or st.record_over(1.0) for a Result of one second",
    ),
    **dict.fromkeys(("ctrl", "control"), "give inputs by name: st.step(inputs={'motor': 0.5})"),
    **dict.fromkeys(("state", "get_state"), "the state is st.q and st.v; st.save() is all of it"),
    **dict.fromkeys(("set_state", "set"), "write st.reset(q, v)"),
    **dict.fromkeys(("pose", "position", "positions"), "write st.mech.pose(st.q, 'arm')"),
}
_BATCH_HAS = {
    **dict.fromkeys(
        ("run", "simulate", "advance", "record", "rollout"),
        "write batch.step(n=1000), or batch.trace(n=1000) for q and v after each step",
    ),
    **dict.fromkeys(("state", "states", "get_state"), "the states are batch.q and batch.v"),
    **dict.fromkeys(("set_state", "set"), "write batch.reset(q, v)"),
    **dict.fromkeys(
        ("energy", "energies", "pose", "positions"),
        "declare an Output in the model and read batch.outputs",
    ),
    **dict.fromkeys(
        ("gait", "change"),
        "fields of the gait are given as set={'scenarios.trot.gait.speed': values}",
    ),
}
_PANDAS = dict.fromkeys(("df", "dataframe"), "to_pandas()")
# class -> names that people try: what to write
MEANT_BY: dict[str, dict[str, str]] = {
    "Mechanism": _MECH_HAS,
    "Model": _MODEL_HAS,
    "Result": _RUN_HAS | {name: f"write run.{to}" for name, to in _PANDAS.items()},
    "Stepper": _STEPPER_HAS,
    "BatchStepper": _BATCH_HAS,
    "Sweep": _TABLE_HAS | {name: f"write table.{to}" for name, to in _PANDAS.items()},
}


TRIED = {kind: {*SAME.get(kind, ()), *MEANT_BY[kind]} for kind in MEANT_BY}  # names, per class


def _elsewhere(kind: str, name: str) -> str:
    """Return a hint on what replaces an attribute that a class of ours lacks, "" for others."""
    if name.startswith("_"):
        return ""
    if hint := MEANT_BY.get(kind, {}).get(name):
        return hint
    public = import_module("pgraph_core").__all__
    given = {"Model": "model", "Mechanism": "mech", "Result": "run"}.get(kind, "...")
    if name in public and name.islower():
        return f"write pg.{name}({given}, ...)"
    act, _, what = name.partition("_")
    if what and kind == "Model" and act in ("add", "remove", "edit", "set"):
        part = what.split("_")[0].capitalize()
        part = f"pg.{part}" if part in public else "pg.Body"
        calls = {"add": f"add({part}(name=..., ...))", "remove": "remove(name)"}
        return f"write {given}.{calls.get(act, 'edit(name, field=value)')}"
    return ""


def _of_this(value: Any, name: str) -> str:
    """Return a hint on a part of a value by this name, or on a similar name."""
    if name.startswith("_"):
        return ""
    own = vars(value)
    if name in getattr(own.get("mechanism"), "joints", ()):
        return f"write run[{name!r}]"
    parts = [x for many in own.values() if isinstance(many, tuple) for x in many]
    if "bodies" in own and name in [getattr(x, "name", None) for x in parts]:
        return f"write model[{name!r}]"
    if "name" in own and "bodies" not in own and (hint := _PART_HAS.get(name)):
        return hint
    known = [x for x in dir(value) if not x.startswith(("_", "model_"))]
    close = words.hint(name, known)
    return f"did you mean {close}?" if close else ""


def _empty(written: str, module: str, name: str) -> Any:
    """An instance without state, for `pickle`. Raises InputError for another version's pickle."""
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
    """A mixin: holds addresses of this process, which mean nothing elsewhere."""

    def __reduce_ex__(self, protocol: Any) -> Any:
        text = "holds memory addresses and cannot be pickled or copied; send its Mechanism instead"
        raise TypeError(f"a {type(self).__name__} {text}")


class ReadOnly(dict[str, Any]):
    """A dictionary that is not changed in place, which an InputError says, and what to write."""

    def __init__(self, entries: Mapping[str, Any], where: str, instead: str):
        super().__init__(entries)
        self._told = where, instead

    def _refused(self, *args: Any, **named: Any) -> NoReturn:
        where, instead = self._told
        field = repr(args[0]) if args and isinstance(args[0], str) else ""
        raise InputError(Problem(where, field, f"is not changed in place; {instead}"))

    __setitem__ = __delitem__ = __ior__ = _refused  # pyright: ignore[reportAssignmentType]
    clear = pop = popitem = setdefault = update = _refused  # pyright: ignore[reportAssignmentType]

    def __reduce__(self) -> Any:
        return ReadOnly, (dict(self), *self._told)


def keep_unchanged(arrays: Iterable[Any]) -> None:
    """Let nobody write into these arrays."""
    for array in arrays:
        if isinstance(array, np.ndarray):
            array.flags.writeable = False


# -- equality of values that hold arrays ---------------------------------------------------------


def same(a: Any, b: Any) -> bool:
    """True if two values, or all values in them, are equal, with nan = nan and list = tuple."""
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
    """A mixin of dataclasses with arrays: equal fields, but for those with `compare=False`.

    Arrays can change, so there is no hash.
    """

    def __eq__(self, other: object) -> bool:
        """Compare the fields, with nan equal to nan."""
        if type(self) is not type(other):
            return NotImplemented
        names = [field.name for field in fields(cast("Any", self)) if field.compare]
        return all(same(getattr(self, name), getattr(other, name)) for name in names)

    __hash__ = None  # pyright: ignore[reportAssignmentType]
