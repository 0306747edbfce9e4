"""Forces over a run: the energy ledger closes, prescribed motions have closed forms."""

import numpy as np
import pytest

import pgraph_core as pg

from ..nights import combined
from .rescaling import rescaled

pytestmark = pytest.mark.quick

UP_DOWN = pg.Table(t=(0.0, 0.5, 1.0), value=(0.0, 2.0, -1.0))
GUST = pg.VectorTable(t=(0.0, 0.5, 1.0), value=((0, 0, 0), (2, 1, 3), (-4, 0, 1)))
ARM = {"body": "3", "point": (0.1, 0.2, 0.3)}


def chain():
    kind = {"mass": 1, "com": (0.2, 0.1, 0.3), "inertia": 0.1 * np.eye(3)}
    link = {"link": (0.3, 0, 0.4), **kind}
    bodies = (
        pg.Body(name="1", axes=((0, 1, 0),), **kind),
        pg.Body(name="2", parent="1", axes=((1, 0, 0),), q=0.4, **link),
        pg.Body(name="3", parent="2", dof=3, **link),
    )
    return pg.Model(bodies=bodies)


WRENCH = {"name": "f", "kind": "wrench", **ARM}
SPRING = {"name": "f", "kind": "spring", **ARM}
ACTING = {
    "spring": pg.Force(**SPRING, other="1", stiffness=90, damping=1.5),
    "spring to the ground": pg.Force(**SPRING, other_point=(1, 1, 1), stiffness=50, rest=0.2),
    "torsion": pg.Torsion(name="f", body="3", other="1", axis=(1, 0, 1), stiffness=9, damping=0.4),
    "constant wrench": pg.Force(**WRENCH, torque=(1, 2, 3), force=(4, 0, 2)),
    "wrench table": pg.Force(**WRENCH, torque=GUST, force=GUST),
    "wrench in body axes": pg.Force(**WRENCH, force=GUST, frame="body"),
    "motor": pg.Force(name="f", body="2", torque=UP_DOWN),
    "servo": pg.Force(name="f", kind="servo", body="2", kp=30, kd=2, target=UP_DOWN),
}


@pytest.mark.parametrize("what", ACTING)
def test_the_ledger_closes_at_the_order_of_the_method(what):
    """Halving RK4's step divides what is open by 16: 10 leaves room for the next order."""
    mech = pg.Mechanism(chain().replace(forces=(ACTING[what],)))
    runs = [pg.simulate(mech, t_end=1.0, method="rk4", step=h, frames=5) for h in (1e-2, 5e-3)]
    coarse, fine = (run.energy_drift for run in runs)
    assert coarse < 1e-4
    assert fine < max(coarse / 10, 1e-13)
    passive = ACTING[what].kind in ("spring", "torsion")
    assert (np.ptp(runs[1].work) > 1e-3) != passive
    assert np.all(np.diff(runs[1].dissipation) >= 0)
    assert (runs[1].dissipation[-1] > 0) == (passive and ACTING[what].damping > 0)


def test_the_ledger_closes_with_friction_and_dampers_of_joints():
    wheel = pg.Body(name="w", mass=1, inertia=0.5 * np.eye(3), friction=0.8, damping=0.1, v=9.0)
    run = pg.simulate(pg.Model(bodies=(wheel,)), t_end=1.0, method="rk4", step=1e-2)
    assert run.energy_drift < 1e-10
    assert run.dissipation[-1] == pytest.approx(run.energy[0] - run.energy[-1], rel=1e-9)


def test_the_ledger_closes_with_a_servo_at_its_limit():
    servo = pg.Force(name="f", kind="servo", body="2", kp=90, kd=9, target=1.0, torque_limit=2.0)
    run = pg.simulate(chain().replace(forces=(servo,)), t_end=1.0, method="rk4", step=1e-3)
    assert run.energy_drift < 1e-6
    assert abs(run.work[-1]) > 1e-2


@pytest.mark.parametrize("kind", pg.Force.KINDS)
def test_every_kind_of_force_has_units(kind):
    needed = {"tendon": {"coefficients": {"2": 1.0}}, "drag": {"size": (1, 1, 1)}}.get(kind, {})
    if kind == "muscle":
        needed = {"f_max": 1.0, "l_opt": 0.1, "l_slack": 0.1}
    if kind == "cable":
        needed = {"through": ["2", ("ground", (0, 0, 9))]}
    model = chain().replace(forces=(pg.Force(name="f", kind=kind, body="2", **needed),))
    assert rescaled(model, time=2.0).forces[0].kind == kind


LENGTH, MASS = 0.7, 2.0


def arm(q_of_t, **kinds):
    """A point mass on a massless arm about y, along x at q = 0, whose angle is prescribed."""
    given = {"axes": (0, 1, 0), "mass": MASS, "com": (LENGTH, 0, 0), "inertia": np.zeros((3, 3))}
    body = pg.Body(name="a", **given, **kinds)
    drive = pg.Constraint(name="drive", kind="motion", body="a", q_of_t=q_of_t)
    return pg.Mechanism(pg.Model(bodies=(body,), constraints=(drive,)))


LINE = pg.Polynomial(coefficients=(0.3, 4.0))
CUBIC = pg.Polynomial(coefficients=(0.3, 1.0, 2.0, -1.0))
SINE = pg.Sine(mean=0.2, amplitude=0.5, frequency=6.0, phase=0.4)
CURVES = {
    "constant speed": (LINE, lambda t: 0.0 * t),
    "polynomial": (CUBIC, lambda t: 4.0 - 6.0 * t),
    "sine": (SINE, lambda t: -18.0 * np.sin(6.0 * t + 0.4)),
}


@pytest.mark.parametrize("what", CURVES)
def test_the_torque_of_a_prescribed_motion(what):
    """τ = m l² q'' - m g l cos q about y (+q is down), and its work is the energy's change."""
    curve, acceleration = CURVES[what]
    run = pg.simulate(arm(curve), t_end=1.0, method="rk4", step=1e-3, frames=11)
    torque = run.constraint_force["drive"][:, 1]
    weight = MASS * 9.81 * LENGTH * np.cos(run.q[:, 0])
    expected = MASS * LENGTH**2 * acceleration(run.t) - weight
    np.testing.assert_allclose(torque, expected, atol=1e-9)
    np.testing.assert_allclose(run.work - run.work[0], run.energy - run.energy[0], atol=1e-9)
    assert run.energy_drift < 1e-9


def test_a_table_is_followed_as_a_spline_and_its_work_is_booked():
    table = pg.Table(t=(0.0, 0.3, 0.6, 1.0), value=(0.0, 0.8, -0.4, 0.5))
    run = pg.simulate(arm(table), t_end=1.0, method="rk4", step=1e-3, t_eval=(0, 0.3, 0.6, 1.0))
    np.testing.assert_allclose(run.q[:, 0], table.value, atol=1e-10)
    assert run.energy_drift < 1e-8  # the third derivative jumps at the knots


def test_a_speed_that_is_held_does_work():
    body = arm(LINE, v=3.0).model.bodies[0]
    held = pg.Constraint(name="drive", kind="velocity", coefficients={"a": (2.0,)}, value=6.0)
    mech = pg.Mechanism(pg.Model(bodies=(body,), constraints=(held,)))
    run = pg.simulate(mech, t_end=1.0, method="rk4", step=1e-3, frames=11)
    torque = -MASS * 9.81 * LENGTH * np.cos(3.0 * run.t)
    np.testing.assert_allclose(run.constraint_force["drive"][:, 1], torque, atol=1e-9)
    assert run.energy_drift < 1e-9
    assert np.ptp(run.work) > 1.0


def test_impulses_of_prescribed_motions_do_work():
    """Moreau and Jean's method is of first order: 1e-2 at 1 ms, with no limit met."""
    mech = arm(SINE, limits=(-9.0, 9.0))
    ask = {"method": "moreau_jean", "t_end": 1.0, "frames": 11}
    runs = [pg.simulate(mech, step=h, **ask) for h in (2e-3, 1e-3)]
    assert runs[0].header["method"] == "moreau_jean"
    assert np.ptp(runs[1].work) > 1.0
    assert runs[1].energy_drift < max(0.7 * runs[0].energy_drift, 1e-6) < 1e-2


def test_a_slider_crank_driven_by_a_sine():
    """Work of the drive = change of energy, and torque = dE/dt over q': nothing else does work."""
    r, rod = 0.2, 0.6
    bodies = (
        pg.Body(name="crank", axes=(0, 0, 1), mass=1, com=(r / 2, 0, 0), inertia=0.01 * np.eye(3)),
        pg.Body(name="rod", parent="crank", axes=(0, 0, 1), link=(r, 0, 0), mass=0.5,
                com=(rod / 2, 0, 0), inertia=0.02 * np.eye(3)),
    )  # fmt: skip
    along = pg.Plane(name="rail", body="rod", point=(rod, 0, 0), other_axis=(0, 1, 0))
    sine = pg.Sine(mean=0.6, amplitude=0.6, frequency=3.0, phase=-np.pi / 2)
    drive = pg.Constraint(name="drive", kind="motion", body="crank", q_of_t=sine)
    model = pg.Model(bodies=bodies, constraints=(along, drive), gravity=(0, 0, 0))
    run = pg.simulate(model, t_end=2.0, method="rk4", step=1e-3, frames=2001)
    assert run.energy_drift < 1e-9
    power = run.constraint_force["drive"][:, 2] * run.v[:, 0]
    slope = (run.energy[2:] - run.energy[:-2]) / (run.t[2:] - run.t[:-2])
    np.testing.assert_allclose(power[1:-1], slope, atol=1e-4 * np.max(np.abs(slope)))


@pytest.mark.parametrize("what", [name for name in ACTING if "ground" not in name])
def test_a_mechanism_turned_in_the_world_moves_alike(what):
    """Without gravity, forces between bodies or in their axes know no direction of the world."""
    force = ACTING[what]
    if what in ("constant wrench", "wrench table"):
        force = force.model_copy(update={"frame": "body"})
    model = chain().replace(forces=(force,), gravity=(0, 0, 0)).edit("2", v=0.5)
    first = model.bodies[0].name
    runs = [
        pg.simulate(m, t_end=1.0, rtol=1e-10)
        for m in (model, model.edit(first, rotation=(0.3, -0.5, 0.7, 0.2)))
    ]
    np.testing.assert_allclose(runs[1].q, runs[0].q, atol=1e-8)


RAMP = pg.Table(t=(0.0, 0.3), value=(0.0, 4.0))
DRIVES = {
    "limited servo": pg.Servo(name="d", body="2", kp=30, kd=2, target=0.9, torque_limit=3.0),
    "table": pg.Motor(name="d", body="2", torque=RAMP, gear=-2.0, torque_limit=2.5, torque_low=-9),
    "expression": pg.Motor(name="d", body="2", torque='=if(t < 0.2, 4, -q["2"])', torque_limit=3),
    "sum": pg.Servo(name="d", body="2", kp=9, torque=1.0, coefficients={"1": 0.5, "2": -1.0}),
    "lag": pg.SpeedServo(name="d", body="2", kd=4.0, speed=2.0, lag=0.1, start=-1.0, gear=0.5),
    "integral": pg.Actuator(
        name="d", body="2", input=RAMP, gain=9, integrates=True, state_high=0.2
    ),
}
METHODS = ("auto", "rk4", "radau5", "moreau_jean")


@pytest.mark.parametrize(("what", "method"), combined(DRIVES, METHODS))
def test_the_force_of_a_drive_times_its_speed_is_its_power(what, method):
    """Trapezia of 0.5 ms err by 1e-6 of the work, and by half a frame of the power at a jump, 3e-3
    of it. The error of time stepping is halved with its steps, 5e-3 at these."""
    drive = DRIVES[what]
    model = chain().replace(forces=(drive,))
    given = {"t_end": 0.4, "frames": 801, "method": method, "estimate": False}
    if method == "moreau_jean":
        model = model.edit("1", limits=((-9.0, 9.0),))
    run = pg.simulate(model, **given)
    speed = sum(x * run[f"v.{body}"] for body, _, x in drive.terms if body != "3")
    force = run.drive_force["d"]
    rough = 1e-2 if method == "moreau_jean" or what == "expression" else 1e-5
    size = rough * abs(run.work).max()
    assert np.trapezoid(force * speed, run.t) == pytest.approx(run.work[-1], abs=size)
    least, most = drive.torques
    assert least <= force.min()
    assert force.max() <= most
    assert most == np.inf or most in force
    np.testing.assert_array_equal(run["drive_force.d"], force)
    assert "drive_force.d [N m]" in run.to_csv()


def test_steppers_and_batches_have_the_force_of_a_drive(tmp_path):
    """The lag of the input that a stepper sets at 0.1 s begins there."""
    model = chain().replace(
        forces=(DRIVES["lag"], DRIVES["limited servo"].model_copy(update={"name": "s"}))
    )
    stepper = pg.Stepper(model, step=1e-3)
    first = stepper.record(100)
    stepper.step(inputs={"d": -3.0})
    then = stepper.record(200)
    held = then.drive_force["d"][-1]
    assert held == pytest.approx(stepper.drive_force["d"], abs=1e-12)
    stepper.input("d", 5.0)
    stepper.step(n=30)
    assert then.drive_force["d"][-1] == held
    y = -3.0 + (2.0 - 3.0 * np.exp(-1.0) + 3.0) * np.exp(-2.01)
    assert held == pytest.approx(4.0 * (y - 0.5 * then["v.2"][-1]), rel=1e-9)
    run = pg.simulate(model, t_end=0.1, step=1e-3, method="rk4")
    np.testing.assert_allclose(first.drive_force["d"], run.drive_force["d"], atol=1e-9)
    limits = np.array([1.0, 2.0])
    batch = pg.BatchStepper(model, 2, step=1e-3, set={"forces.s.torque_limit": limits})
    batch.step(n=100)
    for i, limit in enumerate(limits):
        one = pg.Stepper(model.edit("s", torque_limit=limit), step=1e-3)
        one.step(n=100)
        for name, force in one.drive_force.items():
            assert batch.drive_force[name][i] == force
    np.testing.assert_array_equal(batch.drive_force["s"], limits)
    run.save(tmp_path / "run.npz")
    assert pg.Result.load(tmp_path / "run.npz") == run
    whole = pg.joined([first, pg.simulate(model, first.q[-1], first.v[-1], t_start=0.1, t_end=0.2)])
    assert whole.drive_force["s"].shape == whole.t.shape


def test_the_force_of_a_drive_has_its_derivative():
    servo = pg.Servo(name="d", body="2", kp=30, kd=2, target=0.9)
    model = chain().replace(forces=(servo,))
    last = lambda run: run.drive_force["d"][-1]  # noqa: E731
    given = {"t_end": 0.2, "method": "rk4", "step": 1e-2}
    exact = pg.simulate(model, wrt=["forces.d.kp"], **given).gradient(last)["forces.d.kp"]
    up, down = (last(pg.simulate(model.edit("d", kp=kp), **given)) for kp in (30.01, 29.99))
    assert exact == pytest.approx((up - down) / 0.02, rel=1e-5)


def test_torques_of_a_call_beyond_the_limits_of_motors_are_told_and_not_limited():
    """The limits of two motors of a joint add up, times their gears. Drives of sums limit none."""
    numba = pytest.importorskip("numba")
    motors = (
        pg.Motor(name="a", body="2", torque_limit=2.0, gear=-2.0),
        pg.Motor(name="b", body="2", torque_limit=1.0),
        pg.Motor(name="c", coefficients={"1": 1.0, "2": 1.0}, torque_limit=0.1),
    )
    model = chain().replace(forces=motors)
    rises = lambda t, q, v: np.array([9.0, 60.0 * t, 0.0, 0.0, 0.0])  # noqa: E731
    for tau, most in (
        ({"2": 4.9}, None), ({"2": -5.1}, "5.1"), (rises, "6"), (numba.njit(rises), "6"),
    ):  # fmt: skip
        run = pg.simulate(model, t_end=0.1, tau=tau)
        free = pg.simulate(chain(), t_end=0.1, tau=tau)
        np.testing.assert_allclose(run.q, free.q, atol=1e-9)
        told = [text for text in run.notices if "tau" in text and "5 N m" in text]
        assert len(told) == (most is not None)
        assert all(f"{most} N m in the joint of '2'" in text for text in told)
        assert all("'a', 'b'" in text for text in told)
