"""Event-driven contacts and limits: gait phases, impacts, and the instants at which they change."""

from __future__ import annotations

import json

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_core.simulation.event_scene import EventScene
from pgraph_models.case_models import limited_pendulum

G = 9.81
FEET = ("left_front_paw", "right_front_paw", "left_hind_paw", "right_hind_paw")
NONE = ((0.0,) * 3,) * 3


def reference(name):
    return json.loads((pgraph_models.CASES / f"{name}.json").read_text(encoding="utf-8"))[
        "reference"
    ]


def run(model, **options):
    """An event-driven run that reached its end."""
    done = pg.simulate(pg.Mechanism(model), method="rk4", **options)
    assert done.status.ok, done.message
    return done


def touching(body, *, points=((0.0, 0.0, 0.0),), ground=None, **contact):
    """A model of one body with one contact, called floor."""
    floor = pg.Contact(name="floor", body=body.name, points=points, **contact)
    return pg.Model(bodies=(body,), contacts=(floor,), **({"ground": ground} if ground else {}))


# -- impacts, and where they accumulate ------------------------------------------------------------


@pytest.mark.parametrize("e", ["0.5", "0.8", "0.95"])
def test_a_ball_bounces_and_comes_to_rest_when_it_must(e):
    """All impacts to 1e-9 s, and the instant at which infinitely many are over."""
    case = reference("bouncing_ball_zeno")[e]
    ball = pg.Body(name="ball", joint="prismatic", axes=((0, 0, 1),), q=(1.0,))
    model = touching(ball, restitution=float(e))
    done = run(model, t_end=case["zeno_time"] + 0.1, step=2e-3)
    times = np.array([event.t for event in done.events])
    expected = np.array(case["impact_times"])
    assert len(times) > len(expected)
    np.testing.assert_allclose(times[: len(expected)], expected, atol=1e-9)
    assert done.events[-1].after == "stance"
    assert abs(times[-1] - case["zeno_time"]) < 1e-9
    assert abs(done.contact_normal["floor"][-1] - G) < 1e-9
    assert done.energy_drift < 1e-12  # what impacts take is in the ledger


def test_a_sphere_bounces_as_far_as_rounding_tells_impacts_apart():
    """Its height is rounded to 1e-17, its impacts are not to be told apart below that."""
    case = reference("bouncing_ball_zeno")["0.5"]
    shape = {"kind": "sphere", "radius": 0.1}
    body = pg.Body(name="ball", joint="free", link=(0, 0, 1.1), shape=shape)
    done = run(touching(body, points=(), restitution=0.5), t_end=1.5, step=1e-3)
    times = np.array([event.t for event in done.events])
    np.testing.assert_allclose(times[:-1], case["impact_times"][: len(times) - 1], atol=1e-9)
    assert abs(times[-1] - case["zeno_time"]) < 1e-9


def test_a_pendulum_chatters_to_rest_on_its_limit():
    case = reference("pendulum_joint_limit")
    done = run(limited_pendulum(), t_end=2.2, step=1e-3)
    times = np.array([event.t for event in done.events])
    expected = np.array([impact["t"] for impact in case["impacts"]])
    assert len(times) > 25
    np.testing.assert_allclose(times[:-1], expected[: len(times) - 1], atol=1e-9)
    assert abs(times[-1] - case["zeno_time"]) < 1e-9
    assert list(done.phases["rod low limit"][[0, -1]]) == ["free", "stop"]
    torque = done.contacts.limit["rod low limit"][-1]
    assert abs(torque - case["limit_torque_at_rest"]) < 1e-9


def test_newtons_restitution_that_would_raise_the_energy_is_left_out_and_said():
    """A double pendulum's tip on a rough plane: e = 0.9 with friction would gain energy."""
    kinds = ("rotate", (0, 1, 0)), ("rotate", (0, 1, 0))
    rng = np.random.default_rng(3)
    said = 0
    for _ in range(12):
        a, b = rng.uniform(0.2, 1.2), rng.uniform(-2.5, 2.5)
        height = np.cos(a) + np.cos(a + b)
        upper = pg.Body(name="u", axes=(kinds[0][1],), com=(0, 0, -0.5), link=(0, 0, height + 1e-3))
        lower = pg.Body(
            name="l", parent="u", axes=(kinds[1][1],), com=(0, 0, -0.5), link=(0, 0, -1)
        )
        floor = pg.Contact(name="f", body="l", points=((0, 0, -1),), restitution=0.9, friction=0.8)
        model = pg.Model(bodies=(upper, lower), contacts=(floor,))
        mech = pg.Mechanism(model)
        speed = rng.uniform(-4, 4, 2)
        done = pg.simulate(mech, np.array([a, b]), speed, t_end=0.2, method="rk4", frames=201)
        assert done.status.ok, done.message
        ledger = done.energy - done.work
        assert np.all(np.diff(ledger) < 1e-6 * np.ptp(done.kinetic_energy) + 1e-9)
        said += any("would raise the energy" in notice for notice in done.notices)
        assert done.counters["bounces_left_out"] == 0 or said
    assert said


# -- friction --------------------------------------------------------------------------------------


def block(slope=0.0, speed=0.0):
    """A box on a plane that rises along x by `slope`."""
    normal = np.array([-np.sin(slope), 0.0, np.cos(slope)])
    turn = (np.cos(slope / 2), 0.0, -np.sin(slope / 2), 0.0)
    body = pg.Body(
        name="block",
        joint="free",
        q=(*(0.05 * normal), *turn),
        v=(0, 0, 0, speed, 0, 0),
        shape={"kind": "box", "size": (0.2, 0.2, 0.1)},
    )
    return touching(body, points=(), friction=0.3, ground={"slope": slope})


def test_a_sliding_block_stops_where_and_when_it_must():
    case = reference("sliding_block_coulomb")["flat"]
    done = run(block(speed=3.0), t_end=2.0, step=1e-2, frames=21)
    np.testing.assert_allclose(done.q[:, 0], case["x"], atol=1e-12)
    np.testing.assert_allclose(done.v[:, 3], case["v"], atol=1e-12)
    assert len(done.events) == 4  # its lower corners, at once
    assert all(abs(event.t - case["stop_time"]) < 1e-9 for event in done.events)
    assert abs(done.contact_normal["floor"][-1] - G) < 1e-9


@pytest.mark.parametrize("case", reference("sliding_block_coulomb")["incline"])
def test_a_block_sticks_or_slides_on_a_slope(case):
    """Without creep: a set-valued law holds exactly, up to the border of the cone."""
    angle = np.radians(case["angle_deg"])
    done = run(block(slope=angle), t_end=1.0, step=1e-2, frames=11)
    down = -(done.v[-1, 3] * np.cos(angle) + done.v[-1, 5] * np.sin(angle))
    if case["state"] == "sticks":
        assert np.abs(done.v).max() < 1e-9
        force = done.contact_force["floor"][-1, 3:]
        np.testing.assert_allclose(force, (0, 0, G), atol=1e-9)
    else:
        assert abs(down - case["acceleration"]) < 1e-10


def test_a_block_on_a_spring_stops_after_a_finite_number_of_half_cycles():
    case = reference("sliding_block_coulomb")["spring"]
    cart = pg.Body(
        name="cart",
        joint="compound",
        motions=(("translate", (1, 0, 0)), ("translate", (0, 0, 1))),
        inertia=NONE,
        q=(0.5, 0.0),
        stiffness=(100, 0),
    )
    done = run(touching(cart, friction=0.3), t_end=3.0, step=1e-3)
    assert abs(done.events[-1].t - case["stop_time"]) < 1e-9
    assert abs(done.q[-1, 0] - case["final_x"]) < 1e-9
    assert abs(abs(done.contact_force["floor"][-1, 3]) - case["final_friction_force"]) < 1e-8
    turns = np.flatnonzero(np.diff(np.sign(done.v[done.t < case["stop_time"], 0])) != 0)
    assert len(turns) >= case["half_cycles"] - 1


def test_a_thrown_ball_skids_then_rolls():
    """Skidding ends at 2/7 |u| / (mu g), whatever its direction and spin."""
    radius, mu = 0.1, 0.3
    moment = 0.4 * radius**2 * np.eye(3)
    ball = pg.Body(
        name="ball",
        joint="free",
        q=(0, 0, radius, 1, 0, 0, 0),
        v=(30.0, 0, 0, 2.0, 0, 0),
        inertia=tuple(map(tuple, moment)),
        shape={"kind": "sphere", "radius": radius},
    )
    done = run(touching(ball, points=(), friction=mu), t_end=1.0, step=1e-2)
    (rolls,) = done.events
    slip = np.hypot(2.0, 30.0 * radius)
    assert (rolls.before, rolls.after) == ("slip", "stance")
    assert abs(rolls.t - 2 / 7 * slip / (mu * G)) < 1e-12
    omega, v = done.v[-1, :3], done.v[-1, 3:]
    np.testing.assert_allclose(v, np.cross(omega, (0, 0, radius)), atol=1e-12)
    assert done.energy_drift < 1e-12


def test_a_slide_across_a_slope_keeps_the_order_of_the_method():
    """Friction turns with the path; it stops after a stretch that is the same at any step."""
    axes = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    point = pg.Body(
        name="p",
        joint="compound",
        motions=tuple(("translate", axis) for axis in axes),
        inertia=NONE,
        v=(0, 2, 0),
    )
    model = touching(point, friction=0.5, ground={"slope": np.radians(20)})
    steps = (4e-2, 2e-2, 1e-2, 1e-3)
    runs = [run(model, t_end=2.0, step=step, frames=3) for step in steps]
    errors = [np.abs(done.q[-1] - runs[-1].q[-1]).max() for done in runs[:-1]]
    assert errors[2] < 1e-6
    assert np.log2(errors[0] / errors[2]) / 2 > 3.5
    assert np.abs(runs[-1].v[-1]).max() < 1e-9


def test_limits_of_a_chain_take_what_the_ledger_says():
    """A hundred impacts of four stops: energy and work balance, none is passed."""
    bodies = [
        pg.Body(
            name=str(i),
            parent=str(i - 1) if i else "ground",
            axes=((0, 1, 0),),
            link=(0, 0, -0.5 if i else 0),
            com=(0, 0, -0.25),
            inertia=((0.02, 0, 0), (0, 0.02, 0), (0, 0, 0.001)),
            q=(0.0 if i else 1.2,),
            limits=((-0.3, 0.3),) if i else ((-1.3, 1.3),),
            limit_restitution=(0.5,),
        )
        for i in range(4)
    ]
    done = run(pg.Model(bodies=tuple(bodies)), t_end=3.0, step=1e-3)
    assert done.counters["impacts"] > 50
    assert done.energy_drift < 1e-9
    assert min(gap.min() for gap in done.contact_gap.values()) > -1e-12


def leaning_rod(lean, mu, *, length=1.0):
    """A rod that stands on its tip in the plane, leaning along +x."""
    half = length / 2
    rod = pg.Body(
        name="rod",
        joint="planar",
        axes=((1, 0, 0), (0, 0, 1), (0, 1, 0)),
        inertia=((1 / 12, 0, 0), (0, 1 / 12, 0), (0, 0, 0)),
        q=(half * np.sin(lean), half * np.cos(lean), lean),
    )
    return touching(rod, points=((0, 0, -half),), friction=mu)


@pytest.mark.parametrize("case", reference("falling_rod_stance_to_slip")["slip_events"])
def test_a_falling_rod_slips_at_the_closed_form_angle(case):
    """Backwards on slippery ground, forwards on rough ground."""
    done = run(leaning_rod(0.01, case["mu"]), t_end=1.4, step=1e-3)
    slip = done.events[0]
    assert (slip.before, slip.after) == ("stance", "slip")
    assert abs(slip.t - case["time_slip"]) < 1e-9
    there = run(leaning_rod(0.01, case["mu"]), t_end=slip.t, t_eval=[slip.t], step=1e-3)
    assert abs(there.q[-1, 2] - case["theta_slip"]) < 1e-9
    force = there.contact_force["floor"][-1]
    np.testing.assert_allclose(force[[3, 5]], (case["Fx_per_m"], case["Fn_per_m"]), atol=1e-8)
    done = run(leaning_rod(0.01, case["mu"]), t_end=slip.t + 0.02, step=1e-3)
    tip = done.body_pose[-1, 0, 0] - 0.5 * np.sin(done.q[-1, 2])
    assert np.sign(tip) == (1 if "forwards" in case["tip_slides_towards"] else -1)
    assert done.energy_drift < 1e-9


@pytest.mark.parametrize(
    ("mu", "degrees", "spin"), [(1.4, 60.0, 0.0), (2.0, 50.0, 0.0), (2.0, 60.0, 8.0)]
)
def test_painleves_rod_is_named_and_survived(mu, degrees, spin):
    """Sliding with p < 0: no force fits (an impulse ends the slip), or two do (it lifts off)."""
    angle, half = np.radians(degrees), 0.5
    lift = half * spin**2 * np.sin(angle) - G
    rod = pg.Body(
        name="rod",
        joint="planar",
        axes=((1, 0, 0), (0, 0, 1), (0, 1, 0)),
        inertia=((0, 0, 0), (0, half**2 / 3, 0), (0, 0, half**2 / 3)),
        q=(-half * np.cos(angle), half * np.sin(angle), angle),
        v=(1 + half * np.sin(angle) * spin, half * np.cos(angle) * spin, spin),
    )
    done = run(touching(rod, points=((half, 0, 0),), friction=mu), t_end=0.1, step=1e-3)
    (notice,) = done.notices
    assert "'floor'" in notice
    assert ("an impulse ended its slip" if lift < 0 else "it leaves") in notice
    assert done.energy[1] < done.energy[0] + 1e-9
    assert done.energy_drift < 1e-9


# -- the quadruped ---------------------------------------------------------------------------------


def quadruped(mu, *, drop=0.0, scenario="stand", damping=1.6):
    """The quadruped on contacts in the place of its constraints, moved by its servos."""
    base = pg.Model.load(pgraph_models.path("quadruped"))
    contacts = tuple(
        pg.Contact(name=c.body, body=c.body, points=(c.point,), friction=mu)
        for c in base.constraints
    )
    servos = base.scenario(scenario).forces
    servos = [f.model_copy(update={"kd": damping * f.kd}) for f in servos]
    model = base.replace(constraints=(), scenarios=(), contacts=contacts, forces=servos)
    mech = pg.Mechanism(model)
    q, v = mech.home()
    q[1] += drop
    return mech, q, v


def test_the_quadruped_drops_on_its_four_feet_and_stands():
    """Four impacts, weight acceptance, stance; then the ground carries its weight."""
    mech, q, v = quadruped(0.6, drop=0.1)
    done = pg.simulate(mech, q, v, t_end=60.0, method="rk4", step=1e-3)
    assert done.status.ok, done.message
    first = {name: next(e for e in done.events if e.contact == name) for name in FEET}
    assert all(event.cause.startswith("hit at 1.3") for event in first.values())
    assert {"swing", "weight acceptance", "stance"} <= {event.after for event in done.events}
    assert all(done.phases[name][-1] == "stance" for name in FEET)
    weight = G * sum(body.mass for body in mech.model.bodies)
    ground = sum(done.contact_force[name][:, 3:] for name in FEET)
    np.testing.assert_allclose(ground[-1], (0, weight, 0), atol=1e-6 * weight)
    assert min(done.contact_normal[name].min() for name in FEET) > -1e-9 * weight  # never pulls
    assert max(-done.contact_gap[name].min() for name in FEET) < 1e-12
    assert done.energy_drift < 1e-4
    assert done.counters["phase_switches"] == sum(e.before != e.after for e in done.events)
    np.testing.assert_allclose(done.joint_force[-1, 0], 0.0, atol=1e-6)  # nothing else holds it


def test_feet_slide_on_ice():
    mech, q, v = quadruped(0.05, drop=0.1)
    done = pg.simulate(mech, q, v, t_end=0.5, method="rk4", step=1e-3)
    assert done.status.ok, done.message
    assert done.error_estimate < 1e-3  # though the same run at twice the step blows up
    assert max(done.contact_slip[name].max() for name in FEET) > 0.1
    for name in FEET:
        force = done.contact_force[name][:, 3:]
        sideways = np.linalg.norm(force[:, [0, 2]], axis=1)
        assert np.all(sideways <= 0.05 * force[:, 1] + 1e-6)


def test_stance_on_contacts_is_stance_on_constraints():
    """The same motion and forces in the paper's push, as long as nothing slips."""
    base = pg.Model.load(pgraph_models.path("quadruped"))
    push = {"t_end": 0.25, "method": "rk4", "step": 1e-3}
    held = pg.simulate(pg.Mechanism(base), scenario="stance", **push)
    mech, q, v = quadruped(0.8, scenario="stance", damping=1.0)
    free = pg.simulate(mech, q, v, **push)
    assert not free.events
    np.testing.assert_allclose(free.q, held.q, atol=1e-10)
    for name in FEET:
        found, expected = free.contact_force[name][:, 3:], held.constraint_force[name][:, 3:]
        np.testing.assert_allclose(found, expected, atol=1e-6)


def test_a_switch_of_phase_rebuilds_nothing(monkeypatch):
    """The same scene before and after; what changes is which of its blocks are active."""
    built = []
    make = EventScene.__init__

    def counted(self, *args, **options):
        built.append(self)
        make(self, *args, **options)

    monkeypatch.setattr(EventScene, "__init__", counted)
    mech, q, v = quadruped(0.6, drop=0.1)
    done = pg.simulate(mech, q, v, t_end=0.3, method="rk4", step=1e-3, estimate=False)
    assert done.counters["phase_switches"] > 8
    assert len(built) == 1


# -- what is refused, and what is kept -------------------------------------------------------------


def test_pairs_hulls_and_steps_are_for_time_stepping():
    cylinder = pg.Body(name="c", joint="free", shape={"kind": "cylinder", "radius": 1, "length": 1})
    with pytest.raises(pg.InputError, match="not for a cylinder; use method 'moreau_jean'"):
        run(touching(cylinder, points=()), t_end=0.1)
    stairs = {"steps": ({"low": (0, 0), "high": (1, 1), "height": 0.1},)}
    point = pg.Body(name="p", joint="free")
    with pytest.raises(pg.InputError, match="a ground without steps; use method 'moreau_jean'"):
        run(touching(point, ground=stairs), t_end=0.1)


def test_events_and_phases_survive_a_file(tmp_path):
    ball = pg.Body(name="ball", joint="prismatic", axes=((0, 0, 1),), q=(0.1,))
    done = run(touching(ball, restitution=0.5), t_end=0.5, step=1e-3)
    done.save(tmp_path / "run.npz")
    back = pg.Result.load(tmp_path / "run.npz")
    assert back.events == done.events
    np.testing.assert_array_equal(back.phases["floor"], done.phases["floor"])
    assert str(done.events[0]) == (
        "t = 0.142784312 s: floor of ball: swing: hit at 1.40071 m/s and bounced at 0.700357 m/s"
    )
    assert "phases.floor" in done.to_csv().splitlines()[0]


@pytest.mark.parametrize("depth", [1e-4, 1e-6, 1e-8, -1e-8, -1e-6])
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_touch_and_go_within_one_step_is_found(depth, share):
    """A bob on a spring dips below the ground for a part of one step, or stays above it."""
    rate, size, step = 100.0, 0.01, 1e-3
    low = 0.02 + share * step
    middle = size - depth
    bob = pg.Body(
        name="bob",
        joint="prismatic",
        stiffness=rate**2,
        rest=middle,
        q=middle - size * np.cos(rate * low),
        v=-size * rate * np.sin(rate * low),
    )
    floor = pg.Contact(name="floor", body="bob", points=((0, 0, 0),), restitution=0.5)
    model = pg.Model(bodies=(bob,), contacts=(floor,), gravity=(0, 0, 0))
    done = run(model, t_end=0.04, step=step)
    assert done.status.ok
    if depth < 0:
        assert done.events == ()
        return
    hit = low - np.arccos(1 - depth / size) / rate
    speed = rate * np.sqrt(2 * size * depth)
    error = 5e-9 / speed  # what RK4 makes of the place at this step
    assert abs(done.events[0].t - hit) < error
    assert done.contact_gap["floor"].min() > -1e-12
