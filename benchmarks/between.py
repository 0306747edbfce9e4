"""Between and beyond the cases: mass ratios 1e-12 to 1e12, any number of links, any restitution.

`python -m benchmarks.between` prints, for each, our error and what it may be: three times the
accuracy of the case's reference, or the limit of rounding. That limit is computed: how far the
exact answer (50 digits) moves if every number that is given changes by one part in 2^53.

Accelerations of a planar chain of point masses, in absolute angles a from the downward vertical:
sum_j m_max(i,j) l^2 cos(a_i - a_j) a_j'' = -sum_j m_max(i,j) l^2 sin(a_i - a_j) a_j'^2
- g l m_i sin(a_i), where m_i is the mass from link i on. Impacts of a ball dropped from h with
restitution e: t_k = t_0 (1 + 2 (e + ... + e^k)), t_0 = sqrt(2 h / g).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import mpmath
import numpy as np

import pgraph_core as pg
from pgraph_models import case_models

mp = mpmath.mp.clone()
mp.dps = 50
EPS = 2.0**-53
TRIES = 12  # changes of what is given
WORST = 3.0  # times the accuracy of a reference, or the limit of rounding
ACCURATE = {"mass ratio": 1e-14, "links": 1e-12, "restitution": 1e-16}  # of the cases' references
LOCATED = 1e-14  # s: to which instants are located
SHORTEST = 1e-8  # s: flights below it are left out, and the ball rests
RATIOS = tuple(10.0**k for k in range(-12, 13, 2))
LINKS = (1, 2, 3, 5, 10, 20, 40)
BOUNCES = (0.0, 0.05, 0.3, 0.5, 0.7, 0.9, 0.99, 1.0)
G = 9.81


class Row(NamedTuple):
    """One value."""

    what: str
    value: float
    error: float
    limit: float  # of rounding

    @property
    def allowed(self) -> float:
        """What the error may be."""
        return WORST * max(ACCURATE[self.what], self.limit)

    @property
    def ok(self) -> bool:
        """Whether it is."""
        return self.error <= self.allowed


def exact_chain(given: Sequence[Any]) -> list[Any]:
    """Relative angular accelerations of a chain, from [q..., v..., masses..., length]."""
    n = (len(given) - 1) // 3
    q, v, m, length = given[:n], given[n : 2 * n], given[2 * n : 3 * n], given[-1]
    angle = [sum(q[: i + 1]) for i in range(n)]
    speed = [sum(v[: i + 1]) for i in range(n)]
    beyond = [sum(m[i:]) for i in range(n)]
    M, f = mp.matrix(n, n), mp.matrix(n, 1)
    for i in range(n):
        f[i] = -G * length * beyond[i] * mp.sin(angle[i])
        for j in range(n):
            both = beyond[max(i, j)] * length**2
            M[i, j] = both * mp.cos(angle[i] - angle[j])
            f[i] -= both * mp.sin(angle[i] - angle[j]) * speed[j] ** 2
    a = list(mp.lu_solve(M, f))
    return [a[0], *(a[i] - a[i - 1] for i in range(1, n))]


def exact_impacts(given: Sequence[Any], count: int) -> list[Any]:
    """Times of the first impacts of a ball, from [height, g, e]."""
    height, g, e = given
    t = mp.sqrt(2 * height / g)
    found = [t]
    for k in range(1, count):
        found.append(found[-1] + 2 * t * e**k)
    return found


def rounding(exact: Callable[[Sequence[Any]], list[Any]], given: Sequence[float]) -> float:
    """How far the answer moves, over its size, if what is given changes in the last digit."""
    rng = np.random.default_rng(0)
    base = exact([mp.mpf(x) for x in given])
    size, moved = max(abs(x) for x in base), mp.mpf(0)
    for _ in range(TRIES):
        signs = rng.choice([-1.0, 1.0], len(given))
        other = exact([mp.mpf(x) * (1 + mp.mpf(s * EPS)) for x, s in zip(given, signs)])
        moved = max(moved, *(abs(a - b) for a, b in zip(other, base)))
    return float(moved / size)


def chain(what: str, value: float, masses: Sequence[float]) -> Row:
    """Accelerations of a chain of point masses on rods of 1 m, in motion."""
    n, rng = len(masses), np.random.default_rng(len(masses))
    q, v = rng.uniform(-1.5, 1.5, n), rng.uniform(-2, 2, n)
    bodies = tuple(
        pg.Body(
            name=f"b{i}", parent="ground" if i == 0 else f"b{i - 1}", mass=float(mass),
            link=(0, 0, 0) if i == 0 else (0, -1, 0), com=(0, -1, 0), inertia=np.zeros((3, 3)),
        )
        for i, mass in enumerate(masses)
    )  # fmt: skip
    mech = pg.Mechanism(pg.Model(bodies=bodies, gravity=(0, -G, 0), up="y"))
    found = mech.forward_dynamics(q, v, np.zeros(n))
    given = [*q.tolist(), *v.tolist(), *map(float, masses), 1.0]
    exact = np.array([float(x) for x in exact_chain([mp.mpf(x) for x in given])])
    error = float(np.abs(found - exact).max() / np.abs(exact).max())
    return Row(what, value, error, rounding(exact_chain, given))


def bounces(e: float) -> Row:
    """Times of the first impacts of a ball dropped from 1 m, until they cannot be told apart."""
    fall = np.sqrt(2 / G)
    count = 1 + sum(2 * fall * e**k > SHORTEST for k in range(1, 10))
    end = float(fall * (1 + 2 * sum(e**k for k in range(1, count)))) + 1e-3
    run = pg.simulate(case_models.bouncing_ball(e), t_end=end, method="rk4", step=2e-3)
    found = [event.t for event in run.events][:count]
    given = [1.0, G, e]
    exact = [float(t) for t in exact_impacts([mp.mpf(x) for x in given], count)]
    if len(found) < count:
        return Row("restitution", e, np.inf, 0.0)
    error = float(np.abs(np.array(found) - exact).max() / exact[-1])
    limit = rounding(lambda x: exact_impacts(x, count), given) + count * LOCATED / exact[-1]
    return Row("restitution", e, error, limit)


def rows() -> Iterator[Row]:
    """Every value."""
    for ratio in RATIOS:
        yield chain("mass ratio", ratio, (1.0, ratio))
    for n in LINKS:
        yield chain("links", n, (1.0,) * n)
    for e in BOUNCES:
        yield bounces(e)


def main() -> None:
    """Print the table."""
    print("| what | value | error | may be | rounding alone |\n| --- | --- | --- | --- | --- |")
    for row in rows():
        missed = "" if row.ok else " (missed)"
        print(
            f"| {row.what} | {row.value:g} | {row.error:.1e}{missed} | {row.allowed:.1e} | "
            f"{row.limit:.1e} |"
        )


if __name__ == "__main__":
    main()
