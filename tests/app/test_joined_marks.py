"""Springs, rods, cables and muscles in the 3D view: what each mark shows, and clicks on them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pgraph_core as pg
from pgraph_app.pose import poses
from pgraph_app.scene import ties
from pgraph_core.show import shapes

from .store import ME, after, begun, do

SLED = {"joint": "prismatic", "axes": [(0, 0, 1)], "mass": 1.0}
BALL = {"kind": "sphere", "radius": 0.05}
MODEL = pg.Model(
    bodies=[
        pg.Body(name="a", link=(-1, 0, 0), shape=BALL, **SLED),
        pg.Body(name="b", link=(1, 0, 0), shape=BALL, **SLED),
        pg.Body(name="arm", link=(0, 0, 2), axes=[(0, 1, 0)], mass=1, inertia=(1, 1, 1)),
    ],
    forces=[
        pg.Spring(name="s", body="a", other="b", other_point=(0, 0, 0), point=(0, 0, 0)),
        pg.Spring(
            name="led", body="a", other="ground", point=(0, 0, 0),
            via=[("b", (0, 0, 0.3)), pg.Via(body="b", point=(-0.5, 0, 0.2), radius=0.2)],
        ),
        pg.Muscle(name="m", body="b", other="arm", f_max=100, l_opt=1, l_slack=1),
        pg.Cable(name="c", through=["a", ("ground", (0, 0, 3)), "b"], stiffness=100),
    ],
    constraints=[
        pg.Distance(name="d", body="a", other="b", point=(0, 0, 0.2), other_point=(0, 0, 0.2)),
    ],
)  # fmt: skip


def joined(state):
    positions, wxyz = poses(state)
    return ties.joinings(state, positions, shapes.to_matrix(np.asarray(wxyz)))


def test_each_mark_knows_the_part_that_it_shows():
    state = begun(MODEL)
    found = joined(state)
    assert all(len(found[kind].of) == len(found[kind].at) for kind in ties.OPENS)
    shown = {kind: set(found[kind].of) for kind in ties.OPENS}
    assert shown == {
        "springs": {("forces", "s"), ("forces", "led")},
        "rods": {("constraints", "d"), ("forces", "c"), ("forces", "led")},
        "muscles": {("forces", "m")},
        "beads": {("forces", "led")},
    }
    for kind in ties.OPENS:
        runs = found[kind].names()
        assert [one for of, name, n in runs for one in [(of, name)] * n] == list(found[kind].of)
    (only,) = found["rods"].only(("constraints", "d")).ends
    assert only == pytest.approx(np.array([(-1, 0, 0.2), (1, 0, 0.2)]))
    assert not len(found["springs"].only(None).at)


def test_marks_of_a_scenario_open_nothing():
    load = pg.Spring(name="load", body="a", other="ground", point=(0, 0, 0))
    one = MODEL.replace(forces=(), scenarios=(pg.Scenario(name="x", forces=(load,)),))
    state = after(begun(one), do.SetScenario(ME, 1, "x"))
    assert joined(state)["springs"].of == (None,)


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1))
def test_a_ray_hits_a_mark_where_it_comes_nearer_than_its_radius(seed):
    """Against the least distance of 2000 points of the span from the ray."""
    rng = np.random.default_rng(seed)
    begin, end, origin = rng.normal(size=(3, 3))
    way = rng.normal(size=3)
    if seed % 4 == 0:
        way = end - begin  # along it
    way /= np.linalg.norm(way)
    origin = origin - 20.0 * way
    points = begin + np.linspace(0.0, 1.0, 2000)[:, None] * (end - begin) - origin
    gap = np.linalg.norm(points - (points @ way)[:, None] * way, axis=1).min()
    fine = np.linalg.norm(end - begin) / 1999  # no point of the span is farther from one of them
    for wide, hit in ((2 * gap + 2 * fine, True), (2 * max(gap - 2 * fine, 0.0), False)):
        if wide or hit:
            mark = ties._between([ties.Span(begin, end, wide)])
            assert mark.hit(origin, way) is hit
            assert not mark.hit(origin, -way)  # behind


def test_marks_stand_along_their_spans():
    rng = np.random.default_rng(3)
    ways = [*rng.normal(size=(20, 3)), (0, 0, 1), (0, 0, -1), (0, 0, 0), (1e-9, 0, -1)]
    found = ties._between([ties.Span(np.zeros(3), np.array(way, float), 1.0) for way in ways])
    R = shapes.to_matrix(found.wxyz)
    assert np.linalg.det(R) == pytest.approx(1.0)
    np.testing.assert_allclose(R[:, :, 2] * found.size[:, 2:], ways, atol=2e-9)


def click(at, slack=0.0):
    """A click on what is at a point, seen from the front."""
    return do.ClickView(ME, (at[0], -9.0, at[2]), (0.0, 1.0, 0.0), slack)


def test_a_click_on_a_connection_beside_bodies_keeps_what_is_open():
    """The page opens it by the click itself: a click beside all bodies would close it again."""
    state = after(begun(MODEL), do.OpenPart(ME, "forces", "s"))
    assert after(state, click((0.5, 0, 0))).clients[ME].opened == ("forces", "s")
    assert after(state, do.FrameSpot(ME, (0.5, -9.0, 0), (0.0, 1.0, 0.0), 0.0)).clients[
        ME
    ].opened == ("forces", "s")
    assert after(state, click((0.5, 0, -0.6))).clients[ME].opened is None
    hidden = after(state, do.Show(ME, "joining", False))
    assert after(hidden, click((0.5, 0, 0))).clients[ME].opened is None
