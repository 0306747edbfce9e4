"""From markers and a force plate to joint moments with a 95 % band, and back to masses.

A leg swings over a plate on a known motion. Its markers have errors of 1 mm.
"""

import numpy as np

import pgraph_core as pg

bodies = [
    pg.Body(name="pelvis", joint="compound", link=(0, 0, 0.9), mass=30, inertia=(1, 0.8, 1),
            motions=[("translate", (1, 0, 0)), ("translate", (0, 0, 1)), ("rotate", (0, 1, 0))]),
    pg.Body(name="thigh", parent="pelvis", axes=(0, 1, 0), mass=8, com=(0, 0, -0.18),
            inertia=(0.13, 0.13, 0.03)),
    pg.Body(name="shank", parent="thigh", axes=(0, 1, 0), link=(0, 0, -0.43), mass=4,
            com=(0, 0, -0.2), inertia=(0.06, 0.06, 0.01), tip=(0, 0, -0.45)),
]  # fmt: skip
points = {"front": (0.06, 0, -0.1), "side": (0, 0.06, -0.15), "low": (0, 0, -0.35)}
sites = [
    pg.Site(name=f"{b.name} {k}", body=b.name, point=p) for b in bodies for k, p in points.items()
]
mech = pg.Mechanism(pg.Model(bodies=bodies, sites=sites))

# a trial: markers with errors, and a plate that bears the weight while the leg stands
t = np.arange(120) / 100
hip, knee = mech.joints["thigh"].q.start, mech.joints["shank"].q.start
q = np.tile(mech.home()[0], (120, 1))
q[:, hip], q[:, knee] = 0.3 * np.sin(4 * t), 0.2 + 0.2 * np.sin(4 * t + 1)
rng = np.random.default_rng(0)
poses = [mech.pose(x) for x in q]
markers = {
    s.name: np.array([pose[s.name].position for pose in poses]) + rng.normal(0, 1e-3, (120, 3))
    for s in sites
}
push = np.outer(400 * np.clip(np.sin(3 * t), 0, None), (0, 0, 1))  # [N]
foot = np.array([pose["shank"].place((0, 0, -0.45)) for pose in poses])
loaded = push[:, 2:] > 20
plate = pg.Plate("plate", t, push, np.cross(foot, push), np.where(loaded, foot, np.nan))
trial = pg.Trial(t=t, markers=markers, plates=(plate,), up="z")

fit = pg.track(mech, trial)
print(fit)
loads = pg.joint_moments(mech, fit, cutoff=6, band=True)
print(loads)
for name in ("thigh", "shank"):
    low, high = (loads[f"{name}.{end}"][60] for end in ("low", "high"))
    print(f"{name}: {loads[name][60]:.1f} N m, {low:.1f} to {high:.1f} N m")
print(f"the plate bears the shank alone: {[b[0] for b in loads.bears['plate']] == ['shank']}")

# masses from motion and torques: what a swing in a plane shows of the shank
rates = {"v": loads.v, "vdot": loads.vdot}
torque = loads.torque + rng.normal(0, 0.1, loads.torque.shape)
found = pg.identify_inertia(mech, loads.q, **rates, torque=torque, external=loads.external,
                            bodies=["shank"])  # fmt: skip
print(found)
