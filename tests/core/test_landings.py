"""Shapes that have hit with one edge land with the rest: nothing is passed through on the way."""

from __future__ import annotations

import numba
import numpy as np
import pytest

import pgraph_core as pg
from benchmarks.passing import Shot
from pgraph_core.engine.contact.passing import cuts_ball, cuts_box


@pytest.mark.parametrize("speed", [9.0, 1000.0])
def test_a_turning_plate_takes_another_along(speed):
    """Without bounce they fly on together, at half the speed, in order."""
    shape = {"kind": "box", "size": (1e-3, 0.5, 0.5)}
    bodies = [
        pg.Body(
            name="one", joint="free", v=(0, 0.3, 0, speed, 0, 0), mass=0.1, shape=shape,
            derived=("inertia",),
        ),
        pg.Body(
            name="two", joint="free", q=(6e-3, 0, 0, 1, 0, 0, 0), mass=0.1, shape=shape,
            derived=("inertia",),
        ),
    ]  # fmt: skip
    hit = pg.Contact(name="hit", body="one", other="two", friction=0.3)
    model = pg.Model(bodies=bodies, gravity=(0, 0, 0), contacts=(hit,))
    run = pg.simulate(model, t_end=0.02, frames=5, estimate=False)
    assert (run["two"][:, 0] - run["one"][:, 0] > 0.9e-3).all()
    np.testing.assert_allclose(run.v[-1, [3, 9]], 0.5 * speed, rtol=0.01)


@pytest.mark.parametrize("kind", ["plate", "capsule", "cylinder", "ellipsoid", "mesh"])
def test_a_tilted_bullet_stays_before_a_thin_wall(kind):
    """However few frames: the end that lands second is found, too."""
    assert Shot(kind, 0.02, 300.0, 1e-3, False, 0.0, 4).run() == ("right", "")


def test_a_plank_that_tips_over_lies_flat_on_a_thin_slab():
    """Its foot touches from the start; its other end moves more than its thickness a step."""
    tilt = 0.1
    out, up = np.sin(tilt), np.cos(tilt)
    middle = np.array([0.5 * out - 5e-4 * up, 0.0, 0.5 * up + 5e-4 * out])
    slab = pg.Body(
        name="slab", joint="weld", link=(0, 0, -5e-4), shape={"kind": "box", "size": (4, 2, 1e-3)}
    )
    plank = pg.Body(
        name="plank", joint="free", q=(*middle, np.cos(tilt / 2), 0, np.sin(tilt / 2), 0),
        shape={"kind": "box", "size": (1e-3, 0.5, 1.0)}, derived=("inertia",),
    )  # fmt: skip
    foot = pg.Contact(name="foot", body="plank", other="slab", friction=1.0)
    model = pg.Model(bodies=(plank, slab), contacts=(foot,))
    run = pg.simulate(model, t_end=2.0, step=1e-3, frames=3, estimate=False)
    assert run["plank"][-1, 2] == pytest.approx(5e-4, abs=1e-5)


@numba.njit
def cuts(is_box, p, way):
    """Whether a way cuts a box, or the ellipsoid in it; both are called in compiled code alone."""
    half = (0.5, 2.0, 2.0)
    return cuts_box(p, way, half) if is_box else cuts_ball(p, way, half, False)


@pytest.mark.parametrize("is_box", [True, False])
def test_a_passage_is_what_comes_in_and_goes_out(is_box):
    """A way beside a box or a ball, or one that ends inside, is none."""
    assert cuts(is_box, (-2.0, 0.3, 0.0), (4.0, 0.2, 0.0))
    assert not cuts(is_box, (-2.0, 0.3, 0.0), (2.0, 0.0, 0.0))
    assert not cuts(is_box, (-2.0, 2.3, 0.0), (4.0, 0.0, 0.0))
    assert not cuts(is_box, (-2.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    assert not cuts(is_box, (0.0, 0.0, 0.0), (4.0, 0.0, 0.0))


def test_a_thin_plate_that_overlaps_by_a_tenth_of_its_thickness_is_told():
    """However wide it is: what counts is how thin it is."""
    plate = pg.Body(
        name="plate", joint="free", q=(0, 0, 0.4e-3, 1, 0, 0, 0),
        shape={"kind": "box", "size": (1.0, 1.0, 1e-3)}, derived=("inertia",),
    )  # fmt: skip
    model = pg.Model(bodies=(plate,), contacts=(pg.Contact(name="lies", body="plate"),))
    run = pg.simulate(model, t_end=0.01, step=1e-3, frames=3, estimate=False)
    assert any("lies" in text for text in run.notices)


@pytest.mark.parametrize("gap", [1e-9, 6e-9, 1e-7])
@pytest.mark.parametrize("push", [300.0, 3000.0])
def test_what_is_pressed_down_softly_costs_no_parts_of_a_step_where_another_lands(push, gap):
    """It rests where the step takes it; only the ball that falls is located."""
    ball = {
        "joint": "prismatic", "axes": (0, 0, 1), "mass": 1.0, "derived": ("inertia",),
        "shape": {"kind": "sphere", "radius": 0.05},
    }  # fmt: skip
    stands = pg.Body(name="stands", q=(0.05 + gap,), **ball)
    falls = pg.Body(name="falls", link=(1, 0, 0), q=(0.0505,), v=(-1.0,), **ball)
    contacts = tuple(pg.Contact(name=body.name, body=body.name) for body in (stands, falls))

    def run(bodies, torques):
        model = pg.Model(bodies=bodies, contacts=contacts[: len(bodies)])
        return pg.simulate(
            model, tau=np.array(torques), t_end=1e-3, step=1e-3, frames=2, estimate=False
        )

    both, alone = run((stands, falls), (-push, 0.0)), run((stands,), (-push,))
    idle = run((stands, falls), (0.0, 0.0))
    assert both.counters["evaluations"] <= idle.counters["evaluations"]
    assert alone.contacts.gap["stands"][-1] <= both.contacts.gap["stands"][-1] < 0.0
    assert abs(both.v[-1]).max() < 1e-12
