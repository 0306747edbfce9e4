"""Records of a run: contacts, joint limits and user events.

`ContactRecord` has forces, gaps, phases and events of contacts. A `UserEvent` is a zero crossing of
a function passed to `simulate`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import NameLookupError, Problem, choices, nearest_first, shown
from ..fields import EVERY, GROUND
from ..model import Model
from ..model.contact import PAIRED
from ..packing import Array
from ..portable import EqualByFields, keep_unchanged


class Status(Enum):
    """The final status of a run: reached its end, stopped or failed."""

    DONE = "the run reached its end"
    STOPPED = "an event stopped the run"
    NOT_FINITE = "the motion stopped being finite"
    CANNOT_CLOSE = "the constraints cannot all be met"
    STEP_TOO_SMALL = "the step that the tolerance requires fell below the resolution of time"
    TOO_MANY_STEPS = "the run reached its largest number of steps"
    NOT_SOLVED = "the equations of an implicit step could not be solved"
    CHATTER = "contacts or switches change without end"
    CANCELLED = "the run was cancelled"

    @property
    def ok(self) -> bool:
        """Return True if the run reached its end or a terminal user event."""
        return self in (Status.DONE, Status.STOPPED)


# -- contacts and limits ---------------------------------------------------------------------------


SWING, ACCEPTANCE, SLIP, STANCE = "swing", "weight acceptance", "slip", "stance"
PHASES = (SWING, ACCEPTANCE, SLIP, STANCE)  # indexed by the numbers of the kernels
MAKE = "_make"  # attribute that makes a record when it is first read
FREE, STOP = "free", "stop"  # a joint between its limits, and at one


class Event(NamedTuple):
    """A phase change at one contact point at one instant. A bounce is a transition from swing to
    swing."""

    t: float  # [s]
    contact: str  # its name, with the number of the point where it has several
    body: str
    before: str  # the phase it was in
    after: str
    cause: str

    @property
    def time(self) -> float:
        """The time [s], as `t`."""
        return self.t

    def __str__(self) -> str:
        """Return the event as a sentence."""
        change = f"{self.before} to {self.after}" if self.before != self.after else self.after
        where = self.contact if self.body in self.contact else f"{self.contact} of {self.body}"
        return f"t = {self.t:.9g} s: {where}: {change}: {self.cause}"


class Derivatives(dict[str, Array]):
    """{path: (n, nq + nv + 2)} of q, v, work and dissipation, and how to go beside a run.

    Pickles keep the arrays alone.
    """

    def __init__(self, arrays: Mapping[str, Array], source: Any = None):
        """`source` has a method `beside`."""
        super().__init__(arrays)
        self.source = source

    def __reduce__(self) -> Any:
        return Derivatives, (dict(self),)


NO_DERIVATIVES = Derivatives({})


class Memory(dict[str, Array]):
    """The memory of a run at its end, besides its state, as arrays by name."""

    def __hash__(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        return id(self)

    def __eq__(self, other: object) -> bool:
        return self is other


@dataclass(frozen=True, eq=False)
class ContactRecord(EqualByFields):
    """Arrays over n frames, keyed by contact name, or by `name[body]` if it has several bodies."""

    force: Mapping[str, Array] = field(default_factory=dict)
    """(n, 6) [torque, force] on the touch's body about its origin, world axes [N m, N]. With time
    stepping, the mean since the previous frame."""
    gap: Mapping[str, Array] = field(default_factory=dict)
    """(n,) smallest gap [m], negative where it penetrates; inf where nothing is near."""
    slip: Mapping[str, Array] = field(default_factory=dict)
    """(n,) fastest slip [m/s] of its touching points."""
    limit: Mapping[str, Array] = field(default_factory=dict)
    """(n,) torque or force of a joint limit along its coordinate [N m, N], by limit. With time
    stepping, the mean since the previous frame."""
    pull: Mapping[str, Array] = field(default_factory=dict)
    """(n, 6) with time stepping, the wrenches of constraints in the step that ends at a frame."""
    wrench: Array = field(default_factory=lambda: np.zeros((0, 0, 6)))
    """(n, nb, 6) [torque, force] of all contacts on every body about its origin, world axes. With
    time stepping, those of the step that ends at a frame."""

    residual: Array = field(default_factory=lambda: np.zeros((0, 3)))
    """(n, 3) see `Result.contact_residual`."""

    normal: Mapping[str, Array] = field(default_factory=dict)
    """(n,) part of the force off the ground [N], of touches with the ground."""
    phases: Mapping[str, NDArray[np.str_]] = field(default_factory=dict)
    """(n,) swing, weight acceptance, slip or stance by contact point; a limit: free or stop."""
    events: tuple[Event, ...] = field(default_factory=tuple)
    """Changes, in order of time."""

    @classmethod
    def later(cls, make: Callable[[], ContactRecord]) -> ContactRecord:
        """Return a record that calls `make` on first access, because creating it takes as long as
        many steps."""
        found = object.__new__(cls)
        found.__dict__[MAKE] = make
        return found

    def __getattr__(self, name: str) -> Any:
        own = self.__dict__
        if (make := own.get(MAKE)) is not None:
            made = make()
            made.keep_unchanged()
            own.update(made.__dict__)
            own.pop(MAKE, None)
        if name not in own:  # another thread may have made it
            raise AttributeError(f"a record of contacts has no {name!r}")
        return own[name]

    def __getstate__(self) -> dict[str, Any]:
        """Return the arrays, without the function that makes them."""
        _ = self.wrench  # makes it
        return self.__dict__

    def keep_unchanged(self) -> None:
        """Make the arrays read-only. Other mapping types already are."""
        if MAKE in self.__dict__ or not self.wrench.flags.writeable:
            return  # done when it is made, or before
        keep_unchanged((self.wrench, self.residual))
        for what in KINDS:
            found = getattr(self, what)
            if isinstance(found, Named):
                found.keep_unchanged()
            elif type(found) is dict:
                keep_unchanged(found.values())

    def arrays(self) -> dict[str, Array]:
        """Return all arrays by name, for writing to a file."""
        found = {
            f"contact {what}:{name}": array
            for what in KINDS
            for name, array in getattr(self, what).items()
        }
        if self.events:
            times, *texts = zip(*self.events)
            found |= {"contact event times": np.array(times), "contact events": np.array(texts)}
        found |= {"contact residual": self.residual} if self.residual.size else {}
        return found | ({"contact wrench": self.wrench} if self.wrench.size else {})

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, Array]) -> ContactRecord:
        """Rebuild a record from its arrays and ignore other names."""
        parts: list[dict[str, Any]] = [
            {
                key.removeprefix(f"contact {what}:"): array
                for key, array in arrays.items()
                if key.startswith(f"contact {what}:")
            }
            for what in KINDS
        ]
        force, gap, slip, limit, normal, phases, pull = parts
        wrench = arrays.get("contact wrench", NOTHING.wrench)
        texts = arrays.get("contact events", np.empty((5, 0))).T.tolist()
        times = arrays.get("contact event times", np.empty(0)).tolist()
        events = tuple(Event(t, *text) for t, text in zip(times, texts))
        residual = arrays.get("contact residual", NOTHING.residual)
        return cls(force, gap, slip, limit, pull, wrench, residual, normal, phases, events)


class Named(Mapping[str, Any]):
    """Arrays by name. An unknown name raises a KeyError that lists the valid names."""

    def __init__(
        self, arrays: Mapping[str, Any] | Callable[[], Mapping[str, Any]], word: str, what: str
    ):
        """Set the attribute `word` and the kind of object `what`: "contact_force", "contact".

        A function gives the arrays when one is first read.
        """
        self._given, self._word, self._what = arrays, word, what

    @property
    def _arrays(self) -> Mapping[str, Any]:
        if callable(self._given):
            self._given = self._given()
            keep_unchanged(self._given.values())
        return self._given

    def keep_unchanged(self) -> None:
        """Make the arrays read-only, those computed later when they are first read."""
        if not callable(self._given):
            keep_unchanged(self._given.values())

    def __reduce__(self) -> Any:
        """Pickle the arrays, without the function that makes them."""
        return type(self), (dict(self._arrays), self._word, self._what)

    def __getitem__(self, name: Any) -> Any:
        """Return the array with this name. Raises NameLookupError, which lists the valid names."""
        try:
            return self._arrays[name]
        except (KeyError, TypeError):
            raise NameLookupError(Problem(self._word, "", self._missing(name))) from None

    def __call__(self, *names: Any) -> Any:
        """Return the array of a name, or of two bodies, like `run.contact_force["a", "b"]`."""
        first, *others = names or (None,)
        return self if first is None else self[names if others else first]

    def __iter__(self) -> Iterator[str]:
        """Over the names."""
        return iter(self._arrays)

    def __len__(self) -> int:
        """Count the arrays."""
        return len(self._arrays)

    def __repr__(self) -> str:
        """Return the repr of the contents as a dictionary."""
        return repr(dict(self))

    def _missing(self, name: Any) -> str:
        if not self._arrays:
            add = f"; model.add(pg.{ADDED[self._what]}) adds one" if self._what in ADDED else ""
            return f"no {self._what} acts in this run, got {shown(name)}{add}"
        known = choices(nearest_first(name, self) if isinstance(name, str) else self)
        return f"no {self._what} is named {shown(name)}; choose one of {known}"


class ByTouch(Named):
    """Arrays by contact pair or by two body names: `run.contact_force["a", "ground"]`.

    If there are several pairs between two bodies, the result is the sum of the forces, the smallest
    gap and the largest slip.
    """

    def __init__(
        self,
        arrays: Mapping[str, Any],
        word: str,
        model: Model,
        joined: Callable[[list[Any]], Any],
        swapped: Callable[[Any, str, str], Any] = lambda value, *_: value,
    ):
        """Set `swapped(value, a, b)`, which turns a value on a, touched by b, into that on b."""
        super().__init__(arrays, word, "contact")
        self._model, self._joined, self._swapped = model, joined, swapped

    def __getitem__(self, name: Any) -> Any:
        """Return the array of a pair, or of all contacts of two bodies. Raises NameLookupError."""
        if not (isinstance(name, tuple) and len(name) == 2):
            return super().__getitem__(name)
        a, b = name
        found: list[Any] = []
        for c in self._model.contacts:
            if (own := c.touch_name(a, b)) in self._arrays:
                found.append(self._arrays[own])
            elif (own := c.touch_name(b, a)) in self._arrays:
                found.append(self._swapped(self._arrays[own], b, a))
        if not found:
            raise NameLookupError(Problem(self._word, "", self._no_pair(a, b)))
        return found[0] if len(found) == 1 else self._joined(found)

    def __reduce__(self) -> Any:
        """Pickle as a plain dictionary, without the run."""
        return dict, (dict(self._arrays),)

    def _no_pair(self, a: Any, b: Any) -> str:
        bodies = (*self._model.row, GROUND)
        for name in (a, b):
            if name not in bodies:
                return f"no body is named {shown(name)}; choose one of {choices(bodies)}"
        crowds = [
            c.name for c in self._model.contacts if c.name in self and c.pair == (EVERY, EVERY)
        ]
        if crowds:
            text = f"of more bodies than {PAIRED} is one entry, '{crowds[0]}'; name two bodies in a"
            return f"a contact {text} contact of their own"
        return self._missing((a, b)).replace("is named", "is between")


KINDS = ("force", "gap", "slip", "limit", "normal", "phases", "pull")
OF_CONSTRAINTS = ("constraint_force", "constraint")  # arguments of Named for constraints
OF_DRIVES = ("drive_force", "motor, servo or actuator")  # and for drives
OF_PATHS = ("tension", "spring, strut, cable or rope")  # and for paths
ADDED = {  # contents of `Named`: the part of the model that brings each
    "contact": "Contact(body='...', other='ground')", "output": "Output('...', at='...')",
    "constraint": "Point(body='...', other='...')", OF_DRIVES[1]: "Motor('...', body='...')",
    "control": "Filter('...', input='=...')",
}  # fmt: skip
NOTHING, NO_FORCES, NO_DRIVES = ContactRecord(), Named({}, *OF_CONSTRAINTS), Named({}, *OF_DRIVES)


# -- user event ------------------------------------------------------------------------------------


class UserEvent(NamedTuple):
    """An event from `simulate(events=[...])`, located within a step."""

    t: float  # [s]
    name: str  # name of the function
    number: int  # index of the function in the list
    q: Array  # (nq,)
    v: Array  # (nv,)

    @property
    def time(self) -> float:
        """The time [s], as `t`."""
        return self.t

    def __str__(self) -> str:
        """Return the event as a sentence."""
        return f"t = {self.t:.9g} s: {self.name}"


def event_arrays(events: Sequence[UserEvent]) -> dict[str, Any]:
    """Return arrays by name for a file, or {} if there are no events."""
    if not events:
        return {}
    t, name, number, q, v = zip(*events)
    columns = {"t": t, "name": name, "number": number, "q": q, "v": v}
    return {f"user event {key}": np.array(column) for key, column in columns.items()}


def events_of_arrays(arrays: Mapping[str, Any]) -> tuple[UserEvent, ...]:
    """The way back."""
    if "user event t" not in arrays:
        return ()
    t, name, number, q, v = (arrays[f"user event {key}"] for key in UserEvent._fields)
    return tuple(map(UserEvent, t.tolist(), name.tolist(), number.tolist(), q, v))
