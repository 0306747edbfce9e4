"""The columns of a run as a table, and the lookup of columns by name.

A coordinate has the name of its body, as in `run["knee"]`. All other columns are named
`attribute.object`: `v.knee`, `energy`, `contact_force.paw.z`.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Mapping
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .. import words
from ..dynamics.arguments import finite
from ..errors import InputError, NameLookupError, Problem, choices, needed, shown
from ..joints import units_of
from ..packing import Array
from .beams import columns_of_beams
from .bodies import all_forces, units_of_drives

if TYPE_CHECKING:
    from ..mechanism import Mechanism
from collections.abc import Callable

from ..errors import nearest_first

LEDGER = ("energy", "kinetic_energy", "potential_energy", "work", "dissipation")
OF_BODIES = {  # name: (unit, attribute of a run (n, nb, ...), first of three columns)
    "position": ("m", "body_pose", 0),
    "velocity": ("m/s", "body_velocity", 3),
    "angular_velocity": ("rad/s", "body_velocity", 0),
    "acceleration": ("m/s^2", "body_acceleration", 3),
    "angular_acceleration": ("rad/s^2", "body_acceleration", 0),
    "joint_force": ("N", "joint_force", 3),
    "joint_torque": ("N m", "joint_force", 0),
}
OTHER_WORDS = {"time": "t", "total_energy": "energy"}


class Column(NamedTuple):
    """Values over all frames (n,) and their unit, which is "" for text."""

    unit: str
    values: Any


def columns_of(run: Any, bodies: bool = False) -> dict[str, Column]:
    """Return all columns of a run by name, with the motion and joint forces of bodies if wanted.

    A coordinate or an output whose name another column has is called `q.NAME`, `outputs.NAME`.
    """
    positions, speeds = coordinates(run.mechanism)
    rates: dict[str, Column] = {}
    for kind, per, array in (("v", "/s", run.v), ("vdot", "/s^2", run.vdot)):
        rates |= {f"{kind}.{x}": Column(u + per, a) for (x, u), a in zip(speeds, array.T)}
    rates |= {name: Column("J", getattr(run, name)) for name in LEDGER}
    forces = _forces(run)
    reserved = {"t", *rates, *forces}
    found = {"t": Column("s", run.t)}
    for (place, unit), x in zip(positions, run.q.T):
        taken = {place, place.rpartition(".")[0]} & reserved
        found[f"q.{place}" if taken else place] = Column(unit, x)
    found |= rates
    for o in run.mechanism.model.outputs:
        values = run.outputs[o.name].reshape(len(run.t), -1).T
        for part, x in zip(o.reading.parts, values):
            name = ".".join(filter(None, (o.name, part)))
            taken = name in found or name in forces
            found[f"outputs.{name}" if taken else name] = Column(o.reading.unit, x)
    found |= forces | columns_of_states(run)
    if run.mechanism.model.segments:
        found |= {name: Column(*x) for name, x in columns_of_beams(run).items()}
    return found | (_bodies(run) if bodies else {})


def columns_of_states(run: Any) -> dict[str, Column]:
    """Return the values of controls and their states, numbered from 1.

    A state with a quantity has its name instead, as `activation.NAME` of a muscle.
    """
    states, parts = run.states.T, run.mechanism.model.states
    found = {
        f"{own.quantity.word}.{part.name}": Column(own.quantity.unit, own.quantity.scale * x)
        for (part, _, own), x in zip(parts, states) if own.quantity is not None
    }  # fmt: skip
    named = {part.name for part, _, own in parts if own.quantity is not None}
    for name, value in run.controls.items():
        if name not in named:
            found[f"x.{name}"] = Column("1", value)
    for (part, k, own), x in zip(parts, states):
        unnamed = own.quantity is None
        if unnamed and not np.array_equal(x, run.controls[part.name], equal_nan=True):
            found[f"x.{part.name}.{k + 1}"] = Column("1", x)
    return found


def _bodies(run: Any) -> dict[str, Column]:
    """Return the motion of all body frames in world axes, and the wrenches of their joints."""
    found: dict[str, Column] = {}
    for kind, (unit, attribute, first) in OF_BODIES.items():
        for name, values in zip(run.mechanism.names, getattr(run, attribute).swapaxes(0, 1)):
            found |= {
                f"{kind}.{name}.{axis}": Column(unit, values[:, first + i])
                for i, axis in enumerate("xyz")
            }
    return found


def _forces(run: Any) -> dict[str, Column]:
    """Return the columns for constraints, contacts, drives, limits and phases."""
    found: dict[str, Column] = {}
    kinds = {c.name: c.kind for c in run.mechanism.model.constraints}
    for name, force in run.constraint_force.items():
        found |= _along_axes(f"constraint_force.{name}", force)
        if kinds.get(name) != "point":  # a point transmits no torque
            found |= _about_axes(f"constraint_torque.{name}", force)
    for name, cam in run.cams.items():
        found[f"pressure_angle.{name}"] = Column("rad", cam.pressure_angle)
        found[f"normal_force.{name}"] = Column("N", cam.normal_force)
        found |= {
            f"contact_point.{name}.{axis}": Column("m", x) for axis, x in zip("xyz", cam.point.T)
        }
    touched = run.contacts
    for name, force in touched.force.items():
        found |= _along_axes(f"contact_force.{name}", force)
        if name in touched.normal:
            found[f"contact_normal.{name}"] = Column("N", touched.normal[name])
        found[f"contact_gap.{name}"] = Column("m", touched.gap[name])
        found[f"contact_slip.{name}"] = Column("m/s", touched.slip[name])
    units = units_of_drives(run.mechanism.model, all_forces(run)) if run.drive_force else {}
    for name, force in run.drive_force.items():
        found[f"drive_force.{name}"] = Column(units.get(name, "N m, N"), force)
    found |= {f"tension.{name}": Column("N", x) for name, x in run.tension.items()}
    found |= {f"path_length.{name}": Column("m", x) for name, x in run.path_length.items()}
    found |= {f"limit.{name}": Column("N m, N", x) for name, x in touched.limit.items()}
    return found | {f"phases.{name}": Column("", x) for name, x in touched.phases.items()}


def _along_axes(name: str, wrench: Array) -> dict[str, Column]:
    """Return the forces in wrenches (n, 6), one column per axis."""
    return {f"{name}.{axis}": Column("N", wrench[:, 3 + i]) for i, axis in enumerate("xyz")}


def _about_axes(name: str, wrench: Array) -> dict[str, Column]:
    """Return the torques in wrenches (n, 6), one column per axis."""
    return {f"{name}.{axis}": Column("N m", wrench[:, i]) for i, axis in enumerate("xyz")}


def coordinates(mech: Mechanism) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """Return (name, unit) of every entry of q and of v: ("knee", "rad"), ("trunk.0", "m")."""
    found: tuple[list[tuple[str, str]], list[tuple[str, str]]] = ([], [])
    for name in mech.names:
        units = [units_of(m) for m in mech.model.body(name).sequence]
        of_q, of_v = ([unit for pair in units for unit in pair[k]] for k in (0, 1))
        for entries, each in zip(found, (of_q, of_v)):
            places = [name] if len(each) == 1 else [f"{name}.{n}" for n in range(len(each))]
            if len(each) > 1 and set(places) & set(mech.names):
                places = [f"{name}[{n}]" for n in range(len(each))]
            entries += zip(places, each)
    return found


class State(NamedTuple):
    """The quantity, "q" or "v", and the coordinate of a column."""

    quantity: str
    place: str
    alone: bool  # whether its joint has no other coordinate

    def given(self, x: float) -> str:
        """Return how to start it at x, to complete a sentence."""
        name, word = self.place, self.quantity
        if not self.alone:
            return f"give the start of its body in {word}"
        return f"give {word}={{{name!r}: {x:.6g}}}, or free '{word}.{name}'"


def states_of_columns(run: Any) -> dict[str, State]:
    """Return the coordinates and velocities among the columns of a run, by column."""
    positions, speeds = coordinates(run.mechanism)
    names, columns = {*run.mechanism.names}, columns_of(run)
    found = {f"v.{place}": State("v", place, place in names) for place, _ in speeds}
    for place, _ in positions:
        own = f"q.{place}"
        found[own if own in columns else place] = State("q", place, place in names)
    return found


def meant(columns: Iterable[str], name: str) -> list[str]:
    """Return the columns that match a name: an exact match, a common prefix or a common object.

    "trunk" is trunk.0 to trunk.6, "v" all velocities, "paw" everything of a contact or constraint
    of that name; "q.knee" is knee; the words of a name may stand apart, "kinetic energy", and its
    unit may follow in brackets. The result is empty if no column matches.
    """
    known = list(columns)
    word = name.partition(" [")[0]
    spelt = [word, word.replace(" ", "."), word.replace(" ", "_"), word.replace(" ", ".", 1)]
    for one in dict.fromkeys(OTHER_WORDS.get(x, x) for x in spelt):
        for start in (one, one.removeprefix("q."), one.removeprefix("outputs.")):
            if start in known:
                return [start]
            if found := [c for c in known if c.startswith(f"{start}.")]:
                return found
        if one == "q":
            return [c for c in known if _is_coordinate(c, set(known))]
        parts = [c.partition(".") for c in known]
        of_it = ["".join(p) for p in parts if p[2] == one or p[2].startswith(f"{one}.")]
        if of_it:
            return of_it
    return []


def _is_coordinate(column: str, known: set[str]) -> bool:
    """Return True for a column of q, whose joint has a velocity."""
    joint = column.removeprefix("q.")
    own = bool({f"v.{joint}", f"v.{joint.rpartition('.')[0]}.0"} & known)
    return own and f"q.{column}" not in known


def no_column(columns: Iterable[str], name: str) -> str:
    """Return the message for an unknown column, with the closest names."""
    known = list(columns)
    head, _, part = name.partition(".")
    last, whole = name.rpartition(".")[2].rpartition("_")[2], name.rpartition(".")[0]
    kinds = words.ATTRIBUTES.get(head, ())  # torque.push is drive_force.push
    close = [c for c in known if whole and c.rpartition(".")[0] == whole]
    close += [c for c in known if part and c.partition(".")[2] == part]
    close += [c for c in known if c.partition(".")[0] in kinds and not part]
    close += words.similar(name, known, n=6, cutoff=0.5)
    close += [c for c in known if name in c.split(".") or last in c.split(".")]
    hint = f"; did you mean {choices(dict.fromkeys(close), 7)}?" if close else ""
    plain = [c for c in known if c.partition(".")[0] not in OF_BODIES] or known
    return f"there is no column {name!r}{hint or '; choose one of ' + choices(plain, 24)}"


def frame(columns: Mapping[str, Column]) -> Any:
    """Return a pandas.DataFrame with one row per frame, indexed by t [s], with `attrs["units"]`.

    Names are resolved as in `meant`. The name of the index is also accepted. A KeyError lists the
    columns. Needs pandas.
    """
    numbers = {name: column for name, column in columns.items() if column.unit}
    made = _frame_class()({name: column.values for name, column in numbers.items()}).set_index("t")
    made.attrs["units"] = {name: column.unit for name, column in numbers.items()}
    return made


def dataset(columns: Mapping[str, Column]) -> Any:
    """Create an xarray.Dataset of the numeric columns over t [s], each with `attrs["units"]`."""
    xarray = needed("xarray", "xarray")
    numbers = {name: column for name, column in columns.items() if column.unit}
    t = numbers.pop("t")
    made = {name: ("t", c.values, {"units": c.unit}) for name, c in numbers.items()}
    return xarray.Dataset(made, coords={"t": ("t", t.values, {"units": t.unit})})


LONGEST_WORD = 63  # characters of a variable of MATLAB


def matlab(columns: Mapping[str, Column]) -> bytes:
    """Return a MATLAB file with one variable per numeric column, plus `names` and `units`."""
    from scipy.io import savemat

    numbers = {name: column for name, column in columns.items() if column.unit}
    found: dict[str, Any] = {}
    for name, column in numbers.items():
        word = re.sub(r"[^A-Za-z0-9]", "_", name)
        word = stem = (word if word[:1].isalpha() else f"x{word}")[: LONGEST_WORD - 4]
        n = 2
        while word in (*found, "names", "units"):
            word, n = f"{stem}_{n}", n + 1
        found[word] = column.values
    found["names"] = np.array([*numbers], dtype=object)
    found["units"] = np.array([column.unit for column in numbers.values()], dtype=object)
    file = io.BytesIO()
    savemat(file, found, oned_as="column", long_field_names=True)
    return file.getvalue()


@cache
def _frame_class() -> Any:
    pandas = needed("pandas", "pandas")

    class Frame(pandas.DataFrame):
        @property
        def _constructor(self) -> Any:  # class of derived tables
            return Frame

        def _is_time(self, key: Any) -> bool:
            if not isinstance(key, str) or self.index.name is None or key in self.columns:
                return False
            return OTHER_WORDS.get(key, key) == self.index.name

        def __getitem__(self, key: Any) -> Any:
            try:
                return super().__getitem__(key)
            except KeyError:
                names = key if isinstance(key, list) else [key]
                if not all(isinstance(name, str) for name in names):
                    raise
            if self._is_time(key):
                return self.index.to_series()
            found = [column for name in names for column in self._meant(name)]
            return super().__getitem__(found[0] if len(found) == 1 and key is not names else found)

        def _meant(self, name: str) -> list[str]:
            """Return the columns that match a name. Raises NameLookupError."""
            found = [name] * (name in self.columns)
            found = found or meant([c for c in self.columns if isinstance(c, str)], name)
            if not found:
                raise NameLookupError(Problem("table", "", no_column(self.columns, name)))
            return found

        def __contains__(self, key: Any) -> bool:
            known = [c for c in self.columns if isinstance(c, str)]
            named = isinstance(key, str) and (self._is_time(key) or bool(meant(known, key)))
            return named or super().__contains__(key)

        def set_index(self, keys: Any, *args: Any, **named: Any) -> Any:
            if self._is_time(keys):  # df.plot(x="t") calls this
                return None if named.get("inplace") else self.copy()
            return super().set_index(keys, *args, **named)

        def __reduce_ex__(self, protocol: Any) -> Any:
            plain = pandas.DataFrame(self)
            plain.attrs = dict(self.attrs)
            return _itself, (plain,)

    Frame.__name__ = Frame.__qualname__ = "DataFrame"
    return Frame


def _itself(value: Any) -> Any:
    """Return the value unchanged. Pickles call this to restore a table as a plain DataFrame."""
    return value


# -- arrays whose columns have names ---------------------------------------------------------------


class Labelled(np.ndarray[Any, np.dtype[Any]]):
    """An array that a name of a joint or body indexes too.

    Its parts and the results of arithmetic are plain arrays.
    """

    # below that of arrays, so that it becomes one when it is joined with others
    __array_priority__ = -1.0  # pyright: ignore[reportAssignmentType, reportIncompatibleMethodOverride]
    # what an error calls it, and the function with its argument that returns {name: index}
    _names: tuple[str, Callable[[Any], Mapping[str, Any]], Any] = ("array", dict, ())

    def __getitem__(self, key: Any) -> Any:
        """Return the columns of a name, or the contents of an array. Raises NameLookupError."""
        if isinstance(key, str):
            word, of, given = self._names
            places = of(given)
            if key not in places:
                text = f"no entry is named {key!r}; choose one of "
                text += choices(nearest_first(key, places))
                whole, _, number = key.rpartition(".")
                if whole in places and number.isdigit():
                    text += f"; its column {number} is run.{word}[{whole!r}][:, {number}]"
                raise NameLookupError(Problem(f"run.{word}", "", text))
            key = places[key]
        return self.view(np.ndarray)[key]

    _at: Any = None  # function of a name and a point (3,) of a body that returns its own columns

    def __call__(self, name: str, point: Any = None) -> Any:
        """Return the columns of a name, like `array[name]`.

        `point` is a point in body axes, whose position, velocity or acceleration is returned in
        place of the origin's.
        """
        if point is None:
            return self[name]
        word = f"run.{self._names[0]}"
        if self._at is None:
            text = "is for run.position, run.velocity and run.acceleration of a body"
            raise InputError(Problem(word, "point", f"{text}; write {word}[{shown(name)}]"))
        return self._at(name, finite(f"{word}, point", point, 3))

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: bool = False) -> Any:
        return array[()] if return_scalar else array.view(np.ndarray)

    def __repr__(self) -> str:
        return repr(self.view(np.ndarray))


def labelled(
    array: Array, word: str, of: Callable[[Any], Mapping[str, Any]], given: Any
) -> Labelled:
    """Return a view of `run.word` that can also be indexed by the names in `of(given)`."""
    found = array.view(Labelled)
    found._names = word, of, given  # pyright: ignore[reportPrivateUsage]
    return found


def by_position(joints: Mapping[str, Any]) -> dict[str, Any]:
    """Return {joint: index} of coordinates along the last axis: one number, or several."""
    return {name: _one_or_more(joint.q) for name, joint in joints.items()}


def by_velocity(joints: Mapping[str, Any]) -> dict[str, Any]:
    """Return {joint: index} of velocities along the last axis: one number, or several."""
    return {name: _one_or_more(joint.v) for name, joint in joints.items()}


def _one_or_more(place: slice) -> Any:
    return ..., place.start if place.stop == place.start + 1 else place


def by_body(names: tuple[str, ...]) -> dict[str, Any]:
    """Return {body: index} along the second axis."""
    return {name: (slice(None), k) for k, name in enumerate(names)}
