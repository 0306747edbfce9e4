"""Reactions of contact torques on the body that is touched."""

import numpy as np
import pytest

import pgraph_core as pg

from ..worlds import ball, box

G = 9.81


def test_a_spinning_ball_turns_the_table_below_it():
    """The weld of the table carries the torque σ m g of spinning friction."""
    sigma, spin = 1e-3, (0, 0, 10, 0, 0, 0)
    bodies = box("table", (0, 0, 0), (1, 1, 1), joint="weld"), ball(place=(0, 0, 0.6), v=spin)
    contact = pg.Contact(name="c", body="b", other="table", spinning_friction=sigma)
    model = pg.Model(bodies=bodies, contacts=[contact])
    result = pg.simulate(model, t_end=0.1, method="moreau_jean", step=1e-3)
    assert result.contact_force["c"][-1, 2] == pytest.approx(-sigma * G, rel=1e-9)
    assert result.joint_force[-1, 0, 2] == pytest.approx(-sigma * G, rel=1e-9)
    assert result.joint_force[-1, 0, 5] == pytest.approx(2 * G, rel=1e-9)


def test_a_string_pulls_a_body_where_it_is_tied():
    """The weld of a beam carries the weight that hangs at its end, and its moment."""
    beam = pg.Body(name="beam", joint="weld", mass=1, inertia=np.eye(3))
    weight = pg.Body(
        name="weight", joint="free", mass=2, inertia=np.eye(3), q=(0.7, 0.2, -1, 1, 0, 0, 0)
    )
    string = pg.Spring(
        name="s", body="weight", other="beam", point=(0, 0, 0), other_point=(0.7, 0.2, 0), high=1.0
    )
    model = pg.Model(bodies=[beam, weight], forces=[string])
    result = pg.simulate(model, t_end=0.1, method="moreau_jean", step=1e-3)
    expected = (0.2 * 2 * G, -0.7 * 2 * G, 0, 0, 0, 3 * G)
    np.testing.assert_allclose(result.joint_force[-1, 0], expected, atol=1e-6)
