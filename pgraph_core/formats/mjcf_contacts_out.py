"""Contacts of an MJCF file that is written: friction of geoms, pairs added and excluded."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from ..fields import EVERY, GROUND
from ..joints import restrains
from ..model import Body, Contact, Model
from ..shapes import kind_of
from .conversion import Report, at_origin, names_beside
from .mjcf_contacts import FRICTIONLESS, Law
from .urdf_out import Tag

WORLD = "world"


class OddPair(NamedTuple):
    """A pair of bodies, or a body and the ground, with the friction between them."""

    body: Body
    other: Body | None
    friction: Law


def _touching(body: Body) -> Iterator[int]:
    """Yield the indices of the body's collision shapes that are exported."""
    for k, shape in enumerate(body.shapes):
        if shape.role != "visual" and kind_of(shape).mjcf(shape) is not None:
            yield k


def geom_name(body: Body, k: int) -> str:
    """Return the geom name for a shape."""
    return f"{body.name} shape {k + 1}"


def condim(law: Law) -> str:
    """Return MuJoCo's dimension of a contact: without friction, sliding, spinning or rolling."""
    return "6" if law.rolling else "4" if law.spinning else "3" if law.sliding else "1"


class ContactsOut:
    """The contacts of a model, by MuJoCo's rules for geoms that touch."""

    def __init__(self, model: Model, name: str):
        self.model, self.report = model, Report(name)
        self.body_names = {b.name: b.name for b in model.bodies}
        self.own_world = WORLD in self.body_names and at_origin(model.body(WORLD))  # has its solids
        if WORLD in self.body_names and not self.own_world:
            self.body_names = names_beside(WORLD, self.body_names)
            text = f'is the body "{self.body_names[WORLD]}", because "{WORLD}" is the ground'
            self.report.add("converted", f"body '{WORLD}'", text, part=WORLD)
        self.floor = {c.body: c for c in model.contacts if c.active and c.other == GROUND}
        self.above = {c.body for c in model.contacts if not c.active and c.other == GROUND}
        self.named = [c for c in model.contacts if c.other != GROUND]
        self.touch = [c for c in self.named if c.active]
        self.of_ground = self._ground_law()
        self.pairs = [*self._odd_pairs([b for b in model.bodies if b.touching])]
        paired = {b.name for ends in self.pairs for b in ends[:2] if b is not None}
        self.named_geoms = {
            (b.name, k) for b in model.bodies if b.name in paired for k in _touching(b)
        }

    def out(self, where: str, text: str, *, acts: bool = True, part: str = "") -> None:
        text = f"{text}, which is not written to MJCF"
        self.report.add("left out", where, text, acts=acts, part=part)

    def _law(self, name: str) -> Law:
        """Return the friction of a body's geoms. MuJoCo takes the larger of two that touch."""
        mine = [self._friction(c) for c in self.touch if {name, EVERY} & {*c.touches}]
        if self.of_ground is None:
            mine += [self._friction(c) for n, c in self.floor.items() if n in (name, EVERY)]
        return min(mine, default=FRICTIONLESS)

    def _ground_law(self) -> Law | None:
        """Return the ground plane's friction if its contacts share one value, the largest."""
        laws = {self._friction(c) for c in self.floor.values()}
        others = [self._friction(c) for c in self.touch]
        if len(laws) != 1:
            return None
        law = next(iter(laws))
        return law if all(x <= y for other in others for x, y in zip(other, law)) else None

    def _still(self, name: str) -> bool:
        """Check whether a body cannot move."""
        while name != GROUND:
            body = self.model.body(name)
            if body.joint != "weld":
                return False
            name = body.parent
        return True

    def _friction(self, c: Contact) -> Law:
        found = c.frictions(self.model.ground)
        return Law(found.kinetic, found.spinning, found.rolling)

    def _unsaid(self) -> None:
        """Report numbers of the contacts that act, their own or the ground's, without a word in
        MJCF."""
        ground, told = self.model.ground, dict[tuple[str, str], None]()
        for c in (c for c in self.model.contacts if c.active):
            friction, unsaid = c.frictions(ground), dict[str, float | None]()
            if friction.static > friction.kinetic:
                unsaid["static_friction"] = friction.static
            if c.law != "complementarity":
                unsaid |= {"stiffness": c.stiffness, "damping": c.damping}
            back = ground.restitution if c.restitution is None else c.restitution
            if back and unsaid.get("damping") is None:  # a given one takes its place
                unsaid["restitution"] = back
            for field, value in unsaid.items():
                if value is not None:
                    own = getattr(c, field) is not None
                    told[c.name if own else "", f"its {field} {value:g}"] = None
        for name, text in told:
            self.out(f"contact '{name}'" if name else GROUND, text, part=name)

    def _excluded(self, bodies: Sequence[Body]) -> Iterator[Tag]:
        """Yield exclusions for pairs of bodies that would touch in MuJoCo but do not touch here."""
        self._unsaid()
        solid = [b.name for b in bodies if b.touching]
        for c in (*self.floor.values(), *self.touch):
            if c.points:
                self.out(f"contact '{c.name}'", "its points")
            if c._varies:
                self.out(f"contact '{c.name}'", f"its friction {c.friction!r}")
            if c.law != "complementarity":
                text = f"law {c.law} is MuJoCo's own soft contact"
                self.report.add("approximated", f"contact '{c.name}'", text)
        for k, name in enumerate(solid):
            own = self.body_names[name]
            if self.floor and self._floor(name) is None and own != WORLD:
                yield Tag("exclude", body1=WORLD, body2=own)
            for other in solid[:k]:
                if not self._apart(name, other) and self._between(name, other) is None:
                    yield Tag("exclude", body1=self.body_names[other], body2=own)

    def _odd_pairs(self, solid: Sequence[Body]) -> Iterator[OddPair]:
        """Yield pairs of neighbours, and pairs whose friction is not the larger of the two."""
        for k, body in enumerate(solid):
            mine, floor = self._law(body.name), self._floor(body.name)
            if floor is not None and not self._still(body.name):
                law = tuple(map(max, mine, self.of_ground or FRICTIONLESS))
                if law != (wanted := self._friction(floor)):
                    yield OddPair(body, None, wanted)
            for other in solid[:k]:
                c, apart = self._between(body.name, other.name), self._apart(body.name, other.name)
                if c is None:
                    continue
                law = tuple(map(max, mine, self._law(other.name)))
                if apart or law != self._friction(c):
                    yield OddPair(other, body, self._friction(c))

    def _apart(self, one: str, two: str) -> bool:
        """Check whether two bodies are neighbours in MuJoCo, which touch as explicit pairs."""
        still = self._still(one), self._still(two)
        parent = self.model.body(one).parent, self.model.body(two).parent
        tied = (parent[0] == two and not still[1]) or (parent[1] == one and not still[0])
        return tied or all(still)

    def _floor(self, name: str) -> Contact | None:
        """Return the active contact of a body with the ground, preferring one that names it."""
        own = self.floor.get(name)
        return own if own or name in self.above else self.floor.get(EVERY)

    def _between(self, one: str, two: str) -> Contact | None:
        """Return the active contact between two bodies, preferring one that names both."""
        ends = self.model.body(one), self.model.body(two)
        # these touch only if both are named
        tied = any(b.parent in (one, two) and restrains(b.sequence) for b in ends)

        def meet(c: Contact) -> bool:
            here = (c.body in (one, EVERY) and c.other in (two, EVERY)) or (
                c.body in (two, EVERY) and c.other in (one, EVERY)
            )
            return here and not (tied and EVERY in (c.body, c.other))

        found = filter(meet, self.named)
        first = min(found, key=lambda c: (c.pair.count(EVERY), not c.active), default=None)
        return first if first is not None and first.active else None

    def _paired(self) -> Iterator[Tag]:
        """Yield geom pairs that have their own friction."""
        for body, other, law in self.pairs:
            others = (
                ["ground"] if other is None else [geom_name(other, k) for k in _touching(other)]
            )
            for one in (geom_name(body, k) for k in _touching(body)):
                for two in others:
                    five = (law.sliding, law.sliding, law.spinning, law.rolling, law.rolling)
                    yield Tag("pair", geom1=one, geom2=two, friction=five, condim=condim(law))
