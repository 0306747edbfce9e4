"""A walk that is simulated in segments, between which the speed can be changed and pushes
applied."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import InputError, Problem, explained
from ..gait.controller import Controller
from ..mechanism import Mechanism, mechanism_of
from ..model import Force, Gait, Model, VectorTable
from ..packing import Array
from ..portable import Portable
from ..result import Result
from ..tolerances import NOTABLE
from . import simulate
from .options import Options, positive
from .plan import plan_of
from .stepper import Stepper


@explained
class Walk(Portable):
    """An interactive walk, simulated in segments.

    For example, the following code plays a walk while it is computed:

        walk = Walk(mech, scenario="trot")
        part = walk.step(0.05)           # a Result, ready long before its 50 ms are over
        show(part); parts.append(part)   # `joined(parts)` is the whole run, for files and plots
        walk.change(speed=0.9)           # any field of the gait, whose clock and heading continue
        walk.change(**dict(gaits["crawl"]))              # the speed follows its `acceleration`
        walk.push((0, 0, 80), seconds=0.2)               # [N] on the trunk, in world axes
        walk.follow(underfoot(walk.mech.model, friction=0.3))    # other ground, law or masses

    Each piece continues from the final state of the previous one, including the states of controls.
    Results are reproducible if the same changes are made at the same times. If the model falls, a
    warning is added to the piece and `fell` is set to True.
    """

    def __init__(
        self,
        mech: Mechanism | Model,
        scenario: str,
        *,
        gait: Gait | None = None,
        q: Array | None = None,
        v: Array | None = None,
        step: float | None = None,
        method: str | None = None,
    ):
        """Start from standing. Raises InputError if the scenario has no gait."""
        mech = mechanism_of(mech, "Walk")
        given = mech.model.scenario(scenario)
        if gait is None and given.gait is None:
            text = f"scenario '{scenario}' has no gait; give it one"
            raise InputError(Problem("Walk", "gait", text))
        self.mech, self.scenario = mech, scenario
        self.controller = Controller(mech, gait or given.gait)  # type: ignore[arg-type]
        start = self.controller.start()
        self.t = 0.0
        self.q, self.v = start[0] if q is None else q, start[1] if v is None else v
        self.states: Array | None = None  # control states, None before the first piece
        self.fell = False
        self._options: dict[str, Any] = {"step": step, "method": method}
        self._pushes: list[tuple[float, Force]] = []  # when each is over
        self._stepper: Stepper | None = None
        self._built = False  # whether the stepper is that of the next piece
        self._failed: Result | None = None  # the last piece if it failed

    @property
    def gait(self) -> Gait:
        """The current gait."""
        return self.controller.gait

    def step(self, dt: float, *, frames: int | None = None) -> Result:
        """Advance the walk and return the motion.

        Parameters
        ----------
        dt : float
            Duration [s].
        frames : int, optional
            Number of evenly spaced states in the result. The default is one per step.

        Raises
        ------
        InputError
            If the previous piece failed, and neither the state nor the walk was changed.
        """
        dt = positive("dt", dt, call="Walk.step")
        last, state = self._failed, np.concatenate((self.q, self.v))
        same = last is not None and np.array_equal(state, (*last.q[-1], *last.v[-1]))
        if last is not None and self._built and same:
            text = f"the last piece failed: {last.message}; give other q and v, or change or "
            raise InputError(Problem("Walk.step", "", f"{text}push the walk"))
        if any(end <= self.t for end, _ in self._pushes):
            self._pushes = [push for push in self._pushes if push[0] > self.t]
            self._built = False
        if not self._built or not self._follows():
            self._stepper, self._built = self._new_stepper(dt), True
        stepper = self._stepper
        run = self._run(dt, frames) if stepper is None else stepper.record_over(dt, frames)
        if len(run.t):
            self.t, self.q, self.v = float(run.t[-1]), run.q[-1], run.v[-1]
            self.states = run.states[-1]
        self.fell = self.fell or any("fell" in text for text in run.notices)
        self._failed = None if run.status.ok else run
        return run

    def _follows(self) -> bool:
        """Check whether the stepper is at the walk's state, which a caller may have changed."""
        stepper = self._stepper
        if stepper is None:
            return True
        same = self.t == stepper.t and self.controller is stepper.tau
        return same and np.array_equal(self.q, stepper.q) and np.array_equal(self.v, stepper.v)

    def _new_stepper(self, dt: float) -> Stepper | None:
        """Return the stepper for the next segments, or None if the method requires separate
        runs."""
        options = Options.unchecked(
            scenario=self.scenario, t_end=dt, forces=self._forces, **self._options
        )
        plan = plan_of(self.mech, options, self.controller, self.q, self.v)
        given = self.mech.model.scenario(self.scenario)
        if plan.tolerance is not None or plan.contact_points or given.switches:
            return None
        stepper = Stepper(
            self.mech,
            step=self._options["step"] or given.step,
            method=plan.method.name,
            scenario=self.scenario,
            tau=self.controller,
            forces=self._forces,
            q=self.q,
            v=self.v,
            states=self.states,
            t_start=self.t,
        )
        stepper.because(plan.header["why"])
        return stepper

    @property
    def _forces(self) -> tuple[Force, ...]:
        return tuple(force for _, force in self._pushes)

    def _run(self, dt: float, frames: int | None) -> Result:
        """Simulate a segment as a separate run."""
        return simulate(
            self.mech,
            self.q,
            self.v,
            states=self.states,
            t_start=self.t,
            t_end=self.t + dt,
            scenario=self.scenario,
            tau=self.controller,
            forces=self._forces,
            frames=frames,
            estimate=False,
            **self._options,
        )

    def change(self, **fields: Any) -> None:
        """Change fields of the gait from now on.

        Parameters
        ----------
        **fields
            New values by name of field of `Gait`.

        Raises
        ------
        ModelError, InputError
            If a field does not exist or a value is not permitted. The gait stays unchanged.
        """
        self.controller = self.controller.changed(self.t, **fields)
        self._built = False

    def push(
        self, force: Sequence[float], seconds: float = 0.1, *, body: str | None = None
    ) -> None:
        """Push a body for some time, starting now.

        Parameters
        ----------
        force : array_like (3,)
            Force in world axes [N].
        seconds : float, optional
            Duration [s].
        body : str, optional
            Body at whose origin the force acts. The default is the trunk.
        """
        t, (x, y, z) = self.t, force
        end, edge = t + seconds, NOTABLE * seconds
        table = VectorTable(
            t=(t - edge, t, end, end + edge),
            value=((0.0, 0.0, 0.0), (x, y, z), (x, y, z), (0.0, 0.0, 0.0)),
        )
        name, whose = f"push at {t:.6g} s", body or self.mech.names[0]
        wrench = Force(name=name, kind="wrench", body=whose, force=table, point=(0.0, 0.0, 0.0))
        self._pushes.append((end + edge, wrench))
        self._built = False

    def follow(self, model: Model) -> None:
        """Continue with a modified model. The controller is not changed.

        Parameters
        ----------
        model : Model
            A model with the same joints.
        """
        mech = Mechanism(model)
        self.q, self.v, _ = mech.state_from(self.mech, self.q, self.v)
        self.mech, self._built = mech, False
