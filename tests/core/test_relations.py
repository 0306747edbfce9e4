"""Relations: a coordinate that is a smooth function of another one."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import pgraph_core as pg
from pgraph_core.analysis.rows import Rows
from pgraph_core.simulation.paths import Path

INERTIA, MASS, G, AMPLITUDE = 0.3, 2.0, 9.81, 0.2
SINE = f"={AMPLITUDE}*(1-cos(q.cam))"
METHODS = ("dopri5", "rk4", "radau5", "gauss6", "moreau_jean", "semi_implicit_euler")
CURVES: dict[str, Any] = {
    "expression": "=0.3*sin(2*q.a) + 0.1*q^2",
    "polynomial": pg.Polynomial(coefficients=(0.1, 0.2, -0.3, 0.05, 0.02, -0.01)),
    "natural": pg.Curve(x=(-1.0, 0.2, 0.5, 1.5), value=(0.0, 0.4, 0.3, 1.0)),
    "clamped": pg.Curve(x=(-1.0, 0.2, 0.5, 1.5), value=(0.0, 0.4, 0.3, 1.0), kind="clamped"),
    "periodic": pg.Curve(x=(-1.0, 0.2, 0.5, 1.5), value=(0.0, 0.4, 0.3, 1.0), kind="periodic"),
    "quintic": pg.Curve(x=(-1.0, 0.2, 0.5, 1.5), value=(0.0, 0.4, 0.3, 1.0), kind="quintic"),
    "hermite": pg.Curve(
        x=(-1.0, 0.2, 1.5), value=(0.0, 0.4, 1.0), slope=(0.1, -0.3, 0.7), kind="hermite"
    ),
}


def cam(curve: Any = SINE, speed: float = 3.0, far: bool = False, **follower: Any) -> pg.Model:
    """A cam with a vertical follower. Gravity acts along -z.

    Time stepping needs a limit, which is `far` away.
    """
    follower = {"limits": [(-9.0, 9.0)], **follower} if far else follower
    bodies = (
        pg.Body(name="cam", inertia=INERTIA * np.eye(3), v=(speed,)),
        pg.Body(name="follower", joint="prismatic", axes=[(0, 0, 1)], mass=MASS, **follower),
    )
    lift = pg.Relation(name="lift", body="follower", other="cam", curve=curve)
    return pg.Model(bodies=bodies, constraints=(lift,), parameters={"size": 0.2})


def rotors(*ties: pg.Constraint, **first: Any) -> pg.Model:
    """Two discs about z, of which b follows a."""
    discs = (("a", 0.3, first), ("b", 0.7, {}))
    bodies = [pg.Body(name=n, inertia=x * np.eye(3), **more) for n, x, more in discs]
    return pg.Model(bodies=bodies, constraints=ties)


def function(curve: Any, x: float) -> tuple[float, float, float]:
    """Return f, f' and f'' at x of rotor a, from the acceleration and the gap of rotor b."""
    mech = pg.Mechanism(rotors(pg.Relation(name="r", body="b", other="a", curve=curve)))
    rows = Rows.of(mech, np.zeros(1, dtype=np.int64), np.array([x, 0.0]))
    v = np.array([1.0, -rows.J[0, 0]])
    vdot, _ = mech.constrained_dynamics((x, 0.0), v)
    return -float(rows.gap[0]), -float(rows.J[0, 0]), float(vdot[1] + rows.J[0, 0] * vdot[0])


# -- the function ----------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", CURVES)
@pytest.mark.parametrize("x", [-3.7, -0.4, 0.3, 1.2, 9.1])
def test_slopes_are_those_of_the_values(kind, x):
    """By central differences of order 4, also beyond the ends."""
    h = 1e-3
    f, slope, bend = function(CURVES[kind], x)
    at = [function(CURVES[kind], x + k * h) for k in (-2, -1, 1, 2)]
    weights = np.array([1.0, -8.0, 8.0, -1.0]) / (12.0 * h)
    size = 1.0 + abs(f) + abs(slope)
    assert abs(weights @ [y[0] for y in at] - slope) < 1e-9 * size
    assert abs(weights @ [y[1] for y in at] - bend) < 1e-9 * size


def test_curves_pass_through_their_points_and_repeat_or_go_on_linearly():
    for kind in ("natural", "clamped", "periodic", "quintic", "hermite"):
        curve = CURVES[kind]
        for x, slope in zip(curve.x, curve.slope):
            assert function(curve, x)[1] == pytest.approx(slope, abs=1e-14)
        for x, value in zip(curve.x, curve.value):
            assert function(curve, x)[0] == pytest.approx(value, abs=1e-14)
        (low, high), (first, last) = (np.array(x)[[0, -1]] for x in (curve.x, curve.value))
        if kind == "periodic":
            for x in (0.3, 1.2):
                f = np.array(function(curve, x))
                turned = np.array(function(curve, x + 40 * (high - low)))
                assert turned - f == pytest.approx([40 * (last - first), 0, 0], abs=1e-12)
            continue
        slopes = [function(curve, x)[1] for x in (low, high)]
        for x, end, value, slope in ((-8.0, low, first, slopes[0]), (9.0, high, last, slopes[1])):
            known = value + slope * (x - end), slope, 0.0
            assert function(curve, x) == pytest.approx(known, abs=1e-13)
    spline = CubicSpline(CURVES["natural"].x, CURVES["natural"].value, bc_type="natural")
    found = function(CURVES["natural"], 0.9)
    assert found == pytest.approx([float(spline(0.9, k)) for k in range(3)], abs=1e-14)


def test_a_quintic_between_two_points_is_the_3_4_5_polynomial():
    """Its peak acceleration is 10/√3 h/β² ω², and the dwells beyond it do not bend."""
    rise, angle, speed = 0.02, 1.2, 30.0
    curve = pg.Curve(x=(0.3, 0.3 + angle), value=(0.01, 0.01 + rise), kind="quintic")
    u = (1.0 - np.sqrt(1.0 / 3.0)) / 2.0
    _, _, bend = function(curve, 0.3 + u * angle)
    peak = 10.0 / np.sqrt(3.0) * rise / angle**2 * speed**2
    assert bend * speed**2 == pytest.approx(peak, rel=1e-9)
    for x in (0.3, 0.3 + angle, -2.0, 4.0):
        assert function(curve, x)[1:] == pytest.approx((0.0, 0.0), abs=1e-13)


# -- motions ---------------------------------------------------------------------------------------


def test_a_straight_relation_is_a_gear():
    ratio, offset = -1.7, 0.3
    ties = [
        pg.Gear(name="tie", body="b", other="a", ratio=ratio, offset=offset),
        pg.Relation(name="tie", body="b", other="a", curve=f"={offset} - 1.7*q"),
        pg.Relation(name="tie", body="b", other="a", curve=pg.Polynomial(coefficients=(0.3, -1.7))),
        pg.Relation(name="tie", body="b", other="a", curve=pg.Curve(x=(0, 1), value=(0.3, -1.4))),
    ]
    push = pg.Motor(name="push", body="a", torque="=sin(3*t)")
    runs = [pg.simulate(rotors(tie).add(push), t_end=1.0) for tie in ties]
    for run in runs[1:]:
        assert run.q == pytest.approx(runs[0].q, abs=1e-12)
        found, known = (r.constraint_force["tie"] for r in (run, runs[0]))
        assert found == pytest.approx(known, abs=1e-12)


def lagrange(q: float, v: float) -> float:
    """Return q'' of the cam, (I + m f'²) q'' + m f' f'' q'² + m g f' = 0."""
    slope, bend = AMPLITUDE * np.sin(q), AMPLITUDE * np.cos(q)
    return -MASS * slope * (bend * v * v + G) / (INERTIA + MASS * slope**2)


@pytest.mark.parametrize("method", METHODS)
def test_every_method_moves_a_scotch_yoke_by_its_equation(method):
    step = {} if method in ("dopri5", "radau5") else {"step": 1e-3}
    tolerance = {} if step else {"rtol": 1e-10}
    model = cam(far=method == "moreau_jean")
    run = pg.simulate(model, t_end=2.0, frames=41, method=method, **step, **tolerance)
    assert run.status.ok, run.message
    reference = pg.simulate(cam(), t_end=2.0, frames=41, method="dop853", rtol=1e-12)
    error = {"moreau_jean": 1e-4, "semi_implicit_euler": 2e-2}.get(method, 1e-7)
    assert np.abs(run.q - reference.q).max() < error
    q, v = run.q[:, 0], run.v[:, 0]
    assert run.q[:, 1] == pytest.approx(AMPLITUDE * (1.0 - np.cos(q)), abs=1e-11)
    assert run.v[:, 1] == pytest.approx(AMPLITUDE * np.sin(q) * v, abs=1e-11)
    if method != "moreau_jean":  # whose accelerations are means
        known = np.array([lagrange(*x) for x in zip(q, v)])
        assert run.vdot[:, 0] == pytest.approx(known, abs=1e-11 * np.abs(known).max())


def test_a_relation_does_no_work():
    run = pg.simulate(cam(), t_end=4.0, rtol=1e-12)
    energy = run.energy
    assert np.ptp(energy) < 1e-10 * np.abs(energy).max()
    assert (run.work == 0.0).all()


def test_the_force_is_that_of_the_follower():
    run = pg.simulate(cam(), t_end=1.0, rtol=1e-11)
    lift = run.constraint_force["lift"][:, 5]
    assert lift == pytest.approx(MASS * (run.vdot[:, 1] + G), abs=1e-10)
    slope = AMPLITUDE * np.sin(run.q[:, 0])
    assert INERTIA * run.vdot[:, 0] == pytest.approx(-slope * lift, abs=1e-10)


def ellipse(angle: Any, e: float) -> Any:
    """Return the angle of the second of two equal ellipses that turn about their foci."""
    return angle + 2.0 * np.arctan(e * np.sin(angle) / (1.0 - e * np.cos(angle)))


@pytest.mark.parametrize("given", ["expression", "points"])
def test_elliptic_gears_transmit_by_their_radii_over_several_turns(given):
    """The ratio of speeds is (1 - e²) / (1 + e² - 2 e cos θ)."""
    e, x = 0.4, np.linspace(0.0, 2.0 * np.pi, 721)
    value = np.append(ellipse(x[:-1], e), 2.0 * np.pi)
    points = pg.Curve(x=x, value=value, kind="periodic")
    curve = points if given == "points" else f"=q + 2*atan({e}*sin(q)/(1 - {e}*cos(q)))"
    wheel = pg.Relation(name="wheel", body="b", other="a", curve=curve)
    run = pg.simulate(rotors(wheel, v=(5.0,)), t_end=20.0, rtol=1e-11, frames=101)
    turned, (first, second) = run.q[:, 0], run.v.T
    assert turned[-1] > 4 * np.pi
    known = (1.0 - e**2) / (1.0 + e**2 - 2.0 * e * np.cos(turned))
    error = 1e-10 if given == "expression" else 0.2 * x[1] ** 3  # of the spline
    assert second / first == pytest.approx(known, abs=error)
    assert run.q[:, 1] == pytest.approx(ellipse(turned, e), abs=max(error, 1e-11))
    energy = 0.5 * (0.3 * first**2 + 0.7 * second**2)
    assert energy == pytest.approx(np.full(101, energy[0]), rel=1e-9)


@pytest.mark.parametrize("options", [{"rtol": 1e-10}, {"method": "moreau_jean", "step": 1e-3}])
def test_a_relation_within_a_loop(options):
    """A crank lifts a table by a relation and moves a slider by a rod, whose place is known."""
    crank, rod = 0.3, 1.0
    bodies = (
        pg.Body(name="crank", axes=[(0, 1, 0)], mass=1.0, com=(0.1, 0, 0), v=(2.0,),
                inertia=0.1 * np.eye(3)),
        pg.Body(name="slider", joint="prismatic", axes=[(1, 0, 0)], mass=0.5, q=(crank + rod,)),
        pg.Body(name="table", joint="prismatic", axes=[(0, 0, 1)], mass=0.4, link=(0, 2, 0),
                q=(1.3**2,), limits=[(-9, 9)] if "method" in options else None),
    )  # fmt: skip
    ties = (
        pg.Distance(name="rod", body="crank", other="slider", point=(crank, 0, 0),
                    other_point=(0, 0, 0), length=rod),
        pg.Relation(name="lift", body="table", other="slider", curve="=q^2"),
    )  # fmt: skip
    run = pg.simulate(pg.Model(bodies=bodies, constraints=ties), t_end=2.0, **options)
    assert run.status.ok, run.message
    angle, x, z = run.q.T
    place = crank * np.cos(angle) + np.sqrt(rod**2 - (crank * np.sin(angle)) ** 2)
    assert x == pytest.approx(place, abs=1e-12)
    assert z == pytest.approx(x**2, abs=1e-12)
    energy = run.energy
    assert np.ptp(energy) < (1e-4 if "method" in options else 1e-9) * np.abs(energy).max()


def test_time_stepping_is_of_second_order():
    exact = pg.simulate(cam(), t_end=1.0, method="dop853", rtol=1e-12).q[-1]
    errors = [
        np.abs(
            pg.simulate(cam(far=True), t_end=1.0, method="moreau_jean", step=h).q[-1] - exact
        ).max()
        for h in (4e-3, 2e-3)
    ]
    assert 3.5 < errors[0] / errors[1] < 4.5


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_a_limit_of_the_follower_stops_the_cam_too(restitution):
    """Without gravity all energy is kinetic. What is lost is booked."""
    model = cam(limits=[(-1.0, 0.1)], limit_restitution=restitution)
    model = model.replace(gravity=(0.0, 0.0, 0.0))
    run = pg.simulate(model, t_end=1.0, method="moreau_jean", step=1e-3, estimate=False)
    assert run.status.ok, run.message
    assert run.q[:, 1].max() < 0.1 + 1e-6
    assert run.energy + run.dissipation == pytest.approx(run.energy[0], abs=1e-5 * run.energy[0])
    if restitution == 0.0:
        assert np.abs(run.v[-1]).max() < 1e-9
    else:
        assert run.v[-1, 0] < 0.0
        slope = AMPLITUDE * np.sin(run.q[-1, 0])
        assert run.v[-1, 1] == pytest.approx(slope * run.v[-1, 0], abs=1e-9)


@pytest.mark.parametrize("step", [4e-3, 1e-3])
@pytest.mark.parametrize("far", [0.02, 0.0207])
@pytest.mark.parametrize("kind", ["gear", "relation"])
def test_an_elastic_limit_of_a_coupled_joint_keeps_the_energy(kind, far, step):
    """The way to the limit is that with the impulses of the coupling.

    A gear under gravity lost up to 0.17 of 6.5 J: the impact was expected with the acceleration of
    the uncoupled joint, and the limit took the speed that led past it before.
    """
    follower = {"limits": [(-1.0, 0.1)], "limit_restitution": 1.0}
    if kind == "gear":
        model = cam(**follower)
        gear = pg.Gear(name="lift", body="follower", other="cam", ratio=0.15)
        model = pg.Model(bodies=model.bodies, constraints=[gear])
        q = 0.1 / 0.15 - 3.0 * far
        start = {"q0": [q, 0.15 * q], "v0": [3.0, 0.45]}
    else:
        model = cam("=0.2*(1-cos(q.cam))", **follower)
        q = math.acos(0.5) - 3.0 * far
        start = {"q0": [q, 0.2 * (1.0 - math.cos(q))], "v0": [3.0, 0.6 * math.sin(q)]}
    run = pg.simulate(
        model, t_end=0.04, frames=3, method="moreau_jean", step=step, estimate=False, **start
    )
    assert (run.v[-1] < 0.0).all()
    assert run.dissipation[-1] == pytest.approx(0.0, abs=1e-9 if kind == "gear" else 2e-4)


POINTS = pg.Curve(x=(-0.5, 0.4, 1.0, 2.0, 4.0), value=(0.1, 0.0, 0.15, 0.3, 0.2))


@pytest.mark.parametrize("method", ["dopri5", "radau5", "moreau_jean"])
@pytest.mark.parametrize(
    ("curve", "paths"),
    [
        ("=size*(1-cos(q.cam))", ["size", "bodies.follower.mass"]),
        (POINTS, ["constraints.lift.curve.value.2", "constraints.lift.curve.x.3"]),
        (pg.Polynomial(coefficients=(0, 0.2, 0.1)), ["constraints.lift.curve.coefficients.2"]),
    ],
)
def test_derivatives_are_those_of_differences(curve, paths, method):
    model, options = cam(curve, far=method == "moreau_jean"), {"step": 2e-3}
    if method != "moreau_jean":
        options = {"rtol": 1e-11}
    last = lambda m: pg.simulate(m, t_end=0.7, method=method, frames=2, **options).q[-1]  # noqa: E731
    run = pg.simulate(model, t_end=0.7, method=method, wrt=paths, frames=2, **options)
    for path in paths:
        # a step of time stepping has other knots of a spline where the knots are moved farther
        present, h = Path(model, path, "test").present, 1e-5 if method == "moreau_jean" else 1e-3
        ends = [last(model.edit(path, present + k * h)) for k in (-2, -1, 1, 2)]
        slope = np.array([1.0, -8.0, 8.0, -1.0]) @ ends / (12.0 * h)
        found = run.derivatives[path][-1, :2]
        assert found == pytest.approx(slope, abs=1e-7 * max(1.0, np.abs(slope).max()))


def test_a_relation_beside_a_gear_that_says_the_same_is_told():
    ties = (
        pg.Gear(name="gear", body="b", other="a", ratio=2.0),
        pg.Relation(name="same", body="b", other="a", curve="=2*q.a"),
    )
    found = pg.Mechanism(rotors(*ties)).mobility()
    assert found.dof == 1
    assert [row.constraint for row in found.redundant] == ["same"]
    push = pg.Motor(name="push", body="a", torque=1.0)
    run = pg.simulate(rotors(*ties).add(push), t_end=0.5)
    assert run.vdot[:, 0] == pytest.approx(1.0 / (0.3 + 4 * 0.7), rel=1e-12)


def test_a_run_names_a_relation_past_the_end_of_its_points():
    notices = {}
    for kind in ("natural", "periodic", "quintic"):
        curve = pg.Curve(x=(-0.5, 0.4, 1.0, 2.0), value=(0.1, 0.0, 0.15, 0.3), kind=kind)
        run = pg.simulate(cam(curve, speed=12.0), t_end=1.0, estimate=False)
        assert np.abs(run.q[:, 0]).max() > 2.0
        notices[kind] = [text for text in run.notices if "'lift' is past an end" in text]
    assert [len(notices[kind]) for kind in notices] == [1, 0, 0]
    assert "from -0.5 to 2" in notices["natural"][0]


def test_linearised_motions_turn_with_the_curve():
    """About rest at a lowest point: I + m f'² = I, and m g f'' = m g A, so ω² = m g A / I."""
    found = pg.Mechanism(cam(speed=0.0)).linearise()
    assert found.frequencies == pytest.approx([np.sqrt(MASS * G * AMPLITUDE / INERTIA)], rel=1e-9)


def test_a_relation_survives_files_copies_and_names():
    for curve in CURVES.values():
        model = rotors(pg.Relation(name="tie", body="b", other="a", curve=curve))
        assert pg.Model.from_json(model.to_json()) == model
    model = rotors(pg.Relation(name="tie", body="b", other="a", curve="=sin(q.a)"))
    assert '"schema_version": 9' in model.to_json()
    (tie,) = model.edit("a", name="first wheel").constraints
    assert (tie.other, tie.curve) == ("first wheel", '=sin(q["first wheel"])')
    assert model.remove("a").constraints == ()


POWERS = (0.01, 0.1, -0.2, 0.3, 0.4)
XML = """<mujoco><option timestep="1e-4"/><worldbody>
<body name="arm"><joint name="turn" axis="0 1 0" ref="20"/><geom type="capsule" mass="1" size=".02"
 fromto="0 0 0 .3 0 0"/><body name="ball" pos=".3 0 0"><joint name="slide" type="slide"
 axis="1 0 0" ref=".1"/><geom size=".05" mass="2"/></body></body></worldbody><equality>
<joint name="tie" joint1="slide" joint2="turn" polycoef="{}" solref="0.001 1"
 solimp="0.9999 0.9999 0.001"/></equality></mujoco>"""


def test_a_polynomial_of_degree_four_moves_as_that_of_mujoco(tmp_path):
    """MuJoCo leaves J' v out of its rows, so accelerations are compared at rest.

    Its rows are soft, J q'' = -R f, which is taken out of its accelerations.
    """
    mujoco = pytest.importorskip("mujoco")
    text = XML.format(" ".join(map(str, POWERS)))
    (tmp_path / "in.xml").write_text(text)
    model, report = pg.read_mjcf(tmp_path / "in.xml")
    (tie,) = model.constraints
    assert tie == pg.Relation(
        name="tie", body="ball", other="arm", curve=pg.Polynomial(coefficients=POWERS)
    )
    assert not list(report.of("left out"))
    pg.write_mjcf(model, tmp_path / "out.xml")
    again, _ = pg.read_mjcf(tmp_path / "out.xml")
    assert again.constraints == model.constraints
    m = mujoco.MjModel.from_xml_path(str(tmp_path / "in.xml"))
    data, mech = mujoco.MjData(m), pg.Mechanism(model)
    f = np.polynomial.Polynomial(POWERS)
    for angle in (-0.4, 0.0, 0.5):
        q = np.array([angle, f(angle)])
        data.qpos[:] = m.qpos0 + q
        mujoco.mj_forward(m, data)
        M, J = np.zeros((2, 2)), data.efc_J.reshape(-1, 2)[:1]
        mujoco.mj_fullM(m, data, M)
        respond = np.linalg.solve(M, J.T)
        known = data.qacc - (respond @ np.linalg.solve(J @ respond, J @ data.qacc[:, None]))[:, 0]
        vdot, _ = mech.constrained_dynamics(q, np.zeros(2))
        assert vdot == pytest.approx(known, abs=1e-9 * np.abs(vdot).max())
        assert vdot == pytest.approx(data.qacc, abs=5e-3 * np.abs(vdot).max())


def test_relations_that_mjcf_cannot_write_are_told(tmp_path):
    for curve in (pg.Polynomial(coefficients=(0, 0, 0, 0, 0, 1)), "=sin(q)", POINTS):
        report = pg.write_mjcf(cam(curve), tmp_path / "out.xml")
        assert any("polynomial of degree 4" in e.text for e in report.of("left out"))


@pytest.mark.parametrize(
    "curve",
    [
        pg.Curve(x=(0.3, 1.5), value=(0.0, 0.15), kind="clamped"),
        pg.Curve(x=(0.3, 0.8, 1.5), value=(0.0, 0.1, 0.15), slope=(0.0, 0.2, 0.1), kind="hermite"),
        "=0.15*smoothstep(q.cam, 0.3, 1.5)",
    ],
)
def test_steps_end_where_the_second_derivative_jumps(curve):
    """A method of order 4 keeps its order, as within a piece."""
    model = cam(curve, speed=6.0)
    exact = pg.simulate(model, t_end=0.4, method="dop853", rtol=1e-13).q[-1]
    errors = [
        np.abs(pg.simulate(model, t_end=0.4, method="rk4", step=h).q[-1] - exact).max()
        for h in (2e-3, 1e-3)
    ]
    assert errors[1] < 1e-8
    assert errors[0] / errors[1] > 8.0


@pytest.mark.parametrize("kind", ["relation", "gear"])
def test_a_coordinate_follows_another_one_of_its_joint(kind):
    given: dict[str, Any] = {"curve": "=0.1*sin(q)"} if kind == "relation" else {"ratio": 0.1}
    body = pg.Body(
        name="nut", joint="cylindrical", axes=((0, 0, 1), (0, 0, 1)), mass=1.0, com=(0.1, 0, 0),
        inertia=(0.01, 0.01, 0.01),
    )  # fmt: skip
    ends = {"body": "nut", "coordinate": 1, "other": "nut", "other_coordinate": 0}
    follows = pg.Constraint(name="thread", kind=kind, **ends, **given)
    mech = pg.Mechanism(pg.Model(bodies=[body], constraints=[follows]))
    run = mech.simulate(t_end=1.0, method="dop853", rtol=1e-9)
    turn, lift = run.q.T
    expected = 0.1 * np.sin(turn) if kind == "relation" else 0.1 * turn
    np.testing.assert_allclose(lift, expected, atol=1e-12)
    assert run.energy_drift < 1e-6
    assert abs(turn[-1]) > 0.5
    with pytest.raises(pg.ModelError, match="itself"):
        mech.model.edit("thread", kind="constraint", coordinate=0)


def test_a_ratio_that_varies_leads_to_a_relation():
    with pytest.raises(pg.ModelError, match=r"pg\.Relation"):
        pg.Gear("g", body="a", other="b", ratio="=2*q")
