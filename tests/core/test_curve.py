"""A curve joint beside closed forms, a hinge, quadrature and differences."""

import math
import sys

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import pgraph_core as pg
from pgraph_core.paper import Operators

G = 9.81
FINE = {"method": "dop853", "rtol": 1e-13, "estimate": False}
INERTIA = ((0.02, 0.001, 0.002), (0.001, 0.03, 0.003), (0.002, 0.003, 0.04))


def alone(track: pg.Track, **fields) -> pg.Model:
    return pg.Model(bodies=[pg.Body(name="bead", joint="curve", track=track, **fields)])


def chain() -> pg.Model:
    """Return curves that turn, below a free body, below each other, and in a compound joint."""
    knee = pg.Track(
        x="0.3*sin(q)",
        y=[(-2, 0), (0, 0.1), (1, 0.4), (2, 0.2)],
        z="0.2*q^2",
        angles=["0.5*q^2+q", "0.3*sin(2*q)", 0.2],
        axes=[(1, 0.2, 0), (0, 1, 0), (0, 0.3, 1)],
        range=(-2, 2),
    )
    wire = pg.Track(
        points=[(0, 0, 0), (0.3, 0.1, 0.1), (0.6, 0, 0.3), (0.8, 0.2, 0.2)], up=(0, 0, 1)
    )
    more = {"inertia": INERTIA, "com": (0.05, 0.1, 0.02)}
    both = (("rotate", (0, 1, 1)), ("curve", (0, 0, 1)))
    return pg.Model(
        bodies=[
            pg.Body(name="a", joint="free", mass=1, **more),
            pg.Body(name="b", parent="a", link=(0.3, 0.1, 0), rotation=(0.8, 0, 0.6, 0),
                    joint="curve", track=knee, mass=1.3, q=0.4, **more),
            pg.Body(name="c", parent="b", joint="compound", motions=both, track=wire,
                    link=(0, 0.2, 0.1), mass=0.7, q=(0.3, 0.35), **more),
            pg.Body(name="d", parent="c", joint="spherical", link=(0, 0.2, 0.1), mass=0.4, **more),
        ]
    )  # fmt: skip


def test_a_bead_on_a_circle_moves_like_a_pendulum():
    circle = pg.Track(x="0.7*sin(q)", z="-0.7*cos(q)", range=(-math.pi, math.pi), closed=True)
    bead = pg.simulate(alone(circle, q=2.5, v=1.0, mass=1.3), t_end=20, **FINE)
    body = pg.Body(name="bead", axes=(0, -1, 0), com=(0, 0, -0.7), q=2.5, v=1.0, mass=1.3)
    hinge = pg.simulate(pg.Model(bodies=[body]), t_end=20, **FINE)
    assert np.abs(bead.q - hinge.q).max() < 1e-9
    assert bead.energy_drift < 1e-11


def test_a_bead_slides_down_a_helix_as_down_a_slope():
    helix = pg.Track(x="0.5*cos(q)", y="0.5*sin(q)", z="-0.1*q", range=(0, 60))
    run = pg.simulate(alone(helix, mass=2), t_end=3, **FINE)
    slope = G * 0.1 / (0.5**2 + 0.1**2)
    assert np.abs(run.q[:, 0] - 0.5 * slope * run.t**2).max() < 1e-10


def test_a_bead_on_a_parabola_follows_the_equation_of_motion():
    parabola = pg.Track(x="q", z="q^2", range=(-3, 3), unit="m")
    run = pg.simulate(alone(parabola, q=1), t_end=4, **FINE)

    def rates(t, y):
        x, v = y
        return v, -(2 * G * x + 4 * x * v * v) / (1 + 4 * x * x)

    exact = solve_ivp(rates, (0, 4), (1, 0), method="DOP853", rtol=1e-13, atol=1e-14, t_eval=run.t)
    assert np.abs(run.q[:, 0] - exact.y[0]).max() < 1e-10


@pytest.mark.parametrize("start", [0.5, 1.5, 2.8])
def test_a_cycloid_takes_equal_time_from_any_height(start):
    cycloid = pg.Track(x="q-sin(q)", z="cos(q)", range=(0.2, 6.0))
    run = pg.simulate(alone(cycloid, q=start), t_end=math.pi / math.sqrt(G), **FINE)
    assert abs(run.q[-1, 0] - math.pi) < 1e-9 * abs(run.v[-1, 0])


def test_a_knee_of_six_splines_has_the_accelerations_of_its_lagrangian():
    """The equation of one coordinate, m(q) q'' + m'(q) q'²/2 = -V'(q), with m and V of SciPy's
    splines."""
    q = np.linspace(0.0, 2.0, 7)
    table = {
        "x": 0.01 * np.sin(q), "y": -0.02 * q**2, "z": 0.01 * np.cos(2 * q),
    }  # fmt: skip
    turns = [1.0 * q, 0.05 * np.sin(q), 0.1 * q**2]
    track = pg.Track(
        **{name: list(zip(q.tolist(), y.tolist())) for name, y in table.items()},
        angles=[list(zip(q.tolist(), y.tolist())) for y in turns],
        axes=[(0, 0, 1), (1, 0, 0), (0, 1, 0)],
    )
    com, mass = np.array((0.02, -0.2, 0.01)), 3.2
    model = alone(track, mass=mass, com=com, inertia=INERTIA, q=0.7, v=1.1)
    mech = pg.Mechanism(model)
    place = [CubicSpline(q, y, bc_type="natural") for y in (*table.values(), *turns)]

    def motion(at: float) -> tuple[np.ndarray, np.ndarray, float]:
        """Return the derivatives of the centre of mass, the body's spin, and the height."""
        x, slope = [f(at) for f in place], [f(at, 1) for f in place]
        cz, sz, cx, sx, cy, sy = (f(a) for a in x[3:] for f in (np.cos, np.sin))
        rz = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
        rx = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
        ry = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
        turn = rz @ rx @ ry
        spin = slope[3] * np.array((0, 0, 1)) + slope[4] * rz[:, 0] + slope[5] * (rz @ rx)[:, 1]
        reach = turn @ com
        return np.array(slope[:3]) + np.cross(spin, reach), turn.T @ spin, x[2] + reach[2]

    def inertia(at: float) -> float:
        v, spin, _ = motion(at)
        return mass * v @ v + spin @ np.array(INERTIA) @ spin

    def slope_of(f, at: float) -> float:
        h = 1e-4
        return (8 * (f(at + h) - f(at - h)) - (f(at + 2 * h) - f(at - 2 * h))) / (12 * h)

    for at, v in ((0.7, 1.1), (1.234, -2.0), (0.1, 3.0)):
        m = inertia(at)
        assert abs(mech.mass_matrix([at])[0, 0] - m) < 1e-11 * m
        weight = slope_of(lambda x: mass * G * motion(x)[2], at)
        exact = -(0.5 * slope_of(inertia, at) * v * v + weight) / m
        assert abs(mech.forward_dynamics([at], [v])[0] - exact) < 1e-8 * abs(exact)


def test_points_give_a_coordinate_that_is_the_way_along_them():
    corners = [(math.cos(a), math.sin(a), 0.3) for a in np.arange(24) * math.pi / 12]
    ring = pg.Track(points=corners, closed=True, up=(0, 0, 1))
    run = pg.simulate(alone(ring, v=2.0, mass=3), t_end=5, **FINE)
    assert np.abs(run.v - 2.0).max() < 1e-9  # without a slope, the speed stays
    x, turn = ring.at(1.234)
    assert abs(np.linalg.norm(x[:2]) - 1.0) < 1e-6
    np.testing.assert_allclose(turn[:, 2], (0, 0, 1), atol=1e-12)
    np.testing.assert_allclose(turn[:, 0], ring.slope(1.234)[3:], atol=1e-10)


def test_the_derivatives_of_v_equal_differences():
    mech = pg.Mechanism(chain())
    rng = np.random.default_rng(1)
    q, v, tau = mech.packed.system.q.copy(), rng.normal(size=mech.nv), rng.normal(size=mech.nv)
    by_q, by_v, _ = mech.forward_derivatives(q, v, tau)
    h = 1e-6
    for i in (7, 8, 9):  # of the curves and the rotation between them
        step = h * np.eye(len(q))[i]
        change = mech.forward_dynamics(q + step, v, tau) - mech.forward_dynamics(q - step, v, tau)
        np.testing.assert_allclose(by_q[:, i - 1], change / (2 * h), rtol=1e-7, atol=1e-6)
    for i in range(mech.nv):
        step = h * np.eye(mech.nv)[i]
        change = mech.forward_dynamics(q, v + step, tau) - mech.forward_dynamics(q, v - step, tau)
        np.testing.assert_allclose(by_v[:, i], change / (2 * h), rtol=1e-7, atol=1e-6)
    vdot = rng.normal(size=mech.nv)
    back = mech.forward_dynamics(q, v, mech.inverse_dynamics(q, v, vdot))
    np.testing.assert_allclose(back, vdot, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("method", ["rk4", "gauss6", "radau5"])
def test_methods_agree_and_keep_the_energy(method):
    given = {"rtol": 1e-11} if method == "radau5" else {"step": 5e-4}
    exact = pg.simulate(chain(), t_end=0.2, **FINE)
    run = pg.simulate(chain(), t_end=0.2, method=method, estimate=False, **given)
    assert np.abs(run.q[-1] - exact.q[-1]).max() < 1e-8
    assert run.energy_drift < 1e-8


def test_a_stepper_a_batch_and_a_run_have_the_same_bits():
    model = chain()
    given = {"method": "rk4", "step": 1e-3}
    run = pg.simulate(model, t_end=0.02, frames=20, estimate=False, **given)
    stepper = pg.Stepper(model, **given)
    batch = pg.BatchStepper(model, 5, **given)
    for _ in range(20):
        stepper.step()
        batch.step()
    np.testing.assert_array_equal(stepper.q, run.q[-1])
    for q in batch.q:
        np.testing.assert_array_equal(q, run.q[-1])


def test_derivatives_by_parameters_equal_differences():
    track = pg.Track(x="0.5*sin(q)", z="0.2*cos(2*q)", angles=["q^2"], range=(-2, 2))
    model = alone(track, mass=1.2, com=(0.1, 0, 0.05), inertia=INERTIA, q=0.4, v=0.3)
    names = ["bodies.bead.mass", "bodies.bead.damping", "q.bead", "v.bead"]
    model = model.edit("bead", damping=0.1)
    run = pg.simulate(model, t_end=0.5, wrt=names, **FINE)

    def end(**changed) -> np.ndarray:
        return pg.simulate(model.edit("bead", **changed), t_end=0.5, **FINE).q[-1]

    h = 1e-5
    for k, (name, x) in enumerate((("mass", 1.2), ("damping", 0.1), ("q", 0.4), ("v", 0.3))):
        change = (end(**{name: x + h}) - end(**{name: x - h})) / (2 * h)
        found = run.sensitivity(names[k])[-1, :1]
        np.testing.assert_allclose(found, change, rtol=1e-7, atol=1e-8)


def test_a_curve_takes_limits_springs_friction_and_motors():
    wire = pg.Track(points=[(0, 0, 0), (1, 0, -0.4), (2, 0, 0)])
    model = alone(wire, q=0.1, friction=1.5, limits=(0.0, 1.8), stiffness=2.0, rest=0.5)
    run = pg.simulate(model, t_end=6, estimate=False)
    assert run.status == pg.Status.DONE
    assert run.q.min() > -1e-6
    assert run.q.max() < 1.8 + 1e-6
    assert abs(run.energy_drift) < 0.02
    assert abs(run.v[-1, 0]) < 0.2  # friction brings it to rest


def test_a_mirrored_curve_moves_as_its_mirror_image():
    model = chain().edit("b", name="left")
    image = model.mirror("left", "y")
    mech = pg.Mechanism(image)
    rng = np.random.default_rng(3)
    q, slices = mech.packed.system.q.copy(), {n: j.q for n, j in mech.packed.joints.items()}
    left, right = image.body("left"), image.body("right")
    for at in rng.uniform(-1.5, 1.5, 5):
        q[slices["left"]] = q[slices["right"]] = at
        place, turn = mech.poses(q)
        a, b = (mech.names.index(x.name) for x in (left, right))
        np.testing.assert_allclose(place[b], place[a] * (1, -1, 1), atol=1e-12)


def test_a_model_with_curves_is_saved_and_loaded():
    model = chain()
    again = pg.Model.from_json(model.to_json())
    assert again == model
    np.testing.assert_array_equal(again.bodies[1].track.rows, model.bodies[1].track.rows)


BAD = [
    ({"points": [(0, 0, 0)]}, "points"),
    ({"points": [(0, 0, 0), (0, 0, 0), (1, 0, 0)]}, "points"),
    ({"points": [(0, 0, 0), (0.5, 0, 0), (0.5, 1e-9, 0), (1, 0, 0)]}, "points"),
    ({"points": [(7, 0, 0), (7, 5e-4, 0), (7, 5e2, 0), (8, 1e3, 0)]}, "points"),
    ({"points": [(0, 0, 0), (1, 0, 0), (0, 0, 0)]}, "points"),
    ({"points": [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 0)], "closed": True}, "points"),
    ({"points": [(0, 0, 0), (1, 0, 0)], "closed": True}, "points"),
    ({"points": [(0, 0, 0), (0, 0, 1)], "up": (0, 0, 1)}, "up"),
    ({"points": [(0, 0, 0), (0, 0, 1)], "x": "q"}, "points"),
    ({"points": [(0, 0, 0), (0, 0, 1)], "unit": "rad"}, "unit"),
    ({"x": "q^2", "range": (-1, 1)}, "x"),
    ({"x": "q^3", "y": "q^2", "range": (-1, 1.3)}, "x"),
    ({"x": "q", "range": (0, 1), "closed": True}, "closed"),
    ({"x": "abs(q)", "range": (-1, 1)}, "x"),
    ({"x": "1/q", "range": (-1, 1)}, "x"),
    ({"x": "cos(w)", "range": (0, 1)}, "x"),
    ({"x": "q"}, "range"),
    ({"x": "q", "range": (1, 0)}, "range"),
    ({"x": [(0, 1), (0, 2)]}, "x"),
    ({"x": [(0, 1, 0), (0, 2, 0)]}, "x"),
    ({"x": [(0, 1), (1e-7, 2), (1, 3)]}, "x"),
    ({"x": [(0, 1), (1, 2)], "range": (0, 2)}, "x"),
    ({"angles": ["q", "q"], "axes": [(1, 0, 0), (2, 0, 0)], "range": (0, 1)}, "axes"),
    ({"angles": ["q"], "axes": [(0, 0, 0)], "range": (0, 1)}, "axes"),
    ({"angles": ["q"], "axes": [(1, 0, 0), (0, 1, 0)], "range": (0, 1)}, "axes"),
    ({}, "x"),
]


@pytest.mark.quick
@pytest.mark.parametrize(("fields", "field"), BAD)
def test_a_bad_track_is_refused_by_its_field(fields, field):
    with pytest.raises(pg.ModelError) as caught:
        pg.Track(**fields)
    assert [problem.field for problem in caught.value.problems] == [field]


@pytest.mark.quick
def test_triples_are_a_piecewise_cubic_with_their_slopes():
    rows = ((-1.0, 0.1, 0.5), (0.2, 0.3, -0.2), (1.0, 0.0, 1.0))
    track = pg.Track(x=rows, y="q", angles=[rows], axes=[(0, 0, 1)])
    for q, value, slope in rows:
        assert track.at(q)[0][0] == pytest.approx(value, abs=1e-14)
        assert track.slope(q)[[2, 3]] == pytest.approx([slope, slope], abs=1e-10)  # of the fit
    q = 0.2 + 0.8 * 0.4  # h00 y0 + h10 h m0 + h01 y1 + h11 h m1 at t = 0.4
    assert track.at(q)[0][0] == pytest.approx(
        0.648 * 0.3 + 0.144 * 0.8 * -0.2 - 0.096 * 0.8 * 1.0, abs=1e-14
    )
    assert track.mirrored((-1, 1, 1)).x[1] == (0.2, -0.3, 0.2)


def test_steps_end_where_the_second_derivative_of_a_track_jumps():
    """A method of order 4 keeps its order, as within a piece."""
    track = pg.Track(x="q", z=((-1, 0, 0), (0.3, 0.1, 0.2), (3, 0.4, 0)), range=(-1, 3), unit="m")
    assert track.corners == (0.3,)
    model = alone(track, q=(-0.4,), v=(6.0,))
    exact = pg.simulate(model, t_end=0.4, method="dop853", rtol=1e-13).q[-1]
    errors = [
        np.abs(pg.simulate(model, t_end=0.4, method="rk4", step=h).q[-1] - exact).max()
        for h in (8e-3, 4e-3)
    ]
    assert errors[1] < 1e-8
    assert errors[0] / errors[1] > 8.0


@pytest.mark.quick
def test_a_curve_needs_one_track_and_other_joints_none():
    track = pg.Track(points=[(0, 0, 0), (1, 0, 0)])
    two = (("curve", (0, 0, 1)), ("curve", (0, 0, 1)))
    for fields, field in (
        ({"joint": "curve"}, "track"),
        ({"joint": "revolute", "track": track}, "track"),
        ({"joint": "compound", "motions": two, "track": track}, "motions"),
    ):
        with pytest.raises(pg.ModelError) as caught:
            pg.Body(name="a", **fields)
        assert field in [problem.field for problem in caught.value.problems]


def test_a_run_names_a_body_past_the_end_of_its_track():
    track = pg.Track(points=[(0, 0, 0), (1, 0, -0.5)])
    run = pg.simulate(alone(track), t_end=1.0, estimate=False)
    assert any("past the end of its track at t = " in text for text in run.notices)
    short = pg.simulate(alone(track), t_end=0.2, estimate=False)
    assert not any("track" in text for text in short.notices)


def test_operators_of_the_paper_know_that_axes_of_curves_turn():
    """H depends on the coordinate, so that a of eq. (9) contains H' times the squared speed."""
    mech = pg.Mechanism(chain())
    q = np.concatenate([body.q for body in mech.model.bodies])
    v = np.linspace(0.3, 1.5, mech.nv)
    dense = Operators(mech.model, mech.topology, q, v)
    expected = mech.bias_force(q, v)
    np.testing.assert_allclose(dense.bias_force, expected, atol=1e-12 * abs(expected).max())


def test_a_curve_may_be_any_motion_of_a_compound_joint():
    """The track of a curve before a hinge was lost, and kernels read beyond their arrays."""
    guide = pg.Track(x="0.1*cos(q)", y="0.07*sin(q)", range=(0, 6.28))
    fields = {"track": guide, "com": (0, 0, -0.1), "mass": 1.0, "inertia": INERTIA}
    both = [("curve", (0, 0, 1)), ("rotate", (0, 1, 0))]
    one = pg.Body(name="a", joint="compound", motions=both, q=(0.3, 0.2), v=(1.0, 2.0), **fields)
    arm = pg.Body(name="a", joint="curve", track=guide, mass=0.0, q=0.3, v=1.0)
    own = {key: fields[key] for key in ("com", "mass", "inertia")}
    hinge = pg.Body(name="b", parent="a", axes=(0, 1, 0), q=0.2, v=2.0, **own)
    run = pg.simulate(pg.Model(bodies=[one]), t_end=0.3, **FINE)
    two = pg.simulate(pg.Model(bodies=[arm, hinge]), t_end=0.3, **FINE)
    np.testing.assert_allclose(run.q, two.q, atol=1e-11)


@pytest.mark.parametrize("size", [1e-3, 1.0, 100.0])
def test_closed_tracks_of_any_size_are_taken(size):
    a = np.arange(10) * math.tau / 10
    ring = np.stack((np.cos(a), 0.6 * np.sin(a), 0.2 * np.sin(2 * a)), axis=1) * size
    assert pg.Track(points=ring, closed=True).pieces.x[-1] > size
    uneven = np.array([(0, 0, 0), (0.5, 0.2, 0.1), (1, 0.1, 0.3), (1.3, 0.8, 0.2)]) * size
    assert pg.Track(points=uneven, closed=True).closed


def test_derivatives_by_a_start_at_the_beginning_of_a_track_equal_differences():
    a = np.arange(12) * math.tau / 12
    points = np.stack((np.cos(a), np.sin(a), 0.3 * np.sin(2 * a)), axis=1)
    model = alone(pg.Track(points=points, closed=True, up=(0, 0, 1)), v=1.5, inertia=INERTIA)
    given = {"method": "rk4", "step": 5e-3, "t_end": 0.2, "estimate": False}
    run = pg.simulate(model, wrt=["q.bead"], **given)
    h = 1e-5  # into the track: third derivatives jump by 2e-6 where it closes
    a, b, c = (pg.simulate(model, q=[x], **given).q[-1, 0] for x in (0.0, h, 2 * h))
    assert abs(run.sensitivity("q.bead")[-1, 0] - (4 * b - 3 * a - c) / (2 * h)) < 1e-7


KNEE = {
    "joint": "curve",
    "track": pg.Track(
        x="0.2*sin(q)", z="-0.1*q^2", angles=["-q", "0.3*sin(q)"], axes=[(0, 1, 0), (1, 0, 0)],
        range=(-2, 2),
    ),
}  # fmt: skip
GUIDED = {
    "knee": KNEE,
    **{f"{p} m a turn": {"joint": "screw", "axes": (1, 0, 0), "pitch": p} for p in (0.01, 0.5, 3)},
}


def hanging(**fields) -> pg.Model:
    """Return a body on a free one, without gravity."""
    base = pg.Body(name="base", joint="free", mass=2, inertia=INERTIA, com=(0.1, 0, 0.2))
    guided = {"link": (0.3, 0, -0.4), "com": (0, 0.1, 0.1), "mass": 2, "inertia": INERTIA}
    body = pg.Body(name="body", parent="base", **guided, **fields)
    return pg.Model(bodies=[base, body], gravity=(0, 0, 0))


@pytest.mark.parametrize("options", [FINE, {"step": 1e-4}], ids=["events", "time stepping"])
@pytest.mark.parametrize("guide", GUIDED)
def test_impulses_along_a_curve_and_a_coarse_screw_keep_energy_and_momentum(guide, options):
    """H has a length other than 1 there, and impulses took it for their own direction."""
    model = hanging(**GUIDED[guide], limits=(-0.3, 0.4), limit_restitution=1.0)
    model = model.edit("base", v=(0.3, -0.2, 0.5, 0.1, 0.2, 0.3)).edit("body", v=(3.0,))
    run = pg.simulate(model, t_end=0.5, **options)
    assert run.q[:, -1].min() > -0.31
    assert run.q[:, -1].max() < 0.41
    assert sum(run.v[1:, -1] * run.v[:-1, -1] < 0) > 1, "it hits both limits"
    mech = run.mechanism
    momentum = np.array([mech.momentum(q, v) for q, v in zip(run.q, run.v)])
    close = 1e-9 if options is FINE else 2e-3
    assert np.abs(momentum - momentum[0]).max() < close * np.abs(momentum).max()
    assert np.abs(run.kinetic_energy - run.kinetic_energy[0]).max() < close * run.kinetic_energy[0]


@pytest.mark.parametrize("guide", GUIDED)
def test_joint_friction_and_a_prescribed_motion_balance_energy_along_a_curve(guide):
    held = pg.Motion(name="m", body="body", q_of_t="=0.2*sin(9*t)")
    for model in (
        hanging(**GUIDED[guide], friction=0.5).edit("body", v=(1.0,)),
        pg.Model(bodies=hanging(**GUIDED[guide]).bodies, gravity=(0, 0, 0), constraints=[held]),
    ):
        run = pg.simulate(model, t_end=0.5, step=1e-3)
        booked = run.kinetic_energy + run.dissipation - run.work
        assert np.abs(booked - booked[0]).max() < 1e-4 * run.kinetic_energy.max()


@pytest.mark.parametrize(("place", "text"), [("x", "R*cos(2*q)"), ("angles", "=2*R*sin(q)/4")])
def test_a_parameter_in_a_function_of_a_track_is_refused_with_what_to_write(place, text):
    fields = {"z": "sin(q)", "range": (0, 1)}
    body = {"name": "a", "joint": "curve", "track": {place: text, **fields}, "mass": 1.0}
    with pytest.raises(pg.ModelError, match="reads only q") as error:
        pg.Model(bodies=[body], parameters={"R": 2.0})
    written = str(error.value).split("=f'")[1].rstrip("'").format(R=2.0)
    assert pg.Track(**{place: written}, **fields).range == (0, 1)
    assert pg.Model(bodies=[{**body, "track": {"x": "=R", **fields}}], parameters={"R": 2.0})


def test_a_track_of_many_points_follows_them():
    """The work of a piece does not grow with their number: they are fitted together."""
    s = np.linspace(0.0, 40.0, 2000)
    points = np.column_stack(((1 + 0.1 * s) * np.cos(s), (1 + 0.1 * s) * np.sin(s), 0.2 * s))
    track = pg.Track(points=points, up=(0, 0, 1))
    calls = 0

    def count(frame, event, _):
        nonlocal calls
        calls += event == "call"

    sys.setprofile(count)
    try:
        track = pg.Track(points=points, up=(0, 0, 1))
    finally:
        sys.setprofile(None)
    assert calls < 8 * len(points)  # four of them per point read the numbers
    middle = track.at(track.pieces.x[2000])[0]
    assert np.linalg.norm(points - middle, axis=1).min() < 1e-9
    speed = [np.linalg.norm(track.slope(q)[3:]) for q in np.linspace(0.0, track.pieces.x[-1], 50)]
    np.testing.assert_allclose(speed, 1.0, atol=1e-10)


@pytest.mark.quick
def test_each_refusal_of_a_track_has_a_text():
    with pytest.raises(pg.ModelError, match="at most 3"):
        pg.Track(angles=["q"] * 4, axes=[(0, 1, 0)] * 4, range=(0, 1))
    assert pg.Track(angles="q", range=(0, 1)).angles == ("q",)
