"""Contacts in an MJCF file that is read or written.

A file that is read has the ground, walls, and the pairs of bodies that may touch. One that is
written has the friction of geoms, and pairs that are added or excluded.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import choices
from ..fields import EVERY, GROUND
from ..model import Body, Contact, Model
from ..rotation import quaternion_of
from ..tolerances import SOLVED, VISIBLE
from .conversion import TALL, Report
from .mjcf_compiled import Reading
from .urdf_out import Tag

Array = np.ndarray
PLANE = 0  # mjtGeom
HALF_EDGE = TALL / 2  # m: of the box that stands for a plane without end that is no ground


class Law(NamedTuple):
    """The friction of a pair: sliding, spinning and rolling."""

    sliding: float
    spinning: float
    rolling: float


FRICTIONLESS = Law(0.0, 0.0, 0.0)


class Contacts:
    """The contacts of a model, following MuJoCo's rules for which geoms may touch.

    If `filters` is true, contacts between a body and its parent are excluded, as is the default in
    MuJoCo.
    """

    def __init__(self, reader: Reading, filters: bool):
        self.reader, self.m, self.report = reader, reader.m, reader.report
        self.filters = filters
        home = self.m.home
        self.placed = list(zip(home.geom_xpos, home.geom_xmat.reshape(-1, 3, 3), strict=True))
        self.floors, self.walls = self._planes()
        self._body_of = self.m.geom_bodyid.tolist()

    def _planes(self) -> tuple[list[int], list[int]]:
        """Return the world planes that form the ground, and the other ones."""
        m = self.m
        floors: list[int] = []
        walls: list[int] = []
        for g in range(m.ngeom):
            root = m.body_weldid[m.geom_bodyid[g]]
            if m.geom_type[g] != PLANE or (root and m.body_mocapid[root] < 0):  # not a fixed plane
                continue
            place, turn = self.placed[g]
            flat = turn[2, 2] > 1 - SOLVED and abs(place[2]) < SOLVED
            touches = self.m.touching[g]
            if not touches:
                text = "a plane that touches nothing"
                self.reader.left_out("geom", m.geom(g).name, text, acts=False)
            if flat or not touches:
                floors.append(g)
            else:
                walls.append(g)
        return floors, walls

    def world(self) -> list[dict[str, Any]]:
        """Return a body fixed to the ground with the world's solids, if there are any."""
        shapes = [shape for g in self.walls for shape in self._wall(g)]
        shapes += self._solids_of_the_world()
        if not shapes:
            return []
        none = {"mass": 0.0, "inertia": ((0.0,) * 3,) * 3, "joint": "weld"}
        return [{"name": "world", "shapes": shapes, **none}]

    def _solids_of_the_world(self) -> Iterator[dict[str, Any]]:
        planes = {*self.floors, *self.walls}
        for g in range(self.m.body_geomadr[0], self.m.body_geomadr[0] + self.m.body_geomnum[0]):
            if g not in planes and (shape := self.reader.solid(g)):
                yield shape

    def _wall(self, g: int) -> Iterator[dict[str, Any]]:
        """Yield a collision box and a visual box, each with one face on the plane."""
        m = self.m
        drawn = [float(s) for s in m.geom_size[g][:2]]
        place, axes = self.placed[g]
        where = self.reader.where("geom", m.geom(g).name)
        wide = [max(s, HALF_EDGE) for s in drawn]
        thickest = 2 * VISIBLE * HALF_EDGE
        text = f"a plane that is not z = 0 is a box {thickest} m thick and {2 * min(wide):g} m wide"
        self.report.add("approximated", where, text)
        roles = ("collision", wide, thickest), ("visual", drawn, VISIBLE * thickest)
        for role, (x, y), thick in roles:
            if x and y:
                yield {
                    "kind": "box",
                    "size": (2 * x, 2 * y, thick),
                    "position": tuple((place - thick / 2 * axes[:, 2]).tolist()),
                    "rotation": quaternion_of(axes),
                    "role": role if all(drawn) else "both",
                }

    def contacts(self, bodies: list[dict[str, Any]]) -> Iterator[Contact]:
        """Yield contacts by MuJoCo's rules. Pairs that share one law become one contact of '*'.

        If trees of bodies are alike, two of each kind say whether that is so.
        """
        solid = {
            b["name"] for b in bodies if any(s.get("role") != "visual" for s in b.get("shapes", ()))
        }
        every = [*range(self.m.nbody)]
        few = self._two_of_each_kind()
        if len(few) < len(every):
            found = self._laws(few)
            here = solid & {"world", *(self.reader.names[b] for b in few)}
            contacts = [*self._contacts(here, found[0], few)]
            uniform = all(c.body == EVERY for c in contacts)
            if uniform and all(len(laws) == 1 for laws in found[0].values()):
                self._tell(*found)
                yield from contacts
                return
        found = self._laws(every)
        self._tell(*found)
        yield from self._contacts(solid, found[0], every)

    def _two_of_each_kind(self) -> list[int]:
        """Return the bodies of at most two of the trees that no rule of contacts tells apart."""
        m, own = self.m, self._rules()
        geoms: dict[int, list[Any]] = {}
        for g in range(m.ngeom):
            geoms.setdefault(int(m.geom_bodyid[g]), []).append((bool(m.touching[g]), *own[g][1:]))
        roots = m.body_rootid.tolist()
        ends = [(int(s) >> 16, int(s) & 0xFFFF) for s in m.exclude_signature]
        ends += [(int(m.geom_bodyid[g]), int(m.geom_bodyid[h]))
                 for g, h in zip(m.pair_geom1, m.pair_geom2)]  # fmt: skip
        named = {roots[b] for pair in ends for b in pair}
        trees: dict[int, list[int]] = {}
        for b, root in enumerate(roots):
            trees.setdefault(root, []).append(b)
        kinds, kept = Counter[Any](), list[int]()
        for root, tree in trees.items():
            above = [(int(m.body_parentid[b]) - root, int(m.body_weldid[b]) - root) for b in tree]
            rows = [(*pair, *geoms.get(b, ())) for pair, b in zip(above, tree)]
            fixed = root in named or m.body_weldid[root] == 0
            kind = root if fixed else (len(tree), *rows[0][1:], *rows[1:])
            kinds[kind] += 1
            if kinds[kind] <= 2:
                kept += tree
        return kept

    def _contacts(
        self, solid: set[str], counted: dict[tuple[str, str], Counter[Law]], among: list[int]
    ) -> Iterator[Contact]:
        """Yield the contacts between solid bodies, of the pairs `among` bodies of MuJoCo."""
        laws = {pair: max(each) for pair, each in counted.items()}
        floor = {
            body: law for (body, other), law in laws.items() if other == GROUND and body in solid
        }
        moving = {self.reader.names[b] for b in among if b and self.m.body_weldid[b] != 0}
        if floor and set(floor) == solid & moving == solid and len(set(floor.values())) == 1:
            yield _contact("floor", EVERY, GROUND, next(iter(floor.values())))
        else:
            yield from (_contact(f"{b} floor", b, GROUND, law) for b, law in floor.items())
        pairs = {
            pair: law for pair, law in laws.items() if GROUND not in pair and set(pair) <= solid
        }
        if pairs and len(set(pairs.values())) == 1 and set(pairs) == self._all_pairs(solid, among):
            yield _contact("bodies", EVERY, EVERY, next(iter(pairs.values())))
            return
        for (body, other), law in pairs.items():
            yield _contact(f"{body}, {other}", body, other, law)

    def _all_pairs(self, solid: set[str], among: list[int]) -> set[tuple[str, str]]:
        """Return the pairs covered by '*' and '*', excluding those connected by a joint or weld."""
        m, names = self.m, self.reader.names
        found: set[tuple[str, str]] = set()
        for n, b in enumerate(among):
            for a in among[:n] if b else ():
                tied = m.body_parentid[b] == a or m.body_weldid[a] == m.body_weldid[b]
                if a and not tied and names[a] in solid and names[b] in solid:
                    found.add((names[a], names[b]))
        return found

    def _laws(self, among: list[int]) -> tuple[dict[tuple[str, str], Counter[Law]], dict[int, str]]:
        """Return ({(body, other): pairs of geoms by friction}, owners of geoms) of some bodies.

        All planes are one ground.
        """
        kept = {*among}
        m = self.m
        excluded = {(int(s) >> 16, int(s) & 0xFFFF) for s in m.exclude_signature}
        excluded |= {(b, a) for a, b in excluded}
        able = [g for g in range(m.ngeom) if m.touching[g] and int(m.geom_bodyid[g]) in kept]
        owners = {g: self._owner(g) for g in able}
        alike: dict[Any, list[int]] = {}
        rules = self._rules()
        for g in able:
            alike.setdefault((owners[g], *rules[g]), []).append(g)
        found: dict[tuple[str, str], Counter[Law]] = {}  # pairs of geoms by their friction
        listed = self._listed()
        classes = list(alike.values())
        for n, these in enumerate(classes):
            for those in classes[: n + 1]:
                g, h = these[0], those[0]
                pair = self._pair(g, h)
                if pair is None or not self._masks(g, h):
                    continue
                a, b = int(m.geom_bodyid[g]), int(m.geom_bodyid[h])
                if (a, b) in excluded or self._related(a, b):
                    continue
                planes = (these if g in self.floors else those) if GROUND in pair else ()
                count = len(these) * len(those) // max(len(planes), 1)
                count -= sum(k in listed for k in self._keys(these, those)) if listed else 0
                found.setdefault(pair, Counter())[self._friction(g, h)] += count
        for (g, h), law in listed.items():
            if (pair := self._pair(g, h)) is not None:
                found.setdefault(pair, Counter())[law] += 1
        return {pair: +laws for pair, laws in found.items() if +laws}, owners

    def _tell(self, found: dict[tuple[str, str], Counter[Law]], owners: dict[int, str]) -> None:
        """Report what is approximated in contacts."""
        m = self.m
        mixed = [pair for pair, laws in found.items() if len(laws) > 1]
        if mixed:
            text = f"{len(mixed)} pairs of bodies whose geoms differ in friction have the largest"
            self.report.add("approximated", self.reader.path.name, text)
        count = Counter(owners.values())
        count[GROUND] = 1
        more = [
            f"'{body}' and '{other}'"
            for (body, other), laws in found.items()
            if laws.total() < count[body] * count[other]
        ]
        if more:
            text = "touch with all of their shapes; in the file some of their geoms do not touch"
            self.report.add("approximated", self.reader.path.name, f"{choices(more, 4)} {text}")
        if found:
            text = "contacts are rigid: MuJoCo's solref and solimp make them soft"
            self.report.add("approximated", self.reader.path.name, text)
        touching = (m.geom_contype | m.geom_conaffinity) > 0
        wide = int((touching & (m.geom_margin > m.geom_gap)).sum())
        wide += int((m.pair_margin > m.pair_gap).sum())
        if found and wide:
            text = (
                f"{wide} geoms or pairs have a margin and push before they touch; here they do not"
            )
            self.report.add("approximated", self.reader.path.name, text)

    def _rules(self) -> list[Any]:
        """Return, for each geom, the properties that determine its contacts and their friction."""
        m = self.m
        tables = (m.geom_contype, m.geom_conaffinity, m.geom_condim, m.geom_priority)
        rows = np.column_stack((m.geom_bodyid, *tables, m.geom_friction))
        return [*map(tuple, rows.tolist())]

    def _masks(self, g: int, h: int) -> bool:
        """Check whether the masks of two geoms allow contact."""
        m = self.m
        return bool(
            m.geom_contype[g] & m.geom_conaffinity[h] or m.geom_contype[h] & m.geom_conaffinity[g]
        )

    def _listed(self) -> dict[tuple[int, int], Law]:
        """Return the friction for each geom pair listed in the file."""
        m, found = self.m, dict[tuple[int, int], Law]()
        for p in np.flatnonzero(m.pair_dim):
            one, across, spin, roll, along = (float(x) for x in m.pair_friction[p])
            if (one != across and m.pair_dim[p] > 1) or (roll != along and m.pair_dim[p] > 4):
                text = "friction that depends on the direction: its first number holds for all"
                self.reader.left_out("pair", m.pair(p).name, text)
            key = self._geoms(int(m.pair_geom1[p]), int(m.pair_geom2[p]))
            found[key] = _law(int(m.pair_dim[p]), one, spin, roll)
        return found

    def _keys(self, these: list[int], those: list[int]) -> set[tuple[int, int]]:
        """Return all pairs of geoms from two classes."""
        return {self._geoms(g, h) for g in these for h in those}

    def _pair(self, g: int, h: int) -> tuple[str, str] | None:
        """Return (body, other) for two geoms, or None if neither can move."""
        m = self.m
        a, b = int(m.geom_bodyid[g]), int(m.geom_bodyid[h])
        if m.body_weldid[a] == m.body_weldid[b]:
            return None
        (_, body), (_, other) = sorted(((b, self._owner(h)), (a, self._owner(g))))
        return (other, body) if body == GROUND else (body, other)

    def _owner(self, g: int) -> str:
        """Return the name of the body that owns a geom here: the ground, "world" or a body."""
        if g in self.floors:
            return GROUND
        b = self._body_of[g]
        return "world" if b == 0 or g in self.walls else self.reader.names[b]

    def _geoms(self, g: int, h: int) -> tuple[int, int]:
        """Return two geoms in order, with all ground planes represented by the first one."""
        one, two = sorted(self.floors[0] if x in self.floors else x for x in (g, h))
        return one, two

    def _related(self, a: int, b: int) -> bool:
        """Check whether MuJoCo excludes a pair: welded, or a parent and child off the world."""
        m = self.m
        one, two = int(m.body_weldid[a]), int(m.body_weldid[b])
        if one == two:
            return True
        above = [int(m.body_weldid[m.body_parentid[x]]) for x in (one, two)]
        parent = (one == above[1] and one != 0) or (two == above[0] and two != 0)
        return parent and self.filters

    def _friction(self, g: int, h: int) -> Law:
        m = self.m
        one, two = int(m.geom_priority[g]), int(m.geom_priority[h])
        if one != two:
            x = m.geom_friction[g if one > two else h]
            dim = int(m.geom_condim[g if one > two else h])
        else:
            x = np.maximum(m.geom_friction[g], m.geom_friction[h])
            dim = max(int(m.geom_condim[g]), int(m.geom_condim[h]))
        return _law(dim, *(float(c) for c in x))


def _law(dim: int, sliding: float, spinning: float, rolling: float) -> Law:
    return Law(
        sliding if dim > 1 else 0.0, spinning if dim > 3 else 0.0, rolling if dim > 4 else 0.0
    )


def _contact(name: str, body: str, other: str, law: Law) -> Contact:
    return Contact(
        name=name, body=body, other=other, friction=law.sliding,
        spinning_friction=law.spinning or None, rolling_friction=law.rolling or None,
    )  # fmt: skip


# -- contacts of a file that is written ------------------------------------------------------------

MESHES = (".stl", ".obj")
SOLIDS = ("box", "sphere", "capsule", "cylinder", "ellipsoid")
WORLD = "world"


class OddPair(NamedTuple):
    """A pair of bodies, or a body and the ground, with the friction between them."""

    body: Body
    other: Body | None
    friction: Law


def _touching(body: Body) -> Iterator[int]:
    """Yield the indices of the body's collision shapes that are exported."""
    for k, shape in enumerate(body.shapes):
        mesh = shape.kind == "mesh" and Path(shape.file or "").suffix.lower() in MESHES
        if shape.role != "visual" and (mesh or shape.kind in SOLIDS):
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
        self.floor = {c.body: c for c in model.contacts if c.active and c.other == GROUND}
        self.touch = [c for c in model.contacts if c.active and c.other != GROUND]
        self.of_ground = self._ground_law()
        self.pairs = [*self._odd_pairs([b for b in model.bodies if b.touching])]
        paired = {b.name for ends in self.pairs for b in ends[:2] if b is not None}
        self.named_geoms = {
            (b.name, k) for b in model.bodies if b.name in paired for k in _touching(b)
        }

    def out(self, where: str, text: str, *, acts: bool = True) -> None:
        self.report.add("left out", where, f"{text}, which is not written to MJCF", acts=acts)

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
        return Law(
            c.frictions(self.model.ground).kinetic,
            c.spinning_friction or 0.0,
            c.rolling_friction or 0.0,
        )

    def _excluded(self, bodies: Sequence[Body]) -> Iterator[Tag]:
        """Yield exclusions for pairs of bodies that would touch in MuJoCo but do not touch here."""
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
            if self.floor and not ({name, EVERY} & self.floor.keys()) and name != WORLD:
                yield Tag("exclude", body1=WORLD, body2=name)
            for other in solid[:k]:
                if not self._apart(name, other) and self._between(name, other) is None:
                    yield Tag("exclude", body1=other, body2=name)

    def _odd_pairs(self, solid: Sequence[Body]) -> Iterator[OddPair]:
        """Yield pairs of neighbours, and pairs whose friction is not the larger of the two."""
        for k, body in enumerate(solid):
            mine, floor = self._law(body.name), self.floor.get(body.name) or self.floor.get(EVERY)
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

    def _between(self, one: str, two: str) -> Contact | None:
        """Return the contact between two bodies, preferring one that names both."""
        parent = self.model.body(one).parent, self.model.body(two).parent
        tied = parent[0] == two or parent[1] == one  # these touch only if both are named

        def meet(c: Contact) -> bool:
            here = (c.body in (one, EVERY) and c.other in (two, EVERY)) or (
                c.body in (two, EVERY) and c.other in (one, EVERY)
            )
            return here and not (tied and EVERY in (c.body, c.other))

        found = filter(meet, self.touch)
        return min(found, key=lambda c: (c.body, c.other).count(EVERY), default=None)

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
