"""Forces: a spring, gusts over time, a wheel that is driven by a sine, a compiled torque function.

Run it with `python examples/08_forces.py`; docs/forces.md has the equation of each force.
"""

import math

import numba
import numpy as np
import numpy.typing as npt

import pgraph_core as pg

Vector = npt.NDArray[np.float64]

ROUND = ((0.05, 0, 0), (0, 0.05, 0), (0, 0, 0.05))
model = pg.Model(
    name="arm on a wheel",
    bodies=(
        pg.Body(name="wheel", axes=((0, 1, 0),), mass=2.0, inertia=ROUND),
        pg.Body(
            name="arm", parent="wheel", axes=((0, 1, 0),), link=(0.3, 0, 0), com=(0.2, 0, 0),
            mass=1.0, inertia=ROUND, tip=(0.5, 0, 0),
        ),
    ),
    forces=(
        pg.Force(
            name="spring", kind="spring", body="arm", other_point=(0.3, 0, 0.6),
            stiffness=60.0, damping=0.5, rest=0.4,
        ),
        pg.Force(
            name="gust", kind="wrench", body="arm", point=(0.5, 0, 0),
            force=pg.VectorTable(t=(0.5, 0.7, 0.9), value=((0, 0, 0), (0, 0, 8), (0, 0, 0))),
        ),
    ),
    constraints=(
        pg.Constraint(
            name="drive", kind="motion", body="wheel",
            q_of_t=pg.Sine(amplitude=0.4, frequency=2 * math.pi),
        ),
    ),
)  # fmt: skip
mech = pg.Mechanism(model)
q, v = mech.home()

# What is passive acts in every question, what depends on time only in runs.
print(f"potential energy at first {mech.energy(q, v)[1]:.4f} J, all of it in the spring")


@numba.njit
def brake(t: float, q: Vector, v: Vector) -> Vector:
    """A torque against the arm's motion; it counts as work, negative here."""
    tau = np.zeros(2)
    tau[1] = -0.3 * v[1] * abs(v[1])
    return tau


run = pg.simulate(mech, tau=brake, t_end=2.0, step=1e-3, method="rk4", frames=201)
drive = run.constraint_force["drive"][:, 1]
print(run.message)
print(f"the drive needs {drive.min():.2f} to {drive.max():.2f} N m")
print(f"work put in {run.work[-1]:.4f} J, dissipated {run.dissipation[-1]:.4f} J")
print(f"energy gained {run.energy[-1] - run.energy[0]:.4f} J")
print("the ledger closes to 1e-6:", run.energy_drift < 1e-6)
arm = run.joint_force[:, mech.topology.number("arm") - 1]
print(f"the arm's bearing carries at most {np.linalg.norm(arm[:, 3:], axis=1).max():.1f} N")
