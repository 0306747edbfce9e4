"""The energy of impulses: E(t) - E(0) = work - dissipation, for every row and method.

An impulse p along a row with the relative velocities v- and v+ before and after it does the work
p (v- + v+) / 2. Prescribed motions do work, and everything else dissipates.
"""

from typing import Any

import numpy as np
import pytest

import pgraph_core as pg

from ..nights import combined

EXACT = 1e-11  # of the energies at hand: rounding of a thousand steps


def balance(run):
    """Largest |E - E0 - work + dissipation|, relative to the energies."""
    missed = run.energy - run.energy[0] - run.work + run.dissipation
    return float(np.abs(missed).max() / max(np.abs(run.kinetic_energy).max(), 1e-300))


def slider(name="s", mass=1.0, v=1.0, parent="ground", **fields):
    return pg.Body(
        name=name, parent=parent, joint="prismatic", axes=[(1, 0, 0)], mass=mass, v=(v,), **fields
    )


# -- strings and struts ---------------------------------------------------------------------------


@pytest.mark.parametrize(("step", "stiffness"), combined([1e-3, 3e-4, 2e-4, 1e-4], [0.0, 20.0]))
def test_a_string_that_catches_a_mass_dissipates_its_kinetic_energy(step, stiffness):
    body = pg.Body(name="b", joint="prismatic", axes=[(0, 0, 1)], mass=0.5, q=(1.0,))
    string = pg.Spring(
        name="st", body="b", point=(0, 0, 0), other_point=(0, 0, 1.5), high=0.9, rest=0.9,
        stiffness=stiffness,
    )  # fmt: skip
    run = pg.simulate(pg.Model(bodies=[body], forces=[string]), t_end=0.4, step=step)
    stretched = 0.5 * stiffness * 0.4**2  # at the start
    assert run.dissipation[-1] == pytest.approx(0.5 * 9.81 * 0.4 + stretched, rel=1e-3)
    assert run.energy_drift < 1e-3


def crossing(ends, sense):
    """Two free bodies without gravity, joined by an oblique string or strut."""
    bodies = [
        pg.Body(
            name=n, joint="free", mass=m, inertia=(0.01,) * 3, q=(*x, 1, 0, 0, 0), v=(0, 0, 0, *v)
        )
        for n, m, x, v in (
            ("a", 1.0, (0.0, 0.0, 0.0), (0.0, 0.2, 0.0)),
            ("b", 3.0, (0.5, 0.1, 0.2), (2.0 * sense, 0.3, -0.4)),
        )
    ]  # fmt: skip
    string = pg.Spring(name="s", body="a", other="b", point=(0.01, 0.02, 0), **ends)
    return pg.Model(bodies=bodies, forces=[string], gravity=(0, 0, 0))


@pytest.mark.parametrize("step", [2e-3, 1e-3])
@pytest.mark.parametrize(("ends", "sense"), [({"high": 1.0}, 1), ({"low": 0.3}, -1)])
def test_a_string_between_two_free_bodies_keeps_the_balance(ends, sense, step):
    run = pg.simulate(crossing(ends, sense), t_end=0.6, step=step, estimate=False)
    assert run.dissipation[-1] > 0.1
    assert balance(run) < EXACT


def test_several_catches_at_once_keep_the_balance():
    bodies = [slider(f"s{k}", mass=1.0 + k, v=1.0 + 0.3 * k) for k in range(3)]
    forces = [
        pg.Spring(name="a", body="s0", point=(0, 0, 0), other_point=(-0.5, 0.3, 0), high=0.7),
        pg.Spring(
            name="b", body="s1", other="s0", point=(0, 0, 0), other_point=(0, 1, 0), high=1.02
        ),
        pg.Tendon(name="t", coefficients={"s1": [1.0], "s2": [1.0]}, rest=0.0, high=0.5),
    ]  # fmt: skip
    model = pg.Model(bodies=bodies, forces=forces, gravity=(0, 0, 0))
    run = pg.simulate(model, t_end=0.6, step=1e-3, estimate=False)
    assert run.dissipation[-1] > 1.0
    assert balance(run) < EXACT


# -- prescribed motions ---------------------------------------------------------------------------

HOW: list[dict[str, Any]] = [
    {"step": 1e-3}, {"rtol": 1e-8}, {"method": "rk4", "step": 1e-3},
    {"method": "semi_implicit_euler", "step": 1e-3}, {"method": "dopri5", "rtol": 1e-6},
]  # fmt: skip
SMOOTH: list[dict[str, Any]] = [*HOW[1:], {"method": "radau5"}, {"method": "gauss6", "step": 1e-2}]


def driven(*bodies, velocity=False, **model):
    """A base that moves with 0.7 m/s, by a Motion or a Velocity, and carries sliders."""
    drive = pg.Motion(name="mv", body="base", q_of_t=pg.Polynomial(coefficients=(0, 0.7)))
    if velocity:
        drive = pg.Velocity(name="mv", coefficients={"base": [1.0]}, value=0.7)
    more = model.pop("constraints", ())
    base = slider("base", 2.0, 0.7)
    return pg.Model(bodies=[base, *bodies], constraints=[drive, *more], gravity=(0, 0, 0), **model)


@pytest.mark.parametrize(
    ("how", "velocity", "bounce"), combined(HOW, [False, True], [0.0, 0.4, 1.0]), ids=str
)
def test_a_drive_does_work_in_impacts_at_limits(how, velocity, bounce):
    """The drive supplies (1 + e) m u V if the slider on its base rebounds with e u."""
    on_it = slider(parent="base", limits=[(-0.1, 0.1)], limit_restitution=(bounce,))
    run = pg.simulate(driven(on_it, velocity=velocity), t_end=0.15, **how)
    assert run.work[-1] == pytest.approx(-(1 + bounce) * 0.7, rel=1e-9)
    assert run.dissipation[-1] == pytest.approx(0.5 * (1 - bounce**2), rel=1e-9, abs=1e-12)
    assert balance(run) < 1e-9
    assert not [text for text in run.notices if "energy" in text]


@pytest.mark.parametrize("how", HOW[:4], ids=str)
def test_a_drive_does_work_in_impacts_on_the_ground(how):
    """A driven carriage with a ball that falls: friction turns the work of the drive into heat."""
    base = slider("base", 2.0, 0.7)
    ball = pg.Body(
        name="ball", parent="base", joint="prismatic", axes=[(0, 0, 1)], mass=1.5, link=(0, 0, 0.3),
        shape={"kind": "sphere", "radius": 0.1},
    )  # fmt: skip
    drive = pg.Motion(name="mv", body="base", q_of_t=pg.Polynomial(coefficients=(0, 0.7)))
    floor = pg.Contact(name="c", body="ball", friction=0.3)
    model = pg.Model(bodies=[base, ball], constraints=[drive], contacts=[floor])
    run = pg.simulate(model, t_end=0.4, **how)
    fall = 1.5 * 9.81 * 0.2
    push = 1.5 * np.sqrt(2 * 9.81 * 0.2) + 1.5 * 9.81 * (0.4 - np.sqrt(2 * 0.2 / 9.81))
    rough = 1e-2 if how.get("method") == "semi_implicit_euler" else 2e-3  # of the fall itself
    assert run.work[-1] == pytest.approx(0.3 * push * 0.7, rel=rough)
    assert run.dissipation[-1] == pytest.approx(fall + 0.3 * push * 0.7, rel=rough)


@pytest.mark.parametrize(
    ("how", "velocity"), combined([{"step": 1e-3}, *SMOOTH], [False, True]), ids=str
)
def test_a_weld_that_is_switched_on_under_a_drive_books_both(how, velocity):
    """The slider is caught by the driven base: 0.5 J are lost, and the drive does -0.7 J."""
    limits: dict[str, Any] = {"limits": [(-1.0, 1.0)]} if how in HOW[:1] else {}
    weld = pg.Weld(name="w", body="s", other="base", active=False)
    model = driven(slider(parent="base", **limits), velocity=velocity, constraints=[weld])
    run = pg.simulate(model, t_end=0.25, switches=((0.1, "w", True),), **how)
    assert run.work[-1] == pytest.approx(-0.7, rel=1e-9)
    assert run.dissipation[-1] == pytest.approx(0.5, rel=1e-9)
    assert "took 0.5 J" in str(run.events[0])
    assert "-0.7 J" in str(run.events[0])


@pytest.mark.parametrize("rate", [-1.3, 0.4])
def test_a_motion_that_is_switched_on_does_work_and_a_brake_dissipates(rate):
    """m (V² - v²)/2 is the work of a motion that jumps to V; a brake at rest only dissipates."""
    speed = pg.Velocity(name="on", coefficients={"s": [1.0]}, value=rate, active=False)
    brake = pg.Velocity(name="on", coefficients={"s": [1.0]}, value=0.0, active=False)
    for drive, work, lost in ((speed, 0.5 * 2 * (rate**2 - 1), 0.0), (brake, 0.0, 0.5 * 2)):
        model = pg.Model(bodies=[slider(mass=2.0)], constraints=[drive], gravity=(0, 0, 0))
        run = pg.simulate(model, t_end=0.2, switches=((0.1, "on", True),))
        assert run.work[-1] == pytest.approx(work, abs=1e-12)
        assert run.dissipation[-1] == pytest.approx(lost, abs=1e-12)


@pytest.mark.parametrize("method", ["rk4", "dop853", "radau5"])
def test_a_clutch_between_two_wheels_dissipates_at_once(method):
    """Two wheels that get one speed lose J1 J2 (w1 - w2)² / 2 (J1 + J2), without any work."""
    wheels = [
        pg.Body(name=n, axes=(0, 0, 1), inertia=(j,) * 3, v=(w,))
        for n, j, w in (("a", 0.2, 3.0), ("b", 0.5, -1.0))
    ]
    gear = pg.Velocity(name="c", coefficients={"a": [1.0], "b": [-1.0]}, value=0.0, active=False)
    run = pg.simulate(
        pg.Model(bodies=wheels, constraints=[gear]), t_end=0.2, method=method,
        switches=((0.1, "c", True),),
    )  # fmt: skip
    assert run.dissipation[-1] == pytest.approx(0.2 * 0.5 * 16.0 / (2 * 0.7), rel=1e-9)
    assert run.work[-1] == pytest.approx(0.0, abs=1e-12)
