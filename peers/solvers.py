"""Other integrators on Pgraph's own equations: SUNDIALS' CVODE and IDA, SciPy's Radau and BDF.

They get y' = (q', v') of the driven, loaded, constrained mechanism from the kernels that Pgraph's
methods call, through a Python function, as somebody would who has only the equations. Constraints
enter as forces; nothing is projected.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from pgraph_core import Mechanism
from pgraph_core.dynamics.scene import Scene
from pgraph_core.engine import motion
from pgraph_core.engine.compiler.address import address_of
from pgraph_core.packing import plain
from pgraph_core.simulation.plan import active_constraints

from .motion import Clocks, Refused, Trajectory, refuse_contacts
from .rows import Array

MOST_STEPS = 1_000_000


class Cancelled(Exception):
    """The run was cancelled."""


class Equations:
    """y' of a motion, y = (q, v)."""

    def __init__(self, mech: Mechanism, scenario: str | None, tau: Any):
        """Raises Refused for scenes with contacts, switches or torques from a function."""
        given = None if scenario is None else mech.model.scenario(scenario)
        if callable(tau):
            raise Refused("its torques are a function")
        refuse_contacts(mech, given)
        if any(any(body.friction) for body in mech.model.bodies):
            raise Refused("it has joint friction, at whose kinks these methods stall")
        forces = (*mech.model.forces, *(given.forces if given else ()))
        packed = mech.packed
        active = active_constraints(mech, given)
        self.scene = Scene(packed, packed.drives(forces), packed.loads(forces), active)
        self.accelerate = address_of(motion.acceleration)
        self.nq, self.nv = mech.nq, mech.nv
        self.tau = np.zeros(mech.nv) if tau is None else np.asarray(tau, dtype=float)
        self.balls = [(i, j) for _, i, j in packed.quaternions]
        self.at_q, self.at_v = plain(packed.rows)
        self.vdot, self.flow = np.zeros(mech.nv), np.zeros(3)
        self.none = np.zeros((len(self.scene.blocks.blocks_i), 6))
        self.count = 0

    def __call__(self, t: float, y: Array, out: Array) -> None:
        """y' into `out`."""
        self.count += 1
        nq = self.nq
        q, v = y[:nq].copy(), y[nq:].copy()
        for i, _ in self.balls:
            q[i : i + 4] /= np.linalg.norm(q[i : i + 4])
        motion.constrained_dynamics(
            self.scene.address, self.accelerate, t, q, v, self.tau, self.flow, self.vdot, self.none
        )
        out[self.at_q] = v[self.at_v]
        for i, j in self.balls:
            w, u, omega = y[i], y[i + 1 : i + 4], 0.5 * v[j : j + 3]
            out[i] = -omega @ u
            out[i + 1 : i + 4] = w * omega + np.cross(omega, u)
        out[nq:] = self.vdot


class Run(ABC):
    """A motion by each method of a package, at any tolerance."""

    by = "rtol"

    def __init__(
        self, mech: Mechanism, q: Array, v: Array, t: Array, scenario: str | None, tau: Any
    ):
        self.equations = Equations(mech, scenario, tau)
        self.t, self.start = t, np.concatenate((q, v))
        self.methods = {name: partial(self, how) for name, how in self.ways().items()}

    @abstractmethod
    def ways(self) -> dict[str, Callable[..., Any]]:
        """Methods by name: functions of (y', tolerance) that return (y at all times, counters)."""

    def __call__(
        self, way: Callable[..., Any], rtol: float, going: Callable[[], bool]
    ) -> Trajectory | None:
        """Run a method, or return None if `going` returned False."""
        equations = self.equations
        equations.count = 0

        def rates(t: float, y: Array, out: Array) -> None:
            if equations.count % 64 == 0 and not going():
                raise Cancelled
            equations(t, y, out)

        clocks = Clocks()
        try:
            y, counters = way(rates, rtol)
        except Cancelled:
            return None
        q = np.asarray(y)[:, : equations.nq]
        seconds = clocks.read()
        for i, _ in equations.balls:
            q[:, i : i + 4] /= np.linalg.norm(q[:, i : i + 4], axis=1, keepdims=True)
        return Trajectory(q, seconds, {**counters, "evaluations": equations.count})


class Sundials(Run):
    """CVODE by backward differences and Adams' formulas, and IDA on y' - f(t, y) = 0."""

    def ways(self) -> dict[str, Callable[..., Any]]:
        return {
            "cvode bdf": partial(self._cvode, "BDF"),
            "cvode adams": partial(self._cvode, "Adams"),
            "ida": self._ida,
        }

    def _cvode(self, method: str, rates: Callable[..., None], rtol: float) -> Any:
        from sksundae.cvode import CVODE

        solver = CVODE(rates, method=method, rtol=rtol, atol=rtol, max_num_steps=MOST_STEPS)
        return _done(solver.solve(self.t, self.start))

    def _ida(self, rates: Callable[..., None], rtol: float) -> Any:
        from sksundae.ida import IDA

        def residual(t: float, y: Array, yp: Array, out: Array) -> None:
            rates(t, y, out)
            out[:] = yp - out

        slope = np.zeros_like(self.start)
        rates(0.0, self.start, slope)
        solver = IDA(residual, rtol=rtol, atol=rtol, max_num_steps=MOST_STEPS)
        return _done(solver.solve(self.t, self.start, slope))


def _done(found: Any) -> tuple[Array, dict[str, int]]:
    if not found.success:
        raise RuntimeError(str(found.message))
    return np.array(found.y), {}


class Scipy(Run):
    """SciPy's implicit methods."""

    def ways(self) -> dict[str, Callable[..., Any]]:
        return {name.lower(): partial(self._solved, name) for name in ("Radau", "BDF")}

    def _solved(self, method: str, rates: Callable[..., None], rtol: float) -> Any:
        from scipy.integrate import solve_ivp

        def slope(t: float, y: Array) -> Array:
            out = np.empty_like(y)
            rates(t, y, out)
            return out

        span = (0.0, float(self.t[-1]))
        done = solve_ivp(slope, span, self.start, method, self.t, rtol=rtol, atol=rtol)
        if not done.success:
            raise RuntimeError(done.message)
        return done.y.T, {}
