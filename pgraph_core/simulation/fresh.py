"""The plan and the tables with which a stepper begins, and to which a reset takes it back.

Making tables takes as long as a hundred steps of a small model, copying them back as long as a few.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple, Self

import numpy as np

from ..engine.arrays import Run
from ..errors import InputError, Problem
from ..mechanism import Mechanism
from ..model import Force
from ..packing import Array
from .choice import STEPPED
from .loop import Workplace
from .options import Options, begun, driven
from .plan import begun_with, plan_of, with_contacts
from .recording import Recording
from .run_plan import RunPlan
from .start import given_states

Bytes = Array


class Fresh(NamedTuple):
    """The arrays of a workplace, and copies of them from before its first run."""

    asked: RunPlan  # the plan that the mechanism keeps
    plan: RunPlan  # the same with tables of the stepper's own
    place: Workplace
    kept: Run  # the arrays that kernels know
    arrays: list[tuple[Bytes, Bytes]]  # with their copies

    @classmethod
    def of(cls, record: Recording, asked: RunPlan) -> Self | None:
        """Keep what a recording that has not begun writes into, or return None if it depends on
        functions of the user or on a run before it."""
        scene, steps = record.scene, record.steps
        called = record.user is not None or record.sampled is not None or record.watch is not None
        if called or steps.clearance is not None or record.plan.memory is not None:
            return None
        written = [*memory_of(record), *steps.given]
        written += [array for own in scene.loads for array in own]
        views = [array.reshape(-1).view(np.uint8) for array in written if array.size]
        place = Workplace(scene, steps, record.out, None)
        return cls(asked, record.plan, place, steps.kept, [(x, x.copy()) for x in views])

    def again(self, record: Recording, state: tuple[Array, Array], tau: Any) -> Recording:
        """Return a recording from another state in the same place, after this one."""
        for array, copy in self.arrays:
            array[:] = copy
        return Recording(record.mech, self.plan, *state, tau, place=self.place)

    def fits(self, record: Recording, asked: RunPlan) -> bool:
        """Check whether a recording is still in this place, and the next is by the same plan."""
        return asked is self.asked and record.steps.kept is self.kept


def memory_of(record: Recording) -> list[Array]:
    """Return the arrays that the steps of a recording read before writing to them."""
    scene, steps = record.scene, record.steps
    found = [steps.control_table, steps.counters_table, steps.stages, *steps.memory]
    found += [scene.given]
    _, inputs_of_paths, _ = scene.loads.strut
    found += [scene.active, scene.blocks.blocks_f, scene.drives.knots, inputs_of_paths]
    found += scene.space
    if scene.touching is not None:
        found += scene.touching.memory
    if record.user is not None:
        found += record.user.memory
    return found


def plan_of_steps(mech: Mechanism, options: Options, tau: Any, q: Any, v: Any) -> RunPlan:
    """Return the plan of steps with contacts from the start. Raises InputError."""
    plan = with_contacts(plan_of(mech, options, tau, q, v))
    if plan.contact_points and options.method is None:
        return with_contacts(plan_of(mech, options.changed(method=STEPPED), tau, q, v))
    if plan.contact_points:
        text = f"{options.method} is event-driven for rigid contacts and limits, which a "
        text += f"Stepper does not support; choose '{STEPPED}', or use simulate"
        raise InputError(Problem("Stepper", "method", text))
    return plan


def set_up(
    mech: Mechanism, options: Options, asked: RunPlan, state: tuple[Array, Array], states: Any,
    tau: Any,
) -> tuple[Recording, tuple[Force, ...]]:  # fmt: skip
    """Return a recording with tables of its own, whose constraints and inputs may change, and its
    forces."""
    name, t = options.scenario, options.t_start
    given = mech.model.scenario(name) if name is not None else None
    forces = (*mech.model.forces, *(given.forces if given else ()), *options.forces)
    if options.inputs:
        forces = driven(forces, options.inputs, "Stepper", t)
    forces = begun(forces, t)
    drives = asked.drives._replace(knots=asked.drives.knots.copy())
    whole, bent = np.arange(len(mech.model.constraints)), asked.method.order > 1
    loads = mech.packed.loads(forces, states=True, bent=bent, touching=bent and asked.yields)
    plan = replace(asked, drives=drives, loads=loads, ever=whole, acting=forces)
    if states is not None:
        plan = begun_with(plan, given_states(mech, states))
    record = Recording(mech, plan, *state, tau)
    scene = record.scene
    record.plan = replace(record.plan, drives=scene.drives, loads=scene.loads)
    return record, forces
