"""The C library has the bits of `simulate`, and says what it refuses."""

import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_core.native import library
from pgraph_core.native.image import READ, STATE, Exported, Wanted
from tests.native_runs import Instance, has_library, instance
from tests.nights import at_night

pytestmark = has_library
SMOOTH = ("rk4", "semi_implicit_euler", "dopri5", "dop853")
RODS = pg.Shape(kind="box", size=(0.5, 0.02, 0.02), position=(0.25, 0, 0))


def arm(**more):
    """Two rods with all kinds of inputs, and every output that travels."""
    upper = pg.Body(
        name="upper arm", axes=(0, 1, 0), mass=1.2, shape=RODS, derived=("com", "inertia")
    )
    hand = upper.model_copy(update={"name": "hand", "parent": "upper arm", "link": (0.5, 0, 0)})
    forces = [
        pg.Motor(name="drive", body="upper arm", torque=0.3, lag=more.pop("lag", 0.0)),
        pg.Servo(name="hold", body="hand", target=0.2, kp=4.0, kd=0.1, input_high=3.0),
        pg.LinearActuator(name="pull", body="hand", other="ground", point=(0.1, 0, 0),
                          other_point=(1.0, 0, 0.3), gain=2.0, force_high=3.0),
    ]  # fmt: skip
    outputs = [pg.Output(name=f"the {kind}", kind=kind, at="hand") for kind in READ]
    return pg.Model(bodies=[upper, hand], forces=forces, outputs=outputs, **more)


def final(model, t_end, **call):
    run = pg.simulate(model, t_end=t_end, estimate=False, **call)
    return np.concatenate((run.q[-1], run.v[-1])), run


def load(name):
    return pg.load(pgraph_models.path(name))


USUAL = ("double_pendulum", "four_bar", "falling_rod")
OTHERS = [name for name in pgraph_models.names() if name not in USUAL]


@pytest.mark.parametrize("name", [*USUAL, *at_night(*OTHERS)])
def test_the_library_has_the_bits_of_a_run(name):
    """With every method that the scene takes, in every scenario."""
    model, count = load(name), 120
    for scenario in (None, *(s.name for s in model.scenarios)):
        for method in (*SMOOTH, "moreau_jean"):
            try:
                exported = Exported(model, Wanted(method=method, scenario=scenario))
            except pg.InputError:  # with contacts moreau_jean alone, without them all others
                continue
            step, found = exported.setup.step, Instance(exported.content()).start()
            call = {"method": method, "step": step, "scenario": scenario}
            run = pg.simulate(model, t_end=count * step, estimate=False, **call)
            if not run.status.ok:
                with pytest.raises(ValueError, match="stopped at t ="):
                    found.call("step", count)
                continue
            found.call("step", count)
            np.testing.assert_array_equal(found.state, [*run.q[-1], *run.v[-1]])
            assert found.t == run.t[-1]


@pytest.mark.parametrize("method", ["rk4", "dop853"])
def test_inputs_parameters_and_outputs_have_the_bits_of_a_stepper(method):
    fields = ("bodies.hand.link.0", "forces.hold.kp", "gravity.2")
    found = instance(arm(), method=method, parameters=fields)
    found["bodies.hand.link.0"], found["forces.hold.kp"] = 0.6, 5.0
    found.start()
    changed = arm().edit({"bodies.hand.link.0": 0.6, "forces.hold.kp": 5.0})
    stepper = pg.Stepper(changed, step=1e-3, method=method)
    for u in (0.1, -0.4, 0.7):
        inputs = {"drive": u, "hold": 2 * u, "pull": 3 * u}
        for name, x in inputs.items():
            found[name] = x
        stepper.step(n=100, inputs=inputs)
        found.call("step", 100)
        np.testing.assert_array_equal(found.state, [*stepper.q, *stepper.v])
        for name, x in stepper.outputs.items():
            parts = [""] if np.ndim(x) == 0 else [f".{i}" for i in "wxyz"[-len(x) :]]
            np.testing.assert_array_equal([found[name + part] for part in parts], np.ravel(x))


def test_a_parameter_acts_through_what_the_model_derives_from_it():
    """The inertia of a solid is a multiple of its mass, to rounding; unchanged, it has its bits."""
    for mass in (1.2, 2.5):
        found = instance(arm(), parameters=["bodies.hand.mass"])
        found["bodies.hand.mass"] = mass
        found.start().call("step", 100)
        want, _ = final(arm().edit("bodies.hand.mass", mass), 0.1, step=1e-3, method="rk4")
        np.testing.assert_allclose(found.state, want, rtol=1e-12)
        assert mass != 1.2 or np.array_equal(found.state, want)


def test_a_drive_with_a_lag_follows_its_input_as_in_a_stepper():
    found, stepper = instance(arm(lag=0.05)).start(), pg.Stepper(arm(lag=0.05), step=1e-3)
    for u in (0.1, -0.4):
        found["drive"] = u
        stepper.step(n=50, inputs={"drive": u})
        found.call("step", 50)
        np.testing.assert_array_equal(found.state, [*stepper.q, *stepper.v])
    with pytest.raises(ValueError, match="starts at t = 0 s"):
        found.start(1.0)


def test_steps_that_do_not_divide_the_time_are_those_of_a_run():
    found = instance(load("double_pendulum")).start()
    found.call("advance", 0.0123)
    times = [0.0123]
    run = pg.simulate(load("double_pendulum"), t_eval=times, t_end=0.0123, step=1e-3, method="rk4",
                      estimate=False)  # fmt: skip
    np.testing.assert_array_equal(found.state, [*run.q[-1], *run.v[-1]])
    assert found.t == 0.0123


def test_chosen_steps_meet_their_tolerance_and_end_where_asked():
    model = load("double_pendulum")
    found = instance(model, rtol=1e-9).start()
    for _ in range(10):
        found.call("advance", 0.1)
    want, _ = final(model, 1.0, rtol=1e-12)
    assert abs(found.t - 1.0) <= 4 * np.finfo(float).eps
    np.testing.assert_allclose(found.state, want, atol=1e-7)


@pytest.mark.parametrize("case", [("quadruped_hips", "trot"), ("four_bar", "turn")])
def test_a_saved_state_repeats_the_motion_in_every_instance(case):
    """The state has no address, so two instances at different places have the same bytes."""
    name, scenario = case
    content = Exported(load(name), Wanted(scenario=scenario)).content()
    one, other = Instance(content).start(), Instance(content).start()
    one.call("step", 37)
    kept = one.save()
    one.call("step", 50)
    other.restore(kept)
    np.testing.assert_array_equal(other.save(), kept)
    other.call("step", 50)
    np.testing.assert_array_equal(other.state, one.state)
    np.testing.assert_array_equal(other.save(), one.save())
    one.restore(kept)
    one.call("step", 50)
    np.testing.assert_array_equal(other.state, one.state)


def test_instances_are_independent_in_threads():
    content = Exported(load("quadruped_hips"), Wanted(scenario="trot")).content()
    from concurrent.futures import ThreadPoolExecutor

    def ran(_):
        one = Instance(content).start()
        for _ in range(20):
            one.call("step", 2)
        return one.state

    with ThreadPoolExecutor(4) as pool:
        states = [*pool.map(ran, range(20))]
    assert all(np.array_equal(state, states[0]) for state in states)


# -- refusals --------------------------------------------------------------------------------------


def test_a_damaged_file_is_refused_with_the_reason():
    content = Exported(load("pendulum"), Wanted()).content()
    for place in (200, len(content) // 2, len(content) - 3):
        wrong = bytearray(content)
        wrong[place] ^= 1
        with pytest.raises(ValueError, match=r"damaged|another version|no file"):
            Instance(bytes(wrong))
    for wrong in (content[:-8], content[:100], b"", b"x" * 5000):
        with pytest.raises(ValueError, match=r"damaged|no file"):
            Instance(wrong)
    other = bytearray(content)
    other[16:24] = b"otherone"
    with pytest.raises(ValueError, match=r"another version of Pgraph"):
        Instance(bytes(other))


def test_wrong_calls_of_the_library_are_refused_with_the_variable_and_the_bounds():
    found = instance(arm(), parameters=["forces.hold.kp=1:9"])
    with pytest.raises(ValueError, match="not been started"):
        found.call("step", 1)
    with pytest.raises(ValueError, match=r"'forces.hold.kp' must be from 1 to 9, given 10"):
        found["forces.hold.kp"] = 10.0
    found.start()
    for name, value, text in (
        ("forces.hold.kp", 2.0, "before the start"),
        ("hold", 4.0, "'hold' must be from -inf to 3, given 4"),
        ("drive", np.nan, "'drive' must be a finite number"),
        ("the gyro.x", 1.0, "'the gyro.x' is computed"),
        ("nothing", 1.0, "no variable has the number -1"),
    ):
        with pytest.raises(ValueError, match=text):
            found[name] = value
    for name, value in (("step", 0), ("advance", -1.0), ("advance", np.inf)):
        with pytest.raises(ValueError, match=r"at least 1|> 0 s"):
            found.call(name, value)


WRONG = [
    ({"method": "radau5"}, "radau5", "rk4"),
    ({"method": "rk4", "rtol": 1e-6}, "rtol", "rk4"),
    ({"step": -1.0}, "step", "-1"),
    ({"inputs": ["nobody"]}, "nobody", "drive"),
    ({"outputs": ["nobody"]}, "nobody", "the gyro"),
    ({"inputs": "drive"}, "inputs", "['NAME']"),
    ({"parameters": ["bodies.hand.damping.0=0:1"]}, "bodies.hand.damping.0", "sizes of its tables"),
    ({"platforms": ["vax"]}, "vax", "x86_64-linux"),
    ({"platforms": []}, "platforms", "x86_64-linux"),
]


@pytest.mark.parametrize(("given", "part", "allowed"), WRONG)
def test_what_cannot_travel_is_refused_and_nothing_is_written(given, part, allowed, tmp_path):
    for write in (partial(pg.write_c, arm()), partial(pg.write_fmu, arm())):
        path = tmp_path / "arm.fmu"
        with pytest.raises(pg.InputError) as refused:
            write(path, **given)
        assert part in str(refused.value)
        assert allowed in str(refused.value)
        assert not path.exists()


def test_an_output_that_does_not_travel_is_left_out_or_refused(tmp_path):
    touch, load_ = (pg.Output(name="felt", kind=kind, at="coupler") for kind in ("touch", "force"))
    for model, kind in (
        (load("four_bar").add(touch), "touch"),
        (load("four_bar").add(load_), "loops"),
    ):
        report = pg.write_c(model, tmp_path / "out")
        assert any("felt" in str(line) and kind in str(line) for line in report.of("left out"))
        with pytest.raises(pg.InputError, match=kind):
            pg.write_c(model, tmp_path / "other", outputs=["felt"])


def test_wrenches_are_inputs_and_joints_pass_on_what_acts_on_bodies():
    push = pg.Wrench(name="push", body="hand", force=(0.5, 0, 0), point=(0.3, 0, 0), frame="body")
    line = pg.Spring(name="line", body="hand", other="ground", stiffness=20.0, rest=0.1)
    model = arm().add(push).add(line)
    found = instance(model, inputs=("push",)).start()
    stepper = pg.Stepper(model, step=1e-3, method="rk4")
    for force, torque in (((0.5, 0, 0), (0, 0, 0)), ((0.5, -2.0, 3.0), (0, 0.4, 0))):
        for i, axis in enumerate("xyz"):
            found[f"push.force.{axis}"], found[f"push.torque.{axis}"] = force[i], torque[i]
        changed = model.edit("push", force=force, torque=torque)
        stepper = pg.Stepper(changed, step=1e-3, method="rk4", q=stepper.q, v=stepper.v)
        found.call("step", 100)
        stepper.step(n=100)
        np.testing.assert_allclose(found.state, [*stepper.q, *stepper.v], rtol=1e-12)
        for name in ("the force", "the torque"):
            got = [found[f"{name}.{axis}"] for axis in "xyz"]
            np.testing.assert_allclose(got, stepper.outputs[name], rtol=1e-10, atol=1e-10)


def test_a_loop_that_is_open_at_first_begins_closed_as_in_a_run():
    model = load("four_bar").edit("coupler", q=load("four_bar").body("coupler").q[0] + 1e-3)
    found = instance(model).start()
    run = pg.simulate(model, t_end=0.1, step=1e-3, method="rk4", estimate=False)
    assert abs(run.q[0, 1] - model.body("coupler").q[0]) > 1e-6
    found.call("step", 100)
    np.testing.assert_allclose(found.state, [*run.q[-1], *run.v[-1]], atol=1e-12)


def test_joint_friction_begins_as_in_a_run():
    """The trial step of a run for the forces of its first frame leaves no guess behind."""
    rods = {"axes": (0, 1, 0), "shape": RODS, "mass": 1.2, "derived": ("com", "inertia"),
            "friction": (0.3,), "damping": (0.1,), "limits": ((-1.0, 1.0),)}  # fmt: skip
    bodies = [pg.Body(name="b0", **rods)]
    for k in range(3):
        bodies.append(pg.Body(name=f"b{k + 1}", parent=f"b{k}", link=(0.5, 0, 0), **rods))
    model = pg.Model(bodies=bodies)
    want, _ = final(model, 0.02, step=1e-3, method="moreau_jean")
    found = instance(model).start()
    found.call("step", 20)
    np.testing.assert_array_equal(found.state, want)


def test_a_folder_names_the_functions_of_its_dll(tmp_path):
    """Visual Studio makes its import library from them."""
    pg.write_c(pg.Model.serial(1), tmp_path, platforms=["x86_64-windows"])
    head, _, *names = (tmp_path / "x86_64-windows" / "pgraph.def").read_text().split("\n")[:-1]
    content = (tmp_path / "x86_64-windows" / "pgraph.dll").read_bytes()
    assert head == "LIBRARY pgraph.dll"
    assert len(names) == (tmp_path / "pgraph.h").read_text().count("\nPGRAPH_API ")
    assert [name for name in names if name.strip().encode() + b"\0" not in content] == []


def test_names_that_coincide_are_told_apart_or_refused(tmp_path):
    model = arm().add(pg.Output(name="hand", kind="joint_position", at="hand"))
    names = [one.name for one in Exported(model, Wanted()).variables]
    assert "outputs.hand" in names
    assert len(names) == len({*names})
    clash = model.add(pg.Output(name="outputs.hand", kind="joint_velocity", at="hand"))
    order = clash.replace(outputs=clash.outputs[::-1])
    with pytest.raises(pg.InputError, match=r"'outputs\.hand'"):
        Exported(order, Wanted())


def test_the_examples_of_a_folder_run(tmp_path):
    """The one in Python here, that in C where there is a compiler."""
    import shutil

    pg.write_c(arm(), tmp_path, platforms=[library.here()])
    done = subprocess.run([sys.executable, "-S", "example.py"], cwd=tmp_path, capture_output=True,
                          text=True, check=True)  # fmt: skip
    rows = done.stdout.splitlines()
    want, _ = final(arm(), 1.0, step=1e-3, method="rk4")
    assert rows[0].startswith("time,upper arm,hand,v.upper arm,v.hand,")
    np.testing.assert_array_equal(np.array(rows[-1].split(",")[1:5], float), want)
    if (compiler := shutil.which("cc")) is None:
        return
    place = str(tmp_path / library.here() / library.PLATFORMS[library.here()].file)
    call = [compiler, "-std=c11", "-Wall", "-Werror", "example.c", place, "-o", "example"]
    subprocess.run(call, cwd=tmp_path, check=True)
    again = subprocess.run(["./example"], cwd=tmp_path, env={}, capture_output=True, text=True,
                           check=True)  # fmt: skip
    assert again.stdout == done.stdout


def sanitized(folder, *sources):
    """Compile a program with the library, which reports wrong addresses, leaks and undefined
    behaviour."""
    import shutil

    from pgraph_core.native import __main__ as build

    if (compiler := shutil.which("gcc")) is None or library.here() != "x86_64-linux":
        pytest.skip("gcc is not installed")
    code = build.object_of(build.bitcode(), library.PLATFORMS["x86_64-linux"])
    (folder / "kernels.o").write_bytes(code)
    digest = f'const char kernels_digest[] = "{library.kernels_digest()}";'
    text = f"extern const char kernels_digest[];\n{digest}\n"
    (folder / "digest.c").write_text(text)
    all_ = [*map(str, library.SOURCES.glob("*.c")), *map(str, sources)]
    call = [compiler, "-std=c2x", "-include", "stdbool.h", "-g", "-O1", "-Wall", "-Wextra",
            "-fsanitize=address,undefined", "-fno-sanitize-recover=all", f"-I{library.SOURCES}",
            *all_, "digest.c", "kernels.o", "-o", "run", "-lm"]  # fmt: skip
    subprocess.run(call, cwd=folder, check=True)


@pytest.mark.nightly
def test_the_functions_of_fmi_pass_the_sanitizers(tmp_path):
    """Both kinds of FMI 3 from the first call to the last: states, derivatives, events, reset."""
    sanitized(tmp_path, Path(__file__).with_name("fmi_driver.c"))
    for name, scenario in (
        ("double_pendulum", None),
        ("quadruped_hips", "trot"),
        ("four_bar", "turn"),
    ):
        exported = Exported(load(name), Wanted(scenario=scenario, rates=scenario is None))
        content = exported.content()
        (tmp_path / "model.bin").write_bytes(content)
        token = f"{int.from_bytes(content[-8:], 'little'):016x}"
        numbers = [k for k, one in enumerate(exported.variables) if one.kind == STATE]
        call = ["./run", token, str(numbers[0]), str(numbers[-1]), str(len(numbers))]
        done = subprocess.run(call, cwd=tmp_path, capture_output=True, text=True)
        assert (done.returncode, done.stderr) == (0, "")
        # a wrong token, and in each of two rounds a state that is cut
        assert ["belongs to" in line for line in done.stdout.splitlines()] == [True, False, False]


@pytest.mark.nightly
def test_the_c_files_pass_the_sanitizers(tmp_path):
    """Contacts, loops, controls and saved states, and a file that is cut."""
    sanitized(tmp_path, library.HERE / "examples" / "example.c")
    for name, scenario in (("four_bar", "turn"), ("quadruped_hips", "trot"), ("heavy_top", None),
                           ("quadruped_muscles", "step")):  # fmt: skip
        content = Exported(load(name), Wanted(scenario=scenario)).content()
        (tmp_path / "model.bin").write_bytes(content)
        done = subprocess.run(["./run"], cwd=tmp_path, capture_output=True, text=True)
        assert (done.returncode, done.stderr) == (0, "")
        (tmp_path / "model.bin").write_bytes(content[:-16])
        done = subprocess.run(["./run"], cwd=tmp_path, capture_output=True, text=True)
        assert (done.returncode, "damaged" in done.stderr) == (1, True)


def test_c_has_no_more_than_1500_lines():
    assert (
        sum(len(path.read_text().splitlines()) for path in library.SOURCES.glob("*.[ch]")) <= 1500
    )


def test_the_libraries_are_of_these_sources():
    """The lead makes them again after a change of kernels: python -m pgraph_core.native."""
    assert [text for name in library.about()["sources"] if (text := library.stale(name))] == []
    assert library.here() in library.about()["sources"]
