"""Sites: the contact points and joint limits that event-driven runs know, as blocks of rows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from ..engine import layout as at
from ..errors import InputError, Problem
from ..model import Body, Contact, Model
from ..model.names import GROUND
from ..packing.constraints import Blocks
from ..packing.system import Array, Ints, System, point_in_row
from ..rotation import matrix, normals_of
from ..topology import Topology
from .tables import Tables, Touch

INSTEAD = "use method 'moreau_jean'"


class Limit(NamedTuple):
    """One end of a coordinate's range: sign q - value >= 0."""

    row: int
    at_v: int
    at_q: int
    sign: float
    value: float  # the bound itself times the sign


class Site(NamedTuple):
    """A material point or a sphere of a body over the ground, or one end of a joint's range."""

    name: str
    touch: str  # of which it is one; a limit's own name
    body: str
    friction: float
    restitution: float
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of the body, a sphere's centre [m]
    radius: float = 0.0
    limit: Limit | None = None


def sites_of(model: Model, topology: Topology, packed: System, tables: Tables) -> tuple[Site, ...]:
    """The sites of rigid contacts with the ground, and of all joints' limits.

    Raises InputError for contacts whose points events are not located for.
    """
    rigid = [t for t in tables.touches if t.contact.law == "complementarity"]
    points = (site for touch in rigid for site in _points(model, touch))
    return (*points, *_limits(topology, packed, tables))


def _points(model: Model, touch: Touch) -> Iterator[Site]:
    contact, ground = touch.contact, model.ground
    if touch.other != GROUND:
        raise _refused(contact, "other", "events are located between a body and the ground")
    if ground.steps:
        raise _refused(contact, "other", "events are located on a ground without steps")
    friction = ground.friction if contact.friction is None else contact.friction
    bounce = ground.restitution if contact.restitution is None else contact.restitution
    places = _places(model.body(touch.body), contact)
    for k, (point, radius) in enumerate(places):
        name = touch.name if len(places) == 1 else f"{touch.name}[{k}]"
        yield Site(name, touch.name, touch.body, friction, bounce, point, radius)


def _places(body: Body, contact: Contact) -> list[tuple[tuple[float, float, float], float]]:
    """(point, radius) in the body's axes of everything on it that can touch a plane."""
    if contact.points:
        return [(point, 0.0) for point in contact.points]
    if len(body.touching) > 1:
        text = f"events are located for one shape a body; '{body.name}' has several"
        raise _refused(contact, "body", text)
    shape = body.touching[0] if body.touching else None
    kind = shape.kind if shape else "missing shape"
    ends: list[tuple[float, ...]] = []
    if shape and kind == "sphere":
        ends = [(0.0, 0.0, 0.0)]
    elif shape and kind == "capsule" and shape.length is not None:
        ends = [(0.0, 0.0, z * shape.length / 2) for z in (-1, 1)]
    elif shape and kind == "box" and shape.size is not None:
        ends = [tuple(s * x / 2 for s, x in zip(signs, shape.size)) for signs in SIGNS]
    if shape is None or not ends:
        text = f"events are located for points, spheres, capsules and boxes, not for a {kind}"
        raise _refused(contact, "body", text)
    radius = shape.radius if kind != "box" and shape.radius is not None else 0.0
    places = np.array(shape.position) + np.array(ends) @ matrix(shape.rotation).T
    return [((float(x), float(y), float(z)), radius) for x, y, z in places]


SIGNS = tuple(product((-1, 1), repeat=3))


def _refused(contact: Contact, field: str, text: str) -> InputError:
    return InputError(Problem(f"contact '{contact.name}'", field, f"{text}; {INSTEAD}"))


def _limits(topology: Topology, packed: System, tables: Tables) -> Iterator[Site]:
    ints, floats, terms, factors = tables.limit_blocks
    for name, block, values, term, sign in zip(tables.limits, ints, floats, terms, factors):
        row = int(block[at.B_A])
        body = topology.names[int(packed.body_of_row[row]) - 1]
        limit = Limit(row, int(term[0]), int(term[1]), float(sign), float(values[at.VALUE]))
        yield Site(name, name, body, 0.0, float(values[at.BOUNCE]), limit=limit)


class SiteTables(NamedTuple):
    """Sites as kernels take them; columns in `engine/layout.py`."""

    sites_i: Ints  # (ns, 6)
    sites_f: Array  # (ns, 31)


def with_sites(
    blocks: Blocks, sites: Sequence[Site], model: Model, topology: Topology, packed: System
) -> tuple[Blocks, SiteTables]:
    """The blocks of the constraints and, after them, of the sites; each site is an entry of
    `names` with the block that takes all its rows, and a second one with its other blocks."""
    normal = np.array(model.ground_normal)
    frame = (normal, *normals_of(normal))
    rows_i, rows_f = list(blocks.blocks_i), list(blocks.blocks_f)
    terms_i, terms_f = list(blocks.terms_i), list(blocks.terms_f)
    first = list(blocks.first)
    tables = SiteTables(
        np.zeros((len(sites), at.SITE_I), dtype=np.int64), np.zeros((len(sites), at.SITE_F))
    )
    for n, site in enumerate(sites):
        number = topology.number(site.body)
        row = int(packed.bodies_i[number, at.ROW])
        start = len(rows_i)
        if site.limit is not None:
            rows_i.append(np.array([at.T_LIMIT, site.limit.row, 0, 1, len(terms_f), 1, 0, 0]))
            rows_f.append(_values(offset=site.limit.value))
            terms_i.append(np.array([site.limit.at_v, site.limit.at_q]))
            terms_f.append(site.limit.sign)
            places = (start, start, start, 1)
        else:
            point = point_in_row(packed, number, site.point)
            values = _values(point, frame, site.radius)
            for kind, size in ((at.T_SPHERE, 3), (at.T_SPHERE, 1), (at.T_POINT, 3)):
                rows_i.append(np.array([kind, row, 0, size, 0, 0, 0, 0]))
                rows_f.append(values.copy())
            held = start if site.radius > 0 else start + 2
            places = (held, start, start + 1, 0)
        tables.sites_i[n, at.S_STANCE : at.S_LIMIT + 1] = places
        tables.sites_f[n, at.S_FRICTION] = site.friction
        tables.sites_f[n, at.S_NORMAL : at.S_NORMAL + 3] = normal
        tables.sites_f[n, at.S_WAY : at.S_WAY + 3] = frame[1]
        first += [start + 1, len(rows_i)]
    names = (*blocks.names, *(name for s in sites for name in (s.name, s.name)))
    extended = Blocks(
        names,
        np.array(first, dtype=np.int64),
        np.array(rows_i, dtype=np.int64).reshape(-1, at.BLOCK_I),
        np.array(rows_f).reshape(-1, at.BLOCK_F),
        np.array(terms_i, dtype=np.int64).reshape(-1, 2),
        np.array(terms_f),
        blocks.curves,
    )
    return extended, tables


def _values(
    point: Array | None = None, frame: Sequence[Array] = (), radius: float = 0.0, offset: float = 0
) -> Array:
    """(28,) of a block: a point over the plane of the ground, or a coordinate's value."""
    out = np.zeros(at.BLOCK_F)
    if point is not None:
        out[at.PA : at.PA + 3] = point
        out[at.DIR : at.DIR + 9] = np.concatenate(frame)
    out[at.VALUE] = radius or offset
    return out
