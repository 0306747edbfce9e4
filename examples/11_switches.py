"""Constraints switched on and off during a run: a catch, a release, and the energy of each."""

from typing import Any

import numpy as np

import pgraph_core as pg

# Two bodies in space; a weld between them is switched on as they pass each other, and off again.
still: dict[str, Any] = {"joint": "free", "inertia": np.diag((1.0, 2.0, 2.5))}
a = pg.Body(name="a", v=(0, 0, 0, 0, 1, 0), **still)
b = pg.Body(name="b", q=(1, -0.5, 0, 1, 0, 0, 0), **still)
tie = pg.Constraint(name="tie", kind="weld", body="b", other="a", active=False)
mech = pg.Mechanism(pg.Model(bodies=(a, b), constraints=(tie,), gravity=(0, 0, 0)))

run = pg.simulate(mech, t_end=1.5, rtol=1e-10, switches=((0.5, "tie", True), (1.0, "tie", False)))
print(*run.events, sep="\n")

momenta = np.array([mech.momentum(q, v) for q, v in zip(run.q, run.v)])
print(f"momentum is kept to 1e-8: {np.ptp(momenta, axis=0).max() < 1e-8}")
print(f"the ledger closes to 1e-8: {run.energy_drift < 1e-8}")

# The same in a model file: a scenario that says it.
late = pg.Scenario(name="late", switches=(pg.Switch(t=1.2, constraint="tie", active=True),))
model = mech.model.replace(scenarios=(late,))
print(pg.simulate(pg.Mechanism(model), scenario="late", t_end=1.5).events[0])
