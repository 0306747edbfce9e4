"""Result functions: expressions of the columns of a run, as `max(norm(joint_force.crank))`.

The grammar and its units are those of expressions in models. Names are those of `run[name]`.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.integrate import trapezoid

from ..errors import InputError, Problem, choices, shown
from ..packing import Array
from ..signals import Node, Unreadable, parsed_of_columns
from ..signals.grammar import walk
from ..signals.meaning import CONSTANTS, VALUES, dim_of, interpolated, smoothstep, unit
from ..units import KG, NONE, PA, RAD, Dim, J, M, N, S
from .columns import Column, columns_of, meant, no_column

if TYPE_CHECKING:
    from ..mechanism import Mechanism

SETTLED = 0.02  # share of the way to its end within which a curve has settled
WAYS: dict[str, Callable[[Array, Array], Any]] = {  # functions of times and values
    "final": lambda t, x: x[-1],
    "max": lambda t, x: np.max(x),
    "min": lambda t, x: np.min(x),
    "mean": lambda t, x: _mean(t, x),
    "rms": lambda t, x: np.sqrt(_mean(t, np.square(x))),
    "peak": lambda t, x: np.max(np.abs(x)),
    "range": lambda t, x: np.ptp(x),
    "settle": lambda t, x: _settling_time(t, x),
}
OF_CURVE = WAYS | {"integral": lambda t, x: trapezoid(x, t)}
POINTWISE = VALUES | {"smoothstep": smoothstep, "table": interpolated}
BASE = {"1": NONE, "rad": RAD, "m": M, "s": S, "kg": KG, "N": N, "J": J, "Pa": PA}
VECTOR = (".x", ".y", ".z")  # the ends of the columns of a vector


class Curve(NamedTuple):
    """A result function over time."""

    t: Array  # (n,) [s]
    values: Array  # (n,)
    unit: str  # "" where numbers without a unit are factors


class _Value(NamedTuple):
    """A number, or a curve with its times."""

    t: Array | None
    values: Array


class Evaluated:
    """Values and curves of expressions of the columns of a run."""

    mechanism: Mechanism
    t: Array

    def value(self, expression: str, /) -> float:
        """Evaluate an expression of columns that is one number.

        Parameters
        ----------
        expression : str
            Columns have the names of `run[name]`, as in "max(abs(v.knee))". A name that is no
            word stands in quotes: "v.upper arm". Functions of a curve are `final`, `max`, `min`,
            `mean`, `rms`, `peak`, `range`, `settle` and `integral`. `norm(joint_force.knee)` is the
            magnitude of a vector, and `window(x, 1, 2)` is a curve from 1 s to 2 s. Operators and
            other functions are those of expressions in models.

        Returns
        -------
        float
            The value in SI units.

        Raises
        ------
        InputError
            If the text cannot be read, a column is unknown, units do not fit, or the value is
            a curve or not a number.

        Examples
        --------
        >>> import pgraph_core as pg
        >>> run = pg.simulate(pg.Model.serial(2), t_end=1.0)
        >>> run.value("max(energy) - min(energy)") < 1e-6
        True
        """
        found = self._evaluated(expression)
        if found.t is not None:
            text = "is a curve; write max, min, mean, rms, peak, range, final or integral around it"
            raise _refused(f"{shown(expression)} {text}")
        number = float(found.values)
        if not np.isfinite(number):
            raise _refused(f"{shown(expression)} is {number}{self._gap(expression)}")
        return number

    def curve(self, expression: str, /) -> Curve:
        """Evaluate an expression of columns over time.

        Parameters
        ----------
        expression : str
            As in `value`: "norm(joint_force.knee)", or "window(knee - hip, 1, 2)".

        Returns
        -------
        Curve
            `t` [s] and `values`, (n,) each, and `unit`. A number is constant over the run.

        Raises
        ------
        InputError
            If the text cannot be read, a column is unknown, or units do not fit.

        Examples
        --------
        >>> import pgraph_core as pg
        >>> run = pg.simulate(pg.Model.serial(2), t_end=1.0)
        >>> run.curve("2 * kinetic_energy").values.shape == run.t.shape
        True
        """
        found = self._evaluated(expression)
        times = self.t if found.t is None else found.t
        dim = self._dim(expression)
        values = np.broadcast_to(found.values, np.shape(times)).astype(float)
        return Curve(np.asarray(times), values, "" if dim is None else unit(dim))

    def _evaluated(self, text: str) -> _Value:
        """Return the value of an expression whose units fit. Raises InputError."""
        self._dim(text)
        columns = {
            name: [column.values for column in found.values()]
            for name, found in self._columns_in(text).items()
        }
        try:
            return _value(read(text), columns, np.asarray(self.t))
        except Unreadable as error:
            raise _refused(f"{shown(text)}, {error}") from None

    def _dim(self, text: str) -> Dim | None:
        columns = self._columns_in(text)

        def of_column(node: Node) -> Dim | None:
            first, *_ = columns[node.signal[1]].values()  # a vector has one unit
            return _dim_of_unit(first.unit)

        try:
            return dim_of(read(text), of_column)
        except Unreadable as error:
            raise _refused(f"{shown(text)}, {error}") from None

    def _columns_in(self, text: str) -> dict[str, dict[str, Column]]:
        """Return the columns that each name in an expression means. Raises InputError."""
        found: dict[str, dict[str, Column]] = {}
        known = columns_of(self)
        for node in walk(read(text)):
            name = node.signal[1]
            if node.op != "signal" or name in found:
                continue
            names = meant(known, name)
            if not names:
                known = columns_of(self, bodies=True)
                names = meant(known, name)
            if not names:
                raise _refused(f"{shown(text)}, column {node.column}: {no_column(known, name)}")
            found[name] = {one: known[one] for one in names}
            if any(not column.unit for column in found[name].values()):
                raise _refused(f"{shown(text)}, column {node.column}: {name!r} is text")
        _check_sizes(text, read(text), found)
        return found

    def _gap(self, text: str) -> str:
        """Return where a column of an expression is not a number, or ""."""
        for columns in self._columns_in(text).values():
            for name, column in columns.items():
                gaps = np.flatnonzero(~np.isfinite(np.asarray(column.values, float)))
                if len(gaps):
                    return f", because {name} is not a number at t = {self.t[gaps[0]]:.6g} s"
        return ""


def read(text: str) -> Node:
    """Parse an expression of columns. Raises InputError."""
    if not isinstance(text, str):
        raise _refused(f"must be text such as 'max(abs(v.knee))', got {shown(text)}")
    try:
        return parsed_of_columns(text)
    except Unreadable as error:
        raise _refused(f"{shown(text)}, {error}") from None


def _value(node: Node, columns: dict[str, list[Array]], t: Array) -> _Value:
    """Evaluate a tree. Raises Unreadable for windows and arithmetic without a value."""
    if node.op == "number":
        return _Value(None, np.asarray(node.value))
    if node.op == "name":
        return _Value(None, np.asarray(CONSTANTS[node.signal[1]]))
    if node.op == "signal":
        parts = [np.asarray(x, float) for x in columns[node.signal[1]]]
        return _Value(t, parts[0] if len(parts) == 1 else np.sqrt(sum(x * x for x in parts)))
    args = [_value(x, columns, t) for x in node.args]
    if node.op == "window":
        return _window(node, args)
    if node.op in OF_CURVE and len(args) == 1:
        times, values = args[0]
        if times is None:
            raise Unreadable(node.column, f"{node.op} takes a curve, got a number")
        return _Value(None, np.asarray(OF_CURVE[node.op](times, values), float))
    times = None
    for x in args:
        if x.t is not None and times is not None and not np.array_equal(x.t, times):
            text = "curves over different times; write one window around all of them"
            raise Unreadable(node.column, text)
        times = x.t if times is None else times
    values = [x.values for x in args]
    if node.op == "norm":
        return _Value(times, np.sqrt(sum(x * x for x in values)))
    try:
        with np.errstate(invalid="ignore"):  # gaps, which stay gaps
            found = np.vectorize(POINTWISE[node.op], otypes=[float])(*values)
    except (ArithmeticError, ValueError, TypeError) as error:
        raise Unreadable(node.column, f"{node.op} has no value here: {error}") from None
    # min(nan, 1) of Python is nan, min(1, nan) is 1, and a gap in a condition chooses neither
    decisive = values[:1] if node.op == "if" else values
    found = np.where(sum(np.isnan(x) for x in decisive), np.nan, found)
    return _Value(times, found)


def _window(node: Node, args: list[_Value]) -> _Value:
    """Return a curve between two times, at which it is interpolated linearly."""
    (t, values), *ends = args
    if t is None:
        raise Unreadable(node.column, "window takes a curve first, got a number")
    if any(end.t is not None for end in ends):
        raise Unreadable(node.column, "window takes two numbers [s] after the curve, got a curve")
    a, b = (float(end.values) for end in ends)
    if not t[0] <= a < b <= t[-1]:
        text = f"a window is within the run, from {t[0]:.6g} s to {t[-1]:.6g} s, and its second "
        raise Unreadable(node.column, f"{text}time is later; got {a:g} and {b:g}")
    inside = (t > a) & (t < b)
    times = np.concatenate(([a], t[inside], [b]))
    first, last = np.interp([a, b], t, values)
    return _Value(times, np.concatenate(([first], values[inside], [last])))


def _check_sizes(
    text: str, node: Node, found: dict[str, dict[str, Column]], inside: bool = False
) -> None:
    """Refuse a name that means several columns, unless it is a vector in `norm`."""
    for x in node.args:
        _check_sizes(text, x, found, node.op == "norm")
    names = list(found[node.signal[1]]) if node.op == "signal" else []
    vector = tuple(name[-2:] for name in names) == VECTOR
    if len(names) > 1 and not (vector and inside):
        remedy = f"write norm({shown(node.signal[1])}) or " if vector else ""
        reason = f"{node.signal[1]!r} has {len(names)} columns; {remedy}choose one of "
        raise _refused(f"{shown(text)}, column {node.column}: {reason}{choices(names)}")


def _dim_of_unit(text: str) -> Dim | None:
    """Return the dimension of a unit such as "rad/s^2" or "N m", None if it is of several kinds."""
    found = NONE
    for sign, word, power in re.findall(r"([/ ]?)([A-Za-z]+|1)(?:\^(\d+))?", text):
        if word not in BASE or "," in text:
            return None
        one = BASE[word] ** float(power or 1)
        found = found / one if sign == "/" else found * one
    return found


def _mean(t: Array, x: Array) -> float:
    """Return the time average of a piecewise linear curve."""
    return float(trapezoid(x, t) / (t[-1] - t[0])) if t[-1] > t[0] else float(x[-1])


def _settling_time(t: Array, x: Array) -> float:
    """Return the time after which a curve stays near its last value, between frames too [s].

    It is nan for a curve with a gap, where the curve may be away from that value.
    """
    if np.isnan(x).any():
        return np.nan
    band = SETTLED * abs(x[-1] - x[0])
    away = np.abs(x - x[-1]) - band
    outside = np.flatnonzero(away > 0.0)
    if not len(outside):
        return 0.0
    i = outside[-1]
    share = away[i] / (away[i] - away[i + 1]) if away[i] > away[i + 1] else 1.0
    return float(t[i] + share * (t[i + 1] - t[i]) - t[0])


def _refused(text: str) -> InputError:
    return InputError(Problem("run", "expression", text))
