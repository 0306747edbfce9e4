"""Bookkeeping for time stepping: impulses for the next step, forces at its frame, a log."""

import math

from ...tolerances import SOLVED
from .. import layout as at
from ..arrays import BEFORE, EFFECT, LAMBDA, RHS
from ..cables import over_spans
from ..compiler.jit import part, sweep
from ..compiler.masks import both, either, more, most
from ..constraints.blocks import (
    along,
    ends_of,
    first_of,
    place_a,
    place_b,
    stations_of,
    type_of,
)
from ..constraints.coordinates import coefficient
from ..contact.closing import log_depth, smaller_size, thinner
from ..contact.contacts import (
    SLIDING,
    add_wrench,
    contacts_at,
    keep_point,
    kept_place,
    note,
    note_turn,
)
from ..contact.island_rows import gather
from ..contact.newton import LEAST_NORM
from ..contact.projections import tension_before
from ..motion import opened
from ..vec import add_scaled, load, load3, scale, set_xyz, xyz

BRIEF = 1e-3  # shortest sub-step whose impulses start the next step, relative to the step


@sweep
def note_chain(scene, first, t):
    """Count an impact at time t in which several bodies simultaneously push a body that rebounds.

    In this case, the result of Newton's law differs from that of successive impacts.
    """
    data = opened(scene)
    blocks, space = data.blocks, data.space
    tally = contacts_at(data.links.contacts).tally[0]
    active, slots, vectors = blocks.active, space.slots, space.vectors
    found = False
    for j in range(first, active[0] + 1):
        i = active[j]
        hit = blocks.blocks_f[i, at.BOUNCE] * vectors[BEFORE, first_of(slots, i)]
        if type_of(blocks.blocks_i, i) == at.T_CONTACT and hit < -SLIDING:
            for n in range(first, active[0] + 1):
                found = found or (
                    type_of(blocks.blocks_i, active[n]) == at.T_CONTACT
                    and vectors[LAMBDA, first_of(slots, active[n])] > 0.0
                    and meet_at_a_body(blocks.blocks_i, i, active[n])
                )
    if found:
        tally.chains += 1
        if tally.chains == 1:
            tally.chain_time = t


@part
def meet_at_a_body(blocks_i, i, n):
    """Check whether two contacts share exactly one moving body."""
    a, b = ends_of(blocks_i, i)
    c, d = ends_of(blocks_i, n)
    shared = (a > 0 and (a == c or a == d)) or (b > 0 and (b == c or b == d))
    same = (a == c and b == d) or (a == d and b == c)
    return shared and not same


@sweep
def book(scene, first, t, w, h, last):
    """Store the impulses for the next step, and as forces on bodies and contact pairs.

    The residuals of the contact laws are recorded for the frame and for the run. `t` is the end of
    the sub-step, whose width is w. A sub-step that is not the last of its step only adds points to
    the stored ones, since it may be so short that loaded contacts have no impulse.
    """
    data = opened(scene)
    blocks, work, space = data.blocks, data.work, data.space
    contacts = contacts_at(data.links.contacts)
    active, slots = blocks.active, space.slots
    lam = space.vectors[LAMBDA]
    found, kept, tally = contacts.found, contacts.kept, contacts.tally[0]
    pairs = contacts.pairs
    begin = tally.first_contact
    missed = contacts.islands.pushed
    whole = 1.0 / tally.share if tally.share > BRIEF else 1.0
    count = 0
    for j in range(first, active[0] + 1):
        n = active[j] - begin
        r = first_of(slots, active[j])
        if n < 0:
            book_limit(scene, active[j], pairs.shape[0] + n, t, w, h)
            continue
        force = (0.0, 0.0, 0.0)
        for c in range(3):
            d = load(blocks.blocks_f, active[j], at.DIR + 3 * c)
            force = add_scaled(force, lam[r + c] / h, d)
        if n >= found.shape[0]:  # belongs to the previous contact point
            if last:
                set_xyz(kept[count - 1].turn, scale(whole, (lam[r], lam[r + 1], lam[r + 2])))
            note_turn(opened(scene).links.contacts, n - found.shape[0], force)
            continue
        size = math.sqrt(lam[r] ** 2 + lam[r + 1] ** 2 + lam[r + 2] ** 2) / h
        pair = found[n].pair
        log_missed(tally, missed[active[j], 0] / h, missed[active[j], 1] / h, size, pair, t)
        log_depth(tally, -found[n].gap, thickness_at(contacts, n), pair, t)
        u = gather(space.y, slots, active[j], space.vectors[EFFECT])
        x, z = space.vectors[RHS, r + 1] + u[1], space.vectors[RHS, r + 2] + u[2]
        slip = math.sqrt(x * x + z * z)
        place_in = count
        if not last:
            new = lam[r] > 0.0 and tally.share > 0.0
            new = new and kept_place(found[n], kept, tally.kept, n) < 0
            place_in = tally.kept if new and tally.kept < kept.shape[0] else -1
        if place_in >= 0:
            push = scale(whole, (lam[r], lam[r + 1], lam[r + 2]))
            if tally.share < BRIEF and found[n].held[0] > 0.0:  # continues as before an impact
                push = xyz(found[n].held)
            keep_point(kept[place_in], found[n], push)
            least = blocks.blocks_f[active[j], at.SETTLED] == LEAST_NORM
            kept[place_in].settled = 1 if least else 0
            push, mu = load3(lam, r), blocks.blocks_f[active[j], at.FRICTION]
            kept[place_in].slides = int(goes_on_sliding(push, mu, space.vectors[RHS, r], slip))
            if last:
                count += 1
            else:
                tally.kept += 1
        note(opened(scene).links.contacts, work, n, force, slip)
        pushed(pairs[pair], lam[r], t, w)
    if last:
        tally.kept = count


@sweep
def book_limit(scene, i, n, t, w, h):
    """Store the impulse of joint friction, or of a limit in row n of the contact pairs."""
    data = opened(scene)
    blocks, contacts = data.blocks, contacts_at(data.links.contacts)
    lam = data.space.vectors[LAMBDA, first_of(data.space.slots, i)]
    kind, one = type_of(blocks.blocks_i, i), blocks.blocks_f[i]
    if kind == at.T_SPAN:
        note_span(scene, i, scale(lam / h, along(data.space.place, i, 0)))
        force = math.copysign(lam / h, one[at.VALUE])
    elif kind == at.T_SLACK or kind == at.T_WRAP:
        force = lam / h
        first, last = stations_of(blocks.blocks_i, i)
        note_spans((contacts.wrenches, force), blocks.stations, data.work, first, last)
        lam += tension_before(data, i)
        force = lam / h
    else:
        term = blocks.blocks_i[i, at.B_TERM]
        # on the first joint that it bounds
        force = coefficient(blocks, data.space.place, i, term) * lam / h
        for k in range(term, term + blocks.blocks_i[i, at.B_TERMS]):
            share = coefficient(blocks, data.space.place, i, k)
            contacts.limit_tau[blocks.terms_i[k, 0]] += share * lam / h
    if kind == at.T_FRICTION:
        one[at.HELD] = lam * one[at.VALUE] / one[at.AIM]
        return
    contacts.pairs[n].force[0] += force
    pushed(contacts.pairs[n], lam, t, w)
    missed = contacts.islands.pushed[i, 0] / h
    log_missed(contacts.tally[0], missed, 0.0, abs(force), n, t)


@part
def pushed(pair, impulse, t, w):
    """Note the end t of a sub-step of width w in which a contact pair or a limit pushes."""
    if impulse > 0.0:
        pair.ended = t
        if w == 0.0:
            pair.struck = min(pair.struck, t)


@part
def note_tension(to, vias, work, n, p, q, along):
    """Add the tension of a span to the wrenches on its two bodies."""
    wrenches, tension = to
    a, b, force = vias[n - 1], vias[n], scale(tension, along)
    add_wrench(wrenches, work, a.body, a.row, p, force)
    add_wrench(wrenches, work, b.body, b.row, q, scale(-1.0, force))
    return 0.0


note_spans = over_spans(note_tension)


@sweep
def note_span(scene, i, force):
    """Add the force of a length bound, `force` on A, to the wrenches on its two bodies."""
    data = opened(scene)
    work, place = data.work, data.space.place
    wrenches = contacts_at(data.links.contacts).wrenches
    a, b = ends_of(data.blocks.blocks_i, i)
    body_a, body_b = data.blocks.blocks_i[i, at.B_BODY_A], data.blocks.blocks_i[i, at.B_BODY_B]
    add_wrench(wrenches, work, body_a, a, place_a(place, i), force)
    add_wrench(wrenches, work, body_b, b, place_b(place, i), scale(-1.0, force))


@part
def goes_on_sliding(lam, mu, closing, slip):
    """Return 1 if a point slides fast, or slips with the full friction of its cone, or else 0.

    `closing` is its normal velocity without impulses.
    """
    pull = math.sqrt(lam[1] * lam[1] + lam[2] * lam[2])
    moves = more(slip, SOLVED * abs(closing))  # some points of a patch may be full
    full = both(more(lam[0], 0.0), most((1.0 - SOLVED) * (mu * lam[0]), pull))
    return either(more(slip, SLIDING), both(moves, full))


@part
def log_missed(tally, complementarity, cone, force, pair, t):
    """Log the residual of a single contact's laws [N], and its force."""
    tally.complementarity = max(tally.complementarity, complementarity)
    tally.cone = max(tally.cone, cone)
    tally.force = max(tally.force, force)
    most = max(complementarity, cone)
    if most > tally.worst:
        tally.worst = most
        tally.worst_pair = pair
        tally.worst_time = t


@part
def thickness_at(contacts, n):
    """Return the thickness of the thinner shape at contact point n, or the shapes' size [m]."""
    a, b = contacts.found[n].shape_a, contacts.found[n].shape_b
    thick = 2.0 * thinner(contacts, a, b)
    return thick if thick > 0.0 else smaller_size(contacts, a, b)
