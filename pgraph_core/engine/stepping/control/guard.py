"""The guard of a run: events and contacts that are looked for in its steps."""

from typing import Any

import numpy as np

from ...compiler.jit import part
from ...records import ONCE

# -- in kernels -----------------------------------------------------------------------------------


@part
def fire(guard, why):
    """Let the run report REACHED or CONTACT_AHEAD."""
    guard.fired = why


@part
def note_reported(guard):
    """Note that what has been found is reported."""
    guard.fired = 0


@part
def bound_width(guard, h):
    """Permit the next step at most the width h."""
    guard.bound = h


@part
def ask_once(guard):
    """Look for events in the last step, if not in every step."""
    guard.due = max(guard.due, ONCE)


@part
def note_looked(guard):
    """Note that the step for which events were asked once has been looked at."""
    if guard.due == ONCE:
        guard.due = 0


@part
def rest_until(guard, t, slow):
    """Check nothing until time t while all speeds are at most `slow`."""
    guard.slow = slow
    guard.next_check = t


# -- in Python ------------------------------------------------------------------------------------


def begin(guard: Any) -> None:
    """Begin without a bound on the next step, and check at once."""
    guard["bound"] = np.inf
    check_again(guard)


def check_again(guard: Any) -> None:
    """Check at the next look."""
    guard["next_check"] = -np.inf


def set_due(guard: Any, due: int) -> None:
    """Say when events are due: 0, ONCE or ALWAYS."""
    guard["due"] = due


def set_turning(guard: Any, time: float) -> None:
    """Set the time in which friction may turn slow slip around [s]."""
    guard["turning"] = time


def forget_event(guard: Any) -> None:
    """Do not report what ended the last step."""
    guard["fired"] = 0


def set_addresses(guard: Any, addresses: dict[str, Any]) -> None:
    """Set the addresses, by name, of what looks at steps."""
    for name, address in addresses.items():
        guard[name] = address


def set_bounds(guards: Any, which: Any, h: Any) -> None:
    """Permit the next steps of the runs `which` at most the width h."""
    guards["bound"][which] = h
