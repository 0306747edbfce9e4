"""The stance phase of the quadruped: four feet held, a push, and the forces on the ground.

Run it with `python examples/04_stance.py`; the first run on a machine compiles for some seconds.
"""

import numpy as np

import pgraph_core as pg
import static_models

mech = pg.Mechanism(pg.Model.load(static_models.path("quadruped")))
run = pg.simulate(mech, scenario="stance")  # or: q, v, t_end=0.25, method="rk4", step=1e-3

print("status            ", run.message)
print("error estimate    ", f"{run.error_estimate:.1e} rad or m")
print("energy drift      ", f"{run.energy_drift:.1e} of its range")
print("constraint drift  ", run.constraint_drift.max(axis=0), "m, m/s")
print("cost              ", dict(run.counters))
print("left out          ", *run.left_out, sep="\n  ")

for foot, force in run.constraint_force.items():
    normal = force[:, 4]  # y is up
    print(f"{foot:16}  {normal[0]:6.2f} N at first, {normal.max():6.2f} N at most")

weight = sum(force[0, 4] for force in run.constraint_force.values())
print(f"in all            {weight:.2f} N at first = 33 kg x 9.81 m/s^2")
print("pelvis moved      ", np.ptp(run.q[:, :3], axis=0).round(4), "m")
