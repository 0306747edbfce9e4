"""The pairs of bodies that a contact covers, in particular one of "*"."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import TYPE_CHECKING

from ..fields import EVERY, GROUND
from ..joints import restrains
from ..model import Contact

if TYPE_CHECKING:
    from ..packing.packed import Packed


class Covered:
    """The pairs of bodies of each contact of a model.

    A contact that names both bodies of a pair takes the place of one with a "*", and this one of
    "*" and "*". This also holds while it is off: the two then do not touch. Contacts of points add
    to the others.
    """

    def __init__(self, mech: Packed):
        self.number, self.system = mech.topology.number, mech.system
        self.shaped = [b.name for b in mech.model.bodies if b.touching]
        self.joined = {
            (self.number(b.parent), self.number(b.name))
            for b in mech.model.bodies
            if b.parent != GROUND and restrains(b.sequence)
        }
        self.claims = self._claims(mech.model.contacts)
        named = {(a, b) for a, b in self.claims if a and not self._fixed(a, b)}
        self.apart = self.joined | named  # numbers of bodies that are no pair of "*" and "*"

    def pairs(self, c: Contact) -> Iterator[tuple[str, str]]:
        """Yield the pairs of bodies of a contact.

        Bodies that are fixed to each other, or connected by a joint that restrains them, only
        touch if both are named.
        """
        stars = c.pair.count(EVERY)
        for body, other in _named(c, self.shaped):
            key = self._key(body, other)
            claimed = self.claims.get(key, stars) < stars
            if not (stars and (key in self.joined or self._fixed(*key) or claimed)):
                yield body, other

    def _claims(self, contacts: Sequence[Contact]) -> dict[tuple[int, int], int]:
        """Return the fewest "*" in the contacts of two bodies, if less than two."""
        found = dict[tuple[int, int], int]()
        if all(EVERY not in c.pair for c in contacts):
            return {}
        for c in contacts:
            stars = c.pair.count(EVERY)
            for pair in _named(c, self.shaped) if stars < 2 and not c.points else ():
                key = self._key(*pair)
                found[key] = min(found.get(key, stars), stars)
        return found

    def _key(self, body: str, other: str) -> tuple[int, int]:
        """Return the numbers of two bodies, the smaller one first."""
        a, b = sorted((self.number(body), self.number(other)))
        return a, b

    def _fixed(self, a: int, b: int) -> bool:
        return self.system.row_of(a) == self.system.row_of(b)


def _named(c: Contact, shaped: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield all pairs of bodies that a contact names, with "*" for each of `shaped`."""
    if c.pair == (EVERY, EVERY):
        yield from combinations(shaped, 2)
        return
    for body in shaped if c.body == EVERY else [c.body]:
        for other in shaped if c.other == EVERY else [c.other]:
            if body != other:
                yield body, other
