"""What a run tells of its contacts and switches: their record, counters and notices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..engine import layout as at
from ..mechanism import Mechanism
from ..mechanism.scene import Scene
from ..result.contact_record import NOTHING, ContactRecord, Event
from ..system import Array
from .phase_log import stepped_over
from .run_plan import RunPlan
from .switching import Change

GRAZE = 2.5  # steps: a shorter flight of a contact is none
LOOSE = 1e-6  # of the velocities: a law missed by more is said


def contacts_of(
    mech: Mechanism,
    plan: RunPlan,
    frames: tuple[Array, Array, Array],
    changes: Array,
    log: Sequence[Event],
) -> ContactRecord:
    """What frames (times, pushes, touches) say of contacts and limits, and the events between."""
    if not plan.contacts:
        return replace(NOTHING, events=tuple(log))
    up = np.array(mech.model.ground_normal)
    impulses = plan.method.name == "moreau_jean"
    graze = GRAZE * float(np.max(plan.width, initial=0.0)) if impulses else 0.0
    found = stepped_over(plan.contacts, up, *frames, changes, graze)
    events = sorted((*found.events, *log), key=lambda event: event.t)
    return replace(found, events=tuple(events))


def switched(mech: Mechanism, change: Change, gain: float) -> list[Event]:
    """The events of a change that has put in `gain` [J] at once."""
    took = f"; its impulse took {-gain:.4g} J" if gain < 0 else ""
    took = f"; its impulse put in {gain:.4g} J" if gain > 0 else took
    found: list[Event] = []
    for numbers, (old, new) in ((change.off, ("on", "off")), (change.on, ("off", "on"))):
        for i in numbers.tolist():
            c = mech.model.constraints[i]
            cause = f"switched {new}{took if new == 'on' else ''}"
            found.append(Event(change.t, c.name, c.body, old, new, cause))
    return found


def contact_counters(scene: Scene) -> dict[str, int]:
    """How often contacts were solved or changed in another way than usual."""
    if scene.touching is None:
        return {}
    tally = scene.touching.tally
    return {"contact_fallbacks": int(tally[at.N_FALLBACK]), "calmed": int(tally[at.N_CALMED])}


def contact_notices(scene: Scene, unlogged: int) -> list[str]:
    """What a person should know of how contacts were solved."""
    if scene.touching is None:
        return []
    tally, worst = scene.touching.tally, scene.touching.worst
    found: list[str] = []
    if tally[at.N_CALMED]:
        found.append(
            f"in {tally[at.N_CALMED]} steps the bounce with friction would have gained energy: "
            "they were taken without restitution"
        )
    if worst[at.MISSED] > LOOSE:
        found.append(
            "the contact solver stopped at its cap: laws missed by up to "
            f"{worst[at.MISSED]:.1e} of the velocities; try a smaller step"
        )
    if unlogged:
        found.append(f"{unlogged} changes of contacts' phases were too many to log")
    if tally[at.N_MISSED]:
        found.append(f"in {tally[at.N_MISSED]} steps there were more contact points than room")
    return found
