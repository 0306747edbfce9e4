"""FMUs of other programs act as controllers, at their samples and forward in time alone."""

import math
import pickle
import re
import zipfile
from contextlib import contextmanager

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.native import library
from tests.native_runs import has_library
from tests.refusals import assert_names

fmpy = pytest.importorskip("fmpy", reason="fmpy imports FMUs")
pytestmark = has_library
HERE = [library.here()]
SAMPLE = 0.01


@contextmanager
def refused(*facts):
    with pytest.raises(pg.InputError) as found:
        yield
    assert_names(str(found.value), *facts)


def plant():
    """Return a pendulum on a cart."""
    cart = pg.Body(name="cart", joint="prismatic", axes=(1, 0, 0), mass=2.0)
    pole = pg.Body(name="pole", parent="cart", axes=(0, 1, 0), mass=0.3, com=(0, 0, 0.4), q=0.1)
    return pg.Model(
        bodies=[cart, pole],
        sites=[pg.Site(name="end", body="pole", point=(0, 0, 0.8))],
        outputs=[pg.Output(name="tip", kind="position", at="end"),
                 pg.Output(name="felt", kind="accelerometer", at="pole")],
    )  # fmt: skip


def filter_():
    """Return a mass on a spring, which turns a force into a delayed position."""
    mass = pg.Body(name="y", joint="prismatic", axes=(1, 0, 0), mass=1.0, damping=8.0)
    spring = pg.Servo(name="u", body="y", kp=30.0, kd=1.0, target=0.0)
    return pg.Model(bodies=[mass], forces=[spring], gravity=(0, 0, 0))


@pytest.fixture(params=[2, 3], scope="module")
def path(request, tmp_path_factory):
    """Return the FMU of the filter, whose variables have no units."""
    folder = tmp_path_factory.mktemp("fmu")
    whole, bare = folder / "whole.fmu", folder / "filter.fmu"
    pg.write_fmu(filter_(), whole, version=request.param, platforms=HERE)
    with zipfile.ZipFile(whole) as old, zipfile.ZipFile(bare, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "modelDescription.xml":
                content = re.sub(rb' (unit|modelIdentifier)="[^"]*"', _without_unit, content)
            new.writestr(name.replace("whole.", "filter."), content)
    return bare


def _without_unit(found):
    return b"" if found[1] == b"unit" else b' modelIdentifier="filter"'


def by_hand(steps):
    """Return the state of a loop of two steppers that exchange values at samples."""
    one, two = (pg.Stepper(x, step=1e-3, method="rk4") for x in (plant(), filter_()))
    for _ in range(steps):
        angle = float(one.q[1])
        one.step(tau=[two.q[0], 0.0], n=10)
        two.step(n=10, inputs={"u": angle})  # with the angle of the sample
    return [*one.q, *one.v]


def test_a_run_has_the_bits_of_two_steppers(path):
    given = {"inputs": {"u": "pole"}, "outputs": {"y": "cart"}}
    controller = pg.read_fmu(path, plant(), **given)
    for _ in range(2):  # each run starts it again
        run = pg.simulate(
            plant(), tau=controller, sample=SAMPLE, t_end=0.3, method="rk4", step=1e-3
        )
        np.testing.assert_array_equal([*run.q[-1], *run.v[-1]], by_hand(30))
    controller.restart()
    stepper = pg.Stepper(plant(), step=1e-3, method="rk4")
    for _ in range(30):
        stepper.step(tau=controller(stepper.t, stepper.q, stepper.v), n=10)
    np.testing.assert_allclose([*stepper.q, *stepper.v], by_hand(30), rtol=1e-12)


def test_a_run_that_goes_on_keeps_the_state_of_the_fmu(path):
    controller = pg.read_fmu(path, plant(), inputs={"u": "pole"}, outputs={"y": "cart"})
    how = {"tau": controller, "sample": SAMPLE, "method": "rk4", "step": 1e-3}
    first = pg.simulate(plant(), t_end=0.15, **how)
    second = pg.simulate(plant(), start=first, t_end=0.3, **how)
    np.testing.assert_allclose([*second.q[-1], *second.v[-1]], by_hand(30), rtol=1e-9)


def test_copies_and_sweeps_in_other_processes_start_it_anew(path):
    controller = pg.read_fmu(path, plant(), inputs={"u": "pole"}, outputs={"y": "cart"})
    controller.step(0.0)
    controller.step(0.1)
    again = pickle.loads(pickle.dumps(controller))
    how = {"sample": SAMPLE, "t_end": 0.1, "method": "rk4", "step": 1e-3}
    want = pg.simulate(plant(), tau=controller, **how)
    np.testing.assert_array_equal(pg.simulate(plant(), tau=again, **how).q, want.q)


def test_outputs_of_the_model_are_measured(path):
    controller = pg.read_fmu(path, plant(), inputs={"u": "tip.z"}, outputs={"y": "cart"})
    by_name = pg.read_fmu(path)
    for k, angle in enumerate((0.1, 0.5, 0.2)):
        got = controller(0.1 * k, np.array([0.3, angle]), np.zeros(2))
        z = 0.8 * math.cos(angle)
        assert got[0] == pytest.approx(by_name.step(0.1 * k, {"u": z})["y"], rel=1e-12)


def test_numbers_are_in_si_units_whatever_the_fmu_declares(tmp_path):
    """A copy whose unit of length is a millimetre and whose angles are degrees."""
    whole, other = tmp_path / "m.fmu", tmp_path / "copy" / "m.fmu"
    other.parent.mkdir()
    pg.write_fmu(filter_(), whole, platforms=HERE)
    with zipfile.ZipFile(whole) as old, zipfile.ZipFile(other, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "modelDescription.xml":
                content = content.replace(
                    b'<BaseUnit m="1" />', b'<BaseUnit m="1" factor="1e-3" />'
                )
            new.writestr(name, content)
    metres, millimetres = pg.read_fmu(whole), pg.read_fmu(other)
    for t, u in ((0.0, 2.0), (0.1, 3.0), (0.3, 0.0)):
        want = metres.step(t, {"u": 1e3 * u})["y"]
        assert millimetres.step(t, {"u": u})["y"] == pytest.approx(1e-3 * want, rel=1e-12)


def test_an_fmu_says_why_it_fails_and_can_start_again(path):
    with refused("u", "finite"):
        pg.read_fmu(path, start={"y": 0.1}).step(0.0, {"u": math.nan})
    limited = pg.read_fmu(path)
    limited.step(0.0)
    with refused("doStep", "asked for at t = 5 s"):  # in the words of the FMU
        limited._guarded("doStep", limited._fmu.doStep, 5.0, 0.1)
    limited.restart()
    assert limited.step(0.3)["y"] == 0.0


def test_time_goes_forward_alone_and_estimates_are_refused(path):
    controller = pg.read_fmu(path, plant(), inputs={"u": "pole"}, outputs={"y": "cart"})
    controller.step(0.0)
    controller.step(0.5)
    with refused("0.2", "restart"):
        controller.step(0.2)
    controller.restart()
    assert controller.step(0.2)["y"] == 0.0
    run = pg.simulate(plant(), tau=controller, sample=SAMPLE, t_end=0.05, estimate=True)
    assert run.status.ok
    assert "second run" in run.message


WRONG = [
    ({"inputs": {"w": "pole"}}, "inputs", ("'w'", "u")),
    ({"inputs": {"u": "arm"}}, "inputs", ("'arm'", "pole")),
    ({"inputs": {"u": "felt.x"}}, "inputs", ("felt.x", "torques")),
    ({"outputs": {"y": "arm"}}, "outputs", ("'arm'", "cart")),
    ({"outputs": {}}, "outputs", ("at least one", "y")),
    ({"outputs": ["y"]}, "outputs", ("['y']",)),
    ({"start": {"mass": 1.0}}, "start", ("'mass'",)),
]


@pytest.mark.parametrize(("given", "field", "facts"), WRONG, ids=range(len(WRONG)))
def test_wrong_connections_are_refused(given, field, facts, path):
    with refused(field, *facts):
        pg.read_fmu(path, plant(), **{"inputs": {"u": "pole"}, "outputs": {"y": "cart"}, **given})


def test_exactness_is_not_promised(path):
    controller = pg.read_fmu(path, plant(), inputs={"u": "pole"}, outputs={"y": "cart"})
    for call in (pg.simulate, pg.Stepper):
        with refused("sample"):
            call(plant(), tau=controller)
    with refused("tau"):
        pg.BatchStepper(plant(), 3, tau=controller)


def test_units_are_compared_and_other_files_are_refused(tmp_path):
    path = tmp_path / "m.fmu"
    pg.write_fmu(filter_(), path, platforms=HERE)
    with refused("outputs", "'y'", "cart", "N"):  # a position [m] on a joint that takes forces
        pg.read_fmu(path, plant(), outputs={"y": "cart"})
    with pytest.raises(pg.FileError, match=r"no such file"):
        pg.read_fmu(tmp_path / "none.fmu")
    (tmp_path / "text.fmu").write_text("text")
    with pytest.raises(pg.FileError, match=r"text\.fmu"):
        pg.read_fmu(tmp_path / "text.fmu")
    pg.write_fmu(filter_(), path, kinds=["me"], platforms=HERE)
    with refused("co-simulation"):
        pg.read_fmu(path)
