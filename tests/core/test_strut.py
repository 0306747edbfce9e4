"""Struts: tables over length and speed, and bump stops, against closed forms."""

import numpy as np
import pytest

import pgraph_core as pg

from .rescaling import rescaled

SPRING = pg.Lines(x=(0.5, 1.0, 1.5), value=(-20.0, 0.0, 80.0))  # 40 N/m, then 160 N/m
DAMPER = pg.Lines(x=(-1.0, 0.0, 1.0), value=(-2.0, 0.0, 6.0))  # 2 N s/m in, 6 N s/m out


def slider(mass=1.0, q=1.0, **fields):
    """A mass on a line, and a strut from it to the ground's origin."""
    body = pg.Body(name="a", joint="prismatic", axes=((1, 0, 0),), mass=mass, q=q)
    strut = pg.Strut(name="s", body="a", point=(0, 0, 0), **fields)
    return pg.Model(bodies=[body], forces=[strut], gravity=(0, 0, 0))


def pull(model, q, v):
    return -float(pg.Mechanism(model).forward_dynamics([q], [v])[0]) * model.body("a").mass


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_it_pulls_as_its_tables_say_and_as_their_ends_go_on(size):
    spring = pg.Lines(x=[size * x for x in SPRING.x], value=SPRING.value)
    damper = pg.Lines(x=[size * x for x in DAMPER.x], value=DAMPER.value)
    model = slider(q=size, spring=spring, damper=damper)
    for x in np.linspace(0.1, 3.0, 30):
        slope = 40.0 if x < 1.0 else 160.0
        for v in (-4.0, -1.0, -0.3, 0.0, 0.3, 2.5):
            expected = slope * (x - 1.0) + (2.0 if v < 0 else 6.0) * v
            assert pull(model, size * x, size * v) == pytest.approx(expected, rel=1e-12, abs=1e-11)


def test_one_knot_is_a_constant_force():
    model = slider(spring={"x": [0.3], "value": [7.0]})
    assert [pull(model, q, 0.0) for q in (0.1, 1.0, 5.0)] == pytest.approx([7.0] * 3)


def test_two_springs_in_one_table_swing_with_half_of_each_period():
    """A period of pi sqrt(m / k) on each side of the bend."""
    mass, v = 2.0, 0.3
    model = slider(mass=mass, spring=SPRING)
    period = np.pi * (np.sqrt(mass / 40.0) + np.sqrt(mass / 160.0))
    run = pg.simulate(model, v=[v], t_end=period, method="dop853", rtol=1e-11, estimate=False)
    assert run.q[-1, 0] == pytest.approx(1.0, abs=1e-8)
    assert run.v[-1, 0] == pytest.approx(v, abs=1e-8)
    stored = run.kinetic_energy + run.potential_energy
    assert np.ptp(stored) < 1e-9


@pytest.mark.parametrize("method", ["dop853", "rk4"])
@pytest.mark.parametrize("damping", [0.0, 0.4])
def test_a_stop_gives_back_what_hunt_and_crossley_say(method, damping):
    """k d (1 + c u) of Hunt and Crossley: m u du/dd = -k d (1 + c u), from u0 to -u1 at d = 0."""
    stiffness, mass, speed = 1e4, 2.0, 1.5
    model = slider(mass, q=0.3, bump_length=0.25, bump_stiffness=stiffness, bump_damping=damping)
    how = {"rtol": 1e-10} if method == "dop853" else {"step": 1e-5}
    run = pg.simulate(model, v=[-speed], t_end=0.2, method=method, estimate=False, **how)
    back = run.v[-1, 0]

    def lhs(u):  # the integral of u / (1 + c u)
        return u * u / 2 if damping == 0.0 else u / damping - np.log1p(damping * u) / damping**2

    assert lhs(-back) == pytest.approx(lhs(speed), rel=1e-6)
    lost = mass * (speed**2 - back**2) / 2
    assert run.dissipation[-1] == pytest.approx(lost, abs=1e-6 * mass * speed**2)


def test_a_stop_never_pulls():
    model = slider(bump_length=0.5, bump_stiffness=100.0, bump_damping=2.0)
    assert pull(model, 0.4, 10.0) == 0.0
    assert pull(model, 0.4, -1.0) == pytest.approx(-100.0 * 0.1 * 3.0)
    assert pull(model, 0.6, -1.0) == 0.0


@pytest.mark.parametrize("method", ["rk4", "semi_implicit_euler"])
def test_instances_in_lanes_move_as_single_runs(method):
    model = slider(
        q=0.6, spring=SPRING, damper=DAMPER, bump_length=0.5, bump_stiffness=1e3, bump_damping=0.1
    )
    batch = pg.BatchStepper(model, 9, method=method, step=1e-3)
    v = np.linspace(-3.0, 3.0, 9)[:, None]
    batch.reset(batch.q, v)
    batch.step(n=300)
    for n in range(9):
        run = pg.simulate(model, v=v[n], t_end=0.3, method=method, step=1e-3, estimate=False)
        assert batch.q[n, 0] == pytest.approx(run.q[-1, 0], abs=1e-12)


def test_in_other_units_it_is_the_same_motion():
    model = slider(
        q=0.6, spring=SPRING, damper=DAMPER, bump_length=0.5, bump_stiffness=1e3, bump_damping=0.1
    )
    scaled = rescaled(model, length=3.0, mass=5.0, time=0.5)
    one = pg.simulate(model, v=[-2.0], t_end=0.2, step=1e-3, method="rk4", estimate=False)
    two = pg.simulate(scaled, v=[-12.0], t_end=0.1, step=5e-4, method="rk4", estimate=False)
    np.testing.assert_allclose(two.q, 3.0 * one.q, rtol=1e-11)


def test_files_hold_it_and_older_versions_refuse_them():
    model = slider(spring=SPRING, damper=DAMPER)
    assert '"schema_version": 5' in model.to_json()
    assert pg.Model.from_json(model.to_json()) == model


@pytest.mark.parametrize(
    ("fields", "named"),
    [
        ({"spring": {"x": (0, 0), "value": (1, 2)}}, "ascend"),
        ({"spring": {"x": (0, 1), "value": (1,)}}, "values"),
        ({"damper": {"x": (), "value": ()}}, "values"),
        ({"bump_stiffness": 10.0}, "bump_length"),
        ({"bump_damping": -1.0}, "bump_damping"),
    ],
)
def test_what_has_no_meaning_is_refused(fields, named):
    with pytest.raises(pg.ModelError, match=named):
        pg.Strut(name="s", body="a", **fields)


@pytest.mark.parametrize(("mass", "depth"), [(1e-3, 0.2), (1.0, 0.05), (1e3, 0.2)])
def test_a_stop_that_a_step_passes_is_named_and_met_by_steps(mass, depth):
    """A free body comes from far with one wide step, at whose ends the stop does not act."""
    body = pg.Body(name="m", mass=mass, joint="prismatic", axes=[(1, 0, 0)], q=(9.5,), v=(-1.0,))
    stop = {"bump_length": depth, "bump_stiffness": 1e3 * mass / depth}
    strut = pg.Strut(name="s", body="m", point=(0, 0, 0), other_point=(0, 0, 0), **stop)
    model = pg.Model(bodies=[body], forces=[strut], gravity=(0, 0, 0))
    run = pg.simulate(model, t_end=12.0)
    met = run.q[-1, 0] > 0.0
    assert met or any("work" in text for text in run.notices)
    run = pg.simulate(model, t_end=12.0, step=0.02 * depth)
    assert run.q[-1, 0] > 0.0
    assert run.notices == ()
