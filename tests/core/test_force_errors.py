"""Errors of contact forces."""

import numpy as np
import pytest

import pgraph_core as pg

from ..worlds import ball, on_ground


def force(run):
    return run.contact_force["floor"][:, 3:]


@pytest.mark.parametrize("rtol", [1e-4, 1e-5, 1e-7])
def test_the_error_of_soft_forces_is_that_against_an_exact_run(rtol):
    model = on_ground(ball(place=(0, 0, 0.15)), law="soft", friction=0.3, restitution=0.5)
    t = np.r_[0.0, np.linspace(0.1, 0.104, 81)]  # the impact takes 1 ms
    exact = pg.simulate(model, t_eval=t, rtol=1e-9, estimate=False)
    run = pg.simulate(model, t_eval=t, rtol=rtol)
    error = np.linalg.norm(force(run) - force(exact), axis=1).max()
    peak = np.linalg.norm(force(exact), axis=1).max()
    assert 0.3 < run.force_error / error < 3.0
    assert run.force_error == run.force_error_at.max()
    assert run.relative_force_error == pytest.approx(run.force_error / peak, rel=0.05)
    told = [text for text in run.notices if "the error of contact and limit forces" in text]
    assert len(told) == (error > 0.1 * peak)


def test_the_error_of_mean_forces_covers_the_time_of_an_impact():
    model = on_ground(
        ball(place=(0, 0, 0.6), v=(0, 1, 0, 0.3, 0, 0)), friction=0.3, restitution=0.5
    )
    t = np.linspace(0.0, 1.0, 38)
    run = pg.simulate(model, t_eval=t, method="moreau_jean", step=5e-3)
    fine = pg.simulate(model, t_eval=t, method="moreau_jean", step=1e-4, estimate=False)
    error = np.linalg.norm(force(run) - force(fine), axis=1)[1:].max()
    assert 0.1 < run.force_error / error < 10.0


def test_the_error_of_forces_is_kept_in_files(tmp_path):
    run = pg.simulate(on_ground(ball(place=(0, 0, 0.2)), law="soft"), t_end=0.3, rtol=1e-6)
    run.save(tmp_path / "run.npz")
    assert np.array_equal(pg.Result.load(tmp_path / "run.npz").force_error_at, run.force_error_at)
    assert np.isnan(pg.simulate(run.model, t_end=0.1, estimate=False).force_error)
