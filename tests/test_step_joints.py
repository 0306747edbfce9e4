"""Joints proposed from faces alone, without the library that reads STEP files."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from pgraph_core.formats.step_joints import Face, evidence_of, joint_of, merged, proposed

pytestmark = pytest.mark.quick
X, Y, Z = np.eye(3)
TOLERANCE = 1e-7


def cylinder(radius, low, high, side, *, at=(0, 0, 0), axis=Z, share=1.0):
    at, reach = np.array(at, float), radius + max(abs(low), abs(high))
    box = np.array((at - reach, at + reach))
    given = {"radius": radius, "low": low, "high": high, "side": side, "share": share}
    return Face("cylinder", at, np.array(axis, float), box, **given)


def plane(normal, at, u, v, *, hole=0.0):
    """A rectangle with edges 2u and 2v around a point."""
    at, u, v = (np.array(x, float) for x in (at, u, v))
    corners = [at + i * u + j * v for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    triangles = np.array([[corners[k] for k in rows] for rows in ((0, 1, 2), (0, 2, 3))])
    box = np.array((np.min(corners, 0), np.max(corners, 0)))
    return Face("plane", at, np.array(normal, float), box, triangles=triangles)


def sphere(radius, side, *, at=(0, 0, 0), share=1.0):
    at = np.array(at, float)
    return Face(
        "sphere", at, Z, np.array((at - radius, at + radius)), radius, side=side, share=share
    )


def part(name, *faces):
    boxes = np.array([face.box for face in faces])
    return SimpleNamespace(
        name=name, faces=faces, box=np.array((boxes[:, 0].min(0), boxes[:, 1].max(0)))
    )


def only(*pair):
    found = proposed(pair, TOLERANCE)
    assert len(found) <= 1
    return found[0] if found else None


SHAFT = cylinder(0.005, 0, 0.02, 1)
BORE = cylinder(0.005, 0, 0.01, -1)
SHOULDER = (plane(Z, (0.01, 0, 0), (0.02, 0, 0), (0, 0.02, 0)),
            plane(-Z, (0, 0, 0), (0.01, 0, 0), (0, 0.01, 0)))  # fmt: skip
WALLS = [
    (plane(s * Y, (0, s * 0.01, 0), (0.02, 0, 0), (0, 0, 0.01)),
     plane(-s * Y, (0, s * 0.01, 0), (0.1, 0, 0), (0, 0, 0.01))) for s in (1, -1)
]  # fmt: skip
FLOOR = (plane(-Z, (0, 0, -0.01), (0.02, 0, 0), (0, 0.01, 0)),
         plane(Z, (0, 0, -0.01), (0.1, 0, 0), (0, 0.01, 0)))  # fmt: skip
STOP = (plane(X, (0.02, 0, 0), (0, 0.01, 0), (0, 0, 0.01)),
        plane(-X, (0.02, 0, 0), (0, 0.01, 0), (0, 0, 0.01)))  # fmt: skip
FAR = [(cylinder(0.005, 0, 0.02, 1, at=(0.1, 0, 0), axis=axis),
        cylinder(0.005, 0, 0.01, -1, at=(0.1, 0, 0), axis=axis)) for axis in (Z, X)]  # fmt: skip
BALL = (sphere(0.01, 1), sphere(0.0102, -1, share=0.7))


@pytest.mark.parametrize(
    ("pairs", "kind", "selected"),
    [
        ([(SHAFT, BORE)], "cylindrical", True),
        ([(SHAFT, BORE), SHOULDER], "revolute", True),
        ([(SHAFT, BORE), SHOULDER, STOP], "revolute", True),  # a stop does not hold
        ([(SHAFT, BORE), FAR[0]], "prismatic", True),
        ([(SHAFT, BORE), FAR[0], SHOULDER], "weld", True),
        ([(SHAFT, BORE), FAR[1]], "weld", True),
        ([*WALLS, FLOOR], "prismatic", True),
        ([*WALLS, FLOOR, STOP], "prismatic", True),
        (WALLS, "planar", False),
        ([FLOOR], "planar", False),
        ([FLOOR, WALLS[0]], "prismatic", False),  # a corner: it can be lifted off
        ([BALL], "spherical", True),
        ([BALL, (sphere(0.01, 1, at=X), sphere(0.01, -1, at=X))], "revolute", True),
    ],
)
def test_what_the_faces_leave_is_the_joint(pairs, kind, selected):
    first, second = (part(name, *(pair[k] for pair in pairs)) for k, name in enumerate("ab"))
    found = only(first, second)
    assert (found.kind, found.selected, found.bodies) == (kind, selected, ("a", "b"))
    turned = only(second, first)
    assert (turned.kind, turned.selected) == (kind, selected)


@pytest.mark.parametrize(
    ("shaft", "bore"),
    [
        (SHAFT, cylinder(0.0045, 0, 0.01, -1)),  # too tight
        (SHAFT, cylinder(0.0053, 0, 0.01, -1)),  # too wide
        (SHAFT, cylinder(0.005, 0, 0.01, 1)),  # two shafts
        (SHAFT, cylinder(0.005, 0, 0.01, -1, share=0.5)),  # half a bore
        (SHAFT, cylinder(0.005, 0.03, 0.04, -1)),  # beyond its end
        (SHAFT, cylinder(0.005, 0, 0.01, -1, at=(0.0003, 0, 0))),  # beside it
        (SHAFT, cylinder(0.005, 0, 0.01, -1, axis=X)),
    ],
)
def test_what_does_not_fit_is_no_joint(shaft, bore):
    assert only(part("a", shaft), part("b", bore)) is None


def test_planes_that_share_an_edge_do_not_touch():
    beside = plane(Z, (0.04, 0, 0), (0.01, 0, 0), (0, 0.02, 0))
    assert evidence_of(SHOULDER[0], SHOULDER[1], TOLERANCE) is not None
    assert evidence_of(beside, SHOULDER[1], TOLERANCE) is None
    assert evidence_of(SHOULDER[0], SHOULDER[0], TOLERANCE) is None  # side by side, not opposite


def test_halves_of_a_bore_are_one_and_separate_bores_are_not():
    halves = [
        cylinder(0.005, 0, 0.01, -1, share=0.5),
        cylinder(0.005, -0.01, 0, -1, axis=-Z, share=0.5),
    ]
    (whole,) = merged(halves, TOLERANCE)
    assert (whole.share, whole.low, whole.high) == (1.0, 0.0, 0.01)
    assert len(merged([BORE, cylinder(0.005, 0.02, 0.03, -1)], TOLERANCE)) == 2


@pytest.mark.parametrize("kind", ["revolute", "prismatic", "cylindrical", "spherical", "planar"])
def test_the_place_of_a_joint_follows_a_turn_of_the_assembly(kind):
    rng = np.random.default_rng(3)
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    point = rng.normal(size=3)
    far = point + 0.3 * axis if kind in ("revolute", "cylindrical") else point
    found = joint_of([(kind, point, axis), (kind, far, axis)], 1e-6)
    assert found[0] == kind
    if kind != "spherical":
        assert np.linalg.norm(np.cross(found[2], axis)) < 1e-12
    if kind in ("revolute", "cylindrical"):
        assert np.linalg.norm(np.cross(found[1] - point, axis)) < 1e-12
    if kind == "spherical":
        assert found[1] == pytest.approx(point, abs=1e-12)


def test_the_gap_is_the_distance_of_the_axes():
    found = only(part("a", SHAFT), part("b", cylinder(0.0051, 0, 0.01, -1, at=(1e-4, 0, 0))))
    assert found.gap == pytest.approx(1e-4)
    assert math.dist(found.point, found.other_point) == pytest.approx(1e-4)
    assert "0.1 mm apart" in str(found)
