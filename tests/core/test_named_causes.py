"""Notices name the cause, and a remedy that helps: mass ratios, drives that crush, stiff servos."""

from itertools import pairwise

import numpy as np
import pytest

import pgraph_core as pg

TURNED = (np.cos(-np.pi / 4), 0, np.sin(-np.pi / 4), 0)


def hung(light, heavy=1.0):
    """A free rod that is pinned to the ground, and a bob that is welded to its end."""
    rod = pg.Body(
        name="rod", joint="free", mass=light, inertia=np.diag([1, 1, 1e-3]) * light / 12,
        q=(0.5, 0, 0, *TURNED),
    )  # fmt: skip
    bob = pg.Body(
        name="bob", joint="free", mass=heavy, inertia=np.eye(3) * 1e-4 * heavy, q=(1, 0, 0, *TURNED)
    )
    pin = pg.Revolute(name="pin", body="rod", point=(0, 0, 0.5), axis=(0, 1, 0))
    tie = pg.Weld(name="tie", body="bob", other="rod", point=(0, 0, 0))
    return pg.Model(bodies=[rod, bob], constraints=[pin, tie])


def told(run):
    return " ".join((*run.notices, run.message))


@pytest.mark.parametrize("light", [1e-6, 1e-7, 1e-8, 1e-9, 1e-10])
@pytest.mark.parametrize("heavy", [1.0, 1e3])
def test_masses_that_differ_too_much_are_named_as_such(light, heavy):
    run = pg.simulate(hung(light * heavy, heavy), t_end=0.2, estimate=False)
    text = told(run)
    assert "'rod'" in text or run.status.ok
    for false in ("redundant", "torn", "singular"):
        assert false not in text


@pytest.mark.parametrize("heavy", [1e-3, 1.0, 1e6])
def test_the_least_mass_that_is_named_helps(heavy):
    run = pg.simulate(hung(1e-5 * heavy, heavy), t_end=0.2, estimate=False)
    assert run.status.ok
    assert not run.notices


@pytest.mark.parametrize("mass", [1.0, 1e-9])
def test_rows_that_say_the_same_are_redundant_at_any_mass(mass):
    model = hung(mass)
    again = pg.Revolute(name="again", body="rod", point=(0, 0, 0.5), axis=(0, 1, 0))
    run = pg.simulate(
        model.model_copy(update={"constraints": (*model.constraints, again)}), t_end=0.1,
        estimate=False,
    )  # fmt: skip
    assert "redundant" in told(run)


def crushed(parts=1, drive=-0.5):
    plate = pg.Body(
        name="plate", joint="prismatic", axes=(0, 0, 1), link=(0, 0, 0.1 + 0.2 * parts + 0.2),
        shape={"kind": "box", "size": (1, 1, 0.1)},
    )  # fmt: skip
    boxes = [
        pg.Body(
            name=f"b{i}", joint="free", q=(0, 0, 0.1 + 0.2 * i, 1, 0, 0, 0),
            shape={"kind": "box", "size": (0.2, 0.2, 0.2)}, derived=("inertia",),
        )
        for i in range(parts)
    ]  # fmt: skip
    motion = pg.Motion(name="press", body="plate", q_of_t=pg.Polynomial(coefficients=[0, drive]))
    names = ["ground", *(b.name for b in boxes), "plate"]
    contacts = [
        pg.Contact(name=f"c{i}", body=high, other=low)
        for i, (low, high) in enumerate(pairwise(names))
    ]
    return pg.Model(bodies=[plate, *boxes], constraints=[motion], contacts=contacts)


@pytest.mark.parametrize("step", [1e-3, 5e-3])
@pytest.mark.parametrize("parts", [1, 2, 3])
def test_a_drive_that_crushes_bodies_is_named(parts, step):
    t_end = (0.25 + 0.05) / 0.5
    run = pg.simulate(crushed(parts), t_end=t_end + 0.1, step=step, estimate=False)
    assert "'press'" in told(run)


def test_a_stiff_servo_that_is_implicit_is_no_stiffness():
    """Time stepping takes its damping at the end of the step: no other method is advised."""
    wheel = pg.Body(
        name="w", joint="free", q=(0, 0, 0.1, 1, 0, 0, 0), shape={"kind": "sphere", "radius": 0.1},
        derived=("inertia",),
    )  # fmt: skip
    arm = pg.Body(name="a", parent="w", axes=(0, 1, 0), mass=0.1, inertia=np.eye(3) * 1e-3)
    servo = pg.SpeedServo(name="s", body="a", kd=50.0, speed=1.0)
    model = pg.Model(bodies=[wheel, arm], forces=[servo], contacts=[pg.Contact(name="c", body="w")])
    run = pg.simulate(model, t_end=0.1, step=1e-3, estimate=False)
    assert "radau5" not in told(run)
    assert "stiff" not in told(run)
