"""The conventions of docs/conventions.md, on poses."""

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core import rotation

pytestmark = pytest.mark.quick

X, SLANTED = (1.0, 0.0, 0.0), (0.0, 0.6, 0.8)
TURNED = rotation.unit((0.9, 0.1, -0.3, 0.2))
BALL = rotation.unit((0.8, 0.2, 0.1, 0.5))
LINK = (0.1, 0.2, 0.3)
ROTATE_X, ROTATE, BALL_MOTION = ("rotate", X), ("rotate", SLANTED), ("ball", (0.0, 0.0, 1.0))
SLIDE = ("translate", X)


@pytest.mark.parametrize(
    ("motions", "q"),
    [
        ((ROTATE_X, ROTATE), (0.4, -0.7)),
        ((ROTATE_X, SLIDE, ROTATE), (0.4, 0.3, -0.7)),
        ((BALL_MOTION, SLIDE), (*BALL, 0.3)),
        ((ROTATE_X, BALL_MOTION), (0.4, *BALL)),
        ((ROTATE_X, BALL_MOTION, SLIDE), (0.4, *BALL, 0.3)),
    ],
    ids=str,
)
def test_motions_of_a_compound_joint_act_in_order_each_in_the_frame_turned_so_far(motions, q):
    """R = P_1 P_2 ... R(rotation), and translations shift along axes turned by earlier motions."""
    body = pg.Body(name="b", joint="compound", motions=motions, rotation=TURNED, link=LINK, mass=1)
    position, R = pg.Mechanism(pg.Model(bodies=(body,))).pose(np.array(q), "b")
    start = rotation.matrix(TURNED)
    P, shift, left = np.eye(3), np.array(LINK), list(q)
    for kind, axis in motions:
        if kind == "ball":
            P = P @ rotation.matrix([left.pop(0) for _ in range(4)])
        elif kind == "rotate":
            P = P @ rotation.rodrigues(start @ axis, left.pop(0))
        else:
            shift = shift + P @ start @ axis * left.pop(0)
    np.testing.assert_allclose(R, P @ start, atol=1e-15)
    np.testing.assert_allclose(position, shift, atol=1e-15)


def test_the_position_in_q_of_a_free_joint_is_relative_to_its_link():
    """At the ground a body is at link + q, and below another body this turns with it."""
    first = pg.Body(name="first", joint="free", link=LINK)
    second = pg.Body(name="second", joint="free", parent="first", link=LINK)
    mech = pg.Mechanism(pg.Model(bodies=(first, second)))
    q = np.array((1.0, -2.0, 0.5, *TURNED, 0.3, 0.2, 0.1, *BALL))
    place = np.add(LINK, (1.0, -2.0, 0.5))
    np.testing.assert_allclose(mech.pose(q, "first")[0], place, atol=1e-15)
    place += rotation.matrix(TURNED) @ np.add(LINK, (0.3, 0.2, 0.1))
    np.testing.assert_allclose(mech.pose(q, "second")[0], place, atol=1e-15)
