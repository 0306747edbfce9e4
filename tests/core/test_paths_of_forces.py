"""Forces over via points: laws of energy and momentum, closed forms, derivatives and files."""

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.dynamics.exerted import load_wrenches
from pgraph_core.forces import lines_of
from pgraph_core.simulation.paths import Path

from .rescaling import rescaled
from .test_gradients import difference
from .trees import moved

CALM = {"method": "dop853", "rtol": 1e-11, "estimate": False}
TABLE = pg.Lines(x=(0.5, 2.0, 3.0), value=(-4.0, 10.0, 40.0))
LAWS = {
    "spring": {"stiffness": 12.0, "rest": 0.5},
    "strut": {"spring": TABLE, "bump_length": 2.5, "bump_stiffness": 30.0},
}


def via(*places):
    return [{"body": name, "point": point} for name, point in places]


INSIDE = via(("b", (0.2, 0.1, -0.1)), ("c", (-0.1, 0.3, 0.2)), ("a", (0.0, 0.2, 1.0)))
ALSO_GROUND = [*INSIDE, *via(("ground", (0.5, -1.0, 0.3)))]

# past a sphere on a body and a cylinder on the ground, which the path touches in the scene
PAST = {
    "floating": [
        {"body": "b", "point": (-0.72, 0.45, 0.25), "radius": 0.25},
        {"body": "a", "point": (0.4, 1.2, 0.6)},
        {"body": "ground", "point": (0.4, 1.3, 0.15), "radius": 0.2, "axis": (1.0, 0.2, 0.0),
         "side": (0.35, 2.0, 0.15)},
    ],
    "chain": [
        {"body": "b", "point": (0.1, 0.3, 0.2), "radius": 0.25},
        {"body": "c", "point": (-0.1, 0.6, 0.2)},
        {"body": "ground", "point": (0.3, 0.1, 0.0), "radius": 0.3, "axis": (0.0, -0.5, -0.5),
         "side": (0.8, 0.4, 0.1)},
        {"body": "a", "point": (0.0, 0.2, 1.0)},
    ],
}  # fmt: skip


def past(scene):
    """Return elements of a path that the force of a scene leads around."""
    return PAST[scene.__name__]


def around(model, q):
    """Return for each line of a path whether it lies on an obstacle, and its points."""
    mech, (f,) = pg.Mechanism(model), model.forces
    pose = {"ground": (np.zeros(3), np.eye(3)), **{n: mech.pose(q, n) for n in mech.names}}
    at = lambda name, point: pose[name][0] + pose[name][1] @ np.array(point)  # noqa: E731
    return [(on, line) for line, on in lines_of(f, model.body(f.body), at, lambda n: pose[n][1])]


def over(points, kind="spring", **fields):
    """A spring or strut from body a over via points to body c."""
    given = {"name": "s", "body": "a", "other": "c", "via": points, **LAWS[kind], **fields}
    return pg.Force(kind=kind, **{"point": (0.1, 0.2, 0.3), "other_point": (0.2, 0, 0.1), **given})


def floating(*forces):
    """Three free bodies without gravity."""
    starts = {
        "a": ((0, 0, 0), (0.1, 0.2, 0.1, 0.3, -0.4, 0.2)),
        "b": ((1, 0.3, 0.2), (0.2, -0.1, 0.4, -0.1, 0.2, 0.1)),
        "c": ((0.2, 1.3, -0.4), (-0.3, 0.1, 0.2, 0.1, 0.1, -0.2)),
    }
    bodies = [
        pg.Body(name=name, joint="free", mass=1.5, inertia=(0.2, 0.3, 0.4), q=(*place, 1, 0, 0, 0),
                v=speed)
        for name, (place, speed) in starts.items()
    ]  # fmt: skip
    return pg.Model(bodies=bodies, forces=forces, gravity=(0, 0, 0))


def chain(*forces):
    """Three bodies on a hinge, a ball and a universal joint, away from q = 0."""
    joints = ("a", "ground", "revolute"), ("b", "a", "spherical"), ("c", "b", "universal")
    bodies = [
        pg.Body(name=n, parent=p, joint=j, mass=1.0, inertia=(1, 1, 1), link=(0.3, 0.5, 0.2))
        for n, p, j in joints
    ]
    model = pg.Model(bodies=bodies, forces=forces, gravity=(0, 0, 0))
    q = moved(model, pg.Mechanism(model).home()[0], np.linspace(0.2, 0.7, 6))
    return model.edit("a", q=q[:1]).edit("b", q=q[1:5]).edit("c", q=q[5:])


def rope(**fields):
    """A block on a line through x, and a rope to it over a pulley without mass at the origin."""
    block = pg.Body(name="a", joint="prismatic", axes=((1, 0, 0),), mass=2.0, q=(1.4,))
    ends = {"point": (0, 0, 0), "other_point": (0, -3.0, 0)}
    given = {"stiffness": 50.0, "rest": 4.0} | fields
    force = pg.Spring(name="s", body="a", **ends, via=via(("ground", (0, 0, 0))), **given)
    return pg.Model(bodies=[block], forces=[force], gravity=(0, 0, 0))


def torque_of(mech, q):
    return mech.mass_matrix(q) @ mech.forward_dynamics(q, np.zeros(mech.nv))


@pytest.mark.quick
@pytest.mark.parametrize(
    "points", [INSIDE, ALSO_GROUND, ALSO_GROUND[2:], past], ids=[3, 4, 2, "past"]
)
@pytest.mark.parametrize("kind", LAWS)
@pytest.mark.parametrize("scene", [floating, chain])
def test_the_force_is_the_slope_of_the_energy(scene, kind, points):
    points = past(scene) if points is past else points
    model = scene(over(points, kind))
    mech = pg.Mechanism(model)
    if points is PAST[scene.__name__]:
        assert sum(on for on, _ in around(model, mech.home()[0])) == 2
    q, still = mech.home()[0], np.zeros(mech.nv)

    def energy(step):
        return mech.energy(moved(model, q, step), still)[1]

    slope = [difference(lambda x, e=e: energy(x * e), 5e-4) for e in np.eye(mech.nv)]
    tau = torque_of(mech, q)
    assert np.abs(tau).max() > 1.0
    np.testing.assert_allclose(tau, -np.array(slope), rtol=0, atol=1e-8 * np.abs(tau).max())


@pytest.mark.parametrize("points", [INSIDE, PAST["floating"][:1]], ids=["points", "sphere"])
@pytest.mark.parametrize("kind", LAWS)
def test_free_bodies_keep_energy_and_momentum(kind, points):
    run = pg.simulate(floating(over(points, kind)), t_end=2.0, **CALM)
    scale = run.kinetic_energy.max()
    assert np.ptp(run.kinetic_energy + run.potential_energy) < 1e-8 * scale
    assert np.ptp(run.kinetic_energy) > 0.1 * scale
    momentum = run.mechanism.momentum(run.q, run.v)
    assert np.ptp(momentum, axis=0).max() < 1e-9


@pytest.mark.quick
@pytest.mark.parametrize("points", [INSIDE, PAST["floating"][:1]], ids=["points", "sphere"])
def test_wrenches_of_a_path_inside_a_system_add_up_to_zero(points):
    model = floating(over(points, damping=2.0))
    mech = pg.Mechanism(model)
    q, v = mech.home()
    (wrenches,) = load_wrenches(mech.packed, model.forces, np.zeros(1), q[None], v[None])
    places = np.array([mech.pose(q, name)[0] for name in mech.names])
    forces = wrenches[:, 3:]
    moments = wrenches[:, :3] + np.cross(places, forces)
    assert np.abs(forces).max() > 1.0
    np.testing.assert_allclose(forces.sum(axis=0), 0.0, atol=1e-13)
    np.testing.assert_allclose(moments.sum(axis=0), 0.0, atol=1e-13)


@pytest.mark.quick
def test_points_along_a_straight_line_of_one_body_change_nothing():
    ends = np.array([0.1, 0.2, 0.3]), np.array([0.7, -0.4, 0.5])
    between = via(*(("a", tuple(ends[0] + s * (ends[1] - ends[0]))) for s in (0.3, 0.55, 1.0)))
    long = floating(over(between, damping=2.0, rest=1.0))
    short = floating(
        over((), damping=2.0, point=ends[1], rest=1.0 - np.linalg.norm(np.diff(ends, axis=0)))
    )
    one, two = map(pg.Mechanism, (long, short))
    q, v = one.home()
    assert one.energy(q, v) == pytest.approx(two.energy(q, v), abs=1e-13)
    found, expected = one.forward_dynamics(q, v), two.forward_dynamics(q, v)
    assert np.abs(expected).max() > 1.0
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.quick
@pytest.mark.parametrize("scene", [floating, chain])
@pytest.mark.parametrize("which", ["points", "past"])
def test_a_path_read_from_its_other_end_pulls_alike(scene, which):
    points = past(scene) if which == "past" else ALSO_GROUND
    given = over(points, damping=2.0)
    ends = {"body": "c", "other": "a", "point": given.other_point, "other_point": given.point}
    one, two = scene(given), scene(over(points[::-1], damping=2.0, **ends))
    q, v = pg.Mechanism(one).home()
    v = np.linspace(-1.0, 1.0, len(v))
    found, expected = (pg.Mechanism(x).forward_dynamics(q, v) for x in (one, two))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_a_rope_over_a_pulley_swings_at_the_frequency_of_its_spring():
    """The rope is x + 3 m long, so that m x'' = -k (x - 1)."""
    t = 1.7
    run = pg.simulate(rope(), t_end=t, **CALM)
    assert run.q[-1, 0] == pytest.approx(1.0 + 0.4 * np.cos(5.0 * t), abs=1e-9)


def test_a_rope_with_both_ends_on_a_load_lifts_twice_its_tension():
    load = pg.Body(name="load", joint="prismatic", axes=((0, 0, 1),), mass=3.0, q=(-1.0,))
    ends = {"body": "load", "other": "load", "point": (0, 0, 0), "other_point": (0.2, 0, 0)}
    points = via(("ground", (0, 0, 0)), ("ground", (0.2, 0, 0)))
    force = pg.Spring(name="s", **ends, via=points, stiffness=100.0, rest=2.0)
    mech = pg.Mechanism(pg.Model(bodies=[load], forces=[force], gravity=(0, 0, 0)))
    x = -1.3  # two falls of 1.3 m and 0.2 m between the points of the ground
    tension = 100.0 * (2 * 1.3 + 0.2 - 2.0)
    assert mech.forward_dynamics([x], [0.0])[0] == pytest.approx(2 * tension / 3.0, rel=1e-12)


@pytest.mark.parametrize(
    "path", ["forces.s.stiffness", "forces.s.via.0.point.1", "forces.s.rest", "forces.s.point.2",
             "forces.s.via.0.radius", "forces.s.via.2.axis.2"],
)  # fmt: skip
def test_runs_have_derivatives_by_numbers_of_a_path(path):
    is_round = path.endswith(("radius", "axis.2"))
    model = floating(over(PAST["floating"] if is_round else ALSO_GROUND, damping=0.5))
    t_end = 0.06 if is_round else 0.4  # while it lies on its obstacles
    how = {"method": "rk4", "step": 2e-3, "t_end": t_end, "estimate": False, "frames": 3}
    run = pg.simulate(model, wrt=path, **how)
    now = pg.simulate(model, **how)
    assert (run.q == now.q).all()
    given = Path(model, path)

    def state(change):
        end = pg.simulate(given.set(model, given.present + change), **how)
        return np.hstack((end.q, end.v))

    expected = difference(state, 2e-5 if is_round else 2e-4)
    assert np.abs(expected).max() > 1e-3
    found = run.sensitivity(path)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8 * np.abs(expected).max())


@pytest.mark.parametrize("method", ["rk4", "semi_implicit_euler"])
@pytest.mark.parametrize("points", [ALSO_GROUND, PAST["chain"]], ids=["points", "past"])
def test_instances_in_lanes_move_as_single_runs(method, points):
    model = chain(over(points, damping=0.5))
    batch = pg.BatchStepper(model, 5, method=method, step=1e-3)
    v = np.linspace(-0.5, 0.5, 5)[:, None] * np.ones(6)
    batch.reset(batch.q, v)
    batch.step(n=100)
    for n in range(5):
        run = pg.simulate(model, v=v[n], t_end=0.1, method=method, step=1e-3, estimate=False)
        np.testing.assert_allclose(batch.q[n], run.q[-1], rtol=0, atol=1e-12)


@pytest.mark.parametrize("points", [ALSO_GROUND, PAST["chain"]], ids=["points", "past"])
def test_in_other_units_it_is_the_same_motion(points):
    model = chain(over(points, damping=0.5))
    scaled = rescaled(model, length=3.0, mass=5.0, time=0.5)
    how = {"method": "rk4", "estimate": False}
    one = pg.simulate(model, t_end=0.2, step=1e-3, **how)
    two = pg.simulate(scaled, t_end=0.1, step=5e-4, **how)
    np.testing.assert_allclose(two.q, one.q, rtol=1e-10)


def test_a_bend_of_a_strut_is_met_at_the_length_of_its_whole_path():
    """The table bends at 4 m, which the rope over the pulley has at x = 1 m."""
    block = rope().bodies[0].unchecked_copy({"q": (0.7,), "v": (0.0,)})
    given = rope().forces[0]
    bent = pg.Lines(x=(0.0, 4.0, 8.0), value=(-40.0, 0.0, 1600.0))  # 10 N/m, then 400 N/m
    strut = pg.Strut(name="s", body="a", point=given.point, other_point=given.other_point,
                     via=given.via, spring=bent)  # fmt: skip
    model = pg.Model(bodies=[block], forces=[strut], gravity=(0, 0, 0))
    slow, fast = np.sqrt(10.0 / 2.0), np.sqrt(400.0 / 2.0)
    t = np.pi / 2 / slow + np.pi / fast  # back at 1 m, at the speed with which it came
    run = pg.simulate(model, t_end=t, **CALM)
    assert run.q[-1, 0] == pytest.approx(1.0, abs=1e-7)
    assert run.v[-1, 0] == pytest.approx(-0.3 * slow, abs=1e-7)


def test_a_span_that_loses_its_length_is_told_with_derivatives():
    run = pg.simulate(rope(rest=0.0), wrt="forces.s.stiffness", method="rk4", step=1e-3, t_end=1.0,
                      estimate=False)  # fmt: skip
    assert any("length of 0" in text for text in run.notices)
    start = rope().edit("a", q=(0.0,))
    notices = pg.simulate(start, t_end=0.01, method="rk4", step=1e-3).notices
    assert any("'s'" in text and "coincide" in text for text in notices)


# -- round obstacles ---


def rope_past(x, y, radius, rise=0.0, **fields):
    """A block at x of a line at y = -1, and a rope to it from (-1, y) past a cylinder about z."""
    block = pg.Body(
        name="a", joint="prismatic", axes=((1, 0, 0),), mass=2.0, q=(x,), link=(0, -1, 0)
    )
    post = {
        "body": "ground",
        "point": (0, 0, 5.0),
        "radius": radius,
        "axis": (0, 0, -2.0),
        **fields,
    }
    rope = pg.Spring(name="s", body="a", point=(0, 0, rise), other_point=(-1.0, y, 0), via=[post],
                     stiffness=50.0, rest=1.0)  # fmt: skip
    return pg.Mechanism(pg.Model(bodies=[block], forces=[rope], gravity=(0, 0, 0)))


@pytest.mark.quick
@pytest.mark.parametrize("rise", [0.0, 0.7])
@pytest.mark.parametrize("x", [0.8, 1.4])
def test_a_rope_past_a_post_is_two_tangents_and_an_arc(x, rise):
    """Its ends are at angles a and b of the post, and its tangents reach acos(r/d) of them."""
    radius, y = 0.5, -1.0
    mech = rope_past(x, y, radius, rise, side=(0, 2.0, 0))
    p, q = np.array((x, -1.0)), np.array((-1.0, y))
    far = np.hypot(*p), np.hypot(*q)
    swept = (np.arctan2(q[1], q[0]) - np.arctan2(p[1], p[0])) % (2 * np.pi)
    arc = swept - np.arccos(radius / far[0]) - np.arccos(radius / far[1])
    assert arc > 1.0
    flat = radius * arc + sum(np.sqrt(np.square(far) - radius**2))
    stretch = np.hypot(flat, rise) - 1.0
    home = mech.home()
    assert mech.energy(*home)[1] == pytest.approx(25.0 * stretch**2, rel=1e-13)


@pytest.mark.quick
@pytest.mark.parametrize("x", [-0.6, -0.2, 0.3, 0.9])
@pytest.mark.parametrize("axis", [(0, 0, 1.0), None], ids=["cylinder", "sphere"])
def test_a_rope_leaves_an_obstacle_where_it_is_straight(axis, x):
    """The line from (-1, 0.4) to (x, -1) is |0.4 x - 1| / straight from the origin."""
    mech = rope_past(x, 0.4, 0.5, axis=axis, point=(0, 0, 0))
    length = 1.0 + np.sqrt(mech.energy(*mech.home())[1] / 25.0)
    straight = np.hypot(x + 1.0, 1.4)
    if abs(0.4 * x - 1.0) / straight >= 0.5:
        assert length == pytest.approx(straight, rel=1e-13)
    else:
        assert length > straight * (1.0 + 1e-4)


@pytest.mark.quick
def test_a_rope_around_half_a_post_presses_on_it_with_twice_its_tension():
    """Both falls hang down, so that a post on a spring of its own sinks by 2 T / k."""
    post = pg.Body(name="post", joint="prismatic", axes=((0, 1, 0),), mass=1.0)
    left, right = (-0.3, -2.0, 0.0), (0.3, -2.0, 0.0)
    rope = pg.Spring(name="s", body="post", other="ground", point=left, other_point=right, rest=1.0,
                     stiffness=7.0, via=[{"body": "post", "point": (0, 0, 0), "radius": 0.3,
                                          "axis": (0, 0, 1), "side": (0, 1, 0)}])  # fmt: skip
    mech = pg.Mechanism(pg.Model(bodies=[post], forces=[rope], gravity=(0, 0, 0)))
    tension = 7.0 * (2.0 + np.pi * 0.3 + 2.0 - 1.0)
    # the fall on the post itself pulls its end up, so that one tension is left
    assert mech.forward_dynamics([0.0], [0.0])[0] == pytest.approx(-tension, rel=1e-12)


@pytest.mark.quick
@pytest.mark.parametrize("x", [0.3, 0.9])
def test_a_point_inside_an_obstacle_is_told(x):
    mech = rope_past(x, 0.9, 1.2, point=(0, 0, 5.0))
    notices = pg.simulate(mech, t_end=1e-3, method="rk4", step=1e-3).notices
    told = [text for text in notices if "'s'" in text and "1.2 m" in text]
    assert len(told) == (np.hypot(x, 1.0) < 1.2)


@pytest.mark.quick
@pytest.mark.parametrize("given", ["model", "scenario", "call"])
def test_a_point_inside_an_obstacle_is_told_of_every_force_of_a_run(given):
    model = rope_past(0.3, 0.9, 1.2, point=(0, 0, 5.0)).model
    rope, bare = model.forces, model.replace(forces=())
    if given == "scenario":
        bare = bare.replace(scenarios=[pg.Scenario(name="pulled", forces=rope)])
    mech = pg.Mechanism(model if given == "model" else bare)
    call = {"scenario": {"scenario": "pulled"}, "call": {"forces": rope}}.get(given, {})
    notices = pg.simulate(mech, t_end=1e-3, method="rk4", step=1e-3, **call).notices
    assert sum("'s'" in text and "1.2 m" in text for text in notices) == 1


# -- the description -------------------------------------------------------------------------------


def test_files_hold_via_points_and_older_versions_refuse_them():
    model = floating(over(ALSO_GROUND))
    assert '"schema_version": 9' in model.to_json()
    assert pg.Model.from_json(model.to_json()) == model
    assert "via" not in floating(over(())).to_json()
    assert '"schema_version": 1' in pg.Model(bodies=[pg.Body(name="a", mass=1)], forces=[
        pg.Spring(name="s", body="a", stiffness=1.0)]).to_json()  # fmt: skip


def test_a_pair_is_a_via_point_as_among_the_stations_of_a_cable():
    pair, via = ("b", (0.1, 0, 1)), pg.Via(body="b", point=(0.1, 0, 1))
    assert pg.Spring(name="s", body="a", via=[pair]) == pg.Spring(name="s", body="a", via=[via])


def test_via_points_follow_their_bodies():
    model = floating(over(ALSO_GROUND))
    named = model.edit("b", name="new").forces[0]
    assert [place.body for place in named.via] == ["new", "c", "a", "ground"]
    assert model.remove("b").forces == ()
    sole = floating(over(ALSO_GROUND), pg.Spring(name="t", body="a", stiffness=1.0))
    assert [f.name for f in sole.remove("b").forces] == ["t"]


def test_a_mirrored_branch_has_the_mirror_images_of_its_via_points():
    trunk = pg.Body(name="trunk", joint="fixed", mass=1.0)
    leg = pg.Body(name="left leg", parent="trunk", link=(0, 0.3, 0), mass=1.0, tip=(0, 0, -1))
    points = via(("trunk", (0.1, 0.4, -0.2)), ("left leg", (0.2, 0.1, -0.3)))
    muscle = pg.Spring(name="left", body="left leg", other="trunk", via=points, stiffness=9.0)
    model = pg.Model(bodies=[trunk, leg], forces=[muscle]).mirror("left leg", plane="y")
    copy = model.part("right", "force")
    assert (copy.body, copy.other) == ("right leg", "trunk")
    assert [(x.body, x.point) for x in copy.via] == [
        ("trunk", (0.1, -0.4, -0.2)), ("right leg", (0.2, -0.1, -0.3)),
    ]  # fmt: skip


def test_a_parameter_moves_a_via_point():
    point = {"body": "ground", "point": (0, "=2*h", 0)}
    given = {"kind": "spring", "name": "s", "body": "a", "stiffness": 1.0, "via": [point]}
    model = pg.Model(bodies=[pg.Body(name="a", mass=1.0)], parameters={"h": 0.5}, forces=[given])
    assert model.forces[0].via[0].point == (0.0, 1.0, 0.0)
    again = pg.Model.from_json(model.to_json()).edit("h", 0.75)
    assert again.forces[0].via[0].point == (0.0, 1.5, 0.0)
