"""Many instances at once: a pendulum chain with a mass that differs, over lanes and cores.

Run it with `python examples/06_batch.py`.
"""

import numpy as np

import pgraph_core as pg

base = pg.Model.serial(3)
models = [base.edit("3", mass=0.5 + 0.1 * i) for i in range(20)]
mech = pg.Mechanism(base)
q, v = mech.home()

many = pg.simulate_batch(
    mech,
    np.repeat(q[None], len(models), axis=0),
    np.repeat(v[None], len(models), axis=0),
    models=models,
    t_end=1.0,
    step=1e-3,
    frames=11,
)
print("frames, instances:", many.q.shape[1], many.q.shape[0])
for i in (0, 19):
    print(
        f"mass {models[i].body('3').mass:.1f} kg: first angle after 1 s {many.q[i, -1, 0]:.6f} rad"
    )

alone = pg.simulate(pg.Mechanism(models[19]), t_end=1.0, step=1e-3, frames=11)
print("as alone to 1e-12:", bool(np.max(np.abs(alone.q - many.q[19])) < 1e-12))
