"""Points of paths that move with coordinates, or count in a range: laws of energy and of work,
equivalent models, switches of runs, derivatives, descriptions and refusals."""

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.dynamics.exerted import load_wrenches
from pgraph_core.errors import ModelError
from pgraph_core.simulation.paths import Path

from ..refusals import assert_names
from .test_gradients import difference

CALM = {"method": "dop853", "rtol": 1e-11, "estimate": False}
BENT = pg.Curve(x=(-2.0, -1.0, -0.3, 0.5), value=(0.01, 0.03, 0.06, 0.05))
LOW, HIGH = -0.8, -0.2


def shift(along=(1, 0, 0.2), curve=BENT, body="shank", **fields):
    return pg.Shift(body=body, along=along, curve=curve, **fields)


MOVING = pg.Via(body="shank", point=(0.01, 0.02, -0.02), shifts=[shift(), shift(body="thigh")])
RANGED = pg.Via(
    body="thigh", point=(0.05, 0.01, -0.38), when=pg.Within(body="shank", low=LOW, high=HIGH)
)
ALWAYS = pg.Via(body="thigh", point=(0.04, 0, -0.3))
BALL = pg.Via(body="thigh", point=(0.06, 0, -0.33), radius=0.02, side=(0.2, 0, -0.33))
BOTH = RANGED.model_copy(update={"shifts": (shift(body="thigh"),)})
POINTS = {
    "moving": (MOVING, ALWAYS),
    "ranged": (RANGED, ALWAYS),
    "both": (MOVING, BOTH, ALWAYS),
    "two ranged": (RANGED, BOTH, ALWAYS),
    "beside a ball": (MOVING, RANGED, BALL, ALWAYS),
    "behind a ball": (BALL, RANGED, BOTH, MOVING),
}


def leg(*points, kind="spring", v=(0.0, 0.0), **fields):
    """A thigh and a shank with a force from the shank over points to the ground."""
    size = {"joint": "revolute", "axes": [(0, 1, 0)], "com": (0, 0, -0.2)}
    inertia = {"inertia": (0.02, 0.02, 0.01)}
    thigh = pg.Body(name="thigh", mass=2, q=(0.3,), v=v[:1], **size, **inertia)
    shank = pg.Body(
        name="shank", parent="thigh", link=(0, 0, -0.4), mass=1.5, q=(-0.5,), v=v[1:], **size,
        **inertia,
    )  # fmt: skip
    given = {"name": "s", "body": "shank", "point": (0.02, 0, -0.08), "via": points}
    given |= {"other_point": (0.1, 0, 0.05), "shifts": [shift()]}
    own = {"spring": {"stiffness": 3000.0, "rest": 0.4}, "muscle": {}}[kind]
    force = pg.Force(kind=kind, **{**given, **own, **fields})
    return pg.Model(bodies=[thigh, shank], forces=[force])


def states(when=True):
    """States on all sides of the range, none of them within a difference of its ends."""
    return [np.array([0.3, x]) for x in (-0.5, -1.2, 0.4)[: 3 if when else 1]]


def slope_of(function):
    """Return the slope of a function of a change of both coordinates."""
    return np.array([difference(lambda x, e=e: function(x * e), 1e-3) for e in np.eye(2)])


# -- statics ---------------------------------------------------------------------------------------


@pytest.mark.quick
@pytest.mark.parametrize("points", POINTS)
def test_moment_arms_are_the_slopes_of_the_length(points):
    mech = pg.Mechanism(leg(*POINTS[points]))
    for q in states():
        slopes = slope_of(lambda step, q=q: mech.path_length(q + step))
        arms = mech.moment_arms(q)
        assert np.abs(arms).max() > 0.02
        np.testing.assert_allclose(arms, -np.transpose(slopes), rtol=0, atol=1e-10)


@pytest.mark.quick
@pytest.mark.parametrize("other", ["shank", "thigh"])
def test_a_shift_alone_lets_a_path_change_its_length(other):
    """A path within one body, and one from the axis of its joint, of which no part is refused or
    doubted."""
    model = leg(other=other, point=(0, 0, 0), other_point=(0.1, 0, -0.4))
    mech, q = pg.Mechanism(model), np.array([0.3, -0.5])
    assert not model.doubts
    slopes = slope_of(lambda step: mech.path_length(q + step))
    assert abs(slopes[1, 0]) > 1e-3
    np.testing.assert_allclose(mech.moment_arms(q), -np.transpose(slopes), rtol=0, atol=1e-10)


@pytest.mark.quick
@pytest.mark.parametrize("points", POINTS)
def test_the_force_is_the_slope_of_the_energy(points):
    mech = pg.Mechanism(leg(*POINTS[points]))
    still = np.zeros(2)
    for q in states():
        slope = slope_of(lambda step, q=q: mech.energy(q + step, still)[1])
        tau = mech.mass_matrix(q) @ mech.forward_dynamics(q, still)
        np.testing.assert_allclose(tau, -slope, rtol=0, atol=1e-8 * np.abs(tau).max())


@pytest.mark.parametrize("points", POINTS)
def test_outside_of_its_range_a_point_might_as_well_be_left_out(points):
    given = POINTS[points]
    left = tuple(via for via in given if via.when is None)
    kept = tuple(via.unchecked_copy({"when": None}) for via in given)
    mech, without, always = (pg.Mechanism(leg(*x, damping=5.0)) for x in (given, left, kept))
    v = np.array([0.7, -1.1])
    for q, other in zip(states(), (always, without, without)):
        for of in ("path_length", "moment_arms"):
            now, wanted = getattr(mech, of)(q), getattr(other, of)(q)
            np.testing.assert_allclose(now, wanted, rtol=0, atol=1e-15)
        now, wanted = mech.forward_dynamics(q, v), other.forward_dynamics(q, v)
        np.testing.assert_allclose(now, wanted, rtol=1e-12)


def test_a_point_counts_at_both_ends_of_its_range():
    mech, kept = (
        pg.Mechanism(leg(via, ALWAYS)) for via in (RANGED, RANGED.unchecked_copy({"when": None}))
    )
    for x in (LOW, HIGH):
        q = np.array([0.3, x])
        assert mech.path_length(q) == pytest.approx(kept.path_length(q), rel=1e-15)


def carriage(moves):
    """A slider with a rope from the ground to a post on it, or to a point of the ground that shifts
    as the slider does."""
    line = pg.Polynomial(coefficients=(0.0, 1.0))
    body = pg.Body(name="a", joint="prismatic", axes=[(1, 0, 0)], mass=2.0, q=(0.4,), v=(0.3,))
    hub = pg.Body(
        name="b", joint="revolute", axes=[(0, 1, 0)], mass=1.0, inertia=(0.1,) * 3, v=(1,)
    )
    shifts = [pg.Shift(body="a", along=(1, 0, 0), curve=line)] if moves else []
    post = pg.Via(body="ground" if moves else "a", point=(0.1, 0, 0.5), shifts=shifts)
    rope = {"body": "b", "point": (0.2, 0, 0.1), "other_point": (0, 0.4, 1), "via": [post]}
    spring = pg.Spring(name="s", stiffness=40.0, rest=0.2, damping=2.0, **rope)
    return pg.Model(bodies=[body, hub], forces=[spring])


def test_a_point_that_shifts_with_a_slider_pulls_as_one_on_the_slider():
    one, two = (pg.Mechanism(carriage(x)) for x in (True, False))
    q, v = np.array([0.4, 0.2]), np.array([0.3, -0.8])
    for of in ("path_length", "moment_arms"):
        np.testing.assert_allclose(getattr(one, of)(q), getattr(two, of)(q), rtol=1e-14, atol=1e-16)
    np.testing.assert_allclose(one.forward_dynamics(q, v), two.forward_dynamics(q, v), rtol=1e-13)
    slopes = one.forward_derivatives(q, v, np.zeros(2)), two.forward_derivatives(q, v, np.zeros(2))
    for now, wanted in zip(*slopes):
        np.testing.assert_allclose(now, wanted, rtol=0, atol=1e-9)
    one, two = (pg.simulate(carriage(x), t_end=1.0, **CALM) for x in (True, False))
    np.testing.assert_allclose(one.q, two.q, rtol=0, atol=1e-10)
    np.testing.assert_allclose(one.tension["s"], two.tension["s"], rtol=0, atol=1e-8)


@pytest.mark.parametrize("points", POINTS)
def test_forces_of_a_path_add_up_to_zero_with_what_holds_its_ground(points):
    """The spans of a path inside a system exert no force on it, whatever rides."""
    model = leg(*POINTS[points])
    model = model.edit("s", other="thigh", other_point=(0, 0, 0.1))
    mech = pg.Mechanism(model)
    for q in states():
        loads = load_wrenches(mech.packed, model.forces, np.zeros(1), q[None], np.zeros((1, 2)))
        assert np.abs(loads[0, :, 3:]).max() > 10.0
        assert np.abs(loads[0, :, 3:].sum(axis=0)).max() < 1e-12 * np.abs(loads).max()


# -- runs ------------------------------------------------------------------------------------------


def test_a_run_with_points_that_move_keeps_its_energy():
    run = pg.simulate(leg(MOVING, ALWAYS), t_end=1.0, **CALM)
    assert np.abs(run.energy_drift).max() < 1e-9
    assert np.ptp(run.q[:, 1]) > 1.0


def swing(**how):
    """The leg swings through the upper end of the range once."""
    model = leg(MOVING, RANGED, ALWAYS, v=(0.0, 8.0), damping=5.0, stiffness=300.0)
    return pg.simulate(model, t_end=0.06, estimate=False, frames=7, **how)


def test_steps_end_at_the_switch_and_methods_keep_their_order():
    exact = swing(method="dop853", rtol=1e-12)
    assert exact.q[0, 1] < HIGH < exact.q[-1, 1]
    errors = []
    for n in (1, 8):
        run = swing(method="rk4", step=0.01 / n)
        errors.append(np.abs(run.v[-1] - exact.v[-1]).max())
    assert errors[0] < 1e-2
    # 8^4 = 4096, but for the width of the step at whose end the switch happens to be; 8 if it were
    # passed within a step
    assert errors[0] > 1000.0 * errors[1]


def test_a_notice_tells_where_a_path_jumps_and_by_how_much():
    run = swing(method="rk4", step=1e-3)
    (text,) = [x for x in run.notices if "jumps by" in x]
    q = np.array([np.interp(HIGH, run.q[:, 1], run.q[:, 0]), HIGH])
    kept = leg(MOVING, RANGED.unchecked_copy({"when": None}), ALWAYS)
    sizes = [pg.Mechanism(x).path_length(q)[0] for x in (kept, leg(MOVING, ALWAYS))]
    assert_names(text, "'s'", "'shank'", f"{HIGH:g}", "mm", "point 2", "energy")
    assert float(text.split(" mm")[0].split()[-1]) == pytest.approx(
        1e3 * abs(np.diff(sizes)[0]), abs=2e-3
    )
    assert not [x for x in pg.simulate(leg(MOVING), t_end=0.01).notices if "jumps by" in x]


@pytest.mark.parametrize("path", ["forces.s.stiffness", "forces.s.via.1.point.0", "q.thigh"])
def test_runs_have_derivatives_across_the_switch(path):
    model = leg(MOVING, RANGED, ALWAYS, v=(0.0, 8.0), damping=5.0, stiffness=300.0)
    how = {"method": "rk4", "step": 2e-3, "t_end": 0.06, "estimate": False, "frames": 3}
    run = pg.simulate(model, wrt=path, **how)
    assert run.q[0, 1] < HIGH < run.q[-1, 1]
    given = Path(model, path)

    def state(change):
        end = pg.simulate(given.set(model, given.present + change), **how)
        return np.hstack((end.q[-1], end.v[-1]))

    h = 2e-4 * max(abs(given.present), 0.1)
    expected = difference(state, h)
    found = run.sensitivity(path)[-1]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("points", ["moving", "both"])
def test_instances_of_a_batch_move_as_single_runs(points):
    model = leg(*POINTS[points], damping=5.0)
    batch = pg.BatchStepper(model, 3, method="rk4", step=1e-3)
    v = np.linspace(-0.5, 0.5, 3)[:, None] * np.ones(2)
    batch.reset(batch.q, v)
    batch.step(n=100)
    for n in range(3):
        run = pg.simulate(model, v=v[n], t_end=0.1, method="rk4", step=1e-3, estimate=False)
        np.testing.assert_allclose(batch.q[n], run.q[-1], rtol=0, atol=1e-12)


def test_a_stepper_moves_as_a_run():
    model = leg(RANGED, MOVING, v=(0.0, 6.0), stiffness=300.0)
    stepper = pg.Stepper(model, method="rk4", step=1e-3)
    for _ in range(100):
        stepper.step()
    run = pg.simulate(model, t_end=0.1, method="rk4", step=1e-3, estimate=False)
    np.testing.assert_allclose(stepper.q, run.q[-1], rtol=0, atol=1e-13)


# -- the description -------------------------------------------------------------------------------


def test_files_hold_points_that_ride():
    model = leg(*POINTS["both"])
    assert pg.Model.from_json(model.to_json()) == model
    assert '"when"' not in leg(ALWAYS).to_json()


def test_they_follow_the_bodies_of_their_coordinates():
    model = leg(*POINTS["both"]).edit("shank", name="new")
    (f,) = model.forces
    assert {x.body for x in f._riding} == {"new", "thigh"}
    carried = carriage(True)
    assert carried.remove("a").forces == ()
    wide = leg(ALWAYS).edit("s", shifts=[shift(body="shank")]).edit("shank", joint="spherical")
    assert wide.forces == ()


def test_a_mirrored_branch_has_mirrored_shifts():
    trunk = pg.Body(name="trunk", joint="fixed", mass=1.0)
    thigh = pg.Body(name="left", parent="trunk", link=(0, 0.3, 0), axes=[(0, 1, 0)], mass=1.0)
    shifts = [pg.Shift(body="left", along=(0.1, 0.2, 0.3), curve=BENT)]
    f = pg.Spring(name="left s", body="left", other="trunk", stiffness=1.0, via=[
        pg.Via(body="left", point=(0.2, 0.1, 0), shifts=shifts,
               when=pg.Within(body="left", low=-1, high=1)),
    ])  # fmt: skip
    model = pg.Model(bodies=[trunk, thigh], forces=[f]).mirror("left", plane="y")
    (via,) = model.part("right s", "force").via
    assert (via.shifts[0].body, via.when.body) == ("right", "right")
    assert via.shifts[0].along == (0.1, -0.2, 0.3)
    mech, q = pg.Mechanism(model), np.full(2, 0.4)
    assert mech.path_length(q)[0] == pytest.approx(mech.path_length(q)[1], rel=1e-14)


def test_a_path_from_its_other_end_is_the_same():
    model = carriage(True)
    given = model.forces[0]
    back = pg.Spring(
        name="s", body="ground", other="b", point=(0, 0.4, 1), other_point=given.point,
        via=given.via[::-1], stiffness=40.0, other_shifts=[shift(body="a")],
    )  # fmt: skip
    turned = pg.Model(bodies=model.bodies, forces=[back]).forces[0]
    assert (turned.body, turned.shifts, turned.other_shifts) == ("b", back.other_shifts, ())


BAD = {
    "an unknown joint": (lambda: leg(pg.Via(body="thigh", point=(0, 0, 0), shifts=[
        shift(body="knee")])), "'s'", "point 1", "knee"),
    "a coordinate that is none": (lambda: leg(pg.Via(body="thigh", point=(0, 0, 0), when=pg.Within(
        body="shank", coordinate=1, low=0, high=1))), "'s'", "point 1", "shank"),
    "a range the wrong way round": (lambda: pg.Within(body="a", low=2, high=1), "low", "2", "1"),
    "a vector of zero": (lambda: shift(along=(0, 0, 0)), "along", "zero"),
    "an expression": (lambda: shift(curve="=sin(q)"), "curve", "expression", "x"),
    "a curve with a gap": (lambda: shift(curve={"x": (0, 1, 1), "value": (0, 1, 2)}), "ascend"),
    "a high degree": (lambda: shift(curve=pg.Polynomial(coefficients=(0, 0, 0, 1))), "degree 3"),
    "an obstacle that moves": (lambda: BALL.model_copy(update={"shifts": (shift(),)}), "shifts",
                               "obstacle"),
    "between obstacles": (lambda: leg(BALL, RANGED, BALL), "'s'", "via", "point 2", "1", "3"),
    "a limit": (lambda: leg(high=1.0), "'s'", "high", "Strut"),
}  # fmt: skip


@pytest.mark.quick
@pytest.mark.parametrize("bad", BAD)
def test_refusals_name_the_fault(bad):
    make, *facts = BAD[bad]
    with pytest.raises(ModelError) as refused:
        make()
    assert_names(str(refused.value), *facts)


def test_a_ball_joint_shifts_no_point():
    ball = pg.Body(name="ball", joint="spherical", mass=1.0, inertia=(1, 1, 1))
    f = pg.Spring(name="s", body="ball", point=(0, 0, 1), shifts=[shift(body="ball")])
    with pytest.raises(ModelError) as refused:
        pg.Model(bodies=[ball], forces=[f])
    assert_names(str(refused.value), "'s'", "shifts", "ball", "hinge")


@pytest.mark.parametrize("points", [(MOVING,), (RANGED,)])
def test_mjcf_has_no_such_points_and_the_writer_says_so(points, tmp_path):
    model = leg(*points).add(pg.LinearActuator(name="l", body="shank", via=points, input=1.0))
    report = pg.write_mjcf(model, tmp_path / "leg.xml")
    assert_names(str(report), "'s'", "'l'", "range")
