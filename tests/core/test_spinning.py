"""Time stepping of bodies that spin fast: what turns freely keeps its energy at any step."""

import numpy as np
import pytest

import pgraph_core as pg

INERTIA = np.diag((1.0, 2.0, 2.5))
SPIN = np.array((0.3, 0.8, 0.52))


def flown(spin, joint, com, **options):
    """A body without loads, out of reach of a floor, that turns at `spin` [rad/s] at first."""
    speed = (*spin, 0.0, 0.0, 0.0) if joint == "free" else tuple(spin)
    body = pg.Body(
        name="b", joint=joint, link=(0, 0, 1e9), mass=2.0, com=com, inertia=INERTIA, v=speed,
        shape={"kind": "sphere", "radius": 0.1},
    )  # fmt: skip
    floor = pg.Contact(name="c", body="b")
    model = pg.Model(bodies=(body,), gravity=(0, 0, 0), contacts=(floor,))
    run = pg.simulate(model, frames=11, **options)
    assert run.status.ok
    return run


@pytest.mark.parametrize("com", [(0.0, 0.0, 0.0), (0.1, 0.2, -0.3)])
@pytest.mark.parametrize("joint", ["free", "spherical"])
@pytest.mark.parametrize("turn", [0.1, 1.0, 20.0, 1e4])
def test_energy_stays_at_any_angle_of_turn_a_step(turn, joint, com):
    run = flown(1e3 * turn * SPIN, joint, com, t_end=0.1, step=1e-3, method="moreau_jean")
    assert run.energy == pytest.approx(run.energy[0], rel=1e-11)


@pytest.mark.parametrize("com", [(0.0, 0.0, 0.0), (0.1, 0.2, -0.3)])
@pytest.mark.parametrize("joint", ["free", "spherical"])
def test_a_free_top_turns_to_second_order(joint, com):
    exact = flown(9.0 * SPIN, joint, com, t_end=1.0, method="dop853", rtol=1e-11)
    errors = [
        abs(flown(9.0 * SPIN, joint, com, t_end=1.0, step=step, method="moreau_jean").q - exact.q)
        for step in (2e-3, 1e-3)
    ]
    coarse, fine = (float(e[-1].max()) for e in errors)
    assert fine < 2e-4
    assert fine == pytest.approx(coarse / 4, rel=0.05)


@pytest.mark.parametrize("seed", range(3))
def test_a_small_brick_thrown_at_the_floor_gains_no_energy(seed):
    """5 mm at 10 m/s leaves the floor with about 2 rad a step."""
    size = np.array((0.005, 0.0075, 0.01))
    turn = np.random.default_rng(seed).normal(size=4)
    brick = pg.Body(
        name="b", joint="free", q=(0, 0, 0.3, *turn / np.linalg.norm(turn)), mass=0.01,
        v=(0, 0, 0, 7, 0, -7), inertia=0.01 / 12 * np.diag(size @ size - size**2),
        shape={"kind": "box", "size": tuple(size)},
    )  # fmt: skip
    floor = pg.Contact(name="f", body="b", friction=0.3, restitution=0.5)
    run = pg.simulate(pg.Model(bodies=(brick,), contacts=(floor,)), t_end=0.3, step=1e-3, frames=61)
    assert run.status.ok
    assert abs(run.v[:, :3]).max() > 300
    assert run.energy.max() < 1.001 * run.energy[0]
