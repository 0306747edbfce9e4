"""Actuators along paths: their law, their inputs and their limits."""

from functools import partial

import numpy as np
import pytest

import pgraph_core as pg
from tests.refusals import assert_names, refusal

ARM = pg.Model(
    bodies=[
        pg.Body(
            name="arm", joint="revolute", axes=[(0, 1, 0)], mass=2, com=(0.3, 0, 0),
            inertia=(0.01, 0.1, 0.1),
        ),
        pg.Body(
            name="hand", parent="arm", joint="revolute", axes=[(0, 1, 0)], link=(0.6, 0, 0),
            mass=1, com=(0.2, 0, 0), inertia=(0.01, 0.02, 0.02),
        ),
    ]
)  # fmt: skip
PATH = {
    "body": "hand", "point": (0.2, 0, 0.05), "other_point": (0, 0, 0.4),
    "via": [pg.Via(body="arm", point=(0.5, 0, 0.1))],
}  # fmt: skip
RUN = {"t_end": 0.5, "method": "dop853", "rtol": 1e-10}


def driven(**law):
    return ARM.add(pg.LinearActuator(name="cylinder", **PATH, **law))


def test_a_linear_actuator_is_the_strut_of_its_law():
    lines = {"spring": {"x": (0, 1), "value": (25, 325)}, "damper": {"x": (0, 1), "value": (0, 4)}}
    strut = ARM.add(pg.Strut(name="cylinder", **PATH, **lines))
    mine = pg.simulate(driven(input=2.0, gain=-15.0, bias=5.0, kp=300.0, kd=4.0), **RUN)
    other = pg.simulate(strut, **RUN)
    assert np.abs(mine.q - other.q).max() < 1e-8  # both runs have an error of about 1e-9
    tension = mine.tension["cylinder"] - other.tension["cylinder"]
    assert np.abs(tension).max() < 1e-6  # of up to 300 N
    assert mine.energy_drift < 1e-8


def test_the_work_of_a_linear_actuator_is_that_of_its_input():
    run = pg.simulate(driven(input=-30.0, kp=300.0, kd=4.0), **RUN)
    shorter = run.path_length["cylinder"][0] - run.path_length["cylinder"]
    assert run.work == pytest.approx(30.0 * shorter, abs=1e-7)  # of 20 J; the run errs by 1e-8
    assert (np.diff(run.dissipation) >= 0.0).all()
    assert run.energy_drift < 1e-9


def test_inputs_of_all_kinds_give_the_same_run():
    held = pg.simulate(driven(input=-30.0), **RUN)
    table = pg.Table(t=[0, 1], value=[-30, -30])
    for model, given in (
        (driven(), {"cylinder": -30}), (driven(), {"cylinder": table}),
        (driven(input=table), None), (driven(input="=-30+0*q.arm"), None),
    ):  # fmt: skip
        run = pg.simulate(model, inputs=given, **RUN)
        assert np.abs(run.q - held.q).max() < 1e-12
    assert (held.tension["cylinder"] == 30.0).all()


def test_a_stepper_drives_a_linear_actuator():
    stepper = pg.Stepper(driven(force_low=-40.0), method="rk4", step=1e-3)
    stepper.step(inputs={"cylinder": -100.0})
    limited = stepper.inputs["cylinder"], stepper.tension["cylinder"]
    assert limited == (-100.0, 40.0)
    saved = stepper.save()
    stepper.step(inputs={"cylinder": 7.0})
    assert stepper.tension["cylinder"] == -7.0
    stepper.restore(saved)
    assert (stepper.inputs["cylinder"], stepper.tension["cylinder"]) == limited


def test_the_linearised_step_has_a_column_for_a_linear_actuator():
    def after(u):
        stepper = pg.Stepper(driven(), method="rk4", step=1e-2)
        stepper.step(inputs={"cylinder": u})
        return np.concatenate((stepper.q, stepper.v))

    column = pg.Stepper(driven(), method="rk4", step=1e-2).linearise(inputs=["cylinder"]).B[:, 0]
    assert column == pytest.approx((after(1.0) - after(-1.0)) / 2.0, rel=1e-5)


def test_a_linear_actuator_springs_to_the_length_that_its_input_gives():
    run = pg.simulate(driven(input=0.9, gain=400.0, kp=400.0), **RUN)
    stretch = run.path_length["cylinder"] - 0.9
    assert run.tension["cylinder"] == pytest.approx(400.0 * stretch, abs=1e-9)


def test_bounds_of_a_linear_actuator_hold_for_its_expressions():
    run = pg.simulate(driven(input="=100*sin(20*t)", input_high=60, force_low=-25), **RUN)
    force = -run.tension["cylinder"]
    assert force == pytest.approx(np.clip(100 * np.sin(20 * run.t), -25, 60), abs=1e-9)


def test_a_linear_actuator_refuses_limits_beside_gains_of_the_motion():
    for law, *facts in (
        ({"kp": 10.0, "force_high": 5.0}, "force_high", "kp 10", "pg.Strut"),
        ({"force_low": 3.0, "force_high": 2.0}, "force_low", "3", "2"),
        ({"input": 2.0, "input_high": 1.0}, "input", "2", "from -inf to 1"),
    ):
        assert_names(str(refusal(partial(driven, **law))), "'cylinder'", *facts)


@pytest.mark.parametrize("q", [-0.3, -0.04, 0.1, 0.3, 0.5])
def test_an_arm_is_in_equilibrium_where_an_actuator_holds_it(q):
    """The force of an input has no energy that a search could lower."""
    arm = pg.Body(
        name="arm", axes=[(0, 1, 0)], mass=1, com=(0, 0, -0.2), inertia=(0.02, 0.02, 0.01)
    )
    jack = pg.LinearActuator(name="jack", body="arm", point=(0, 0, -0.1), input=2, gain=3,
                             other_point=(-0.05, 0, 0.15))  # fmt: skip
    mech = pg.Mechanism(pg.Model(bodies=[arm], forces=[jack]))
    found = mech.equilibrium([q]).q
    wanted = -mech.moment_arms(found)[0, 0] * 6.0
    assert 9.81 * 0.2 * np.sin(found[0]) == pytest.approx(wanted, rel=1e-6)
