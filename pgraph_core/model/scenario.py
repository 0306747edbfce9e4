"""A named run of a model, with initial state, actuation, active parts, duration and method."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Annotated, Any, ClassVar, Self

from pydantic import BeforeValidator, Field, model_validator

from .. import joints
from ..errors import Problem, choices, shown
from ..fields import (
    EMPTY,
    ByName,
    Described,
    Expression,
    Flag,
    Frozen,
    Number,
    Numbers,
    Text,
    by_name,
    field,
    listed,
    maybe_part_of,
    names_or_none,
    parts_of,
    refuse,
)
from ..forces import Force
from ..pulleys import most_segments, without_segment
from ..signals import parsed
from ..signals.meaning import compares
from ..units import S
from .body import Body
from .constraint import Constraint
from .expressions import TENSE, without_force
from .settings import ADAPTIVE, AUTO, OF, Settings, no_tolerance

Positive = Annotated[Number, Field(gt=0)]
AtLeast0 = Annotated[Number, Field(ge=0)]
Pair = Annotated[tuple[AtLeast0, AtLeast0], BeforeValidator(listed)]
HARMONICS = 4  # number of harmonics of a wave


class Footfall(Frozen):
    """The fraction of a stride during which a foot is on the ground."""

    foot: Text = Field(description="the name of a contact that is one point of a paw")
    offset: Annotated[Number, Field(ge=0, lt=1)] = Field(
        description="a number from 0 to below 1: the part of the stride at which it touches down"
    )
    duty: Annotated[Number, Field(gt=0, le=1)] = Field(
        description="a number above 0, at most 1: the fraction of the stride on the ground"
    )
    ahead: Number = Field(
        default=0.0, description="a finite number: how far ahead of its home position it lands [m]"
    )


class Gains(Frozen):
    """Gains for virtual springs and dampers on trunk and legs, as accelerations per unit error."""

    speed: AtLeast0 = Field(default=8.0, description="a number >= 0 [1/s]")
    drift: AtLeast0 = Field(default=5.0, description="a number >= 0 [1/s]")
    sway: AtLeast0 = Field(default=0.0, description="a number >= 0 [1/s^2]")
    surge: AtLeast0 = Field(default=0.0, description="a number >= 0 [1/s^2]")
    height: Pair = Field(default=(150.0, 20.0), description="two numbers >= 0 [1/s^2, 1/s]")
    roll: Pair = Field(default=(120.0, 40.0), description="two numbers >= 0 [1/s^2, 1/s]")
    pitch: Pair = Field(default=(150.0, 25.0), description="two numbers >= 0 [1/s^2, 1/s]")
    yaw: Pair = Field(default=(60.0, 12.0), description="two numbers >= 0 [1/s^2, 1/s]")
    swing: Pair = Field(default=(1600.0, 80.0), description="two numbers >= 0 [1/s^2, 1/s]")
    spine: Pair = Field(default=(400.0, 18.0), description="two numbers >= 0 [1/s^2, 1/s]")
    paw: Pair = Field(default=(400.0, 40.0), description="two numbers >= 0 [1/s^2, 1/s]")
    place: Number = Field(default=0.03, description="change of the step per error of speed [s]")
    place_drift: Number = Field(
        default=0.15, description="change of the step per error of sideways speed [s]"
    )
    place_roll: Number = Field(
        default=-0.08, description="change of the step per angle of roll [m/rad]"
    )
    tight_torque: Positive = Field(default=15.0, description="a number > 0: weight of its torque")
    tight_force: Positive = Field(default=5.0, description="a number > 0: weight of its force")


class Gait(Described):
    """A quadruped gait.

    Waves are (a1, b1, a2, b2, ...): Σ a cos 2πk p + b sin 2πk p at the fraction p of a stride.
    """

    name: Text = Field(description="a non-empty string")
    description: Text = Field(default="", description="a sentence")
    feet: tuple[Footfall, ...] = Field(
        description="a list of {'foot': contact, 'offset': 0 to 1, 'duty': 0 to 1}"
    )
    stride: Positive = Field(default=0.4, description="the time of a stride > 0 [s]")
    speed: Number = Field(default=0.5, description="a finite number: forward speed [m/s]")
    acceleration: Positive = Field(
        default=0.5, description="a number > 0: how fast its speed may change [m/s^2]"
    )
    drift: Number = Field(default=0.0, description="a finite number: speed to the right [m/s]")
    turn: Number = Field(default=0.0, description="a finite number: turning to the left [rad/s]")
    height: Positive = Field(
        default=0.5, description="a height > 0 of the centre of mass over the ground [m]"
    )
    width: Number = Field(
        default=0.0,
        description="a finite number: distance outside the hip at which a foot lands [m]",
    )
    clearance: AtLeast0 = Field(default=0.06, description="a height >= 0 of a swinging foot [m]")
    landing: AtLeast0 = Field(
        default=0.2, description="a speed >= 0 of a foot down at its end [m/s]"
    )
    loading: Annotated[Number, Field(gt=0, le=0.5)] = Field(
        default=0.1,
        description="above 0, at most 0.5: the fraction of a stance in which its load builds up",
    )
    push: Positive = Field(default=1.0, description="a number > 0: a factor on the planned loads")
    rise: Number = Field(
        default=0.0,
        description="a number: fraction of the height change by these loads that the trunk follows",
    )
    nod: Number = Field(
        default=0.0,
        description="a number: fraction of the pitching by these loads that the trunk follows",
    )
    sway: Numbers = Field(default=(), description="a wave of up to 8 numbers, to the side [m]")
    surge: Numbers = Field(default=(), description="a wave of up to 8 numbers, forward [m]")
    flexion: Numbers = Field(
        default=(), description="a wave of up to 8 numbers, of the spine [rad]"
    )
    grip: Positive = Field(
        default=0.55, description="a number > 0: friction coefficient that planned forces may use"
    )
    least: AtLeast0 = Field(default=5.0, description="a number >= 0: the least load of a foot [N]")
    leg_torque: Positive = Field(
        default=150.0, description="a number > 0: a leg hinge's limit [N m]"
    )
    spine_torque: Positive = Field(default=200.0, description="a number > 0: a spine hinge's [N m]")
    gains: Gains = Field(default=Gains(), description="an object of gains")

    @model_validator(mode="after")
    def _possible(self) -> Self:
        found = []
        names = [fall.foot for fall in self.feet]
        if len(names) != 4:
            text = f"must be four, got {shown(names)}"
            found.append(("feet", text))
        found += [
            ("feet", f"'{name}' appears twice") for i, name in enumerate(names) if name in names[:i]
        ]
        for wave in ("sway", "surge", "flexion"):
            given = getattr(self, wave)
            if len(given) > 2 * HARMONICS or len(given) % 2:
                text = f"must be pairs of numbers, {HARMONICS} at most, got {shown(given)}"
                found.append((wave, text))
        refuse(found)
        return self

    def edit(self, /, **changes: Any) -> Self:
        """Return a new gait with changed fields.

        Parameters
        ----------
        **changes
            New values by name of field.

        Raises
        ------
        ModelError
            If a field does not exist or a value is not permitted.
        """
        return type(self)(**{**self.model_dump(), **changes})


# -- scenarios -------------------------------------------------------------------------------------


SUBJECTS = ("coordinate", "gap", "force", "constraint", "holds")


class When(Frozen):
    """A condition on the state, given by a coordinate, gap, force or constraint and its bound.

    Alternatively, `holds` is a comparison of expressions, such as "=q.arm > 0.5 and v.arm < 0".
    """

    coordinate: Text | None = field(
        "the name of a body, with a number if it has several: 'a 1'", default=None
    )
    gap: Text | None = field("the name of a contact, whose smallest gap counts [m]", default=None)
    force: Text | None = field(
        "the name of a contact or constraint, whose force counts, or of a spring, strut, cable or "
        "rope, whose tension does, as 'rope[2]' of one with several segments [N]",
        default=None,
    )
    constraint: Text | None = field("the name of a constraint", default=None)
    above: Number | None = field("a number", default=None)
    below: Number | None = field("a number", default=None)
    active: Flag | None = field("true or false, with constraint", default=None)
    holds: Expression | None = field("a comparison, '=q.arm > 0.5 and v.arm < 0'", default=None)
    after: Number | None = field(
        "a time > 0 [s] that the constraint has been so", default=None, gt=0
    )
    once: Flag | None = field("true: the first time only", default=None)

    @property
    def subject(self) -> tuple[str, str]:
        """The kind of quantity being monitored, and its name."""
        return next((what, getattr(self, what)) for what in SUBJECTS if getattr(self, what))

    def __str__(self) -> str:
        what, name = self.subject
        if self.holds is not None:
            return self.holds.removeprefix("=").strip()
        if self.active is not None:
            since = f" for {self.after:g} s" if self.after else ""
            return f"constraint {name} {'active' if self.active else 'inactive'}{since}"
        bound = f"above {self.above:g}" if self.above is not None else f"below {self.below:g}"
        return f"{what} of {name} {bound}"

    @model_validator(mode="after")
    def _one_of_each(self) -> Self:
        given = [what for what in SUBJECTS if getattr(self, what) is not None]
        bounds = [b for b in ("above", "below", "active") if getattr(self, b) is not None]
        if len(given) != 1:
            named = " and ".join(given) or "none"
            refuse([("when", f"name one of {choices(SUBJECTS)}, got {named}")])
        if self.after is not None and given != ["constraint"]:
            refuse([("when", "`after` needs a constraint, whose state it waits for")])
        if self.holds is not None:
            text = "" if compares(parsed(self.holds)) else "holds must compare, as in q.arm > 0.5"
            refuse([("when", text)] if text else [])
            refuse([("when", f"holds needs no {' and '.join(bounds)}")] if bounds else [])
            return self
        wanted = ("active",) if given == ["constraint"] else ("above", "below")
        if len(bounds) != 1 or bounds[0] not in wanted:
            text = f"a {given[0]} needs {' or '.join(wanted)}, got "
            refuse([("when", text + (" and ".join(bounds) or "neither"))])
        return self


class Switch(Frozen):
    """A constraint switched on or off during a run, at a given time or on a condition."""

    FOLLOWERS: ClassVar[Mapping[str, tuple[str, ...]]] = {"when": ("t",)}

    t: Annotated[Number, Field(ge=0)] | None = Field(default=None, description="a time >= 0 [s]")
    constraint: Text = Field(description="the name of a constraint")
    active: Flag = Field(description="true or false")
    when: When | None = field(
        "in place of t a condition: {'coordinate', 'gap', 'force' or 'constraint': name, 'above', "
        "'below': value or 'active': bool}, or {'holds': '=q.arm > 0.5 and v.arm < 0'}; also "
        "'after': seconds, with a constraint, and 'once': true for the first time only",
        converter=maybe_part_of(When), default=None,
    )  # fmt: skip

    @model_validator(mode="after")
    def _time_or_condition(self) -> Self:
        if (self.t is None) == (self.when is None):
            refuse([("t", f"give t or when, {'not both' if self.when else 'one of them'}")])
        return self


class Setup(Described):
    """The name, start and parts of a scenario, which also has the settings of a run."""

    name: Text = Field(description="a non-empty string")
    description: Text = Field(default="", description="a sentence")
    q: ByName = field("body name -> initial q", converter=by_name, default=EMPTY)
    v: ByName = field(
        "body name -> initial v, of a free joint [angular, linear]", converter=by_name,
        default=EMPTY,
    )  # fmt: skip
    forces: tuple[Force, ...] = field(
        "a list of additional forces", converter=parts_of(Force), default=()
    )
    constraints: tuple[str, ...] | None = field(
        "names of the active constraints; default: as in the model",
        converter=names_or_none, default=None,
    )  # fmt: skip
    switches: tuple[Switch, ...] = field(
        "constraints switched on or off during the run, {t or when, constraint, active}",
        converter=parts_of(Switch), default=(),
    )  # fmt: skip
    contacts: tuple[str, ...] | None = field(
        "names of the active contacts; default: as in the model",
        converter=names_or_none, default=None,
    )  # fmt: skip
    gait: Gait | None = field(
        "a gait that drives the joints, or None: {'name': ...}",
        converter=maybe_part_of(Gait), default=None,
    )  # fmt: skip


class Scenario(Settings, Setup):
    """Named run settings for `simulate(mech, scenario=name)`."""

    t_end: Annotated[Number, OF["t_end"]] = 1.0
    step: Number | None = field(
        "a finite number > 0 [s]", default=None, gt=0, dim=S,
        help="size of fixed steps, which adaptive methods ignore; with rtol their largest step",
    )  # fmt: skip
    method: Annotated[Text, OF["method"]] = AUTO

    @model_validator(mode="after")
    def _stepped(self) -> Self:
        if self.rtol is not None and self.method not in (AUTO, *ADAPTIVE):
            refuse([("rtol", no_tolerance(self.method))])
        return self


# -- conditions ------------------------------------------------------------------------------------


Bodies = Mapping[str, Body | None]  # None: a body that is refused
Known = Mapping[str, Sequence[str]]  # monitored quantity of a condition -> available names


def coordinates(bodies: Bodies) -> dict[str, tuple[str, int]]:
    """Return {name in conditions: (body, number)} for coordinates, as "a", or "a 1" if a has
    several.

    Balls and free joints have none, since their positions are quaternions.
    """
    found = {}
    for name, body in bodies.items():
        if body is None:
            continue
        nq, nv = joints.nq(body.sequence), joints.nv(body.sequence)
        if nq == 1:
            found[name] = name, 0
        elif nq == nv:
            found |= {f"{name} {k}": (name, k) for k in range(nq)}
    return found


def known_names(
    bodies: Bodies, constraints: Sequence[str], contacts: Sequence[str], forces: Sequence[Force]
) -> Known:
    """Return the names that conditions may use."""
    return {
        "coordinate": list(coordinates(bodies)),
        "gap": list(contacts),
        "force": [*contacts, *constraints, *(f.name for f in forces if isinstance(f, TENSE))],
        "constraint": list(constraints),
    }


def condition_problems(
    scenarios: Sequence[Scenario],
    bodies: Bodies,
    constraints: Sequence[Constraint],
    forces: Sequence[Force],
    model: Known,
) -> list[Problem]:
    """Return problems with conditions: unknown names, never met, or endless switching.

    `model` contains the names without those of forces that a scenario adds.
    """
    found = []
    refused = any(body is None for body in bodies.values())
    for s in scenarios:
        if not any(switch.when for switch in s.switches):
            continue
        own = {f.name for f in s.forces if isinstance(f, TENSE)} - {f.name for f in forces}
        known = {**model, "force": [*model["force"], *own]}
        strung = [*forces, *s.forces, *constraints]
        listed = s.constraints
        on = {c.name for c in constraints if (c.active if listed is None else c.name in listed)}
        for switch in s.switches:
            text = _unknown(switch, known, refused) or forceless(switch, constraints, bodies)
            text = text or _beside_segments(switch, strung, known)
            text = text or _never(switch, s.switches, on, bodies, known)
            if text:
                found.append(Problem(f"scenario '{s.name}'", "switches", text))
        if text := _endless(s.switches):
            found.append(Problem(f"scenario '{s.name}'", "switches", text))
    return found


def _unknown(switch: Switch, known: Known, refused: bool) -> str:
    if switch.when is None:
        return ""
    what, name = switch.when.subject
    if what == "holds":
        return ""  # its names are checked with those of other expressions
    if what == "force":
        name, _ = without_segment(name, known[what])
    if what == "force" and known[what].count(name) > 1:
        kinds = {"contact": "gap", "constraint": "constraint"}
        of = [word for word, key in kinds.items() if name in known[key]]
        of += ["force"] * (known[what].count(name) > len(of))
        text = f"a {' and a '.join(of)} are both '{name}'; rename one"
        return f"of '{switch.constraint}': {text}"
    if name in known[what] or (refused and what == "coordinate"):
        return ""
    there = known[what]
    do = f"choose one of {choices(there)}" if there else f"the model has no {what} to wait for"
    return f"of '{switch.constraint}': no {what} is called '{name}'; {do}"


def _beside_segments(switch: Switch, parts: Sequence[Any], known: Known) -> str:
    """Return the reason why a condition names a segment that no cable or rope has, or ""."""
    given = (switch.when and switch.when.force) or ""
    name, k = without_segment(given, known["force"])
    most = max((most_segments(x) for x in parts if x.name == name), default=1)
    if not k or (1 < most >= k):
        return ""
    text = f"'{name}' has at most {most} segments" if most > 1 else f"'{name}' has no segments"
    do = f"write '{name}[1]' for the first one" if most > 1 else f"write '{name}'"
    return f"of '{switch.constraint}': {text}, got '{given}'; {do}"


def forceless(switch: Switch, constraints: Sequence[Constraint], bodies: Bodies) -> str:
    """Return the reason why a condition on the force of a constraint reads nothing, or ""."""
    name = switch.when.force if switch.when is not None else None
    found = [c for c in constraints if c.name == name and not c.pulls(bodies)]
    return f"of '{switch.constraint}': {without_force(found[0])}" if found else ""


def _never(
    switch: Switch, others: Sequence[Switch], on: set[str], bodies: Bodies, known: Known
) -> str:
    """Return the reason why a switch condition can never become true, or ""."""
    when = switch.when
    if when is None:
        return ""
    what, name = when.subject
    if what == "force":
        name, _ = without_segment(name, known["force"])
    of = f"of '{switch.constraint}': '{when}' never holds: "

    def becomes(active: bool) -> bool:
        switched = any(s.constraint == name and s.active == active for s in others)
        return switched or (name in on) == active

    if name == switch.constraint and what == "constraint" and not when.after:
        return f"of '{name}': it waits for itself; name another constraint"
    if name == switch.constraint and switch.active and what == "force":
        return f"of '{name}': it waits for its own force, which is 0 while it is off"
    if what == "constraint" and when.active is not None and not becomes(when.active):
        return of + f"nothing switches '{name}' {'on' if when.active else 'off'}"
    touches = what == "force" and (name in known["constraint"] or name in known["gap"])
    if touches and when.below is not None and when.below <= 0:
        return of + "a force is a magnitude, which is never negative; give a value above 0"
    held = what == "force" and name in known["constraint"]
    if held and when.above is not None and when.above >= 0 and not becomes(True):
        return of + f"'{name}' is off throughout"
    return of + text if what == "coordinate" and (text := _beyond(switch, bodies)) else ""


def _beyond(switch: Switch, bodies: Bodies) -> str:
    """Return the joint limit that prevents a coordinate from crossing its value, or ""."""
    when = switch.when
    assert when is not None
    name, k = coordinates(bodies).get(when.coordinate or "", ("", 0))
    body = bodies.get(name)
    limit = body.limits[k] if body is not None and k < len(body.limits) else None
    low, high = limit or (None, None)
    if when.above is not None and high is not None and when.above >= high:
        return f"the joint limit of '{name}' is at {high:g}; give a value below it"
    if when.below is not None and low is not None and when.below <= low:
        return f"the joint limit of '{name}' is at {low:g}; give a value above it"
    return ""


def _endless(switches: Sequence[Switch]) -> str:
    """Yield constraints that switch each other on and off endlessly at the same instant."""
    after = {
        (s.constraint, s.active): [
            (o.constraint, o.active) for o in switches
            if o.when is not None and not o.when.after
            and (o.when.constraint, o.when.active) == (s.constraint, s.active)
        ]
        for s in switches
    }  # fmt: skip

    def reached(start: tuple[str, bool]) -> Iterator[tuple[str, bool]]:
        left, seen = list(after[start]), set()
        while left:
            if (one := left.pop()) not in seen:
                seen.add(one)
                left += after[one]
                yield one

    for name, active in after:
        opposite = (name, not active)
        if opposite in reached((name, active)) and (name, active) in reached(opposite):
            return (
                f"'{name}' is switched on and off without end: its conditions wait for each other"
            )
    return ""


# -- edits -----------------------------------------------------------------------------------------


def followed(
    switches: Sequence[Switch], whats: Sequence[str], called: Callable[[str], str | None]
) -> tuple[Switch, ...]:
    """Rename the objects in switch conditions, dropping those whose name becomes None."""
    found = []
    for s in switches:
        if s.when is not None and s.when.subject[0] in whats:
            what, name = s.when.subject
            new = called(name)
            if new is None:
                continue
            if new != name:
                s = s.unchecked_copy({"when": s.when.unchecked_copy({what: new})})
        found.append(s)
    return tuple(found)


def of_bodies(names: Mapping[str, str | None]) -> Callable[[str], str | None]:
    """Return a function that maps coordinate names after bodies are renamed or removed."""

    def called(name: str) -> str | None:
        body, _, k = name.rpartition(" ")
        if name in names:
            return names[name]
        if body in names and k.isdigit():
            return f"{names[body]} {k}" if names[body] is not None else None
        return name

    return called
