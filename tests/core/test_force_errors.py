"""Errors of contact forces, creep of soft contacts, and depth that their laws do not allow for."""

import re

import numpy as np
import pytest

import pgraph_core as pg

from ..nights import at_night
from ..worlds import ball, box, on_ground

G = 9.81


def force(run):
    return run.contact_force["floor"][:, 3:]


@pytest.mark.parametrize("rtol", [1e-4, 1e-5, 1e-7])
def test_the_error_of_soft_forces_is_that_against_an_exact_run(rtol):
    model = on_ground(ball(place=(0, 0, 0.15)), law="soft", friction=0.3, restitution=0.5)
    t = np.r_[0.0, np.linspace(0.1, 0.104, 81)]  # the impact takes 1 ms
    exact = pg.simulate(model, t_eval=t, rtol=1e-9, estimate=False)
    run = pg.simulate(model, t_eval=t, rtol=rtol)
    error = np.linalg.norm(force(run) - force(exact), axis=1).max()
    peak = np.linalg.norm(force(exact), axis=1).max()
    assert 0.3 < run.force_error / error < 3.0
    assert run.force_error == run.force_error_at.max()
    assert run.relative_force_error == pytest.approx(run.force_error / peak, rel=0.05)
    told = [text for text in run.notices if "the error of contact and limit forces" in text]
    assert len(told) == (error > 0.1 * peak)


def test_the_error_of_mean_forces_covers_the_time_of_an_impact():
    model = on_ground(
        ball(place=(0, 0, 0.6), v=(0, 1, 0, 0.3, 0, 0)), friction=0.3, restitution=0.5
    )
    t = np.linspace(0.0, 1.0, 38)
    run = pg.simulate(model, t_eval=t, method="moreau_jean", step=5e-3)
    fine = pg.simulate(model, t_eval=t, method="moreau_jean", step=1e-4, estimate=False)
    error = np.linalg.norm(force(run) - force(fine), axis=1)[1:].max()
    assert 0.1 < run.force_error / error < 10.0


def swinging(stop):
    """A pendulum on a base that rests on the ground, or on the limit of its joint."""
    base = pg.Body(
        name="b", joint="prismatic", axes=((0, 0, 1),), mass=3.0,
        limits=((0.0, None),) if stop else None,
    )  # fmt: skip
    rod = pg.Body(
        name="rod", parent="b", axes=((0, 1, 0),), mass=1.0, com=(0, 0, -0.5), q=(2.0,),
        inertia=(0.01,) * 3,
    )  # fmt: skip
    floor = pg.Contact(name="floor", body="b", points=((0, 0, 0),))
    return pg.Model(bodies=[base, rod], contacts=[] if stop else [floor])


@pytest.mark.parametrize("stop", [False, True])
@pytest.mark.parametrize("options", [{"rtol": 1e-4}, {"method": "rk4", "step": 0.05}])
def test_the_error_of_forces_from_event_to_event_is_that_against_an_exact_run(stop, options):
    def pushes(run):
        return next(iter(run.contacts.limit.values())) if stop else force(run)[:, 2]

    call = {"t_end": 1.0, "frames": 51}
    exact = pg.simulate(swinging(stop), rtol=1e-11, estimate=False, **call)
    run = pg.simulate(swinging(stop), **call, **options)
    error = np.abs(pushes(run) - pushes(exact))
    peak = np.abs(pushes(exact)).max()
    assert 0.3 < run.force_error / error.max() < 3.0
    assert run.force_error_at.argmax() == pytest.approx(error.argmax(), abs=2)
    assert run.relative_force_error == pytest.approx(run.force_error / peak, rel=0.05)


def test_the_error_of_forces_is_kept_in_files(tmp_path):
    run = pg.simulate(on_ground(ball(place=(0, 0, 0.2)), law="soft"), t_end=0.3, rtol=1e-6)
    run.save(tmp_path / "run.npz")
    assert np.array_equal(pg.Result.load(tmp_path / "run.npz").force_error_at, run.force_error_at)
    assert np.isnan(pg.simulate(run.model, t_end=0.1, estimate=False).force_error)


@pytest.mark.parametrize("size", [0.004, 4.0, *at_night(0.1)])
def test_creep_of_soft_contacts_scales_with_the_bodies_and_is_in_the_estimate(size):
    tilt = np.arctan(0.4)
    stuck = box("b", (0, 0, 0.125 * size), (size, 0.75 * size, 0.25 * size), mass=2.0 * size**3)
    down = {"gravity": (G * np.sin(tilt), 0, -G * np.cos(tilt))}
    model = on_ground(stuck, model=down, law="soft", friction=0.5)
    unit = np.sqrt(size / G)
    run = pg.simulate(model, t_end=8.0 * unit)
    crept, gyration = run.position["b"][-1, 0], np.sqrt((1 + 0.75**2 + 0.25**2) / 12)
    assert crept / size == pytest.approx(8.0 * 0.4 / 0.3 * 1e-3 * np.sqrt(gyration), rel=0.01)
    assert 0.3 * crept < run.error_estimate < 3.0 * crept


def squeezed(law, size=0.04, speed=1.0, **given):
    def finger(name, x):
        return pg.Body(
            name=name, joint="prismatic", axes=[(1, 0, 0)], mass=0.1, link=(x, 0, 1),
            v=(-np.sign(x) * speed,), shape={"kind": "box", "size": (0.02, 0.03, 0.06)},
        )  # fmt: skip

    held = box("b", (0, 0, 1), (size,) * 3, mass=0.2)
    drives = [
        pg.Motion(name=f"m{o}", body=o, q_of_t=pg.Polynomial(coefficients=(0, s * speed)))
        for o, s in (("l", 1), ("r", -1))
    ]
    contacts = [pg.Contact(name=f"c{o}", body="b", other=o, law=law, **given) for o in "lr"]
    bodies = [finger("l", -0.04), finger("r", 0.04), held]
    return pg.Model(bodies=bodies, gravity=(0, 0, 0), contacts=contacts, constraints=drives)


@pytest.mark.parametrize("law", ["soft", "penalty"])
def test_bodies_pressed_into_each_other_are_named(law):
    call = {"t_end": 0.02, "frames": 11, "estimate": False}  # they meet at 0.01 s
    run = pg.simulate(squeezed(law), **call)
    (told,) = [text for text in run.notices if "penetrated by" in text]
    assert "of 'b' and 'l'" in told or "of 'b' and 'r'" in told
    assert "of the thickness of the touching shapes (0.02 m)" in told
    assert "constraints 'ml' and 'mr' drive 'b'" in told
    assert "which cannot stop it" in told


@pytest.mark.parametrize("law", ["soft", "penalty"])
def test_the_stiffness_that_a_deep_contact_is_told_helps(law):
    falling = ball(place=(0, 0, 0.6), mass=1.0)
    stiffness = 3e3 if law == "soft" else 1e3
    model = on_ground(falling, law=law, stiffness=stiffness, restitution=0.5)
    run = pg.simulate(model, t_end=1.0, estimate=False)
    (told,) = [text for text in run.notices if "penetrated by" in text]
    assert "contact 'floor' of 'b' and the ground" in told
    needed = float(told.split("give it a stiffness of ")[1].split()[0])
    better = on_ground(falling, law=law, stiffness=needed, restitution=0.5)
    assert not [x for x in pg.simulate(better, t_end=1.0, estimate=False).notices if "penetr" in x]


def about_depth(run):
    words = "penetrated by", " deep,", "rates of about", "overlap"
    return [text for text in run.notices if any(word in text for word in words)]


@pytest.mark.parametrize("height", [0.05, 0.1, 0.6])  # the ball overlaps, touches and falls
@pytest.mark.parametrize(
    ("law", "stiffness"), [("soft", 200.0), ("soft", 2e3), ("soft", 4.6e8), ("penalty", 200.0),
                           ("penalty", 2e3), ("penalty", 1e5), ("complementarity", None)],
)  # fmt: skip
def test_what_deep_contacts_are_told_is_of_one_mind_and_helps(law, stiffness, height):
    """All that a run says is done at once, and nothing is left to say about the depth."""
    given = {"t_end": 0.4, "step": 1e-3} if law == "complementarity" else {"t_end": 0.4}
    own = {"law": law} | ({"stiffness": stiffness} if stiffness else {})
    told = about_depth(pg.simulate(on_ground(ball(place=(0, 0, height)), **own), **given))
    asked = [float(x) for text in told for x in re.findall(r"a stiffness of ([\d.e+]+)", text)]
    assert not any(word in text for text in told for word in ("smaller step", "less stiffness"))
    assert len(asked) <= 1
    assert not asked or asked[0] > stiffness
    overlaps = [text for text in told if "start without overlap" in text]
    assert bool(overlaps) == (height < 0.1)
    better = own | ({"stiffness": asked[0]} if asked else {})
    higher = on_ground(ball(place=(0, 0, max(height, 0.1))), **better)
    assert not about_depth(pg.simulate(higher, **given))


def test_a_smaller_step_is_told_where_it_helps():
    """A bar that spins at 10 turns a second meets the ground."""
    spin = box("s", (0, 0, 0.3), (0.4, 0.05, 0.05), v=(30, 50, 10, 0, 0, -10))
    model = on_ground(spin, friction=0.5, restitution=0.5)
    given = {"t_end": 0.5, "estimate": False}
    (told,) = about_depth(pg.simulate(model, step=0.05, **given))
    assert "use a smaller step" in told
    assert not about_depth(pg.simulate(model, step=0.01, **given))


def test_a_limit_that_is_passed_at_the_start_is_told_to_start_within():
    arm = pg.Body("a", axes=(0, 1, 0), inertia=(0.1,) * 3, q=0.5, limits=((-1.0, 0.4),))
    model = pg.Model([arm])
    told = [text for text in pg.simulate(model, t_end=0.2).notices if "limit" in text]
    assert any("start within the limit" in text for text in told)
    assert not any("smaller step" in text for text in told)
    assert not pg.simulate(model.edit("a", q=0.4), t_end=0.2).notices


@pytest.mark.parametrize("law", ["soft", "penalty"])
def test_steps_that_hard_contacts_do_not_resolve_are_told_what_helps(law):
    """At a smaller stiffness, friction and damping have the same rates."""
    model = on_ground(ball(place=(0, 0, 0.12)), law=law, stiffness=5e4, friction=0.5)
    (told,) = about_depth(pg.simulate(model, t_end=0.1, method="rk4", step=0.02, estimate=False))
    step = float(told.split("give ")[1].split()[0])
    for given in ({"method": "rk4", "step": step}, {"method": "dop853", "rtol": 1e-6}):
        assert not about_depth(pg.simulate(model, t_end=0.1, estimate=False, **given))
    assert "method='dop853' with rtol=" in told


@pytest.mark.parametrize("method", ["moreau_jean", "semi_implicit_euler", "rk4"])
def test_an_energy_balance_that_is_violated_is_told_for_every_method(method):
    limits = (-3.0, 3.0) if method == "moreau_jean" else (None, None)
    arm = pg.Body(
        name="a", axes=[(0, 1, 0)], mass=1.0, com=(0.5, 0, 0), inertia=(0.1,) * 3, limits=limits
    )
    stiff = pg.Spring(name="s", body="a", point=(1, 0, 0), other_point=(1, 0, 1), stiffness=4e3)
    model = pg.Model(bodies=[arm], forces=[stiff])
    run = pg.simulate(model, t_end=0.5, step=0.012, method=method)
    assert run.energy_drift > 0.01
    assert [x for x in run.notices if "energy balance" in x or "the error is" in x]
