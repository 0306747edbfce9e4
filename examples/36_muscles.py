"""Move an arm by muscles: excite them, read moment arms, share a torque, and improve a reach."""

import numpy as np

import pgraph_core as pg

ACROSS = (0, 1, 0)
inertia = np.diag((0.02, 0.02, 0.002))
upper = pg.Body(name="upper", joint="weld", link=(0, 0, 0), mass=2, inertia=inertia)
forearm = pg.Body(
    name="forearm", parent="upper", link=(0, 0, -0.3), axes=[ACROSS], q=(-0.5,), mass=1.5,
    com=(0, 0, -0.15), inertia=inertia, tip=(0, 0, -0.3),
)  # fmt: skip
elbow = pg.Via(body="upper", point=(0, 0, -0.3), radius=0.02, axis=ACROSS, side=(-0.1, 0, -0.3))
biceps = pg.Muscle(
    name="biceps", body="forearm", point=(0.01, 0, -0.045), other="upper", other_point=(0.02, 0, 0),
    f_max=600, l_opt=0.12, l_slack=0.17, excitation=0.05,
)  # fmt: skip
triceps = pg.Muscle(
    name="triceps", body="forearm", point=(-0.02, 0, -0.02), other="upper",
    other_point=(-0.02, 0, -0.05), via=[elbow], f_max=700, l_opt=0.1, l_slack=0.15, excitation=0.01,
)  # fmt: skip
arm = pg.Model(name="arm", bodies=[upper, forearm], forces=[biceps, triceps])
mech = pg.Mechanism(arm)

# moment arms are exact: the negative slope of the length over the joint
q, h = np.array([-1.2]), 1e-5
slope = (mech.path_length(q + h) - mech.path_length(q - h)) / (2 * h)
arms = mech.moment_arms(q)[:, 0]
print(f"moment arms of {', '.join(mech.path_names)}: {np.round(arms, 4)} m")
print(f"they are the slopes of the lengths: {np.allclose(arms, -slope, atol=1e-9)}")

# a burst of the biceps lifts the forearm; its fibre is shorter than its path
burst = "=0.05 + 0.45*if(t > 0.1, 1, 0)*if(t < 0.4, 1, 0)"
run = pg.simulate(arm.edit("biceps", excitation=burst), t_end=0.8, q={"forearm": 0.0})
peak = run["activation.biceps"].max()
print(f"the activation reaches {peak:.2f}, the tension {run.tension['biceps'].max():.0f} N")
print(f"the fibre is {run['fibre.biceps'].min():.3f} m at its shortest")

# static optimisation: which activations hold 8 N m at this angle?
found = mech.activations({"forearm": -8.0}, q={"forearm": -1.2})
shares = {name: round(a, 3) for name, a in found.activation.items()}
print(f"activations {shares} exert {found.torque['forearm']:.4f} N m")
print(mech.activations({"forearm": -99.0}, q={"forearm": -1.2}).notices[0])

# the derivative of a reach by an excitation is exact, through tendons and activation
excited = {"biceps": 0.3}
run = pg.simulate(mech, t_end=0.3, inputs=excited, wrt=["inputs.biceps"])
exact = run.gradient(lambda r: r.q[-1, 0])["inputs.biceps"]
ends = [pg.simulate(mech, t_end=0.3, inputs={"biceps": 0.3 + s * 1e-3}).q[-1, 0] for s in (1, -1)]
print(f"it is that of differences: {abs(exact - (ends[0] - ends[1]) / 2e-3) < 1e-3 * abs(exact)}")
