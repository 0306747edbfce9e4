"""Derivatives at corners: bounds, limits, knots, clamps, numbers of zero, and forces that jump."""

import numpy as np
import pytest

import pgraph_core as pg

from ..nights import combined
from .test_gradients import STEPS, missed, state

BOUNDED = {"state_high": (1.0, 4.0), "state_low": (-1.0, -4.0)}


def integrating(end, rate, **fields):
    drive = pg.Motor(name="p", body="s", torque=rate, integrates=True, **{end: BOUNDED[end][0]})
    body = pg.Body(name="s", joint="prismatic", axes=[(1, 0, 0)], mass=1.0)
    return pg.Model(bodies=[body], gravity=(0, 0, 0), forces=[drive])


@pytest.mark.parametrize("method", ["radau5", "gauss6"])
@pytest.mark.parametrize("end", BOUNDED)
def test_a_drive_meets_the_bound_of_its_integral(end, method):
    """v = h - h^2 / (2 u) at t = 1, of an integral u t up to h."""
    h, u = BOUNDED[end]
    wrt = ["forces.p.torque", f"forces.p.{end}"]
    run = pg.simulate(integrating(end, u), t_end=1.0, method=method, wrt=wrt)
    assert np.isclose(run.sensitivity(wrt[0])[-1, 1], h * h / (2 * u * u), rtol=1e-6)
    assert np.isclose(run.sensitivity(wrt[1])[-1, 1], 1.0 - h / u, rtol=1e-6)


@pytest.mark.parametrize(
    ("end", "method"), combined(BOUNDED, ["auto", "rk4", "semi_implicit_euler", "dopri5", "dop853"])
)
def test_bounds_of_integrals_are_refused_by_explicit_methods(end, method):
    model = integrating(end, BOUNDED[end][1])
    with pytest.raises(pg.InputError, match=f"force 'p', {end}"):
        pg.simulate(model, t_end=1.0, method=method, wrt=["forces.p.torque"])
    free = model.edit("p", kind="force", **{end: None})
    by = pg.simulate(free, t_end=1.0, method=method, wrt=["forces.p.torque"])
    assert np.isclose(by.sensitivity("forces.p.torque")[-1, 1], 0.5, rtol=2e-3)


@pytest.mark.parametrize("method", ["dop853", "rk4", "radau5", "gauss6"])
def test_a_ramp_meets_the_limit_of_its_drive(method):
    """v = h - h^2 / (2 u) at t = 1, of a torque u t up to h."""
    h, u, wrt = 1.0, 4.0, ["forces.p.torque.value.1", "forces.p.torque_limit"]
    model = integrating("state_high", u)
    ramp = pg.Table(t=[0, 1], value=[0, u])

    def run(limit):
        drive = pg.Motor(name="p", body="s", torque=ramp, torque_limit=limit)
        return pg.simulate(model.replace(forces=[drive]), t_end=1.0, method=method, wrt=wrt)

    if method in ("radau5", "gauss6"):
        found = [run(h).sensitivity(path)[-1, 1] for path in wrt]
        assert np.allclose(found, [h * h / (2 * u * u), 1.0 - h / u], rtol=1e-6)
        return
    with pytest.raises(pg.InputError, match="force 'p', torque_limit"):
        run(h)
    assert np.isclose(run(2 * u).sensitivity(wrt[0])[-1, 1], 0.5)  # a limit that it never meets


CORNERS = {"t": (0.1, 0.3, 0.5, 0.8), "value": (0.5, 2.0, -1.0, 1.5)}


@pytest.mark.parametrize(
    ("kind", "method"),
    combined([pg.Motor, pg.Wrench], ["dop853", "dopri5", "rk4", "radau5", "gauss6"]),
)
def test_each_knot_of_a_table_has_the_slopes_of_both_its_sides(kind, method):
    """The end speed is the area under the table, which stays constant beyond its outer knots."""
    t, x = (np.array(CORNERS[name]) for name in ("t", "value"))
    block = pg.Body(name="s", joint="prismatic", axes=[(1, 0, 0)], mass=1.0)
    given, field, last = {"torque": pg.Table(**CORNERS)}, "torque", ""
    if kind is pg.Wrench:
        forces = np.outer(x, (1.0, 0.3, -0.2))
        given, field, last = {"force": pg.VectorTable(t=t, value=forces)}, "force", ".0"
    model = pg.Model(bodies=[block], forces=[kind(name="f", body="s", **given)], gravity=(0, 0, 0))
    wrt = [f"forces.f.{field}.t.{k}" for k in range(4)]
    wrt += [f"forces.f.{field}.value.{k}{last}" for k in range(4)]
    run = pg.simulate(model, t_end=1.0, method=method, estimate=False, wrt=wrt)
    outside = np.concatenate((x[:1], x, x[-1:]))
    around = np.concatenate(([-t[0]], t, [2.0 - t[-1]]))  # as far outside again as the run goes
    exact = np.concatenate((outside[:-2] - outside[2:], around[2:] - around[:-2])) / 2.0
    assert np.allclose([run.sensitivity(path)[-1, 1] for path in wrt], exact, rtol=1e-6)


@pytest.mark.parametrize(
    ("brake", "method"),
    combined(
        ["=-max(a, 3*v.s)", "=-min(max(-3*v.s, a), 3*v.s)"],
        ["dop853", "dopri5", "rk4", "radau5", "gauss6"],
    ),
)
def test_a_clamp_of_the_motion_has_the_slopes_of_both_its_sides(brake, method):
    """A slider decays at a rate of 3 until 3 v = a and then brakes evenly, or the reverse."""
    block = pg.Body(name="s", joint="prismatic", axes=[(1, 0, 0)], mass=1.0)
    drive = pg.Actuator(name="f", body="s", input=brake)  # a gain beside 1 makes another program
    model = pg.Model(bodies=[block], parameters={"a": 1.2}, gravity=(0, 0, 0)).add(drive)
    begin, end, fixed = 1.0, 1.0, brake.startswith("=-max")
    meets = np.log(3 * begin / 1.2) / 3 if fixed else (begin - 0.4) / 1.2
    wrt = ["a", "v.s", "forces.f.gain"]  # the gain makes time go faster
    run = pg.simulate(model, t_end=end, method=method, v=[begin], estimate=False, wrt=wrt)
    exact = meets - end, 1.2 / (3 * begin), -1.2 * end
    if not fixed:
        left = np.exp(-3 * (end - meets))
        exact = -meets * left, left, -3 * 0.4 * left * end
    assert np.allclose([run.sensitivity(path)[-1, 1] for path in wrt], exact, rtol=1e-5)


def test_a_gain_of_zero_is_a_number_as_any_other():
    """Of an actuator that pushes with u at t = 1: v = u t - kp u t^3 / 6 to first order in kp."""
    block = pg.Body(name="s", joint="prismatic", axes=[(1, 0, 0)], mass=1.0)
    drive = pg.Actuator(name="f", body="s", input=3.0, kp=0.0)
    model = pg.Model(bodies=[block], forces=[drive], gravity=(0, 0, 0))
    for u in (3.0, "=3"):
        given = model.edit("f", input=u)
        run = pg.simulate(given, t_end=1.0, method="dop853", wrt=["forces.f.kp"])
        assert np.isclose(run.sensitivity("forces.f.kp")[-1, 1], -3.0 / 6.0, rtol=1e-9)
        small, none = (
            pg.simulate(given.edit("f", kp=kp), t_end=1.0, method="dop853") for kp in (1e-9, 0.0)
        )
        assert np.isclose(small.v[-1, 0] - none.v[-1, 0], -0.5e-9, rtol=1e-5)


@pytest.mark.parametrize("step", [1e-3, 2e-3])
def test_derivatives_through_limits_agree_with_those_of_a_finer_run(step):
    """The frames of a finer run are at other times, as its steps are shifted."""
    body = pg.Body(
        name="a", axes=(0, 1, 0), com=(0, 0, -0.5), inertia=(0.1, 0.1, 0.02), q=(0.5,),
        limits=(-0.2, 1.0), limit_restitution=0.6,
    )  # fmt: skip
    options = {"t_end": 1.0, "method": "moreau_jean", "step": step}
    run = pg.simulate(pg.Model(bodies=[body]), wrt=["q.a"], **options)
    assert run.notices == ()
    lost = run.gradient(lambda run: run.energy[0] - run.energy[-1])["q.a"]
    assert lost == pytest.approx(1.505, rel=2e-3)  # central differences
    assert np.isnan(run.gradient(lambda run: run.dissipation[-1])["q.a"])  # impacts are not in it


def test_slopes_that_are_infinite_are_named():
    slider = pg.Body(name="a", joint="prismatic", axes=[(1, 0, 0)])
    motor = pg.Motor(name="f", body="a", torque="=g*sqrt(max(q.a-0.1,0))+1")
    model = pg.Model(bodies=[slider], gravity=(0, 0, 0), parameters={"g": 1.3}, forces=[motor])
    run = pg.simulate(model, t_end=1.0, wrt=["g"], method="rk4", step=1e-3)
    named = [text for text in run.notices if "'g'" in text or "by g " in text]
    assert named or np.isfinite(run.sensitivity("g")).all()


def test_a_number_at_which_its_part_is_packed_as_idle_has_its_derivative():
    """Of a torque g u: S = u ∂/∂τ. The derivative by another number beside it is as alone."""
    arm = pg.Body(name="r", axes=(0, 1, 0), mass=1.0, com=(0.3, 0, 0), inertia=(0.05, 0.06, 0.02))
    model = pg.Model(bodies=[arm], forces=[pg.Motor(name="s", body="r", torque=2.0)])
    wrt = ["forces.s.gear", "forces.s.torque", "bodies.r.mass"]
    run, plain = pg.simulate(model, wrt=wrt, **STEPS), pg.simulate(model, **STEPS)
    assert run == plain
    assert missed(run.sensitivity(wrt[0]), 2.0 * run.sensitivity(wrt[1])) < 1e-12
    alone = pg.simulate(model, wrt=wrt[2], **STEPS).sensitivity(wrt[2])
    assert missed(run.sensitivity(wrt[2]), alone) < 1e-12


@pytest.mark.parametrize("number", ["friction.0", "damping.0", "stiffness.0"])
def test_a_joint_without_a_law_has_the_derivative_to_its_first(number):
    """They are those to one side, of a smooth law that starts at 0."""
    arm = pg.Body(name="r", axes=(0, 1, 0), com=(0.3, 0, 0), inertia=(0.05, 0.06, 0.02), v=[-4.0])
    model, path = pg.Model(bodies=[arm]), f"bodies.r.{number}"
    field, h = number.partition(".")[0], 1e-4
    given = STEPS | {"t_end": 0.1}
    runs = [state(pg.simulate(model.edit("r", **{field: (k * h,)}), **given)) for k in range(3)]
    slope = (4.0 * runs[1] - runs[2] - 3.0 * runs[0]) / (2.0 * h)
    assert missed(pg.simulate(model, wrt=path, **given).sensitivity(path), slope) < 1e-5


def test_a_box_that_moves_along_an_axis_has_derivatives_by_its_drag():
    """Pressure c v² on one side alone, with v' = -c v² / m and v = v0 / (1 + c v0 t / m)."""
    box = pg.Body(name="b", joint="prismatic", axes=[(0, 0, 1)], mass=2.0, v=[3.0])
    drag = pg.Drag(name="d", body="b", size=(0.2, 0.3, 0.1), density=50.0)
    model = pg.Model(bodies=[box], forces=[drag], gravity=(0, 0, 0))
    run = pg.simulate(model, wrt=["forces.d.density", "v.b"], **STEPS)
    c, speed, t = 0.5 * 50.0 * 0.2 * 0.3 / 2.0, 3.0, run.t
    by_c = -speed * speed * t / (1 + c * speed * t) ** 2
    assert missed(run.sensitivity("forces.d.density")[:, 1], by_c * c / 50.0) < 1e-9
    assert missed(run.sensitivity("v.b")[:, 1], 1 / (1 + c * speed * t) ** 2) < 1e-9


WHEEL = pg.Body(name="r", axes=(0, 0, 1), inertia=(1, 1, 0.2), v=[12.0])
BLOCK = pg.Body(name="r", joint="prismatic", axes=[(1, 0, 0)], q=[1.0])
AT_ORIGIN = {"name": "f", "body": "r", "point": (0, 0, 0), "other_point": (0, 0, 0)}
PULLS = pg.Lines(x=[0.0, 0.4, 1.0], value=[-8.0, 0.0, 12.0])


@pytest.mark.parametrize("options", [{}, {"method": "rk4", "step": 1e-3}])
@pytest.mark.parametrize(
    ("body", "force", "jump"),
    [
        (WHEEL, pg.Torsion(name="f", body="r", stiffness=2.0), 0.3086),
        (WHEEL, pg.Torsion(name="f", body="r", stiffness=2.0, rest=1.0), 0.3756),
        (WHEEL, pg.Bushing(**AT_ORIGIN, stiffness=np.diag([1, 1, 1, 1, 1, 2.0])), 0.3086),
        (BLOCK, pg.Spring(**AT_ORIGIN, stiffness=20.0, rest=0.4), 0.5144),
        (BLOCK, pg.Strut(**AT_ORIGIN, spring=PULLS), 0.5144),
    ],
)
def test_derivatives_end_where_a_force_jumps(body, force, jump, options):
    """The force jumps at half a turn and at a length of 0, at a time that depends on v and mass."""
    model, wrt = pg.Model(bodies=[body], forces=[force], gravity=(0, 0, 0)), "bodies.r.mass"
    wrt = "v.r" if body is WHEEL else wrt
    run = pg.simulate(model, wrt=wrt, t_end=0.8, frames=801, **options)
    assert np.array_equal(run.q, pg.simulate(model, t_end=0.8, frames=801, **options).q)
    known = np.isfinite(run.sensitivity(wrt)).all(axis=1)
    assert not known[run.t > jump].any()
    assert known[run.t < 0.5 * jump].all()
    assert any("derivatives end" in text and "'r'" in text for text in run.notices)


def test_springs_that_pass_no_corner_keep_their_derivatives():
    """A spring turns about a point that it does not reach, and a torsion turns back in time."""
    spring = pg.Spring(**AT_ORIGIN | {"other_point": (0, 0.2, 0)}, stiffness=20.0, rest=0.4)
    for body, force in ((BLOCK, spring), (WHEEL, pg.Torsion(name="f", body="r", stiffness=9.0))):
        model = pg.Model(bodies=[body.model_copy(update={"v": (9.0,)})], forces=[force])
        run = pg.simulate(model.replace(gravity=(0, 0, 0)), wrt="q.r", t_end=2.0, rtol=1e-9)
        assert np.isfinite(run.sensitivity("q.r")).all()
        assert not any("derivatives" in text for text in run.notices)
