"""Contacts of an MJCF file that is read: the ground, walls, and the pairs that may touch."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ..errors import choices, needed, shown
from ..fields import EVERY, GROUND
from ..joints import SIZE
from ..model import Contact
from ..rotation import quaternion_of
from ..tolerances import SOLVED, VISIBLE
from .conversion import TALL
from .mjcf_compiled import Reading

Array = np.ndarray
PLANE = 0  # mjtGeom
PYRAMIDAL = 0  # mjtCone
MARGIN_PUSHES = 4_000_000  # version of MuJoCo since which geoms push within all of their margin
HALF_EDGE = TALL / 2  # m: of the box that stands for a plane without end that is no ground


class Law(NamedTuple):
    """The friction of a pair: sliding, spinning and rolling."""

    sliding: float
    spinning: float
    rolling: float


FRICTIONLESS = Law(0.0, 0.0, 0.0)
Rule: TypeAlias = "tuple[Any, ...]"  # contype, conaffinity, condim, priority, friction (3)


class Touching(NamedTuple):
    """The pairs of bodies that may touch, with the largest of their laws."""

    names: list[str]  # ground, world, and all bodies
    owners: Array  # (n,) numbers of names, ascending
    law: Array  # (n, n) numbers of laws above the diagonal, -1 if the two do not touch
    mixed: Array  # (n, n) whether their geoms have several laws
    partly: Array  # (n, n) whether some of their geoms do not touch
    laws: list[Law]


class _Pairs(NamedTuple):
    """Pairs of bodies that a contact of '*' may cover."""

    stars: tuple[str, str]  # the bodies of that contact
    ends: Callable[[int], tuple[str, str]]  # the names of a pair
    law: Array  # (n,) numbers of their laws, -1 if they do not touch
    covered: Array  # (n,) whether that contact covers them


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
        """Yield contacts by MuJoCo's rules, as few as there can be.

        Contacts of '*' have the most frequent law. Contacts between two bodies have other laws, or
        are off if the two do not touch. If trees of bodies are alike, two of each kind say whether
        all have one law.
        """
        every = [*range(self.m.nbody)]
        few = self._two_of_each_kind()
        if len(few) < len(every):
            found = self._touching(few)
            contacts = [*self._contacts(bodies, found, few)]
            if all(c.body == EVERY for c in contacts) and not found.mixed.any():
                self._tell(found)
                yield from contacts
                return
        found = self._touching(every)
        self._tell(found)
        yield from self._contacts(bodies, found, every)

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
        self, bodies: list[dict[str, Any]], found: Touching, among: list[int]
    ) -> Iterator[Contact]:
        """Yield the contacts between solid bodies, of the pairs `among` bodies of MuJoCo."""
        kept = {"world", *(self.reader.names[b] for b in among)}
        carrier = {GROUND: GROUND}  # body -> the body with the joint that moves it
        parent = {b["name"]: b.get("parent", GROUND) for b in bodies}
        for b in bodies:
            fixed = b.get("joint") == "weld"
            carrier[b["name"]] = carrier[parent[b["name"]]] if fixed else b["name"]
        solid = [
            b["name"] for b in bodies
            if b["name"] in kept and any(s.get("role") != "visual" for s in b.get("shapes", ()))
        ]  # fmt: skip
        number = {name: k for k, name in enumerate(found.names)}
        solid.sort(key=number.__getitem__)
        n = len(solid)
        row = np.full(len(number), len(found.owners))  # the last row of `padded` is for the others
        row[found.owners] = range(len(found.owners))
        padded = np.pad(found.law, (0, 1), constant_values=-1)
        rows = row[[0, *(number[name] for name in solid)]]  # the ground first
        law = padded[np.ix_(rows, rows)]
        moves = np.array([carrier[name] != GROUND for name in solid], dtype=bool)
        floor = _Pairs((EVERY, GROUND), lambda k: (solid[k], GROUND), law[0, 1:], moves)
        yield from self._fewest("floor", floor, found.laws)
        codes = {name: k for k, name in enumerate(dict.fromkeys(carrier.values()))}
        carriers = np.array([codes[carrier[name]] for name in solid], dtype=int)
        numbers = {name: k for k, name in enumerate(solid)}
        parents = np.array([numbers.get(parent[name], -1) for name in solid], dtype=int)
        # a joint with all six degrees of freedom restrains nothing
        freedoms = self.reader.freedoms
        held = np.array([freedoms.get(name, 0) < SIZE["free"][1] for name in solid], dtype=bool)
        below = (parents == np.arange(n)[:, None]) & held
        tied = (carriers[:, None] == carriers) | below | below.T
        ends = np.triu(~tied, 1).ravel()
        both = _Pairs(
            (EVERY, EVERY), lambda k: (solid[k // n], solid[k % n]), law[1:, 1:].ravel(), ends
        )
        yield from self._fewest("bodies", both, found.laws)

    def _fewest(self, name: str, pairs: _Pairs, laws: list[Law]) -> Iterator[Contact]:
        """Yield contacts for pairs of bodies: one of all that are covered by '*' and others of the
        rest, if these are fewer than the pairs."""
        stars, ends, law, covered = pairs
        touch, left = law >= 0, np.flatnonzero(law >= 0)
        inside = law[touch & covered]
        if inside.size:
            most = int(np.bincount(inside).argmax())
            odd = np.flatnonzero(np.where(covered, law != most, touch))
            if 1 + odd.size < left.size:
                yield _contact(name, *stars, laws[most])
                left = odd
        for k in left.tolist():
            body, other = ends(k)
            own = f"{body} floor" if other == GROUND else f"{body}, {other}"
            if law[k] >= 0:
                yield _contact(own, body, other, laws[int(law[k])])
            else:
                yield Contact(name=own, body=body, other=other, active=False)

    def _touching(self, among: list[int]) -> Touching:
        """Return the pairs of bodies of which some geoms may touch, of some bodies of MuJoCo.

        All planes are one ground.
        """
        m, kept = self.m, {*among}
        able = [g for g in range(m.ngeom) if m.touching[g] and self._body_of[g] in kept]
        names = [GROUND, "world", *self.reader.names[1:]]
        places = [self._place(g) for g in able]
        nodes = sorted({*places})  # a plane on a fixed body is of the ground, and of this body
        node = {place: k for k, place in enumerate(nodes)}
        rules = self._rules()
        kinds = sorted({rules[g][1:] for g in able})
        kind = {rule: k for k, rule in enumerate(kinds)}
        counts = np.zeros((len(kinds), len(nodes)), dtype=np.int32)
        for g, place in zip(able, places):
            counts[kind[rules[g][1:]], node[place]] += 1
        ground = np.array([owner == 0 for owner, _ in nodes], dtype=bool)
        counts[:, ground] = np.minimum(counts[:, ground], 1)
        weights = dict[Law, Array]()  # whether geoms of two kinds touch with this law
        for i, one in enumerate(kinds):
            for j, other in enumerate(kinds[: i + 1]):
                if one[0] & other[1] or other[0] & one[1]:
                    law = _friction(one, other)
                    weight = weights.setdefault(law, np.zeros((len(kinds),) * 2, dtype=np.int32))
                    weight[i, j] = weight[j, i] = 1
        may = self._may_touch([body for _, body in nodes])
        listed = dict[Law, list[tuple[int, int, int]]]()  # pairs of geoms to add
        for (g, h), law in self._listed().items():
            if not {self._body_of[g], self._body_of[h]} <= kept:
                continue
            if self._still(self._body_of[g]) == self._still(self._body_of[h]):
                continue
            a, b = sorted(node[self._place(x)] for x in (g, h))
            listed.setdefault(law, []).append((a, b, 1))
            if self._masks(g, h) and may[a, b]:
                own = _friction(rules[g][1:], rules[h][1:])
                listed.setdefault(own, []).append((a, b, -1))
        count = {**Counter(owner for owner, _ in places), 0: 1}
        owner = np.array([owner for owner, _ in nodes], dtype=int)
        return _summed(names, owner, counts, may, weights, listed, count)

    def _place(self, g: int) -> tuple[int, int]:
        """Return the number of the owner of a geom, which is 0 for the ground, 1 for the world and
        b + 1 for body b, and the body of MuJoCo."""
        b = self._body_of[g]
        return (0 if g in self.floors else 1 if b == 0 or g in self.walls else b + 1), b

    def _may_touch(self, bodies: list[int]) -> Array:
        """Return the pairs (n, n) of bodies that MuJoCo does not exclude: not fixed to each other,
        not parent and child off the world, and not in <exclude>."""
        m = self.m
        still = np.array([self._still(b) for b in bodies], dtype=int)
        apart = still[:, None] == still
        if self.filters:
            weld = m.body_weldid[bodies]
            above = m.body_weldid[m.body_parentid[weld]]
            child = (weld[:, None] == above) & (weld != 0)[:, None]
            apart |= child | child.T
        places: dict[int, list[int]] = {}
        for k, body in enumerate(bodies):
            places.setdefault(body, []).append(k)
        for ends in m.exclude_signature.tolist():
            one, two = (places.get(body, []) for body in (ends >> 16, ends & 0xFFFF))
            apart[np.ix_(one, two)] = apart[np.ix_(two, one)] = True
        return ~apart

    def _still(self, b: int) -> int:
        """Return the body to which a body is fixed, which is the world for mocap bodies."""
        root = int(self.m.body_weldid[b])
        return root if self.m.body_mocapid[root] < 0 else 0

    def _tell(self, found: Touching) -> None:
        """Report what is approximated in contacts."""
        m = self.m
        if mixed := int(found.mixed.sum()):
            text = f"{mixed} pairs of bodies whose geoms differ in friction have the largest"
            self.report.add("approximated", self.reader.path.name, text)
        partly = found.owners[np.argwhere(found.partly)].tolist()
        if partly:
            ends = ((found.names[b], found.names[a]) if a == 0 else (found.names[a], found.names[b])
                    for a, b in partly[:4])  # fmt: skip
            named = ", ".join(f"'{body}' and '{other}'" for body, other in ends)
            named += f" and {len(partly) - 4} more" * (len(partly) > 4)
            text = "touch with all of their shapes; in the file some of their geoms do not touch"
            self.report.add("approximated", self.reader.path.name, f"{named} {text}")
        touch = bool((found.law >= 0).any())
        if touch:
            text = "contacts are rigid: MuJoCo's solref and solimp make them soft"
            if m.opt.cone == PYRAMIDAL and any(law.sliding for law in found.laws):
                text += "; friction has its round cone in place of a pyramid"
            self.report.add("approximated", self.reader.path.name, text)
        if touch and (wide := [*dict.fromkeys(self._wide())]):
            text = f"geoms of {choices(map(shown, wide), 4)} have a margin and push before they "
            self.report.add("approximated", self.reader.path.name, f"{text}touch; here they do not")

    def _wide(self) -> Iterator[str]:
        """Yield the bodies whose geoms push before they touch.

        Since MuJoCo 4, they push within their margin, and before it within margin - gap.
        """
        m, older = self.m, needed("mujoco", "mjcf").mj_version() < MARGIN_PUSHES
        touching = (m.geom_contype | m.geom_conaffinity) > 0
        geoms = np.flatnonzero(touching & (m.geom_margin > older * m.geom_gap)).tolist()
        pairs = m.pair_margin > older * m.pair_gap
        for g in (*geoms, *m.pair_geom1[pairs].tolist(), *m.pair_geom2[pairs].tolist()):
            yield self.reader.names[self._body_of[g]] if self._body_of[g] else GROUND

    def _rules(self) -> list[Any]:
        """Return, for each geom, the properties that determine its contacts and their friction."""
        m = self.m
        tables = (m.geom_contype, m.geom_conaffinity, m.geom_condim, m.geom_priority)
        whole = np.column_stack((m.geom_bodyid, *tables)).tolist()
        return [(*row, *x) for row, x in zip(whole, m.geom_friction.tolist(), strict=True)]

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
                ends = [self._body_of[g] for g in (m.pair_geom1[p], m.pair_geom2[p])]
                one_of, other_of = (shown(self.reader.names[b] if b else GROUND) for b in ends)
                text = f"friction of {one_of} and {other_of} that depends on the direction: its "
                self.reader.left_out("pair", m.pair(p).name, f"{text}first number holds for all")
            key = self._geoms(int(m.pair_geom1[p]), int(m.pair_geom2[p]))
            found[key] = _law(int(m.pair_dim[p]), one, spin, roll)
        return found

    def _geoms(self, g: int, h: int) -> tuple[int, int]:
        """Return two geoms in order, with all ground planes represented by the first one."""
        one, two = sorted(self.floors[0] if x in self.floors else x for x in (g, h))
        return one, two


def _friction(one: Rule, other: Rule) -> Law:
    """Return the friction of two geoms by their rules: of the one with priority, or the larger."""
    (_, _, dim, priority, *mine), (_, _, their_dim, their_priority, *theirs) = one, other
    if priority != their_priority:
        first = priority > their_priority
        return _law(int(dim if first else their_dim), *(mine if first else theirs))
    return _law(int(max(dim, their_dim)), *map(max, mine, theirs))


def _summed(
    names: list[str],
    owner: Array,
    counts: Array,
    may: Array,
    weights: Mapping[Law, Array],
    listed: Mapping[Law, list[tuple[int, int, int]]],
    count: Mapping[int, int],
) -> Touching:
    """Return the pairs of owners of nodes (n,), from the geoms of each kind (k, n), the pairs of
    nodes that may touch (n, n), and for each law the pairs of kinds that do (k, k)."""
    laws = sorted({*weights, *listed})
    owners, row = np.unique(owner, return_inverse=True)
    largest = np.full((len(owners),) * 2, -1, dtype=np.int32)
    mixed, totals = largest > 0, np.zeros(largest.shape, dtype=np.int32)
    for k, law in enumerate(laws):
        weight = weights.get(law, np.zeros((len(counts),) * 2, dtype=np.int32))
        kinds = np.flatnonzero(weight.any(axis=0))
        own, share = counts[kinds], weight[kinds] @ counts
        changes = listed.get(law, [])
        nodes = {*np.flatnonzero(share.any(axis=0)), *(x for a, b, _ in changes for x in (a, b))}
        at = np.array(sorted(nodes), dtype=int)
        total = np.einsum("ki,kj->ij", own[:, at], share[:, at])
        total *= may[_block(at, len(owner))]
        for a, b, change in changes:
            total[tuple(np.searchsorted(at, (a, b)))] += change
        rows, first = np.unique(row[at], return_index=True)
        if len(rows) < len(at):
            total = np.add.reduceat(np.add.reduceat(total, first, axis=0), first, axis=1)
        there, block = np.triu(total > 0, 1), _block(rows, len(owners))
        before = largest[block]
        mixed[block] |= there & (before >= 0)
        before[there] = k
        largest[block] = before
        totals[block] += total * there
    sizes = np.array([count.get(k, 0) for k in owners.tolist()], dtype=np.int32)
    partly = (largest >= 0) & (totals < np.outer(sizes, sizes))
    return Touching(names, owners, largest, mixed, partly, laws)


def _block(at: Array, n: int) -> Any:
    """Return an index for these rows and columns of a matrix (n, n), a slice if they are all."""
    return np.ix_(at, at) if len(at) < n else np.s_[:, :]


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
