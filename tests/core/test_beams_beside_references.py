"""Beams follow independent models of elastic rods, written here with SciPy."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import eigh
from scipy.optimize import fsolve

import pgraph_core as pg
from pgraph_core.rotation import skew

# -- Kane's spin-up --------------------------------------------------------------------------------

LENGTH, STIFFNESS, DENSITY, SPEED, RISE = 10.0, 1.4e4, 1.2, 6.0, 15.0
KANE = "=if(t < 15, 6/15*(t^2/2 + (15/(2*pi))^2*(cos(2*pi*t/15) - 1)), 45 + 6*(t - 15))"
SOFT = "=if(t < 15, 90*(7*(t/15)^5 - 14*(t/15)^6 + 10*(t/15)^7 - 2.5*(t/15)^8), 45 + 6*(t - 15))"


def kane_rate(s):
    """The hub's rate and acceleration over Ω and Ω/T, of Kane's law, with s = t/T."""
    return s - math.sin(2 * math.pi * s) / (2 * math.pi), 1 - math.cos(2 * math.pi * s)


def soft_rate(s):
    """The same of a law whose first three derivatives vanish at both ends."""
    return 35 * s**4 - 84 * s**5 + 70 * s**6 - 20 * s**7, 140 * (s * (1 - s)) ** 3


def bending(rate, times):
    """The tip of a linear beam with centrifugal stiffening, by four modes of a polynomial basis."""
    x, w = np.polynomial.legendre.leggauss(40)
    x, w = (x + 1) / 2, w / 2
    powers = np.arange(2, 10)[:, None]
    f, df, ddf = x**powers, powers * x ** (powers - 1), powers * (powers - 1) * x ** (powers - 2)
    mass = DENSITY * LENGTH * (f * w) @ f.T
    bend = STIFFNESS / LENGTH**3 * (ddf * w) @ ddf.T
    pull = DENSITY * LENGTH * (df * w * (1 - x**2) / 2) @ df.T
    squares, modes = eigh(bend, mass)
    squares, modes = squares[:4], modes[:, :4]
    spun = modes.T @ pull @ modes - np.eye(4)
    load = modes.T @ (DENSITY * LENGTH**2 * (f * w) @ x)

    def rates(t, y):
        turning, speeding = rate(t / RISE) if t < RISE else (1.0, 0.0)
        stiff = np.diag(squares) + (SPEED * turning) ** 2 * spun
        return np.append(y[4:], -load * SPEED / RISE * speeding - stiff @ y[:4])

    found = solve_ivp(
        rates, (0, times[-1]), np.zeros(8), method="DOP853", rtol=1e-9, atol=1e-11, t_eval=times
    )
    return modes.sum(axis=0) @ found.y[:4]


def tip_beside(turn, n):
    """The tip of Pgraph's beam across the axis of its hub, and the times."""
    hub = pg.Body(name="hub", axes=(0, 0, 1), mass=0.0, inertia=(1, 1, 1))
    rod = pg.Beam(
        name="rod", parent="hub", length=LENGTH, EI=STIFFNESS, rho_a=DENSITY, strains=("bend_z",),
        nodes=n,
    )  # fmt: skip
    motion = pg.Motion(name="turn", body="hub", q_of_t=turn)
    model = pg.Model(bodies=[hub], beams=[rod], constraints=[motion], gravity=(0, 0, 0))
    call = {"t_end": 20.0, "method": "radau5", "rtol": 1e-8, "frames": 801, "estimate": False}
    run = pg.simulate(model, **call)
    at, turned = run.position["rod"], run["hub"]
    return np.cos(turned) * at[:, 1] - np.sin(turned) * at[:, 0], run.t


@pytest.mark.parametrize(
    ("turn", "rate", "left"),
    [pytest.param(KANE, kane_rate, 3.6e-3, id="kane"),
     pytest.param(SOFT, soft_rate, 1.7e-3, id="soft")],
)  # fmt: skip
def test_the_vibration_after_a_spin_up_is_that_of_its_law(turn, rate, left):
    """A law of finite length leaves a vibration, which nothing damps.

    That of Kane has a jump in the third derivative of its speed, and the softer one in the fourth.
    """
    found, times = tip_beside(turn, 32)
    after = times > RISE
    exact = bending(rate, times)
    assert np.abs(found[after]).max() == pytest.approx(left, rel=0.03)
    assert found[after] == pytest.approx(exact[after], abs=3e-4)


# -- statics in space ------------------------------------------------------------------------------


def hanging_rod(length, stiff, force):
    """The tip and the turned axes of Kirchhoff's rod with a dead load at its tip, by shooting."""

    def rates(_, y):
        turned, moment = y[3:12].reshape(3, 3), y[12:]
        curved = moment / stiff
        change = -np.cross(curved, moment) - np.cross((1.0, 0.0, 0.0), turned.T @ force)
        return np.concatenate((turned[:, 0], (turned @ skew(curved)).ravel(), change))

    def shot(moment):
        start = np.concatenate((np.zeros(3), np.eye(3).ravel(), moment))
        return solve_ivp(rates, (0, length), start, method="DOP853", rtol=1e-11, atol=1e-12).y[
            :, -1
        ]

    root = np.cross((length, 0.0, 0.0), force)
    end = shot(fsolve(lambda moment: shot(moment)[12:], root, xtol=1e-11))
    return end[:3], end[3:12].reshape(3, 3)


@pytest.mark.parametrize("degrees", [0, 30, 60, 90])
def test_a_strip_that_bends_both_ways_also_twists_as_a_rod_of_kirchhoff(degrees):
    """A strip with the sizes of the Princeton beam, loaded between its stiff and its weak axis."""
    width, height, load = 0.0123770, 0.0032024, 13.345
    about = math.radians(degrees)
    force = load * np.array((0.0, math.cos(about), -math.sin(about)))
    ends = []
    for n in (20, 40):
        rod = pg.Beam(
            name="rod", length=0.508, section=("rectangle", width, height), E=71.7e9, G=27.37e9,
            density=2700, nodes=n,
        )  # fmt: skip
        wrench = pg.Wrench(name="P", body="rod", force=force)
        mech = pg.Mechanism(pg.Model(beams=[rod], forces=[wrench], gravity=(0, 0, 0)))
        ends.append(mech.pose(mech.equilibrium(), "rod"))
    place, turned = hanging_rod(0.508, np.array((rod.stiff.GJ, *rod.stiff.EI)), force)
    errors = [np.linalg.norm(end.position - place) for end in ends]
    twists = [np.abs(end.rotation - turned).max() for end in ends]
    better = ends[1].position + (ends[1].position - ends[0].position) / 3
    assert errors[0] < 1e-3 * 0.508
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)
    assert better == pytest.approx(place, abs=1e-5 * 0.508)
    assert twists[1] < 1e-3


def test_moments_of_all_segments_are_those_of_their_strains():
    """Segments in turns have their motions in reverse order, which columns do not show."""
    rod = pg.Beam(
        name="rod", length=1.0, EI=(2.0, 3.0), GJ=1.0, rho_a=1e-3, rho_j=1e-6, nodes=6,
        damping_ratio=0.5,
    )  # fmt: skip
    wrench = pg.Wrench(name="w", body="rod", torque=(1e-3, 2e-3, 3e-3))
    model = pg.Model(beams=[rod], forces=[wrench], gravity=(0, 0, 0))
    run = pg.simulate(model, t_end=5.0, estimate=False)
    for strain, moment in (("twist", 1e-3), ("bend_y", 2e-3), ("bend_z", 3e-3)):
        found = [run[f"moment.rod[{k}].{strain}"][-1] for k in range(1, 7)]
        assert found == pytest.approx([moment] * 6, abs=2e-5)


def test_a_start_bent_both_ways_has_one_shape_with_other_segments():
    rod = pg.Beam(
        name="rod", length=1.0, EI=1.0, GJ=1.0, rho_a=1.0, rho_j=0.01, nodes=8, damping_ratio=0.05
    )
    model = pg.Model(beams=[rod], gravity=(0, 0, 0))
    bent = np.concatenate([(0.0, 0.02, 0.06)[:: 1 if k % 2 else -1] for k in range(1, 9)])
    run = pg.simulate(model, q=bent, t_end=0.05, rtol=1e-6, frames=3)
    assert run.space_error_at[0] < 1e-3


# -- dynamics --------------------------------------------------------------------------------------

ARM, ROD, BEND, MASS, SLIDER = 0.1, 0.4, 0.5, 0.6, 0.2


def pinned_rod(n, times):
    """The places of the middle and of the slider, with n + 1 masses joined by elastic rods."""
    h = ROD / n
    mass = np.full(n, MASS * h)
    mass[-1] = MASS * h / 2 + SLIDER

    def rates(t, y):
        x = y[: 2 * n].reshape(n, 2)
        turned = 10 * t * t
        first = (ARM * math.cos(turned), -ARM * math.sin(turned))
        d = np.diff(np.vstack((first, x)), axis=0)
        size = np.hypot(*d.T)
        moment = np.zeros(n + 1)
        moment[1:-1] = BEND / h * np.diff(np.arctan2(d[:, 1], d[:, 0]))
        pull = (1e5 * (size / h - 1) / size)[:, None] * d
        turning = np.column_stack((-d[:, 1], d[:, 0])) / (size**2)[:, None]
        pull += (moment[:-1] - moment[1:])[:, None] * turning
        force = -pull
        force[:-1] += pull[1:]
        rate = force / mass[:, None]
        rate[-1, 1] = 0.0  # the slider stays in its guide
        return np.append(y[2 * n :], rate.ravel())

    start = np.zeros((2 * n, 2))
    start[:n, 0] = ARM + h * np.arange(1, n + 1)
    call = {"method": "DOP853", "rtol": 1e-8, "atol": 1e-10, "t_eval": times}
    y = solve_ivp(rates, (0, times[-1]), start.ravel(), **call).y
    return y[n - 2 : n].T, y[2 * n - 2]


def slider_crank(n):
    crank = pg.Body(name="crank", axes=(0, 1, 0), inertia=(1e-3,) * 3, tip=(ARM, 0, 0))
    pin = pg.Body(name="pin", parent="crank", axes=(0, 1, 0), link=(ARM, 0, 0), mass=0.0)
    slider = pg.Body(
        name="slider", joint="prismatic", axes=(1, 0, 0), link=(ARM + ROD, 0, 0), mass=SLIDER
    )
    rod = pg.Beam(
        name="rod", parent="pin", length=ROD, EI=BEND, rho_a=MASS, strains=("bend_y",), nodes=n
    )
    ends = {"point": (0, 0, 0), "other_point": (0, 0, 0)}
    joint = pg.Point(name="joint", body="rod", other="slider", **ends)
    drive = pg.Motion(name="drive", body="crank", q_of_t="=10*t^2")
    model = pg.Model(
        bodies=[crank, pin, slider], beams=[rod], constraints=[joint, drive], gravity=(0, 0, 0),
        sites=[pg.Site(name="middle", body="rod@0.5")],
    )  # fmt: skip
    call = {"t_end": 0.6, "rtol": 1e-8, "method": "radau5", "frames": 121, "estimate": False}
    run = pg.simulate(model, **call)
    assert run.success
    return run.t, run.position["rod@0.5"][:, [0, 2]], run.position["slider"][:, 0]


def bent(times, middle, slider):
    """The deflection of the middle from the line between both pins."""
    turned = 10 * times**2
    start = ARM * np.column_stack((np.cos(turned), -np.sin(turned)))
    end = np.column_stack((slider, np.zeros(len(slider))))
    along = (end - start) / np.linalg.norm(end - start, axis=1)[:, None]
    off = middle - (start + end) / 2
    return along[:, 0] * off[:, 1] - along[:, 1] * off[:, 0]


@pytest.mark.nightly
def test_the_rod_of_a_slider_crank_bends_as_a_chain_of_masses():
    """Its connecting rod bends by 1.86 mm, and both models approach the same motion."""
    ours = [bent(*slider_crank(n)) for n in (10, 20)]
    times = np.linspace(0, 0.6, 121)
    theirs = [bent(times, *pinned_rod(n, times)) for n in (20, 40)]
    better, other = (x[1] + (x[1] - x[0]) / 3 for x in (ours, theirs))
    assert np.abs(other).max() == pytest.approx(1.861e-3, rel=1e-3)
    assert ours[1] == pytest.approx(other, abs=1e-5)
    assert better == pytest.approx(other, abs=1e-5)


def elbow(per):
    """The places of the corner and the tip of a right angle that a load across its plane moves."""
    rod = pg.Beam(
        name="rod", points=((10, 0, 0), (10, 10, 0)), EI=1e3, GJ=1e3, rho_a=1.0, rho_j=20.0,
        nodes=2 * per,
    )  # fmt: skip
    load = "=if(t < 1, 50*t, if(t < 2, 50*(2 - t), 0))"
    wrench = pg.Wrench(name="P", body="rod@0.5", force=(0, 0, load))
    model = pg.Model(beams=[rod], forces=[wrench], gravity=(0, 0, 0))
    call = {"t_end": 10.0, "method": "radau5", "rtol": 1e-6, "frames": 101, "estimate": False}
    run = pg.simulate(model, **call)
    return np.hstack((run.position["rod@0.5"], run.position["rod"])), run.t


def turns_of(matrices):
    """The rotation vectors of matrices (n, 3, 3)."""
    a, b, c = np.moveaxis(matrices - np.swapaxes(matrices, 1, 2), 0, -1)
    across = np.stack((c[1], a[2], b[0]), axis=1) / 2
    sine, cosine = np.linalg.norm(across, axis=1), (np.trace(matrices, axis1=1, axis2=2) - 1) / 2
    return (np.arctan2(sine, cosine) / np.maximum(sine, 1e-300))[:, None] * across


def staggered_elbow(per, times):
    """The same by a Cosserat rod on a staggered grid, with masses between rotating pieces."""
    n, h, stiff = 2 * per, 10 / per, 1e6
    inertia, mass = h * np.array((20.0, 10.0, 10.0)), np.full(n, h)
    mass[-1] = h / 2
    corner = np.array(((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)))
    rest = np.array([np.eye(3)] * n)
    rest[per] = corner
    bend = np.full(n, 1e3 / h)
    bend[0] *= 2  # half a cell is between the root and the first rotation

    def rates(t, y):
        x, v, spin = y[: 3 * n].reshape(n, 3), y[3 * n : 6 * n], y[15 * n :].reshape(n, 3)
        turned = y[6 * n : 15 * n].reshape(n, 3, 3)
        d = np.diff(np.vstack((np.zeros(3), x)), axis=0)
        strain = np.einsum("kji,kj->ki", turned, d) / h - (1.0, 0.0, 0.0)
        pull = stiff * np.einsum("kij,kj->ki", turned, strain)
        force = -pull
        force[:-1] += pull[1:]
        force[per - 1, 2] += max(0.0, 50 * min(t, 2 - t))
        before = np.concatenate((np.eye(3)[None], turned[:-1]))
        between = np.einsum("kji,kjl,kml->kim", before, turned, rest)
        moment = np.einsum("kij,kj->ki", before, turns_of(between)) * bend[:, None]
        torque = np.cross(d, pull) - moment
        torque[:-1] += moment[1:]
        own = np.einsum("kji,kj->ki", turned, torque)
        rate = (own - np.cross(spin, inertia * spin)) / inertia
        change = np.cross(turned, spin[:, None])
        return np.concatenate((v, (force / mass[:, None]).ravel(), change.ravel(), rate.ravel()))

    x = np.zeros((n, 3))
    steps = h * np.arange(1, per + 1)
    x[:per, 0], x[per:, 0], x[per:, 1] = steps, 10.0, steps
    turned = np.array([np.eye(3)] * per + [corner] * per)
    start = np.concatenate((x.ravel(), np.zeros(3 * n), turned.ravel(), np.zeros(3 * n)))
    call = {"method": "DOP853", "rtol": 1e-6, "atol": 1e-7, "t_eval": times, "max_step": 0.02}
    y = solve_ivp(rates, (0, times[-1]), start, **call).y[: 3 * n].reshape(n, 3, -1)
    return np.vstack((y[per - 1], y[-1])).T


@pytest.mark.nightly
def test_a_right_angle_moves_as_a_rod_of_cosserat():
    """Its tip moves by 8.25 m, and both models approach the same motion with order two."""
    found = [elbow(per) for per in (4, 8, 16)]
    times, ours = found[0][1], [x for x, _ in found]
    theirs = [staggered_elbow(per, times) for per in (8, 16)]
    better, other = (x[-1] + (x[-1] - x[-2]) / 3 for x in (ours, theirs))
    assert other[:, 5].max() == pytest.approx(8.25, abs=0.02)
    assert better == pytest.approx(other, abs=0.01)
    assert 3.5 < np.abs(ours[0] - ours[1]).max() / np.abs(ours[1] - ours[2]).max() < 5.0
