"""Identify the friction and the inertia of a pendulum from a noisy measurement.

`pg.fit` runs the model, differentiates the run by each free number, and follows Gauss and Newton.
"""

import numpy as np

import pgraph_core as pg

rod = pg.Body(
    name="rod", joint="revolute", axes=[(0, 1, 0)], mass=1.0, com=(0, 0, -0.4), damping=0.05,
    inertia=np.diag([0.03, 0.02, 0.03]),
)  # fmt: skip
model = pg.Model(bodies=[rod], gravity=(0, 0, -9.81))
t = np.linspace(0.0, 5.0, 501)
truth = pg.simulate(model, {"rod": 1.2}, t_end=5.0, t_eval=t)
noise = 5e-3 * np.random.default_rng(1).normal(size=len(t))

start = model.edit("rod", q=[1.0], damping=0.2, inertia=np.diag([0.03, 0.05, 0.03]))
free = {
    "bodies.rod.damping": (0.0, 1.0),
    "bodies.rod.inertia.1.1": (0.01, 0.055),
    "q.rod": (0.5, 2.0),
}
fit = pg.fit(start, {"t": t, "rod": truth["rod"] + noise}, free)
print(fit)
for path, true in zip(free, (0.05, 0.02, 1.2)):
    near = abs(fit.values[path] - true) < 4 * fit.errors[path]
    print(f"{path} is {true} within its error: {near}")
