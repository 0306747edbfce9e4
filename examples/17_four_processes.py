"""Send a mechanism to four processes: each simulates one initial speed.

Run it with `python examples/17_four_processes.py`.
"""

from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np

import pgraph_core as pg


def highest_speed(mech: pg.Mechanism, speed: float) -> float:
    """Largest joint speed [rad/s] in a second from this speed of both joints."""
    run = pg.simulate(mech, v=np.full(mech.nv, speed), t_end=1.0)
    return float(abs(run.v).max())


if __name__ == "__main__":
    mech = pg.Mechanism(pg.load("double_pendulum"))
    speeds = (0.0, 1.0, 2.0, 3.0)
    with ProcessPoolExecutor(max_workers=4) as pool:
        found = list(pool.map(partial(highest_speed, mech), speeds))
    for speed, fastest in zip(speeds, found):
        print(f"from {speed:g} rad/s: at most {fastest:.3f} rad/s")
    print("as in one process:", found == [highest_speed(mech, speed) for speed in speeds])
