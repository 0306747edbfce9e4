"""Contacts and limits that nothing comes near: the same bits as without them, and what follows."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

import pgraph_core as pg


def chain(limits=None, law=None):
    """Four links, perhaps with limits, or with contacts with a wall 1 km away."""
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
    wall = pg.Body(
        name="wall", joint="weld", link=(1000, 0, 0), shape={"kind": "box", "size": (1, 1, 1)}
    )
    contacts = tuple(pg.Contact(name=b.name, body=b.name, other="wall", law=law) for b in bodies)
    return pg.Mechanism(pg.Model(bodies=(*bodies, wall), contacts=contacts))


LAWS = ("complementarity", "soft", "penalty")
WAYS = [
    {},
    {"step": 1e-3},
    {"rtol": 1e-5},
    *({"method": name, "step": 1e-3} for name in ("rk4", "semi_implicit_euler", "radau5", "ros2")),
    {"method": "dop853"},
    {"method": "dopri5"},
]


@pytest.mark.parametrize("way", WAYS, ids=str)
def test_what_never_comes_near_changes_no_bit(way):
    """Limits at 1000 rad, contacts of each law 1 km away: method, steps and states as without."""
    bare = pg.simulate(chain(), t_end=0.5, **way)
    for far in (chain(limits=(-1000, 1000)), *(chain(law=law) for law in LAWS)):
        run = pg.simulate(far, t_end=0.5, **way)
        assert run.header["method"] == bare.header["method"]
        assert run.counters["steps"] == bare.counters["steps"]
        for name in ("t", "q", "v", "vdot"):
            assert np.array_equal(getattr(run, name), getattr(bare, name))
        assert run.error_estimate == bare.error_estimate
        assert all(not force.any() for force in run.contact_force.values())
        for gap in run.contact_gap.values():
            assert np.all((gap > 997) & (gap < 1000))


WELD = pg.Constraint(name="weld", kind="weld", body="a3", active=False)
FAR = {
    "limits": (chain(), chain(limits=(-1000, 1000))),
    "contacts": (pg.Mechanism(pg.Model(bodies=chain(law="soft").model.bodies)), chain(law="soft")),
    "an inactive weld": (chain(), pg.Mechanism(chain().model.add(WELD))),
}


@pytest.mark.parametrize("what", FAR)
def test_what_never_comes_near_takes_no_memory(what):
    """Within 5 % of what runs without it hold at once, where they are too long to be kept."""

    def held(mech):
        tracemalloc.start()
        run = pg.simulate(mech, t_end=0.2, frames=2001, step=1e-4, method="rk4", estimate=False)
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert len(run.t) == 2001
        return most

    bare, laden = (min(held(mech) for _ in range(3)) for mech in FAR[what])
    assert laden <= 1.05 * bare


def test_long_runs_leave_nothing_to_the_next_one():
    """One that meets a limit, one that does not, one again: too long to go on in one workplace."""
    mech, way = chain(limits=(-1.0, 1.0)), {"t_end": 0.3, "frames": 3001, "step": 1e-4}
    for q, v in ((0.1, 0.0), (0.0, 9.0), (0.1, 0.0)):
        start = np.full(4, q), np.full(4, v)
        run = pg.simulate(mech, *start, method="rk4", **way)
        first = pg.simulate(chain(limits=(-1.0, 1.0)), *start, method="rk4", **way)
        assert ("began" in run.header) == (v > 0)
        assert np.array_equal(run.q, first.q)


@pytest.mark.parametrize("law", LAWS)
def test_what_rests_far_from_all_it_may_touch_is_far(law):
    """Nothing moves at all, and the wall is 1 km away: no contact comes into the run."""
    mech = chain(law=law)
    run = pg.simulate(mech, np.zeros(4), t_end=0.1, method="rk4", step=1e-3)
    assert (run.header["method"], "began" in run.header) == ("rk4", False)
    assert np.array_equal(run.q[-1], run.q[0])


@pytest.mark.parametrize("way", [{}, {"step": 1e-3}, {"rtol": 1e-5}, WAYS[3], WAYS[7]], ids=str)
def test_runs_far_and_near_leave_nothing_to_the_next_one(way):
    """One mechanism, starts that meet a limit and others that do not: the bits of first runs."""
    mech, still = chain(limits=(-1.0, 1.0)), np.zeros(4)
    for q, v in ((0.1 * np.ones(4), still), (still, 9 * np.ones(4)), (0.2 * np.ones(4), still)):
        run = pg.simulate(mech, q, v, t_end=0.2, frames=11, **way)
        first = pg.simulate(chain(limits=(-1.0, 1.0)), q, v, t_end=0.2, frames=11, **way)
        for name in ("t", "q", "v", "vdot"):
            assert np.array_equal(getattr(run, name), getattr(first, name)), name
        assert run.counters == first.counters
        assert run.error_estimate == first.error_estimate
        for name, torque in first.contacts.limit.items():
            assert np.array_equal(run.contacts.limit[name], torque)


def test_a_run_goes_on_with_contacts_where_something_comes_near():
    """A ball that falls 1 m: smooth until then, and bounces to e² of the height."""
    ball = pg.Body(
        name="b", joint="free", link=(0, 0, 1.1), shape={"kind": "sphere", "radius": 0.1}
    )
    floor = pg.Contact(name="floor", body="b", restitution=0.5)
    run = pg.simulate(pg.Mechanism(pg.Model(bodies=(ball,), contacts=(floor,))), t_end=0.7)
    assert run.header["method"] == "moreau_jean"
    assert run.header["began"].startswith("dop853 until something came near at t = 0.")
    hit = np.sqrt(2 / 9.81)
    after = run.t > hit
    t = run.t[after] - hit
    height = 0.5 * 9.81 * hit * t - 0.5 * 9.81 * t**2
    np.testing.assert_allclose(run.contact_gap["floor"][after], height, atol=1e-8)
    falls = 1 - 0.5 * 9.81 * run.t[~after] ** 2
    np.testing.assert_allclose(run.contact_gap["floor"][~after], falls, atol=1e-8)
    assert run.phases["floor"][0] == "swing"


@pytest.mark.parametrize(("method", "rtol"), [("dopri5", 1e-8), ("dopri5", 1e-4), ("dop853", 1e-8)])
def test_a_tip_that_dips_under_the_ground_in_every_turn_is_seen(method, rtol):
    """A rotor without forces, whose steps would be as wide as the run."""
    rotor = pg.Body(
        name="rotor", axes=((0, 1, 0),), link=(0, 0, 0.99), com=(0, 0, 0), tip=(0, 0, -1), q=2.0,
        inertia=np.eye(3),
    )  # fmt: skip
    tip = pg.Contact(name="tip", body="rotor", points=((0, 0, -1),), restitution=1.0, friction=0.0)
    mech = pg.Mechanism(pg.Model(bodies=(rotor,), gravity=(0, 0, 0), contacts=(tip,)))
    run = pg.simulate(mech, [2.0], [3.0], t_end=4.0, method=method, rtol=rtol, estimate=False)
    inside = np.arccos(0.99)  # the tip is at or over the ground beyond this angle
    first = (2 * np.pi - inside - 2.0) / 3.0
    turn = (2 * np.pi - 2 * inside) / 3.0
    hits = [event.t for event in run.events]
    np.testing.assert_allclose(hits, first + turn * np.arange(len(hits)), atol=1e-6)
    assert len(hits) == 1 + int((4.0 - first) / turn)


@pytest.mark.parametrize("law", ["soft", "penalty"])
@pytest.mark.parametrize("speed", [1.0, 1000.0])
def test_soft_balls_hit_and_give_the_restitution_asked_for(law, speed):
    """Two balls 10 m apart at the default settings: momentum, and Newton's restitution."""
    balls = tuple(
        pg.Body(name=name, joint="prismatic", axes=((1, 0, 0),), link=(x, 0, 0),
                shape={"kind": "sphere", "radius": 0.01})
        for name, x in (("a", 0.0), ("b", 10.02))
    )  # fmt: skip
    hit = pg.Contact(name="hit", body="a", other="b", law=law, restitution=0.5)
    mech = pg.Mechanism(pg.Model(bodies=balls, gravity=(0, 0, 0), contacts=(hit,)))
    run = pg.simulate(mech, [0.0, 0.0], [speed, 0.0], t_end=12 / speed, estimate=False)
    np.testing.assert_allclose(run.v[-1], [0.25 * speed, 0.75 * speed], rtol=0.01)


@pytest.mark.parametrize("method", ["rk4", "dopri5"])
def test_what_rests_and_then_is_pushed_is_looked_at_again(method):
    """Nothing moves for 0.5 s, then 8 m/s² towards a limit 1 m away: hit at t = 1 s with 4 m/s."""
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
