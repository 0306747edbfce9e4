"""What an edit does to the parts of a model: new parts from old ones, never changed in place."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

from ..errors import ModelError, Problem
from ..rotation import multiply, rotate
from .body import Body
from .checks import force_problems, state_problems
from .constraint import Constraint
from .fields import Described, fields_of
from .force import Force
from .scenario import Scenario
from .sentences import nearest

T = TypeVar("T", bound=Described)

JOINT_FIELDS = (
    *("axes", "motions", "q", "v"),
    *("stiffness", "damping", "rest", "friction", "armature"),
)


def edited(old: Body, changes: Mapping[str, Any]) -> tuple[Body, list[str]]:
    """The body with changed fields, and what changed besides. Raises ModelError."""
    for key in changes:
        if key not in Body.model_fields and key != "dof":
            known = (*Body.model_fields, "dof")
            raise ModelError(
                Problem(f"body '{old.name}'", key, f"no such field; {nearest(key, known)}")
            )
    changes = {
        key: value
        for key, value in changes.items()
        if value is not None or key not in ("joint", "dof")  # none: as it is
    }
    data = fields_of(old)
    kind, dof = changes.get("joint", old.joint), changes.get("dof", old.dof)
    new_joint = kind != old.joint or dof != old.dof
    if new_joint:
        data = {key: value for key, value in data.items() if key not in (*JOINT_FIELDS, "joint")}
    elif "dof" in changes:
        changes = {key: value for key, value in changes.items() if key != "dof"}
    if "motions" in changes:
        data.pop("axes", None)
    new = _refused_as(old.name, {**data, **changes})
    if not new_joint:
        return new, []
    lost = [key for key in JOINT_FIELDS if key not in changes and _set(old, key)]
    text = f"body '{new.name}': the joint is now {new.joint} ({new.dof} DoF)"
    return new, [text + (f"; reset: {', '.join(lost)}" if lost else "")]


def _refused_as(name: str, data: dict[str, Any]) -> Body:
    """Validated; a refusal names the body as it is called now, not by the refused name."""
    try:
        return Body(**data)
    except ModelError as error:
        where = f"body '{name}'"
        raise ModelError(Problem(where, p.field, p.text) for p in error.problems) from None


def _set(body: Body, field: str) -> bool:
    """Whether a joint's field differs from what a fresh joint of its kind has."""
    return getattr(body, field) != getattr(Body(name="fresh", joint=body.joint), field)


def renamed(part: T, old: str, new: str, fields: tuple[str, ...]) -> T:
    """The part with a body's new name in the fields that hold names of bodies."""
    update = {field: new for field in fields if getattr(part, field) == old}
    return part.model_copy(update=update) if update else part


def renamed_all(parts: Mapping[str, Sequence[Any]], old: str, new: str) -> dict[str, Any]:
    """All parts of a model with a body's new name in place of the old."""

    def scenario(s: Scenario) -> Scenario:
        state = {
            key: {new if k == old else k: value for k, value in getattr(s, key).items()}
            for key in ("q", "v")
        }
        forces = tuple(renamed(f, old, new, ("body",)) for f in s.forces)
        return s.model_copy(update={**state, "forces": forces})

    return {
        "bodies": tuple(renamed(b, old, new, ("parent",)) for b in parts["bodies"]),
        "constraints": tuple(renamed(c, old, new, ("body", "other")) for c in parts["constraints"]),
        "forces": tuple(renamed(f, old, new, ("body",)) for f in parts["forces"]),
        "scenarios": tuple(map(scenario, parts["scenarios"])),
    }


def fitted(
    body: Body, name: str, forces: Sequence[Force], scenarios: Sequence[Scenario]
) -> tuple[dict[str, Any], list[str]]:
    """What still fits a body's new joint, and a notice for each that goes; `name`: as it was."""

    def fits(f: Force) -> bool:
        return f.body != name or not force_problems([f], {name: body})

    def cut(s: Scenario) -> Scenario:
        states = {
            key: {
                k: x
                for k, x in getattr(s, key).items()
                if k != name or not state_problems(key, k, x, {name: body})
            }
            for key in ("q", "v")
        }
        return s.model_copy(update={**states, "forces": tuple(filter(fits, s.forces))})

    cuts = tuple(map(cut, scenarios))
    notices = [f"force '{f.name}' went: it does not fit the joint" for f in forces if not fits(f)]
    notices += [
        f"scenario '{s.name}': what does not fit the joint of '{name}' went"
        for s, new in zip(scenarios, cuts)
        if s != new
    ]
    return {"forces": tuple(filter(fits, forces)), "scenarios": cuts}, notices


def attached(body: Body, gone: Body) -> Body:
    """A child of `gone` as a child of its parent, at the same place at q = 0."""
    if body.parent != gone.name:
        return body
    ahead = rotate(gone.rotation, body.link)
    return body.model_copy(
        update={
            "parent": gone.parent,
            "link": tuple(a + b for a, b in zip(gone.link, ahead)),
            "rotation": multiply(gone.rotation, body.rotation),
        }
    )


def without(
    constraints: Sequence[Constraint],
    forces: Sequence[Force],
    scenarios: Sequence[Scenario],
    names: set[str],
) -> tuple[dict[str, Any], list[str]]:
    """What is left of them without the bodies called `names`, and a notice for each that goes."""
    dropped = {c.name for c in constraints if {c.body, c.other} & names}
    notices = [
        f"constraint '{c.name}' went with its body" for c in constraints if c.name in dropped
    ]
    notices += [f"force '{f.name}' went with its body" for f in forces if f.body in names]

    def cut(s: Scenario) -> Scenario:
        active = s.constraints and tuple(c for c in s.constraints if c not in dropped)
        return s.model_copy(
            update={
                "q": {k: value for k, value in s.q.items() if k not in names},
                "v": {k: value for k, value in s.v.items() if k not in names},
                "forces": tuple(f for f in s.forces if f.body not in names),
                "constraints": active,
            }
        )

    kept = {
        "constraints": tuple(c for c in constraints if c.name not in dropped),
        "forces": tuple(f for f in forces if f.body not in names),
        "scenarios": tuple(map(cut, scenarios)),
    }
    return kept, notices
