"""Models of OpenSim against the numbers of OpenSim 4.6, by golden/osim/write_numbers.py."""

from pathlib import Path

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.formats.osim_text import turned
from pgraph_core.rotation import matrix, quaternion_of

HERE = Path(__file__).parent / "osim"
ROOT = np.array([0.1, 0.2, 0.3]), turned((0.3, -0.2, 0.5))  # frame of the free joint in the ground
TOLERANCE = 1e-11  # relative; slopes of splines amplify rounding of tracks, 512 EPS, by 1 / knots


def mechanism_of(name):
    """Return the mechanism without constraints, numbers of OpenSim, and places of coordinates."""
    model, report = pg.read_osim(HERE / f"{name}.osim")
    assert report.loaded
    golden = np.load(HERE / f"{name}.npz")
    mech = pg.Mechanism(pg.Model(name="bare", bodies=model.bodies, sites=model.sites))
    return mech, golden, {out.name: (out.at, out.coordinate) for out in model.outputs}


def state(mech, golden, places, row):
    """Return q at the coordinates of a row."""
    given, q = dict(zip(golden["coordinates"].tolist(), row.tolist())), np.zeros(mech.nq)
    for name, (body, k) in places.items():
        q[mech.joints[body].q.start + k] = given[name]
    if "rx" in given:
        turn = ROOT[1] @ turned([given[x] for x in ("rx", "ry", "rz")])
        place = ROOT[0] + ROOT[1] @ [given[x] for x in ("tx", "ty", "tz")]
        q[mech.joints["base"].q] = [*place, *quaternion_of(turn)]
        home = matrix(mech.model.body("f").rotation)
        turn = home @ turned([given[x] for x in ("b1", "b2", "b3")]) @ home.T
        q[mech.joints["f"].q] = quaternion_of(turn)
    return q


def columns(mech, places):
    """Return the index in v of each coordinate of OpenSim, and v by its speeds (nv, nv)."""
    index, turn = {}, np.eye(mech.nv)
    for name, (body, k) in places.items():
        index[name] = mech.joints[body].v.start + k
    for body, angles in (("base", "rx ry rz tx ty tz"), ("f", "b1 b2 b3")):
        if body in mech.joints:
            own = mech.joints[body].v
            index |= dict(zip(angles.split(), range(own.start, own.stop)))
            at = ROOT[1] if body == "base" else matrix(mech.model.body("f").rotation)
            for k in range(own.start, own.stop, 3):
                turn[k : k + 3, k : k + 3] = at
    return index, turn


@pytest.mark.quick
@pytest.mark.parametrize("name", ["joints_40000", "joints_20303"])
def test_frames_markers_and_masses_are_those_of_opensim(name):
    mech, golden, places = mechanism_of(name)
    coordinates = golden["coordinates"].tolist()
    index, turn = columns(mech, places)
    own = [k for k, x in enumerate(coordinates) if x in index]
    assert len(own) == mech.nv
    columns_of = (golden[x] for x in ("q", "frames", "marks", "M", "slope"))
    for row, frames, marks, M, slope in zip(*columns_of):
        q = state(mech, golden, places, row)
        for body, frame in zip(golden["bodies"], frames):
            place, rotation = mech.pose(q, f"{body}_frame")
            np.testing.assert_allclose(np.c_[rotation, place], frame, rtol=0, atol=TOLERANCE)
        for mark, at in zip(golden["markers"], marks):
            np.testing.assert_allclose(mech.pose(q, str(mark))[0], at, rtol=0, atol=TOLERANCE)
        order = [index[coordinates[k]] for k in own]
        ours = (turn.T @ mech.mass_matrix(q) @ turn)[np.ix_(order, order)]
        slope[own] = np.eye(len(coordinates))[own]  # the others follow in their joints
        theirs = (slope.T @ M @ slope)[np.ix_(own, own)]
        size = np.sqrt(np.outer(np.diag(theirs), np.diag(theirs)))
        assert np.abs((ours - theirs) / size).max() < TOLERANCE


@pytest.mark.quick
def test_moving_and_conditional_points_have_the_lengths_and_arms_of_opensim():
    """Of a moving point between two others, OpenSim's arm misses the slope of its own length by up
    to 0.029 m (by differences with 1e-5 rad), so that it is compared in the lengths alone."""
    model, report = pg.read_osim(HERE / "points_40000.osim")
    assert report.loaded
    assert all(f._rides for f in model.forces)
    told = [str(x) for x in report.of("warning") if "jumps by" in str(x)]
    assert named(told) == ["conditional"]
    golden, mech = np.load(HERE / "points_40000.npz"), pg.Mechanism(model)
    places = {out.name: (out.at, out.coordinate) for out in model.outputs}
    index, _ = columns(mech, places)
    order = [golden["muscles"].tolist().index(name) for name in mech.path_names]
    at_v = [index[name] for name in golden["coordinates"].tolist()]
    for row, lengths, arms in zip(golden["q"], golden["lengths"], golden["arms"]):
        q = state(mech, golden, places, row)
        np.testing.assert_allclose(mech.path_length(q), lengths[order], rtol=1e-14)
        found, own = mech.moment_arms(q)[:, at_v], [x != "inside" for x in mech.path_names]
        np.testing.assert_allclose(found[own], arms[order][own], rtol=0, atol=1e-14)


def named(texts):
    """Return the names of muscles in texts, in order."""
    return [text.split("muscle '")[1].split("'")[0] for text in texts]
