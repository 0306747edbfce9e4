"""Conditions that switches of a scenario wait for: names, those that are no use, renames."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

from .. import joints
from ..errors import Problem, choices
from .body import Body
from .constraint import Constraint
from .scenario import Scenario, Switch

Bodies = Mapping[str, Body | None]  # None: a body that is refused
Known = Mapping[str, Sequence[str]]  # what a condition watches -> the names there are


def coordinates(bodies: Bodies) -> dict[str, tuple[str, int]]:
    """What a condition calls a coordinate -> (body, its number): 'a', or 'a 1' where a has several.

    Balls and free joints have none: their positions are quaternions.
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


def known_names(bodies: Bodies, constraints: Sequence[str], contacts: Sequence[str]) -> Known:
    """What conditions may name."""
    return {
        "coordinate": list(coordinates(bodies)),
        "gap": list(contacts),
        "force": [*contacts, *constraints],
        "constraint": list(constraints),
    }


def condition_problems(
    scenarios: Sequence[Scenario], bodies: Bodies, constraints: Sequence[Constraint], known: Known
) -> list[Problem]:
    """Conditions that name what is not there, that never hold, or that switch without end."""
    found = []
    refused = any(body is None for body in bodies.values())
    for s in scenarios:
        if not any(switch.when for switch in s.switches):
            continue
        listed = s.constraints
        on = {c.name for c in constraints if (c.active if listed is None else c.name in listed)}
        for switch in s.switches:
            text = _unknown(switch, known, refused) or _never(switch, s.switches, on, bodies, known)
            if text:
                found.append(Problem(f"scenario '{s.name}'", "switches", text))
        if text := _endless(s.switches):
            found.append(Problem(f"scenario '{s.name}'", "switches", text))
    return found


def _unknown(switch: Switch, known: Known, refused: bool) -> str:
    if switch.when is None:
        return ""
    what, name = switch.when.subject
    if name in known[what] or (refused and what == "coordinate"):
        return ""
    there = known[what]
    do = f"choose one of {choices(there)}" if there else f"the model has no {what} to wait for"
    return f"of '{switch.constraint}': no {what} is called '{name}'; {do}"


def _never(
    switch: Switch, others: Sequence[Switch], on: set[str], bodies: Bodies, known: Known
) -> str:
    """Why the condition of a switch cannot become true; "" where it may."""
    when = switch.when
    if when is None:
        return ""
    what, name = when.subject
    of = f"of '{switch.constraint}': '{when}' never holds: "

    def becomes(active: bool) -> bool:
        switched = any(s.constraint == name and s.active == active for s in others)
        return switched or (name in on) == active

    if name == switch.constraint and what == "constraint":
        return f"of '{name}': it waits for itself; name another constraint"
    if name == switch.constraint and switch.active and what == "force":
        return f"of '{name}': it waits for its own force, which is 0 while it is off"
    if what == "constraint" and when.active is not None and not becomes(when.active):
        return of + f"nothing switches '{name}' {'on' if when.active else 'off'}"
    if what == "force" and when.below is not None and when.below <= 0:
        return of + "a force is a size, which is not below 0; give a value above 0"
    held = what == "force" and name in known["constraint"]
    if held and when.above is not None and when.above >= 0 and not becomes(True):
        return of + f"'{name}' is off throughout"
    return of + text if what == "coordinate" and (text := _beyond(switch, bodies)) else ""


def _beyond(switch: Switch, bodies: Bodies) -> str:
    """Which joint limit keeps a coordinate from crossing its value; "" where none does."""
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
    """Which constraints switch each other on and off at one instant, without end."""
    after = {
        (s.constraint, s.active): [
            (o.constraint, o.active) for o in switches
            if o.when is not None and (o.when.constraint, o.when.active) == (s.constraint, s.active)
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


# -- edits ---------------------------------------------------------------------------------------


def followed(
    switches: Sequence[Switch], whats: Sequence[str], called: Callable[[str], str | None]
) -> tuple[Switch, ...]:
    """The switches with new names in their conditions; those whose name is None go."""
    found = []
    for s in switches:
        if s.when is not None and s.when.subject[0] in whats:
            what, name = s.when.subject
            new = called(name)
            if new is None:
                continue
            if new != name:
                s = s.model_copy(update={"when": s.when.model_copy(update={what: new})})
        found.append(s)
    return tuple(found)


def of_bodies(names: Mapping[str, str | None]) -> Callable[[str], str | None]:
    """New names of coordinates where bodies are renamed, or go."""

    def called(name: str) -> str | None:
        body, _, k = name.rpartition(" ")
        if name in names:
            return names[name]
        if body in names and k.isdigit():
            return f"{names[body]} {k}" if names[body] is not None else None
        return name

    return called
