"""The paper's case study: the stance of the quadruped, 0.25 s on four feet.

Run it with `python examples/04_stance.py`, or cell by cell; the first run on a machine compiles for
some seconds. docs/paper.md has the figures and a comparison with two other solvers.
"""

# %% The model: four columns for the tree, a point constraint a paw, servos for the push.
import numpy as np

import pgraph_core as pg

model = pg.load("quadruped")
mech = pg.Mechanism(model)
print("Pgraph", mech.pgraph)
print("jdof  ", mech.jdof)

# %% The run, and what it was worth.
run = pg.simulate(mech, scenario="stance")  # or: q, v, t_end=0.25, method="rk4", step=1e-3
print("status            ", run.message)
print("error estimate    ", f"{run.error_estimate:.1e} rad or m")
print("energy drift      ", f"{run.energy_drift:.1e} of its range")
print("constraint drift  ", run.constraint_drift.max(axis=0), "m, m/s")
print("cost              ", dict(run.counters))

# %% Fig. 10: the configuration every 50 ms.
pictured = [int(abs(run.t - t).argmin()) for t in np.arange(0, 0.251, 0.05)]
for k in pictured:
    x, y, _ = run.body_pose[k, 0, :3]
    print(f"{1e3 * run.t[k]:4.0f} ms: pelvis at x = {x:.4f} m, y = {y:.4f} m")

# %% Figs. 11 and 12: angular acceleration of every body about z. Body 0 is the ground.
alpha = np.pad(run.body_acceleration[:, :, 2], ((0, 0), (1, 0)))  # (len(t), 17) [rad/s^2]
for number, name in enumerate(("ground", *mech.names)):
    low, high = alpha[:, number].min(), alpha[:, number].max()
    print(f"Body {number:2} {name:19} {low:7.2f} ... {high:6.2f} rad/s^2")

# %% Fig. 13: the ground's force on the left back paw, and the sum of all four against the weight.
paw = run.constraint_force["left_hind_paw"][:, 3:]  # (len(t), 3) [N], world axes, y is up
print("left back paw at 50 ms", paw[pictured[1]].round(2), "N")
for foot, force in run.constraint_force.items():
    normal = force[:, 4]
    print(f"{foot:16}  {normal[0]:6.2f} N at first, {normal.max():6.2f} N at most")
weight = sum(force[0, 4] for force in run.constraint_force.values())
print(f"in all            {weight:.2f} N at first = 33 kg x 9.81 m/s^2")
