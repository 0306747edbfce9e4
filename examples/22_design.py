"""A design from the table: leg lengths and spine of the quadruped for its cost of transport.

SciPy proposes a generation of designs; one BatchStepper walks them all at once, each with its own
numbers of the description. Run it with `python examples/22_design.py`; some seconds a core.
"""

import numpy as np
from scipy.optimize import differential_evolution

import pgraph_core as pg

LIMBS = {  # each limb's bodies: the lower one hangs on the end of the upper one
    "front": (("left_humerus", "left_radius"), ("right_humerus", "right_radius")),
    "hind": (("left_femur", "left_tibia"), ("right_femur", "right_tibia")),
}
SPINE = ("lumbar", "thorax")
SETTLED, WALKED = 800, 1200  # steps of 1 ms

model = pg.load("quadruped_hips")
for name in SPINE:
    model = model.edit(name, kind="body", stiffness=20.0, damping=1.0)
mass = sum(body.mass for body in model.bodies)


def numbers(designs: np.ndarray) -> dict:
    """Paths and their values: lengths of front and hind legs as factors, stiffness [N m/rad]."""
    found = {}
    for factors, limbs in zip(designs.T, LIMBS.values()):
        for upper, lower in limbs:
            for axis in range(3):
                for path in (("bodies", upper, "com", axis), ("bodies", lower, "link", axis)):
                    found[path] = factors * getattr(model.body(path[1]), path[2])[axis]
    return found | {f"bodies.{name}.stiffness.0": designs[:, 2] for name in SPINE}


def cost_of_transport(designs: np.ndarray) -> np.ndarray:
    """Net work of the motors over weight times distance, of each design (k, 3); inf for a fall."""
    batch = pg.BatchStepper(model, len(designs), scenario="trot", set=numbers(designs))
    batch.step(n=SETTLED)
    work, x = batch.work, batch.q[:, 0].copy()
    batch.step(n=WALKED)
    distance = batch.q[:, 0] - x
    walks = batch.ok & (batch.q[:, 1] > -0.15) & (distance > 0.1)
    return np.where(walks, (batch.work - work) / (mass * 9.81 * np.maximum(distance, 0.1)), np.inf)


if __name__ == "__main__":
    before = np.array([[1.0, 1.0, 20.0]])
    bounds = [(0.9, 1.1), (0.9, 1.1), (2.0, 200.0)]
    best = differential_evolution(
        lambda x: cost_of_transport(np.atleast_2d(x.T)), bounds, x0=before[0], rng=1,
        vectorized=True, updating="deferred", popsize=5, maxiter=7, polish=False,
    )  # fmt: skip
    first = float(cost_of_transport(before)[0])
    front, hind, stiff = best.x
    print(f"before: cost of transport {first:.4f}")
    print(f"after:  cost of transport {best.fun:.4f} with legs of {front:.3f} in front and")
    print(f"        {hind:.3f} behind of their lengths, a spine of {stiff:.0f} N m/rad")
    print("cheaper:", best.fun < first)
