"""Cables that slip on wheels with friction: the law of Euler and Eytelwein, sticking, energy."""

import math

import numpy as np
import pytest

import pgraph_core as pg
from tests.core.test_cables import SOLID, TURN, G, weight, wheel
from tests.refusals import assert_names, refusal

UP, ALONG = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)


def rough(friction, radius, body="ground", **more):
    return pg.Pulley(body, radius=radius, friction=friction, axis=TURN, **more)


def hung(*wheels, masses=(9.0, 1.0), radius=0.1, inertia=None, backwards=False, **more):
    """Return two weights on a cable over an odd number of wheels of these frictions, alternately
    above and below, which are parts of the ground, or have an inertia and turn."""
    bodies, through = [], ["left"]
    for k, friction in enumerate(wheels):
        place, name = (2 * k * radius, 0.0, -8.0 * radius * (k % 2)), f"wheel {k}"
        if inertia is None:
            through.append(rough(friction, radius, point=place))
        else:
            bodies.append(wheel(name, inertia, link=place))
            through.append(rough(friction, radius, name))
    bodies.append(weight("left", masses[0], -radius, -10.0 * radius))
    bodies.append(weight("right", masses[1], (2 * len(wheels) - 1) * radius, -15.0 * radius))
    through = [*through, "right"][:: -1 if backwards else 1]
    cable = pg.Cable(name="rope", through=through, **more)
    return pg.Model(bodies=bodies, forces=(cable,), gravity=(0.0, 0.0, -G))


def tensions(run):
    return np.array([x for name, x in run.tension.items() if name.startswith("rope")])


@pytest.mark.parametrize(
    ("friction", "radius", "masses", "backwards"),
    [(0.3, 0.1, (9.0, 1.0), False), (0.3, 0.1, (9.0, 1.0), True), (0.05, 0.013, (1.0, 3.0), False),
     (1.0, 2.0, (4e4, 20.0), True)],
)  # fmt: skip
def test_a_cable_that_slips_has_the_ratio_of_euler_and_eytelwein(
    friction, radius, masses, backwards
):
    model = hung(friction, masses=masses, radius=radius, backwards=backwards)
    run = pg.simulate(model, t_end=0.05, step=5e-3)
    left, right = tensions(run)[:: -1 if backwards else 1]
    small, large = sorted((left[-1], right[-1]))
    assert large / small == pytest.approx(math.exp(math.pi * friction), rel=1e-9)
    heavy, light = max(masses), min(masses) * math.exp(math.pi * friction)
    speed = 0.05 * G * (heavy - light) / (heavy + light)
    assert run.v[-1] == pytest.approx(np.sign(masses[1] - masses[0]) * speed * np.array([1, -1]))
    if friction == 0.3:
        assert large / small == pytest.approx(2.566332395, abs=1e-8)


@pytest.mark.parametrize("masses", [(2.0, 1.0), (1.0, 2.5), (1.0, 1.0)])
def test_a_cable_sticks_below_the_ratio(masses):
    run = pg.simulate(hung(0.3, masses=masses), t_end=0.05, step=5e-3)
    assert np.abs(run.v).max() < 1e-11
    for found, mass in zip(tensions(run), masses):
        assert found == pytest.approx(mass * G, rel=1e-10)  # as the solver's tolerance
        assert found[2:] == pytest.approx(mass * G, rel=1e-12)


@pytest.mark.parametrize("angle", [0.3, 1.2, 2.4])
@pytest.mark.parametrize("side", [1, -1])
def test_the_ratio_follows_the_angle_of_wrap(angle, side):
    """A sledge on a ramp pulls a cable, which turns by an angle on its way down to a weight."""
    radius, mu, reach = 0.05, 0.4, 1.0
    ahead = np.array([side * math.sin(angle), 0.0, -math.cos(angle)])  # from the sledge's wheel
    normal = np.array([-side * math.cos(angle), 0.0, -math.sin(angle)])
    place = -radius * normal + reach * ahead
    sledge = pg.Body(
        name="sledge", joint="prismatic", axes=[tuple(ahead)], link=tuple(place), mass=0.5,
        inertia=SOLID,
    )  # fmt: skip
    load = weight("load", 5.0, side * -radius)
    cable = pg.Cable(name="rope", through=["sledge", rough(mu, radius, side=-side), "load"])
    model = pg.Model(bodies=(sledge, load), forces=(cable,), gravity=(0.0, 0.0, -G))
    run = pg.simulate(model, t_end=0.02, step=2e-3)
    up, down = tensions(run)
    assert down[-1] / up[-1] == pytest.approx(math.exp(mu * (math.pi - angle)), rel=1e-9)


@pytest.mark.parametrize("backwards", [False, True])
def test_wheels_in_series_multiply_their_ratios(backwards):
    frictions = (0.1, 0.2, 0.25)
    model = hung(*frictions, masses=(30.0, 1.0), radius=0.05, backwards=backwards)
    found = tensions(pg.simulate(model, t_end=0.02, step=2e-3))[:: -1 if backwards else 1]
    for k, friction in enumerate(frictions):
        ratio = found[k, -1] / found[k + 1, -1]
        assert ratio == pytest.approx(math.exp(math.pi * friction), rel=1e-8)


def test_some_wheels_of_a_series_stick_while_the_cable_slips_on_others():
    model = hung(0.1, 0.2, 0.25, masses=(30.0, 1.0), radius=0.05, inertia=0.01)
    run = pg.simulate(model, t_end=0.01, step=1e-3)
    found, speeds = tensions(run)[:, -1], 0.05 * run.v[-1, :3]
    ratios, bounds = np.log(found[:-1] / found[1:]), math.pi * np.array((0.1, 0.2, 0.25))
    slip = np.abs(np.abs(speeds) - abs(run.v[-1, 3]))
    sticks = slip < 1e-9
    assert sticks.tolist() == [False, True, False]
    assert ratios[~sticks] == pytest.approx(bounds[~sticks], rel=1e-9)
    assert ratios[sticks] < 0.95 * bounds[sticks]


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_band_brake_has_the_torque_of_its_band(way):
    """The band is tight at the ground in one sense of rotation, and slack there in the other."""
    mu, radius, mass, inertia = 0.35, 0.15, 2.0, 0.4
    band = ["load", rough(mu, radius, "drum"), ("ground", (radius, 0.0, -1.0))]
    bodies = (wheel("drum", inertia), weight("load", mass, -radius))
    cable = pg.Cable(name="band", through=band)
    model = pg.Model(bodies=bodies, forces=(cable,), gravity=(0.0, 0.0, -G))
    run = pg.simulate(model, v=[30.0 * way, 0.0], t_end=0.05, step=5e-3)
    wrap = math.exp(-way * mu * math.pi)
    torque = mass * G * radius * (wrap - 1.0)
    sense = np.sign(run.v[-1, 0])
    assert sense == way
    assert run.vdot[-1, 0] == pytest.approx(torque / inertia, rel=1e-9)
    assert np.abs(run.v[:, 1]).max() < 1e-11
    assert run.tension["band[2]"][-1] == pytest.approx(mass * G * wrap, rel=1e-9)


def test_slip_spins_a_wheel_up_until_it_sticks():
    radius, inertia, mu = 0.1, 0.002, 0.05
    model = hung(mu, masses=(3.0, 1.0), radius=radius, inertia=inertia)
    run = pg.simulate(model, v=[0.0, -1.0, 1.0], t_end=0.6, step=2e-3, frames=301)
    rim, rope = -radius * run.v[:, 0], -run.v[:, 1]
    slips = np.abs(rim - rope) > 1e-9
    begun, met = run.t > 0.0, run.t[slips].max()
    assert 0.05 < met < 0.55
    assert slips[begun & (run.t < met)].all()
    one, other = tensions(run)
    full = begun & (run.t < met - 2e-3)
    assert one[full] / other[full] == pytest.approx(math.exp(mu * math.pi), rel=1e-8)
    alpha = radius * (one - other) / inertia
    assert np.abs(run.vdot[full, 0]) == pytest.approx(np.abs(alpha[full]), rel=1e-8)
    held = run.t > met + 2e-3
    a = 2.0 * G / (4.0 + inertia / radius**2)
    assert -run.vdot[held, 1] == pytest.approx(a, rel=1e-8)


def test_the_loss_is_friction_times_slip():
    run = pg.simulate(hung(0.3), t_end=0.2, step=2e-3)
    one, other = tensions(run)[:, -1]
    way = abs(run.q[-1, 0])
    assert run.dissipation[-1] == pytest.approx((one - other) * way, rel=1e-9)
    assert np.ptp(run.energy + run.dissipation) < 1e-10 * run.dissipation[-1]


def test_a_cable_that_nothing_moves_has_the_tensions_of_least_friction():
    through = ["load", rough(0.2, 0.1), ("ground", (0.1, 0.0, -1.0))]
    bodies, cable = (weight("load", 1.0, -0.1),), pg.Cable(name="rope", through=through)
    model = pg.Model(bodies=bodies, forces=(cable,), gravity=(0.0, 0.0, -G))
    run = pg.simulate(model, t_end=0.01, step=1e-3)
    assert tensions(run) == pytest.approx(G, rel=1e-12)


def test_bearings_carry_both_tensions():
    model = hung(0.1, masses=(3.0, 1.0), inertia=0.02)
    run = pg.simulate(model, t_end=0.01, step=1e-3)
    held = run.joint_force["wheel 0"][-1, 5] - G  # without its weight
    assert held == pytest.approx(tensions(run)[:, -1].sum(), rel=1e-9)


def test_a_slack_cable_has_no_friction():
    model = hung(0.3, masses=(1.0, 1.0))
    run = pg.simulate(model, v=[1.0, 1.0], t_end=0.05, step=5e-3)
    assert not tensions(run)[:, 1:].any()
    assert run.vdot[1:] == pytest.approx(-G, rel=1e-12)


def test_derivatives_of_a_run_with_slip_are_those_of_runs():
    model, h = hung(0.1, masses=(5.0, 1.0), inertia=0.02), 1e-5
    how = {"t_end": 0.05, "step": 5e-3}
    run = pg.simulate(model, wrt=["left.mass"], **how)
    ends = [pg.simulate(model.edit("left", mass=5.0 + x), **how).v[-1] for x in (h, -h)]
    slope = (ends[0] - ends[1]) / (2 * h)
    found = run.gradient(lambda r: r.v[-1])["left.mass"]
    assert found == pytest.approx(slope, rel=1e-6)


# -- elastic cables --------------------------------------------------------------------------------

ELASTIC = {"stiffness": 2e4, "damping": 40.0, "tension": 20.0}


@pytest.mark.parametrize("method", ["dop853", "radau5"])
@pytest.mark.parametrize("backwards", [False, True])
def test_an_elastic_cable_slips_with_regularised_friction(method, backwards):
    model = hung(0.1, 0.05, 0.2, masses=(9.0, 1.0), backwards=backwards, **ELASTIC)
    run = pg.simulate(model, t_end=0.05, method=method, rtol=1e-9)
    found = tensions(run)[:: -1 if backwards else 1, -1]
    speed = abs(run.v[-1]).mean()
    held = speed / math.hypot(speed, 1e-3)
    hold = math.pi * held * np.array((0.1, 0.05, 0.2))
    assert np.log(found[:-1] / found[1:]) == pytest.approx(hold, rel=1e-4)
    assert np.ptp(run.energy + run.dissipation) < 1e-6 * run.dissipation[-1]
    assert np.diff(run.dissipation).min() >= 0.0


def test_an_elastic_cable_is_refused_in_time_stepping_by_its_name():
    model = hung(0.3, **ELASTIC).edit("left", limits=[(-5.0, 5.0)])
    error = refusal(lambda: pg.simulate(model, t_end=0.01, method="moreau_jean"))
    assert_names(str(error), "method", "'moreau_jean'", "'rope'", "stiffness", "'dop853'")
    assert pg.simulate(model, t_end=0.01).header["method"] == "dop853"


# -- refusals --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("more", "facts"),
    [
        ({"friction": -0.1}, ("friction", "-0.1", ">= 0")),
        ({"friction": 0.1, "radius": 0.0}, ("friction", "0.1", "radius")),
        ({"friction": 0.1, "grip": True}, ("friction", "0.1", "grip=True", "does not slip")),
        ({"friction": 0.1, "grip": False}, ("friction", "0.1", "grip=False", "without friction")),
    ],
)
def test_friction_that_contradicts_itself_is_refused(more, facts):
    error = refusal(lambda: pg.Pulley("sheave", **{"radius": 0.1, **more}))
    assert_names(str(error), *facts)


def test_a_drum_does_not_slip():
    bodies = (wheel("drum"), weight("load", 1.0, 0.1))
    drum = pg.Pulley("drum", radius=0.1, side=1, friction=0.2)
    cable = pg.Cable(name="hoist", through=[drum, "load"])
    model = pg.Model(bodies=bodies, forces=(cable,))
    error = refusal(lambda: pg.simulate(model, t_end=0.01))
    assert_names(str(error), "'hoist'", "through", "'drum'", "friction=0.2")


def test_a_rope_that_may_push_has_no_friction():
    model = hung(0.3)
    rope = pg.Rope(name="rope", through=model.forces[0].through)
    error = refusal(lambda: pg.simulate(model.replace(forces=(), constraints=(rope,)), t_end=0.01))
    assert_names(str(error), "'rope'", "through", "0.3", "'ground'", "Cable")


def test_a_belt_needs_a_wheel_on_which_it_does_not_slip():
    bodies = (wheel("a"), wheel("b", link=(0.5, 0, 0)))

    def belt(*frictions):
        through = [
            pg.Pulley(name, radius=0.08, side=1, friction=x) for name, x in zip("ab", frictions)
        ]
        parts = pg.Cable(name="belt", through=through, closed=True)
        return pg.Model(bodies=bodies, forces=(parts,))

    error = refusal(lambda: pg.simulate(belt(0.3, 0.3), t_end=0.01))
    assert_names(str(error), "'belt'", "grips")
    assert len(pg.simulate(belt(None, 0.3), t_end=0.01, step=5e-3).tension) == 2
