"""Controls beside a gait: phases of feet as signals, and what they drive."""

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from tests.refusals import assert_names

QUADRUPED = pg.Model.load(pgraph_models.path("quadruped_hips"))
FEET = [contact.name for contact in QUADRUPED.contacts if contact.name.endswith("foot")]
EVERY = 0.005  # [s]
SWING, ACCEPTANCE, STANCE = 0, 1, 2
FULL = 100.0  # [N] load from which a foot stands


def phase(foot):
    """A state machine of a foot: it accepts weight until it bears `FULL`, and then stands."""
    accepts = f"force.{foot} < {FULL} and x.{foot} < 1.5"
    return pg.Sampled(
        name=foot, update=f"=if(force.{foot} > 0, if({accepts}, 1, 2), 0)", sample=EVERY
    )


def phased(*, feet=FEET, torque="=if(x.left_front_foot > 1.5, -2, 2)"):
    nod = pg.Motor(name="nod", body="shoulder_neck_head", torque=torque)
    return QUADRUPED.replace(controls=map(phase, feet), forces=[*QUADRUPED.forces, nod])


def walked(model, scenario="trot", t_end=0.8, **call):
    times = np.arange(round(t_end / EVERY) + 1) * EVERY
    return pg.simulate(model, scenario=scenario, t_end=t_end, t_eval=times, **call)


def expected(load):
    """The phases that follow from the loads of a foot at its samples."""
    found, now = [], SWING
    for force in load.tolist():
        accepts = force < FULL and now < STANCE
        now = SWING if not force > 0 else ACCEPTANCE if accepts else STANCE
        found.append(now)
    return found


@pytest.mark.parametrize("scenario", ["trot", "crawl", "gallop", "stand"])
def test_a_state_machine_follows_the_phases_of_a_walk(scenario):
    """Frames around the last step before a sample have the force that the sample reads."""
    step = 1e-3
    samples = np.arange(1, 161) * EVERY
    times = np.append(0.0, np.stack((samples - step, samples), axis=1))
    run = pg.simulate(phased(), scenario=scenario, t_end=0.8, t_eval=times, step=step)
    assert run.status.ok
    assert not np.isnan(run.error_estimate)
    for foot in FEET:
        load = np.linalg.norm(run.contacts.force[foot][2::2, 3:], axis=1)
        found = run.controls[foot][2::2]
        assert found.tolist() == expected(load)
        bears = np.isin(run.phases[foot][2::2], ("stance", "slip", "weight acceptance"))
        assert (bears == (found > 0)).mean() > 0.97  # forces are means of steps
    phases = set(np.concatenate([run.controls[foot] for foot in FEET]))
    assert phases >= ({ACCEPTANCE} if scenario == "stand" else {SWING, ACCEPTANCE, STANCE})


def test_what_a_phase_drives_acts_beside_the_gait():
    """A reflex of the neck is the torque that the walk gets, and it changes the motion."""
    run, still = walked(phased()), walked(phased(torque="=0*x.left_front_foot"))
    bare = walked(QUADRUPED)
    assert np.array_equal(still.q, bare.q)  # measuring changes nothing
    stands = run.controls["left_front_foot"] > 1.5
    assert 0.2 < stands.mean() < 0.8
    at = run.mechanism.joints["shoulder_neck_head"].q.start
    assert np.abs(run.q[:, at] - bare.q[:, at]).max() > 1e-3
    assert abs(run.q[-1, 0] - bare.q[-1, 0]) < 0.1  # it walks on


@pytest.mark.parametrize("count", [1, 4])
def test_walks_in_pieces_steppers_and_batches_have_the_same_bits(count):
    model = phased(feet=FEET[:count], torque="=-2*x.left_front_foot")
    run = walked(model, t_end=0.4, step=1e-3, method="moreau_jean")
    stepper = pg.Stepper(model, scenario="trot", step=1e-3)
    batch = pg.BatchStepper(model, 2, scenario="trot", step=1e-3)
    walk = pg.Walk(model, "trot")
    parts = [walk.step(0.05) for _ in range(8)]
    for one in (stepper, batch):
        one.step(n=400)
        assert np.array_equal(np.atleast_2d(one.q)[-1], run.q[-1])
        assert np.array_equal(np.atleast_2d(one.states)[-1], run.states[-1])
    assert np.array_equal(parts[-1].q[-1], run.q[-1])
    assert np.array_equal(parts[-1].states[-1], run.states[-1])


def test_a_figure_walks_as_a_run():
    """The memory that a figure takes over, stepped by the kernels that the module has too."""
    from pgraph_core.live.run import LiveRun, Setup

    model = phased(torque="=-2*x.left_front_foot")
    live = LiveRun(pg.Mechanism(model), Setup(scenario="trot", step=1e-3), "moreau_jean")
    live.record.steps.advance(200)
    run = walked(model, t_end=0.2, step=1e-3, method="moreau_jean")
    assert np.array_equal(live.record.steps.v, np.append(run.v[-1], run.states[-1]))


def test_controls_go_on_through_changes_of_a_walk():
    count = pg.Sampled(name="count", update="=x.count + 1", sample=0.01)
    time = pg.State(name="time", rate=1.0)
    walk = pg.Walk(QUADRUPED.replace(controls=[count, time]), "trot")
    for change in (lambda: walk.push((0, 0, 40.0), 0.03), lambda: walk.change(speed=0.7)):
        walk.step(0.1)
        change()
    run = walk.step(0.1)
    assert run.controls["count"][-1] == 31
    assert abs(run.states[-1, 1] - 0.3) < 1e-12


def test_a_phase_cannot_act_at_once_on_what_it_follows_from():
    with pytest.raises(pg.ModelError) as error:
        phased(torque="=if(force.left_front_foot > 0, 1, 0)")
    assert_names(str(error.value), "'nod'", "force.left_front_foot", "samples")
