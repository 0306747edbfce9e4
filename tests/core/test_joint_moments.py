"""Joint moments of a tracked motion: filter, plates, residual of the root, band."""

import warnings
from dataclasses import replace

import numpy as np

import pgraph_core as pg
from pgraph_core.capture.filters import filtered, moved
from pgraph_core.capture.tracking import Tracking
from pgraph_core.capture.trial import Plate, Trial
from pgraph_core.dynamics.many import motions

from ..refusals import assert_names, refusal
from ..worlds import built_in
from .test_tracking import four_bar, sites, trial_of, turned_crank, walker


def tracking(mech, t, q, v=None, vdot=None, plates=()):
    """A motion as `track` gives it, without markers."""
    none = np.zeros((len(t), 0, 3))
    trial = Trial(t=t, plates=tuple(plates), up=mech.model.up)
    return Tracking(mech, trial, t, q, (), none, np.zeros(0), np.zeros(len(t)), v, vdot)


def plate(name, t, wrench, up=1):
    """A plate with this wrench (n, 6) about the world's origin, on a plane through it."""
    force, moment = wrench[:, 3:], wrench[:, :3]
    borne = force[:, up] > 20
    lift = np.where(borne, force[:, up], 1.0)
    normal = np.eye(3)[up]
    point = np.where(borne[:, None], np.cross(normal, moment) / lift[:, None], np.nan)
    return Plate(name, t, force, moment, point)


def test_the_root_of_a_simulated_walk_bears_nothing():
    """With its own contact forces; and each plate finds the foot that it bears."""
    mech = built_in("quadruped_hips")
    run = pg.simulate(mech, scenario="trot", t_end=0.25, estimate=False)
    place = motions(mech.packed, run.q, 0 * run.v, 0 * run.v).place
    plates = []
    for contact in mech.model.contacts:
        wrench = run.contacts.force[contact.name].copy()
        body = mech.topology.number(contact.body) - 1
        wrench[:, :3] += np.cross(place[:, body], wrench[:, 3:])
        if wrench.any():
            plates.append((contact.body, plate(contact.name, run.t, wrench)))
    fit = tracking(mech, run.t, run.q, run.v, run.vdot, [p for _, p in plates])
    loads = pg.joint_moments(mech, fit)
    assert np.abs(loads.share).max() < 1e-8
    assert loads.residual == tuple(f"pelvis.{i}" for i in range(6))
    for body, p in plates:
        assert {spell[0] for spell in loads.bears[p.name]} <= {body}
    states = zip(run.q, run.v, run.vdot, loads.external)
    wanted = np.array([mech.inverse_dynamics(*state) for state in states])
    assert np.abs(loads.torque - wanted).max() < 1e-9 * np.abs(wanted).max()


def test_the_filter_attenuates_sines_as_butterworth_says():
    """Forward and backward: the square of its gain, without a shift, in the middle of a record."""
    rate, cutoff, t = 100.0, 6.0, np.arange(600) / 100
    for f in (1.0, 5.0, 9.0):
        x, v, a = filtered(t, np.sin(2 * np.pi * f * t)[:, None], cutoff, 3)
        gain = 1 / (1 + (np.tan(np.pi * f / rate) / np.tan(np.pi * cutoff / rate)) ** 6)
        middle, w = slice(200, 400), 2 * np.pi * f
        assert np.abs(x[middle, 0] - gain * np.sin(w * t[middle])).max() < 1e-9
        # a spline of degree five at 100 Hz: relative errors of (w / 100)^6 / 100 or less
        near = gain * (w / rate) ** 4
        assert np.abs(v[middle, 0] - gain * w * np.cos(w * t[middle])).max() < near * w
        assert np.abs(a[middle, 0] + gain * w**2 * np.sin(w * t[middle])).max() < near * w**2


def test_attitudes_have_the_angular_velocity_of_their_motion():
    mech = walker()
    t, w = np.arange(40) / 100, np.array([0.3, -2.0, 7.0])
    q = np.tile(mech.home()[0], (40, 1))
    for k, x in enumerate(t):  # a constant rate about one axis, past a whole turn
        angle = np.linalg.norm(w) * x
        q[k, 3:7] = (-1) ** (k // 7) * np.array(
            [np.cos(angle / 2), *np.sin(angle / 2) * w / np.linalg.norm(w)]
        )
    _, v, a = moved(mech, t, q, np.inf, 3)
    middle = slice(10, -10)
    assert np.abs(v[middle, :3] - w).max() < 1e-6
    assert np.abs(a[middle, :3]).max() < 1e-4


def foot(name, y):
    return pg.Body(name=name, joint="free", link=(0, y, 0), mass=1)


def two_feet():
    """Two bodies that move on their own, beside each other."""
    model = pg.Model(
        bodies=[foot("left", 0.1), foot("right", -0.1)],
        sites=[pg.Site(name="heel l", body="left"), pg.Site(name="heel r", body="right")], up="z",
        gravity=(0, 0, -9.81),
    )  # fmt: skip
    return pg.Mechanism(model)


def test_a_plate_bears_the_foot_that_is_near_while_it_is_loaded():
    """The other foot is nearer most of the time, but not under load."""
    mech, t = two_feet(), np.arange(60) / 60
    q = np.tile(mech.home()[0], (60, 1))
    right = mech.joints["right"].q.start
    q[:, right + 1] = 0.19  # beside the left foot, whose plate is at y = 0.1
    q[20:30, right + 1] = -0.3
    wrench = np.zeros((60, 6))
    wrench[20:30, 5] = 700.0
    wrench[20:30, 0] = 70.0  # at y = 0.1
    loads = pg.joint_moments(mech, tracking(mech, t, q, plates=[plate("p", t, wrench, 2)]))
    assert [spell[:3] for spell in loads.bears["p"]] == [("left", t[20], t[29])]
    assert np.allclose(loads.external[25, 0, 3:], [0, 0, 700])
    other = pg.joint_moments(mech, tracking(mech, t, q, plates=[plate("p", t, wrench, 2)]),
                             plates={"p": "right"})  # fmt: skip
    assert not other.external[:, 0].any()
    assert np.allclose(other.external[25, 1, 3:], [0, 0, 700])
    both = pg.joint_moments(
        mech, tracking(mech, t, q, plates=[plate(name, t, wrench, 2) for name in "ab"]),
        plates={"a": "right", "b": "auto"},
    )  # fmt: skip
    assert np.array_equal(both.external, loads.external + other.external)


def test_a_plate_that_bears_two_feet_is_named():
    mech, t = two_feet(), np.arange(60) / 60
    wrench = np.zeros((60, 6))
    wrench[20:40, 5] = 700.0
    wrench[20:40, 0] = 70.0
    wrench[31:40, 0] = -70.0  # passes from the left to the right
    fit = tracking(mech, t, np.tile(mech.home()[0], (60, 1)), plates=[plate("p", t, wrench, 2)])
    assert_names(repr(pg.joint_moments(mech, fit)), "p perhaps bears right", "left")


def test_moments_of_a_loop_are_those_of_constrained_inverse_dynamics():
    mech = four_bar()
    q, t = turned_crank(mech, 40), np.arange(40) / 100
    with warnings.catch_warnings(action="ignore"):
        loads = pg.joint_moments(mech, tracking(mech, t, q), cutoff=10)
        for k in range(0, 40, 7):
            tau = mech.constrained_inverse_dynamics(loads.q[k], loads.v[k], loads.vdot[k])
            assert np.abs(loads.torque[k] - tau).max() < 1e-8 * np.abs(tau).max()
        crank = pg.joint_moments(mech, tracking(mech, t, q), cutoff=10, actuated=["crank"])
    assert not crank.torque[:, 1:].any()


def arm():
    bodies = [pg.Body(name="upper", axes=(0, 1, 0), mass=2, com=(0, 0, -0.15), inertia=[0.02] * 3)]
    bodies.append(
        bodies[0].model_copy(update={"name": "fore", "parent": "upper", "link": (0, 0, -0.3)})
    )
    return pg.Mechanism(pg.Model(bodies=bodies, sites=sites("upper", "fore")))


def swung(t):
    """A motion of the arm, and its moments."""
    w, phase, size = np.array([8.0, 6.0]), np.array([0.0, 1.0]), np.array([0.5, 0.7])
    angle = np.outer(t, w) + phase
    q, v, vdot = size * np.sin(angle), size * w * np.cos(angle), -size * w**2 * np.sin(angle)
    return q, arm().inverse_dynamics(q, v, vdot)


def test_the_band_has_the_moment_of_the_motion_in_95_of_100_frames_whatever_the_filter():
    """Of 40 copies with errors of 1 mm. A cut-off of 2 Hz takes most of the motion, which the band
    has nevertheless, and the report names it. 93 to 97 %: copies have a standard error of 1 %."""
    mech, t = arm(), np.arange(60) / 100
    q, true = swung(t)
    clean, inside, rng = trial_of(mech, q, t), [], np.random.default_rng(3)
    for _ in range(40):
        noisy = {k: x + 1e-3 * rng.normal(size=x.shape) for k, x in clean.markers.items()}
        fit = pg.track(mech, replace(clean, markers=noisy))
        loads = pg.joint_moments(mech, fit, cutoff=2, band=True)
        inside.append((loads.low <= true) & (true <= loads.high))
    assert 0.93 <= np.mean(inside) <= 0.97
    assert ((loads.torque < loads.low) | (loads.torque > loads.high)).mean() > 1 / 2
    assert_names(repr(loads), "the filter takes part", "upper in", "fore in")
    other = pg.joint_moments(mech, fit, cutoff=20, band=True)
    assert np.array_equal(other.low, loads.low)


def test_the_band_of_exact_markers_is_the_moment_of_the_motion():
    mech, t = arm(), np.arange(60) / 100
    q, true = swung(t)
    loads = pg.joint_moments(mech, pg.track(mech, trial_of(mech, q, t)), cutoff=2, band=True)
    size = np.abs(true).max()
    assert (loads.high - loads.low).max() < 1e-6 * size
    assert np.abs(loads.high - true)[10:-10].max() < 1e-3 * size  # of the spline, beside its ends


def test_the_band_of_a_smoothed_motion_is_that_of_its_markers():
    mech, t = arm(), np.arange(60) / 100
    clean, rng = trial_of(mech, swung(t)[0], t), np.random.default_rng(3)
    noisy = {k: x + 1e-3 * rng.normal(size=x.shape) for k, x in clean.markers.items()}
    trial = replace(clean, markers=noisy)
    alone, together = (
        pg.joint_moments(mech, pg.track(mech, trial, smooth=smooth), band=True)
        for smooth in (None, True)
    )
    assert np.allclose(together.low, alone.low, atol=1e-6 * np.abs(alone.low).max())
    assert np.allclose(together.high, alone.high, atol=1e-6 * np.abs(alone.low).max())


def test_markers_at_wrong_places_of_their_bodies_do_not_widen_the_band():
    """Errors that stay have no effect on accelerations, and little on the weight."""
    mech, t = arm(), np.arange(60) / 100
    q, true = swung(t)
    moved_sites = [s.model_copy(update={"point": tuple(np.add(s.point, (0.004, 0, 0)))})
                   for s in mech.model.sites]  # fmt: skip
    other = pg.Mechanism(mech.model.replace(sites=moved_sites))
    fit = pg.track(other, trial_of(mech, q, t))
    loads = pg.joint_moments(other, fit, cutoff=20, band=True)
    assert fit.rms.min() > 1e-3
    assert np.median(loads.high - loads.low) < 0.1 * np.abs(true).max()


def test_columns_have_names_units_and_ends_of_the_band(tmp_path):
    mech, t = arm(), np.arange(40) / 100
    out = [pg.Output(name="elbow", kind="joint_position", at="fore")]
    mech = pg.Mechanism(mech.model.replace(outputs=out))
    fit = pg.track(mech, trial_of(mech, np.stack((t, t), 1), t))
    loads = pg.joint_moments(mech, fit, band=True)
    head = loads.to_csv(tmp_path / "id.csv").splitlines()[0]
    wanted = "t [s],upper [N m],upper.low [N m],upper.high [N m],elbow [N m],elbow.low [N m]"
    assert head.startswith(wanted)
    assert np.array_equal(loads["elbow"], loads.torque[:, 1])
    assert_names(str(refusal(lambda: loads["knee"])), "'knee'", "elbow")
    assert_names(repr(loads), "no force plates")


def test_what_cannot_be_computed_is_refused():
    mech, t = arm(), np.arange(40) / 100
    q = np.stack((t, t), 1)
    fit, short = tracking(mech, t, q), tracking(mech, t[:5], q[:5])
    loop = four_bar()
    for call, *facts in (
        (lambda: pg.joint_moments(mech, short), "5 frames", "8"),
        (lambda: pg.joint_moments(mech, fit, cutoff=60), "cutoff", "50 Hz", "60"),
        (lambda: pg.joint_moments(mech, fit, cutoff=-1), "cutoff", "-1"),
        (lambda: pg.joint_moments(mech, fit, order=0), "order", "1 to 10"),
        (lambda: pg.joint_moments(mech, fit, plates={"p": "fore"}), "plates", "'p'"),
        (lambda: pg.joint_moments(mech, fit, plates=3), "plates", "'auto'"),
        (lambda: pg.joint_moments(mech, fit, actuated=["fore"]), "actuated", "loops"),
        (lambda: pg.joint_moments(walker(), fit), "fit", "2 coordinates"),
        (lambda: pg.joint_moments(mech, 3), "fit", "pg.Trial"),
        (lambda: pg.joint_moments(loop, tracking(loop, t, turned_crank(loop, 40)), band=True),
         "band", "loops"),
        (lambda: pg.joint_moments(mech, Trial(t=t, coordinates={"knee": t})), "knee", "upper"),
    ):  # fmt: skip
        assert_names(str(refusal(call)), *facts)
