"""Parts of a live run as one motion: a part begins as the one before it ended (pure).

A run that starts anew has no impulse of a step behind it and does not know which feet stick: its
first frame says less than the last frame of the part before, which is the same instant.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

import pgraph_core as pg
from pgraph_core.result.contact_record import PHASES, SWING, ContactRecord, Event
from pgraph_core.simulation.contact_log import CAUSES, LIFTED

ON_GROUND = frozenset(PHASES) - {SWING}
GRAZE = 5e-3  # [s]: what is over sooner than this after a part begins is no change


class Seam:
    """Takes parts one after the other and gives them as parts of one motion."""

    def __init__(self) -> None:
        self._before: pg.Result | None = None
        self._lifted: dict[str, Event] = {}  # just before the last part ended: perhaps no flight

    def sewn(self, part: pg.Result) -> pg.Result:
        """`part` with contacts, accelerations and phases that go on from the one before."""
        before = self._before
        if len(part.t) and part.contacts.force:
            record = part.contacts
            if before is not None and before.contacts.force:
                part = _begun_as(before, part)
                record = self._continued(before.contacts, part.contacts, np.asarray(part.t))
            part = replace(part, contacts=self._held_back(record, np.asarray(part.t)))
        self._before = part
        return part

    def _continued(self, was: ContactRecord, now: ContactRecord, t: np.ndarray) -> ContactRecord:
        """Phases and events in which no foot changes because the part begins."""
        phases, events = dict(now.phases), list(now.events)
        for name, phase in now.phases.items():
            known = str(was.phases[name][-1]) if name in was.phases else str(phase[0])
            soon = [e for e in events if e.contact == name and e.t - t[0] < GRAZE]
            if known not in PHASES or (known == phase[0] and not soon):
                continue
            body = soon[0].body if soon else _body(name, was, now)
            if soon and soon[-1].after == known:
                events = [event for event in events if event not in soon]
                phases[name] = np.where(t < soon[-1].t, known, phase)
            elif known == phase[0]:
                continue
            elif soon:
                events.remove(soon[0])
                phases[name] = np.where(t < soon[0].t, known, phase)
                events += _event(soon[0].t, name, body, known, soon[0].after)
            elif phase[0] == SWING and name in self._lifted:
                events.append(self._lifted[name])
            else:
                events += _event(float(t[0]), name, body, known, str(phase[0]))
        return replace(now, phases=phases, events=tuple(sorted(events, key=lambda e: e.t)))

    def _held_back(self, record: ContactRecord, t: np.ndarray) -> ContactRecord:
        """Without flights that began just now: the next part says whether they are."""
        phases, events = dict(record.phases), list(record.events)
        last = {event.contact: event for event in events}
        self._lifted = {
            name: event
            for name, event in last.items()
            if event.after == SWING and event.before in ON_GROUND and event.t > t[-1] - GRAZE
        }
        for name, event in self._lifted.items():
            events.remove(event)
            phases[name] = np.where(t >= event.t, event.before, phases[name])
        return replace(record, phases=phases, events=tuple(events))


def _begun_as(before: pg.Result, part: pg.Result) -> pg.Result:
    """`part` whose first frame has the contacts and accelerations of the last of `before`."""
    was, now = before.contacts, part.contacts
    wrench = now.wrench
    if wrench.shape[1:] == was.wrench.shape[1:] and len(wrench) and len(was.wrench):
        wrench = _from(was.wrench, wrench)
    kinds = ("force", "gap", "slip", "limit", "normal")
    begun = {kind: _begun(getattr(was, kind), getattr(now, kind)) for kind in kinds}
    same = before.vdot.shape[1:] == part.vdot.shape[1:]
    return replace(
        part,
        contacts=replace(now, **begun, wrench=wrench),
        vdot=_from(before.vdot, part.vdot) if same else part.vdot,
    )


def _from(was: np.ndarray, now: np.ndarray) -> np.ndarray:
    return np.concatenate((was[-1:], now[1:]))


def _begun(was: Mapping[str, np.ndarray], now: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {name: _from(was[name], x) if name in was else x for name, x in now.items()}


def _event(t: float, name: str, body: str, before: str, after: str) -> list[Event]:
    if before == after:
        return []
    cause = CAUSES.get((PHASES.index(before), PHASES.index(after)), LIFTED)
    return [Event(t, name, body, before, after, str(cause))]


def _body(name: str, *records: ContactRecord) -> str:
    """The body of a contact, as its events say; "" where there was none yet."""
    events = (event for record in records for event in record.events)
    return next((event.body for event in events if event.contact == name), "")
