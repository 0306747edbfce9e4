"""Event-driven contacts and limits: impacts, phases and the instants at which they change."""

import json

import numpy as np
import pytest
from scipy.optimize import minimize

import pgraph_core as pg
import pgraph_models
from pgraph_models.case_models import limited_pendulum

from ..nights import at_night, combined
from ..worlds import ball, box, built_in, on_ground

G = 9.81
FEET = ("left_front_paw", "right_front_paw", "left_hind_paw", "right_hind_paw")
NONE = ((0.0,) * 3,) * 3
WAYS = {
    "rk4": {"method": "rk4", "step": 1e-3},
    "dopri5": {"method": "dopri5", "rtol": 1e-10},
    "dop853": {"method": "dop853", "rtol": 1e-12},
}
every_way = pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)


def reference(name):
    path = pgraph_models.CASES / f"{name}.json"
    return json.loads(path.read_text(encoding="utf-8"))["reference"]


def run(model, **options):
    done = pg.simulate(model, **options)
    assert done.status.ok, done.message
    return done


def touching(body, *, points=((0.0, 0.0, 0.0),), ground=None, **contact):
    floor = pg.Contact(name="floor", body=body.name, points=points, **contact)
    return pg.Model(bodies=(body,), contacts=(floor,), **({"ground": ground} if ground else {}))


def falling(height):
    return pg.Body(name="ball", joint="prismatic", axes=((0, 0, 1),), q=(height,))


@pytest.mark.parametrize(("depth", "told"), [(1e-2, True), (1e-5, True), (1e-7, False)])
def test_a_start_below_the_ground_is_moved_onto_it_and_told(depth, told):
    done = run(touching(falling(-depth)), t_end=0.1, method="dop853", rtol=1e-8)
    assert done.q[0, 0] == pytest.approx(0.0, abs=1e-12)
    found = [text for text in done.notices if "initial state was changed" in text]
    assert [f"{depth:.3g}" in text for text in found] == [True] * told


@pytest.mark.parametrize(
    ("e", "way"),
    [(0.5, WAYS["rk4"]), (0.8, WAYS["rk4"]), (0.95, WAYS["rk4"]),
     (0.8, {"method": "dopri5", "rtol": 1e-6}), (0.8, {"method": "dop853", "rtol": 1e-6})],
)  # fmt: skip
def test_a_ball_comes_to_rest_at_the_zeno_time(e, way):
    """Impacts to 1e-9 s at a loose tolerance, and frames on the parabolas between them."""
    case = reference("bouncing_ball_zeno")[str(e)]
    model = touching(falling(1.0), restitution=e)
    done = run(model, t_end=case["zeno_time"] + 0.1, frames=40, **way)
    times, expected = np.array([event.t for event in done.events]), np.array(case["impact_times"])
    assert len(times) > len(expected)
    np.testing.assert_allclose(times[: len(expected)], expected, atol=1e-9)
    assert done.events[-1].after == "stance"
    assert abs(times[-1] - case["zeno_time"]) < 1e-9
    assert abs(done.contact_normal["floor"][-1] - G) < 1e-9
    assert done.energy_drift < 1e-12
    for t, gap in zip(done.t, done.contact_gap["floor"]):
        since = expected[expected <= t]
        if len(since) and t < expected[-1]:
            late = t - since[-1]
            up = e ** len(since) * np.sqrt(2 * G)
            assert abs(gap - (up * late - G * late**2 / 2)) < 1e-9


def test_a_pendulum_chatters_to_rest_on_its_limit():
    case = reference("pendulum_joint_limit")
    done = run(limited_pendulum(), t_end=2.2, **WAYS["dop853"])
    times = np.array([event.t for event in done.events])
    expected = np.array([impact["t"] for impact in case["impacts"]])
    assert len(times) > 25
    np.testing.assert_allclose(times[:-1], expected[: len(times) - 1], atol=1e-9)
    assert abs(times[-1] - case["zeno_time"]) < 1e-9
    assert list(done.phases["rod low limit"][[0, -1]]) == ["free", "stop"]
    torque = done.contacts.limit["rod low limit"][-1]
    assert abs(torque - case["limit_torque_at_rest"]) < 1e-9


def test_restitution_that_would_raise_the_energy_is_left_out_and_reported():
    """The tip of a double pendulum on a rough plane: e = 0.9 with friction would gain energy."""
    rng = np.random.default_rng(3)
    reported = 0
    for _ in range(6):
        a, b = rng.uniform(0.2, 1.2), rng.uniform(-2.5, 2.5)
        height = np.cos(a) + np.cos(a + b)
        link = {"axes": ((0, 1, 0),), "com": (0, 0, -0.5)}
        upper = pg.Body(name="u", link=(0, 0, height + 1e-3), **link)
        lower = pg.Body(name="l", parent="u", link=(0, 0, -1), **link)
        floor = pg.Contact(name="f", body="l", points=((0, 0, -1),), restitution=0.9, friction=0.8)
        model = pg.Model(bodies=(upper, lower), contacts=(floor,))
        speed = rng.uniform(-4, 4, 2)
        done = pg.simulate(model, np.array([a, b]), speed, t_end=0.2, method="rk4", frames=201)
        assert done.status.ok, done.message
        ledger = done.energy - done.work
        assert np.all(np.diff(ledger) < 1e-6 * np.ptp(done.kinetic_energy) + 1e-9)
        told = any("increase the energy" in notice for notice in done.notices)
        assert told == (done.counters["bounces_left_out"] > 0)
        reported += told
    assert reported


@pytest.mark.parametrize("start", [0.6, 0.1001, 0.1])
def test_the_first_impact_without_restitution_is_an_event(start):
    thrown = ball(joint="prismatic", axes=((0, 0, 1),), place=(0, 0, 0), q=(start,), v=(-1.0,))
    (hit,) = run(on_ground(thrown, restitution=0.0), t_end=0.5, rtol=1e-9).events
    exact = (np.sqrt(1 + 2 * G * (start - 0.1)) - 1) / G
    assert hit.t == pytest.approx(exact, abs=1e-12)
    assert (hit.before, hit.after) == ("swing", "stance")


@pytest.mark.parametrize(
    ("depth", "share", "way"),
    combined([1e-4, 1e-8, -1e-8], [0.1, 0.9], [WAYS["rk4"], {"method": "dop853", "rtol": 1e-10}]),
)
def test_a_touch_within_one_step_is_found(depth, share, way):
    """A bob on a spring dips below the ground for a part of one step, or stays above it."""
    rate, size, step = 100.0, 0.01, 1e-3
    low = 0.02 + share * step
    middle = size - depth
    bob = pg.Body(
        name="bob", joint="prismatic", stiffness=rate**2, rest=middle,
        q=middle - size * np.cos(rate * low), v=-size * rate * np.sin(rate * low),
    )  # fmt: skip
    model = touching(bob, restitution=0.5).replace(gravity=(0, 0, 0))
    done = run(model, t_end=0.04, **way)
    if depth < 0:
        assert done.events == ()
        return
    hit = low - np.arccos(1 - depth / size) / rate
    speed = rate * np.sqrt(2 * size * depth)
    assert abs(done.events[0].t - hit) < 5e-9 / speed  # what RK4 makes of the place at this step
    assert done.contact_gap["floor"].min() > -1e-12


def test_limits_of_a_chain_take_the_energy_in_the_ledger():
    """A hundred impacts of four stops: none is passed."""
    bodies = [
        pg.Body(
            name=str(i), parent=str(i - 1) if i else "ground", axes=((0, 1, 0),),
            link=(0, 0, -0.5 if i else 0), com=(0, 0, -0.25), inertia=np.diag((0.02, 0.02, 0.001)),
            q=(0.0 if i else 1.2,), limits=((-0.3, 0.3),) if i else ((-1.3, 1.3),),
            limit_restitution=(0.5,),
        )
        for i in range(4)
    ]  # fmt: skip
    done = run(pg.Model(bodies=tuple(bodies)), t_end=3.0, **WAYS["rk4"])
    assert done.counters["impacts"] > 50
    assert done.energy_drift < 1e-9
    assert min(gap.min() for gap in done.contact_gap.values()) > -1e-12


@pytest.mark.parametrize(
    "options",
    [{"rtol": 1e-8}, {"method": "dopri5"}, {"method": "rk4", "step": 0.01},
     {"method": "moreau_jean", "step": 0.01}],
    ids=str,
)  # fmt: skip
def test_a_joint_goes_to_and_fro_between_elastic_limits(options):
    body = pg.Body(
        name="b", inertia=np.eye(3), limits=((-3.0, 3.0),), limit_restitution=(1.0,), v=(2.0,)
    )
    done = run(pg.Model(bodies=(body,), gravity=(0, 0, 0)), t_end=20.0, **options)
    place = np.abs((2.0 * done.t - 3.0) % 12.0 - 6.0) - 3.0
    np.testing.assert_allclose(done.q[:, 0], place, atol=1e-7)
    if options.get("method") != "moreau_jean":
        times = [event.t for event in done.events]
        assert times == pytest.approx(np.arange(1.5, 20, 3.0), abs=1e-10)


def block(slope=0.0, speed=0.0):
    normal = np.array([-np.sin(slope), 0.0, np.cos(slope)])
    q = (*(0.05 * normal), np.cos(slope / 2), 0.0, -np.sin(slope / 2), 0.0)
    body = box(place=(0, 0, 0), size=(0.2, 0.2, 0.1), q=q, v=(0, 0, 0, speed, 0, 0))
    return on_ground(body, friction=0.3, model={"ground": {"slope": slope}})


@every_way
def test_a_sliding_block_stops_where_and_when_it_must(way):
    case = reference("sliding_block_coulomb")["flat"]
    done = run(block(speed=3.0), t_end=2.0, frames=21, **way)
    np.testing.assert_allclose(done.q[:, 0], case["x"], atol=1e-9)
    np.testing.assert_allclose(done.v[:, 3], case["v"], atol=1e-9)
    assert len(done.events) == 4  # its lower corners, at once
    assert all(abs(event.t - case["stop_time"]) < 1e-9 for event in done.events)
    assert abs(done.contact_normal["floor"][-1] - G) < 1e-9


def test_a_thrown_ball_skids_then_rolls():
    """Skidding ends at 2/7 |u| / (mu g), whatever its direction and spin."""
    radius, mu = 0.1, 0.3
    thrown = ball(v=(30.0, 0, 0, 2.0, 0, 0))
    done = run(on_ground(thrown, friction=mu), t_end=1.0, method="rk4", step=1e-2)
    (rolls,) = done.events
    assert (rolls.before, rolls.after) == ("slip", "stance")
    assert abs(rolls.t - 2 / 7 * np.hypot(2.0, 30.0 * radius) / (mu * G)) < 1e-12
    omega, v = done.v[-1, :3], done.v[-1, 3:]
    np.testing.assert_allclose(v, np.cross(omega, (0, 0, radius)), atol=1e-12)
    assert done.energy_drift < 1e-12


def test_a_slide_across_a_slope_keeps_the_order_and_the_tolerance_of_the_method():
    """Friction turns with the path of a point until it stops."""
    motions = tuple(("translate", axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1)))
    point = pg.Body(name="p", joint="compound", motions=motions, inertia=NONE, v=(0, 2, 0))
    model = touching(point, friction=0.5, ground={"slope": np.radians(20)})
    given = {"t_end": 2.0, "frames": 3}
    finest = run(model, method="dop853", rtol=1e-12, **given)
    assert np.abs(finest.v[-1]).max() < 1e-9
    for rtol in (1e-5, 1e-8):
        done = run(model, method="dop853", rtol=rtol, **given)
        assert done.events[-1].after == "stance"
        assert np.abs(done.q - finest.q).max() < 10 * rtol
        assert done.energy_drift < 10 * rtol
    runs = [run(model, method="rk4", step=step, **given) for step in (4e-2, 1e-2)]
    errors = [np.abs(done.q[-1] - finest.q[-1]).max() for done in runs]
    assert errors[1] < 1e-6
    assert np.log2(errors[0] / errors[1]) / 2 > 3.5


def leaning_rod(lean, mu):
    rod = pg.Body(
        name="rod", joint="planar", axes=((1, 0, 0), (0, 0, 1), (0, 1, 0)),
        inertia=np.diag((1 / 12, 1 / 12, 0)), q=(0.5 * np.sin(lean), 0.5 * np.cos(lean), lean),
    )  # fmt: skip
    return touching(rod, points=((0, 0, -0.5),), friction=mu)


@pytest.mark.parametrize(
    ("case", "way"),
    combined(reference("falling_rod_stance_to_slip")["slip_events"], WAYS.values()),
)
def test_a_falling_rod_slips_at_the_closed_form_angle(case, way):
    """Backwards on slippery ground, forwards on rough ground."""
    way = way | ({} if "step" in way else {"rtol": 1e-12})
    model = leaning_rod(0.01, case["mu"])
    done = run(model, t_end=case["time_slip"] + 0.02, **way)
    slip = done.events[0]
    assert (slip.before, slip.after) == ("stance", "slip")
    assert abs(slip.t - case["time_slip"]) < 1e-9
    assert done.energy_drift < 1e-9
    tip = done.body_pose[-1, 0, 0] - 0.5 * np.sin(done.q[-1, 2])
    assert np.sign(tip) == (1 if "forwards" in case["tip_slides_towards"] else -1)
    there = run(model, t_end=slip.t, t_eval=[slip.t], **way)
    assert abs(there.q[-1, 2] - case["theta_slip"]) < 1e-9
    force = there.contact_force["floor"][-1]
    np.testing.assert_allclose(force[[3, 5]], (case["Fx_per_m"], case["Fn_per_m"]), atol=1e-8)


@pytest.mark.parametrize("way", [WAYS["rk4"], {"rtol": 1e-8}], ids=["rk4", "rtol"])
@pytest.mark.parametrize(
    ("mu", "degrees", "spin"), [(1.4, 60.0, 0.0), (2.0, 50.0, 0.0), (2.0, 60.0, 8.0)]
)
def test_painleves_rod_is_reported_and_survived(mu, degrees, spin, way):
    """No force fits (an impulse ends the slip), or two do (it lifts off)."""
    angle, half = np.radians(degrees), 0.5
    lift = half * spin**2 * np.sin(angle) - G
    rod = pg.Body(
        name="rod", joint="planar", axes=((1, 0, 0), (0, 0, 1), (0, 1, 0)),
        inertia=np.diag((0, half**2 / 3, half**2 / 3)),
        q=(-half * np.cos(angle), half * np.sin(angle), angle),
        v=(1 + half * np.sin(angle) * spin, half * np.cos(angle) * spin, spin),
    )  # fmt: skip
    done = run(touching(rod, points=((half, 0, 0),), friction=mu), t_end=0.1, **way)
    (notice,) = done.notices
    assert "'floor'" in notice
    assert ("impulse" if lift < 0 else "leaves") in notice
    assert done.energy[1] < done.energy[0] + 1e-9
    assert done.energy_drift < 1e-8


def quadruped(mu, *, drop=0.0, scenario="stand", damping=1.6):
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


@pytest.mark.parametrize(
    "t_end", [2.5, pytest.param(60.0, marks=pytest.mark.nightly)], ids=["short", "minute"]
)
def test_the_quadruped_drops_on_its_four_feet_and_stands(t_end):
    mech, q, v = quadruped(0.6, drop=0.1)
    done = run(mech, q=q, v=v, t_end=t_end, estimate=False, **WAYS["rk4"])
    first = {name: next(e for e in done.events if e.contact == name) for name in FEET}
    fall = np.sqrt(2 * 0.1 / G)
    assert all(abs(event.t - fall) < 0.01 for event in first.values())
    assert {"swing", "weight acceptance", "stance"} <= {event.after for event in done.events}
    assert all(done.phases[name][-1] == "stance" for name in FEET)
    weight = G * sum(body.mass for body in mech.model.bodies)
    ground = sum(done.contact_force[name][:, 3:] for name in FEET)
    slack = 1e-6 if t_end > 10 else 5e-2
    np.testing.assert_allclose(ground[-1], (0, weight, 0), atol=slack * weight)
    assert min(done.contact_normal[name].min() for name in FEET) > -1e-9 * weight  # never pulls
    assert max(-done.contact_gap[name].min() for name in FEET) < 1e-12
    assert done.energy_drift < 1e-4
    assert done.counters["phase_switches"] == sum(e.before != e.after for e in done.events)
    np.testing.assert_allclose(done.joint_force[-1, 0], 0.0, atol=1e-6)  # nothing else holds it


def test_stance_on_contacts_is_stance_on_constraints():
    """The same motion and forces in the paper's push, as long as nothing slips."""
    base = pg.Model.load(pgraph_models.path("quadruped"))
    push = {"t_end": 0.25, "estimate": False, **WAYS["rk4"]}
    held = run(base, scenario="stance", **push)
    mech, q, v = quadruped(0.8, scenario="stance", damping=1.0)
    free = run(mech, q=q, v=v, **push)
    assert not free.events
    np.testing.assert_allclose(free.q, held.q, atol=1e-10)
    for name in FEET:
        found, expected = free.contact_force[name][:, 3:], held.constraint_force[name][:, 3:]
        np.testing.assert_allclose(found, expected, atol=1e-6)


def walk(name, gait, t_end, **options):
    return run(built_in(name), scenario=gait, t_end=t_end, estimate=False, **options)


def test_the_trot_closes_its_ledger_and_agrees_with_given_steps():
    done = walk("quadruped_hips", "trot", 0.8, rtol=1e-8)
    assert done.energy_drift < 1e-7
    given = walk("quadruped_hips", "trot", 0.8, method="rk4", step=2.5e-4)
    np.testing.assert_allclose(done.q[-1], given.q[-1], atol=5e-5)  # 1e-5 of rk4
    other = walk("quadruped_hips", "trot", 0.8, rtol=1e-7, method="dopri5")
    np.testing.assert_allclose(done.q[-1], other.q[-1], atol=1e-5)
    for event in done.events[1:]:
        k = int(np.searchsorted(done.t, event.t))
        following = [e for e in done.events if e.contact == event.contact and e.t <= done.t[k]]
        assert done.phases[event.contact][k] == following[-1].after


def test_feet_that_land_in_pairs_keep_the_symmetry_of_the_trunk():
    """Impulses across are not unique: neither foot can move aside against the other."""
    options = {"method": "rk4", "step": 2.5e-4, "frames": 2}
    done = walk("quadruped", "bound", 1.85, **options)
    assert done.counters["impacts"] > 10
    assert np.abs(done.v[-1, [0, 1, 5]]).max() < 1e-9  # roll, yaw, aside: it was 0.1 rad/s
    assert not [text for text in done.notices if "no phases satisfy" in text]


@pytest.mark.nightly
@pytest.mark.parametrize("gait", ["trot", "crawl"])
def test_thirty_seconds_of_a_walk_close_their_ledger(gait):
    assert walk("quadruped_hips", gait, 30.0, rtol=1e-8).energy_drift < 1e-6


@pytest.mark.nightly
def test_a_run_whose_contacts_contradict_each_other_ends():
    """At 0.7565 s a limit and two feet had no consistent phases, and it opened and closed at once.

    A foot that would fall if it opens, and would be pulled if it sticks, slides.
    """
    done = walk("quadruped_hips", "trot", 1.0, method="rk4", step=0.02)
    assert done.status.ok
    assert not [text for text in done.notices if "no phases satisfy" in text]


def test_methods_that_locate_events_and_those_that_do_not():
    model = touching(falling(0.1))
    assert run(model, t_end=0.2, rtol=1e-8).header["method"] == "dop853"
    fixed = run(model, t_end=0.2, method="dopri5", step=1e-2)
    assert abs(fixed.events[0].t - np.sqrt(0.2 / G)) < 1e-12
    stop = touching(falling(0.1).model_copy(update={"limits": ((None, 0.2),)}), law="penalty")
    stairs = {"steps": ({"low": (0, 0), "high": (1, 1), "height": 0.1},)}
    for refused, options, key in (
        (model, {"method": "radau5"}, "dense output"),
        (model, {"method": "moreau_jean", "rtol": 1e-6}, "tolerance"),
        (stop, {"rtol": 1e-6}, "penalty"),
        (touching(falling(0.1), ground=stairs), {"method": "rk4"}, "steps.*moreau_jean"),
    ):
        with pytest.raises(pg.InputError, match=key):
            pg.simulate(refused, t_end=0.2, **options)


def test_events_and_phases_survive_a_file(tmp_path):
    given = {"events": [lambda t, q, v: q[0] - 0.05], **WAYS["rk4"]}
    done = run(touching(falling(0.1), restitution=0.5), t_end=0.5, **given)
    done.save(tmp_path / "run.npz")
    back = pg.Result.load(tmp_path / "run.npz")
    assert back.events == done.events
    assert done.user_events
    assert [e[:3] for e in back.user_events] == [e[:3] for e in done.user_events]
    np.testing.assert_array_equal(back.user_events[0].q, done.user_events[0].q)
    np.testing.assert_array_equal(back.phases["floor"], done.phases["floor"])
    for fact in ("0.142784312", "floor", "ball", "swing", "1.40071", "0.700357"):
        assert fact in str(done.contacts.events[0])
    assert done.events[0] == done.user_events[0]  # in order of time
    assert "phases.floor" in done.to_csv().splitlines()[0]


@pytest.mark.parametrize("step", [5e-4, 1e-3, 2.3e-3])
@pytest.mark.parametrize(("height", "e"), [(0.37, 0.8), (1.0, 0.5), (1.3, 1.0), (2.0, 0.95)])
def test_time_stepping_tells_a_bounce_once_and_when_it_is(step, height, e):
    """A ball falls for √(2h/g), and rises and falls for 2e as long, until the first two impacts."""
    ball = pg.Body("ball", joint="free", mass=0.5, shape=pg.Shape("sphere", radius=0.05))
    model = pg.Model([ball], contacts=[pg.Contact("ball", restitution=e)])
    fall = np.sqrt(2.0 * (height - 0.05) / 9.81)
    t_end = fall * (1.0 + 3.0 * e)
    options = {"method": "moreau_jean", "step": step, "estimate": False}
    run = pg.simulate(model, {"ball": [0.0, 0.0, height]}, t_end=t_end, **options)
    assert [(event.before, event.after) for event in run.events] == [("swing", "swing")] * 2
    times = [event.t for event in run.impacts]
    np.testing.assert_allclose(times, [fall, fall * (1.0 + 2.0 * e)], rtol=0, atol=1e-6 * step)


@pytest.mark.parametrize(("e", "step"), combined([0.0, 0.3, 0.8], [5e-4, 1e-3, 5e-3]))
def test_hits_of_a_joint_limit_are_events_of_time_stepping(e, step):
    """They are located, and the events are those of an event-driven run."""
    body = pg.Body(
        name="b", joint="prismatic", axes=(0, 0, 1), q=(0.5,), limits=((0.0, None),),
        limit_restitution=(e,),
    )  # fmt: skip
    model = pg.Model(bodies=(body,))
    first = np.sqrt(2.0 * 0.5 / G)
    t_end = first * (1.0 + e)  # during the flight after the second hit
    done = run(model, t_end=t_end, step=step, method="moreau_jean")
    fine = run(model, t_end=t_end, rtol=1e-9)
    assert done.events[0].t == pytest.approx(first, abs=1e-8)
    assert len(done.events) == len(fine.events)
    assert [x.contact for x in done.events] == [x.contact for x in fine.events]
    if e == 0.0:
        (hit,) = done.events
        assert (hit.body, hit.before, hit.after) == ("b", "free", "stop")
        assert done.phases["b low limit"][-1] == "stop"
    else:
        assert done.events[0].after == "free"


@pytest.mark.parametrize("way", ["rk4", "dopri5", *at_night("dop853")])
def test_a_driven_anchor_does_the_work_that_its_spring_takes(way):
    """A box slips behind a spring, and the energy is balanced in event-driven runs."""
    anchor = pg.Body(name="anchor", joint="prismatic", axes=(1, 0, 0), link=(1, 0, 0.05))
    model = pg.Model(
        bodies=[anchor, box("box", (0, 0, 0.05), (0.1, 0.1, 0.1))],
        constraints=[
            pg.Motion(name="drive", body="anchor", q_of_t=pg.Polynomial(coefficients=[0, 0.1]))
        ],
        contacts=[pg.Contact(name="floor", body="box", friction=0.3)],
        forces=[pg.Spring(name="spring", body="box", other="anchor", stiffness=100.0, rest=1.0)],
    )
    done = run(model, t_end=0.9, frames=601, **WAYS[way])  # it slips from 0.294 s on
    pull = 100.0 * (0.1 * done.t - done["box"][:, 0])
    work = 0.1 * np.sum(0.5 * (pull[1:] + pull[:-1]) * np.diff(done.t))
    assert "slip" in {e.after for e in done.events}
    assert done.work[-1] == pytest.approx(work, rel=1e-5)
    assert done.energy_drift < 1e-6


def test_feet_with_little_load_share_a_push_within_their_cones():
    """Forces that no motion tells apart are close to those of least norm within the cones.

    Those of least norm alone would leave the cones of two feet. The run projects them, and ends at
    a point whose friction is within 2 % of the least, here 1 %.
    """
    feet, com, mu = np.array([(-0.5, 0, -0.05), (0.5, 0, -0.05), (0.4, 0.3, -0.05)]), 0.45, 0.5
    body = pg.Body(
        name="b", joint="free", inertia=(0.1, 0.1, 0.1), com=(com, 0, 0),
        q=(0, 0, 0.05, 1, 0, 0, 0),
    )  # fmt: skip
    contacts = [
        pg.Contact(name=f"c{i}", body="b", points=[p], friction=mu) for i, p in enumerate(feet)
    ]
    model = pg.Model(bodies=[body], contacts=contacts, gravity=(2.0, 1.0, -G))
    found = run(model, t_end=0.1, method="dop853", rtol=1e-8, estimate=False, frames=3)
    forces = np.array([found.contact_force[f"c{i}"][-1, 3:] for i in range(3)])
    arms = feet - (com, 0, 0)
    np.testing.assert_allclose(forces.sum(axis=0), (-2.0, -1.0, G), atol=1e-9)
    np.testing.assert_allclose(np.cross(arms, forces).sum(axis=0), 0, atol=1e-9)
    assert abs(found.v).max() < 1e-9
    drag = np.linalg.norm(forces[:, :2], axis=1)
    assert (drag <= mu * forces[:, 2] * (1 + 1e-9)).all()
    balance = np.vstack(
        [np.hstack([np.eye(3)] * 3), np.hstack([np.cross(np.eye(3), a) for a in -arms])]
    )
    weight = np.array([-2.0, -1.0, G, 0, 0, 0])
    least = np.linalg.lstsq(balance, weight, rcond=None)[0].reshape(3, 3)
    assert (np.linalg.norm(least[:, :2], axis=1) > mu * least[:, 2]).sum() == 2
    laws = [{"type": "eq", "fun": lambda x: balance @ x - weight}]
    laws += [
        {
            "type": "ineq",
            "fun": lambda x, i=i: (mu * x[3 * i + 2]) ** 2 - x[3 * i] ** 2 - x[3 * i + 1] ** 2,
        }
        for i in range(3)
    ]
    best = minimize(lambda x: x @ x, least.ravel(), constraints=laws, options={"maxiter": 500})
    assert best.success
    assert (drag**2).sum() <= 1.02 * (best.x.reshape(3, 3)[:, :2] ** 2).sum()


@pytest.mark.parametrize("friction", [0.2, 0.22])
def test_stances_that_no_forces_hold_slide(friction):
    """A ball and a capsule on the ground, which a point joins while both touch it.

    The slip of the capsule comes to zero at 0.38 s. Three stances and the joint have twelve
    dependent rows then, and their bodies go on moving: 0.23 J of 7 were lost.
    """
    mass, light = 3.8857564438180656, 2.2673316485697637
    ball = pg.Body(
        name="ball", joint="free", shape={"kind": "sphere", "radius": 0.12440577228157185},
        q=(
            0.19869491109199372, 0.04438149153672999, 0.5497057466632713, 0.029949397017162743,
            -0.9097412232058593, -0.40018275613206716, -0.10643167814498558,
        ),
        v=(
            0.24559157797984765, -2.3708381204246023, 2.678923460833361, 0.4302804800837008,
            0.4431435061934692, -0.5158486547537917,
        ),
        mass=mass, inertia=(0.004 * mass, 0.005 * mass, 0.006 * mass),
        com=(-0.0018699720731507295, 0.0015388722760608445, 0.006162707845133987),
    )  # fmt: skip
    capsule = pg.Body(
        name="capsule", joint="free", mass=light,
        q=(
            1.317186718988861, -0.2851300406418294, 0.3548719839098701, 0.010979198813509256,
            0.7593800331747994, -0.5798568528842634, 0.29493635342363607,
        ),
        v=(
            -2.78168627766905, -2.846103053080993, 0.5473953653903498, -0.7741613153000471,
            -0.20135471648044434, 0.18138954658910666,
        ),
        shape={"kind": "capsule", "radius": 0.0772943654548226, "length": 0.1931246996330096},
    )  # fmt: skip
    model = pg.Model(
        bodies=[ball, capsule], ground=pg.Ground(friction=friction),
        contacts=[pg.Contact(name="floor", body="*")],
        constraints=[
            pg.Point(name="tie", body="capsule", other="ball", point=(0, 0, 0), active=False)
        ],
    )  # fmt: skip
    given = {"t_end": 0.43, "switches": ((0.2618651404316106, "tie", True),), "estimate": False}
    run = pg.simulate(model, method="dop853", rtol=1e-9, **given)
    other = pg.simulate(model, method="moreau_jean", step=1e-4, **given)
    assert run.energy_drift < 1e-8
    assert run.q[-1] == pytest.approx(other.q[-1], abs=2e-5)
