"""The stepper: the states of `simulate` bit for bit, its snapshots, inputs and refusals."""

import copy
import pickle
from hashlib import sha256

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core import portable

from ..refusals import assert_names
from ..worlds import ball, box, built_in, on_ground


def chain(joint="revolute"):
    part = {"com": (0, -0.5, 0), "inertia": np.diag([0.1, 0.2, 0.3])}
    upper = pg.Body(name="upper", joint=joint, **part)
    lower = pg.Body(name="lower", parent="upper", link=(0, -1, 0), **part)
    return pg.Mechanism(pg.Model(bodies=[upper, lower], gravity=(0, -9.81, 0)))


CASES = [
    ("spherical", "rk4"), ("free", "semi_implicit_euler"), ("bricard", "rk4"),
    ("rolling_disc", "rk4"),
    ("four_bar", "gauss6"),
    ("falling_rod", "moreau_jean"), ("quadruped_hips", "moreau_jean"),
]  # fmt: skip


def case(name):
    if name in ("spherical", "free"):
        mech = chain(name)
        q, v = mech.home()
        return mech, {"q": q, "v": v + 0.3 * np.arange(1, mech.nv + 1)}
    return built_in(name), {"scenario": "trot"} if name == "quadruped_hips" else {}


@pytest.mark.parametrize(("name", "method"), CASES)
def test_same_bits_as_a_run(name, method):
    mech, given = case(name)
    run = pg.simulate(mech, t_end=0.25, step=1e-3, method=method, estimate=False, **given)
    single, many, parts = (pg.Stepper(mech, step=1e-3, method=method, **given) for _ in range(3))
    for k in range(250):
        single.step()
        if k % 11 == 0:
            assert np.isfinite(single.vdot).all()
            assert all(np.isfinite(f).all() for f in single.contact_force.values())
    many.step(n=250)
    pieces = [parts.record(100), parts.record(50, frames=6)]
    parts.step(n=50)
    last = parts.record(50)
    for stepper in (single, many, parts):
        assert np.array_equal(stepper.q, run.q[-1])
        assert np.array_equal(stepper.v, run.v[-1])
        assert stepper.t == pytest.approx(run.t[-1], abs=1e-15)
    assert np.array_equal(pieces[0].q, run.q[:101])
    assert np.array_equal(pieces[1].q, run.q[100:151:10])
    assert np.array_equal(last.q, run.q[200:])


@pytest.mark.parametrize(("name", "method"), CASES)
def test_a_snapshot_continues_with_the_same_bits(name, method):
    mech, given = case(name)
    stepper = pg.Stepper(mech, step=1e-3, method=method, **given)
    stepper.step(n=70)
    snapshot = stepper.save()
    copies = [pickle.loads(pickle.dumps(stepper)), copy.deepcopy(stepper)]
    stepper.step(n=70)
    q, v, t = stepper.q.copy(), stepper.v.copy(), stepper.t
    stepper.step(n=33)
    stepper.restore(snapshot)
    for one in (stepper, *copies):
        one.step(n=70)
        assert one.t == t
        assert np.array_equal(one.q, q)
        assert np.array_equal(one.v, v)


def test_torques_act_in_their_own_steps():
    """A rotor of inertia 2: v = Σ τ h / 2."""
    rotor = pg.Body(name="rotor", mass=1.0, inertia=2 * np.eye(3))
    stepper = pg.Stepper(pg.Model(bodies=[rotor]), step=0.01)
    for tau in ([4.0], None):
        stepper.step(tau=tau, n=10)
        assert stepper.v[0] == pytest.approx(0.2, rel=1e-12)
    stepper.record(3)
    stepper.step(tau=np.array([-4.0]), n=10)
    assert stepper.v[0] == pytest.approx(0.0, abs=1e-15)
    assert stepper.vdot[0] == pytest.approx(-2.0)


def test_a_torque_function_is_that_of_simulate():
    mech, q = chain(), np.array([0.4, -0.2])
    tau = lambda t, q, v: -3.0 * q - v * np.cos(t)  # noqa: E731
    run = pg.simulate(mech, q, t_end=0.1, step=1e-3, method="rk4", tau=tau)
    stepper = pg.Stepper(mech, q=q, tau=tau)
    stepper.step(n=100)
    assert np.array_equal(stepper.q, run.q[-1])


def test_a_servo_follows_its_target():
    model = chain().model.add(pg.Servo(name="knee", body="lower", kp=400.0, kd=40.0, target=0.0))
    stepper = pg.Stepper(model, step=1e-3)
    stepper.target("knee", 0.5)
    stepper.step(n=3000)
    assert abs(stepper.q[1] - 0.5) < 0.05
    assert pg.Stepper(model).mech.model == model
    with pytest.raises(pg.InputError, match="'elbow'"):
        stepper.target("elbow", 0.1)


def test_constraints_are_switched_between_steps():
    model = built_in("four_bar").model
    name = model.constraints[0].name
    options = {"t_end": 0.3, "step": 1e-3, "method": "rk4", "estimate": False}
    run = pg.simulate(model, switches=[(0.1, name, False)], **options)
    stepper = pg.Stepper(model, step=1e-3)
    assert set(stepper.constraint_force) == {c.name for c in model.constraints}
    stepper.step(n=100)
    stepper.switch(name, False)
    stepper.step(n=200)
    assert stepper.q == pytest.approx(run.q[-1], abs=1e-12)
    before, q = stepper.save(), stepper.q.copy()
    with pytest.raises(pg.InputError):  # it has swung far open
        stepper.switch(name, True)
    assert np.array_equal(stepper.q, q)
    assert stepper.save() == before


def test_a_scenario_that_switches_later_is_refused():
    model = built_in("four_bar").model
    off = pg.Switch(t=0.1, constraint=model.constraints[0].name, active=False)
    model = model.add(pg.Scenario(name="opens", switches=(off,)))
    with pytest.raises(pg.InputError, match=r"t = 0.1 .*switches="):
        pg.Stepper(model, scenario="opens")
    pg.Stepper(model, scenario="opens", switches=()).step()
    late = pg.Stepper(model, scenario="opens", t_start=0.2)
    late.step(n=50)
    assert np.abs(late.vdot).max() > 0.0


RESETS = {
    "double_pendulum": {}, "four_bar": {"method": "rk4"}, "bricard": {"method": "gauss6"},
    "rolling_disc": {}, "falling_rod": {}, "andrews": {"method": "dop853"}, "skate": {},
    "quadruped_hips": {}, "quadruped_muscles": {},
}  # fmt: skip


@pytest.mark.parametrize("name", RESETS)
def test_a_reset_leaves_nothing_of_the_steps_before(name):
    """Neither steps, inputs, switches, frames, other states nor failures: as a new stepper."""
    mech = built_in(name)
    new, used = (pg.Stepper(mech, step=1e-3, **RESETS[name]) for _ in range(2))
    used.step(n=30)
    used.record(5)
    for inputs in list(used.inputs)[:2]:
        used.input(inputs, 0.3)
    for constraint in mech.model.constraints:
        used.switch(constraint.name, active=not constraint.active)
        used.switch(constraint.name, active=constraint.active)
    used.step(0.1 + np.zeros(mech.nv), n=20)
    used.reset(new.q, 0.5 * new.v)
    used.step(n=10)
    for _ in range(2):  # the second time in the place of the first
        used.reset()
        assert used.inputs == new.inputs
        assert used._content() == new._content()
        assert (
            used.record(20).q.tobytes()
            == pg.Stepper(mech, step=1e-3, **RESETS[name]).record(20).q.tobytes()
        )
        used.step(n=30)
    new.step(n=30)
    used.reset()
    used.step(n=30)
    assert used._content() == new._content()


def test_a_reset_makes_no_tables_anew():
    """The work of a reset is that of copying back, which learning meets at each episode."""
    stepper = pg.Stepper(built_in("quadruped_hips"), step=1e-3, method="rk4")
    q, v = stepper.q.copy(), stepper.v.copy()
    for states in ([(), ()], [(q, v), (q + 1e-3 * np.arange(q.size), v), (q, -v)]):
        stepper.reset(*states[0])
        place = stepper.recording.scene, stepper.recording.steps
        for state in states[1:]:
            stepper.step(n=10)
            stepper.reset(*state)
            assert (stepper.recording.scene, stepper.recording.steps) == place


def test_reset_starts_again():
    stepper = pg.Stepper(built_in("falling_rod"), step=1e-3)
    assert stepper.method == "moreau_jean"
    q = stepper.q.copy()
    stepper.step(n=400)
    first = stepper.q.copy()
    stepper.reset()
    assert (stepper.t, stepper.q.tolist()) == (0.0, q.tolist())
    stepper.step(n=400)
    assert np.array_equal(stepper.q, first)
    assert pg.Stepper(chain()).method == "rk4"


def test_a_step_that_fails_is_not_taken():
    stepper = pg.Stepper(chain(), step=1e-3)
    stepper.step(n=5)
    q, t, snapshot = stepper.q.copy(), stepper.t, stepper.save()
    assert stepper.step(tau=np.full(2, 1e308), n=10) is pg.Status.NOT_FINITE
    assert not stepper.status.ok
    assert "t = " in stepper.message
    assert np.isfinite(stepper.q).all()
    with pytest.raises(pg.InputError, match="reset"):
        stepper.step()
    stepper.restore(snapshot)
    assert (stepper.t, stepper.q.tolist()) == (t, q.tolist())
    assert stepper.step().ok


@pytest.mark.parametrize(
    "advance",
    [
        lambda stepper: stepper.step(),
        lambda stepper: stepper.record(20),
        lambda stepper: stepper.record_over(0.02),
        lambda stepper: stepper.switch("c", False),
    ],
)
@pytest.mark.parametrize("fails", ["step", "record"])
def test_nothing_advances_a_stepper_that_failed(advance, fails):
    """A loop until a time would never end."""
    model = pg.Model.serial(2).add(pg.Gear(name="c", body="2", other="1", ratio=1.0))
    stepper = pg.Stepper(model, step=1e-3)
    snapshot, large = stepper.save(), np.full(2, 1e308)
    assert getattr(stepper, fails)(n=10, tau=large) is not pg.Status.DONE
    assert not stepper.status.ok
    with pytest.raises(pg.InputError) as refused:
        advance(stepper)
    assert_names(str(refused.value), stepper.message, "reset", "restore")
    stepper.restore(snapshot)
    advance(stepper)


def test_a_step_fails_as_a_run_does():
    mech, width = built_in("quadruped"), 1e-3
    tau = np.random.default_rng(0).normal(size=(2, mech.nv))[1] * 0.5
    run = pg.simulate(mech, scenario="stand", tau=tau, t_end=0.3, step=width, method="rk4")
    stepper = pg.Stepper(mech, scenario="stand", step=width)
    assert stepper.step(tau, n=300) is run.status is pg.Status.CANNOT_CLOSE
    assert stepper.message == run.message
    assert (stepper.t, stepper.q.tolist()) == (run.t[-1], run.q[-1].tolist())
    with pytest.raises(pg.InputError, match="failed"):
        stepper.step()


def test_notices_report_bodies_in_or_below_the_ground():
    air = {"scenarios": [pg.Scenario(name="air", contacts=())]}
    stepper = pg.Stepper(on_ground(ball("ball", (0, 0, 0.2)), model=air), scenario="air")
    assert stepper.notices == ()
    stepper.step(n=400)
    assert any("'ball'" in text and "ground" in text for text in stepper.notices)
    stepper = pg.Stepper(on_ground(box(place=(0, 0, 0.07))))
    for advance in (lambda: stepper.step(n=3), lambda: stepper.record(5)):
        advance()
        assert any("'floor'" in text for text in stepper.notices)


def test_a_scenario_gives_step_and_method_where_the_call_does_not():
    bob = pg.Body(name="bob", axes=(0, 1, 0), com=(0, 0, -1), inertia=0.1 * np.eye(3), q=1.0)
    own = {"step": 0.01, "t_end": 0.5}
    methods = {"euler": "semi_implicit_euler", "chosen": "dopri5"}
    scenarios = [pg.Scenario(name=name, method=method, **own) for name, method in methods.items()]
    model = pg.Model(bodies=[bob], scenarios=scenarios)
    run = pg.simulate(model, scenario="euler", estimate=False)
    one, many = pg.Stepper(model, scenario="euler"), pg.BatchStepper(model, 1, scenario="euler")
    for stepper in (one, many):
        stepper.step(n=50)
        assert stepper.method == "semi_implicit_euler"
        np.testing.assert_allclose(np.ravel(stepper.q), run.q[-1], rtol=1e-12)
    assert pg.Stepper(model, scenario="euler", step=0.02, method="rk4").method == "rk4"
    chosen = pg.Stepper(model, scenario="chosen")
    chosen.step(n=50)
    run = pg.simulate(model, scenario="chosen", step=0.01, estimate=False)
    assert chosen.method == run.header["method"] == "dopri5"
    assert np.array_equal(chosen.q, run.q[-1])
    hit = model.edit("bob", limits=((-1.0, 1.0),))
    assert pg.Stepper(hit, scenario="euler").method == "moreau_jean"
    for path in ("step", "t_end"):
        with pytest.raises(pg.InputError, match=path):
            pg.BatchStepper(model, 2, scenario="euler", set={f"scenarios.euler.{path}": [1, 2]})


RESTING = {"name": "ball", "joint": "free", "q": (0, 0, 0.5, 1, 0, 0, 0)}
STIFF = {"name": "x", "joint": "prismatic", "axes": (1, 0, 0), "q": 0.1, "damping": 1e5}


@pytest.mark.parametrize(
    ("body", "contact", "method"),
    [
        (RESTING, {}, "moreau_jean"),
        (RESTING, {"law": "soft", "stiffness": 1e4, "damping": 10.0}, "rk4"),
        (RESTING, {"law": "penalty", "stiffness": 1e4, "damping": 10.0}, "rk4"),
        (RESTING, None, "rk4"),
        ({**STIFF, "friction": 1.0}, None, "moreau_jean"),
        ({**STIFF, "stiffness": 1e8}, None, "radau5"),
    ],
    ids=str,
)
def test_all_calls_choose_the_same_method_for_a_step(body, contact, method):
    shape = pg.Shape(kind="sphere", radius=0.1)
    ball = pg.Body(mass=1.0, inertia=(0.004, 0.004, 0.004), shape=shape, **body)
    contacts = [] if contact is None else [pg.Contact(name="floor", body="ball", **contact)]
    mech = pg.Mechanism(pg.Model(bodies=[ball], contacts=contacts))
    run = pg.simulate(mech, t_end=0.4, step=1e-3, estimate=False)
    one, many = pg.Stepper(mech, step=1e-3), pg.BatchStepper(mech, 2, step=1e-3)
    one.step(n=400)
    many.step(n=400)
    assert run.header["method"] == one.method == many.method == method
    assert np.array_equal(one.q, run.q[-1])
    assert np.array_equal(many.q, [one.q, one.q])


@pytest.mark.parametrize("method", ["dopri5", "dop853", "radau5", "gauss6"])
@pytest.mark.parametrize("frames", [None, 2, 7])
def test_methods_that_can_choose_their_steps_take_given_ones(method, frames):
    """Frames divide the steps, as for all methods."""
    mech, start = chain(), [1.0, 0.5]
    run = pg.simulate(mech, start, t_end=0.6, step=0.01, method=method, frames=frames)
    stepper = pg.Stepper(mech, step=0.01, method=method, q=start)
    stepper.step(n=60)
    assert run.counters["steps"] == 60
    assert run.header["step"] == 0.01
    assert run.error_estimate < 1e-5
    assert np.array_equal(stepper.q, run.q[-1])


@pytest.mark.parametrize("method", ["radau5", "gauss6"])
def test_implicit_steps_do_not_depend_on_the_length_of_the_run(method):
    """Friction makes the equations of some steps so hard that steps are divided."""
    rod = {"mass": 1.0, "com": (0, 0, -0.5), "inertia": (0.1, 0.1, 0.01)}
    upper = pg.Body(name="upper", joint="revolute", axes=(0, 1, 0), friction=2.0, q=1.0, **rod)
    lower = pg.Body(name="lower", parent="upper", joint="revolute", axes=(0, 1, 0), **rod)
    mech = pg.Mechanism(pg.Model(bodies=[upper, lower]))
    short, long = (
        pg.simulate(mech, t_end=t, step=0.01, method=method, frames=2, estimate=False)
        for t in (0.3, 0.6)
    )
    stepper = pg.Stepper(mech, step=0.01, method=method)
    stepper.step(n=30)
    assert np.array_equal(stepper.q, short.q[-1])
    stepper.step(n=30)
    assert np.array_equal(stepper.q, long.q[-1])


def test_wrong_arguments_are_refused():
    mech = chain()
    stepper = pg.Stepper(mech)
    for wrong, words in [
        (lambda: pg.Stepper(mech, method="dop85"), "rk4"),
        (lambda: pg.Stepper(built_in("falling_rod"), method="dop853"), "moreau_jean"),
        (lambda: pg.Stepper(built_in("falling_rod"), method="rk4"), "moreau_jean"),
        (lambda: stepper.step(tau=np.zeros(3)), "tau"),
        (lambda: stepper.step(tau=[np.nan, 0.0]), "tau"),
        (lambda: stepper.step(n=0), "whole number"),
        (lambda: stepper.step(n=2.5), "whole number"),
        (lambda: stepper.reset(q=np.zeros(5)), "q"),
        (lambda: stepper.record(10, frames=1), "frames"),
        (lambda: stepper.restore(b"something"), "Stepper.save"),
        (lambda: stepper.restore(stepper.save()[:-8]), "damaged"),
        (lambda: stepper.restore(stepper.save()[:40]), "damaged"),
        (lambda: stepper.restore(pg.Stepper(mech, stabilise=None).save()), "options"),
        (lambda: stepper.restore(pg.Stepper(chain("spherical")).save()), "mechanism"),
        (lambda: stepper.restore(pg.Stepper(mech, step=2e-3).save()), "mechanism"),
    ]:
        with pytest.raises(pg.InputError) as refused:
            wrong()
        assert words in str(refused.value)
    with pytest.raises(ValueError, match="read-only"):
        stepper.q[0] = 1.0
    assert stepper.step().ok


@pytest.mark.parametrize("kind", [pg.Stepper, pg.BatchStepper])
def test_a_damaged_snapshot_or_one_of_another_version_is_refused(kind, monkeypatch):
    stepper = kind(chain(), **({"size": 3} if kind is pg.BatchStepper else {}))
    saved, rng = stepper.save(), np.random.default_rng(0)
    for i in rng.integers(len(saved), size=60).tolist():
        damaged = bytearray(saved)
        damaged[i] ^= 1 << int(rng.integers(8))
        with pytest.raises(pg.InputError, match=rf"damaged|{kind.__name__}\.save"):
            stepper.restore(bytes(damaged))
    assert stepper.save() == saved
    monkeypatch.setattr("pgraph_core.portable.installed", lambda: "9.9")
    with pytest.raises(pg.InputError, match=r"9\.9"):
        stepper.restore(saved)


@pytest.mark.parametrize("kind", [pg.Stepper, pg.BatchStepper])
@pytest.mark.parametrize("value", [2**62, -1])
def test_a_snapshot_with_a_forged_word_and_its_digest_made_right_is_refused(kind, value):
    """Kernels trust the numbers of a snapshot, so only one that this user saved is taken."""
    stepper = kind(chain(), **({"size": 3} if kind is pg.BatchStepper else {}))
    stepper.step()
    saved = stepper.save()
    magic = f"pgraph {kind.__name__} ".encode()
    for size in (16, 32):  # of a digest
        for k in range(len(magic) + size, len(saved) - 7, 8):
            content = saved[len(magic) + size :]
            at = k - len(magic) - size
            content = content[:at] + (value % 2**64).to_bytes(8, "little") + content[at + 8 :]
            with pytest.raises(pg.InputError, match="another user"):
                stepper.restore(magic + sha256(content).digest()[:size] + content)
    assert stepper.save() == saved


def test_snapshots_are_of_one_user_and_pickles_of_any(tmp_path, monkeypatch):
    stepper = pg.Stepper(chain())
    saved, pickled = stepper.save(), pickle.dumps(stepper)
    for folder in (tmp_path, None):  # of another user; one that has none
        for kind in (pg.Stepper, pg.BatchStepper):
            monkeypatch.setattr(kind, "_folder", lambda _, it=folder: it)
        with pytest.raises(pg.InputError, match="another user"):
            stepper.restore(saved)
        assert np.array_equal(pickle.loads(pickled).q, stepper.q)
        stepper.restore(stepper.save())
        pg.BatchStepper(chain(), 2).restore(pg.BatchStepper(chain(), 2).save())
    assert [path.name for path in tmp_path.iterdir()] == [portable.KEY]
    assert (tmp_path / portable.KEY).stat().st_mode & 0o077 == 0


def test_inputs_are_taken_together_or_not_at_all_within_bounds():
    arm = pg.Body(name="arm", com=(1, 0, 0))
    servo = pg.Servo(name="servo", body="arm", kp=10.0, kd=1.0, input_low=-1, input_high=1)
    motor = pg.Motor(name="motor", body="arm", torque=1.0, input_low=0, input_high=2)
    model = pg.Model(bodies=[arm], forces=[servo, motor])
    stepper = pg.Stepper(model)
    before = stepper.inputs
    for inputs in ({"motor": 1.5, "servo": 9.0}, {"motor": 1.5, "serv": 0.0}, [1.0]):
        with pytest.raises(pg.InputError):
            stepper.step(inputs=inputs)
        assert stepper.inputs == before
    for one, targets in ((stepper, 3.0), (pg.BatchStepper(model, 2), [0.0, 3.0])):
        with pytest.raises(pg.InputError, match=r"-1 .*1.*3"):
            one.target("servo", targets)
    with pytest.raises(pg.ModelError, match="lag"):
        pg.Servo(name="slow", body="arm", kp=1.0, start=0.3)
