"""A model of an assembly: welded parts are one body, in a tree of joints with closed loops."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError, PgraphError, Problem, choices, explained, nearest_first, shown
from ..fields import GROUND
from ..model import Body, Constraint, Model
from ..rotation import normals_of, quaternion_of, rodrigues
from ..tolerances import NOTABLE, ROUNDING, TOUCHING
from .conversion import Report, reach_of, suspect_units
from .step_joints import KINDS, Array, Proposal
from .step_parts import Part, Parts, carried

WATER = 1000  # [kg/m^3] density of parts without one
CALL = "read_step"


@explained
@dataclass
class StepReport(Report):
    """A report on a STEP file, with its proposed joints."""

    joints: list[Proposal] = field(default_factory=list[Proposal])  # all that were proposed
    moved: float = 0.0  # largest distance by which parts were moved to close the joints [m]

    def to_dict(self) -> dict[str, Any]:
        """Return the fields as a dictionary, for JSON."""
        joints = [vars(joint) | {"text": str(joint)} for joint in self.joints]
        return super().to_dict() | {"joints": joints, "moved": self.moved}


class Move(NamedTuple):
    """A displacement of a body from its place in the file: turn, and then shift."""

    turn: Array
    shift: Array

    def of(self, x: Array) -> Array:
        return self.turn @ x + self.shift


@dataclass
class _Group:
    """Parts that move together."""

    name: str
    parts: list[Part]
    mass: float
    com: Array
    inertia: Array  # about the centre of mass


def model_of(
    found: Parts,
    accepted: Sequence[Proposal],
    by_name: Mapping[str, float],
    fixed: Iterable[str],
    report: StepReport,
) -> Model:
    """Return the model of the parts with the accepted joints. Raises InputError, ModelError."""
    densities = _densities(found.parts, by_name, report)
    known = {part.name: part for part in found.parts}
    held = [_known(name, known, "fixed") for name in fixed]
    groups = _welded(found.parts, densities, accepted, report)
    if accepted and not held:
        heaviest = max({id(x): x for x in groups.values()}.values(), key=lambda group: group.mass)
        held = [heaviest.name]
        text = f"'{heaviest.name}' is the heaviest body and welded to the ground; fixed=[NAME] "
        report.add("converted", report.file, f"{text}gives another", part=heaviest.name)
    builder = _Builder(groups, [groups[name] for name in held])
    builder.add([joint for joint in accepted if joint.kind != "weld"])
    name = report.file.rpartition(".")[0] or report.file
    model = Model(name=name, bodies=builder.bodies, constraints=builder.loops)
    model = _closed(model, builder, report)
    corners = np.array([part.box for part in found.parts])
    ends = {"low": tuple(corners[:, 0].min(0)), "high": tuple(corners[:, 1].max(0))}
    suspect_units(report, model, reach_of(ends))
    return model


def _known(name: Any, names: Collection[str], argument: str) -> str:
    if name in names:
        return name
    known = choices(nearest_first(str(name), names), 12)
    text = f"must be parts of the file, got {shown(name)}; its parts are {known}"
    raise InputError(Problem(CALL, argument, text))


def densities_by_name(given: Any) -> Mapping[str, float]:
    """Return the argument `density` by names of parts, "*" for all. Raises InputError."""
    by_name = given if isinstance(given, Mapping) else {} if given is None else {"*": given}
    for name, value in by_name.items():
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not (number and 0 < value < np.inf):
            text = f"must be a finite number > 0 [kg/m^3], got {shown(value)} for {shown(name)}"
            raise InputError(Problem(CALL, "density", text))
    return by_name


def _densities(
    parts: Sequence[Part], by_name: Mapping[str, float], report: Report
) -> dict[str, float]:
    """Return the density of each part: by its name, for all ("*"), or of the file's material."""
    own = {part.name for part in parts} | {part.product for part in parts}
    for name in by_name:
        _known(name, {*own, "*"}, "density")
    found, assumed, of_file = dict[str, float](), list[str](), dict[float, list[str]]()
    for part in parts:
        named = [by_name[x] for x in (part.name, part.product, "*") if x in by_name]
        found[part.name] = float(next(iter(named), part.density))
        if found[part.name] and not named:
            of_file.setdefault(part.density, []).append(part.name)
        if not found[part.name]:
            found[part.name] = float(WATER)
            assumed.append(part.name)
    for value, names in of_file.items():
        text = f"the file's material gives {value:.6g} kg/m^3 to {choices(names, 5)}"
        report.add("read", report.file, text)
    if assumed:
        text = f"no density is known of {choices(assumed, 5)}: that of water is taken, {WATER} "
        report.add("warning", report.file, f"{text}kg/m^3; give density={{NAME: NUMBER}}")
    return found


def _welded(
    parts: Sequence[Part],
    densities: Mapping[str, float],
    joints: Iterable[Proposal],
    report: Report,
) -> dict[str, _Group]:
    """Return the group of each part by its name."""
    first = {part.name: part.name for part in parts}

    def top(name: str) -> str:
        while first[name] != name:
            name = first[name]
        return name

    for joint in joints:
        if joint.kind == "weld":
            first[top(joint.bodies[1])] = top(joint.bodies[0])
    members = dict[str, list[Part]]()
    for part in parts:
        members.setdefault(top(part.name), []).append(part)
    found = dict[str, _Group]()
    for own in members.values():
        group = _group(own, [densities[part.name] for part in own])
        found |= {part.name: group for part in own}
        if len(own) > 1:
            others = choices([part.name for part in own if part.name != group.name], 6)
            text = f"{others} move with '{group.name}': they are one body"
            report.add("converted", report.file, text, part=group.name)
    return found


def _group(parts: list[Part], densities: Sequence[float]) -> _Group:
    """Return parts as one body, with the mass properties of all."""
    masses = np.array([part.volume * density for part, density in zip(parts, densities)])
    mass = float(masses.sum())
    com = masses @ np.array([part.com for part in parts]) / mass
    inertia = np.zeros((3, 3))
    for part, own, density in zip(parts, masses, densities):
        arm = part.com - com
        inertia += density * part.inertia + own * carried(arm)
    heaviest = parts[int(np.argmax(masses))]
    return _Group(heaviest.name, parts, mass, com, (inertia + inertia.T) / 2)


class _Builder:
    """Bodies in the order of a tree that begins at the fixed parts, and constraints that close
    loops."""

    def __init__(self, groups: Mapping[str, _Group], fixed: Sequence[_Group]):
        self.groups = groups
        corners = np.array([part.box for group in groups.values() for part in group.parts])
        self.size = float(np.max(np.abs(corners), initial=0.0))
        self.bodies, self.loops = list[Body](), list[Constraint]()
        self.moves, self.origins = dict[str, Move](), dict[str, Array]()
        for group in fixed:
            if group.name not in self.moves:
                self._body(group, Move(np.eye(3), np.zeros(3)), np.zeros(3), {"joint": "weld"})

    def add(self, joints: Sequence[Proposal]) -> None:
        """Add all bodies: those that joints reach from the fixed parts, and then free ones."""
        left = sorted(joints, key=lambda joint: KINDS.index(joint.kind))
        pending = list({group.name: group for group in self.groups.values()}.values())
        while True:
            while (k := next((k for k, x in enumerate(left) if self._leads(x)), None)) is not None:
                self._joined(left.pop(k))
            loose = next((group for group in pending if group.name not in self.moves), None)
            if loose is None:
                break
            near = np.linalg.norm(loose.com) < TOUCHING * self.reach(loose)
            origin = np.zeros(3) if near else loose.com
            self._body(loose, Move(np.eye(3), np.zeros(3)), origin, {"joint": "free"})
        for joint in left:
            self._loop(joint)

    def _ends(self, joint: Proposal) -> tuple[_Group, _Group]:
        first, second = (self.groups[name] for name in joint.bodies)
        return first, second

    def _leads(self, joint: Proposal) -> bool:
        """Check whether exactly one of the bodies of a joint is in the tree."""
        first, second = self._ends(joint)
        return (first.name in self.moves) != (second.name in self.moves)

    def _joined(self, joint: Proposal) -> None:
        """Add the body at the far end of a joint, moved so that their features coincide."""
        first, second = self._ends(joint)
        sides = [(np.array(joint.point), np.array(joint.axis)),
                 (np.array(joint.other_point), np.array(joint.other_axis))]  # fmt: skip
        if first.name not in self.moves:
            first, second = second, first
            sides.reverse()
        at, axis = self._moved(first.name, *sides[0])
        own = self.moves[first.name]
        point, along = own.of(sides[1][0]), own.turn @ sides[1][1]
        turn = np.eye(3) if joint.kind == "spherical" else _between(along, axis)
        shift = at - point
        if joint.kind in ("prismatic", "cylindrical"):
            shift = shift - (shift @ axis) * axis
        elif joint.kind == "planar":
            shift = (shift @ axis) * axis
        total = turn @ own.turn, turn @ (own.shift - point) + point + shift
        axis = _plain(axis)
        axes = {"weld": 0, "cylindrical": 2, "spherical": 0}.get(joint.kind, 1) * [tuple(axis)]
        if joint.kind == "planar":
            axes = [*map(tuple, normals_of(axis)), tuple(axis)]
        fields = {"joint": joint.kind, "parent": first.name} | ({"axes": axes} if axes else {})
        self._body(second, Move(*total), point + shift, fields)

    def _moved(self, name: str, point: Array, axis: Array) -> tuple[Array, Array]:
        move = self.moves[name]
        return move.of(point), _plain(move.turn @ axis)

    def _body(self, group: _Group, move: Move, origin: Array, fields: Mapping[str, Any]) -> None:
        """Add a body whose axes are those of the assembly."""
        origin = _plain(origin, self.size)
        self.moves[group.name], self.origins[group.name] = move, origin
        base = self.origins.get(fields.get("parent", GROUND), np.zeros(3))
        shapes = [
            {
                "kind": "mesh", "file": part.file, "hull": "convex",
                "position": tuple(move.of(part.place) - origin),
                "rotation": quaternion_of(move.turn @ part.turn),
                **({"colour": part.colour} if part.colour else {}),
            }
            for part in group.parts if part.file
        ]  # fmt: skip
        self.bodies.append(
            Body(
                name=group.name, link=tuple(origin - base), mass=group.mass,
                com=tuple(move.of(group.com) - origin), shapes=shapes,
                inertia=move.turn @ group.inertia @ move.turn.T, **fields,
            )
        )  # fmt: skip

    def _loop(self, joint: Proposal) -> None:
        """Add the constraints of a joint whose bodies are both in the tree."""
        first, second = self._ends(joint)
        fixed = [
            body.joint == "weld" for body in self.bodies if body.name in (first.name, second.name)
        ]
        if first is second or all(fixed):
            return
        names = {constraint.name for constraint in self.loops}
        at, axis = self._moved(first.name, np.array(joint.point), np.array(joint.axis))
        there, along = self._moved(
            second.name, np.array(joint.other_point), np.array(joint.other_axis)
        )
        given = {
            "body": second.name, "other": first.name,
            "point": tuple(there - self.origins[second.name]),
            "other_point": tuple(at - self.origins[first.name]),
        }  # fmt: skip
        title = f"{joint.kind} {first.name} {second.name}"
        if joint.kind == "planar":
            steps = (np.zeros(3), *(self.reach(second) * x for x in normals_of(along)))
            own = there - self.origins[second.name]
            many = [given | {"kind": "plane", "other_axis": tuple(axis), "point": tuple(own + step)}
                    for step in steps]  # fmt: skip
        elif joint.kind == "spherical":
            many = [given | {"kind": "point"}]
        else:
            many = [given | {"kind": joint.kind, "axis": tuple(along), "other_axis": tuple(axis)}]
        for one in many:
            name, n = title, 1
            while name in names:
                n += 1
                name = f"{title} {n}"
            names.add(name)
            self.loops.append(Constraint(name=name, **one))

    def reach(self, group: _Group) -> float:
        """Return the largest extent of the parts of a body [m]."""
        return float(max(np.ptp(part.box, axis=0).max() for part in group.parts))


def _plain(x: Array, size: float = 1.0) -> Array:
    """Return numbers with zeros for those that are rounding errors at this size."""
    return np.where(np.abs(x) > ROUNDING * size, x, 0.0)


def _between(one: Array, other: Array) -> Array:
    """Return the shortest rotation that maps a unit vector to another."""
    axis = np.cross(one, other)
    sine = float(np.linalg.norm(axis))
    if not sine:
        return np.eye(3)
    return rodrigues(axis / sine, float(np.arctan2(sine, one @ other)))


def _closed(model: Model, builder: _Builder, report: StepReport) -> Model:
    """Return the model with its loops closed, and report by how much parts were moved."""
    from ..mechanism import Mechanism  # no compiler for a file without joints

    turns = {body.name: (builder.origins[body.name], np.eye(3)) for body in model.bodies}
    if model.constraints:
        mech = Mechanism(model)
        try:
            q, _, changed = mech.assemble()
            if changed.notable:
                own = {n: {"q": tuple(q[j.q])} for n, j in mech.joints.items() if len(q[j.q])}
                model = model.edit_all(own)
            mobility = mech.mobility(q)
        except PgraphError as error:
            report.add("warning", report.file, f"the loops do not close: {error}")
            return model
        places, rotations = mech.poses(q)
        turns = {name: (places[k], rotations[k]) for k, name in enumerate(mech.names)}
        for line in str(mobility).splitlines():
            report.add("read", report.file, line.strip())
    for group in {id(x): x for x in builder.groups.values()}.values():
        place, turn = turns[group.name]
        move = builder.moves[group.name]
        corners = np.array([np.array(np.meshgrid(*x.box.T)).reshape(3, -1).T for x in group.parts])
        before = corners.reshape(-1, 3)
        after = (before @ move.turn.T + move.shift - builder.origins[group.name]) @ turn.T + place
        report.moved = max(report.moved, float(np.linalg.norm(after - before, axis=1).max()))
    if report.moved > NOTABLE / WATER:
        text = f"parts were moved by up to {report.moved * 1000:.3g} mm so that the joints meet"
        report.add("approximated", report.file, text)
    return model
