"""Trees that carry fast rotors under time stepping: momentum and energy stay."""

import numpy as np
import pytest

import pgraph_core as pg

from ..nights import combined

ACROSS, ALONG = 1e-3, 2e-3  # kg m²: of a rotor


def rotor(name, parent, speed, axis=2, link=(0, 0, 0), mass=0.0):
    inertia = np.full(3, ACROSS)
    inertia[axis] = ALONG
    return pg.Body(
        name=name, parent=parent, axes=np.eye(3)[axis], link=link, mass=mass,
        inertia=np.diag(inertia), v=(speed,),
    )  # fmt: skip


def craft(speed, kind="one"):
    """A body that tumbles in free fall, with rotors on it."""
    com = (0.05, 0.0, 0.02) if kind == "askew" else (0.0, 0.0, 0.0)
    base = pg.Body(
        name="base", joint="free", inertia=np.diag([0.02, 0.03, 0.045]), com=com,
        v=(2, -1, 0.5, 0.3, 0.2, 0.1), q=(0, 0, 50, 1, 0, 0, 0),
    )  # fmt: skip
    match kind:
        case "one" | "askew":
            return [base, rotor("r", "base", speed)]
        case "along x":
            return [base, rotor("r", "base", speed, axis=0)]
        case "four":
            places = [(0.2, 0, 0.05), (0, 0.2, 0.05), (-0.2, 0, 0.05), (0, -0.2, 0.05)]
            spins = [speed, -0.9 * speed, 0.8 * speed, -0.7 * speed]
            pairs = enumerate(zip(places, spins))
            return [base, *(rotor(f"r{i}", "base", w, 2, p, 0.1) for i, (p, w) in pairs)]
    arm = pg.Body(
        name="arm", parent="base", axes=(0, 1, 0), link=(0.1, 0, 0), mass=0.1, com=(0.1, 0, 0),
        inertia=np.diag([1e-3, 2e-3, 1e-3]), v=(0.5,),
    )  # fmt: skip
    return [base, arm, rotor("r", "arm", speed, link=(0.2, 0, 0), mass=0.05)]


def flown(bodies, step, t_end):
    """(momentum at every frame, its run): beside it a ball lies on the ground, so that it steps."""
    ball = pg.Body(
        name="ball", joint="free", q=(1, 0, 0.1, 1, 0, 0, 0),
        shape={"kind": "sphere", "radius": 0.1}, derived=("inertia",),
    )  # fmt: skip
    contact = pg.Contact(name="c", body="ball")
    model = pg.Model(bodies=[*bodies, ball], contacts=[contact], gravity=(0, 0, 0))
    run = pg.simulate(
        model, t_end=t_end, step=step, estimate=False, frames=21, method="moreau_jean"
    )
    assert run.status.ok
    alone = pg.Mechanism(pg.Model(bodies=bodies, gravity=(0, 0, 0)))
    states = zip(run.q[:, : alone.nq], run.v[:, : alone.nv])
    return np.array([alone.momentum(q, v) for q, v in states]), run


@pytest.mark.parametrize(
    ("kind", "speed", "step"),
    combined(
        ["one", "askew", "along x", "four", "arm"], [300.0, 1000.0, 3000.0],
        [1e-4, 1e-3, 5e-3],
    ),
)  # fmt: skip
def test_momentum_stays_at_any_speed_of_a_rotor(kind, speed, step):
    """Momentum is kept to rounding of as many steps, whatever the rotor turns by in one of them."""
    momentum, _ = flown(craft(speed, kind), step, 1.0 if step < 1e-3 else 10.0)
    for part in (slice(0, 3), slice(3, 6)):
        size = np.linalg.norm(momentum[0, part])
        assert abs(momentum[:, part] - momentum[0, part]).max() < 1e-6 * size


@pytest.mark.parametrize(
    ("kind", "speed"), combined(["one", "askew", "along x", "four"], [300.0, 1000.0, 3000.0])
)
def test_energy_of_a_craft_with_round_rotors_stays(kind, speed):
    """Of what is not in the rotors' own spin, in 10,000 steps of up to 3 rad each.

    What is lost grows with the third power of the turn in a step.
    """
    _, run = flown(craft(speed, kind), 1e-3, 10.0)
    energy = run.energy
    base = 0.5 * (0.02 * 4 + 0.03 + 0.045 * 0.25)
    assert abs(energy - energy[0]).max() < (3e-6 + 2e-5 * (speed / 1000.0) ** 3) * base


def test_a_drone_beside_a_ball_flies_as_without_it():
    """At 2000 rad/s, against a run by an explicit method of order eight without contacts."""
    bodies = craft(2000.0, "one")
    _, run = flown(bodies, 1e-4, 0.2)
    exact = pg.simulate(pg.Model(bodies=bodies, gravity=(0, 0, 0)), t_end=0.2, rtol=1e-10)
    assert run.v[-1, :6] == pytest.approx(exact.v[-1, :6], abs=0.01)
