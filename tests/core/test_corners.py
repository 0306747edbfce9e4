"""Tables that bend inside steps of given width: what it costs, and that a run says so."""

from __future__ import annotations

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models


def driven(apart, *, kind="servo"):
    """A pendulum whose target, or torque, is a table with a knot every `apart` s."""
    t = np.arange(0.0, 0.3 + apart / 2, apart)
    table = pg.Table(t=tuple(t.tolist()), value=tuple((0.4 * np.sin(12 * t)).tolist()))
    force = (
        pg.Force(name="f", kind="servo", body="rod", kp=200.0, kd=2.0, target=table)
        if kind == "servo"
        else pg.Force(name="f", kind="motor", body="rod", torque=table)
    )
    rod = pg.Body(name="rod", joint="revolute", axes=((0, 1, 0),), mass=1.0, com=(0, 0, -0.5))
    return pg.Mechanism(pg.Model(bodies=(rod,), forces=(force,)))


def said(run):
    return [notice for notice in run.notices if "inside steps" in notice]


@pytest.mark.parametrize("kind", ["servo", "motor"])
@pytest.mark.parametrize("apart", [2.5e-3, 1.3e-3, 7.7e-3, 0.0155])
@pytest.mark.parametrize("frames", [31, None])
def test_the_estimate_is_the_error_where_tables_bend_inside_steps(apart, kind, frames):
    """Within a factor of three: coarser steps may cost the same, as corners lie better in them."""
    mech = driven(apart, kind=kind)
    options = {"t_end": 0.3, "frames": frames}
    run = pg.simulate(mech, method="rk4", step=1e-3, **options)
    exact = pg.simulate(mech, method="dop853", rtol=1e-13, t_end=0.3, t_eval=run.t)
    true = float(np.abs(run.q - exact.q).max())
    assert true / 3 < run.error_estimate < true * 3
    assert len(said(run)) == 1


def test_a_run_says_how_many_corners_lie_inside_its_steps():
    """By number and step, and not where steps end at them or the order is as low anyway."""
    mech = driven(2.5e-3)
    run = pg.simulate(mech, method="rk4", step=1e-3, t_end=0.02)
    assert said(run) == [
        "4 corners of tables lie inside steps of 0.001 s: the error there shrinks as the step's "
        "square only; choose a step that divides the times of knots, or an adaptive method such "
        "as dopri5"
    ]
    quiet = ({"step": 5e-4}, {"rtol": 1e-8, "method": "dopri5"}, {"step": 1e-3, "method": "radau5"})
    for options in quiet:
        assert not said(pg.simulate(mech, t_end=0.02, **options))
    assert not said(pg.simulate(mech, t_end=0.02, step=1e-3, method="semi_implicit_euler"))


@pytest.mark.parametrize("name", pgraph_models.names())
def test_built_in_scenarios_step_onto_their_corners(name):
    """No notice in any of them."""
    mech = pg.Mechanism(pg.Model.load(pgraph_models.path(name)))
    for scenario in mech.model.scenarios:
        run = pg.simulate(mech, scenario=scenario.name, t_end=0.01, estimate=False)
        assert not said(run), scenario.name


@pytest.mark.parametrize("method", ["dop853", "dopri5", "radau5"])
def test_a_pulse_late_in_a_long_run_is_as_good_as_its_times(method):
    """At 1e6 s times are good to 1e-10 s: no step makes a pulse of 2 ms better than 1e-7."""
    late = 1e6
    push = pg.Table(t=(late, late + 1e-3, late + 2e-3), value=(0.0, 1.0, 0.0))
    body = pg.Body(
        name="a", mass=1.0, joint="prismatic", axes=((1, 0, 0),), inertia=np.zeros((3, 3))
    )
    model = pg.Model(
        bodies=(body,), gravity=(0, 0, 0), forces=(pg.Motor(name="push", body="a", torque=push),)
    )
    run = pg.simulate(model, t_end=late + 1.0, method=method, estimate=False)
    assert run.status.ok, run.message
    assert run.v[-1, 0] == pytest.approx(1e-3, rel=1e-6)
