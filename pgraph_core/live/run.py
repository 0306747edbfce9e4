"""The memory of a run with one method as an image, which kernels of another machine step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..engine import layout as at
from ..engine import motion
from ..engine.arrays import CONTACTS, RUN, SCENE, Links, RunLinks
from ..engine.compiler.address import address_of
from ..engine.records import CHOSEN, GIVEN, STEP_CONTROL, offsets, table
from ..engine.stepping import crossings
from ..errors import InputError, Problem, choices
from ..forces import spring
from ..integrators import METHODS, RK4
from ..mechanism import Mechanism
from ..model import Force
from ..simulation.options import Options
from ..simulation.plan import plan_of, with_contacts
from ..simulation.recording import Recording
from ..simulation.start import with_state
from .image import FOUR_BYTES, Image, Root

BASE = 1 << 21  # [bytes] address of images: above the stack and the constants of the kernels
# methods of a figure
SMOOTH = RK4.name, *(m.name for m in METHODS.values() if m.explicit and m is not RK4)
TOUCHING = tuple(m.name for m in METHODS.values() if m.time_stepping)
MOST_LIVE_STEPS = 100_000_000  # limit on the steps of a reader's run


CONTROL = offsets(STEP_CONTROL)
NO_LINKS, NO_RUN_LINKS = Links(), RunLinks(0, 0, 0, 0)


class Setup(NamedTuple):
    """Arguments for a run in addition to the mechanism."""

    scenario: str | None = None
    step: float = 1e-3  # [s]
    t_start: float = 0.0  # [s]
    state: tuple[Any, Any] | None = None  # (q, v), None for that of the scenario or the model
    forces: tuple[Force, ...] = ()  # besides the model's and the scenario's

    def options(self, method: str | None) -> Options:
        """Return options for a run with two frames after the start, the next one and the end."""
        adaptive = method in METHODS and METHODS[method].adaptive
        return Options.unchecked(
            scenario=self.scenario, method=method, step=None if adaptive else self.step,
            t_start=self.t_start, t_end=self.t_start + MOST_LIVE_STEPS * self.step, frames=3,
            forces=self.forces, estimate=False,
        )  # fmt: skip


def methods_of(mech: Mechanism, setup: Setup) -> tuple[str, ...]:
    """Return the methods available to a figure of this scene."""
    plan = plan_of(mech, setup.options("auto"), None, *(setup.state or (None, None)))
    plan = plan.touching
    return TOUCHING if plan.contacts is not None or plan.contact_points else SMOOTH


class LiveRun:
    """The memory for a run at its start, before the state is projected onto the constraints."""

    pointers = FOUR_BYTES

    def __init__(self, mech: Mechanism, setup: Setup, method: str):
        """Build the image. Raises InputError if the scene cannot be exported."""
        q, v = setup.state or (None, None)
        plan = with_contacts(plan_of(mech, setup.options(method), None, q, v))
        if plan.changes or plan.conditions:
            text = "switches constraints on the way, which a live figure cannot do; choose another "
            text += "scenario, or export the recording without --live"
            raise InputError(Problem("export", "scenario", text))
        if plan.method.name not in (*SMOOTH, *TOUCHING):
            text = f"must be one of {choices((*SMOOTH, *TOUCHING))}, got {plan.method.name!r}"
            raise InputError(Problem("export", "method", text))
        drives = plan.drives._replace(knots=plan.drives.knots.copy())
        self.mech, self.plan = mech, replace(plan, drives=drives)
        state = with_state(mech, plan.start, q, v, float(plan.times[0]))
        self.record = Recording(mech, self.plan, *state, plan.tau)
        if mech.model.stateful:
            begin = self.record.steps.q, self.record.steps.v
            self.record.scene.begin_controls(self.record.start, 0.0, *begin)
            self.record.scene.loads.signals[0][1::2] = 0.0  # values on the way, of no later use
        if plan.tolerance is None:
            self.record.steps.open_ended(setup.step)
        self._lay_out()

    def _lay_out(self) -> None:
        scene, steps = self.record.scene, self.record.steps
        packed = scene.packed
        kept = scene._kept
        # one spring more than the scene has, for the mouse: the struct does not count it
        springs, *others = kept.loads.spring
        own = len(springs)
        self._pull = table(spring.ROW, own + 1)
        self._pull[:own] = springs
        kept = kept._replace(loads=kept.loads._replace(spring=(self._pull[:own], *others)))
        roots = {"scene": Root(SCENE, kept), "run": Root(RUN, steps._kept)}
        if scene.touching is not None:
            roots["contacts"] = Root(CONTACTS, scene.touching._kept)
        user: Any = scene.user
        if user is not None:
            from ..engine.gait.tables import WALK

            inside = user.exchange
            roots["walk"] = Root(WALK, user.kept, inside, inside[:3].nbytes)
        nb, nv = packed.nb, packed.nv
        self.position, self.rotation = np.zeros((nb, 3)), np.zeros((nb, 9))
        self.still, self.trial = np.zeros(nv), np.zeros(packed.nq + nv)
        self.view_work = np.zeros_like(scene.work)  # apart from the steps' own
        self.numbers, self.packed_arrays = packed.numbers, packed._arrays
        self.image = Image(BASE, self.pointers, roots, self.others())
        self._scene = kept

    def others(self) -> tuple[Any, ...]:
        """Return the arrays outside structs."""
        scratch = (self.position, self.rotation, self.still, self.trial, self.view_work)
        return (self._pull, *self.numbers, *self.packed_arrays, *scratch)

    def memory(self) -> bytearray:
        """Return the image. Kernel addresses are zero and are filled in through `links`."""
        at_, steps = self.image.at, self.record.steps
        kept = self._scene._replace(links=NO_LINKS._replace(contacts=at_.get("contacts", 0)))
        kept = kept._replace(user=kept.user._replace(address=0))
        run = steps._kept._replace(scene=at_["scene"], links=NO_RUN_LINKS)
        found = self.image.bytes({"scene": kept, "run": run})
        for name in ("address", "approach"):
            start = self._control + CONTROL[name] - self.image.base
            found[start : start + 8] = bytes(8)
        return found

    @property
    def _control(self) -> int:
        return self.image.place(self.record.steps.control_table)

    def links(self) -> list[tuple[int, str]]:
        """Return (address, kernel name) pairs. The address gets the kernel's index in the table."""
        scene, run, found = self.image.at["scene"], self.image.at["run"], list[tuple[int, str]]()
        names = _kernels(self.plan.method.name)
        for kind, start, value in (
            (SCENE, scene, self.record.scene._kept.links),
            (RUN, run, self.record.steps._kept.links),
        ):
            for field, address in value._asdict().items():
                if address and field != "contacts":
                    found.append(
                        (start + self.pointers.offset_of(kind, "links", field), names[address])
                    )
        user = self.record.scene.user
        if user is not None:
            found.append(
                (scene + self.pointers.offset_of(SCENE, "user", "address"), names[user.address])
            )
        if approach := int(self.record.steps.guard["approach"]):
            field = CONTROL["approach"]
            found.append((self._control + field, names[approach]))
        return found

    def lengths(self) -> list[int]:
        """Return the addresses that contain the length of the mechanism."""
        found = [self._control + CONTROL["length"]]
        if (touching := self.record.scene.touching) is not None:
            tally = touching._kept.tally
            found.append(self.image.place(tally) + tally.dtype.fields["length"][1])
        return found

    def header(self) -> dict[str, Any]:
        """Return the addresses [bytes] of all data that the browser reads and writes."""
        place, record = self.image.place, self.record
        steps, kept = record.steps, record.steps._kept
        parent, body, motions, start, tracks = self.numbers
        rows, const, bodies_i, bodies_f, home = self.packed_arrays
        copies = []
        if place(self._scene.const) != place(const):
            copies.append((place(const), place(self._scene.const), const.nbytes))
        arrays = {
            "rows": rows, "const": const, "bodies_i": bodies_i, "bodies_f": bodies_f,
            "home": home, "parent": parent, "body": body, "motion": motions, "start": start,
            "tracks": tracks,
            "view_work": self.view_work, "position": self.position, "rotation": self.rotation,
            "still": self.still, "trial": self.trial, "q": steps.q, "v": steps.v,
            "given": self._scene.given, "flow": kept.flow, "vdot": record.out.vdot[0],
            "wrenches": record.out.wrenches[0], "times": kept.times, "substeps": kept.substeps,
            "width": kept.width, "pull": self._pull[-1:], "corners": kept.corners,
            "q_shown": record.out.q[1], "v_shown": record.out.v[1],
        }  # fmt: skip
        described = {name: (place(a), *a.shape) for name, a in arrays.items()}
        touching, chosen = record.scene.touching, self.plan.tolerance is not None
        user: Any = record.scene.user
        return {
            "base": BASE,
            "size": self.image.size,
            "scene": self.image.at["scene"],
            "run": self.image.at["run"],
            "loads": self.image.at["scene"] + self.pointers.offset_of(SCENE, "loads", "spring"),
            "corners": self.image.at["run"] + self.pointers.offset_of(RUN, "corners"),
            "widths": {"chosen": CHOSEN, "given": GIVEN} if chosen else None,
            "control": self._control,
            "fields": CONTROL,
            "spring": offsets(spring.ROW),
            "links": self.links(),
            "arrays": described,
            "copies": copies,
            "lengths": self.lengths(),
            "columns": {"mass": at.MASS, "link": at.LINK, "com": at.COM, "inertia": at.INERTIA},
            "own_loads": len(self._pull) - 1,
            "project": bool(self.plan.project and len(self.plan.active)),
            "bounded": bool(steps.guard["approach"]),
            "state": at.Y,
            "fallen": place(user.fallen) if user is not None else 0,
            "logged": _logged(self.image, touching),
        }  # fmt: skip


def _logged(image: Image, touching: Any) -> int:
    """Return the address of the number of logged phase changes, or 0 without contacts."""
    if touching is None:
        return 0
    tally = touching._kept.tally
    return image.place(tally) + tally.dtype.fields["logged"][1]


def _kernels(method: str) -> Mapping[int, str]:
    """Return {address: name} of the compiled kernels that runs call by address."""
    names = [motion.acceleration, motion.projection, motion.record, motion.constrain]
    names += [METHODS[method].kernel, crossings.cross]
    if METHODS[method].time_stepping:
        from ..engine.contact import approach, contacts
        from ..engine.gait import walking

        names += [contacts.find, contacts.contact_forces, contacts.record_contacts]
        names += [contacts.settle_contacts, approach.bound_step, walking.walking]
    called = lambda kernel: getattr(kernel, "is_ready", True)  # noqa: E731
    return {address_of(kernel): kernel.__name__ for kernel in names if called(kernel)}
