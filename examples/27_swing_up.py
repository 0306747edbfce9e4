"""A swing-up by shooting: the torque over time that brings a pendulum upright and to rest.

The torque is too weak to lift the pendulum at once. Its values at 9 times are free.
"""

from typing import Any

import numpy as np

import pgraph_core as pg

KNOTS = 9
rod = pg.Body(name="rod", joint="revolute", axes=[(0, 1, 0)], mass=1.0, com=(0, 0, -0.5),
              inertia=np.diag([1 / 12, 1 / 12, 1e-3]), damping=0.02)  # fmt: skip
torque = pg.Table(t=np.linspace(0.0, 3.0, KNOTS), value=np.zeros(KNOTS))
push = pg.Motor(name="push", body="rod", torque=torque)
model = pg.Model(bodies=[rod], gravity=(0, 0, -9.81), forces=[push])


def missed(run: pg.Result) -> list[float]:
    """The angle from upright and the speed at the end."""
    return [run["rod"][-1] - np.pi, run.v[-1, 0]]


options: dict[str, Any] = {"t_end": 3.0, "method": "rk4", "step": 0.02, "frames": 31}
found = pg.optimise(model, missed, {"forces.push.torque": (-2.5, 2.5)}, starts=5, **options)
for end in found.endings:
    print(f"a start ends with a miss of {np.sqrt(end.objective):.1e}")
print(f"all five starts bring it upright: {all(end.objective < 1e-10 for end in found.endings)}")
print(f"gravity is stronger than the torque: {2.5 < 9.81 * 0.5}")
