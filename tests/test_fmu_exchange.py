"""Derivatives and events of FMUs for model exchange, and states at any time."""

import numpy as np
import pytest

import pgraph_core as pg
from tests.native_runs import has_library
from tests.test_fmu import HERE, fmpy, load, opened, run, states_of

pytestmark = has_library


def exchanged(path, version):
    """Return an initialised component for model exchange and the numbers of its variables."""
    from fmpy.fmi2 import FMU2Model
    from fmpy.fmi3 import FMU3Model

    described = fmpy.read_model_description(str(path))
    made = {2: FMU2Model, 3: FMU3Model}[version](
        guid=described.guid, unzipDirectory=fmpy.extract(str(path)),
        modelIdentifier=described.modelExchange.modelIdentifier,
    )  # fmt: skip
    made.instantiate()
    if version == 2:
        made.setupExperiment()
    made.enterInitializationMode()
    made.exitInitializationMode()
    return made, {v.name: v.valueReference for v in described.modelVariables}


def columns(fmu, unknowns, knowns):
    """Return the derivatives of unknowns (n) by each of the knowns (m) as (n, m)."""
    return np.array([fmu.getDirectionalDerivative(unknowns, [k], [1.0]) for k in knowns]).T


@pytest.mark.parametrize("version", [2, 3])
def test_directional_derivatives_are_those_of_the_equations_of_motion(version, tmp_path):
    path, model = tmp_path / "m.fmu", load("double_pendulum")
    names = [body.name for body in model.bodies]
    model = model.add(pg.Motor(name="drive", body=names[1], torque=0.3))
    pg.write_fmu(model, path, version=version, platforms=HERE)
    fmu, number = exchanged(path, version)
    x = np.array([0.4, -0.9, 1.3, -2.1])
    if version == 3:
        fmu.setContinuousStates(x.ctypes.data_as(_pointer()), 4)
    else:
        fmu.fmi2SetContinuousStates(fmu.component, x.ctypes.data_as(_pointer()), 4)
    mech = pg.Mechanism(load("double_pendulum"))
    states = [number[name] for name in states_of(path)[-4:]]
    rates = [number[f"der({name})"] for name in states_of(path)[-4:]]
    by_q, by_v, by_tau = mech.forward_derivatives(x[:2], x[2:], [0.0, 0.3])
    want = np.block([[np.zeros((2, 2)), np.eye(2)], [by_q, by_v]])
    got = columns(fmu, rates, states)
    np.testing.assert_allclose(got, want, rtol=1e-11, atol=1e-11 * np.abs(want).max())
    got = columns(fmu, rates[2:], [number["drive"]])[:, 0]
    np.testing.assert_allclose(got, by_tau[:, 1], rtol=1e-12)


def _pointer():
    from ctypes import POINTER, c_double

    return POINTER(c_double)


@pytest.mark.parametrize("name", ["four_bar", "tennis_racket"])
def test_directional_derivatives_agree_with_differences_through_the_fmu(name, tmp_path):
    path = tmp_path / "m.fmu"
    pg.write_fmu(load(name), path, platforms=HERE)
    fmu, number = exchanged(path, 3)
    names = states_of(path)
    rates, n = [number[f"der({name})"] for name in names], len(names)
    x, step = np.array(fmu.getFloat64([number[name] for name in names])), 1e-5
    got = columns(fmu, rates, [number[name] for name in names])
    for i in range(n):
        sides = []
        for sign in (1.0, -1.0):
            moved = x.copy()
            moved[i] += sign * step
            fmu.setContinuousStates(moved.ctypes.data_as(_pointer()), n)
            sides.append(np.array(fmu.getFloat64(rates)))
        want = (sides[0] - sides[1]) / (2.0 * step)
        np.testing.assert_allclose(got[:, i], want, rtol=1e-6, atol=1e-6 * np.abs(got).max())


def test_a_felt_acceleration_has_derivatives_by_inputs_in_co_simulation(tmp_path):
    path, model = tmp_path / "m.fmu", load("double_pendulum")
    names = [body.name for body in model.bodies]
    model = model.add(pg.Motor(name="drive", body=names[1], torque=0.3, input_high=0.5)).add(
        pg.Output(name="felt", kind="accelerometer", at=names[1])
    )  # fmt: skip
    pg.write_fmu(model, path, platforms=HERE)
    fmu, number = opened(path)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    fmu.doStep(0.0, 0.1)
    felt, drive = [number[f"felt.{axis}"] for axis in "xyz"], number["drive"]
    got = fmu.getDirectionalDerivative(felt, [drive], [2.0])
    before = np.array(fmu.getFloat64(felt))
    fmu.setFloat64([drive], [0.5])  # the acceleration is linear in the torque, up to its bound
    np.testing.assert_allclose(got, 10.0 * (np.array(fmu.getFloat64(felt)) - before), rtol=1e-11)
    with pytest.raises(Exception, match="fmi3GetDirectionalDerivative"):
        fmu.getDirectionalDerivative(felt, felt, [1.0, 1.0, 1.0])


@pytest.mark.parametrize("version", [2, 3])
def test_corners_of_tables_are_time_events(version, tmp_path):
    path, model = tmp_path / "m.fmu", load("pendulum")
    table = pg.Table(t=(0.0, 0.2, 0.3, 1.0), value=(0.0, 5.0, -5.0, 0.0))
    model = model.add(pg.Motor(name="drive", body=model.bodies[0].name, torque=table))
    pg.write_fmu(model, path, version=version, platforms=HERE)
    fmu, _ = exchanged(path, version)
    found = fmu.updateDiscreteStates() if version == 3 else fmu.newDiscreteStates()
    assert found[4:6] == (True, 0.2)
    fmu.setTime(0.25)
    found = fmu.updateDiscreteStates() if version == 3 else fmu.newDiscreteStates()
    assert found[4:6] == (True, 0.3)
    fmu.setTime(1.0)
    found = fmu.updateDiscreteStates() if version == 3 else fmu.newDiscreteStates()
    assert not found[4]
    want = pg.simulate(model, t_end=0.5, rtol=1e-12, estimate=False)
    found = run(path, "ModelExchange", 0.5, 0.05, relative_tolerance=1e-9)
    np.testing.assert_allclose(found, [*want.q[-1], *want.v[-1]], rtol=1e-6)
