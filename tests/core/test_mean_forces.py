"""With time stepping, the forces of frames are means: they add up to the change of momentum."""

import numpy as np
import pytest

import pgraph_core as pg

from ..nights import combined
from ..worlds import ball, box, on_ground

G = 9.81


def impulse(run, force):
    """Sum of force times interval over the frames after the first."""
    return (force[1:] * np.diff(run.t)[:, None]).sum(axis=0)


def gained(run, body, mass=1.0):
    """The change of momentum of a body without that due to its weight."""
    change = mass * (run.velocity[body][-1] - run.velocity[body][0])
    return change + mass * np.array((0.0, 0.0, G * (run.t[-1] - run.t[0])))


def balanced(run, force, body, mass=1.0):
    """Return True if the forces on a body add up to its change of momentum, to 1e-9."""
    return np.allclose(impulse(run, force), gained(run, body, mass), rtol=1e-9, atol=1e-9)


def bouncing(law="complementarity", restitution=0.5, mass=1.0):
    thrown = ball(place=(0, 0, 0.6), v=(0, 0, 0, 0.3, 0, 0), mass=mass)
    return on_ground(thrown, restitution=restitution, friction=0.3, law=law)


@pytest.mark.parametrize(
    ("given", "restitution"),
    combined(
        [
            {},
            {"step": 1e-2},
            {"step": 1e-4},
            {"step": 1e-3, "frames": 7},
            {"step": 3e-3, "frames": 90},
        ],
        [0.0, 0.5, 1.0],
    ),
)
def test_contact_forces_add_up_to_the_momentum_for_any_step_and_frames(given, restitution):
    run = pg.simulate(bouncing(restitution=restitution), t_end=1.0, estimate=False, **given)
    assert run.header["method"] == "moreau_jean"
    assert balanced(run, run.contact_force["floor"][:, 3:], "b")


@pytest.mark.parametrize("law", ["soft", "penalty"])
@pytest.mark.parametrize("mass", [0.01, 1.0, 30.0])
def test_mean_forces_of_compliant_contacts_in_time_stepping(law, mass):
    """Other masses have another loss, also where the forces of a first pass are taken back."""
    model = bouncing(law, mass=mass)
    run = pg.simulate(model, t_end=0.6, method="moreau_jean", step=1e-4, frames=11, estimate=False)
    assert balanced(run, run.contact_force["floor"][:, 3:] / mass, "b")


def test_forces_between_bodies_add_up_for_each():
    bodies = ball("a", (0, 0, 0.1)), box("b", (0.02, 0, 0.5), mass=2.0)
    floor = pg.Contact(name="floor", body="a", restitution=0.2)
    pair = pg.Contact(name="pair", body="b", other="a", friction=0.4)
    run = pg.simulate(pg.Model(bodies=bodies, contacts=[floor, pair]), t_end=0.5, frames=9)
    between = run.contact_force["pair"][:, 3:]
    assert balanced(run, between, "b", 2.0)
    assert balanced(run, run.contact_force["floor"][:, 3:] - between, "a")


@pytest.mark.parametrize("step", [1e-4, 3.3e-4, 1e-2])
def test_a_hit_on_a_joint_limit_is_in_the_record(step):
    hammer = pg.Body(
        name="h", joint="revolute", axes=[(0, 1, 0)], mass=2.0, com=(0.5, 0, 0),
        inertia=(0.01,) * 3, limits=(-0.5, None), limit_restitution=0.4, v=(-3.0,),
    )  # fmt: skip
    model = pg.Model(bodies=[hammer], gravity=(0, 0, 0))
    run = pg.simulate(model, t_end=0.4, step=step, frames=21, estimate=False)
    (name,) = run.contacts.limit
    total = (run.contacts.limit[name][1:] * np.diff(run.t)).sum()
    assert total == pytest.approx(0.51 * (run.v[-1, 0] - run.v[0, 0]), rel=1e-9)
    assert total == pytest.approx(0.51 * 1.4 * 3.0, rel=1e-6)


def test_constraint_forces_of_a_weld_include_impacts_and_turns():
    bodies = ball("a", (0, 0, 0.4), v=(0, 3.0, 0, 0.2, 0, 0)), ball("b", (0.3, 0, 0.5), mass=2.0)
    weld = pg.Weld(name="w", body="b", other="a")
    floor = pg.Contact(name="floor", body="a", restitution=0.5, friction=0.3)
    model = pg.Model(bodies=bodies, contacts=[floor], constraints=[weld])
    for frames in (None, 13):
        run = pg.simulate(
            model, method="moreau_jean", t_end=0.5, step=1e-3, frames=frames, estimate=False
        )
        held = run.constraint_force["w"][:, 3:]
        assert balanced(run, held, "b", 2.0)
        assert balanced(run, run.contact_force["floor"][:, 3:] - held, "a")
        np.testing.assert_allclose(run.joint_force["a"], 0.0, atol=1e-6)  # those of one instant


@pytest.mark.parametrize("frames", [2, 6, 101])
def test_a_stepper_records_the_same_forces_as_a_run(frames):
    model = bouncing()
    st = pg.Stepper(model, step=5e-3)
    first, second = st.record(100, frames), st.record(100, frames)
    whole = pg.joined([first, second])
    assert balanced(whole, whole.contact_force["floor"][:, 3:], "b")
    given = {"method": "moreau_jean", "step": 5e-3, "frames": frames}
    run = pg.simulate(model, t_end=0.5, estimate=False, **given)
    np.testing.assert_array_equal(run.contact_force["floor"], first.contact_force["floor"])


def hopper():
    trunk = box("trunk", (0, 0, 0.45), (0.3, 0.2, 0.1))
    leg = pg.Body(
        name="leg", parent="trunk", axes=[(0, 1, 0)], mass=0.3, com=(0, 0, -0.1), q=(0.3,),
        inertia=(1e-3,) * 3, damping=0.2, shape={"kind": "sphere", "radius": 0.03},
    )  # fmt: skip
    return on_ground(trunk, leg, restitution=0.0, friction=0.6)


@pytest.mark.parametrize("n", [1, 7])
@pytest.mark.parametrize("model", [bouncing(), hopper()], ids=["alone", "lanes"])
def test_steppers_and_batches_have_the_means_of_a_call(n, model):
    many, one = pg.BatchStepper(model, 5, step=2e-3), pg.Stepper(model, step=2e-3)
    total, before = np.zeros(3), one.v[3:6].copy()
    for _ in range(400 // n):
        many.step(n=n)
        one.step(n=n)
        for name, force in one.contact_force.items():
            assert np.array_equal(many.contact_force[name], np.tile(force, (5, 1)))
        total += sum(force[3:] for force in one.contact_force.values()) * n * 2e-3
    assert total[2] > 5.0
    if len(one.v) == 6:
        np.testing.assert_allclose(total, one.v[3:] - before + [0, 0, G * one.t], rtol=1e-9)


def test_a_live_condition_reads_the_force_of_the_last_step():
    slider = box("b", (0, 0, 0.6), joint="prismatic", axes=[(0, 0, 1)])
    weld = pg.Weld(name="w", body="b", active=False)
    floor = pg.Contact(name="floor", body="b", restitution=0.5)
    model = pg.Model(bodies=[slider], contacts=[floor], constraints=[weld])
    when = pg.Switch(constraint="w", active=True, when={"force": "floor", "above": 100.0})
    run = pg.simulate(model, t_end=1.0, frames=3, switches=[when], estimate=False)
    hit = np.sqrt(2 * 0.5 / G)
    switched = [event.t for event in run.contacts.events if event.contact == "w"]
    assert switched == pytest.approx([hit], abs=2e-3)
    assert run.contact_force["floor"][:, 5].max() < 100.0


def never(t, q, v):
    return t - 99.0


@pytest.mark.parametrize("restitution", [0.0, 0.5])
@pytest.mark.parametrize("step", [8e-4, 3e-3, 8.8e-3])
def test_an_event_that_never_occurs_changes_neither_motion_nor_forces(step, restitution):
    """Looks at parts of a step leave the impulses of the step that is taken."""
    model = bouncing(restitution=restitution)
    given = {"t_end": 0.6, "step": step, "method": "moreau_jean", "frames": 41, "estimate": False}
    plain, watched = pg.simulate(model, **given), pg.simulate(model, events=never, **given)
    assert np.array_equal(plain.q, watched.q)
    force = watched.contact_force["floor"]
    assert np.allclose(force, plain.contact_force["floor"], rtol=1e-9, atol=1e-9)
    assert balanced(watched, force[:, 3:], "b")


CLUTCH = pg.Velocity(
    name="clutch", body="u", coefficients={"u": (1.0,), "w": (-1.0,)}, active=False
)


def beside_wheels(*switches):
    """A ball that falls beside two wheels, which a clutch joins."""
    wheels = [
        pg.Body(name=name, link=(5, n, 0), inertia=(1, 1, 1), v=(1.0 - 2.0 * n,))
        for n, name in enumerate("uw")
    ]
    model = bouncing(restitution=0.0)
    scenario = pg.Scenario(name="s", switches=switches)
    return model.replace(
        bodies=(*model.bodies, *wheels), constraints=(CLUTCH,), scenarios=(scenario,)
    )


@pytest.mark.parametrize("at", [0.315, 0.3195, 0.3203, 0.33])
@pytest.mark.parametrize("condition", [False, True])
def test_frames_hold_the_impulses_on_both_sides_of_a_switch(at, condition):
    """The ball lands at 0.3193 s. The wheel has turned by 1 rad per second."""
    given = {"when": {"coordinate": "u", "above": at}} if condition else {"t": at}
    model = beside_wheels(pg.Switch(constraint="clutch", active=True, **given))
    run = pg.simulate(model, scenario="s", t_end=0.6, step=1e-3, method="moreau_jean", frames=13)
    assert len(run.t) == 13
    assert balanced(run, run.contact_force["floor"][:, 3:], "b")
    assert run.force_error < 1e-6


def test_a_step_that_ends_at_an_event_and_a_frame_keeps_its_impulses():
    """The ball is hit again and again before the frame, at whose time a value is zero."""
    at, mass = 0.19603424374036973, 2.0
    model = bouncing(restitution=0.5, mass=mass)
    run = pg.simulate(
        model, t_end=4 * at, frames=5, method="moreau_jean", events=lambda t, q, v: t - at,
        estimate=False,
    )  # fmt: skip
    assert [e.t for e in run.user_events] == pytest.approx([at], abs=1e-15)
    assert balanced(run, run.contact_force["floor"][:, 3:], "b", mass)
