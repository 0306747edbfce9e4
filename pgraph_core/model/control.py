"""Controls: user-defined states, filters, PID and sampled controllers.

A control has states and a value, which expressions name `x.NAME`. A state changes at a rate, or
jumps to a new value at its samples; both are expressions. The kinds differ in these alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Literal, Self

from pydantic import model_validator

from ..errors import shown
from ..fields import Expression, Number, OfKinds, Text, field, listed, refuse
from ..signals import Node, filled
from ..stateful import Own, Stateful
from ..units import S

VERSION = 7  # schema version of files that have controls
KIND = "the name of a kind of control"


varying: Callable[[float | str], Number | Expression] = listed


class Control(Stateful, OfKinds):
    """A control, whose value is available in expressions as `x.NAME`.

    Its first and second state are available as `x.NAME[1]` and `x.NAME[2]`.
    """

    KINDS: ClassVar[dict[str, type[OfKinds]]] = {}
    WORD: ClassVar[str] = "control"
    SINCE: ClassVar[int] = VERSION
    READS: ClassVar[str]  # the field that reads a signal

    name: Text = field("a non-empty string", label="Name")
    kind: Text = field(KIND, label="Kind")

    @property
    def touches(self) -> tuple[str, ...]:
        """An empty tuple, because controls are not attached to bodies."""
        return ()

    @property
    def value(self) -> Node:
        """The value, as an expression of the states and the inputs of the control."""
        return self._state(0)


class State(Control):
    """A state with a given `rate`, integrated with the motion."""

    ABOUT: ClassVar[str] = "a state whose rate you give"
    READS: ClassVar[str] = "rate"

    kind: Literal["state"] = field(KIND, default="state")
    rate: Number | Expression = field(
        "a number or an expression [1/s]", converter=varying,
        help="rate, such as =1 - q.arm, =-x.heat/30",
    )  # fmt: skip
    start: Number = field("a number", default=0.0, since=VERSION, help="initial value")

    @property
    def own(self) -> tuple[Own, ...]:
        return (Own(self._read("rate"), self._number("start")),)


class Filter(Control):
    """A first-order filter, lag x' = input - x."""

    ABOUT: ClassVar[str] = "a first-order filter (lag) of a signal"
    READS: ClassVar[str] = "input"
    NEW: ClassVar[Mapping[str, Any]] = {"lag": 0.1}

    kind: Literal["filter"] = field(KIND, default="filter")
    input: Number | Expression = field(
        "a number or an expression", converter=varying, help="filtered signal, such as =v.arm"
    )
    lag: Number = field("a time > 0 [s]", gt=0, dim=S, help="time constant")
    start: Number | None = field(
        "a number, or None: its input at the start", default=None, since=VERSION,
        help="initial value; default: the initial input",
    )  # fmt: skip

    @property
    def own(self) -> tuple[Own, ...]:
        given, lag = self._read("input"), self._number("lag")
        rate = filled("(given - x)/lag", given=given, x=self._state(0), lag=lag)
        return (Own(rate, given if self.start is None else self._number("start")),)


class PID(Control):
    """A PID controller of a signal, with limits, a filtered derivative and anti-windup.

    The value is kp e + I + D, limited to the range from `low` to `high`, with the error e =
    setpoint - signal and I' = ki e. D is the filtered derivative kd s/(filter s + 1) of e, which is
    initially 0. `filter` has no default, and kd/(10 kp) is common. There are two anti-windup
    methods for controllers with limits [Astrom, Hagglund 2006, 3.5]. With "clamp", I is limited to
    the same range, and with "back", (value - kp e - I - D)/tracking is added to I'. If `sample` is
    given, the value is only updated at samples, using the forward Euler rule for I and the backward
    Euler rule for D. The states are I and the filtered error.
    """

    ABOUT: ClassVar[str] = "a PID controller of a signal, with limits and anti-windup"
    READS: ClassVar[str] = "signal"

    kind: Literal["pid"] = field(KIND, default="pid")
    signal: Number | Expression = field(
        "the signal to control, an expression such as '=q.arm'",
        converter=varying,
        help="controlled signal, such as =q.arm",
    )
    setpoint: Number | Expression = field(
        "a number or an expression", converter=varying, default=0.0, since=VERSION,
        help="desired value of the signal",
    )  # fmt: skip
    kp: Number = field("a number", default=0.0, since=VERSION, label="kp", help="proportional gain")
    ki: Number = field("a number", default=0.0, since=VERSION, label="ki", help="integral gain")
    kd: Number = field("a number", default=0.0, since=VERSION, label="kd", help="derivative gain")
    filter: Number | None = field(
        "a time > 0 [s], which kd needs", default=None, gt=0, dim=S, since=VERSION,
        help="time constant of the derivative filter",
    )  # fmt: skip
    low: Number | None = field(
        "a number, or None", default=None, since=VERSION, help="lower bound of the value"
    )
    high: Number | None = field(
        "a number, or None", default=None, since=VERSION, help="upper bound of the value"
    )
    windup: Literal["clamp", "back", "none"] = field(
        "one of clamp, back, none", default="clamp", since=VERSION, label="Anti-windup",
        help="anti-windup method",
    )  # fmt: skip
    tracking: Number | None = field(
        "a time > 0 [s], for windup 'back'", default=None, gt=0, dim=S, since=VERSION,
        help="tracking time constant of back-calculation",
    )  # fmt: skip
    start: Number = field(
        "a number", default=0.0, since=VERSION, help="initial value of the integral"
    )
    sample: Number | None = field(
        "a time > 0 [s], or None: it acts at all times", default=None, gt=0, dim=S,
        since=VERSION, help="sample time; default: continuous",
    )  # fmt: skip

    @model_validator(mode="before")
    @classmethod
    def _of_joint(cls, data: Any) -> Any:
        """Refuse a joint, with the servo that acts on one."""
        for name in {"joint", "body"} & {*data}:
            joint = data[name]
            gains = "".join(f", {k}={data[k]!r}" for k in ("kp", "kd") if data.get(k))
            target = data.get("setpoint", 0.0)
            servo = f"pg.Servo(body={joint!r}{gains}, target={target!r}"
            text = f"a PID has a value and acts on no joint; forces=[{servo})] does"
            if data.get("ki"):
                pid = f"pg.PID('i', signal='=q.{joint}', setpoint={target!r}, ki={data['ki']!r})"
                text += f", with an integral controls=[{pid}], forces=[{servo}, torque='=x.i')]"
            refuse([(name, text)])
        return data

    @classmethod
    def _followers(cls) -> Mapping[str, tuple[str, ...]]:
        moot = (*cls.model_fields, "joint", "body", "target")
        return {**super()._followers(), "joint": moot, "body": moot}

    @model_validator(mode="after")
    def _possible(self) -> Self:
        found = []
        if self.kd and self.filter is None:
            usual = f", such as kd/(10 kp) = {self.kd / (10 * self.kp):.3g}" if self.kp else ""
            text = f"kd needs the time constant of a filter [s]{usual}, got none"
            found.append(("filter", text))
        if self.windup == "back" and self.tracking is None:
            found.append(("tracking", "windup 'back' needs a time > 0 [s], got none"))
        low, high = self.low, self.high
        if low is not None and high is not None and low >= high:
            found.append(("low", f"must be below high, {shown(high)}, got {shown(low)}"))
        refuse(found)
        return self

    @property
    def value(self) -> Node:
        return self._state(1 + bool(self.kd)) if self.sample else self._within(self._sum())

    @property
    def own(self) -> tuple[Own, ...]:
        e, i, d = self._error(), self._state(0), self._state(1)
        rate, lag, start = self._integral(), self._lag(), self._number("start")
        if not self.sample:
            slope = filled("(e - d)/lag", e=e, d=d, lag=lag)
            return (Own(rate, start), Own(slope, e))[: 1 + bool(self.kd)]
        h = self._number("sample")
        whole = filled("i + h*rate", i=i, h=h, rate=rate)
        whole = self._within(whole) if self.windup == "clamp" else whole
        follows = filled("d + h*(e - d)/lag", d=d, e=e, h=h, lag=lag)
        found = Own(whole, start, self.sample), Own(follows, e, self.sample)
        held = Own(self._within(self._sum()), Node("number"), self.sample)
        return *found[: 1 + bool(self.kd)], held

    def _lag(self) -> Node:
        """Return the time over which the derivative is taken."""
        lag = self._number("filter")
        return filled("T + h", T=lag, h=self._number("sample")) if self.sample else lag

    def _error(self) -> Node:
        return filled("w - y", w=self._read("setpoint"), y=self._read("signal"))

    def _sum(self) -> Node:
        """Return the value without limits."""
        e, i, kp = self._error(), self._state(0), self._number("kp")
        found = filled("kp*e + i", kp=kp, e=e, i=i)
        if self.kd:
            kd, d, lag = self._number("kd"), self._state(1), self._lag()
            found = filled("u + kd*(e - d)/lag", u=found, kd=kd, e=e, d=d, lag=lag)
        return found

    def _within(self, x: Node) -> Node:
        for name, text in (("low", "max(x, end)"), ("high", "min(x, end)")):
            x = filled(text, x=x, end=self._number(name)) if name in self._ends else x
        return x

    @property
    def _ends(self) -> list[str]:
        return [name for name in ("low", "high") if getattr(self, name) is not None]

    def _integral(self) -> Node:
        """Return the rate of the integral."""
        rate, i = filled("ki*e", ki=self._number("ki"), e=self._error()), self._state(0)
        if self.windup == "back" and self._ends:
            free, t = self._sum(), self._number("tracking")
            return filled("rate + (u - free)/t", rate=rate, u=self._within(free), free=free, t=t)
        if self.windup == "clamp" and not self.sample:
            bounds = {
                "low": "if(i > end, rate, max(rate, 0))",
                "high": "if(i < end, rate, min(rate, 0))",
            }
            for name in self._ends:
                rate = filled(bounds[name], i=i, rate=rate, end=self._number(name))
        return rate


class Sampled(Control):
    """A value that is set to `update` at every multiple of `sample`, and constant in between.

    In `update`, x.NAME refers to the previous value. If a run starts at a multiple of `sample`, the
    first sample is taken immediately. Samples that are taken at the same time all use the previous
    values.
    """

    ABOUT: ClassVar[str] = "a value computed at samples and held in between"
    READS: ClassVar[str] = "update"
    NEW: ClassVar[Mapping[str, Any]] = {"sample": 0.01}

    kind: Literal["sampled"] = field(KIND, default="sampled")
    update: Number | Expression = field(
        "a number or an expression", converter=varying,
        help="new value at each sample, such as =-8*q.arm or =x.count + 1",
    )  # fmt: skip
    sample: Number = field("a time > 0 [s]", gt=0, dim=S, help="sample time")
    start: Number = field(
        "a number", default=0.0, since=VERSION, help="value before the first sample"
    )

    @property
    def own(self) -> tuple[Own, ...]:
        return (Own(self._read("update"), self._number("start"), self.sample),)
