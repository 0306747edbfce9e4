"""Free joints below a moving body transmit no force."""

import numpy as np
import pytest

import pgraph_core as pg

BOX = {"kind": "box", "size": (0.2, 0.3, 0.4)}


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_a_box_falls_beside_the_body_that_it_names_as_parent(friction):
    spun = pg.Body(
        name="a", joint="free", mass=1, inertia=np.diag((1.0, 2.0, 3.0)), q=(0, 0, 5, 1, 0, 0, 0)
    )
    inertia = np.diag((0.25, 0.2, 0.13)) / 12
    turn = (np.cos(0.3), np.sin(0.3), 0.0, 0.0)
    box = {"name": "b", "joint": "free", "mass": 1, "inertia": inertia, "shape": BOX}
    push = pg.Force(name="f", kind="wrench", body="a", torque=(3.0, 2.0, 1.0), force=(1.0, 0, 0))
    contact = pg.Contact(name="c", body="b", friction=friction, restitution=0.5)

    def place(**fields):
        bodies = [spun, pg.Body(**box, **fields)]
        model = pg.Model(bodies=bodies, contacts=[contact], forces=[push])
        result = pg.simulate(model, t_end=0.5, method="moreau_jean", step=1e-3)
        return result.mechanism.pose(result.q[-1], "b")

    alone = place(q=(0, 0, 0.6, *turn))
    child = place(parent="a", q=(0, 0, -4.4, *turn))
    for found, expected in zip(child, alone):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-3)
