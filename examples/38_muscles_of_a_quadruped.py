"""Let a quadruped stand and trot by 24 muscles, excited over time without any feedback."""

import numpy as np

import pgraph_core as pg

model = pg.load("quadruped_muscles")
mech = pg.Mechanism(model)
muscles = [f.name for f in model.forces if isinstance(f, pg.Muscle)]
print(f"{len(muscles)} muscles, {len(muscles) // 4} in each leg")

# moment arms: the extensor of the knee and the hamstrings, which also extend the hip
q = mech.home()[0]
for name in ("left_vasti", "left_hamstrings"):
    arms = mech.moment_arms(q)[mech.path_names.index(name)]
    at = {j: float(arms[mech.joints[j].v][0]) for j in ("left_femur", "left_tibia")}
    print(f"{name}: {', '.join(f'{1e3 * r:.0f} mm at {j}' for j, r in at.items())}")

FEET = ("left_front_paw", "right_front_paw", "left_hind_paw", "right_hind_paw")


def heights(run: pg.Result) -> np.ndarray:
    """Heights of the soles over the ground, by frame and foot [m]."""
    tips = [np.array(model.body(foot).tip_point) for foot in FEET]
    poses = [[mech.pose(x, foot) for foot in FEET] for x in run.q[::40]]
    return np.array([[(p + turn @ tip)[1] for (p, turn), tip in zip(row, tips)] for row in poses])


# constant excitations hold it: contracted muscles are springs, and no controller is needed
still = pg.simulate(model.replace(parameters={"lift": 0.0}), t_end=3, scenario="step")
sunk = np.abs(still.q[:, mech.joints["pelvis"].q][:, :3]).max()
print(f"it stands for {still.t[-1]:.0f} s: {sunk < 1e-4}")

# excitations over time lift the feet in turn
run = pg.simulate(mech, scenario="step")
air = heights(run) > 0.005
steps = (air[1:] & ~air[:-1]).sum(axis=0)
print(f"the feet make {steps.tolist()} steps")
print(f"every foot makes at least three: {steps.min() >= 3}")
upright = run.q[-1, mech.joints["pelvis"].q][3]
print(f"it is upright at the end: {upright > 0.99}")
