"""Error against run time: which method, at which setting, for the accuracy that is wanted."""

import pgraph_core as pg

mech = pg.Mechanism(pg.load("double_pendulum"))
study = pg.work_precision(
    mech,
    t_end=1.0,
    methods=("rk4", "dopri5", "dop853"),
    tolerances=(1e-3, 1e-5, 1e-7, 1e-9),
    target=1e-6,
)
print(study)

row = study.recommend()  # the cheapest run with an error of at most 1e-6
assert row.error is not None
print("\nits error is below 1e-6:", row.error <= 1e-6)
print("and for three digits:", study.recommend(1e-3).method)

run = pg.simulate(mech, t_end=1.0, method=row.method, **row.setting.options)
print(run.status.value)

# study.save("report.html") writes the diagram and the table as one page; pgraph report does it all:
#     pgraph report double_pendulum --t-end 1 --target 1e-6 -o report.html
