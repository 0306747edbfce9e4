"""Places, colours and shapes of the digraph and the bodies."""

import colorsys
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings

import pgraph_app as app
import pgraph_core as pg
from pgraph_core.show import shapes
from pgraph_core.show.digraph import NODE, TIDY, layout

from .store import trees

pytestmark = pytest.mark.quick


@settings(max_examples=10)
@given(trees(200).filter(lambda parent: len(parent) > TIDY))
def test_in_lanes_every_body_has_a_row_and_no_line_runs_through_another_node(parent):
    place = layout(parent, (8,) * len(parent))
    assert len(set(place.y)) == len(parent) + 1
    for k, p in enumerate(parent, 1):  # the line leaves p's lane just above row k
        assert all(place.x[i] != place.x[p] for i in range(p + 1, k))


def test_left_children_stand_left():
    place = layout((0, 1, 1, 1), (1,) * 4)
    assert place.x[2] < place.x[3] < place.x[4]
    assert len(set(layout(tuple(range(500)), (3,) * 500).x)) == 1  # a chain in one lane
    assert len(layout((), ()).x) == 1  # the ground of an empty model


def test_a_branch_begins_where_one_tip_is_left_and_has_a_hue_of_its_own():
    assert shapes.branches((0, 1, 2, 1, 4, 1)) == (0, 1, 1, 2, 2, 3)
    assert shapes.branches((0, 1, 2)) == (1, 1, 1)
    assert shapes.branches((0, 0)) == (1, 2)
    colors = shapes.branch_colors((0, 1, 2, 1, 4, 1))
    assert colors[1] == colors[2] != colors[3] == colors[4] != colors[5]
    assert [shapes.hue_of(k) for k in (0, 1, 6, 7, 13)] == [0, 1, 6, 1, 1]
    assert shapes.branch_colors(()) == ()


def test_of_a_shape_s_own_colour_what_is_dark_or_light_stays_beside_the_branches():
    shades = [shapes.shade(c) for c in (None, (20, 20, 20), (240, 240, 240), (200, 100, 60))]
    assert shades == [None, shapes.RUBBER, shapes.COAT, None]


def rgb(text):
    text = text if len(text) == 6 else "".join(2 * c for c in text)
    return np.array([int(text[k : k + 2], 16) for k in (0, 2, 4)])


def luminance(color):
    c = color / 255
    linear = np.where(c <= 0.03928, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    return float(linear @ (0.2126, 0.7152, 0.0722))


@pytest.mark.parametrize("dark", [False, True])
def test_the_hues_of_branches_stand_out_from_the_paper_and_are_those_of_the_3d_view(dark):
    """Rings and chips: 3 to 1 (WCAG 2.2, 1.4.11)."""
    css = (Path(app.__file__).parent / "core" / "page.css").read_text()
    paper = rgb(re.findall(r"--panel: #(\w+)", css)[dark])
    hues = [rgb(re.findall(rf"--branch-{k}: #(\w+)", css)[dark]) for k in range(len(shapes.HUES))]
    for hue in hues:
        a, b = sorted((luminance(hue), luminance(paper)))
        assert (b + 0.05) / (a + 0.05) >= 3, hue
    if not dark:
        np.testing.assert_array_equal(hues, shapes.HUES)
    # the coats in 3D are tints of the same hues, nearest to their own
    turn = [colorsys.rgb_to_hls(*(np.array(c) / 255))[0] for c in shapes.COATS]
    for k in range(1, len(hues)):
        own = colorsys.rgb_to_hls(*(hues[k] / 255))[0]
        away = [abs((t - own + 0.5) % 1 - 0.5) for t in turn[1:]]
        assert np.argmin(away) == k - 1


@pytest.mark.parametrize("dark", [False, True])
def test_no_branch_has_the_hue_that_says_what_is_selected(dark):
    """A limb of the first branch was blue, and its outline was, too, when it was selected."""
    css = (Path(app.__file__).parent / "core" / "page.css").read_text()
    names = ("accent", *(f"branch-{k}" for k in range(1, len(shapes.HUES))))
    colors = [rgb(re.findall(rf"--{name}: #(\w+)", css)[dark]) for name in names]
    accent, *hues = (colorsys.rgb_to_hls(*(color / 255))[0] for color in colors)
    away = [abs((hue - accent + 0.5) % 1 - 0.5) for hue in hues]
    assert min(away) > 30 / 360
    apart = [abs((a - b + 0.5) % 1 - 0.5) for k, a in enumerate(hues) for b in hues[:k]]
    assert min(apart) > 20 / 360


def test_a_body_without_a_shape_reaches_to_its_children():
    pieces = shapes.pieces(pg.Body(name="a"), ((1.0, 0.0, 0.0), (0.0, 2.0, 0.0)))
    bounds = shapes.mesh(pieces).bounds
    assert bounds[1][:2] == pytest.approx((1.0, 2.0), abs=1e-6)
    assert shapes.mesh(shapes.pieces(pg.Body(name="a"), ())).volume > 0  # without any extent
    for com, high in (((0.0, 0.5, 0.0), 0.5), ((0.5, 0.0, 0.0), 0.2)):  # beside the rod, and in it
        body = pg.Body(name="a", tip=(1, 0, 0), com=com)
        assert (shapes.mesh(shapes.pieces(body, ())).bounds[1][1] > high) == (high == 0.5)
    for kind in ("box", "sphere", "cylinder", "capsule"):
        assert np.ptp(shapes.unit(kind).bounds, axis=0) == pytest.approx((1, 1, 1), rel=0.02)


@pytest.mark.parametrize("shape", [None, pg.Shape(kind="capsule", radius=0.02, length=0.5)])
def test_joints_are_seen_along_their_axes_in_a_colour_of_no_branch(shape):
    for joint, kind in (("revolute", "cylinder"), ("prismatic", "box"), ("spherical", "sphere")):
        axes = {} if joint == "spherical" else {"axes": (0, 1, 0)}
        body = pg.Body(name="a", joint=joint, tip=(0, 0, 0.5), shape=shape, **axes)
        rod, pin = shapes.pieces(body, ())
        assert (pin.kind, pin.position) == (kind, (0.0, 0.0, 0.0))
        assert pin.size[0] > rod.size[0]
        assert joint == "spherical" or pin.rotation[:, 2] == pytest.approx((0, 1, 0))
        assert rod.color is None
        assert pin.color == shapes.shade(pin.color)  # whatever the colour of its body
    cube = pg.Body(name="a", shape=pg.Shape(kind="box", size=(1, 1, 1)))
    assert len(shapes.pieces(cube, ())) == 1


def test_only_edges_are_sharp_in_the_light():
    for kind, normals in (("box", 6), ("cylinder", 2 + 24), ("sphere", None)):
        solid = shapes.unit(kind)
        shaded = shapes.creased(solid)
        assert shaded.area == pytest.approx(solid.area)
        if normals is None:
            assert len(shaded.vertices) == len(solid.vertices)
        else:
            assert len(np.unique(np.round(shaded.vertex_normals, 3) + 0.0, axis=0)) == normals


@pytest.mark.parametrize(("size", "cell"), [(0.05, 0.05), (0.9, 0.5), (3.0, 2.0), (700.0, 500.0)])
def test_grid_spacings_are_round(size, cell):
    assert shapes.spaced(size) == pytest.approx(cell)


@settings(max_examples=40)
@given(trees(80))
def test_a_parent_stands_above_its_children_and_no_two_nodes_overlap(parent):
    place = layout(parent, (8,) * len(parent))
    for k, p in enumerate(parent, 1):
        assert place.y[p] < place.y[k]
    assert min(place.x) >= 0
    assert max(place.x) <= place.width
    assert max(place.y) <= place.height
    levels = {}
    for x, y in zip(place.x, place.y):
        levels.setdefault(y, []).append(x)
    for row in levels.values():
        assert all(np.diff(sorted(row)) >= NODE)
