"""Walking: a trot by the ordinary door, then live: faster, pushed, on slippery ground.

Run it with `python examples/14_walk.py`.
"""

import pgraph_core as pg

mech = pg.Mechanism(pg.load("quadruped_hips"))
run = pg.simulate(mech, scenario="trot", t_end=3.0)
print(run.message)
print(*run.events[-2:], sep="\n")

walk = pg.Walk(mech, "trot")
parts = [walk.step(0.05) for _ in range(40)]
walk.change(speed=0.9)
walk.push((0.0, 0.0, 60.0), seconds=0.1)
parts += [walk.step(0.05) for _ in range(20)]
walk.follow(pg.underfoot(mech.model, friction=0.5))
parts += [walk.step(0.05) for _ in range(20)]
run = pg.joined(parts)
print(f"after {run.t[-1]:.1f} s at {run.q[-1, 0]:.2f} m, on its feet: {not walk.fell}")

try:
    walk.change(speed=9.0)
except pg.PgraphError as refused:
    print(refused)
