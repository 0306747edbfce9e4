"""Turn a flexible arm, and compare the error of its segments with that of its steps."""

import pgraph_core as pg

hub = pg.Body(name="hub", axes=(0, 1, 0), inertia=(0.01, 0.01, 0.01))
arm = pg.Beam(
    name="arm", parent="hub", length=0.6, section=("rectangle", 0.02, 0.002), material="steel",
    strains=["bend_y"], damping_ratio=0.02,
)  # fmt: skip
load = pg.Body(name="load", parent="arm", joint="weld", mass=0.1)
turn = pg.Motion(name="turn", body="hub", q_of_t="=0.3*(1 - cos(6*t))")
model = pg.Model(bodies=[hub, load], beams=[arm], constraints=[turn])
print(
    f"lowest frequency {arm.lowest_frequency / 6.283:.2f} Hz, EI {arm.stiff.of('bend_y'):.2f} N m²"
)

for nodes in (4, 8, 16):
    run = pg.simulate(model.edit("arm", nodes=nodes), t_end=1.0, rtol=1e-6)
    tip, moment = run["arm.tip.z"].min(), abs(run["moment.arm[1]"]).max()
    errors = f"space {run.space_error:.1e} m, time {run.error_estimate:.1e}"
    print(f"{nodes:3} segments: tip {tip:.5f} m, moment {moment:.3f} N m, errors: {errors}")
