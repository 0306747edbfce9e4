"""Walks in pieces, with changes on the way."""

import copy
import pickle
from functools import cache

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models


@cache
def mechanism() -> pg.Mechanism:
    return pg.Mechanism(pg.Model.load(pgraph_models.path("quadruped_hips")))


def pieces(walk: pg.Walk, seconds: float) -> list[pg.Result]:
    return [walk.step(0.05) for _ in range(round(seconds / 0.05))]


def test_pieces_make_the_run():
    walk = pg.Walk(mechanism(), "trot")
    run = pg.joined(pieces(walk, 1.0))
    whole = pg.simulate(mechanism(), scenario="trot", t_end=1.0, frames=1001, estimate=False)
    assert run.t[[0, -1]] == pytest.approx([0.0, 1.0])
    assert run.q[-1] == pytest.approx(whole.q[-1], abs=1e-4)  # impulses start anew a piece
    assert set(run.phases) == set(whole.phases)


def test_the_contact_records_of_a_piece_do_not_depend_on_when_they_are_read():
    """They are made when first read, also by a copy, and are read-only."""
    early, late = pg.Walk(mechanism(), "trot"), pg.Walk(mechanism(), "trot")
    first, read = [], []
    for _ in range(3):
        first.append(early.step(0.2))
        read.append(first[-1].contacts.events)
    pieces = [late.step(0.2) for _ in range(3)]
    for one, piece, events in zip(first, pieces, read):
        for found in (pickle.loads(pickle.dumps(piece)), copy.deepcopy(piece), piece):
            assert found == one
            assert found.contacts.events == events
            with pytest.raises(ValueError, match="read-only"):
                next(iter(found.contacts.force.values()))[0] = 1.0
    assert any(read)


def test_it_follows_the_speed_and_the_heading():
    walk = pg.Walk(mechanism(), "trot")
    pieces(walk, 2.0)
    walk.change(speed=0.9, turn=0.2)
    pieces(walk, 2.0)
    run = pg.joined(pieces(walk, 0.76))  # two strides
    way = run.q[-1, [0, 2]] - run.q[0, [0, 2]]
    assert np.linalg.norm(way) / 0.76 == pytest.approx(0.9, rel=0.1)
    yaw = 2 * np.arctan2(walk.q[5], walk.q[3])
    assert yaw == pytest.approx(0.2 * 2.76, abs=0.1)
    assert not walk.fell


def test_a_change_is_continuous():
    """Torques are those before the change of speed, at the same state."""
    walk = pg.Walk(mechanism(), "trot")
    pieces(walk, 0.7)
    before = walk.controller(walk.t, walk.q, walk.v)
    walk.change(speed=1.0)
    assert walk.controller(walk.t, walk.q, walk.v) == pytest.approx(before, abs=1e-9)


def test_a_push_moves_it_and_it_recovers():
    walk = pg.Walk(mechanism(), "trot")
    pieces(walk, 1.0)
    walk.push((0.0, 0.0, 80.0), seconds=0.15)  # 12 N s: 0.36 m/s
    pushed = pg.joined(pieces(walk, 0.2))
    assert pushed.v[-1, 5] > 0.1
    pieces(walk, 2.0)
    assert not walk.fell
    assert abs(walk.v[5]) < 0.1


def test_it_goes_on_over_other_ground():
    walk = pg.Walk(mechanism(), "trot", step=2.5e-4)
    pieces(walk, 0.5)
    other = pg.underfoot(walk.mech.model, friction=0.5, law="penalty")
    assert {c.law for c in other.contacts} == {"penalty"}
    walk.follow(other)
    pieces(walk, 0.5)
    assert not walk.fell
    assert walk.q[0] > 0.1


TOLD = "do not resolve", "energy balance"  # notices of a step that is too large


@pytest.mark.parametrize(("law", "step"), [("penalty", 2.5e-4), ("soft", 1e-4)])
def test_a_gait_walks_on_all_laws(law: str, step: float):
    mech = pg.Mechanism(pg.underfoot(mechanism().model, law=law))
    run = pg.simulate(mech, scenario="trot", t_end=1.2, method="rk4", step=step, estimate=False)
    rigid = pg.simulate(mechanism(), scenario="trot", t_end=1.2, estimate=False)
    # soft friction of a light paw that bears the weight is stiffer: it slips at 0.03 m/s
    told = {key for text in run.notices for key in TOLD if key in text}
    assert len(told) == len(run.notices)
    assert ("energy balance" in told) == (run.energy_drift > 0.01)
    assert run.q[-1, 0] == pytest.approx(rigid.q[-1, 0], abs=0.03)
    assert {"swing", "stance"} <= set(run.phases["left_hind_foot"])


def test_a_walk_needs_a_gait():
    with pytest.raises(pg.InputError, match=r"gait.*'stance'"):
        pg.Walk(pg.Mechanism(pg.Model.load(pgraph_models.path("quadruped"))), "stance")
