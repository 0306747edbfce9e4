"""Contact and switching reports for a run: the record, phases, events, counters and notices.

With time stepping, phases are read from a log of changes. Located impacts are accurate to rounding,
other changes to one step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..contact.tables import ContactPair, Tables
from ..dynamics.scene import Scene
from ..engine.records import ACCEPTANCE, DEEP, PAIR, PHASE_CHANGE, SLIP, STANCE, SWING, table
from ..fields import EVERY, GROUND
from ..mechanism import Mechanism
from ..packing import Array, Ints
from ..result.records import FREE, NOTHING, PHASES, STOP, ContactRecord, Event
from ..tolerances import NOTABLE, VISIBLE
from .clearance import gaps_later
from .overpowered import (
    bounced,
    driven_into,
    gaps_at_start,
    limited_bodies,
    limits_passed,
    pressed,
    yielding,
)
from .run_plan import RunPlan
from .switches import Change

GRAZING = 2  # steps: a flight of a contact that takes no more is none

CAUSES = {
    (SWING, ACCEPTANCE): "it touched down, sliding",
    (SWING, STANCE): "it touched down",
    (SWING, SWING): "it bounced",
    (ACCEPTANCE, STANCE): "its slip came to zero",
    (SLIP, STANCE): "its slip came to zero",
    (STANCE, SLIP): "friction did not hold it",
}
LIFTED = "the ground cannot pull"
CAUSES_OF_LIMIT = {
    (SWING, STANCE): "it reached its limit",
    (SWING, SWING): "it rebounded from its limit",
    (STANCE, SWING): "a limit cannot pull",
}
NAMES = np.array(PHASES)
OF_LIMIT = np.array((FREE, "", "", STOP))


COUNTED = {  # field of the tally -> notice if it is not 0
    "calmed": "in {calmed} steps, restitution was disabled because restitution with friction would "
    "have increased the energy",
    "crowded": "{crowded} steps, the first at t = {crowded_time:.6g} s, had too many impacts to "
    "locate individually. The rest of each step was computed at once, so the subsequent motion may "
    "be inaccurate; use a smaller step",
    "chains": "at t = {chain_time:.6g} s a body rebounds between several others ({chains} times in "
    "total). Newton's law treats these impacts as simultaneous, but with gaps between the "
    "bodies, however small, they would be successive",
    "missed": "the contact solver did not converge. At t = {worst_time:.6g} s, {worst_name} "
    "violates its law by {worst:.3g} N, compared with a maximum force of {force:.3g} N; try a "
    "smaller step",
    "passed": "at t = {passed_time:.6g} s {passed_name} failed: one shape passed through the "
    "other within a step; use a smaller step",
    "loose": "at t = {loose_time:.6g} s the impulses of {loose_name} in an impact are not unique: "
    "others that satisfy the contact laws lead to another load or motion; all methods take the "
    "same ones",
    "unlogged": "{unlogged} changes of contacts' phases were not logged",
    "overflows": "in {overflows} steps there were too many contact points",
}


def contacts_of(
    mech: Mechanism,
    plan: RunPlan,
    frames: tuple[Array, Array, Any, Array],
    q: Array,
    changes: Any,
    log: Sequence[Event],
    pulls: dict[str, Array],
) -> ContactRecord:
    """Return contacts and limits over the frames, and the events in between.

    The frames are (times, wrenches on bodies, pairs, residuals of laws), at the states q. If
    contacts were ignored until the end, only the times are used. `pulls` are the wrenches of
    constraints in the last steps.
    """
    tables = plan.contacts if plan.way is None else plan.declared
    if not tables:
        return replace(NOTHING, events=tuple(log))
    if plan.way is not None:
        frames, changes = _untouched(mech, tables, frames[0])
    t, pushes, pairs, missed = frames
    impulses, up = plan.method.time_stepping, np.array(mech.model.ground_normal)
    width = float(np.max(plan.width, initial=0.0)) if impulses else 0.0
    names = [pair.name for pair in tables.touches]
    means = pairs["mean_torque"], pairs["mean_force"]
    forces = np.concatenate(means, axis=-1).swapaxes(0, 1)
    limits = [*zip(tables.limits, limited_bodies(mech, tables))]
    phases, events = phases_over(changes, tables.touches, limits, t, width)
    return ContactRecord(
        force=dict(zip(names, forces)),
        gap=gaps_later(mech, tables, q, dict(zip(names, pairs["gap"].T))),
        slip=dict(zip(names, pairs["slip"].T)),
        limit=dict(zip(tables.limits, means[1][:, len(names) :, 0].T)),
        pull=pulls,
        wrench=pushes,
        residual=missed,
        normal={
            pair.name: force[:, 3:] @ up
            for pair, force in zip(tables.touches, forces)
            if pair.other == GROUND
        },
        phases=phases,
        events=tuple(sorted((*events, *log), key=lambda event: event.t)),
    )


def _untouched(mech: Mechanism, tables: Tables, t: Array) -> tuple[Any, Any]:
    """Return the frames and the changes of a run without contact, for `contacts_of`."""
    count = len(tables.touches) + len(tables.limits)
    pairs, changes = table(PAIR, len(t), count), table(PHASE_CHANGE, count)
    pairs["gap"], changes["pair"], changes["phase"] = np.inf, np.arange(count), SWING
    return (t, np.zeros((len(t), mech.nb, 6)), pairs, np.zeros((0, 3))), changes


def switched(mech: Mechanism, change: Change, work: float, lost: float) -> list[Event]:
    """Return the events for a change whose impulses did `work` and dissipated `lost` [J]."""
    took = f"; its impulse took {lost:.4g} J" if lost > 0 else ""
    took += f"; prescribed motions did work of {work:.4g} J" if work else ""
    found: list[Event] = []
    for numbers, (old, new) in ((change.off, ("on", "off")), (change.on, ("off", "on"))):
        for i in numbers.tolist():
            c = mech.model.constraints[i]
            cause = f"switched {new}{took if new == 'on' else ''}"
            found.append(Event(change.t, c.name, c.body, old, new, cause))
    return found


def contact_counters(scene: Scene) -> dict[str, int]:
    """Return the fallback counts of the contact solver."""
    if scene.touching is None:
        return {}
    tally = scene.touching.tally
    return {"contact_fallbacks": int(tally["fallbacks"]), "calmed": int(tally["calmed"])}


def contact_notices(
    mech: Mechanism,
    scene: Scene,
    unlogged: int,
    tables: Tables,
    active: Ints,
    frames: tuple[Array, Array, Array],
    strong: str,
) -> list[str]:
    """Return notices about how contacts were solved.

    The frames contain (times, states q, gaps of pairs), `active` the constraints, and `strong` the
    notice of `overpowering`.
    """
    if scene.touching is None:
        return []
    tally, (t, q, _) = scene.touching.tally, frames
    names = [*(f"contact '{pair.name}'" for pair in tables.touches), *tables.limits]
    counts = dict(zip(tally.dtype.names, tally.item()))
    counts |= {"unlogged": unlogged, "missed": counts["worst"] > NOTABLE * counts["force"]}
    of_pair = {f"{x}_name": "".join(names[counts[f"{x}_pair"] :][:1]) for x in ("worst", "passed")}
    of_pair["loose_name"] = "".join(
        named(pair.name, pair[1:3]) for pair in tables.touches[counts["loose_pair"] :][:1]
    )
    found = [text.format(**counts, **of_pair) for name, text in COUNTED.items() if counts[name]]
    found += too_deep(mech, tables, active, tally, frames, strong)
    if strong and not (found and found[-1].endswith(strong)):
        found.append(strong)
    found += limits_passed(mech, tables, active, t, q)
    found += pressed(mech, tables, frames)
    found += bounced(mech, tables, active)
    return found


def too_deep(
    mech: Mechanism, tables: Tables, active: Ints, tally: Any, frames: tuple[Array, Array, Array],
    strong: str,
) -> list[str]:  # fmt: skip
    """Return a notice about the contact that is deepest relative to what its law allows for.

    `strong` is the notice of `overpowering`.
    """
    share, of = float(tally["deepest"]), "the thickness of the touching shapes"
    size = tally["length"] or tables.geometry.shapes["reach"].any()
    if share > 0.0 and not size:
        moved = float(np.ptp(frames[1], axis=0).max(initial=0.0))  # a point mass has no size
        share, of = share / moved if moved else 0.0, "how far it moved"
    if not share > VISIBLE:
        return []
    k, when, depth = (tally[f"deepest_{x}"].item() for x in ("pair", "time", "depth"))
    pair, began = tables.touches[k], -float(gaps_at_start(mech, tables, frames)[k])
    overlaps = share * began / depth > VISIBLE
    remedy = "start without overlap" if overlaps else "use a smaller step"
    if pair.contact.law != "complementarity":
        share, strong = share * DEEP, ""
        remedy = yielding(mech, tables, k, (began, depth, share), overlaps)
    of += f" ({depth / share:.3g} m)" if size else ""
    why = driven_into(mech, tables, active, k, frames, when)
    return [
        f"at t = {when:.6g} s {named(pair.name, pair[1:3])} penetrated by {depth:.3g} m, "
        f"{share:.2g} of {of}; {why or strong or remedy}"
    ]


def named(contact: str, bodies: Sequence[str]) -> str:
    """Return the name of a contact with those of its two bodies."""
    if EVERY in bodies:
        return f"contact '{contact}'"
    both = " and ".join("the ground" if x == GROUND else f"'{x}'" for x in bodies)
    return f"contact '{contact}' of {both}"


def phases_over(
    changes: Any,
    touches: Sequence[ContactPair],
    limits: Sequence[tuple[str, str]],
    t: Array,
    width: float = 0.0,
) -> tuple[dict[str, NDArray[np.str_]], tuple[Event, ...]]:
    """Return ({pair: (len(t),) phase}, events) from PHASE_CHANGE records in chronological order.

    `limits` contains (name, body). The phase in the first row of a contact is its initial phase.
    Time stepping, with steps of `width` [s], locates impacts, and events say where they are known
    to a step only. It releases a point for a step when its body is moved out of the ground: flights
    that short are ignored. Touches of one contact between many bodies together have phases as one.
    A shape above the ground that never touches it has none if the contact has points. For example,
    only the feet of a robot have a phase.
    """
    phases, events = {}, []
    points = any(pair.contact.points for pair in touches)
    pairs: list[tuple[str, str, bool]] = [
        (x.name, x.body, points and not x.contact.points and x.other == GROUND) for x in touches
    ]
    pairs += [(name, body, False) for name, body in limits]
    for k, (name, body, aloft) in enumerate(pairs):
        own, words = changes[changes["pair"] == k], NAMES if k < len(touches) else OF_LIMIT
        if len(own) < 2:
            if len(own) and not (aloft and own["phase"][0] == SWING):
                phases[name] = np.full(len(t), words[own["phase"][0]])
            continue
        own = _without_grazes(own, (GRAZING + 0.5) * width)
        now = np.searchsorted(own["time"][1:], t, side="right")
        phases[name] = words[own["phase"][now]]
        before, after = own["phase"][:-1], own["phase"][1:].copy()
        begun, when = own["when"] < own["time"], np.maximum.accumulate(own["when"][1:])
        touch = (after[:-1] != SWING) & (after[1:] == SWING) & (when[:-1] == when[1:])
        after[:-1][touch] = SWING  # a touch that lasts no time is a bounce
        keep = np.ones(len(when), dtype=bool)
        keep[1:] = ~touch
        located = begun[1:] & (before == SWING)
        causes = CAUSES if k < len(touches) else CAUSES_OF_LIMIT
        for x, a, b, sure in zip(when[keep], before[keep], after[keep], located[keep]):
            cause = causes.get((a, b), LIFTED)
            cause += f", to within a step of {width:.3g} s" if width and not sure else ""
            events.append(Event(float(x), name, body, str(words[a]), str(words[b]), cause))
    return phases, tuple(sorted(events, key=lambda event: event.t))


def _without_grazes(own: Any, graze: float) -> Any:
    """Drop flights shorter than `graze` from one touch's rows, and rows that become redundant."""
    if len(own) < 3:
        return own
    short = np.zeros(len(own), dtype=bool)
    short[1:-1] = (own["phase"][1:-1] == SWING) & (np.diff(own["time"][1:]) < graze)
    own = own[~short]
    changed = np.append(True, np.diff(own["phase"]) != 0)
    return own[changed]
