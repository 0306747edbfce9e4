"""Fields that the reader of a figure may change, and the numbers in the image that depend on them.

The browser must treat a field in the same way as Python. By a rule: every number that changes with
it is a copy of the value, or a fixed multiple, or made of such copies in the table of bodies by the
kernel that packs models; that is tried out at several values, byte for byte. For a list of n
values, the numbers are computed for each value and stored, even if no rule applies.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..engine.packing import pack
from ..errors import InputError, PgraphError, Problem, choices
from ..mechanism import Mechanism
from ..model import Model
from ..packing import length_in
from ..simulation.paths import Path, with_numbers
from .run import BASE, LiveRun

VALUES_TRIED = 3  # values within the range, besides its ends
MOST_COMPUTED = 200  # limit on the values of a field that are computed one by one
SOME = 21  # default number of values of a field that no rule covers
RANGE_FACTOR = 4  # default range of a value: this factor smaller and larger
TABLE = ("body", "motion", "start")  # arrays that hold a model's numbers before they are packed
PACKED = ("rows", "const", "bodies_i", "bodies_f", "home")


class Opened(NamedTuple):
    """A field and its range."""

    path: Path
    low: float
    high: float
    number: int = 0  # number of evenly spaced values, 0 for any value

    @property
    def values(self) -> list[float]:
        """The permitted values, including the model's own, or [] if any value is permitted."""
        if not self.number:
            return []
        return sorted({*np.linspace(self.low, self.high, self.number).tolist(), self.path.present})

    @property
    def label(self) -> str:
        """A readable name, such as `mass of lower`."""
        inside = " ".join(map(str, self.path.inside))
        axis = {"0": "x", "1": "y", "2": "z"}
        words = [axis.get(w, w.replace("_", " ")) for w in inside.split()]
        return " ".join(words) + (f" of {self.path.name}" if self.path.name else "")


def opened(model: Model, given: str) -> Opened:
    """Parse `PATH`, `PATH=low:high` or `PATH=low:high:n`. Raises InputError."""
    name, _, span = given.partition("=")
    path = Path(model, name, "export")
    x, count = path.present, 0
    low, high = sorted((x / RANGE_FACTOR, x * RANGE_FACTOR)) if x else (-1.0, 1.0)
    if span:
        try:
            low, high, *more = (float(part) for part in span.split(":"))
            count = int(more[0]) if more else 0
        except (ValueError, OverflowError):
            low, more = np.nan, [0.0]
        if not np.isfinite(low) or (more and not (len(more) == 1 and 2 <= more[0] == count)):
            text = f"must be PATH, PATH=low:high or PATH=low:high:n, n > 1 values, got {given!r}"
            raise InputError(Problem("export", "open", text))
    if count > MOST_COMPUTED:
        text = f"may take {MOST_COMPUTED} values at most, got {count}"
        raise InputError(Problem("export", name, text))
    if not (np.isfinite(high) and low < high and low <= x <= high):
        text = f"needs a range low < high around the model's own {x:g}, got {low:g}:{high:g}"
        raise InputError(Problem("export", name, text))
    return Opened(path, low, high, count)


class Follows(NamedTuple):
    """The addresses in the image for one method that change with a field."""

    copies: tuple[tuple[int, float], ...]  # with the factor
    # numbers of the table of bodies, from which the rest is packed, with the factor
    table: tuple[tuple[int, float], ...]
    # of a list, for each value: where numbers differ from the image, and their bits by halves
    listed: tuple[tuple[float, tuple[int, ...], tuple[int, ...]], ...] = ()


def follows(
    model: Model, runs: Mapping[str, LiveRun], fields: Sequence[Opened], make: Any,
    within: float = 0.0,
) -> list[tuple[Opened, dict[str, Follows]]]:  # fmt: skip
    """Return each field with the dependent addresses as {method: addresses}.

    Fields without a rule have a finite number of values. `make(mechanism, method)` returns the run
    of a changed model. Numbers may differ from those of the changed model by the relative error
    `within`. Raises InputError if the browser cannot follow a field.
    """
    found = []
    rng = np.random.default_rng(0)
    own = {method: run.memory() for method, run in runs.items()}
    for one in fields:
        try:
            found.append((one, _of(one, model, runs, own, make, rng, within)))
        except _NoRuleError:
            some = one._replace(number=SOME)
            found.append((some, _of(some, model, runs, own, make, rng, within)))
    used = [one for one, _ in found]
    for _ in range(VALUES_TRIED if len(fields) > 1 else 0):  # all at once
        together = [float(rng.choice(f.values) if f.number else rng.uniform(f.low, f.high))
                    for f in used]  # fmt: skip
        changed = _made(model, list(zip(used, together)), make, runs)
        for method, run in runs.items():
            given = [(of[method], x) for (_, of), x in zip(found, together)]
            if wrong := _differs(run, own[method], given, changed[method], within):
                names = choices(other.path.text for other in used[:-1])
                text = f"cannot be left open with {names}: {wrong} follow several of them; "
                raise InputError(Problem("export", used[-1].path.text, f"{text}leave one out"))
    return found


class _NoRuleError(InputError):
    """Numbers in the run depend on a field in a way that the browser cannot compute."""

    def __init__(self, one: Opened, what: str):
        text = f"cannot be left open: {what} depend on it by a rule that an export does not know"
        super().__init__(Problem("export", one.path.text, text))


def _of(
    one: Opened, model: Model, runs: Mapping[str, LiveRun], own: Mapping[str, bytearray],
    make: Any, rng: np.random.Generator, within: float,
) -> dict[str, Follows]:  # fmt: skip
    """Return the numbers that depend on a field, by method. Raises InputError."""
    values = one.values or [one.low, *rng.uniform(one.low, one.high, VALUES_TRIED), one.high]
    changed = [_made(model, [(one, x)], make, runs) for x in values]
    of = {}
    for method, run in runs.items():
        theirs = [memories[method] for memories in changed]
        if any(len(memory) != len(own[method]) for memory in theirs):
            raise _NoRuleError(one, "the sizes of its tables")
        given = run, own[method], values, theirs
        of[method] = _listed(*given) if one.number else _follows(*given, within)
        for x, memory in zip(values, theirs):
            if wrong := _differs(run, own[method], [(of[method], x)], memory, within):
                raise _NoRuleError(one, wrong)
    return of


def _listed(
    run: LiveRun, own: bytearray, values: Sequence[float], theirs: Sequence[bytearray]
) -> Follows:
    """List the numbers for each value."""
    found, before = [], np.frombuffer(own, np.int64)
    for x, memory in zip(values, theirs):
        words = np.frombuffer(memory, np.int64)
        places = np.flatnonzero(words != before)
        halves = words[places].view(np.uint32).tolist()
        found.append((x, tuple((BASE + 8 * places).tolist()), tuple(halves)))
    return Follows((), (), tuple(found))


def _made(
    model: Model, values: Sequence[tuple[Opened, float]], make: Any, runs: Mapping[str, LiveRun]
) -> dict[str, bytearray]:
    """Return the image for each method, for the model with these values."""
    one, x = values[-1]
    try:
        paths, numbers = [field.path for field, _ in values], [float(x) for _, x in values]
        mech = Mechanism(with_numbers(model, paths, numbers))
        return {method: make(mech, method).memory() for method in runs}
    except PgraphError as error:
        text = f"cannot be {x:g}: {error.problems[0].text}; open a smaller range"
        raise InputError(Problem("export", one.path.text, text)) from None


def _follows(
    run: LiveRun, own: bytearray, values: Sequence[float], theirs: Sequence[bytearray],
    within: float,
) -> Follows:  # fmt: skip
    """Find the numbers that are copies or multiples of the value."""
    x = np.array(values)
    words = np.stack([np.frombuffer(memory, np.int64) for memory in theirs])
    places = np.flatnonzero((words != np.frombuffer(own, np.int64)).any(axis=0))
    y = words[:, places].view(np.float64)
    copies, table = [], []
    inside = [_span(run, name) for name in TABLE]
    for place, column in zip((BASE + 8 * places).tolist(), y.T):
        in_table = any(begin <= place < end for begin, end in inside)
        factor = _factor(x, column, within)
        if factor is not None:
            (table if in_table else copies).append((place, factor))
    packed = [span for name in PACKED for span in [_span(run, name)]]
    packed += [(to, to + size) for _, to, size in run.header()["copies"]]
    copies = [c for c in copies if not (table and any(b <= c[0] < e for b, e in packed))]
    return Follows(tuple(copies), tuple(table))


def _factor(x: Any, y: Any, within: float) -> float | None:
    """Return c if y equals c x with a single rounding, or within a relative error, else None."""
    k = int(np.argmax(np.abs(x)))
    for c in (1.0, -1.0, float(y[k] / x[k]) if x[k] else 1.0):
        if np.array_equal(c * x, y) or (within and _close(c * x, y, within).all()):
            return c
    return None


def _close(a: Any, b: Any, within: float) -> Any:
    with np.errstate(invalid="ignore", over="ignore"):  # integers as floats
        return np.abs(a - b) <= within * np.maximum(np.abs(a), np.abs(b))


def _span(run: LiveRun, name: str) -> tuple[int, int]:
    place, *shape = run.header()["arrays"][name]
    return place, place + 8 * int(np.prod(shape))


def _differs(
    run: LiveRun, own: bytearray, given: Sequence[tuple[Follows, float]], want: Any, within: float
) -> str:
    """Apply the browser's changes to the image. Return the first difference from `want`, or "" if
    there is none."""
    memory = bytearray(own)

    def view(name: str) -> Any:
        place, *shape = run.header()["arrays"][name]
        kind = np.int64 if name in ("rows", "bodies_i", "parent") else np.float64
        count = int(np.prod(shape))
        return np.frombuffer(memory, kind, count, place - BASE).reshape(shape)

    def put(place: int, value: float) -> None:
        memory[place - BASE : place - BASE + 8] = np.float64(value).tobytes()

    for what, x in given:
        for _, places, halves in (one for one in what.listed if one[0] == x):
            for place, word in zip(places, np.array(halves, np.uint32).view(np.int64)):
                memory[place - BASE : place - BASE + 8] = word.tobytes()
        for place, factor in what.copies:
            put(place, factor * x)
        for place, factor in what.table:
            put(place, factor * x)
    if any(what.table for what, _ in given):
        names = ("parent", "body", "motion", "start", "tracks", *PACKED)
        pack(*(view(name) for name in names))
        for place in run.lengths():
            put(place, length_in(len(view("rows")), view("const"), view("home")[: view("q").size]))
        for begin, to, size in run.header()["copies"]:
            memory[to - BASE : to - BASE + size] = memory[begin - BASE : begin - BASE + size]
    wrong = np.flatnonzero(np.frombuffer(memory, np.int64) != np.frombuffer(want, np.int64))
    if within:
        found, wanted = (np.frombuffer(x, np.float64)[wrong] for x in (memory, want))
        wrong = wrong[~_close(found, wanted, within)]
    return run.image.name_of(BASE + 8 * int(wrong[0])) if len(wrong) else ""
