"""Edits to the parts of a model. Each edit creates new parts."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeVar

from .. import joints, words
from ..errors import ModelError, Problem, nearest
from ..fields import Described, Frozen, OfKinds, OfSums, fields_of, listed
from ..forces import BetweenPoints, Force, OnJoint, Tendon
from ..pulleys import without_segment
from ..rotation import multiply, rotate
from ..signals import signals_in, with_names
from ..stateful import Stateful
from .beam import Beam
from .body import JOINT_FIELDS, Body
from .checks import fits_joint, output_problems, state_problems
from .constraint import Constraint
from .contact import Contact
from .control import Control
from .expressions import TENSE, controls_read, drives_read, named_in, read_by, renamed_in
from .force_checks import coordinate_problem, force_problems
from .output import OF_JOINT, Output, Site
from .part_checks import sum_problems
from .scenario import Scenario, coordinates, followed, of_bodies

NAMING = ("parent", "body", "other", "at")  # fields that name bodies
T = TypeVar("T", bound=Frozen)
Standing = TypeVar("Standing", Body, Beam)  # parts that hang on a parent


def edited(old: Body, changes: Mapping[str, Any]) -> tuple[Body, list[str]]:
    """Return the body with changed fields, and notices of additional changes. Raises ModelError."""
    known = (*Body.model_fields, "dof")
    changes = words.renamed(changes, known) or changes
    for key in changes:
        if key not in known:
            raise ModelError(
                Problem(f"body '{old.name}'", key, f"no such field; {nearest(key, known)}")
            )
    changes = {
        key: value
        for key, value in changes.items()
        if value is not None or key not in ("joint", "dof")  # none: as it is
    }
    data = fields_of(old)
    if "shape" in changes or "shapes" in changes:  # `shape` means one
        data |= {"shape": None, "shapes": ()}
    if "derived" not in changes:  # given values are no longer derived, nor those without shapes
        shaped = changes.get("shapes") or changes.get("shape") or data["shapes"]
        left = tuple(x for x in old.derived if shaped and x not in changes)
        changes = {**changes, "derived": left or old.gained(changes)}
    if "mass" in old.derived and "mass" not in changes["derived"]:
        changes = {"density": None, **changes}
    data = {k: x for k, x in data.items() if k not in changes["derived"] or k in changes}
    kind, dof = changes.get("joint", old.joint), changes.get("dof", old.dof)
    new_joint = kind != old.joint or dof != old.dof or _moves_otherwise(old, changes)
    if new_joint:
        kept = {"joint"} if kind == old.joint == "compound" and "motions" in changes else set()
        if not {"joint", "motions"} & changes.keys() or kind not in joints.FOLLOWING:
            data.pop("track")
        data = {k: x for k, x in data.items() if k in kept or k not in (*JOINT_FIELDS, "joint")}
    elif "dof" in changes:
        changes = {key: value for key, value in changes.items() if key != "dof"}
    if "motions" in changes:
        data.pop("axes", None)
    where = f"body '{old.name}'"
    if not new_joint:
        return _refused_as(Body, where, {**data, **changes}), []
    kept = _axes_kept(old, changes)
    new = _refused_as(Body, where, {**data, **kept, **changes})
    given = {*changes, "axes"} if "motions" in changes else changes
    lost = [key for key in JOINT_FIELDS if key not in given and _set(old, key)]
    lost += ["track"] if old.track and not new.track else []
    lost = [key for key in lost if not kept or key not in ("axes", "motions")]
    text = f"body '{new.name}': the joint is now {new.joint} ({new.dof} DoF)"
    return new, [text + (f"; reset: {', '.join(lost)}" if lost else "")]


def _axes_kept(old: Body, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the axes for a new joint with the same number of axes, or {} if they are defaults."""
    if not {"axes", "motions"}.isdisjoint(changes) or not _set(old, "axes"):
        return {}
    kind = {key: changes[key] for key in ("joint", "dof") if key in changes}
    try:
        fresh = Body(name="fresh", **kind)
        kept: dict[str, Any] = (
            {"axes": old.axes} if fresh.axes and fresh.joint != "compound" else {}
        )
        return kept if Body(name="fresh", **kind, **kept) else {}
    except ModelError:
        return {}  # another number of axes, or a kind that is refused by its own field


def edited_part(old: Described, changes: Mapping[str, Any]) -> tuple[Any, list[str]]:
    """Return a part other than a body with changed fields, and further changes. Raises ModelError.

    If `kind` changes, fields that the new kind does not have are removed.
    """
    data, notices = fields_of(old), []
    if isinstance(old, OfKinds) and changes.get("kind", old.own_kind()) in old.KINDS:
        kind = changes.get("kind", old.own_kind())
        lost = [key for key in data if key not in old.KINDS[kind].model_fields]
        kept = {key: value for key, value in data.items() if key not in lost}
        lost = [key for key in lost if data[key] is not None and key not in changes]
        if lost and kind != old.own_kind():
            text = f"{old.word()} '{data['name']}': a {kind} has no {', '.join(lost)}"
            notices.append(text)
        data, cls = {**kept, "kind": kind}, old.KINDS[kind]
    else:
        cls = type(old)
    return _refused_as(cls, f"{old.word()} '{data['name']}'", {**data, **changes}), notices


# parts that scenarios list by name -> what conditions watch of them
WATCHED = {"constraints": ("force", "constraint"), "contacts": ("force", "gap")}


def renamed_in_scenarios(
    scenarios: Sequence[Scenario], key: str, names: Mapping[str, str | None]
) -> tuple[tuple[Scenario, ...], list[str]]:
    """Return scenarios with renamed constraints, contacts or forces along paths, and notices about
    removed entries.

    `key` is the name of their list. Entries whose name is None are removed.
    """

    def called(name: str) -> str | None:
        part, k = without_segment(name, names)
        new = names.get(part, part)
        return f"{new}[{k}]" if k and new is not None else new

    found, notices = [], []
    for s in scenarios:
        update: dict[str, Any] = {}
        listed = getattr(s, key) if key in WATCHED else None
        if listed is not None and not names.keys().isdisjoint(listed):
            new = (names.get(x, x) for x in listed)
            update[key] = tuple(x for x in new if x is not None)
        switches = s.switches
        if key == "constraints":
            switches = tuple(
                x.unchecked_copy({"constraint": names.get(x.constraint, x.constraint)})
                for x in switches
                if names.get(x.constraint, x.constraint) is not None
            )
        switches = followed(switches, WATCHED.get(key, ("force",)), called)
        if switches != s.switches:
            update["switches"] = switches
            if len(switches) < len(s.switches):
                notices.append(f"scenario '{s.name}': a {key[:-1]} was removed with its switches")
        if key == "contacts" and s.gait and any(f.foot in names for f in s.gait.feet):
            feet = [names.get(f.foot, f.foot) for f in s.gait.feet]
            if None in feet:
                update["gait"] = None
                notices.append(f"scenario '{s.name}': its gait was removed with a foot")
            else:
                moved = zip(s.gait.feet, feet)
                feet = tuple(f.unchecked_copy({"foot": name}) for f, name in moved)
                update["gait"] = s.gait.unchecked_copy({"feet": feet})
        found.append(s.unchecked_copy(update) if update else s)
    return tuple(found), notices


def edited_all(
    bodies: Sequence[Body], others: Mapping[str, Any], changes: Mapping[str, Mapping[str, Any]]
) -> tuple[dict[str, Any], list[str]]:
    """Return all parts after editing several bodies, and further changes. Raises ModelError.

    `others` contains the other parts. In `changes`, `parent` refers to the new names.
    """
    rows, names, notices = {body.name: body for body in bodies}, {}, []
    for name, fields in changes.items():
        new, said = edited(rows[name], fields)
        rows[name] = new
        if said:
            fitting, gone = fitted(new, name, others)
            others, notices = {**others, **fitting}, [*notices, *said, *gone]
        if new.name != name:
            names[name] = new.name
    parts = renamed_all({**others, "bodies": tuple(rows.values())}, names)
    given = {name for name, fields in changes.items() if "parent" in fields}
    parts["bodies"] = tuple(
        new if name in given else followed
        for (name, new), followed in zip(rows.items(), parts["bodies"])
    )
    return parts, notices


def _refused_as(kind: type[T], where: str, data: dict[str, Any]) -> T:
    """Return the validated part. Errors refer to its current name, not to a rejected one."""
    try:
        return kind(**data)
    except ModelError as error:
        raise ModelError(Problem(where, p.field, p.text) for p in error.problems) from None


def _moves_otherwise(old: Body, changes: Mapping[str, Any]) -> bool:
    """Check whether a compound joint gets different motion kinds, which its q does not fit."""
    motions = listed(changes.get("motions"))
    if old.joint != "compound" or not isinstance(motions, tuple):
        return False
    try:
        return [kind for kind, *_ in motions] != [m.kind for m in old.sequence]
    except TypeError:
        return False  # ill-formed motions are refused by their own field


def _set(body: Body, field: str) -> bool:
    """Check whether a joint's field differs from the default for its kind."""
    own: dict[str, Any] = {} if field in ("axes", "motions") else {"motions": body.motions}
    fresh = Body(name="fresh", joint=body.joint, track=body.track, **own)
    return getattr(body, field) != getattr(fresh, field)


def renamed(part: T, names: Mapping[str, str]) -> T:
    """Return the part with renamed bodies in its fields."""
    known = type(part).model_fields
    old = {field: getattr(part, field) for field in NAMING if field in known}
    update: dict[str, Any] = {field: names[name] for field, name in old.items() if name in names}
    if isinstance(part, OfSums) and not names.keys().isdisjoint(part.coefficients):
        update["coefficients"] = {names.get(k, k): x for k, x in part.coefficients.items()}
    for field in getattr(part, "PLACES", ()):
        places = getattr(part, field)
        if any(place.body in names for place in places):
            update[field] = tuple(renamed(place, names) for place in places)
    if isinstance(part, BetweenPoints) and any(x.body in names for x in part._riding):
        update |= part._riding_with(lambda x: renamed(x, names), update.get("via"))
    if isinstance(part, (Force, Constraint, Contact, Control)):
        update |= renamed_in(part, names, "q", "v")
    return part.unchecked_copy(update) if update else part


def renamed_all(parts: Mapping[str, Sequence[Any]], names: Mapping[str, str]) -> dict[str, Any]:
    """Return all parts of a model with bodies renamed, by old name, in every reference to them."""

    def swapped(named: Mapping[str, Any]) -> dict[str, Any]:
        return {names.get(key, key): value for key, value in named.items()}

    def scenario(s: Scenario) -> Scenario:
        forces = tuple(renamed(f, names) for f in s.forces)
        switches = followed(s.switches, ("coordinate",), of_bodies(names))
        switches = followed(switches, ("holds",), lambda x: with_names(x, names, ("q", "v")))
        states = {"q": swapped(s.q), "v": swapped(s.v)}
        return s.unchecked_copy({**states, "forces": forces, "switches": switches})

    named = ("bodies", "beams", "constraints", "contacts", "forces", "sites", "outputs", "controls")
    found: dict[str, Any] = {key: tuple(renamed(x, names) for x in parts[key]) for key in named}
    return found | {"scenarios": tuple(map(scenario, parts["scenarios"]))}


def in_expressions(
    parts: Mapping[str, Sequence[Any]], names: Mapping[str, str], *groups: str
) -> dict[str, tuple[Any, ...]]:
    """Return the parts with expressions after replacing the renamed names.

    `groups` are "out" for outputs, "x" for controls, "u" and "f" for drives, "force" for contacts
    and constraints, "" for parameters.
    """

    def new(part: Any) -> Any:
        update = renamed_in(part, names, *groups)
        return part.unchecked_copy(update) if update else part

    kinds = ("forces", "constraints", "contacts", "controls")
    found = {key: tuple(map(new, parts[key])) for key in kinds}
    scenarios = list[Scenario]()
    for s in parts["scenarios"]:
        switches = followed(s.switches, ("holds",), lambda x: with_names(x, names, groups))
        scenarios.append(
            s.unchecked_copy({"forces": tuple(map(new, s.forces)), "switches": switches})
        )
    return {**found, "scenarios": tuple(scenarios)}


def fitted(
    body: Body, name: str, parts: Mapping[str, Sequence[Any]]
) -> tuple[dict[str, Any], list[str]]:
    """Return the parts that fit a body's new joint, and notices of the removed parts.

    `name` is the body's former name.
    """
    bodies = {name: body}
    there = coordinates(bodies)
    gone = {c.name for c in parts["constraints"] if not fits_joint(c, bodies)}

    def fits(f: Force) -> bool:
        if isinstance(f, OfSums) and f.coefficients:
            springs = isinstance(f, Tendon) or (isinstance(f, OnJoint) and f.law.kp != 0)
            return not sum_problems(f, "", bodies, springs, ours=True)
        if isinstance(f, BetweenPoints):
            return all(x.body != name or not coordinate_problem(x, bodies) for x in f._riding)
        return f.body != name or not isinstance(f, OnJoint) or not force_problems([f], bodies)

    def cut(s: Scenario) -> Scenario:
        states = {
            key: {
                k: x
                for k, x in getattr(s, key).items()
                if k != name or not state_problems(key, k, x, bodies)
            }
            for key in ("q", "v")
        }
        has = lambda at: at in there or of_bodies({name: None})(at) is not None  # noqa: E731
        switches = followed(s.switches, ("coordinate",), lambda at: at if has(at) else None)
        forces = tuple(filter(fits, s.forces))
        return s.unchecked_copy({**states, "forces": forces, "switches": switches})

    def read(o: Output) -> bool:
        return o.at != name or o.kind not in OF_JOINT or not output_problems([o], bodies, [])

    scenarios, _ = renamed_in_scenarios(parts["scenarios"], "constraints", dict.fromkeys(gone))
    kept = {
        "constraints": tuple(c for c in parts["constraints"] if c.name not in gone),
        "forces": tuple(filter(fits, parts["forces"])),
        "outputs": tuple(filter(read, parts["outputs"])),
        "scenarios": tuple(map(cut, scenarios)),
    }
    notices = [f"constraint '{c}' was removed: it does not fit the joint" for c in sorted(gone)]
    notices += [
        f"force '{f.name}' was removed: it does not fit the joint"
        for f in parts["forces"]
        if not fits(f)
    ]
    lost = [o.name for o in parts["outputs"] if not read(o)]
    notices += [f"output '{name}' was removed: it does not fit the joint" for name in lost]
    notices += [
        f"scenario '{s.name}': parts that do not fit the joint of '{name}' were removed"
        for s, new in zip(parts["scenarios"], kept["scenarios"])
        if s != new
    ]
    return kept, notices


def left_behind(old: Body, new: Body, bodies: Sequence[Body]) -> list[str]:
    """Return a notice for each child whose joint was at a tip that moved without it."""
    if old.tip is None or new.tip == old.tip or not any(old.tip):
        return []
    return [stays(new.name, b.name) for b in bodies if b.parent == old.name and b.link == old.tip]


def stays(name: str, child: str) -> str:
    """Return the notice that a tip moved without the child attached to it."""
    return (
        f"body '{name}': its tip moved alone: the joint of '{child}' stays where the tip was, "
        f"and com and inertia are as before; for another length edit '{child}', link=... too"
    )


def followed_tips(bodies: Sequence[Body], row: Mapping[str, int]) -> set[str]:
    """Return the notices about moved tips that no longer apply, because the child is at the tip
    again."""
    return {
        stays(b.parent, b.name)
        for b in bodies if b.parent in row and b.link == bodies[row[b.parent]].tip
    }  # fmt: skip


def attached(body: Standing, gone: Mapping[str, Body]) -> Standing:
    """Return a child of a removed body, moved to the next remaining ancestor at q = 0."""
    while body.parent in gone:
        parent = gone[body.parent]
        ahead = rotate(parent.rotation, body.link)
        body = body.unchecked_copy(
            {
                "parent": parent.parent,
                "link": tuple(a + b for a, b in zip(parent.link, ahead)),
                "rotation": multiply(parent.rotation, body.rotation),
            }
        )
    return body


def without(
    parts: Mapping[str, Sequence[Any]], names: set[str]
) -> tuple[dict[str, Any], list[str]]:
    """Return the parts without the bodies `names`, and notices of the removed parts."""

    def reads(part: Contact | Force | Control) -> bool:
        read = {x for x, _ in read_by(part, parts["outputs"])}
        named = (controls_read(part), drives_read(part), named_in(part, "force"))
        lost = (lost_controls, lost_drives, exerting)
        return bool(names & read) or any(a & b for a, b in zip(named, lost))

    def touched(part: Constraint | Contact | Force | Site | Output | Control) -> bool:
        if isinstance(part, (Contact, Force, Control)) and reads(part):
            return True
        return not names.isdisjoint(part.touches)

    def cut(s: Scenario) -> Scenario:
        switches = followed(s.switches, ("coordinate",), of_bodies(dict.fromkeys(names)))
        read = lambda x: {name for _, name, _ in signals_in(x)}  # noqa: E731
        lost = names | gone["outputs"] | lost_controls | lost_drives | exerting
        switches = followed(switches, ("holds",), lambda x: None if read(x) & lost else x)
        q, v = ({k: x for k, x in given.items() if k not in names} for given in (s.q, s.v))
        forces = tuple(f for f in s.forces if not touched(f))
        return s.unchecked_copy({"q": q, "v": v, "forces": forces, "switches": switches})

    tense = [f for f in parts["forces"] if isinstance(f, TENSE)]
    exerting = {
        part.name for part in (*parts["constraints"], *parts["contacts"], *tense)
        if not names.isdisjoint(part.touches)
    }  # fmt: skip
    lost_controls, lost_drives, before = set[str](), set[str](), -1
    while before < (before := len(lost_controls) + len(lost_drives)):  # one may read another
        lost_controls |= {c.name for c in parts["controls"] if reads(c)}
        lost_controls |= {f.name for f in parts["forces"] if touched(f) and isinstance(f, Stateful)}
        lost_drives |= {f.name for f in parts["forces"] if touched(f)}
    gone = {
        kind: {part.name for part in parts[kind] if touched(part)}
        for kind in ("constraints", "contacts", "forces", "sites", "outputs", "controls")
    }
    gone["outputs"] |= {o.name for o in parts["outputs"] if o.at in gone["sites"]}
    kept = {
        kind: tuple(part for part in parts[kind] if part.name not in dropped)
        for kind, dropped in gone.items()
    }
    notices = [
        f"{kind[:-1]} '{part.name}' was removed with its body"
        for kind in gone
        for part in parts[kind]
        if part.name in gone[kind]
    ]
    scenarios = parts["scenarios"]
    for kind in ("constraints", "contacts", "forces"):
        lost = gone[kind] & exerting
        scenarios, told = renamed_in_scenarios(scenarios, kind, dict.fromkeys(lost))
        notices += told
    return {**kept, "scenarios": tuple(map(cut, scenarios))}, notices


CUT = {  # joint kind -> kind of the constraint that is left of it where a loop is cut
    **{kind: kind for kind in ("revolute", "universal", "prismatic", "cylindrical", "weld")},
    "spherical": "point",
}


def cut_joint(
    body: Body, parent: str, taken: Sequence[str], given: Mapping[str, Any]
) -> Constraint:
    """Return the constraint that replaces a joint from `body` to a second parent. Raises
    ModelError.

    `given` contains the joint, the name and the fields of the constraint. Fields that are None are
    taken from the joint of the body.
    """
    given = {key: value for key, value in given.items() if value is not None}
    joint = given.pop("joint", body.joint)
    where = f"body '{body.name}'"
    if joint not in CUT:
        text = f"a loop is not cut at a {joint} joint; choose one of {', '.join(CUT)}"
        raise ModelError(Problem(where, "joint", text))
    if "axis" not in given and joint == body.joint != "weld":
        if joint == "universal" and body.sequence != joints.DEFAULT["universal"]:
            text = (
                "its axes do not determine the axes of the second parent; give axis and other_axis"
            )
            raise ModelError(Problem(where, "axes", text))
        if joint in ("revolute", "prismatic", "cylindrical"):
            given["axis"] = body.axes[0]
    name = given.pop("name", None) or free_name(f"{body.name}-{parent}", taken)
    return Constraint(name=name, kind=CUT[joint], body=body.name, other=parent, **given)


def free_name(name: str, taken: Iterable[str]) -> str:
    """Return `name`, or the next free numbered name, such as femur, femur_2 or 7, 8."""
    taken = set(taken)
    if name not in taken:
        return name
    if re.fullmatch(r"[0-9]{1,9}", name):
        stem, number = "", int(name)
    else:
        match = re.fullmatch(r"(.*_)(\d{1,9})", name)
        stem, number = (match[1], int(match[2])) if match else (f"{name}_", 1)
    while f"{stem}{number}" in taken or number < 2:
        number += 1
    return f"{stem}{number}"
