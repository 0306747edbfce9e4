"""Data derived from a model alone, for use by the page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

import pgraph_core as pg
from pgraph_core.show.digraph import Layout, layout
from pgraph_core.show.shapes import branches, children_of, reach, to_wxyz
from pgraph_core.show.stage import depth
from pgraph_core.topology import Loop, loops_of

CONTACT = "contact"  # text in the constraint column
KEPT = 8  # models of which it is known


@dataclass(frozen=True)
class Derived:
    """Data derived from the model alone, in number order unless stated otherwise."""

    names: tuple[str, ...]  # depth-first, from body 1
    number: Mapping[str, int]  # name -> 1..nb
    parent: tuple[int, ...]  # numbers, 0 is the ground
    children: tuple[tuple[int, ...], ...]  # children of body 0 (ground), 1, ...
    pgraph: tuple[int, ...]
    jdof: tuple[int, ...]
    tips: frozenset[int]
    separation: frozenset[int]
    dof: int
    constraints: Mapping[str, tuple[str, ...]]  # body name -> names of what touches it
    loops: tuple[Loop, ...]  # constraints drawn in addition to the tree
    layout: Layout
    branches: tuple[int, ...]
    positions: np.ndarray  # (nb, 3) body origins at home, world axes [m]
    wxyz: np.ndarray  # (nb, 4) orientations at home
    center: np.ndarray  # (3,) what the camera looks at [m]
    size: float  # extent of the model from there [m]
    low: float  # depth under its plane at which the ground is drawn [m]

    @property
    def grain(self) -> float:
        """The typical size of one body [m], a reference length for the marks drawn on bodies."""
        return self.size / max(1.0, len(self.names) / 16)


_recent: tuple[tuple[pg.Model, Derived], ...] = ()  # newest first


def derive(model: pg.Model) -> Derived:
    """Return the data derived from a model, cached while the model is in use."""
    global _recent
    for known, derived in _recent:
        if known is model:
            return derived
    derived = _derived(model)
    _recent = ((model, derived), *_recent)[:KEPT]
    return derived


def _derived(model: pg.Model) -> Derived:
    """Compute the topology, layout, home poses, colours and constraint column of a model."""
    top = pg.Topology.of(model)
    names, parent = tuple(top.names), tuple(top.parent.tolist())
    bodies = [model.body(name) for name in names]
    loops = loops_of(model, top)
    tree = _tree(parent, tuple(top.dof.tolist()))
    positions, rotations = pg.home_poses(model)
    center, size = reach(bodies, positions, rotations)
    ends = tuple((loop.body, loop.other) for loop in loops)
    return Derived(
        names=names,
        number={name: k for k, name in enumerate(names, 1)},
        parent=parent,
        **tree._asdict(),
        tips=frozenset(top.tips.tolist()),
        separation=frozenset(top.separation_bodies.tolist()),
        dof=int(top.dof.sum()),
        constraints=touching(model),
        loops=loops,
        layout=_layout(parent, tuple(map(len, names)), ends),
        positions=np.asarray(positions, dtype=float),
        wxyz=to_wxyz(np.asarray(rotations, dtype=float)),
        center=center,
        size=size,
        low=depth(model, bodies, parent, positions, size),
    )  # fmt: skip


class Tree(NamedTuple):
    """Data that depends on parents and degrees of freedom only, so that most edits preserve it."""

    children: tuple[tuple[int, ...], ...]
    pgraph: tuple[int, ...]
    jdof: tuple[int, ...]
    branches: tuple[int, ...]


@lru_cache(maxsize=16)
def _tree(parent: tuple[int, ...], dof: tuple[int, ...]) -> Tree:
    pgraph = pg.pgraph_of(parent)
    jdof = pg.jdof_of(pgraph, dof)
    walk = tuple(pgraph.tolist()), tuple(jdof.tolist())
    return Tree(children_of(parent), *walk, branches(parent))


_layout = lru_cache(maxsize=16)(layout)


def touching(model: pg.Model) -> dict[str, tuple[str, ...]]:
    """Return the constraint column: constraints and contacts attached to a body, and its limits.

    A contact with the name of its body is called "contact" there.
    """
    found: dict[str, list[str]] = {body.name: [] for body in model.bodies}
    shaped = [body.name for body in model.bodies if body.touching]
    for c in model.constraints:
        for name in c.touches:
            found[name].append(c.name)
    for contact in model.contacts:
        ends = {contact.body, contact.other}
        for name in {*ends, *(shaped if "*" in ends else ())} & found.keys():
            found[name].append(CONTACT if contact.name == name else contact.name)
    for body in model.bodies:
        if any(body.limits):
            found[body.name].append("limits")
    return {name: tuple(names) for name, names in found.items()}
