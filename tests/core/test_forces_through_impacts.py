"""Forces that change with time, in steps that an impact divides."""

import numpy as np
import pytest

import pgraph_core as pg

R = 0.1


@pytest.mark.parametrize("step", [1e-2, 3e-3])
def test_the_impulse_of_a_force_is_its_integral_through_impacts(step):
    """A ball bounces without friction while a horizontal force grows linearly with time."""
    ball = pg.Body(
        name="b", joint="free", mass=2.0, inertia=0.4 * R * R * np.eye(3),
        shape={"kind": "sphere", "radius": R}, q=(0, 0, 0.2, 1, 0, 0, 0),
    )  # fmt: skip
    force = pg.VectorTable(t=(0.0, 1.0), value=((0.0, 0.0, 0.0), (40.0, 0.0, 0.0)))
    push = pg.Force(name="f", kind="wrench", body="b", force=force)
    contact = pg.Contact(name="c", body="b", friction=0.0, restitution=0.9)
    model = pg.Model(bodies=[ball], contacts=[contact], forces=[push])
    result = pg.simulate(model, t_end=0.6, method="moreau_jean", step=step)
    bounces = np.count_nonzero(np.diff(np.sign(result.v[:, 5])) > 0)
    assert bounces >= 1
    np.testing.assert_allclose(result.v[:, 3], 10.0 * result.t**2, atol=1e-9)
