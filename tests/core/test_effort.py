"""Steps and solver iterations that easy contacts need: faults that only cost work show here."""

from typing import Any

import numpy as np
import pytest

import pgraph_core as pg

BALL: dict[str, Any] = {
    "name": "b", "joint": "free", "shape": {"kind": "sphere", "radius": 0.1},
    "derived": ("inertia",),
}  # fmt: skip
UP: dict[str, Any] = {"joint": "prismatic", "axes": (0, 0, 1)}
RUBS = pg.Body("s", friction=20.0, **UP)
STEPS: dict[str, Any] = {"estimate": False, "frames": 2}


def on_floor(height, **law):
    body = pg.Body(q=(0, 0, 0.1 + height, 1, 0, 0, 0), **BALL)
    return pg.Model(bodies=[body], contacts=[pg.Contact(name="c", body="b", **law)])


ALONE = {
    "a ball that slides": (on_floor(0.0, friction=0.3), (0, 1, 0, 1, 0, 0)),
    "a ball that rolls": (on_floor(0.0, friction=0.3), (0, 10, 0, 1, 0, 0)),
    "a smooth ball": (on_floor(0.0, friction=0.0), (0, 1, 0, 1, 0, 0)),
    "a slider that its friction stops": (pg.Model(bodies=[RUBS]), (-1,)),
    "a slider that its friction holds": (pg.Model(bodies=[RUBS]), (0,)),
    "a slider at its limit": (pg.Model(bodies=[pg.Body("s", limits=(0, None), **UP)]), (0,)),
}  # fmt: skip


@pytest.mark.parametrize("name", ALONE)
def test_one_row_or_contact_is_solved_in_one_sweep(name):
    """From any start, in each of the two passes of a step: its law alone gives the impulse."""
    model, v = ALONE[name]
    run = pg.simulate(
        model, v=np.array(v, float), t_end=1e-2, step=1e-3, method="moreau_jean", **STEPS
    )
    assert 0 < run.counters["solver_iterations"] <= 2 * run.counters["steps"]


def test_a_ball_set_down_on_a_soft_floor_needs_few_steps():
    """It falls by 1 mm. Steps end where it touches, and are as wide as its force allows."""
    soft = on_floor(1e-3, law="soft", stiffness=1e5)
    run = pg.simulate(soft, t_end=0.03, method="dop853", rtol=1e-6, **STEPS)
    assert run.counters["steps"] <= 20


def test_a_ball_that_flies_away_from_a_soft_floor_is_free():
    run = pg.simulate(
        on_floor(0.05, law="soft", stiffness=1e5), v=np.array([0, 0, 0, 0, 0, 3.0]), t_end=0.3,
        method="dop853", rtol=1e-8, **STEPS,
    )  # fmt: skip
    assert run.counters["steps"] <= 6


def test_bodies_that_fall_through_the_ground_are_found_by_one_look_at_all(monkeypatch):
    """The poses of all bodies are computed for the first and the last frame, not for each body."""
    bodies = [pg.Body(**{**BALL, "name": f"b{i}", "q": (i, 0, 0.2, 1, 0, 0, 0)}) for i in range(9)]
    idle = pg.Contact(name="c", body="*", active=False)
    mech, looks = pg.Mechanism(pg.Model(bodies=bodies, contacts=[idle])), list[int]()
    own = pg.Mechanism.poses
    monkeypatch.setattr(pg.Mechanism, "poses", lambda self, q: looks.append(1) or own(self, q))
    run = pg.simulate(mech, t_end=0.4, **STEPS)
    assert any("'b0'" in text and "6 more" in text for text in run.notices)
    assert len(looks) == 2
