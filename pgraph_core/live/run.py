"""A scene by one fixed-step method as a memory image that the WebAssembly kernels step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..engine import layout as at
from ..engine import motion
from ..engine.arrays import CONTACTS, RUN, SCENE, Links, RunLinks
from ..engine.compiler.address import address_of
from ..engine.records import APPLIED_FORCE, SPRING, STEP_CONTROL, table
from ..errors import InputError, Problem, choices
from ..integrators import METHODS
from ..mechanism import Mechanism
from ..model import Force
from ..simulation.options import Options
from ..simulation.plan import plan_of, with_contacts, with_state
from ..simulation.recording import Recording
from .image import Image, Root, offset_of

BASE = 1 << 21  # [bytes] where images begin: over the stack and the constants of the kernels
SMOOTH, TOUCHING = ("rk4", "semi_implicit_euler"), ("moreau_jean",)  # methods of a figure
LOADS = offset_of(SCENE, "loads", "table")


def offsets(kind: Any) -> dict[str, int]:
    """{field of a record: where it stands} [bytes]."""
    return {name: offset for name, (_, offset, *_) in kind.fields.items()}


CONTROL = offsets(STEP_CONTROL)
NO_LINKS, NO_RUN_LINKS = Links(), RunLinks(0, 0, 0, 0)


class Setup(NamedTuple):
    """What is run, besides the mechanism."""

    scenario: str | None = None
    step: float = 1e-3  # [s]
    t_start: float = 0.0  # [s]
    state: tuple[Any, Any] | None = None  # q, v; None: the scenario's, or the model's
    forces: tuple[Force, ...] = ()  # besides the model's and the scenario's

    def options(self, method: str | None) -> Options:
        """For the plan of a run."""
        return Options(
            scenario=self.scenario, method=method, step=self.step, t_start=self.t_start,
            t_end=self.t_start + self.step, frames=2, forces=self.forces,
        )  # fmt: skip


def methods_of(mech: Mechanism, setup: Setup) -> tuple[str, ...]:
    """The methods that a figure of this scene offers, the usual one first."""
    plan = plan_of(mech, setup.options("auto"), None, *(setup.state or (None, None)))
    plan = plan.near or plan
    return TOUCHING if plan.contacts is not None or plan.contact_points else SMOOTH


class LiveRun:
    """The memory of a run at its start, before its constraints are met."""

    def __init__(self, mech: Mechanism, setup: Setup, method: str):
        """Raises InputError where the scene cannot travel."""
        q, v = setup.state or (None, None)
        plan = with_contacts(plan_of(mech, setup.options(method), None, q, v))
        _check(plan)
        drives = plan.drives._replace(knots=plan.drives.knots.copy())
        self.mech, self.plan = mech, replace(plan, drives=drives)
        self.record = Recording(mech, self.plan, *with_state(mech, plan.start, q, v), plan.tau)
        self.record.steps.open_ended(setup.step)
        self._lay_out()

    def _lay_out(self) -> None:
        scene, steps, packed = self.record.scene, self.record.steps, self.mech.packed
        kept = scene._kept
        # one spring more than the scene has, for the mouse: the struct does not count it
        own = len(kept.loads.table)
        self._pull = table(APPLIED_FORCE, own + 1)
        self._pull[:own] = kept.loads.table
        self._pull[own]["kind"] = SPRING
        kept = kept._replace(loads=kept.loads._replace(table=self._pull[:own]))
        roots = {"scene": Root(SCENE, kept), "run": Root(RUN, steps._kept)}
        if scene.touching is not None:
            roots["contacts"] = Root(CONTACTS, scene.touching._kept)
        user: Any = scene.user
        if user is not None:
            from ..engine.gait.tables import WALK

            inside = user.exchange
            roots["walk"] = Root(WALK, user._kept, inside, inside[:3].nbytes)
        nb, nv = self.mech.nb, self.mech.nv
        self.position, self.rotation = np.zeros((nb, 3)), np.zeros((nb, 9))
        self.still, self.trial = np.zeros(nv), np.zeros(self.mech.nq + nv)
        self.view_work = np.zeros_like(scene.work)  # what steps keep there is not to be touched
        self.numbers, self.packed_arrays = packed.columns.numbers, packed._arrays
        scratch = (self.position, self.rotation, self.still, self.trial, self.view_work)
        others = (self._pull, *self.numbers, *self.packed_arrays, *scratch)
        self.image = Image(BASE, roots, others)
        self._scene = kept

    def memory(self) -> bytearray:
        """The image; addresses of kernels are zero, see `links`."""
        at_, steps = self.image.at, self.record.steps
        kept = self._scene._replace(links=NO_LINKS._replace(contacts=at_.get("contacts", 0)))
        kept = kept._replace(user=kept.user._replace(address=0))
        run = steps._kept._replace(scene=at_["scene"], links=NO_RUN_LINKS)
        found = self.image.bytes({"scene": kept, "run": run})
        for name in ("guard", "approach"):
            start = self._control + CONTROL[name] - BASE
            found[start : start + 8] = bytes(8)
        return found

    @property
    def _control(self) -> int:
        return self.image.place(self.record.steps.control_table)

    def links(self) -> list[tuple[int, str]]:
        """(address, name of the kernel whose number in the table of functions belongs there)."""
        scene, run, found = self.image.at["scene"], self.image.at["run"], list[tuple[int, str]]()
        names = _kernels(self.plan.method.name)
        for kind, start, value in (
            (SCENE, scene, self.record.scene._kept.links),
            (RUN, run, self.record.steps._kept.links),
        ):
            for field, address in value._asdict().items():
                if address and field != "contacts":
                    found.append((start + offset_of(kind, "links", field), names[address]))
        user = self.record.scene.user
        if user is not None:
            found.append((scene + offset_of(SCENE, "user", "address"), names[user.address]))
        if approach := int(self.record.steps.control["approach"]):
            field = CONTROL["approach"]
            found.append((self._control + field, names[approach]))
        return found

    def lengths(self) -> list[int]:
        """Addresses of what is the mechanism's length."""
        found = [self._control + CONTROL["length"]]
        if (touching := self.record.scene.touching) is not None:
            tally = touching._kept.tally
            found.append(self.image.place(tally) + tally.dtype.fields["length"][1])
        return found

    def header(self) -> dict[str, Any]:
        """Where the browser finds what it reads and writes; addresses in [bytes]."""
        place, record = self.image.place, self.record
        steps, kept = record.steps, record.steps._kept
        parent, body, motions, start = self.numbers
        rows, const, bodies_i, bodies_f, home = self.packed_arrays
        copies = []
        if place(self._scene.const) != place(const):
            copies.append((place(const), place(self._scene.const), const.nbytes))
        arrays = {
            "rows": rows, "const": const, "bodies_i": bodies_i, "bodies_f": bodies_f,
            "home": home, "parent": parent, "body": body, "motion": motions, "start": start,
            "view_work": self.view_work, "position": self.position, "rotation": self.rotation,
            "still": self.still, "trial": self.trial, "q": steps.q, "v": steps.v,
            "given": self._scene.given, "flow": kept.flow, "vdot": record.out.vdot[0],
            "wrenches": record.out.wrenches[0], "times": kept.times, "substeps": kept.substeps,
            "width": kept.width, "pull": self._pull[-1:],
        }  # fmt: skip
        described = {name: (place(a), *a.shape) for name, a in arrays.items()}
        touching = record.scene.touching
        user: Any = record.scene.user
        return {
            "base": BASE,
            "size": self.image.size,
            "scene": self.image.at["scene"],
            "run": self.image.at["run"],
            "loads": self.image.at["scene"] + LOADS,
            "control": self._control,
            "fields": CONTROL,
            "spring": offsets(APPLIED_FORCE),
            "links": self.links(),
            "arrays": described,
            "copies": copies,
            "lengths": self.lengths(),
            "columns": {"mass": at.MASS, "link": at.LINK, "com": at.COM, "inertia": at.INERTIA},
            "own_loads": len(self._pull) - 1,
            "project": bool(self.plan.project and len(self.plan.active)),
            "bounded": bool(steps.control["approach"]),
            "fallen": place(user.fallen) if user is not None else 0,
            "logged": _logged(self.image, touching),
        }  # fmt: skip


def _logged(image: Image, touching: Any) -> int:
    """Where the number of logged changes of phases stands; 0 where there are no contacts."""
    if touching is None:
        return 0
    tally = touching._kept.tally
    return image.place(tally) + tally.dtype.fields["logged"][1]


def _check(plan: Any) -> None:
    """Raises InputError where a run changes its equations on the way."""
    if plan.changes or plan.conditions:
        text = "switches constraints on the way, which a live figure cannot do; choose another "
        text += "scenario, or export the recording without --live"
        raise InputError(Problem("export", "scenario", text))
    if plan.method.name not in (*SMOOTH, *TOUCHING):
        text = f"must be one of {choices((*SMOOTH, *TOUCHING))}; given {plan.method.name!r}"
        raise InputError(Problem("export", "method", text))


def _kernels(method: str) -> Mapping[int, str]:
    """{address here: name} of the kernels that runs call by address."""
    names = [motion.acceleration, motion.projection, motion.record, motion.constrain]
    names.append(METHODS[method].kernel)
    if method == "moreau_jean":
        from ..engine.contact import approach, contacts
        from ..engine.gait import walking

        names += [contacts.find, contacts.contact_forces, contacts.record_contacts]
        names += [contacts.settle_contacts, approach.bound_step, walking.walking]
    return {address_of(kernel): kernel.__name__ for kernel in names}
