"""Checks that parts form a valid multibody system, covering the tree and references by name."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

from .. import joints, words
from ..errors import MOST_TOLD, Problem, choices, counted, shown
from ..fields import EVERY, GROUND, Described
from ..forces import Force
from ..joints import quaternion_problems
from ..shapes import KINDS, kind_of
from .beam import Beam
from .body import Body
from .cam import Cam
from .constraint import Constraint, Rolling
from .contact import Contact
from .control import Control
from .expressions import Known, drives_read, expression_problems, loop_problems
from .force_checks import force_problems, late_limits, muscle_problems, place_problems
from .joint_constraint import Coupling, OfOne, OfTwo, Sum
from .output import OF_CONTACT, OF_JOINT, OF_LOAD, Output, Site
from .part_checks import Bodies, pair_problems, problem_of_coordinate, sum_problems, unique, unknown
from .scenario import Scenario, Switch, condition_problems, known_names
from .segments import MARK, named, place_in, rigid, segment
from .world import Ground, below_kinetic


def tree_problems(names: Sequence[str], parents: Sequence[str]) -> list[Problem]:
    """Return duplicate names, unknown parents and cycles in the table."""
    found: list[Problem] = []
    row: dict[str, int] = {}
    for i, name in enumerate(names):
        if name in row:
            text = f"{shown(name)} is already the name of row {row[name] + 1}; choose another"
            found.append(Problem(f"row {i + 1}", "name", text))
        row.setdefault(name, i)
    for name, parent in zip(names, parents):
        if parent != GROUND and parent not in row:
            text = f"no body is named {shown(parent)}"
            if len(found) < MOST_TOLD:  # suggestions take a time that grows with the table
                known = [GROUND, *(each for each in row if each != name)]
                text += f"; choose one of {choices(known)}{words.synonym(parent, known)}"
            found.append(Problem(f"body {shown(name)}", "parent", text))
    return found + [_cycle_problem(cycle) for cycle in _cycles(names, parents, row)]


def _cycle_problem(cycle: list[str]) -> Problem:
    if len(cycle) == 1:
        text = f"a body cannot be its own parent, got '{cycle[0]}'; choose another, or ground"
    else:
        path = " -> ".join([*cycle[:12], "..."] if len(cycle) > 12 else [*cycle, cycle[0]])
        text = f"closes a cycle: {path}; tie one of them to the ground"
    return Problem(f"body '{cycle[0]}'", "parent", text)


def _cycles(names: Sequence[str], parents: Sequence[str], row: dict[str, int]) -> list[list[str]]:
    """Return each cycle once, as the list of its names, in O(n)."""
    state = dict.fromkeys(
        (name for name in names if name != GROUND), 0
    )  # 0 new, 1 on the present path, 2 done
    cycles = []
    for start in names:
        path = []
        name = start
        while name in state and state[name] == 0:
            state[name] = 1
            path.append(name)
            name = parents[row[name]]
        if name in state and state[name] == 1:
            cycles.append(path[path.index(name) :])
        state.update(dict.fromkeys(path, 2))
    return cycles


def constraint_problems(items: Sequence[Constraint], bodies: Bodies) -> list[Problem]:
    """Check constraints for unknown or equal bodies, wrong coordinates and missing radii."""
    found = unique("constraint", [c.name for c in items])
    for c in items:
        where = f"constraint '{c.name}'"
        if isinstance(c, Sum):
            found += [] if c.body in c.coefficients else pair_problems(c, where, bodies)
            found += sum_problems(c, where, bodies, isinstance(c, Coupling))
        else:
            found += pair_problems(c, where, bodies) or _joint_problems(c, where, bodies)
            found += place_problems(c, where, bodies)
    return found


def _joint_problems(c: Constraint, where: str, bodies: Bodies) -> list[Problem]:
    """Check the coordinates of gears, relations and motions, and the radius of rolling bodies."""
    if isinstance(c, Cam) and (own := c.problems_with(bodies)):
        return [Problem(where, field, text) for field, text in own]
    found, asked = [], []
    if isinstance(c, OfOne):
        asked.append(("coordinate", c.body, c.coordinate))
    if isinstance(c, OfTwo):
        asked.append(("other_coordinate", c.other, c.other_coordinate))
    for field, name, k in asked:
        body = bodies.get(name)
        if body is not None and (text := problem_of_coordinate(body, k)):
            found.append(Problem(where, field, text))
    body = bodies.get(c.body)
    if isinstance(c, Rolling) and c.radius is None and body is not None:
        what = "sphere" if c.axis is None else "disc"
        rolls = "" if body.shape is None else kind_of(body.shape).rolls
        if not rolls or (what == "sphere" and rolls != what):
            round_ = next(name for name, kind in KINDS.items() if kind.rolls == what)
            text = f"a rolling {what} needs its radius: '{c.body}' has no {round_} as its shape"
            found.append(Problem(where, "radius", f"{text}; give a radius > 0 [m]"))
    return found


def fits_joint(c: Constraint, bodies: Bodies) -> bool:
    """Check whether the joints of these bodies have the coordinates in a constraint."""
    if isinstance(c, Sum):
        return not sum_problems(c, "", bodies, isinstance(c, Coupling), ours=True)
    return not _joint_problems(c, "", bodies)


def contact_problems(items: Sequence[Contact], bodies: Bodies) -> list[Problem]:
    """Check contacts for unknown bodies, self-contact and bodies without a contact shape."""
    found = unique("contact", [c.name for c in items])
    for c in items:
        where = f"contact '{c.name}'"
        found += pair_problems(c, where, bodies, EVERY) or _shape_problems(c, where, bodies)
    return found


def _shape_problems(c: Contact, where: str, bodies: Bodies) -> list[Problem]:
    found = []
    for field, name in (("body", c.body), ("other", c.other)):
        body = bodies.get(name)
        if body is not None and not body.touching and not (field == "body" and c.points):
            do = "give it a shape, or points" if field == "body" else "give it a shape"
            found.append(Problem(where, field, f"'{name}' has no collision shape; {do}"))
    return found


def soles_among(contacts: Sequence[Contact]) -> list[str]:
    """Return the names of contacts that can serve as feet, single points over the ground."""
    return [c.name for c in contacts if len(c.points) == 1 and c.other == GROUND]


def scenario_problems(
    items: Sequence[Scenario],
    bodies: Bodies,
    constraints: Sequence[str],
    contacts: Sequence[str],
    soles: Sequence[str] = (),
) -> list[Problem]:
    """Check scenarios for unknown names, states of wrong length and their own forces."""
    found = unique("scenario", [s.name for s in items])
    for s in items:
        where = f"scenario '{s.name}'"
        for field, state in (("q", s.q), ("v", s.v)):
            for name, values in state.items():
                texts = state_problems(field, name, values, bodies)
                found += [Problem(where, field, text) for text in texts]
        found += _active_problems(where, "constraint", s.constraints or (), constraints)
        found += _active_problems(where, "contact", s.contacts or (), contacts)
        found += [
            Problem(where, "switches", text) for text in switch_problems(s.switches, constraints)
        ]
        found += force_problems(s.forces, bodies, f"{where}, ") + late_limits(
            s.forces, f"{where}, "
        )
        feet = [fall.foot for fall in s.gait.feet] if s.gait else []
        unknown = [foot for foot in feet if foot not in contacts]
        found += [
            Problem(where, "gait", problem.text)
            for problem in _active_problems(where, "contact", unknown, soles or contacts)
        ]
    return found


def _active_problems(
    where: str, kind: str, names: Sequence[str], known: Sequence[str]
) -> list[Problem]:
    """Check a scenario's list for duplicates and for names that no part of that kind has."""
    found = []
    for i, name in enumerate(names):
        if name not in known:
            do = f"choose one of {choices(known)}" if known else f"the model has no {kind}"
            found.append(Problem(where, f"{kind}s", f"no {kind} is named '{name}'; {do}"))
        elif name in names[:i]:
            found.append(Problem(where, f"{kind}s", f"'{name}' appears twice"))
    return found


def switch_problems(switches: Sequence[Switch], constraints: Sequence[str]) -> list[str]:
    """Return unknown constraint names, and constraints that are switched twice at the same time."""
    found = []
    do = f"choose one of {choices(constraints)}" if constraints else "the model has no constraint"
    for i, s in enumerate(switches):
        if s.constraint not in constraints:
            found.append(f"no constraint is named '{s.constraint}'; {do}")
        elif s.t is not None and (s.t, s.constraint) in [(o.t, o.constraint) for o in switches[:i]]:
            found.append(f"'{s.constraint}' is switched twice at t = {s.t:g} s; leave one out")
    return found


def state_problems(field: str, name: str, values: tuple[float, ...], bodies: Bodies) -> list[str]:
    """Return problems with the q or v of a body in a scenario."""
    if name not in bodies:
        return [f"no body is named '{name}'; choose one of {choices(bodies)}"]
    body = bodies[name]
    if body is None:
        return []
    length = (joints.nq if field == "q" else joints.nv)(body.sequence)
    if len(values) != length:
        return [f"'{name}' has {counted(length, 'number')}, got {len(values)}"]
    if field == "v":
        return []
    return [f"'{name}' {text}" for _, text in quaternion_problems(values, body.sequence)]


def reference_problems(
    bodies: Bodies,
    constraints: Sequence[Constraint],
    contacts: Sequence[Contact],
    forces: Sequence[Force],
    scenarios: Sequence[Scenario],
    sites: Sequence[Site],
    outputs: Sequence[Output],
    controls: Sequence[Control],
    names: tuple[Sequence[str], Sequence[str]],
    parameters: Mapping[str, float],
    lost: Collection[str] = (),
) -> list[Problem]:
    """Return problems with references by name between parts.

    `names` contains the names of all constraints and contacts, including invalid ones, and `lost`
    the names of invalid forces, outputs and controls.
    """
    watched = known_names(bodies, *names, forces)
    watched = {**watched, "force": [*watched["force"], *{*lost} - {*watched["force"]}]}
    return [
        *constraint_problems(constraints, bodies),
        *contact_problems(contacts, bodies),
        *force_problems(forces, bodies),
        *scenario_problems(scenarios, bodies, *names, soles_among(contacts)),
        *condition_problems(scenarios, bodies, constraints, forces, watched),
        *site_problems(sites, bodies),
        *output_problems(outputs, bodies, [s.name for s in sites]),
        *unique("control", [c.name for c in controls]),
        *muscle_problems(forces, controls, scenarios),
        *loop_problems(controls, forces, ""),
        *varying_problems(
            (constraints, contacts, forces, controls), scenarios,
            Known(bodies, outputs, controls, parameters, forces, names, lost, constraints),
        ),
        *(
            problem for s in scenarios if s.forces
            for problem in loop_problems(controls, (*forces, *s.forces), f"scenario '{s.name}', ")
        ),
    ]  # fmt: skip


def varying_problems(
    parts: Sequence[Sequence[Described]], scenarios: Sequence[Scenario], own: Known
) -> list[Problem]:
    """Return problems with expressions in parts, and in the forces of scenarios."""
    found = [problem for some in parts for problem in expression_problems(some, own)]
    for s in scenarios:
        known = own.beside(s.forces)
        twice = own.drives.keys() & {f.name for f in s.forces}
        all_read = (drives_read(p) for some in parts for p in some) if twice else ()
        if read := twice & set[str]().union(*all_read):
            text = f"a force of the model is named '{min(read)}' too, and expressions read it; "
            found.append(Problem(f"scenario '{s.name}'", "forces", f"{text}rename one"))
        found += expression_problems(s.forces, known, f"scenario '{s.name}', ")
        conditions = [x.when.holds for x in s.switches if x.when and x.when.holds]
        texts = (known.problem(text, None) for text in conditions)
        found += [Problem(f"scenario '{s.name}'", "switches", text) for text in texts if text]
    return found


def site_problems(sites: Sequence[Site], bodies: Bodies) -> list[Problem]:
    """Check sites for unknown bodies and for names shared with a body, since both name frames."""
    found = unique("site", [s.name for s in sites])
    for s in sites:
        if text := unknown(s.body, bodies, GROUND):
            found.append(Problem(f"site {shown(s.name)}", "body", text))
        if s.name in bodies or s.name == GROUND:
            text = (
                f"is the name of a body, or of the ground; choose another, such as '{s.name} site'"
            )
            found.append(Problem(f"site {shown(s.name)}", "name", text))
    return found


def output_problems(
    outputs: Sequence[Output], bodies: Bodies, sites: Sequence[str]
) -> list[Problem]:
    """Check outputs for unknown bodies and sites, and for invalid joint coordinates."""
    found = unique("output", [o.name for o in outputs])
    for o in outputs:
        where = f"output {shown(o.name)}"
        if o.kind in OF_JOINT:
            if text := unknown(o.at, bodies):
                found.append(Problem(where, "at", text))
            if (body := bodies.get(o.at)) is None:
                continue
            places = joints.places(body.sequence)
            if o.coordinate >= len(places):
                text = f"the joint of '{o.at}' has {body.dof} degrees of freedom, counted from 0"
                found.append(Problem(where, "coordinate", f"{text}, got {o.coordinate}"))
            elif o.kind == OF_JOINT[0] and places[o.coordinate] is None:
                text = f"a {body.joint} joint has no single angle here; use kind 'rotation', "
                text += "'position' or 'joint_velocity'"
                found.append(Problem(where, "coordinate", text))
        elif o.at not in sites and (text := unknown(o.at, bodies, GROUND)):
            more = f"; or of the sites {choices(sites)}" if sites else ""
            found.append(Problem(where, "at", text + more))
        elif o.at == GROUND and o.kind in (*OF_LOAD, *OF_CONTACT):
            what = "joint transmits" if o.kind in OF_LOAD else "output reads"
            text = f"no {what} a force on the ground; name a body"
            found.append(Problem(where, "at", text))
    return found


def friction_problems(contacts: Sequence[Contact], ground: Ground) -> list[Problem]:
    """Return contacts whose static friction is below the ground's kinetic friction."""
    found = []
    for c in contacts:
        if c.friction is None and c.static_friction is not None:
            bad = below_kinetic("static_friction", c.static_friction, ground.friction)
            text = "and the friction is the value of the ground; give friction as well"
            found += [Problem(f"contact '{c.name}'", at, f"{why}, {text}") for at, why in bad]
    return found


PARTS: dict[str, type[Described]] = {
    "bodies": Body,
    "beams": Beam,
    "constraints": Constraint,
    "contacts": Contact,
    "forces": Force,
    "scenarios": Scenario,
    "sites": Site,
    "outputs": Output,
    "controls": Control,
}


def beam_problems(parts: Mapping[str, Sequence[Any]], bodies: Iterable[str]) -> list[Problem]:
    """Check the names and parents of beams, and the names of places along them.

    `bodies` are the names of all bodies, also of invalid ones.
    """
    beams = {beam.name: beam for beam in parts["beams"]}
    if not beams:
        return []
    found = unique("beam", [beam.name for beam in parts["beams"]])
    taken = {b.name: "body" for b in parts["bodies"]} | {s.name: "site" for s in parts["sites"]}
    taken[GROUND] = "body"
    known = [GROUND, *bodies, *beams]
    for name, beam in beams.items():
        where = f"beam {shown(name)}"
        if (word := taken.get(name)) is not None:
            found.append(Problem(where, "name", f"is the name of a {word} too; rename one"))
        own = next((x for x in taken if x.startswith(segment(name, 0)[:-2])), None)
        if own is not None and own[len(name) + 1 : -1].isdecimal() and own.endswith("]"):
            text = f"its segments have names such as {shown(own)}, which a {taken[own]} has too"
            found.append(Problem(where, "name", f"{text}; rename one"))
        above = place_in(beam.parent, beams)
        if above is not None and above[0] == name:
            text = f"a beam cannot be its own parent, got {shown(beam.parent)}; choose another"
            found.append(Problem(where, "parent", f"{text}, or ground"))
        elif above is None and beam.parent not in known:
            text = unknown(beam.parent, dict.fromkeys(x for x in known if x != name))
            found.append(Problem(where, "parent", text))
    for name in named(parts):
        of, mark, place = name.rpartition(MARK)
        if mark and of in beams and name not in taken and place_in(name, beams) is None:
            text = f"{shown(name)} is no place along it: after {MARK} stands a number from 0 at "
            text += f"its root to 1 at its tip, as in {shown(of + MARK + '0.5')}, got {place}"
            found.append(Problem(f"beam {shown(of)}", "", text))
    return found


def model_problems(
    parts: Mapping[str, Sequence[Any]], ground: Ground, parameters: Mapping[str, float]
) -> list[Problem]:
    """Return problems between the parts of a model, each of which is valid individually."""
    if found := beam_problems(parts, [body.name for body in parts["bodies"]]):
        return found
    bodies = (*parts["bodies"], *rigid(parts))
    others = {key: parts[key] for key in PARTS if key not in ("bodies", "beams")}
    names = ([c.name for c in parts["constraints"]], [c.name for c in parts["contacts"]])
    return [
        *tree_problems([b.name for b in bodies], [b.parent for b in bodies]),
        *reference_problems(
            {b.name: b for b in bodies}, **others, names=names, parameters=parameters
        ),
        *friction_problems(parts["contacts"], ground),
    ]
