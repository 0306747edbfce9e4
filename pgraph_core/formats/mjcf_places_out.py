"""Joints, sites and tendons in an MJCF file that is written, by their names."""

from __future__ import annotations

from typing import Any

from ..dynamics import Dynamics
from ..joints import KINDS, SIZE
from ..model import Model, Spring
from ..tolerances import SOLVED
from .conversion import NO_LIMIT
from .mjcf_contacts_out import ContactsOut
from .urdf_out import Tag

NOTHING = (1.0, 0.0, 0.0, 0.0)


class Places(ContactsOut):
    """The places that forces, constraints and outputs of a model refer to."""

    def __init__(self, model: Model, name: str):
        super().__init__(model, name)
        dynamics = Dynamics(model)
        packed = dynamics.packed
        self.home = packed.home_poses
        self.number = {name: k for k, name in enumerate(dynamics.names)}
        springs = tuple(f for f in model.forces if isinstance(f, Spring))
        rests = packed.loads(springs).spring[0]["rest"].tolist()
        self.rests = dict(zip((f.name for f in springs), rests))
        self.sites: dict[str, list[Tag]] = {}
        self.taken: set[tuple[str, str]] = set()
        self.joints = {
            (b.name, k): self._free("joint", b.name if len(b.motions) == 1 else f"{b.name} {k + 1}")
            for b in model.bodies for k in range(len(b.motions))
        }  # fmt: skip
        self.tendons = list[Tag]()

    def _free(self, kind: str, name: str) -> str:
        """Return the name, made unique among the elements of this kind."""
        while (kind, name) in self.taken:
            name += "'"
        self.taken.add((kind, name))
        return name

    def _site(self, body: str, name: str, place: Any, turn: Any = NOTHING) -> str:
        name = self._free("site", name)
        self.sites.setdefault(body, []).append(
            Tag("site", name=name, pos=tuple(place), quat=tuple(turn))
        )
        return name

    def _joint(self, body: str, coordinate: int) -> str:
        """Return the name of the hinge or slide for a degree of freedom, or "" for a ball."""
        first = 0
        for k, (kind, _) in enumerate(self.model.body(body).motions):
            if KINDS[kind].single and coordinate == first:
                return self.joints[body, k]
            first += SIZE[kind][1]
        return ""

    def _along(self, name: str, part: Any, where: str, **fields: Any) -> str:
        """Return the name of a tendon along a part's joints, or "" if one of them is a ball."""
        name = self._free("tendon", name)
        tag = Tag("fixed", name=name, **fields)
        for body, k, factor in part.terms:
            joint = self._joint(body, k)
            if not joint:
                self.out(where, "a sum with coordinates of a ball or free joint")
                return ""
            tag.add(Tag("joint", joint=joint, coef=factor))
        self.tendons.append(tag)
        return name


def span(low: float | None, high: float | None) -> tuple[float, float]:
    """Return a range that MuJoCo accepts, with finite and distinct ends."""
    least = -NO_LIMIT if low is None else max(low, -NO_LIMIT)
    most = NO_LIMIT if high is None else min(high, NO_LIMIT)
    apart = SOLVED * max(1.0, abs(least))
    return (least, most) if most - least > apart else (least - apart, most + apart)
