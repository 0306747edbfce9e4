"""Paths over obstacles in a row and through rings: closed forms, and laws of moment arms."""

import warnings

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.forces.obstacle_rows import past_obstacles
from pgraph_core.simulation.paths import Path

from .test_gradients import difference
from .test_paths_of_forces import floating, over

UP = (0, 0, 1)
CALM = {"method": "dop853", "rtol": 1e-11, "estimate": False}


def stand(*vias, point=(3.0, -1.0, 0.0), other_point=(-3.0, -1.0, 0.0)):
    """A carriage on three sliders, with a path from the ground to it."""
    axes = np.eye(3)
    bodies = [
        pg.Body(name=n, parent=p, joint="prismatic", axes=(a,), mass=1.0)
        for n, p, a in zip("xyz", ("ground", "x", "y"), axes)
    ]
    path = pg.Spring(name="s", body="z", point=point, other_point=other_point, via=vias,
                     stiffness=20.0, rest=1.0)  # fmt: skip
    return pg.Mechanism(pg.Model(bodies=bodies, forces=[path], gravity=(0, 0, 0)))


def post(x, y, radius, **fields):
    return {"body": "ground", "point": (x, y, 0.3), "radius": radius, "axis": UP, **fields}


def ball(x, y, z, radius, **fields):
    return {"body": "ground", "point": (x, y, z), "radius": radius, **fields}


def egg(x, y, z, *radii, **fields):
    return {"body": "ground", "point": (x, y, z), "radii": radii, **fields}


TURNED = {"rotation": (0.8, 0.3, -0.4, 0.2)}
ABOVE = {"side": (0.0, 90.0, 0.0)}
ASIDE = {"side": (0.0, 5.0, 90.0)}
BELOW = {"side": (0.0, -90.0, 0.0)}


@pytest.mark.quick
@pytest.mark.parametrize("rise", [0.0, 0.8, -2.0])
def test_a_path_over_two_posts_is_straight_on_their_unrolled_surface(rise):
    mech = stand(post(1, 0, 0.5, **ABOVE), post(-1, 0, 0.5, **ABOVE))
    far = np.hypot(2.0, 1.0)
    steep = np.arcsin(0.5 / far) + np.arctan(0.5)  # of the tangent from an end
    flat = 2.0 * (np.sqrt(far**2 - 0.25) + 0.5 * steep) + 2.0
    assert mech.path_length([0, 0, rise])[0] == pytest.approx(np.hypot(flat, rise), rel=1e-13)


@pytest.mark.quick
def test_a_path_between_two_posts_crosses_on_their_inner_tangent():
    mech = stand(post(1, 0, 0.5, **BELOW), post(-1, 0, 0.5, **ABOVE), point=(3.0, 1.0, 0.0))
    far = np.hypot(2.0, 1.0)
    steep = np.arcsin(0.5 / far) + np.arctan(0.5)
    turned = steep + np.arcsin(0.5)  # the tangent between them falls by asin(2 r / distance)
    flat = 2.0 * (np.sqrt(far**2 - 0.25) + 0.5 * turned + np.sqrt(0.75))
    assert mech.path_length(np.zeros(3))[0] == pytest.approx(flat, rel=1e-13)


@pytest.mark.quick
def test_a_path_over_many_balls_of_a_great_circle_is_that_over_their_posts():
    """All centres and both ends lie in a plane, so that the path does. It passes above them."""
    places = ((2.0, 0.1, 0.3), (0.7, 0.2, 0.4), (-0.6, 0.0, 0.5), (-1.9, 0.1, 0.2))
    balls = [ball(x, y, 0.0, r, **ABOVE) for x, y, r in places]
    posts = [post(x, y, r, **ABOVE) for x, y, r in places]
    ends = {"point": (3.0, 0.3, 0.0), "other_point": (-3.0, 0.25, 0.0)}
    one, two = (stand(*x, **ends).path_length(np.zeros(3))[0] for x in (balls, posts))
    assert one == pytest.approx(two, rel=1e-13)
    assert one > 6.03


@pytest.mark.quick
@pytest.mark.parametrize("axis", [UP, None], ids=["cylinder", "sphere"])
def test_a_path_through_a_ring_makes_equal_angles_with_it(axis):
    ring = {"body": "ground", "point": (0, 0, 0), "radius": 0.5, "axis": axis, "inner": True}
    mech = stand(ring, point=(2.0, 1.5, 0.0), other_point=(-2.0, 1.5, 0.0))
    lengths = [mech.path_length([0, 0, z])[0] for z in (0.0, 0.6)]
    assert lengths[0] == pytest.approx(2.0 * np.hypot(2.0, 1.0), rel=1e-13)
    if axis:
        assert lengths[1] == pytest.approx(np.hypot(lengths[0], 0.6), rel=1e-13)
    below = stand(ring, point=(2.0, 0.3, 0.0), other_point=(-2.0, -0.2, 0.0))
    assert below.path_length(np.zeros(3))[0] == pytest.approx(np.hypot(4.0, 0.5), rel=1e-13)


ROWS = {
    "ring": [post(0.3, -2.0, 0.4, inner=True)],
    "hoop": [ball(0.3, -2.0, 0.1, 0.4, inner=True)],
    "posts": [post(1, 0, 0.5, axis=(0.2, 0.1, 1), **ABOVE),
              post(-0.6, 0.1, 0.6, axis=(0.1, -0.3, 1), **ABOVE)],
    "balls": [ball(1, -0.6, 0.1, 0.5, **ABOVE), ball(-0.6, -0.7, -0.1, 0.6, **ASIDE)],
    "three": [ball(1.2, -0.9, 0.3, 0.5, **ABOVE), post(-0.2, -0.6, 0.4, **ABOVE),
              ball(-1.4, -1.0, -0.1, 0.5, **ASIDE)],
    "sides": [post(1.2, -0.2, 0.5, **ABOVE), post(0.0, -1.8, 0.4, **BELOW),
              post(-1.2, -0.2, 0.5, **ABOVE)],
    "egg": [egg(0.3, -0.6, 0.1, 0.9, 0.4, 0.3, **TURNED)],
    "egg with a side": [egg(0.3, -0.9, 0.1, 0.9, 0.5, 0.4, **ASIDE)],
    "eggs": [egg(1.2, -0.6, 0.1, 0.7, 0.4, 0.6, **TURNED, **ABOVE),
             egg(-0.9, -0.7, -0.1, 0.6, 0.5, 0.3, **ABOVE)],
    "egg in a row": [post(1.5, -0.8, 0.4, **ABOVE), egg(0, -0.7, -0.1, 0.6, 0.5, 0.3, **ABOVE),
                     ball(-1.4, -1.0, -0.1, 0.5, **ABOVE)],
    "two legs": [ball(1.4, -0.9, 0.1, 0.4, **ABOVE), post(0.6, -0.8, 0.2, **ABOVE),
                 {"body": "x", "point": (0, -0.5, 0)},
                 post(-0.6, -0.9, 0.3, axis=(0.5, 0, 1), **BELOW),
                 ball(-1.5, -1.1, 0.2, 0.4, **ABOVE)],
}  # fmt: skip


@pytest.mark.quick
@pytest.mark.parametrize("row", ROWS)
def test_moment_arms_are_the_slopes_of_lengths(row):
    mech, h = stand(*ROWS[row]), 1e-4
    for q in np.random.default_rng(3).uniform(-0.5, 0.5, (30, 3)):
        steps = h * np.eye(3)
        behind, ahead = (mech.path_length(q + s * steps)[:, 0] for s in (-1, 1))
        far = [mech.path_length(q + 2.0 * s * steps)[:, 0] for s in (-1, 1)]
        slope = (8.0 * (ahead - behind) - (far[1] - far[0])) / (12.0 * h)
        bent = np.abs(ahead + behind - 2.0 * mech.path_length(q)[0]).max()
        if bent < 1e2 * h * h:  # not where it lifts off
            np.testing.assert_allclose(mech.moment_arms(q)[0], -slope, rtol=0, atol=1e-9)


# the path does not change over to another side of these ellipsoids
GO_ON = {key: row for key, row in ROWS.items() if "egg" not in key} | {
    "egg": [egg(0.3, -1.9, 0.1, 0.9, 0.4, 0.3, **TURNED)],
    "egg with a side": [egg(0.3, -1.6, 0.1, 0.9, 0.5, 0.9, **ABOVE)],
    "eggs": [egg(1, -1.9, 0.1, 0.5, 0.4, 0.6, **ABOVE),
             egg(-0.6, -1.8, -0.1, 0.6, 0.5, 0.4, **TURNED, **ABOVE)],
    "egg in a row": [post(1.5, -0.8, 0.4, **ABOVE), egg(0, -1, -0.1, 0.6, 0.5, 0.4, **ABOVE),
                     ball(-1.4, -1.2, -0.1, 0.5, **ABOVE)],
}  # fmt: skip


@pytest.mark.quick
@pytest.mark.parametrize("row", GO_ON)
def test_lengths_go_on_where_paths_lift_off_and_touch_down(row):
    """A length changes by no more than its end moves, and its slope has no jumps."""
    mech = stand(*GO_ON[row])
    a, b = np.array((0.1, -1.5, -0.3)), np.array((0.1, 1.5, 0.3))
    for most, n in ((0.05, 1500), (0.005, 50)):
        q = a + np.linspace(0.0, 1.0, n + 1)[:, None] * (b - a)
        lengths, arms = mech.path_length(q)[:, 0], mech.moment_arms(q)[:, 0]
        assert np.abs(np.diff(lengths)).max() <= np.linalg.norm(b - a) / n * (1 + 1e-9)
        changes = np.abs(np.diff(arms, axis=0)).max(axis=1)
        assert changes.max() < most
        a, b = q[changes.argmax() :][:2]  # it changes most here, by little in each part of it


# -- motions ---------------------------------------------------------------------------------------

# beside the path of `floating` from a to c, which touches both balls and the drum there
ROW = [
    {"body": "b", "point": (-0.8, 0.25, -0.1), "radius": 0.25, "side": (-5.0, 0.25, 0.0)},
    {"body": "ground", "point": (0.25, 1.0, 0.2), "radius": 0.3, "axis": (0.2, 0.1, 1.0),
     "side": (-4.0, 3.0, 0.0)},
]  # fmt: skip
EGG = [{"body": "b", "point": (-0.8, 0.25, -0.1), "radii": (0.4, 0.25, 0.2), **TURNED}]
RING = [{"body": "b", "point": (-0.9, 0.9, 0.2), "radius": 0.1, "axis": (1, 0.2, 0), "inner": True}]


def arm(*vias):
    """Two links on parallel hinges without gravity, and a spring from the second one to the
    ground, over obstacles at both hinges."""
    bodies = [
        pg.Body(name="upper", joint="revolute", axes=(UP,), mass=1.0, inertia=(0.1, 0.1, 0.1),
                com=(0.5, 0, 0), q=(0.3,), v=(0.8,)),
        pg.Body(name="lower", parent="upper", joint="revolute", axes=(UP,), mass=1.0,
                inertia=(0.1, 0.1, 0.1), link=(1, 0, 0), com=(0.4, 0, 0), q=(-0.9,), v=(-0.5,)),
    ]  # fmt: skip
    spring = pg.Spring(name="s", body="lower", point=(0.5, 0.05, 0.02), other_point=(-0.4, 0.1, 0),
                       via=vias, stiffness=30.0, rest=1.2)  # fmt: skip
    return pg.Model(bodies=bodies, forces=[spring], gravity=(0, 0, 0))


OVER_HINGES = (
    {"body": "upper", "point": (1, 0, 0.02), "radius": 0.3, "side": (1, -5, 0)},
    {"body": "ground", "point": (0, 0, 0), "radius": 0.15, "axis": UP, "side": (0, 5, 0)},
)


OVER_EGGS = (
    {"body": "upper", "point": (1, 0, 0.02), "radii": (0.3, 0.3, 0.4), "side": (1, -5, 0)},
    {"body": "ground", "point": (0, 0, 0), "radii": (0.15, 0.1, 0.12), **TURNED,
     "side": (0, 5, 0)},
)  # fmt: skip


def test_a_row_of_balls_has_a_shortest_path_from_any_side():
    """It is straight between them. Where none is near on their sides, it slips to another one."""
    random, bent = np.random.default_rng(5), 0
    for n in 500 * (2, 3, 4):
        past, places = [], []
        for x in np.linspace(3, -3, n + 2)[1:-1]:
            c, r = np.array((x, *random.uniform(-0.8, 0.4, 2))), random.uniform(0.2, 0.55)
            side = np.add(c, (0.0, 9.0, random.uniform(-6.0, 6.0)))
            past.append(pg.Via(body="ground", point=c, radius=r, side=side))
            places.append((np.eye(3), c))
        ends = (np.array((x, *random.uniform(-1.5, 0.5, 2))) for x in (3.0, -3.0))
        bent += past_obstacles(past, places, *ends)[1] > 1e-8
    assert bent <= 3


def test_an_arm_with_a_spring_over_its_hinges_keeps_its_energy():
    """It swings within a turn over drums: from a ball it slips, and a full turn unwinds it."""
    drums = {**OVER_HINGES[0], "axis": UP}, OVER_HINGES[1]
    model = arm(*drums).edit("s", stiffness=3.0, rest=None)
    run = pg.simulate(model, v=[0.3, -0.2], t_end=10.0, **CALM)
    total = run.kinetic_energy + run.potential_energy
    assert np.ptp(run.kinetic_energy) > 0.01
    assert np.ptp(total) < 1e-9 * total.max()


@pytest.mark.parametrize("points", [ROW, RING, EGG], ids=["row", "ring", "egg"])
def test_free_bodies_keep_energy_and_momentum(points):
    run = pg.simulate(floating(over(points)), t_end=0.5, **CALM)
    scale = run.kinetic_energy.max()
    assert np.ptp(run.kinetic_energy + run.potential_energy) < 1e-8 * scale
    assert np.ptp(run.kinetic_energy) > 0.05 * scale
    if points is not ROW:  # which leans on the ground
        assert np.ptp(run.mechanism.momentum(run.q, run.v), axis=0).max() < 1e-9


def test_moment_arms_are_the_torques_of_springs():
    mech = pg.Mechanism(arm(*OVER_HINGES))
    q = mech.home()[0]
    tension = 30.0 * (mech.path_length(q)[0] - 1.2)
    tau = mech.mass_matrix(q) @ mech.forward_dynamics(q, np.zeros(2))
    np.testing.assert_allclose(tension * mech.moment_arms(q)[0], tau, rtol=1e-12)


@pytest.mark.parametrize(
    ("vias", "path"),
    [
        (OVER_HINGES, "via.0.radius"),
        (OVER_HINGES, "via.1.point.0"),
        (OVER_HINGES, "point.1"),
        (OVER_EGGS, "via.0.radii.1"),
        (OVER_EGGS, "via.1.rotation.2"),
        (OVER_EGGS[:1], "via.0.radii.0"),
    ],
)
def test_runs_have_derivatives_by_numbers_of_obstacles(vias, path):
    model, path = arm(*vias), f"forces.s.{path}"
    how = {"method": "rk4", "step": 2e-3, "t_end": 0.2, "estimate": False, "frames": 3}
    run = pg.simulate(model, wrt=path, **how)
    assert (run.q == pg.simulate(model, **how).q).all()
    given = Path(model, path)

    def state(change):
        end = pg.simulate(given.set(model, given.present + change), **how)
        return np.hstack((end.q, end.v))

    expected = difference(state, 2e-5)
    assert np.abs(expected).max() > 1e-3
    found = run.sensitivity(path)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8 * np.abs(expected).max())


@pytest.mark.parametrize(
    "vias", [OVER_HINGES, (), OVER_EGGS, OVER_EGGS[:1]], ids=["row", "ring", "eggs", "egg"]
)
def test_instances_in_lanes_move_as_single_runs(vias):
    ring = {"body": "upper", "point": (0.5, -0.35, 0), "radius": 0.1, "axis": UP, "inner": True}
    model = arm(*(vias or (ring,)))
    batch = pg.BatchStepper(model, 5, method="rk4", step=1e-3)
    v = np.linspace(-0.5, 0.5, 5)[:, None] * np.ones(2)
    batch.reset(batch.q, v)
    batch.step(n=100)
    for n in range(5):
        run = pg.simulate(model, v=v[n], t_end=0.1, method="rk4", step=1e-3, estimate=False)
        np.testing.assert_allclose(batch.q[n], run.q[-1], rtol=0, atol=1e-12)


@pytest.mark.parametrize("y", [1.0, -1.0])
@pytest.mark.parametrize(("x", "told"), [(1.0, 0), (0.51, 0), (0.49, 1), (0.45, 1), (0.3, 1)])
def test_obstacles_without_a_straight_line_between_them_are_told(x, y, told):
    """The path crosses from above one post to below the other, which overlap if x < 0.5."""
    mech = stand(post(x, 0, 0.5, **BELOW), post(-x, 0, 0.5, **ABOVE), point=(3.0, y, 0.0))
    notices = pg.simulate(mech, t_end=1e-3, method="rk4", step=1e-3).notices
    found = [text for text in notices if "'s'" in text and "no shortest way" in text]
    assert len(found) == told
    assert all("2 obstacles" in text and "'ground'" in text for text in found)
    q = np.array([[0.2, 0.0, 0.0], [0.0, 0.0, 0.0]])
    for ask in (mech.path_length, mech.moment_arms):
        with warnings.catch_warnings(record=True) as given:
            warnings.simplefilter("always")
            ask(q)
        texts = [str(one.message) for one in given]
        assert len(texts) == 2 * told  # one for each state
        assert all("'s'" in text and "no shortest way" in text for text in texts)
        assert all(one.filename == __file__ for one in given)
        assert not told or "x 0.2" in texts[0]
