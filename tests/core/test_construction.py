"""From a description to a mechanism: what is kept between edits is kept rightly."""

from __future__ import annotations

import numpy as np

import pgraph_core as pg


def same(one: pg.Mechanism, other: pg.Mechanism) -> bool:
    """Whether two mechanisms are packed into the same numbers, bit for bit."""
    return all(map(np.array_equal, one.system, other.system))


def test_a_body_attached_elsewhere_is_packed_anew():
    model = pg.Model.serial(4)
    pg.Mechanism(model)  # from here on the bodies keep their packed form
    left = model.remove("2")
    assert same(pg.Mechanism(left), pg.Mechanism(pg.Model.from_json(left.to_json())))
