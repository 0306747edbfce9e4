"""What a scene needs to run, and what is left out of its runs because the model lacks it.

The plan follows from the description alone. Kernels do not look at it: what is absent there is an
empty array and a loop of length zero. It says the same in words and counts.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from .errors import counted, explained, no_method, refusal
from .integrators import METHODS
from .model import Body, Constraint, Contact, Force, Model
from .model.force import OnBody, OnJoint, Tendon, ends_of
from .model.scenario import AUTO, METHOD_NAMES

STEPPED_OVER = "moreau_jean"  # the method that needs no times of impacts
KEPT_A_BODY = 7 + 6 + 6 + 6  # pose, velocity, acceleration, joint force: made when asked for


class Part(NamedTuple):
    """One thing that a scene may need."""

    name: str
    needed: bool
    text: str  # what is done for it, or what is therefore not done
    saved: int = 0  # what leaving it out saves, where that can be counted
    unit: str = ""  # of `saved`


@explained
@dataclass(frozen=True)
class Plan:
    """The parts of a scene; `print` shows them in two columns."""

    parts: tuple[Part, ...]

    @classmethod
    def of(
        cls,
        model: Model,
        *,
        scenario: str | None = None,
        method: str = AUTO,
        acting: Collection[str] | None = None,
    ) -> Plan:
        """The plan of a model's runs; `acting` names constraints in place of the scenario's.

        Raises ModelError for a scenario that is not there, InputError for a method.
        """
        if method not in METHOD_NAMES:
            raise refusal("plan", "method", no_method(method, METHOD_NAMES))
        scene = Acting.of(model, scenario, method, acting)
        return cls(tuple(part for makers in MAKERS for part in makers(scene)))

    @property
    def needed(self) -> dict[str, str]:
        """What is done, by part."""
        return {part.name: part.text for part in self.parts if part.needed}

    @property
    def left_out(self) -> tuple[str, ...]:
        """What is not done, and why, a sentence each."""
        return tuple(part.text for part in self.parts if not part.needed)

    @property
    def saved(self) -> dict[str, str]:
        """Counts of what is not done, by part: "42 evaluations a Jacobian"."""
        return {p.name: f"{p.saved} {p.unit}" for p in self.parts if p.saved and not p.needed}

    def to_dict(self) -> dict[str, Any]:
        """All three, as plain values."""
        return {"needed": self.needed, "left_out": list(self.left_out), "saved": self.saved}

    def lines(self) -> list[str]:
        """A line a part: those that are needed first."""
        saved = self.saved
        lines = [f"needs              {text}" for text in self.needed.values()]
        for part in self.parts:
            if not part.needed:
                count = f" (saves {saved[part.name]})" if part.name in saved else ""
                lines.append(f"left out           {part.text}{count}")
        return lines

    def __str__(self) -> str:
        return "\n".join(self.lines())


class Acting(NamedTuple):
    """What acts in a run."""

    bodies: tuple[Body, ...]
    constraints: tuple[Constraint, ...]
    idle: tuple[Constraint, ...]
    contacts: tuple[Contact, ...]
    forces: tuple[Force, ...]
    method: str

    @classmethod
    def of(
        cls, model: Model, scenario: str | None, method: str, acting: Collection[str] | None
    ) -> Acting:
        """As the model or its scenario has it."""
        given = model.scenario(scenario) if scenario is not None else None
        names = given.constraints if given is not None else None
        if names is None:
            names = tuple(c.name for c in model.constraints if c.active)
        if given is not None:
            names = (*names, *(switch.constraint for switch in given.switches))
        names = set(names if acting is None else acting)
        touching = given.contacts if given is not None else None
        return cls(
            model.bodies,
            tuple(c for c in model.constraints if c.name in names),
            tuple(c for c in model.constraints if c.name not in names),
            tuple(
                c for c in model.contacts if (c.active if touching is None else c.name in touching)
            ),
            (*model.forces, *(given.forces if given is not None else ())),
            given.method if given is not None and method == AUTO else method,
        )

    @property
    def nv(self) -> int:
        """Degrees of freedom of the tree."""
        return sum(body.dof for body in self.bodies)

    @property
    def limits(self) -> int:
        """How many ends of motions are bounded."""
        pairs = [pair for b in self.bodies for pair in b.limits if pair is not None]
        ends = sum(end is not None for pair in pairs for end in pair)
        return ends + sum(end is not None for f in self.forces for end in ends_of(f))

    @property
    def impulses(self) -> bool:
        """Whether velocities may jump."""
        return bool(self.limits) or any(c.law != "soft" for c in self.contacts)

    @property
    def stiff(self) -> bool:
        """Whether something could make rates that a step does not resolve."""
        fields = ("stiffness", "damping", "friction")
        joints = any(any(getattr(b, f)) for b in self.bodies for f in fields)
        drives = (f.law for f in self.forces if isinstance(f, OnJoint))
        between = any(f.PASSIVE for f in self.forces) or any(x.kp or x.kd for x in drives)
        return joints or between or any(c.law != "complementarity" for c in self.contacts)


def _named(parts: Sequence[Any]) -> str:
    names = [part.name for part in parts]
    return ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")


def _tree(s: Acting) -> Iterator[Part]:
    motions = sum(len(b.sequence) for b in s.bodies)
    merged = sum(not b.sequence for b in s.bodies)
    text = f"{counted(motions, 'motion')} with {s.nv} degrees of freedom, swept at each evaluation"
    yield Part("tree", True, text)
    if merged:
        text = f"{counted(merged, 'welded body', 'welded bodies')} merged into what carries them: "
        yield Part("welds", False, f"{text}fewer rows to sweep", merged, "rows an evaluation")
    turning = [b for b in s.bodies if any(m.kind in ("ball", "free") for m in b.sequence)]
    if turning:
        yield Part("quaternions", True, f"quaternions of {_named(turning)}, kept at length 1")
    else:
        text = "no ball or free joint: no quaternions to keep, the state is a plain vector"
        yield Part("quaternions", False, text)


def _loops(s: Acting) -> Iterator[Part]:
    rows = sum(c.ROWS for c in s.constraints)
    if s.constraints:
        text = f"{counted(len(s.constraints), 'constraint')} of {counted(rows, 'row')}: their "
        text += f"forces at each evaluation, drift removed each step ({_named(s.constraints)})"
        yield Part("constraints", True, text)
    else:
        text = "no active constraint: no forces of constraints, no drift to remove"
        yield Part("constraints", False, text)
    if s.idle:
        count = sum(c.ROWS for c in s.idle)
        text = f"inactive: {_named(s.idle)}: their rows are not looked at"
        yield Part("inactive constraints", False, text, count, "rows an evaluation")


def _forces(s: Acting) -> Iterator[Part]:
    drives = [f for f in s.forces if isinstance(f, OnJoint)]
    tendons = [f for f in s.forces if isinstance(f, Tendon)]
    sprung = sum(any(map(any, (b.stiffness, b.damping, b.friction))) for b in s.bodies)
    if drives or sprung or tendons:
        own = [f"springs, dampers or friction of {counted(sprung, 'joint')}"] * bool(sprung)
        own += [f"{counted(len(drives), 'motor or servo', 'motors and servos')}"] * bool(drives)
        own += [f"{counted(len(tendons), 'tendon')}"] * bool(tendons)
        yield Part("drives", True, f"drive forces: {', '.join(own)}")
    else:
        text = "no spring, damper, friction, motor or servo in a joint: no drive forces"
        yield Part("drives", False, text, s.nv, "sums an evaluation")
    between = [f for f in s.forces if isinstance(f, OnBody)]
    if between:
        yield Part("loads", True, f"wrenches and springs between bodies: {_named(between)}")
    else:
        yield Part("loads", False, "no wrench or spring between bodies: no loads")


def _touching(s: Acting) -> Iterator[Part]:
    if s.contacts:
        yield Part("contacts", True, f"search, gaps and forces of contacts: {_named(s.contacts)}")
    else:
        text = "no contact: nothing is looked for that may touch"
        yield Part("contacts", False, text, 6 * len(s.bodies), "numbers a recorded frame")
    if s.limits:
        yield Part("limits", True, f"{counted(s.limits, 'end')} of joints watched")
    else:
        yield Part("limits", False, "no joint limit: no stops to watch", 2 * s.nv, "gaps a step")
    if not s.impulses:
        yield Part("impulses", False, "no rigid contact, no joint limit: no impacts")
    elif s.method in (AUTO, STEPPED_OVER):
        yield Part("impulses", True, "impulses by sweeps over contacts and limits, each step")
        yield Part("events", False, "impacts are located inside steps, not on dense output")
    else:
        yield Part("impulses", True, "impacts, and forces of what stands, from event to event")
        yield Part("events", True, "times of impacts, slips and lift-offs, by shorter steps")
    if not s.impulses:
        text = "nothing switches by itself: no events to locate, no step is taken again"
        yield Part("events", False, text)


def _implicit(s: Acting) -> Iterator[Part]:
    cost, unit = 2 * s.nv, "evaluations a Jacobian"
    if s.method in METHODS and METHODS[s.method].jacobian:
        text = f"Jacobian of {s.method} by differences, {cost} evaluations, and its factors"
        yield Part("jacobian", True, text)
    elif s.stiff and s.method == AUTO:
        text = "springs, dampers or friction: the fastest rate is looked at, radau5 if it rules"
        yield Part("jacobian", True, text)
    elif s.stiff:
        text = f"{s.method} is explicit: no derivatives of forces, no equations to solve"
        yield Part("jacobian", False, text, cost, unit)
    else:
        text = "nothing stiff: no derivatives of forces, no equations to solve"
        yield Part("jacobian", False, text, cost, unit)


def _recording(s: Acting) -> Iterator[Part]:
    text = "poses and accelerations of bodies and forces in joints: made when they are asked for"
    count = KEPT_A_BODY * len(s.bodies)
    yield Part("recording", False, text, count, "numbers a recorded frame")


MAKERS = (_tree, _loops, _forces, _touching, _implicit, _recording)
