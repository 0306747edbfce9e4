"""Soft and penalty contacts of any two shapes: right where nothing is said of steps, or told."""

from __future__ import annotations

import numpy as np
import pytest

import pgraph_core as pg

SHAPES = {
    "box": {"kind": "box", "size": (0.2, 0.3, 0.1)},
    "sphere": {"kind": "sphere", "radius": 0.1},
    "capsule": {"kind": "capsule", "radius": 0.08, "length": 0.2},
}
PAIRS = [("box", "capsule"), ("sphere", "box"), ("sphere", "sphere")]


def drop(lower, upper, law, up="y", **options):
    """One body falls onto the ground and another, a little beside it, onto that."""
    middle = "xyz".index(up)
    links = np.array([[0.0, 0.0, 0.0], [0.01, 0.0, 0.02]])
    links[:, middle] = 0.25, 0.6
    bodies = [
        pg.Body(
            name=name, joint="free", link=link, mass=mass, inertia=mass * np.eye(3) * 0.01,
            shape=SHAPES[shape],
        )
        for name, link, mass, shape in zip("ab", links.tolist(), (2.0, 1.0), (lower, upper))
    ]  # fmt: skip
    contacts = (
        pg.Contact(name="floor", body="*", law=law),
        pg.Contact(name="pair", body="b", other="a", law=law),
    )
    model = pg.Model(bodies=tuple(bodies), up=up, contacts=contacts)
    return pg.simulate(pg.Mechanism(model), t_end=0.4, estimate=False, **options)


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize(("lower", "upper"), PAIRS)
def test_soft_contacts_choose_their_steps_and_the_ledger_closes(lower, upper, up):
    run = drop(lower, upper, "soft", up)
    assert run.header["step"] is None
    assert run.status.ok
    assert run.energy_drift < 1e-6
    assert -1e-3 < min(gap.min() for gap in run.contact_gap.values()) < 0
    assert not run.notices


@pytest.mark.parametrize(("lower", "upper"), PAIRS)
def test_a_step_that_leaps_into_a_wall_is_taken_again(lower, upper):
    """Errors of 1e40 of the scales: their quotient, DOP853's own estimate, would accept them."""
    run = drop(lower, upper, "soft", method="dop853", rtol=1e-6)
    assert run.status.ok
    assert run.energy_drift < 1e-3
    assert abs(run.v).max() < 20


@pytest.mark.parametrize(("lower", "upper"), PAIRS)
def test_penalty_contacts_take_steps_that_resolve_them(lower, upper):
    run = drop(lower, upper, "penalty")
    assert run.header["step"] < 2e-4
    assert run.energy_drift < 0.05


@pytest.mark.parametrize("law", ["soft", "penalty"])
@pytest.mark.parametrize(("lower", "upper"), PAIRS)
def test_steps_that_do_not_resolve_a_contact_are_said(lower, upper, law):
    """The state may blow up: shapes at places that are no numbers touch nothing."""
    run = drop(lower, upper, law, step=1e-3)
    assert any("contacts make rates of about" in text for text in run.notices)
