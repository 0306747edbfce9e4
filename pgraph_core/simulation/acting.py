"""What of a model acts in a run, and the state that the run starts in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..contact.tables import Tables
from ..engine import layout as at
from ..gait.controller import Controller
from ..mechanism import Mechanism
from ..model import Contact, Force, Scenario
from ..system import Array, Drives, Ints, Loads
from .switching import Change, changes


class Acting(NamedTuple):
    """What acts in a run, and the state that it starts in."""

    drives: Drives
    loads: Loads
    contacts: Tables | None  # what touches; None: nothing
    active: Ints  # indices of the constraints that are active at the start
    changes: tuple[Change, ...]  # constraints that go on and off
    tau: Any  # (nv,), a function of (t, q, v), or None
    q: Array
    v: Array

    @property
    def impulses(self) -> bool:
        """Whether there are rigid contacts or joint limits."""
        return self.contacts is not None and self.contacts.rigid


def acting(
    mech: Mechanism,
    given: Scenario | None,
    forces: Sequence[Force],
    switches: Any,
    tau: Any,
    state: tuple[Any, Any],
    span: tuple[float, float],
) -> Acting:
    """What the model, a scenario and the arguments of `simulate` make act. Raises InputError."""
    forces = (*mech.model.forces, *(given.forces if given else ()), *forces)
    drives, loads = mech.drives(forces), mech.loads(forces)
    contacts = mech.contacts(touching_contacts(mech, given))
    active, changing = changes(mech, given, switches, active_constraints(mech, given), span)
    tau = controlled(mech, given) if tau is None else tau
    q, v = initial_state(mech, given, *state, tau)
    return Acting(drives, loads, contacts, active, changing, tau, q, v)


def controlled(mech: Mechanism, given: Scenario | None) -> Controller | None:
    """What makes a scenario's gait; None where it has none."""
    return Controller(mech, given.gait) if given is not None and given.gait is not None else None


def ticks(tau: Any, span: tuple[float, float]) -> Array:
    """Times at which a controller's torques jump by its clock [s]; none of other torques."""
    return tau.ticks(*span) if isinstance(tau, Controller) else np.zeros(0)


def active_constraints(mech: Mechanism, given: Scenario | None) -> Ints:
    """Indices of the constraints that a scenario activates, else the model's active ones."""
    if given is None or given.constraints is None:
        return mech.active
    wanted = set(given.constraints)
    return np.array(
        [i for i, c in enumerate(mech.model.constraints) if c.name in wanted], dtype=np.int64
    )


def touching_contacts(mech: Mechanism, given: Scenario | None) -> tuple[Contact, ...]:
    """The contacts that act."""
    if given is None or given.contacts is None:
        return tuple(c for c in mech.model.contacts if c.active)
    return tuple(c for c in mech.model.contacts if c.name in given.contacts)


def initial_state(
    mech: Mechanism, given: Scenario | None, q: Any, v: Any, tau: Any = None
) -> tuple[Array, Array]:
    """Initial state: the arguments, else the scenario's, else a gait's, else the model's."""
    tau = controlled(mech, given) if tau is None else tau
    known = q is not None and v is not None
    q0, v0 = tau.start() if isinstance(tau, Controller) and not known else mech.home()
    if given is not None:
        for state, entries, column in ((q0, given.q, at.QI), (v0, given.v, at.VI)):
            for name, values in entries.items():
                number = mech.topology.number(name)
                row = int(np.flatnonzero(mech.system.body_of_row == number)[0])
                first = mech.system.rows[row, column]
                state[first : first + len(values)] = values
    q0 = q0 if q is None else mech.position(q).copy()
    v0 = v0 if v is None else mech.finite("v", v, mech.nv).copy()
    return q0, v0
