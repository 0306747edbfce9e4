"""Notices about a run that follow from its plan, before it starts."""

from __future__ import annotations

from ..errors import choices
from ..mechanism import Mechanism
from .compliance import fastest_contact
from .rates import Rate, resolving_step
from .remedies import or_by_error
from .run_plan import RunPlan

SHORT = 20  # steps: looking for the fastest rate would cost more than a shorter run


def lost(lost: tuple[str, ...]) -> tuple[str, ...]:
    """Return a notice about parts of a file that the model lacks or approximates."""
    if not lost:
        return ()
    text = "the result differs from that of the file: "
    return (f"{text}{choices(lost, 3)}; model.lost contains all {len(lost)}",)


def too_wide(plan: RunPlan, rate: Rate) -> bool:
    """Check whether fixed steps are too large for the fastest rate at the start."""
    step, limit = plan.step, plan.method.limit
    if step is None or limit == 0.0 or int(plan.substeps.sum()) < SHORT:
        return False
    if rate() * step <= limit:
        return False
    return not plan.method.time_stepping or rate.explicit() * step > limit


def hard(mech: Mechanism, plan: RunPlan) -> list[str]:
    """Return a notice if fixed steps are too large for the stiffness or friction of contacts.

    A method without a limit damps rates that its steps do not resolve.
    """
    if plan.step is None or not plan.method.limit or plan.contacts is None:
        return []
    rate = fastest_contact(mech, plan.contacts, plan.start[0])
    if rate * plan.step <= 1.0:
        return []
    least = resolving_step(rate)
    return [
        f"soft or penalty contacts make rates of about {rate:.3g}/s, which steps of "
        f"{plan.step:.3g} s do not resolve: give {least:.2g} s or less{or_by_error(plan)}"
    ]


def filled(plan: RunPlan) -> list[str]:
    """Return a notice if meshes collide as convex hulls that are much larger than the meshes."""
    if plan.contacts is None or not plan.contacts.hulls:
        return []
    excess, body = max(plan.contacts.hulls)
    more = len(plan.contacts.hulls) - 1
    others = f", and {more} more" if more else ""
    return [
        f"the mesh of '{body}'{others} touches by its convex hull, whose volume is {excess:.3g} "
        "times its own, so hollows are filled; give its shape hull 'parts', or 'convex' to "
        "accept this"
    ]
