"""Cables, ropes and belts over wheels: closed forms, energy, tensions, slack and refusals."""

from functools import partial

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.packing.cable_lines import led_problems
from tests.refusals import assert_names, refusal

G = 9.81
UP = (0.0, 0.0, 1.0)
TURN = (0.0, 1.0, 0.0)
SOLID = np.eye(3)


def wheel(name, inertia=0.02, **more):
    return pg.Body(
        name=name, joint="revolute", axes=[TURN], mass=1.0, inertia=inertia * SOLID, **more
    )


def weight(name, mass, x, z=-1.0, **more):
    return pg.Body(
        name=name, joint="prismatic", axes=[UP], mass=mass, inertia=SOLID, link=(x, 0.0, z), **more
    )


def atwood(grip=None, inertia=0.02, cable=pg.Rope, masses=(3.0, 1.0), radius=0.1, **more):
    """Return two weights on a rope over a sheave, on its left and on its right."""
    bodies = (
        wheel("sheave", inertia), weight("left", masses[0], -radius),
        weight("right", masses[1], radius, -1.5),
    )  # fmt: skip
    through = ["left", pg.Pulley("sheave", radius=radius, grip=grip), "right"]
    rope = cable(name="rope", through=through, **more)
    parts = {"constraints" if cable is pg.Rope else "forces": (rope,)}
    return pg.Model(bodies=bodies, gravity=(0.0, 0.0, -G), **parts)


METHODS = ({"method": "rk4", "step": 1e-2}, {"method": "dop853"}, {"method": "radau5"}, {})


@pytest.mark.parametrize("how", METHODS, ids=str)
@pytest.mark.parametrize(
    ("masses", "inertia", "radius"), [((3, 1), 0.02, 0.1), ((0.2, 5), 1e-4, 0.02)]
)
def test_an_atwood_machine_accelerates_as_its_inertia_says(how, masses, inertia, radius):
    masses = tuple(map(float, masses))
    run = pg.simulate(atwood(None, inertia, masses=masses, radius=radius), t_end=0.3, **how)
    a = (masses[0] - masses[1]) * G / (sum(masses) + inertia / radius**2)
    assert run.vdot[:, 1] == pytest.approx(-a, rel=1e-12)
    assert run.tension["rope[1]"] == pytest.approx(masses[0] * (G - a), rel=1e-11)
    assert run.tension["rope[2]"] == pytest.approx(masses[1] * (G + a), rel=1e-11)
    assert run.constraint_drift.max() < 1e-12


def test_a_rope_slides_over_a_smooth_wheel():
    run = pg.simulate(atwood(grip=False), t_end=0.3)
    assert run.vdot[:, 1] == pytest.approx(-0.5 * G, rel=1e-12)
    assert run.tension["rope"] == pytest.approx(1.5 * G, rel=1e-11)
    assert not run.v[:, 0].any()  # nothing turns the wheel


def tackle(strands, load, pull, radius=0.05):
    """Return a block on `strands` strands of a rope, whose end carries a weight."""
    half = strands // 2
    block = weight("block", load, 0.0, -2.0)
    through = [("ground", (-radius, 0.0, 0.0))]
    for k in range(half):
        x = 4 * k * radius
        through.append(pg.Pulley("block", point=(x, 0, 0), radius=radius, axis=TURN))
        x += 2 * radius
        through.append(pg.Pulley("ground", point=(x, 0, 0), radius=radius, axis=TURN))
    end = weight("end", pull, x + radius, -1.0)
    rope = pg.Rope(name="rope", through=[*through, "end"])
    return pg.Model(bodies=(block, end), constraints=(rope,), gravity=(0.0, 0.0, -G))


@pytest.mark.parametrize("strands", [2, 6])
@pytest.mark.parametrize(("load", "pull"), [(10.0, 4.0), (10.0, 1.0)])
def test_a_tackle_multiplies_the_pull_by_its_strands(strands, load, pull):
    run = pg.simulate(tackle(strands, load, pull), t_end=0.2)
    a = (load - strands * pull) * G / (load + strands**2 * pull)  # of the load downwards
    assert run.vdot[:, 0] == pytest.approx(-a, rel=1e-11)
    assert run.vdot[:, 1] == pytest.approx(strands * a, rel=1e-11)
    assert run.tension["rope"] == pytest.approx(pull * (G + strands * a), rel=1e-11)


def test_a_winch_counts_its_turns_and_its_motor_does_the_work():
    bodies = (wheel("drum", 0.3), weight("load", 20.0, 0.1, -40.0))
    rope = pg.Rope(name="rope", through=[pg.Pulley("drum", radius=0.1, side=1), "load"])
    motor = pg.Motor(name="motor", body="drum", torque=-25.0)
    model = pg.Model(bodies=bodies, constraints=(rope,), forces=(motor,), gravity=(0.0, 0.0, -G))
    run = pg.simulate(model, t_end=5.0, frames=51)
    turns = abs(run.q[-1, 0]) / (2 * np.pi)
    assert turns > 10
    assert run.q[:, 1] == pytest.approx(-0.1 * run.q[:, 0], abs=1e-10)
    balance = run.energy - run.energy[0] - run.work
    assert np.abs(balance).max() < 1e-10 * np.abs(run.work).max()


@pytest.mark.parametrize("crossed", [False, True])
def test_a_belt_without_stretch_is_a_gear(crossed):
    bodies = (wheel("a", 0.02), wheel("b", 0.3, link=(0.6, 0, 0)))
    sides = (1, -1) if crossed else (1, 1)
    through = [pg.Pulley(n, radius=r, side=s) for n, r, s in zip("ab", (0.05, 0.15), sides)]
    belt = pg.Rope(name="belt", through=through, closed=True)
    model = pg.Model(bodies=bodies, constraints=(belt,), gravity=(0, 0, -G))
    run = pg.simulate(model, v=[3.0, -1.0 if crossed else 1.0], t_end=4.0)
    ratio = -3.0 if crossed else 3.0
    assert run.q[:, 0] == pytest.approx(ratio * run.q[:, 1], abs=1e-10)
    assert np.ptp(run.energy) < 1e-10


def test_an_elastic_belt_has_the_frequency_of_its_two_spans():
    bodies = (wheel("a", 0.02), wheel("b", 0.05, link=(0.5, 0, 0)))
    through = [pg.Pulley(n, radius=0.08, side=1) for n in "ab"]
    belt = pg.Cable(name="belt", through=through, closed=True, stiffness=2e4, tension=50.0)
    mech = pg.Mechanism(pg.Model(bodies=bodies, forces=(belt,)))
    fastest = np.abs(np.linalg.eigvals(mech.linearise().A).imag).max()
    assert fastest == pytest.approx(np.sqrt(2 * 2e4 * 0.08**2 * (1 / 0.02 + 1 / 0.05)), rel=1e-8)
    run = pg.simulate(mech, t_end=0.1)
    assert run.tension["belt[1]"] == pytest.approx(50.0, rel=1e-9)


def crane(cable=pg.Cable, **more):
    """Return a cable from a drum over two wheels on moving arms to a free body."""
    arm = {
        "joint": "revolute",
        "axes": [TURN],
        "mass": 2.0,
        "inertia": 0.3 * SOLID,
        "com": (0.4, 0, 0),
    }
    bodies = (
        pg.Body(name="boom", q=(-0.4,), **arm),
        pg.Body(name="jib", parent="boom", link=(1.0, 0, 0), q=(0.3,), **arm),
        wheel("drum", 0.05, parent="boom", link=(0.2, 0, 0.15)),
        pg.Body(
            name="load", joint="free", mass=5.0, inertia=0.1 * SOLID,
            q=(2.0, 0.05, -1.5, 1, 0, 0, 0),
        ),
    )  # fmt: skip
    through = [
        pg.Pulley("drum", radius=0.08, side=1),
        pg.Pulley("boom", point=(0.9, 0, 0.1), radius=0.05, axis=TURN),
        pg.Pulley("jib", point=(0.8, 0, 0.05), radius=0.06, axis=TURN),
        ("load", (0.02, 0.01, 0.1)),
    ]
    rope = cable(name="rope", through=through, **more)
    parts = {"constraints" if cable is pg.Rope else "forces": (rope,)}
    return pg.Model(bodies=bodies, gravity=(0.0, 0.0, -G), **parts)


@pytest.mark.parametrize(("cable", "more"), [(pg.Rope, {}), (pg.Cable, {"stiffness": 3e3})])
def test_a_cable_over_moving_wheels_keeps_the_energy(cable, more):
    run = pg.simulate(crane(cable, **more), t_end=1.0, rtol=1e-10)
    assert np.abs(run.v).max() > 1.0
    assert np.ptp(run.energy) < 1e-8 * np.ptp(run.kinetic_energy)


def test_the_force_of_a_cable_is_the_slope_of_its_energy():
    model = crane(stiffness=3e3, tension=40.0)
    mech, without = pg.Mechanism(model), pg.Mechanism(model.remove("rope"))
    q, rest = mech.packed.system.q.copy(), np.zeros(mech.nv)
    q[:3] += (0.1, -0.2, -0.3)
    pull = mech.inverse_dynamics(q, rest, rest) - without.inverse_dynamics(q, rest, rest)
    for j in range(6):  # three hinges, and the place of the load
        ahead, back = q.copy(), q.copy()
        ahead[j] += 1e-6
        back[j] -= 1e-6
        slope = sum(
            sign * (mech.energy(x, rest)[1] - without.energy(x, rest)[1]) / 2e-6
            for sign, x in ((1, ahead), (-1, back))
        )
        along = pull[j] if j < 3 else pull[3 + j]
        assert along == pytest.approx(slope, rel=1e-6, abs=1e-6)


def test_derivatives_by_a_radius_and_a_length_are_those_of_runs():
    model = atwood(grip=None, cable=pg.Cable, stiffness=2e3, damping=20.0)
    run = pg.simulate(model, t_end=0.2, method="rk4", step=1e-3, wrt=["sheave.mass", "left.mass"])
    h = 1e-5
    ends = [
        pg.simulate(model.edit("left", mass=3.0 + x), t_end=0.2, method="rk4", step=1e-3).q[-1]
        for x in (h, -h)
    ]
    slope = (ends[0] - ends[1]) / (2 * h)
    assert run.derivatives["left.mass"][-1, : len(slope)] == pytest.approx(slope, rel=1e-6)


def test_a_cable_that_does_not_stretch_slackens_and_becomes_taut_without_a_rebound():
    model = atwood(grip=False, cable=pg.Cable)
    run = pg.simulate(model, v=[0.0, 0.0, 2.0], t_end=0.5, frames=101)
    taut = 2.0 / G  # both fall freely until then
    left, right = -G * taut, 2.0 - G * taut
    blow = -(left + right) / (1 / 3 + 1)
    expected = left + blow / 3 - 0.5 * G * (0.5 - taut)
    assert run.v[-1, 1] == pytest.approx(expected, rel=1e-6)
    assert run.v[-1, 2] == pytest.approx(-expected, rel=1e-6)
    free = run.t < taut - 0.01
    assert run.vdot[free, 1:] == pytest.approx(-G, rel=1e-9)


def test_an_elastic_cable_only_pulls():
    model = atwood(grip=False, cable=pg.Cable, stiffness=1e4, damping=10.0)
    run = pg.simulate(model, v=[0.0, 0.0, 2.0], t_end=0.5, frames=101)
    assert run.tension["rope"].min() >= 0.0
    assert not run.tension["rope"][run.t < 2.0 / G - 0.02].any()
    assert run.tension["rope"].max() > 10.0


def test_joints_transmit_the_forces_of_a_rope():
    run = pg.simulate(atwood(), t_end=0.1)
    held = run.joint_force["sheave"][:, 5] - G  # without its weight
    pulls = run.tension["rope[1]"] + run.tension["rope[2]"]
    assert held == pytest.approx(pulls, rel=1e-10)


@pytest.mark.parametrize(
    ("through", "closed", "told"),
    [
        (["left"], False, "two or more points"),
        (["left", "left"], False, "at the same point"),
        ([("ground", (0, 0, 0)), ("ground", (1, 0, 0))], False, "all its points are on the ground"),
        (["left", pg.Pulley("sheave", radius=0.1), "right"], True, "is a point"),
    ],
)
def test_a_cable_that_leads_nowhere_is_refused(through, closed, told):
    with pytest.raises(pg.ModelError, match=told):
        pg.Rope(name="rope", through=through, closed=closed)


def rope_of(*through, **more):
    bodies = (wheel("sheave"), weight("left", 1.0, -0.1), weight("right", 1.0, 0.1, -1.5))
    rope = pg.Rope(name="rope", through=list(through), **more)
    return pg.Mechanism(pg.Model(bodies=bodies, constraints=(rope,)))


@pytest.mark.parametrize(
    ("through", "told"),
    [
        (["left", pg.Pulley("left", point=(0, 0, 1), radius=0.1), "right"], "needs an axis"),
        (
            [("ground", (-1, 0, -0.2)), pg.Pulley("sheave", radius=0.1, side=-1),
             ("ground", (1, 0, -0.2))],
            "give side=1 for",
        ),
        (["left", pg.Pulley("sheave", radius=1.6), "right"], "move them apart"),
        ([pg.Pulley("sheave", radius=0.1), "right"], "side=1"),
        (
            [pg.Pulley("ground", radius=0.1, axis=TURN, side=1, grip=False), "right"],
            "over which it would slide",
        ),
        (
            [
                "left", pg.Pulley("sheave", radius=0.1),
                pg.Pulley("ground", point=(1, 0, 0), radius=0.1, axis=(1, 0, 0)), "right",
            ],
            "parallel axes",
        ),
    ],
)  # fmt: skip
def test_a_rope_that_cannot_lie_on_its_wheels_is_refused(through, told):
    with pytest.raises(pg.ModelError, match=told):
        _ = rope_of(*through).packed.blocks


def test_a_length_is_that_of_one_segment():
    """The sheave that the cable grips makes two of it, and each would have the whole length."""
    for cable, more in ((pg.Rope, {}), (pg.Cable, {}), (pg.Cable, {"stiffness": 1e4})):
        mech = pg.Mechanism(atwood(cable=cable, length=2.0, **more))
        (problem,) = led_problems(mech.packed)
        assert (problem.where.split()[1], problem.field) == ("'rope'", "length")
        assert_names(problem.text, "2 segments", "grip=False")
        assert str(problem) in str(refusal(partial(pg.simulate, mech, t_end=0.01)))
    whole = atwood(grip=False, cable=pg.Cable, length=2.8, stiffness=1e4)
    assert not led_problems(pg.Mechanism(whole).packed)


@pytest.mark.parametrize("x", [0.37, 1.0, 2.3])
def test_a_damped_cable_that_lengthens_from_its_rest_pulls_at_once(x):
    trolley = pg.Body(name="a", joint="prismatic", axes=[(1, 0, 0)], mass=1, q=(x,), v=(1.0,))
    cable = pg.Cable(name="c", through=["a", ("ground", (0, 0.3, 0.1))], stiffness=100, damping=5)
    run = pg.simulate(pg.Model(bodies=[trolley], gravity=(0, 0, 0), forces=[cable]), t_end=0.01)
    along = x / np.linalg.norm((x, 0.3, 0.1))
    assert run.tension["c"][0] == pytest.approx(5 * along, rel=1e-12)
    assert run.vdot[0, 0] == pytest.approx(-5 * along**2, rel=1e-12)


def test_stretch_of_a_rope_is_led_to_a_cable():
    for name in ("stiffness", "damping", "tension"):
        assert_names(str(refusal(partial(atwood, **{name: 10.0}))), name, "pg.Cable")
