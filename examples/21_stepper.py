"""Step a mechanism from outside: feedback between steps, and a snapshot to go back to."""

import numpy as np

import pgraph_core as pg

rod = pg.Body(name="rod", mass=1.0, tip=(1, 0, 0), com=(0.5, 0, 0), inertia=np.eye(3) / 12)
model = pg.Model(bodies=[rod], gravity=(0, -9.81, 0))

stepper = pg.Stepper(model, step=1e-3)
# stepper.q is a view that follows the steps: keep stepper.q.copy()
while stepper.t < 1.0:
    stepper.step(tau=-40 * (stepper.q - 0.5) - 8 * stepper.v)
snapshot = stepper.save()
print(f"held at {stepper.q[0]:.3f} rad, t = {stepper.t:.3f} s")

stepper.step(n=500)  # released
print(f"half a second later at {stepper.q[0]:.3f} rad")

stepper.restore(snapshot)
print(f"and back at {stepper.q[0]:.3f} rad, t = {stepper.t:.3f} s")
