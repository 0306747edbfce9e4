"""Centres of pressure and zero moment points."""

import numpy as np

import pgraph_core as pg

H, MU = 0.2, 0.3  # half the height of the box [m], friction


def box(**fields):
    shape = pg.Shape(kind="box", size=(0.6, 0.4, 2 * H))
    body = pg.Body(name="box", joint="free", shape=shape, derived=("inertia",), mass=2.0)
    touch = pg.Contact(name="floor", body="box", other="ground", friction=MU)
    return pg.Model(bodies=[body], contacts=[touch], **fields)


def run_of(model, v=(0, 0, 0, 0, 0, 0), z=H, **options):
    given = {"t_end": 0.2, "method": "moreau_jean", "step": 1e-3, "frames": 21} | options
    return pg.simulate(model, q=[0.7, -0.3, z, 1, 0, 0, 0], v=v, **given)


def test_a_box_at_rest_presses_below_its_centre_of_mass():
    run = run_of(box())
    for point in (run.centre_of_pressure, run.zero_moment_point):
        assert np.abs(point[1:] - [0.7, -0.3, 0.0]).max() < 1e-9


def test_a_box_that_slides_presses_ahead():
    """Friction μ m g at the height -H turns it forward: the point is μ H ahead of its middle."""
    run = run_of(box(), v=(0, 0, 0, 1.0, 0, 0))
    ahead = run.position["box"] + [MU * H, 0, -H]
    assert np.abs(run.zero_moment_point - ahead)[1:].max() < 1e-6
    assert np.abs(run.centre_of_pressure - ahead)[1:].max() < 1e-6


def test_the_points_lie_on_a_slope():
    run = run_of(box(ground=pg.Ground(slope=0.1, friction=MU)), t_end=0.5)
    normal = np.array(run.model.ground_normal)
    assert np.abs(run.centre_of_pressure[-5:] @ normal).max() < 1e-12
    assert np.isfinite(run.centre_of_pressure[-5:]).all()


def test_nothing_presses_in_flight():
    run = run_of(box(), z=1.0)
    assert np.isnan(run.centre_of_pressure).all()
    assert np.isnan(run.zero_moment_point).all()
    alone = pg.simulate(pg.Model.serial(1), t_end=0.1)
    assert np.isnan(alone.centre_of_pressure).all()


def test_both_agree_where_a_model_of_many_bodies_stands():
    model = pg.load("quadruped_hips")
    run = pg.simulate(model, scenario=model.scenarios[0].name, t_end=0.1, estimate=False)
    off = run.centre_of_pressure - run.zero_moment_point
    assert np.nanmedian(np.abs(off)) < 1e-6
