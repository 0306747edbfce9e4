"""A rope over points: it pulls and never pushes."""

import numpy as np
import pytest

import pgraph_core as pg

from .test_paths_of_forces import ALSO_GROUND, chain, moved, torque_of


@pytest.mark.quick
@pytest.mark.parametrize("rest", [0.5, 9.0])
def test_a_rope_pulls_along_the_slope_of_its_energy_and_never_pushes(rest):
    ends = {"point": (0.1, 0.2, 0.3), "other_point": (0.2, 0, 0.1), "via": ALSO_GROUND}
    rope = pg.Rope(name="s", body="a", other="c", stiffness=12.0, rest=rest, **ends)
    model = chain(rope)
    mech = pg.Mechanism(model)
    q, still = mech.home()[0], np.zeros(6)
    energy = lambda step: mech.energy(moved(model, q, step), still)[1]  # noqa: E731
    slope = [(energy(1e-5 * e) - energy(-1e-5 * e)) / 2e-5 for e in np.eye(6)]
    np.testing.assert_allclose(torque_of(mech, q), -np.array(slope), atol=1e-7)
    assert np.any(slope) == (rest < 1.0)
