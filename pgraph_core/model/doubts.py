"""Warnings about valid but implausible input. Runs and `pgraph check` repeat them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

from ..errors import shown
from ..fields import EVERY, GROUND, Vec3
from ..forces import OnJoint, Servo, Spring, Torsion
from ..joints import DIRECTED, beyond
from ..signals.grammar import names_in
from ..tolerances import NOTABLE, SOLVED
from .body import Body
from .constraint import AlongAxes, Constraint
from .expressions import named_in, texts_of
from .inertia import inertia_problems
from .world import DOWN


def doubts(model: Any) -> list[str]:
    """Return warnings about values that are implausible for the model or have no effect."""
    bodies = model.bodies
    by_name = {body.name: body for body in bodies}
    return [
        *_units(model), *_gravity(model), *_impossible(bodies),
        *(f"body '{body}': its {text}" for body, text in unlinked(bodies, by_name)),
        *(f"body '{name}': {text}" for name, text in wide(bodies)), *_starts(bodies),
        *_shapes(bodies), *_axes(model.constraints, by_name), *_idle_joints(bodies),
        *_idle_forces(model, by_name), *_twice(model), *_idle_parameters(model),
        *_untouched(model), *_exact(model),
    ]  # fmt: skip


def floppy(beams: Sequence[Any]) -> Iterator[str]:
    """Yield warnings about beams, such as thin open sections, that hardly resist twist."""
    for beam in beams:
        GJ, EI = beam.stiff.GJ, min(beam.stiff.EI or (0.0,))
        if "twist" in beam.deforms and GJ < NOTABLE * EI:
            yield (
                f"beam '{beam.name}', GJ: {GJ:.3g} N m^2 is {GJ / EI:.1g} of its EI, "
                f"{EI:.3g} N m^2, so that next to nothing holds it against twist; give the GJ of "
                "its section, or leave 'twist' out of its strains"
            )


def _impossible(bodies: Sequence[Body]) -> Iterator[str]:
    """Yield warnings about inertias that no rigid body has, which files may contain."""
    for body in bodies:
        if body.any_inertia:
            for _, text in inertia_problems(body.inertia):
                yield f"body '{body.name}': its inertia {text}; runs take it as given"


def unlinked(bodies: Sequence[Body], by_name: Mapping[str, Body]) -> Iterator[tuple[str, str]]:
    """Yield (body, warning) for joints at the origin of a parent that has a tip."""
    hung = Counter(body.parent for body in bodies)
    for body in bodies:
        parent = by_name.get(body.parent)
        tip = None if parent is None or hung[parent.name] > 1 else parent.tip
        if body.sequence and not any(body.link) and tip is not None and any(tip):
            yield (
                body.name,
                f"link is (0, 0, 0), so its joint is at the origin of '{body.parent}', not at its "
                f"tip; for a joint at the tip give link={shown(tip)}",
            )


def _shapes(bodies: Sequence[Body]) -> Iterator[str]:
    """Yield warnings about missing mesh files and moving surfaces without contacts."""
    for body in bodies:
        for shape in body.shapes:
            if shape.file is not None and not Path(shape.file).is_file():
                yield f"body '{body.name}': mesh {shape.file} not found; a placeholder is drawn"
            if shape.moves and shape.role == "visual":
                text = (
                    "its surface moves, but its role is 'visual', so it cannot touch other shapes"
                )
                yield f"body '{body.name}': shape {body.shapes.index(shape)}: {text}"


def _axes(constraints: Sequence[Constraint], by_name: Mapping[str, Body]) -> Iterator[str]:
    """Yield warnings about constraint axes that still have their default values."""
    for c in constraints:
        body = by_name.get(c.body)
        if not isinstance(c, AlongAxes) or body is None or c.axis or c.other_axis:
            continue
        own = {m.axis for m in body.sequence if m.kind in DIRECTED}
        if c.kind != "universal" and len(own) == 1 and not {Z, (0.0, 0.0, -1.0)} & own:
            along = shown(next(iter(own)))
            yield (
                f"constraint '{c.name}': without axis it is along z of '{c.body}', whose own joint "
                f"is along {along}; for the same give axis={along}"
            )


def _units(model: Any) -> Iterator[str]:
    """Yield warnings about angles in degrees and gravity in mm/s²."""
    pull = math.hypot(*model.gravity)
    if pull > MILLI * math.hypot(*DOWN[model.up]):
        text = "as in mm/s²; lengths are in m, and gravity in m/s²: 9.81"
        yield f"model: gravity is {pull:g} m/s², {text}"
    for name, text in limits_in_degrees(model.bodies):
        yield f"body '{name}': {text}"
        return
    for body in model.bodies:
        if body.dof == 1 and body.sequence[0].facts.pivots and in_degrees(body.q[0]):
            yield f"body '{body.name}': {several_turns(body.q[0])}"
            return


def limits_in_degrees(bodies: Sequence[Body]) -> Iterator[tuple[str, str]]:
    """Yield (body, warning) for limits of several turns, which look like degrees."""
    for body in bodies:
        for motion, pair in zip(body.sequence, body.limits):
            ends = [x for x in pair or () if x is not None]
            if motion.facts.pivots and MOST_ANGLE <= max(map(abs, ends), default=0.0) < 1e4:
                text = f"limits of {shown(pair)} would be several turns; angles are in rad, not in"
                yield body.name, f"{text} degrees"
                break


def wide(bodies: Sequence[Body]) -> Iterator[tuple[str, str]]:
    """Yield (body, warning) for inertias that fit the model better in kg mm² or g mm².

    A radius of gyration is a length like all others of the model. If the value divided by 1000 is
    closer to the other lengths, it was probably given in millimetres.
    """
    lengths = [math.hypot(*x) for b in bodies for x in (b.com, b.tip_point, b.link)]
    size = max(lengths, default=0.0)
    for body in bodies:
        if body.mass > 0.0 and "inertia" in body.model_fields_set and "inertia" not in body.derived:
            moments = sum(body.inertia[k][k] for k in range(3)) / 2.0
            radius = math.sqrt(max(moments, 0.0) / body.mass)
            if radius > MILLI * max((size, *map(_extent, body.shapes))) > 0.0:
                yield (
                    body.name,
                    f"with {body.mass:g} kg its inertia is that of a mass {radius:.3g} m away from "
                    f"its centre, in a model of {size:.3g} m; inertias are in kg m², lengths in m",
                )


def _extent(shape: Any) -> float:
    """Return a characteristic length of a shape [m], or 0 for a mesh file."""
    return max(shape.radius or 0.0, shape.length or 0.0, *(shape.size or shape.radii or (0.0,)))


def _starts(bodies: Sequence[Body]) -> Iterator[str]:
    """Yield warnings about joints that start beyond their limits."""
    for body in bodies:
        for k, by in beyond(body.q, body.sequence, body.limits):
            yield (
                f"body '{body.name}': it starts {by:.3g} beyond its limits "
                f"{shown(body.limits[k])}, which prevent it from moving further out"
            )


def in_degrees(angle: float) -> bool:
    """Check whether an angle that should be in rad looks like degrees."""
    return abs(angle) >= MOST_ANGLE and angle == round(angle)


def several_turns(angle: float, word: str = "q") -> str:
    """Return the warning about an angle that looks like degrees."""
    turns = abs(angle) / (2 * math.pi)
    return f"{word} = {angle:g} is {turns:.3g} turns; angles are in rad: np.radians({angle:g})"


def _gravity(model: Any) -> Iterator[str]:
    """Yield a warning about gravity that does not point down."""
    down, gravity = DOWN[model.up], model.gravity
    if any(gravity) and sum(a * b for a, b in zip(down, gravity)) <= 0.0:
        text = f"gravity {shown(gravity)} does not pull along -{model.up}"
        yield f"model: up is {model.up}, but {text}"


def _idle_joints(bodies: Sequence[Body]) -> Iterator[str]:
    """Yield warnings about joint parameters that have no effect without another parameter."""
    for body in bodies:
        if any(x and not k for x, k in zip(body.rest, body.stiffness)):
            yield f"body '{body.name}': rest has no effect without a joint stiffness"
        if any(body.limit_restitution) and not any(body.limits):
            yield f"body '{body.name}': limit_restitution has no effect without limits"


def _idle_forces(model: Any, by_name: Mapping[str, Body]) -> Iterator[str]:
    """Yield warnings about forces that are zero in every motion."""
    for f in model.forces:
        where = f"force '{f.name}'"
        if isinstance(f, Servo) and isinstance(f.target, float) and in_degrees(f.target):
            motions = by_name[f.body].sequence
            if len(motions) == 1 and motions[0].facts.pivots and f.gear == 1.0:
                yield f"{where}: {several_turns(f.target, 'target')}"
        if f._idle:
            yield f"{where}: it has no effect, since {f._idle}"
        elif isinstance(f, OnJoint) and f.coefficients and f.body not in f.coefficients:
            yield (
                f"{where}: it acts on the sum over {', '.join(f.coefficients)}, and its body "
                f"'{f.body}' is not among them"
            )
        elif isinstance(f, (Spring, Torsion)) and (text := _cannot_change(f, by_name)):
            yield f"{where}: it has no effect: {text}"


def _cannot_change(f: Spring | Torsion, by_name: Mapping[str, Body]) -> str:
    """Return why the joint between a spring's ends cannot change its length or angle, or ""."""
    if f._fits_one_body:
        return ""
    body, flipped = by_name[f.body], False
    if body.parent != f.other:
        if f.other == GROUND or by_name[f.other].parent != f.body:
            return ""
        body, flipped = by_name[f.other], True
    if len(body.sequence) != 1:
        return ""
    motion = body.sequence[0]
    kind = motion.facts
    if isinstance(f, Torsion):
        axis = f.axis or (0.0, 0.0, 1.0)
        product = math.hypot(*axis) * math.hypot(*motion.axis)
        across = abs(_dot(axis, motion.axis)) < SOLVED * product
        if not kind.turns or (kind.directed and not flipped and across):
            return f"the joint of '{body.name}' does not turn about its axis {shown(axis)}"
        return ""
    own, other = f.point, f.other_point or (0.0, 0.0, 0.0)
    own = by_name[f.body].tip_point if own is None else own
    if flipped:
        own, other = other, own
    arm = tuple(a - b for a, b in zip(other, body.link))  # from the joint, in the parent's axes
    turned = body.rotation[0] ** 2 < (1 - SOLVED) * sum(x * x for x in body.rotation)
    on_axis = _along(own, motion.axis) or (not turned and _along(arm, motion.axis))
    at_origin = not any(own) or math.hypot(*arm) < SOLVED
    if kind.travels or not (at_origin or (kind.directed and on_axis)):
        return ""
    text = f"the joint of '{body.name}' turns about one of its ends, so that its length is constant"
    return f"{text}; give point and other_point, or use pg.Torsion"


def _along(x: Sequence[float], axis: Vec3) -> bool:
    """Check whether a point lies on the axis."""
    square, length = _dot(axis, axis), math.hypot(*x)
    off = [a - _dot(x, axis) / square * b for a, b in zip(x, axis)]
    return math.hypot(*off) <= SOLVED * length


def _dot(x: Sequence[float], y: Sequence[float]) -> float:
    return sum(a * b for a, b in zip(x, y))


def _twice(model: Any) -> Iterator[str]:
    """Yield warnings about contacts that act between the same two bodies at the same points."""
    acting = [c for c in model.contacts if c.active]
    for one, other in combinations(acting[:MANY], 2):
        same = one.points == other.points or set(one.points) & set(other.points)
        same = same and one.pair.count(EVERY) == other.pair.count(EVERY)  # else the nearer one acts
        if same and all(_overlap(a, b) for a, b in zip(one.pair, other.pair)):
            yield (
                f"contacts '{one.name}' and '{other.name}' are between the same bodies, "
                f"{' and '.join(one.pair)}, and both push; remove one"
            )


def _exact(model: Any) -> Iterator[str]:
    """Yield warnings about expressions that read an imperfect output, whose value is exact."""
    imperfect = {o.name for o in model.outputs if o.imperfect is not None}
    for part in (*model.forces, *model.controls) if imperfect else ():
        for name in sorted(named_in(part, "out") & imperfect):
            yield (
                f"{part.word()} '{part.name}' reads the exact value of output '{name}': its noise "
                "and delay are in run.measured alone, which a loop of pg.Stepper reads"
            )


def _overlap(a: str, b: str) -> bool:
    return a == b or (EVERY in (a, b) and GROUND not in (a, b))


def _idle_parameters(model: Any) -> Iterator[str]:
    """Yield warnings about parameters that no formula or expression uses."""
    texts = [f.text for f in model.formulas]
    texts += texts_of(model)
    used = set[str]().union(*map(names_in, texts))
    for name in model.parameters:
        if name not in used:
            yield f"parameter '{name}': no formula uses it"


def _untouched(model: Any) -> Iterator[str]:
    """Yield a warning about free bodies with shapes that have no contact with the ground or with
    each other.

    Descendants of a body are not listed separately. Contacts that are off count, since switches
    close them.
    """
    root = _roots(model.bodies)
    parts = (*model.constraints, *model.forces)
    solid = {root[body.name] for body in model.bodies if body.shape}
    loose = [body.name for body in model.bodies if body.dof == 6 and body.parent == GROUND]
    own = [part for part in parts if "body" in type(part).model_fields]
    ends = [(part.body, vars(part).get("other", part.body)) for part in own]
    # what acts within a body and all that hangs on it does not hold them, unless on its own joint
    ends = [pair for pair in ends if pair[0] in loose or root.get(pair[0]) != root.get(pair[1])]
    held = {root.get(name) for pair in ends for name in pair}
    loose = [name for name in loose if name in solid and name not in held]
    meets = [
        set[str]().union(*(solid if end == EVERY else {root.get(end, GROUND)} for end in c.pair))
        for c in model.contacts
    ]  # fmt: skip
    stands = {GROUND, *root.values()}.difference(loose)
    while more := [each for each in meets if not stands.isdisjoint(each) and not each <= stands]:
        stands = stands.union(*more)
    falling = [name for name in loose if name not in stands]
    if falling and any(model.gravity):
        text = "it has no contact and would fall through the ground; shapes only touch if "
        lines = "pg.Contact(body='*')" + f", {EACH_OTHER}" * (len(loose) > 1)
        yield f"body '{falling[0]}': {text}a contact names them: contacts=[{lines}]"
    apart = not any(len(each.intersection(loose)) > 1 for each in meets if GROUND not in each)
    if not falling and apart and meets and len(loose) > 1:
        text = f"they would pass through each other; to let them touch add {EACH_OTHER} to contacts"
        yield f"bodies '{loose[0]}' and '{loose[1]}': {text}"


def _roots(bodies: Sequence[Body]) -> dict[str, str]:
    """Return {body: the body on the ground that carries it}."""
    parent, found = {body.name: body.parent for body in bodies}, dict[str, str]()
    for name in parent:
        path = [name]
        while path[-1] not in found and parent[path[-1]] != GROUND:
            path.append(parent[path[-1]])
        found |= dict.fromkeys(path, found.get(path[-1], path[-1]))
    return found


EACH_OTHER = "pg.Contact(body='*', other='*')"  # all bodies but the ground
MILLI = math.sqrt(1000.0)  # a length so much larger than another is nearer to it in mm
MOST_ANGLE = 8 * math.pi  # four turns: limit of a joint that is plausible in degrees, not in rad
Z = (0.0, 0.0, 1.0)
MANY = 300  # contacts that are compared with each other
