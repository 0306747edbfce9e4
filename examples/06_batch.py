"""Many instances at once: a pendulum chain with a mass that differs, over lanes and cores.

Run it with `python examples/06_batch.py`.
"""

import numpy as np

import pgraph_core as pg

model = pg.Model.serial(3)
masses = 0.5 + 0.1 * np.arange(20)
batch = pg.BatchStepper(model, 20, step=1e-3, set={"bodies.3.mass": masses})
batch.step(n=1000)
print("instances, coordinates:", batch.q.shape)
for i in (0, 19):
    print(f"mass {masses[i]:.1f} kg: first angle after 1 s {batch.q[i, 0]:.6f} rad")

alone = pg.simulate(model.edit("3", mass=masses[19]), t_end=1.0, step=1e-3, method="rk4")
print("as alone to 1e-12:", bool(np.max(np.abs(alone.q[-1] - batch.q[19])) < 1e-12))
