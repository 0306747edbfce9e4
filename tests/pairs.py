"""The pairs of bodies that the contacts of a model let touch."""

import itertools

import pgraph_core as pg
from pgraph_core.contact.tables import tables


def touching(model):
    """Return the pairs of bodies that may touch, as sets of names."""
    mech = pg.Mechanism(model)
    contacts = tables(mech.packed, tuple(c for c in model.contacts if c.active))
    found = {frozenset((t.body, t.other)) for t in contacts.touches if t.body != "*"}
    shapes, members = contacts.geometry.shapes, contacts.candidates.members
    apart = {(int(x["low"]), int(x["high"])) for x in contacts.candidates.apart}
    names = mech.topology.names
    for one, two in itertools.combinations(members["shape"].tolist(), 2):
        a, b = sorted(int(shapes[k]["body"]) for k in (one, two))
        if shapes[one]["row"] != shapes[two]["row"] and (a, b) not in apart:
            found.add(frozenset((names[a - 1], names[b - 1])))
    return found
