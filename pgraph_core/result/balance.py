"""The energy balance of a run: E - E(0) = work - dissipation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ..dynamics.exerted import force_sizes
from ..dynamics.paths import UNKEPT
from ..errors import percent
from ..packing import Array
from ..tolerances import SOLVED, VISIBLE
from .bodies import all_forces

VIOLATED = "the energy balance of the run is violated by"  # beginnings of the notices
DECREASES = "the dissipation decreases by"
# in notices about prescribed motions whose rate jumps
UNBOOKED = "The work of that impulse is not in the energies of the run"


def energy_drift(parts: Array) -> tuple[float, float]:
    """Find the largest |E - E0 - work + dissipation| relative to the range of the energies, and
    that range [J], of `parts` (4, n): kinetic and potential energy, work and dissipation.

    The range is at least SOLVED of the largest energy: bodies at rest change theirs by rounding.
    """
    if parts.shape[1] < 2:
        return 0.0, 0.0
    ledger = parts[0] + parts[1] - parts[2] + parts[3]
    worst = float(np.abs(ledger - ledger[0]).max())
    highest = parts.max(axis=1)
    scale = float(max((highest - parts.min(axis=1)).max(), highest[0]))
    scale = max(scale, SOLVED * float(np.abs(parts).max()))
    return worst / scale if scale > 0 else worst, scale


def is_of_balance(notice: str) -> bool:
    """Check whether a notice is one of those about the energy balance."""
    return notice.startswith((VIOLATED, DECREASES))


def of_balance(run: Any, given: Sequence[str]) -> Iterator[str]:
    """Yield a notice about energies that miss the work done, or that contacts increase.

    `given` are the other notices, some of which may be about impulses that no energy contains.

    Steps suit the motion alone. For a prescribed motion, the largest step is used regardless of the
    required power, so forces that start and end within a step are missed.
    """
    energies = run.kinetic_energy, run.potential_energy, run.work, run.dissipation
    parts = np.array(energies)
    drift, scale = energy_drift(parts)
    if not scale > SOLVED * np.abs(parts).max():
        return
    if (gain := _given_by_contacts(run)) > VISIBLE * scale:
        yield (
            f"{DECREASES} {gain:.3g} J, {percent(gain / scale)} of the range of the energies, "
            "although contacts only take energy: the steps do not resolve the contacts; give a "
            "smaller step"
        )
    elif drift > VISIBLE and (named := _named(given)):
        yield f"{VIOLATED} {percent(drift)} of their range, with the {named} named above"
    elif drift > VISIBLE and scale > SOLVED * _work_of_forces(run):
        fixed = run.header.get("step") is not None
        do = "a smaller step" if fixed else "a smaller rtol, or a step"
        yield (
            f"{VIOLATED} {percent(drift)} of their range: the steps are too large for the power "
            f"of the forces, or skip a force; give {do}"
        )


def _named(given: Sequence[str]) -> str:
    """Return what other notices name that no energy contains, or ""."""
    known = {UNBOOKED: "impulses", UNKEPT: "jumps of paths"}
    found = (word for part, word in known.items() if any(part in text for text in given))
    return " and ".join(found)


def _work_of_forces(run: Any) -> float:
    """Return the work of all forces at the start along the length of the mechanism, or along 1 rad
    [J], as if none of them cancelled another one."""
    packed, (q, v) = run.mechanism.packed, run._with_states(slice(0, 1))
    sizes = force_sizes(packed, all_forces(run), q[0], v[0])
    return float(sizes @ np.where(packed.slides, packed.length, 1.0))


def _given_by_contacts(run: Any) -> float:
    """Compute the largest decrease of the dissipation since a frame with open contacts [J].

    The dissipation includes the energy that compliant contacts store, none where they are open.
    Impulses of rigid contacts and of limits do not resolve an impact, so it is 0 with them.
    """
    yielding = [c for c in run.model.contacts if c.law != "complementarity"]
    if not yielding or not (gaps := run.contacts.gap) or run.contacts.limit:
        return 0.0
    if any(not any(c.has_touch(name) for c in yielding) for name in gaps):
        return 0.0
    closed = np.any([gap < 0.0 for gap in gaps.values()], axis=0)
    most = np.maximum.accumulate(np.where(closed, -np.inf, run.dissipation))
    return float((most - run.dissipation).max(initial=0.0))
