"""Pairs of bodies that a constraint fastens to each other while their contact pushes them apart."""

from __future__ import annotations

from ..contact.tables import ContactPair, Tables
from ..fields import EVERY, GROUND
from ..mechanism import Mechanism
from ..model.constraint import AtPoints
from ..model.curve_point import CurvePoint
from ..packing import Array, Ints
from .clearance import gaps_later


def fastened(mech: Mechanism, active: Ints, pair: ContactPair) -> str:
    """Return the constraint that fastens the bodies of a pair, with a remedy, or ""."""
    solid = {b.name for b in mech.model.bodies if b.touching}
    for number in active.tolist():
        c = mech.model.constraints[number]
        if not isinstance(c, (AtPoints, CurvePoint)) or c.other == GROUND:
            continue
        both = {c.body, c.other}
        if both == {pair.body, pair.other} or (pair.body == EVERY and both <= solid):
            off = f"pg.Contact({f'{c.body} and {c.other}'!r}, body={c.body!r}, other={c.other!r}, "
            do = f"remove contact '{pair.contact.name}'"
            if EVERY in pair.contact.pair:
                do = f"add {off}active=False), which leaves it out"
            return (
                f"constraint '{c.name}' fastens '{c.body}' to '{c.other}', and contact "
                f"'{pair.contact.name}' pushes them apart: {do}, or start without overlap"
            )
    return ""


def parted(mech: Mechanism, active: Ints, tables: Tables, q: Array) -> str:
    """Return the first fastened pair that overlaps at the state q (nq,), as above, or ""."""
    named = [(pair, text) for pair in tables.touches if (text := fastened(mech, active, pair))]
    if not named:
        return ""
    gaps = gaps_later(mech, tables, q[None, : mech.nq], {})
    return next((text for pair, text in named if (gaps[pair.name] < 0.0).any()), "")
