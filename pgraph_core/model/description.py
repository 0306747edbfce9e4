"""Access to bodies, constraints, contacts and forces of a model by name."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, Self, overload

from pydantic import ValidationError

from ..errors import ModelError, Problem, choices, counted, explained, nearest_first, shown
from ..fields import AtPoint, Vec3, field, listed, parts_of
from ..forces import Cable, Force
from ..functions import Curve
from ..sentences import in_our_words
from ..stateful import Own, Stateful
from . import files
from .beam import Beam
from .body import Body
from .cam import Cam
from .checks import PARTS, model_problems
from .constraint import Constraint, Rolling
from .contact import Contact
from .control import Control
from .curve_point import CurvePoint
from .doubts import doubts, floppy
from .editing import followed_tips
from .given import by_class, grounded, made_of, problems
from .joint_constraint import Relation
from .output import Output, Site
from .parameters import Formula, inlined, resolved, still_true
from .rope import Rope
from .scenario import Scenario
from .segments import (
    Counts,
    axis_points,
    counts_of,
    expanded,
    places_of,
    rigid,
    segment,
    stand_in,
)
from .world import World

Part = Body | Beam | Constraint | Contact | Force | Scenario | Site | Output | Control
TOLD = "edits told"  # among the attributes of a model
LOST = "lost in reading"  # likewise
SEGMENTS = "segments of beams"  # likewise
DESCRIBED = (
    "described with beams"  # likewise: the model with beams of which this one has the segments
)
PARTS_OF = {"body": "bodies", **{kind.word(): key for key, kind in PARTS.items() if kind != Body}}


@explained
class Description(World):
    """All parts of a model in the order of their lists."""

    bodies: tuple[Body, ...] = field("a list of bodies", converter=parts_of(Body), default=())
    beams: tuple[Beam, ...] = field("a list of beams", converter=parts_of(Beam), default=())
    constraints: tuple[Constraint, ...] = field(
        "a list of constraints", converter=parts_of(Constraint), default=()
    )
    contacts: tuple[Contact, ...] = field(
        "a list of contacts", converter=parts_of(Contact), default=()
    )
    forces: tuple[Force, ...] = field("a list of forces", converter=parts_of(Force), default=())
    scenarios: tuple[Scenario, ...] = field(
        "a list of scenarios", converter=parts_of(Scenario), default=()
    )
    sites: tuple[Site, ...] = field("a list of sites", converter=parts_of(Site), default=())
    outputs: tuple[Output, ...] = field("a list of outputs", converter=parts_of(Output), default=())
    controls: tuple[Control, ...] = field(
        "a list of controls", converter=parts_of(Control), default=()
    )
    formulas: tuple[Formula, ...] = field(
        "formulas of cells", converter=parts_of(Formula), default=()
    )

    if not TYPE_CHECKING:

        def __init__(self, /, **data: Any):
            """Validate a model. Raises ModelError with all problems."""
            data = resolved({key: listed(value) for key, value in data.items()})
            try:
                super(World, self).__init__(**data)
            except (ValidationError, ModelError):
                if ours := by_class(data):
                    self.__init__(**ours)
                    return
                if ours := in_our_words(type(self), data):
                    self.__init__(**ours)
                    return
                found = problems(data, type(self).model_fields)
                if not found and (made := made_of(data)):  # a part in words of other programs
                    self.__init__(**{**data, **made})
                    return
                raise ModelError(found) from None
            if found := model_problems(self._parts(), self.ground, self.parameters):
                if not (ours := grounded(self._parts())):
                    raise ModelError(found)
                self.__init__(**{**data, **ours})

    def __repr__(self) -> str:
        counts = [len(getattr(self, key)) for key in PARTS]
        words = [
            f"{n} {key if n != 1 else word}" for n, (word, key) in zip(counts, PARTS_OF.items())
        ]
        named = [words[0], *(text for n, text in zip(counts[1:], words[1:]) if n)]
        told = f"\n  {counted(len(self.notices), 'notice')}, the first: " if self.notices else ""
        told += "".join(self.notices[:1])
        return f"<Model {shown(self.name)}: {', '.join(named)}; up {self.up}{told}>"

    __str__ = __repr__

    @cached_property
    def row(self) -> Mapping[str, int]:
        """The table row, from 0, for each body name."""
        return {body.name: i for i, body in enumerate(self.bodies)}

    @cached_property
    def _named(self) -> dict[str, dict[str, Part]]:
        """The parts of each kind by name."""
        parts = {word: getattr(self, key) for word, key in PARTS_OF.items()}
        return {word: {part.name: part for part in some} for word, some in parts.items()}

    @cached_property
    def standing(self) -> tuple[Body, ...]:
        """The bodies, and one without mass for each place of a beam that parts name."""
        return (*self.bodies, *rigid(self._parts())) if self.beams else self.bodies

    @cached_property
    def stiffened(self) -> Self:
        """The model in which its `standing` bodies take the place of beams."""
        if not self.beams:
            return self
        return self.unchecked_copy({"bodies": self.standing, "beams": ()})

    @cached_property
    def rows(self) -> tuple[Body, ...]:
        """The rows of the digraph: the bodies, and one without mass for each beam."""
        if not self.beams:
            return self.bodies
        of = self.beam_of
        return tuple(
            b.unchecked_copy({"parent": of[b.parent]}) if b.parent in of else b
            for b in self.standing
            if of.get(b.name, b.name) == b.name
        )

    @cached_property
    def beam_of(self) -> Mapping[str, str]:
        """The beam of each place that parts name, and of the segments of an expanded model."""
        beams = {beam.name: beam for beam in self.described.beams}
        if not beams:
            return {}
        model = self.described
        places = places_of(beams, model.row, model._parts())
        cells = {name: sum(counts) for name, counts in self.segments.items()}
        own = {segment(name, k): name for name, n in cells.items() for k in range(n + 1)}
        return own | {name: of for name, (of, _) in places.items()}

    @property
    def described(self) -> Self:
        """The model with its beams, if this one has their segments, or else the model itself."""
        return vars(self).get(DESCRIBED, self)

    @property
    def segments(self) -> Counts:
        """The number of segments in each span of the beams of an expanded model."""
        return vars(self).get(SEGMENTS, {})

    @cached_property
    def axis_points(self) -> Mapping[str, list[tuple[str, Any]]]:
        """The ends of the cells of the beams of an expanded model, as points of segments."""
        return axis_points(self.described._parts(), self.segments)

    @cached_property
    def expanded(self) -> Self:
        """The model in which the segments of beams, and the places on them, are bodies."""
        return self.with_segments(counts_of(self._parts())) if self.beams else self

    @property
    def of_bodies(self) -> Self:
        """The model with the segments of its beams as common bodies, which its notices tell."""
        if not self.beams:
            return self
        return self.expanded._made(
            f"beam '{name}' became its {sum(counts)} segments, {name}[0] to {name}[{sum(counts)}]"
            for name, counts in self.expanded.segments.items()
        )

    def with_segments(self, counts: Counts) -> Self:
        """Return the expanded model with these numbers of segments between places, by beam."""
        found = self.unchecked_copy({"bodies": expanded(self._parts(), counts), "beams": ()})
        vars(found)[DESCRIBED], vars(found)[SEGMENTS] = self, counts
        vars(found)[LOST], vars(found)[TOLD] = self.lost, self.told
        return found

    @cached_property
    def limited(self) -> bool:
        """Return True if a joint, tendon or spring has limits."""
        bounded = (f._bounds for f in self.forces)
        return any(any(body.limits) for body in self.bodies) or any(bounded)

    @cached_property
    def linked(self) -> tuple[Body, ...]:
        """The free bodies with a link, to which q adds a place."""
        return tuple(body for body in self.bodies if body.floats and any(body.link))

    @cached_property
    def rated(self) -> tuple[Body, ...]:
        """The bodies with limits of speed."""
        return tuple(body for body in self.bodies if any(body.speed_limit))

    @cached_property
    def following(self) -> tuple[Body, ...]:
        """The bodies that follow a track with two ends."""
        return tuple(body for body in self.bodies if body.track and not body.track.closed)

    @cached_property
    def cabled(self) -> bool:
        """Return True if a cable or a rope leads over wheels or points."""
        return any(isinstance(x, Cable | Rope) for x in (*self.forces, *self.constraints))

    @cached_property
    def relating(self) -> tuple[Relation, ...]:
        """The relations by points whose curve begins and ends, and does not rest there."""
        return tuple(
            c
            for c in self.constraints
            if isinstance(c, Relation) and isinstance(c.curve, Curve) and c.curve.ends
        )

    @cached_property
    def riding(self) -> tuple[CurvePoint, ...]:
        """The constraints that keep a point on a curve."""
        return tuple(c for c in self.constraints if isinstance(c, CurvePoint))

    @cached_property
    def bending(self) -> tuple[Relation, ...]:
        """The relations whose second derivative jumps somewhere."""
        return tuple(c for c in self.constraints if isinstance(c, Relation) and c.has_corners)

    @cached_property
    def cornered(self) -> tuple[Body, ...]:
        """The bodies on a track whose second derivative jumps somewhere."""
        return tuple(body for body in self.bodies if body.track and body.track.corners)

    @cached_property
    def cams(self) -> tuple[Cam, ...]:
        """The cams among the constraints."""
        return tuple(c for c in self.constraints if isinstance(c, Cam))

    @cached_property
    def rubbing(self) -> tuple[Contact, ...]:
        """The contacts with an expression as friction."""
        return tuple(c for c in self.contacts if c._varies)

    @cached_property
    def stateful(self) -> tuple[Stateful, ...]:
        """The parts with states that runs integrate: controls, then muscles."""
        return (*self.controls, *(f for f in self.forces if isinstance(f, Stateful)))

    @cached_property
    def states(self) -> tuple[tuple[Stateful, int, Own], ...]:
        """(Part, number, state) of every state of controls and muscles, in the order of v."""
        return tuple((c, k, own) for c in self.stateful for k, own in enumerate(c.own))

    @cached_property
    def notices(self) -> tuple[str, ...]:
        """Notices of additional changes from the last edit or from reading a file.

        A run repeats the notices of all edits since the model was made or read.
        """
        return ()

    @property
    def told(self) -> tuple[str, ...]:
        """The notices from all edits since the model was created or read."""
        return vars(self).get(TOLD, ())

    @property
    def lost(self) -> tuple[str, ...]:
        """Messages about parts of the file that affect results and that the model lacks or
        approximates.

        The list is empty for files in the format of Pgraph. Edits keep it, and every run repeats it
        as notices.
        """
        return vars(self).get(LOST, ())

    @cached_property
    def doubts(self) -> tuple[str, ...]:
        """Warnings about implausible values and parts without effect, repeated by each run."""
        if self.described is not self:
            return self.described.doubts
        return (*doubts(self.stiffened), *floppy(self.beams))

    def body(self, name: str) -> Body:
        """Return the body with a name.

        For a beam, or a place along it such as "rod@0.5", this is a body without mass there, with
        the axes of the beam.

        Parameters
        ----------
        name : str
            Name of the body.

        Raises
        ------
        ModelError
            If no body has this name. The message lists the existing names.
        """
        if name in self.row:
            return self.bodies[self.row[name]]
        if (body := stand_in(name, {beam.name: beam for beam in self.beams})) is not None:
            return body
        names = choices(body.name for body in self.rows)
        text = f"no body has this name; choose one of {names}"
        raise ModelError(Problem(f"body {shown(name)}", "", text))

    def __contains__(self, name: Any) -> bool:
        """Check whether the model has a part `name`."""
        return any(part.name == name for key in PARTS for part in getattr(self, key))

    def __getitem__(self, name: str, /) -> Part:
        """Return the part with this name, like `part(name)`."""
        return self.part(name)

    @overload
    def part(self, name: str, /, kind: Literal["body"]) -> Body: ...
    @overload
    def part(self, name: str, /, kind: Literal["beam"]) -> Beam: ...
    @overload
    def part(self, name: str, /, kind: Literal["constraint"]) -> Constraint: ...
    @overload
    def part(self, name: str, /, kind: Literal["contact"]) -> Contact: ...
    @overload
    def part(self, name: str, /, kind: Literal["force"]) -> Force: ...
    @overload
    def part(self, name: str, /, kind: Literal["scenario"]) -> Scenario: ...
    @overload
    def part(self, name: str, /, kind: Literal["site"]) -> Site: ...
    @overload
    def part(self, name: str, /, kind: Literal["output"]) -> Output: ...
    @overload
    def part(self, name: str, /, kind: Literal["control"]) -> Control: ...
    @overload
    def part(self, name: str, /, kind: str | None = None) -> Part: ...
    def part(self, name: str, /, kind: str | None = None) -> Part:
        """Return the part with a name.

        Parameters
        ----------
        name : str
            Name of a body or of any other part. A body has priority.
        kind : str, optional
            "body", "beam", "constraint", "contact", "force", "scenario", "site", "output" or
            "control", to choose among several parts with this name.

        Raises
        ------
        ModelError
            If there is none, or if several parts have this name and `kind` is not given.
        """
        if kind is not None and kind not in PARTS_OF:
            text = f"must be one of {', '.join(PARTS_OF)}, got {shown(kind)}"
            raise ModelError(Problem(f"part {shown(name)}", "kind", text))
        words = PARTS_OF if kind is None else (kind,)
        found = {word: self._named[word][name] for word in words if name in self._named[word]}
        if "body" in found:
            return found["body"]
        if len(found) == 1:
            return next(iter(found.values()))
        if found:
            kinds = [f'kind="{word}"' for word in found]
            text = f"a {' and a '.join(found)} have this name; give {' or '.join(kinds)}"
            raise ModelError(Problem(f"part {shown(name)}", "", text))
        keys = PARTS if kind is None else (PARTS_OF[kind],)
        known = [part.name for key in keys for part in getattr(self, key)]
        word = kind or ("part" if len(known) > len(self.bodies) else "body")
        do = f"choose one of {choices(nearest_first(name, known))}" if known else "there is none"
        raise ModelError(Problem(f"{word} {shown(name)}", "", f"no {word} has this name; {do}"))

    def scenario(self, name: str) -> Scenario:
        """Return the scenario with a name.

        Parameters
        ----------
        name : str
            Name of the scenario.

        Raises
        ------
        ModelError
            If no scenario has this name. The message lists the existing names.
        """
        found = next((s for s in self.scenarios if s.name == name), None)
        if isinstance(name, Scenario):
            text = "must be the name of a scenario of the model: model.add(scenario), and then "
            text += f"scenario={shown(name.name)}"
            raise ModelError(Problem("scenario", "", text))
        if found is None:
            known = choices(s.name for s in self.scenarios)
            do = f"choose one of {known}" if known else "the model has no scenario"
            raise ModelError(Problem(f"scenario {shown(name)}", "", f"is not there; {do}"))
        return found

    def point_of(self, constraint: Constraint) -> Vec3:
        """Return the `point` of a constraint in the axes of its body [m].

        The default is the body's tip, and the middle of its shape for rolling.
        """
        body = self.body(constraint.body)
        if isinstance(constraint, AtPoint) and constraint.point is not None:
            return constraint.point
        if isinstance(constraint, Rolling) and body.shape is not None:
            return body.shape.position
        return body.tip_point

    @cached_property
    def hash(self) -> str:
        """The SHA-256 hash of the description. Equal hashes mean equal physics."""
        return hashlib.sha256(self.to_json().encode()).hexdigest()

    def to_json(self) -> str:
        """Return the description as JSON text, one body per line."""
        return files.to_json(self.model_dump(mode="json", exclude_none=True), self.formulas)

    def cells(
        self, part: Body | Beam | Constraint | Contact | Force | Control, kind: str = "bodies", /
    ) -> dict[str, Any]:
        """Return the fields of a part as in a file, including formulas."""
        mine = (f for f in self.formulas if (f.part, f.name) == (kind, part.name))
        return inlined(part, mine)

    def _with(self, notices: Iterable[str], **fields: Any) -> Self:
        """Return a copy with validated parts replaced, checking only relations between parts."""
        model = self._made(notices, **fields)
        if found := model_problems(model._parts(), model.ground, model.parameters):
            if not (ours := grounded(model._parts())):
                raise ModelError(found)
            turned = {kind: tuple(parts) for kind, parts in ours.items()}
            return self._with(notices, **{**fields, **turned})
        return model

    def _made(self, notices: Iterable[str], **fields: Any) -> Self:
        """Return a copy with parts replaced, without checks."""
        if formulas := fields.get("formulas", self.formulas):
            now = {**self._others(), "bodies": self.bodies, **fields}
            fields = {**fields, "formulas": still_true(formulas, now, self.parameters)}
        model = self.unchecked_copy(fields)
        said = tuple(notices)
        vars(model)["notices"] = said  # not a field: equality ignores it
        vars(model)[LOST] = self.lost
        if told := dict.fromkeys((*self.told, *said)):
            moot = followed_tips(model.bodies, model.row)
            vars(model)[TOLD] = tuple(text for text in told if text not in moot)
        return model

    def _parts(self) -> dict[str, Any]:
        """Return all parts, grouped by field."""
        return {key: getattr(self, key) for key in PARTS}

    def _others(self) -> dict[str, Any]:
        """Return the parts other than bodies, grouped by field."""
        return {key: getattr(self, key) for key in PARTS if key != "bodies"}
