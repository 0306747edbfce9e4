"""The balance of a run: its energies against the work that was done."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..result.records import energy_drift
from ..tolerances import SOLVED, VISIBLE
from .rates import fastest_rate, fastest_swings

if TYPE_CHECKING:
    from .recording import Recording


def unbalanced(record: Recording, n: int) -> tuple[str, ...]:
    """Return a message about energies that miss the work done, where the motion is accurate.

    Steps suit the motion alone. A prescribed one takes the widest, whatever power it needs, and a
    force that begins and ends within a step is not met. Impulses and methods of first order make
    errors of first order in energies.
    """
    plan, parts = record.plan.onward() if record.met else record.plan, record.out.energies[:n].T
    if plan.impulses or plan.method.order < 2:
        return ()
    drift, scale = energy_drift(parts)
    if drift <= VISIBLE or not scale > SOLVED * np.abs(parts).max():
        return ()
    return (
        f"the energies and the work of the run disagree by {100 * drift:.2g} % of their range: "
        "steps that suit the motion are too wide for its power, or pass a force; give a step",
    )


def passed_over(record: Recording, error: float) -> tuple[str, ...]:
    """Return a message about vibrations that implicit steps damp out at any size, if they may
    matter.

    They are missing from both runs. The energy that the ledger misses bounds their amplitude.
    """
    plan, given, n = record.plan, record.plan.tolerance, record.done
    if given is None or not (given.fixed and plan.method.implicit) or record.steps.divided:
        return ()
    acts = (record.mech, (plan.drives, plan.loads), plan.active, *record.began)
    rate = fastest_rate(*acts)
    if rate * given.widest <= 1.0 or not fastest_swings(*acts):
        return ()
    kinetic, potential, work, lost = record.out.energies[:n].T
    balance = kinetic + potential - work + lost
    inertia = np.diag(record.mech.mass_matrix(record.began[0]))
    most = float(np.sqrt(2.0 * np.ptp(balance) / inertia[inertia > 0.0]).max(initial=0.0)) / rate
    if most <= error:
        return ()
    return (
        f"the error excludes vibrations of {rate:.3g} rad/s, which {plan.method.name} damps "
        f"with steps of {given.widest:.3g} s (up to {most:.2g} rad or m). To resolve them, use a "
        f"step below {1.0 / rate:.2g} s",
    )
