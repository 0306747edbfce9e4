"""Runs with contacts and limits that nothing comes near, and runs in which something does."""

import numpy as np
import pytest

import pgraph_core as pg

from ..worlds import ball, box, on_ground


def chain(limits=None, law=None):
    bodies = [
        pg.Body(
            name=f"a{k}", parent=f"a{k - 1}" if k else "ground", axes=((k % 2, 1 - k % 2, 0),),
            link=(0, 0, -0.5 if k else 0), com=(0, 0, -0.25), tip=(0, 0, -0.5), q=0.3,
            shape={"kind": "capsule", "radius": 0.05, "length": 0.3}, limits=limits,
        )
        for k in range(4)
    ]  # fmt: skip
    if law is None:
        return pg.Mechanism(pg.Model(bodies=tuple(bodies)))
    wall = box("wall", (1000, 0, 0), (1, 1, 1), joint="weld")
    contacts = tuple(pg.Contact(name=b.name, body=b.name, other="wall", law=law) for b in bodies)
    return pg.Mechanism(pg.Model(bodies=(*bodies, wall), contacts=contacts))


LAWS = ("complementarity", "soft", "penalty")
WAYS = [
    {},
    {"method": "rk4", "step": 1e-3},
    {"method": "radau5", "step": 2e-3},
    *(pytest.param(way, marks=pytest.mark.nightly)
      for way in ({"step": 1e-3}, {"rtol": 1e-5}, {"method": "semi_implicit_euler", "step": 1e-3},
                  {"method": "dop853"}, {"method": "dopri5"})),
]  # fmt: skip


@pytest.mark.parametrize("way", WAYS, ids=str)
def test_contacts_and_limits_out_of_reach_change_no_bit(way):
    bare = pg.simulate(chain(), t_end=0.2, **way)
    for far in (chain(limits=(-1000, 1000)), *(chain(law=law) for law in LAWS)):
        run = pg.simulate(far, t_end=0.2, **way)
        assert run.header["method"] == bare.header["method"]
        assert run.counters["steps"] == bare.counters["steps"]
        for name in ("t", "q", "v", "vdot"):
            assert np.array_equal(getattr(run, name), getattr(bare, name))
        assert run.error_estimate == bare.error_estimate
        assert all(not force.any() for force in run.contact_force.values())
        for gap in run.contact_gap.values():
            assert np.all((gap > 997) & (gap < 1000))


def test_a_run_out_of_reach_has_the_record_of_one_in_which_contacts_act():
    """A leg far above the ground, of which only the foot has phases, with a limit and a pair."""
    leg = ball("leg", (0, 0, 9))
    hip = pg.Body(name="hip", axes=((0, 1, 0),), com=(0.1, 0, 0), link=(5, 0, 9), limits=(-3, 3))
    contacts = (
        pg.Contact(name="foot", body="leg", points=((0, 0, -0.2),)),
        pg.Contact(name="shin", body="leg"),
        pg.Contact(name="pair", body="leg", other="rock"),
    )
    bodies = leg, hip, ball("rock", (0, 3, 9))
    mech = pg.Mechanism(pg.Model(bodies=bodies, contacts=contacts))
    far = pg.simulate(mech, t_end=0.1, method="rk4", step=1e-3).contacts
    active = pg.simulate(mech, t_end=0.1, method="moreau_jean", step=1e-3).contacts
    assert set(far.phases) == {"foot", "pair", "hip low limit", "hip high limit"}
    for name in ("force", "slip", "limit", "normal", "phases"):
        ours, theirs = getattr(far, name), getattr(active, name)
        assert list(ours) == list(theirs)
        assert all(np.array_equal(ours[key], theirs[key]) for key in ours), name


LONG = {"method": "rk4", "step": 1e-4, "frames": 2001}  # too long to share memory


@pytest.mark.parametrize("way", [{}, {"rtol": 1e-5, "frames": 11}, LONG], ids=str)
def test_runs_far_and_near_leave_nothing_to_the_next_one(way):
    """Starts of one mechanism that meet a limit and others that do not: the bits of first runs."""
    mech, still = chain(limits=(-1.0, 1.0)), np.zeros(4)
    for q, v in ((0.1 * np.ones(4), still), (still, 9 * np.ones(4)), (0.2 * np.ones(4), still)):
        run = pg.simulate(mech, q, v, t_end=0.2, **way)
        first = pg.simulate(chain(limits=(-1.0, 1.0)), q, v, t_end=0.2, **way)
        assert ("began" in run.header) == v.any()
        for name in ("t", "q", "v", "vdot"):
            assert np.array_equal(getattr(run, name), getattr(first, name)), name
        assert run.counters == first.counters
        assert run.error_estimate == first.error_estimate
        for name, torque in first.contacts.limit.items():
            assert np.array_equal(run.contacts.limit[name], torque)


def test_a_run_includes_contacts_once_a_body_comes_near():
    """A ball falls 1 m and bounces to e² of the height."""
    run = pg.simulate(on_ground(ball(place=(0, 0, 1.1)), restitution=0.5), t_end=0.7)
    assert run.header["method"] == "moreau_jean"
    assert "dop853" in run.header["began"]
    hit = np.sqrt(2 / 9.81)
    after = run.t > hit
    t = run.t[after] - hit
    height = 0.5 * 9.81 * hit * t - 0.5 * 9.81 * t**2
    np.testing.assert_allclose(run.contact_gap["floor"][after], height, atol=1e-8)
    falls = 1 - 0.5 * 9.81 * run.t[~after] ** 2
    np.testing.assert_allclose(run.contact_gap["floor"][~after], falls, atol=1e-8)
    assert run.phases["floor"][0] == "swing"


@pytest.mark.parametrize(("method", "rtol"), [("dopri5", 1e-4), ("dop853", 1e-8)])
def test_a_tip_that_dips_into_the_ground_in_every_turn_hits_it(method, rtol):
    """Without forces, the steps of the rotor would be as wide as the run."""
    rotor = pg.Body(
        name="rotor", axes=((0, 1, 0),), link=(0, 0, 0.99), com=(0, 0, 0), tip=(0, 0, -1), q=2.0,
        inertia=np.eye(3),
    )  # fmt: skip
    law = {"points": ((0, 0, -1),), "restitution": 1.0, "friction": 0.0}
    model = on_ground(rotor, model={"gravity": (0, 0, 0)}, **law)
    run = pg.simulate(model, [2.0], [3.0], t_end=4.0, method=method, rtol=rtol, estimate=False)
    inside = np.arccos(0.99)  # the tip is at or over the ground beyond this angle
    first = (2 * np.pi - inside - 2.0) / 3.0
    turn = (2 * np.pi - 2 * inside) / 3.0
    hits = [event.t for event in run.events]
    np.testing.assert_allclose(hits, first + turn * np.arange(len(hits)), atol=1e-6)
    assert len(hits) == 1 + int((4.0 - first) / turn)


@pytest.mark.parametrize("method", ["rk4", "dopri5"])
def test_a_cart_that_is_pushed_late_hits_its_limit(method):
    """Pushed with 8 m/s² after 0.5 s, it hits a limit 1 m away after 1 s with 4 m/s."""
    cart = pg.Body(
        name="cart", joint="prismatic", axes=((1, 0, 0),), mass=1.0, limits=(-1.0, 1.0),
        limit_restitution=1.0,
    )  # fmt: skip
    still, full = (0.0, 0.0, 0.0), (8.0, 0.0, 0.0)
    table = pg.VectorTable(t=(0.0, 0.5, 0.5 + 1e-6, 3.0), value=(still, still, full, full))
    push = pg.Force(name="push", kind="wrench", body="cart", point=still, force=table)
    mech = pg.Mechanism(pg.Model(bodies=(cart,), forces=(push,), gravity=(0, 0, 0)))
    run = pg.simulate(mech, [0.0], [0.0], t_end=1.2, method=method, step=1e-3, estimate=False)
    assert "began" in run.header
    assert run.q.max() <= 1.0 + 1e-6
    back = 1.2 - 1.0
    np.testing.assert_allclose(run.q[-1], 1.0 - 4 * back + 4 * back**2, atol=2e-3)


@pytest.mark.parametrize("way", [{}, {"rtol": 1e-8}, {"method": "rk4", "step": 1e-3}], ids=str)
def test_a_latch_holds_where_it_closed_when_something_else_comes_near(way):
    """A bead is caught in the air at 0.2 s and released at 1.0 s while another one lands."""
    rail = {"joint": "prismatic", "axes": ((0, 0, 1),)}
    beads = (ball(name="b", place=(0, 0, 3.0), **rail), ball(name="c", place=(1, 0, 1.1), **rail))
    latch = pg.Constraint(name="latch", kind="point", body="b", active=False)
    floors = tuple(pg.Contact(name=f"floor {n}", body=n, restitution=0.0) for n in "bc")
    model = pg.Model(bodies=beads, constraints=(latch,), contacts=floors, gravity=(0, 0, -10))
    switches = [(0.2, "latch", True), (1.0, "latch", False)]
    run = pg.simulate(model, t_end=1.3, switches=switches, estimate=False, **way)
    assert run.status.ok
    assert "began" in run.header
    b, c = run.q.T
    t, fell = run.t, 5 * 0.2**2
    held = (t >= 0.2) & (t <= 1.0)
    np.testing.assert_allclose(b[held], -fell, rtol=0, atol=1e-9)
    np.testing.assert_allclose(b[t > 1.0], -fell - 5 * (t[t > 1.0] - 1.0) ** 2, atol=1e-6)
    landed = t > np.sqrt(0.2) + 2e-3
    np.testing.assert_allclose(c[landed], -1.0, rtol=0, atol=1e-6)
    assert [event.contact for event in run.events if event.contact == "latch"] == ["latch"] * 2


def test_an_event_far_and_near_has_its_instants():
    """A ball passes 0.6 m while nothing is near, and 0.15 m where contacts act, at known times."""
    passes = [lambda t, q, v, z=z: 1.1 + q[2] - z for z in (0.6, 0.15)]
    falling = on_ground(ball(place=(0, 0, 1.1)), restitution=0.5)
    run = pg.simulate(falling, t_end=0.5, events=passes, estimate=False)
    assert "began" in run.header
    found = [(event.number, event.t) for event in run.user_events]
    g, hit = 9.80665, np.sqrt(2 / 9.80665)
    root = np.sqrt(0.25 * 2 * g - 2 * g * 0.05)
    exact = [
        (0, np.sqrt(1.0 / g)),
        (1, np.sqrt(1.9 / g)),
        (1, hit + (0.5 * np.sqrt(2 * g) - root) / g),
    ]
    assert [n for n, _ in found] == [n for n, _ in exact]
    np.testing.assert_allclose([t for _, t in found], [t for _, t in exact], rtol=0, atol=2e-3)


def test_a_slider_that_a_turning_base_carries_outwards_does_not_pass_through_a_post():
    """It moves much farther in a step than from the place where its reach was measured."""
    base = pg.Body(name="base", axes=(0, 0, 1), inertia=np.eye(3) * 1e6, q=(4.393,), v=(24.092,))
    slider = pg.Body(
        name="slider", parent="base", joint="prismatic", axes=(1, 0, 0), mass=1e-3, q=(0.0059,),
        v=(1.771,), inertia=np.eye(3) * 1e-9, shape={"kind": "sphere", "radius": 0.02},
    )  # fmt: skip
    shape = {"kind": "sphere", "radius": 0.03}
    post = pg.Body(name="post", joint="weld", link=(0.813, 0, 0), shape=shape)
    model = pg.Model(
        bodies=[base, slider, post], contacts=[pg.Contact(name="c", body="slider", other="post")],
        gravity=(0, 0, 0), forces=[pg.Spring(name="k", body="slider", stiffness=0.5804)],
    )  # fmt: skip
    run = pg.simulate(model, t_end=0.918, rtol=1e-3, estimate=False, method="dop853", frames=400)
    assert run.contact_gap["c"].min() > -1e-6
