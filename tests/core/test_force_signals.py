"""Forces of contacts and constraints as signals: samples and conditions read what a run records."""

import numpy as np
import pytest

import pgraph_core as pg
from tests.refusals import assert_names

Z = (0, 0, 1)
WAYS = [{"rtol": 1e-9}, {"method": "rk4", "step": 1e-3}, {"method": "radau5", "rtol": 1e-8}]
ENTRIES = ("", "[1]", "[2]", "[3]")


def samples(name, every=0.01, entries=ENTRIES):
    return [
        pg.Sampled(name=f"F{k}", update=f"=force.{name}{entry}", sample=every)
        for k, entry in enumerate(entries)
    ]


def two_links(controls=(), **fields):
    arm = pg.Body(name="arm", axes=[Z], mass=2.0, com=(0.5, 0, 0), inertia=(0.1, 0.1, 0.2))
    tip = pg.Body(
        name="tip", parent="arm", joint="prismatic", axes=[(1, 0, 0)], mass=1.0, com=(0.3, 0, 0),
        inertia=(0.1, 0.1, 0.1), link=(1, 0, 0),
    )  # fmt: skip
    fields = {"constraints": [pg.Weld(name="hold", body="tip", other="arm")], **fields}
    return pg.Model(bodies=[arm, tip], gravity=(0, -9.81, 0), controls=controls, **fields)


def dropped(controls=(), law="complementarity", height=0.1, **fields):
    """A ball above the ground, with a drive that nothing hinders."""
    ball = pg.Body(
        name="ball", joint="prismatic", axes=[Z], mass=2.0, q=[height],
        shape=pg.Shape(kind="sphere", radius=0.1),
    )  # fmt: skip
    law = {"law": law, **({"stiffness": 1e5, "damping": 10.0} if law == "soft" else {})}
    contacts = [pg.Contact(name="floor", body="ball", **law)]
    return pg.Model(
        bodies=[ball], contacts=contacts, controls=controls, **fields
    )  # fmt: skip


def read(run):
    return np.array([run.controls[f"F{k}"] for k in range(4)])


def recorded(force):
    return np.vstack((np.linalg.norm(force[:, 3:], axis=1), force[:, 3:].T))


@pytest.mark.parametrize("how", WAYS)
@pytest.mark.parametrize("every", [0.01, 0.02])
def test_a_sample_reads_the_force_of_a_constraint_at_its_instant(how, every):
    run = pg.simulate(two_links(samples("hold", every)), t_end=0.4, frames=21, q=[0.4, 0.0], **how)
    assert np.array_equal(read(run), recorded(run.constraint_force["hold"]))
    assert np.ptp(run.controls["F0"]) > 1.0


def test_a_constraint_that_is_off_has_no_force():
    off = [pg.Weld(name="hold", body="tip", other="arm", active=False)]
    run = pg.simulate(two_links(samples("hold"), constraints=off), t_end=0.1, step=1e-3)
    assert not read(run).any()
    run = pg.simulate(
        two_links(samples("hold")), q=[0.4, 0.0], t_end=0.4, frames=41, step=1e-3, method="rk4",
        switches=[(0.195, "hold", False)],
    )  # fmt: skip
    assert (run.controls["F0"][:20] > 0).all()
    assert not run.controls["F0"][21:].any()


@pytest.mark.parametrize("law", ["complementarity", "soft"])
def test_a_sample_reads_the_force_of_a_contact(law):
    model = dropped(samples("floor"), law, height=0.1)
    run = pg.simulate(model, t_end=0.5, frames=51, step=1e-3)
    found, force = read(run), run.contacts.force["floor"]
    assert np.array_equal(found[:, 1:], recorded(force)[:, 1:])
    assert abs(found[0, -1] - 2 * 9.81) < 1e-2  # it rests


def test_a_force_at_rest_is_the_weight_for_every_step():
    for step in (1e-4, 1e-3, 1e-2):
        run = pg.simulate(dropped(samples("floor", 0.02)), t_end=0.2, step=step)
        assert abs(run.controls["F3"][-1] - 19.62) < 1e-6


def test_forces_feed_back_through_samples():
    """A drive carries the part of the weight that a sensor has felt under the body."""
    push = pg.Wrench(name="push", body="ball", force=[0, 0, "=0.5*x.F0"])
    run = pg.simulate(dropped(samples("floor"), forces=[push]), t_end=1.0, step=1e-3)
    assert abs(run.controls["F0"][-1] - 19.62 / 1.5) < 1e-3  # the fixed point of F = m g - F/2
    assert abs(run.q[-1, 0] - 0.1) < 1e-6


@pytest.mark.parametrize("method", ["rk4", "semi_implicit_euler", "gauss6"])
def test_runs_steppers_and_batches_have_the_same_bits(method):
    feed = pg.Motor(name="push", body="arm", torque="=-0.1*x.F0 + x.pid")
    pid = pg.PID(
        name="pid", signal="=force.hold[2]", setpoint=3.0, kp=0.1, ki=2.0, kd=0.01, filter=0.05,
        sample=0.02,
    )  # fmt: skip
    model = two_links([*samples("hold"), pid], forces=[feed])
    run = pg.simulate(model, t_end=0.2, q=[0.4, 0.0], frames=201, step=1e-3, method=method)
    stepper = pg.Stepper(model, step=1e-3, method=method, q=[0.4, 0.0])
    batch = pg.BatchStepper(model, 3, step=1e-3, method=method)
    batch.reset(q=[[0.4, 0.0]] * 3)
    for i in range(1, 201):
        stepper.step()
        batch.step()
        assert np.array_equal(stepper.states, run.states[i])
        assert np.array_equal(batch.states, np.tile(run.states[i], (3, 1)))
    assert np.array_equal(stepper.q, run.q[-1])


@pytest.mark.parametrize("method", ["rk4", "semi_implicit_euler"])
def test_figures_and_sweeps_have_the_same_bits(method):
    """The memory that a figure takes over, stepped by the kernels that the module has too."""
    from pgraph_core.live.run import LiveRun, Setup

    feed = pg.Motor(name="push", body="arm", torque="=-k*x.F0")
    model = two_links(samples("hold"), forces=[feed], parameters={"k": 0.1}).edit("arm", q=[0.4])
    call = {"step": 1e-2, "method": method, "t_end": 0.5}
    run = pg.simulate(model, frames=51, **call)
    live = LiveRun(pg.Mechanism(model), Setup(step=1e-2), method)
    live.record.steps.advance(50)
    assert np.array_equal(live.record.steps.v, np.append(run.v[-1], run.states[-1]))
    last = {"last": lambda run: float(run.states[-1, 0])}
    swept = pg.sweep(model, {"k": [0.0, 0.1, 0.2]}, last, **call)
    assert np.asarray(swept["last"])[1] == run.states[-1, 0]


@pytest.mark.parametrize("threshold", [15.0, 18.0])
def test_a_latch_opens_at_a_force_and_a_position(threshold):
    """The pendulum's pull on its latch grows as it falls, and the latch opens at the first time at
    which both hold.
    """
    switches = [
        {
            "constraint": "hold", "active": False,
            "when": {"holds": f"=force.hold > {threshold} and q.arm < -0.5"},
        }
    ]  # fmt: skip
    model = two_links(scenarios=[pg.Scenario(name="s", switches=switches)])
    run = pg.simulate(model, scenario="s", t_end=1.0, rtol=1e-10)
    free = pg.simulate(two_links(), t_end=1.0, rtol=1e-10, frames=20001)
    force = np.linalg.norm(free.constraint_force["hold"][:, 3:], axis=1)
    first = free.t[np.argmax((force > threshold) & (free.q[:, 0] < -0.5))]
    (event,) = run.events
    assert abs(event.t - first) < 1e-4


LOOPS = [
    ({"forces": [pg.Motor(name="push", body="arm", torque="=force.hold")]}, ["push", "force.hold"]),
    ({"controls": [pg.Filter(name="soft", input="=force.hold", lag=0.1)]}, ["soft", "force.hold"]),
    ({"controls": [pg.PID(name="pid", signal="=force.hold", kp=1.0)]}, ["pid", "force.hold"]),
]
UNKNOWN = [("=force.hald", ["hald", "hold"]), ("=force.hold[4]", ["hold", "4"])]


@pytest.mark.parametrize(("fields", "facts"), LOOPS)
def test_a_force_that_follows_from_what_reads_it_is_a_loop(fields, facts):
    with pytest.raises(pg.ModelError) as error:
        two_links(**fields)
    assert_names(str(error.value), *facts, "samples")


@pytest.mark.parametrize(("text", "facts"), UNKNOWN)
def test_unknown_forces_are_refused(text, facts):
    with pytest.raises(pg.ModelError) as error:
        two_links([pg.Sampled(name="F", update=text, sample=0.1)])
    assert_names(str(error.value), *facts)


@pytest.mark.parametrize("name", ["drag", "drive", "nothing"])
@pytest.mark.parametrize("of", ["motor", "sample"])
def test_a_force_without_a_contact_or_constraint_is_no_loop(of, name):
    """The name is wrong wherever it is read, and the message says what has it."""
    drag = pg.Drag(name="drag", body="arm", size=(0.1, 0.1, 0.1), density=1.2)
    drive = pg.Motor(name="drive", body="arm", torque=1.0)
    text, parts = f"=force.{name}", {"forces": [drag, drive]}
    if of == "motor":
        parts["forces"].append(pg.Motor(name="push", body="arm", torque=text))
    else:
        parts["controls"] = [pg.Sampled(name="F", update=text, sample=0.1)]
    with pytest.raises(pg.ModelError) as error:
        two_links(**parts)
    says = {"drag": "drag, whose force", "drive": "f.drive", "nothing": "hold"}
    assert_names(str(error.value), "no contact, constraint", f"'{name}'", says[name])
    assert "loop" not in str(error.value)


def test_units_of_forces_are_checked():
    with pytest.raises(pg.ModelError) as error:
        two_links([pg.Sampled(name="F", update="=force.hold + q.arm", sample=0.1)])
    assert_names(str(error.value), "N", "rad")


def test_forces_follow_names_and_go_with_what_exerts_them(tmp_path):
    model = two_links(samples("hold")).edit("hold", name="the weld")
    assert model.controls[1].update == '=force["the weld"][1]'
    model.save(tmp_path / "m.json")
    assert pg.load(tmp_path / "m.json") == model
    assert not model.remove("tip").controls


def test_rigid_contacts_are_signals_in_time_stepping():
    with pytest.raises(pg.InputError) as error:
        pg.simulate(dropped(samples("floor")), t_end=0.1, method="dopri5", rtol=1e-6)
    assert_names(str(error.value), "floor", "moreau_jean")
    assert pg.simulate(dropped(samples("floor")), t_end=0.1).status.ok


@pytest.mark.parametrize("when", [{"holds": "=force.floor > 1"}, {"force": "floor", "above": 1.0}])
def test_a_contact_and_a_constraint_of_one_name_have_no_force_of_that_name(when):
    hold = pg.Weld(name="floor", body="ball", active=False)
    switch = {"constraint": "floor", "active": True, "when": when}
    with pytest.raises(pg.ModelError) as error:
        dropped(constraints=[hold], scenarios=[pg.Scenario(name="s", switches=[switch])])
    assert_names(str(error.value), "'floor'", "contact", "constraint")


def test_a_force_is_zero_while_no_constraint_is_active():
    """The latch is released, and the second one waits until the first bears nothing."""
    wait = {"holds": "=force.hold < 1 and t > 0.25"}
    switches = [
        {"constraint": "hold", "active": False, "t": 0.5},
        {"constraint": "catch", "active": True, "when": wait},
    ]
    ties = [
        pg.Weld(name="hold", body="tip", other="arm"),
        pg.Weld(name="catch", body="arm", active=False),
    ]
    model = two_links(constraints=ties, scenarios=[pg.Scenario(name="s", switches=switches)])
    run = pg.simulate(model, scenario="s", q=[-1.0, 0.0], t_end=0.6, rtol=1e-9)
    assert np.allclose([event.t for event in run.events], 0.5, rtol=0, atol=1e-6)
