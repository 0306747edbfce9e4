"""Cylinders that stand: their support is a disc, at every azimuth."""

import numpy as np
import pytest

import pgraph_core as pg

from ..nights import combined

G = 9.81
RADIUS = 0.05
AZIMUTHS = (0.0, 0.1, np.pi / 8, np.pi / 5, 1.0, 2.0, 4.5)


def lean(azimuth, slope):
    """(uphill, normal, quaternion that takes z to the normal) of a plane that rises by `slope`."""
    up = np.array((np.cos(azimuth), np.sin(azimuth), 0.0))
    normal = np.array((*(-np.sin(slope) * up[:2]), np.cos(slope)))
    axis = np.cross((0, 0, 1), normal)
    axis /= np.linalg.norm(axis)
    return up, normal, (np.cos(slope / 2), *(np.sin(slope / 2) * axis))


def standing(azimuth, share, length=0.2, radius=RADIUS, floor="ground", friction=5):
    """A cylinder on a plane that is `share` of as steep as it tips on."""
    slope = np.arctan(share * 2 * radius / length)
    up, normal, turn = lean(azimuth, slope)
    body = pg.Body(
        name="c", joint="free", q=(*(normal * length / 2), *turn), derived=("inertia",),
        shape={"kind": "cylinder", "radius": radius, "length": length},
    )  # fmt: skip
    if floor == "ground":
        ground = pg.Ground(slope=slope, uphill=tuple(up))
        contacts = [pg.Contact(name="g", body="c", friction=friction)]
        return pg.Model(bodies=[body], ground=ground, contacts=contacts)
    size = (20 * radius, 20 * radius, 4 * radius)
    plate = pg.Body(
        name="p", joint="free", q=(*(-normal * size[2] / 2), *turn),
        shape={"kind": "box", "size": size},
    )  # fmt: skip
    weld = pg.Weld(name="w", body="p", point=(0, 0, 0))
    contacts = [pg.Contact(name="g", body="c", other="p", friction=friction)]
    return pg.Model(bodies=[body, plate], constraints=[weld], contacts=contacts)


@pytest.mark.parametrize(
    ("share", "azimuth", "step"), combined([0.5, 0.98, 0.999], AZIMUTHS, [None, 1e-2])
)
def test_a_cylinder_stands_at_every_azimuth(share, azimuth, step):
    """Its weight is carried, and nothing moves."""
    run = pg.simulate(standing(azimuth, share), t_end=0.3, step=step, estimate=False)
    load = run.contact_force["g"][1:, 3:]
    assert abs(load - (0, 0, G)).max() < 1e-6 * G
    assert abs(run.v).max() < 1e-9


@pytest.mark.parametrize("azimuth", AZIMUTHS)
@pytest.mark.parametrize(("length", "radius"), [(0.02, 0.05), (2.0, 0.3), (1e-3, 5e-3)])
def test_discs_and_columns_stand_at_every_azimuth(length, radius, azimuth):
    run = pg.simulate(
        standing(azimuth, 0.98, length, radius, friction=20), t_end=0.1, estimate=False
    )
    assert abs(run.contact_force["g"][1:, 3:] - (0, 0, G)).max() < 1e-6 * G


@pytest.mark.parametrize(("share", "azimuth"), combined([0.5, 0.98, 0.999], AZIMUTHS))
def test_a_cylinder_stands_on_a_box_at_every_azimuth(share, azimuth):
    run = pg.simulate(standing(azimuth, share, floor="box"), t_end=0.2, estimate=False)
    assert abs(run.contact_force["g"][1:, 3:] - (0, 0, G)).max() < 1e-6 * G
    assert abs(run.v).max() < 1e-8


@pytest.mark.parametrize("floor", ["ground", "box"])
def test_a_cylinder_tips_beyond_its_rim_at_every_azimuth(floor):
    """It turns about the lowest point of its rim, J w' = m g (h/2 sin - r cos), and alike."""
    share, length, t_end = 1.1, 0.2, 0.02
    slope = np.arctan(share * 2 * RADIUS / length)
    arm = length / 2 * np.sin(slope) - RADIUS * np.cos(slope)
    inertia = RADIUS**2 / 4 + length**2 / 12 + RADIUS**2 + length**2 / 4
    spins = []
    for azimuth in AZIMUTHS:
        model = standing(azimuth, share, floor=floor)
        run = pg.simulate(model, t_end=t_end, step=1e-3, estimate=False)
        spins.append(np.linalg.norm(run.v[-1, :3]))
    assert spins == pytest.approx(len(spins) * [G * arm / inertia * t_end], rel=0.01)
    assert np.ptp(spins) < 1e-6 * spins[0]
