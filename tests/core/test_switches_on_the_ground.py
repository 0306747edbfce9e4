"""Constraints that are switched on while something rests on the ground."""

import numpy as np
import pytest

import pgraph_core as pg


def hammer_and_box(force=()):
    """A falling slider that can be tied to another, which rests on the ground."""

    def slider(name, height):
        return pg.Body(
            name=name, joint="prismatic", axes=((0, 0, 1),), mass=1.0, inertia=np.eye(3), q=height
        )

    foot = pg.Contact(name="foot", body="box", points=((0, 0, 0),), friction=0.5)
    tie = pg.Constraint(name="tie", body="hammer", other="box", point=(0, 0, 0), active=False)
    bodies = [slider("box", 0.0), slider("hammer", 3.0)]
    return pg.Model(bodies=bodies, contacts=[foot], constraints=[tie], forces=force)


@pytest.mark.parametrize("method", ["rk4", "moreau_jean"])
def test_the_ground_takes_the_impulse_of_a_falling_body_that_is_tied_to_a_resting_one(method):
    run = pg.simulate(
        hammer_and_box(), method=method, t_end=0.3, step=1e-3, switches=((0.2, "tie", True),)
    )
    assert run.status.ok, run.message
    fall = 9.81 * 0.2
    assert run.v[run.t < 0.2][-1] == pytest.approx([0.0, -fall], abs=0.05)
    np.testing.assert_allclose(run.v[run.t > 0.2 + 1e-9], 0.0, atol=1e-9)
    assert run.q[-1] == pytest.approx([0.0, 3.0 - fall * 0.1], abs=2e-3)


@pytest.mark.parametrize("method", ["rk4", "moreau_jean"])
def test_a_body_that_has_left_the_ground_is_tied_without_it(method):
    """The momentum of both is the same before and after."""
    up = pg.VectorTable(
        t=(0.05, 0.0501, 1.0), value=((0.0, 0.0, 0.0), (0.0, 0.0, 20.0), (0.0, 0.0, 20.0))
    )
    lift = pg.Force(name="lift", kind="wrench", body="box", force=up)
    model = hammer_and_box([lift])
    run = pg.simulate(model, method=method, t_end=0.21, step=1e-3, switches=((0.2, "tie", True),))
    assert run.status.ok, run.message
    before, after = run.v[run.t < 0.2 - 1e-9][-1], run.v[run.t > 0.2 + 1e-9][0]
    assert before[0] > 1.4
    assert after == pytest.approx(np.full(2, before.mean()), abs=0.02)
