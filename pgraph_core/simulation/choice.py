"""The choice of a method and step: as asked, or those that suit the scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..dynamics.scene import contact_tables, rubs
from ..errors import InputError, Problem
from ..forces import Cable
from ..integrators import DOP853, DOPRI5, MOREAU_JEAN, RADAU5, RK4, Method, method_of
from ..mechanism import Mechanism
from ..model.settings import AUTO, STEP
from ..packing import Loads
from ..packing.constraints import block_arrays
from ..packing.programs import contacts_read
from .compliance import fastest_contact
from .options import Options
from .rates import Rate, resolving_step
from .run_plan import RunPlan

if TYPE_CHECKING:
    from ..contact.tables import Tables
    from .event_scene import ContactPoint

STEPPED = MOREAU_JEAN.name  # for every contact, limit and friction of a joint
MANY_RADIANS = 1e5  # radians of the fastest oscillation in a run: more are not worth resolving


def given_step(mech: Mechanism, plan: RunPlan, o: Options) -> float | None:
    """Return the requested step size, or the one required by penalty contacts if none is given."""
    contacts = plan.contacts
    asked = (o.usual, o.step, o.rtol) != (None, None, None)
    if asked or contacts is None or not contacts.remembers or plan.impulses:
        return o.step
    return min(STEP, resolving_step(fastest_contact(mech, contacts, plan.start[0])))


def method_for(rate: Rate, plan: RunPlan, o: Options) -> tuple[Method, str]:
    """Return the requested method, or a suitable one for "auto", with the reason for it.

    Raises InputError.
    """
    impulses, touching = plan.impulses, plan.contacts is not None
    tendons = plan.contacts is not None and plan.contacts.tendons
    rubbing = rubs(plan.drives)
    slipping = next((f for f in plan.acting if isinstance(f, Cable) and f._slips), None)
    if (name := o.method or AUTO) != AUTO:
        method = method_of(name, impulses=impulses, touching=touching or rubbing)
        if method is MOREAU_JEAN and slipping is not None:
            text = f"'{name}' does not take the friction of the cable '{slipping.name}' on wheels, "
            text += "as it stretches; use 'dop853', or leave its stiffness out"
            raise InputError(Problem("simulate", "method", text))
        return method, f"{name}: as asked"
    if impulses and slipping is None and (o.rtol is None or tendons):
        return MOREAU_JEAN, "moreau_jean: the scene has rigid contacts or joint limits"
    if rubbing and slipping is None and o.rtol is None:
        return MOREAU_JEAN, "moreau_jean: dry friction of joints or tendons, which may stick"
    loose = o.rtol is not None and o.rtol > 1e-5
    if impulses:
        if loose:
            return DOPRI5, "dopri5: rigid contacts or joint limits with a loose tolerance"
        return DOP853, "dop853: rigid contacts or joint limits with a tight tolerance"
    step = o.step or o.usual
    if step is not None and o.rtol is None:
        if rate() * step > RK4.limit:
            text = f"radau5: the fastest rate, {rate():.3g}/s, times the step is too much for rk4"
            return RADAU5, text
        if touching:
            return RK4, "rk4: soft or penalty contacts at a fixed step, narrower inside hard ones"
        return RK4, "rk4: the most accurate of the methods for smooth motion at a fixed step"
    if rate() * rate.span > MANY_RADIANS and rate() > 30.0 * (rest := rate.without_forces()):
        text = f"radau5: springs or dampers make rates of {rate():.3g}/s, the rest {rest:.3g}/s"
        return RADAU5, text
    if touching:
        return DOPRI5, "dopri5: soft contacts, whose forces are not smooth, with adaptive steps"
    if loose:
        return DOPRI5, "dopri5: smooth motion with a loose tolerance"
    return DOP853, "dop853: smooth motion with a tight tolerance and adaptive steps"


def event_driven(
    mech: Mechanism, contacts: Tables, loads: Loads
) -> tuple[Tables | None, tuple[ContactPoint, ...]]:
    """Compute (soft contacts, rigid contact points and limits) for an event-driven run."""
    if contacts.remembers:
        text = (
            "a penalty contact stores its sticking point, so steps with events cannot be repeated"
        )
        text += "; give the contacts law 'soft' or 'complementarity', or use method 'moreau_jean'"
        raise InputError(Problem("simulate", "method", text))
    rigid = {t.contact.name for t in contacts.touches if t.contact.law != "soft"}
    numbers = contacts_read(loads.signals[0])
    if read := rigid & {c.name for i, c in enumerate(mech.model.contacts) if i in numbers}:
        text = f"a control reads the force of the rigid contact '{min(read)}', which is a signal in"
        text += " time stepping only; use method 'moreau_jean'"
        raise InputError(Problem("simulate", "method", text))
    from .event_scene import contact_points

    if contacts.tendons:
        text = "limits of tendons and springs, and cables without a stiffness, require time "
        text += "stepping; use method 'moreau_jean'"
        raise InputError(Problem("simulate", "method", text))
    points = contact_points(mech.model, mech.topology, mech.packed.system, contacts)
    soft = tuple(t.contact for t in contacts.touches if t.contact.law == "soft")
    rest = contact_tables(mech.packed, tuple(dict.fromkeys(soft)))
    if rest is None or not rest.touches:
        return None, points
    return rest._replace(limits=(), limit_blocks=block_arrays(()), cables=()), points
