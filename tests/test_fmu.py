"""FMUs are valid, have the bits of `simulate`, and say what they refuse."""

import os
import zipfile
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_core.native import library
from pgraph_core.native.description import exponents
from tests.core.test_native import arm
from tests.native_runs import has_library
from tests.nights import at_night

fmpy = pytest.importorskip("fmpy", reason="fmpy imports FMUs")
pytestmark = has_library
HERE = [library.here()]


def load(name):
    return pg.load(pgraph_models.path(name))


def states_of(path):
    described = fmpy.read_model_description(str(path))
    own = (v for v in described.modelVariables if v.causality in ("local", "output"))
    return [v.name for v in own if v.start is not None]


def run(path, kind, t_end, step, **more):
    names = states_of(path)
    found = fmpy.simulate_fmu(str(path), stop_time=t_end, step_size=step, output_interval=step,
                              fmi_type=kind, output=names, **more)  # fmt: skip
    return np.array([found[-1][name] for name in names])


USUAL = ("double_pendulum", "four_bar", "falling_rod", "tennis_racket")
OTHERS = [name for name in pgraph_models.names() if name not in USUAL]


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("name", [*USUAL, *at_night(*OTHERS)])
def test_every_model_makes_a_valid_fmu_or_says_why_not(name, version, tmp_path):
    from fmpy.validation import validate_fmu

    model, path = load(name), tmp_path / f"{name}.fmu"
    report = pg.write_fmu(model, path, version=version, platforms=HERE)
    described = fmpy.read_model_description(str(path))
    assert validate_fmu(str(path)) == []
    assert described.coSimulation is not None
    left = " ".join(map(str, report.of("left out")))
    assert (described.modelExchange is None) == ("no model exchange" in left)


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize(
    ("name", "scenario", "method"),
    [("double_pendulum", None, "rk4"), ("four_bar", "turn", "dop853"),
     ("falling_rod", "fall", "moreau_jean")],
)  # fmt: skip
def test_co_simulation_has_the_bits_of_a_run(name, scenario, method, version, tmp_path):
    path, model = tmp_path / "m.fmu", load(name)
    pg.write_fmu(model, path, version=version, scenario=scenario, method=method, platforms=HERE)
    step = (model.scenario(scenario).step if scenario else None) or 1e-3
    want = pg.simulate(model, t_end=100 * step, scenario=scenario, method=method, step=step,
                       estimate=False)  # fmt: skip
    found = run(path, "CoSimulation", 100 * step, step)
    np.testing.assert_array_equal(found, [*want.q[-1], *want.v[-1]])


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize(
    ("name", "scenario", "t_end"),
    [("double_pendulum", None, 1.0), ("four_bar", "turn", 0.5), ("tennis_racket", None, 0.5),
     *at_night(("andrews", "spin", 0.03))],
)  # fmt: skip
def test_model_exchange_meets_the_tolerance_of_the_importer(
    name, scenario, t_end, version, tmp_path
):
    """CVODE of fmpy with 1e-10 is within 1e-6 of a run with 1e-12, of states of size 1 to 30."""
    path, model = tmp_path / "m.fmu", load(name)
    pg.write_fmu(model, path, version=version, scenario=scenario, platforms=HERE)
    want = pg.simulate(model, t_end=t_end, scenario=scenario, rtol=1e-12, estimate=False)
    found = run(path, "ModelExchange", t_end, t_end / 20, relative_tolerance=1e-10)
    np.testing.assert_allclose(found, [*want.q[-1], *want.v[-1]], rtol=1e-6, atol=1e-6)


def opened(path):
    """Return an initialised component of FMI 3 and the numbers of its variables."""
    from fmpy.fmi3 import FMU3Slave

    described = fmpy.read_model_description(str(path))
    numbers = {v.name: v.valueReference for v in described.modelVariables}
    fmu = FMU3Slave(guid=described.guid, unzipDirectory=fmpy.extract(str(path)),
                    modelIdentifier=described.coSimulation.modelIdentifier)  # fmt: skip
    fmu.instantiate()
    return fmu, numbers


def test_inputs_parameters_and_outputs_act_as_in_a_stepper(tmp_path):
    path = tmp_path / "m.fmu"
    pg.write_fmu(arm(), path, parameters=["forces.hold.kp"], platforms=HERE)
    fmu, number = opened(path)
    fmu.setFloat64([number["forces.hold.kp"]], [5.0])
    fmu.enterInitializationMode()
    fmu.setFloat64([number["drive"]], [0.7])
    fmu.getFloat64([number["the position.x"]])  # starts it, and what follows starts it again
    fmu.setFloat64([number["drive"]], [0.1])
    fmu.exitInitializationMode()
    stepper = pg.Stepper(arm().edit("forces.hold.kp", 5.0), step=1e-3, method="rk4")
    for k, u in enumerate((0.1, -0.4, 0.7)):
        fmu.setFloat64([number["drive"]], [u])
        fmu.doStep(0.1 * k, 0.1)
        stepper.step(n=100, inputs={"drive": u})
        names = [f"the accelerometer.{axis}" for axis in "xyz"]
        got = fmu.getFloat64([number[name] for name in ("upper arm", "v.hand", *names)])
        want = [stepper.q[0], stepper.v[1], *stepper.outputs["the accelerometer"]]
        np.testing.assert_array_equal(got, want)
    fmu.terminate()
    fmu.freeInstance()


def test_the_state_is_copied_and_serialised(tmp_path):
    path = tmp_path / "m.fmu"
    pg.write_fmu(load("quadruped_hips"), path, scenario="trot", platforms=HERE)
    fmu, number = opened(path)
    every = [*number.values()]
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    fmu.doStep(0.0, 0.02)
    kept = fmu.getFMUState()
    text = fmu.serializeFMUState(kept)
    fmu.doStep(0.02, 0.03)
    want = fmu.getFloat64(every)
    fmu.setFMUState(kept)
    fmu.doStep(0.02, 0.03)
    np.testing.assert_array_equal(fmu.getFloat64(every), want)
    other, _ = opened(path)
    other.setFMUState(other.deserializeFMUState(text))
    other.doStep(0.02, 0.03)
    np.testing.assert_array_equal(other.getFloat64(every), want)


@pytest.mark.nightly
def test_no_state_is_lost_at_a_thousand_times(tmp_path):
    path, rng = tmp_path / "m.fmu", np.random.default_rng(7)
    pg.write_fmu(load("quadruped_hips"), path, scenario="trot", platforms=HERE)
    fmu, number = opened(path)
    other, _ = opened(path)
    every, t = [*number.values()], 0.0
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    for _ in range(1000):
        kept, ahead = fmu.getFMUState(), float(rng.uniform(1e-4, 3e-3))
        fmu.doStep(t, ahead)
        want = fmu.getFloat64(every)
        copy = other.deserializeFMUState(fmu.serializeFMUState(kept))
        other.setFMUState(copy)
        fmu.setFMUState(kept)
        for one in (fmu, other):
            one.doStep(t, ahead)
            np.testing.assert_array_equal(one.getFloat64(every), want)
        fmu.freeFMUState(kept)
        other.freeFMUState(copy)
        t += ahead


@pytest.mark.nightly
def test_ten_thousand_instances_leave_no_memory(tmp_path):
    path = tmp_path / "m.fmu"
    pg.write_fmu(load("double_pendulum"), path, platforms=HERE)
    fmu, _ = opened(path)
    fmu.fmi3FreeInstance(fmu.component)
    before = 0
    for k in range(11_000):
        fmu.instantiate()
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        fmu.fmi3FreeInstance(fmu.component)
        if k == 1000:  # after what Python keeps
            before = _resident()
    assert _resident() - before < 1_000_000


def _resident():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.parametrize("count", [8, *at_night(100)])
def test_instances_in_threads_have_the_same_bits(count, tmp_path):
    path = tmp_path / "m.fmu"
    pg.write_fmu(load("falling_rod"), path, platforms=HERE)

    def ran(_):
        fmu, number = opened(path)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        for k in range(20):
            fmu.doStep(0.005 * k, 0.005)
        found = fmu.getFloat64([*number.values()])
        fmu.freeInstance()
        return found

    with ThreadPoolExecutor(4) as pool:
        found = [*pool.map(ran, range(count))]
    assert all(one == found[0] for one in found)


def test_a_start_later_than_zero_shifts_the_time(tmp_path):
    path = tmp_path / "m.fmu"
    pg.write_fmu(load("double_pendulum"), path, platforms=HERE)
    fmu, number = opened(path)
    fmu.enterInitializationMode(startTime=2.0)
    fmu.exitInitializationMode()
    fmu.doStep(2.0, 0.1)
    fmu.doStep(2.1, 0.0)  # some importers ask for no step
    assert fmu.getFloat64([number["time"]]) == [pytest.approx(2.1, abs=1e-12)]
    run = pg.simulate(load("double_pendulum"), t_start=2.0, t_end=2.1, method="rk4", step=1e-3,
                      estimate=False)  # fmt: skip
    names = states_of(path)
    got = fmu.getFloat64([number[name] for name in names])
    np.testing.assert_allclose(got, [*run.q[-1], *run.v[-1]], rtol=1e-12)
    with pytest.raises(Exception, match="fmi3DoStep"):
        fmu.doStep(5.0, 0.1)


def test_a_damaged_fmu_is_refused_in_the_log(tmp_path):
    path, messages = tmp_path / "m.fmu", []
    pg.write_fmu(load("pendulum"), path, platforms=HERE)
    folder = fmpy.extract(str(path))
    described = fmpy.read_model_description(str(path))
    from fmpy.fmi3 import FMU3Slave, printLogMessage

    def made(token):
        fmu = FMU3Slave(guid=token, unzipDirectory=folder,
                        modelIdentifier=described.coSimulation.modelIdentifier)  # fmt: skip
        fmu.instantiate(loggingOn=True)

    assert callable(printLogMessage)
    with pytest.raises(Exception, match=r"instantiate"):
        made("another token")
    place = os.path.join(folder, "resources", "model.bin")
    with open(place, "r+b") as file:
        file.seek(500)
        file.write(b"\xff" * 8)
    with pytest.raises(Exception, match=r"instantiate"):
        made(described.guid)
    os.remove(place)
    with pytest.raises(Exception, match=r"instantiate"):
        made(described.guid)
    assert messages == []


def test_an_fmu_needs_the_c_library_alone(tmp_path):
    """No Python, no C++ runtime and no compiler: it names libc and libm at most."""
    path = tmp_path / "m.fmu"
    pg.write_fmu(load("pendulum"), path, platforms=["x86_64-linux"])
    with zipfile.ZipFile(path) as archive:
        content = archive.read("binaries/x86_64-linux/m.so")
        assert {"modelDescription.xml", "resources/model.bin"} <= {*archive.namelist()}
    known = (b"libc.so.6", b"libm.so.6", b"libpthread.so.0", b"libdl.so.2")
    others = (b"libstdc++", b"libgcc_s", b"libpython", b"libc++")
    assert [name for name in others if name in content] == []
    assert any(name in content for name in known)


def test_the_same_model_makes_the_same_bytes(tmp_path):
    for name in ("a.fmu", "b.fmu"):
        (tmp_path / name[0]).mkdir()
        pg.write_fmu(load("four_bar"), tmp_path / name[0] / "m.fmu", platforms=HERE)
    assert (tmp_path / "a/m.fmu").read_bytes() == (tmp_path / "b/m.fmu").read_bytes()


@pytest.mark.parametrize(
    ("unit", "found"),
    [("N m/rad", {"kg": 1, "m": 2, "s": -2, "rad": -1}), ("m/s²", {"m": 1, "s": -2}), ("1", {}),
     ("rad/s^2", {"rad": 1, "s": -2}), ("furlong", None)],
)  # fmt: skip
def test_units_have_their_base_units(unit, found):
    assert exponents(unit) == found


WRONG = [
    ({"version": 1}, "version", "3 or 2"),
    ({"kinds": ["other"]}, "kinds", "'cs'"),
    ({"kinds": ["me"], "scenario": "fall"}, "kinds", "no model exchange"),
]


@pytest.mark.parametrize(("given", "part", "allowed"), WRONG)
def test_wrong_calls_are_refused(given, part, allowed, tmp_path):
    with pytest.raises(pg.InputError) as refused:
        pg.write_fmu(load("falling_rod"), tmp_path / "m.fmu", **given)
    assert part in str(refused.value)
    assert allowed in str(refused.value)
    with pytest.raises(pg.FileError, match=r"\.fmu"):
        pg.write_fmu(load("pendulum"), tmp_path / "m.txt")


def test_the_command_line_writes_an_fmu_and_names_what_does_not_apply(tmp_path, capsys):
    from pgraph_app.cli.main import main

    path = str(tmp_path / "m.fmu")
    call = ["export", "four_bar", "-o", path, "--fmi", "2", "--kind", "cs", "--platform", HERE[0]]
    assert main([*call, "--open", "bodies.coupler.mass", "--json"]) == 0
    assert "bodies.coupler.mass" in capsys.readouterr().out
    assert fmpy.read_model_description(path).fmiVersion == "2.0"
    push = pg.Wrench(name="push", body="coupler", force=(1, 0, 0))
    load("four_bar").add(push).save(tmp_path / "pushed.json")
    call[1:2] = [str(tmp_path / "pushed.json")]
    assert main([*call, "--input", "push"]) == 0
    assert "'push.torque.z' is an input" in capsys.readouterr().out
    for more, part in ((["--live"], "--live"), (["--fps", "20"], "--fps")):
        assert main([*call, *more]) != 0
        assert part in capsys.readouterr().err
    assert main(["convert", path, str(tmp_path / "m.json")]) != 0
    assert "is an FMU" in capsys.readouterr().err
    assert main(["export", "four_bar", "-o", "a.html", "--fmi", "2"]) != 0
    assert "--fmi does not apply to a page" in capsys.readouterr().err
