"""The complete description of a model, and the edits that derive a new model from it."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self, overload

from pydantic import ValidationError

from ..errors import (
    FileError,
    InputError,
    ModelError,
    Problem,
    choices,
    explained,
    nearest_first,
    shown,
)
from ..fields import GROUND, Vec3, field, fields_of, listed, parts_of, whole
from ..forces import Force, ends_of
from ..sentences import in_our_words
from . import files
from .body import Body
from .checks import PARTS, model_problems, problems
from .columns import bodies_of
from .constraint import AtPoints, Constraint, Rolling, Skate
from .contact import Contact
from .control import Control
from .copies import Mirror, branch, copied, names_of_copies, other_side
from .doubts import doubts
from .editing import (
    attached,
    cut_joint,
    edited,
    edited_all,
    edited_part,
    fitted,
    followed_tips,
    in_expressions,
    left_behind,
    renamed,
    renamed_all,
    renamed_in_scenarios,
    without,
)
from .expressions import SIGNALS_OF
from .files import gathered, located
from .output import Output, Site
from .parameters import Formula, cells_of, followed, formulas_in, inlined, resolved, still_true
from .poses import home_poses, poses
from .scenario import Scenario
from .world import DOWN, World

# fields of a body that nothing else in a model depends on, but for the tree
OF_ONE_ROW = {"parent", "mass", "com", "inertia", "link", "rotation", "tip", "armature", "damping"}


Part = Body | Constraint | Contact | Force | Scenario | Site | Output | Control
TOLD = "edits told"  # among the attributes of a model
LOST = "lost in reading"  # likewise
PARTS_OF = {"body": "bodies", **{kind.word(): key for key, kind in PARTS.items() if kind != Body}}


@explained
class Model(World):
    """A multibody system, consisting of the table rows in order and the parts that act on them.

    Bodies are in the order of the table, which is also the order of left children. Every change
    makes a new, validated model; the old one stays as it was.
    """

    bodies: tuple[Body, ...] = field("a list of bodies", converter=parts_of(Body), default=())
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
                if ours := in_our_words(type(self), data):
                    self.__init__(**ours)
                    return
                raise ModelError(problems(data, type(self).model_fields)) from None
            if found := model_problems(self._parts(), self.ground, self.parameters):
                raise ModelError(found)

    def __repr__(self) -> str:
        counts = [len(getattr(self, key)) for key in PARTS]
        words = [
            f"{n} {key if n != 1 else word}" for n, (word, key) in zip(counts, PARTS_OF.items())
        ]
        named = [words[0], *(text for n, text in zip(counts[1:], words[1:]) if n)]
        return f"<Model {shown(self.name)}: {', '.join(named)}; up {self.up}>"

    __str__ = __repr__

    def _repr_html_(self) -> str:
        """Return the digraph and the table of bodies as HTML, for notebooks."""
        from ..show import model_html

        return model_html(self)

    def to_image(
        self, path: str | Path, /, *, what: Literal["view", "digraph"] = "view",
        size: tuple[int, int] | None = None, view: str = "start", dark: bool = False,
    ) -> None:  # fmt: skip
        """Draw the mechanism in its initial state, or its digraph. No screen is required.

        Parameters
        ----------
        path : str or path
            The file to write: .png, or .svg of the digraph.
        what : {"view", "digraph"}
            What to draw.
        size : (int, int), optional
            Width and height in pixels.
        view : {"start", "front", "side", "top", "isometric"}
            Direction of the view.
        dark : bool
            Whether to draw on a dark background.

        Raises
        ------
        InputError, FileError
            If arguments do not fit, or the file cannot be written.
        """
        from ..show import pictures  # with its kernels, which a description has no need of
        from ..show.notebook import numbered

        if what not in ("view", "digraph"):
            text = f"must be 'view' or 'digraph'; given {what!r}"
            raise InputError(Problem("to_image", "what", text))
        if what == "digraph":
            drawn = pictures.digraph(self, path, size=size)
        else:
            pose, size = home_poses(numbered(self)[0]), (1280, 720) if size is None else size
            drawn = pictures.view(self, pose, path, size=size, view=view, dark=dark)
        files.write_atomic(path, drawn)

    # -- reading -----------------------------------------------------------------------------

    @cached_property
    def row(self) -> Mapping[str, int]:
        """The table row, from 0, for each body name."""
        return {body.name: i for i, body in enumerate(self.bodies)}

    @cached_property
    def limited(self) -> bool:
        """Return True if a joint, tendon or spring has limits."""
        return any(any(body.limits) for body in self.bodies) or any(
            end is not None for f in self.forces for end in ends_of(f)
        )

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
        """Messages about parts of the file that affect the motion and are missing from the model.

        It is empty for files of Pgraph. Edits keep it, and every run repeats it as notices.
        """
        return vars(self).get(LOST, ())

    @cached_property
    def doubts(self) -> tuple[str, ...]:
        """Warnings about implausible values and parts without effect, repeated by each run."""
        return tuple(doubts(self))

    def body(self, name: str) -> Body:
        """Return the body with a name.

        Parameters
        ----------
        name : str
            Name of the body.

        Raises
        ------
        ModelError
            If no body has this name. The message lists the existing names.
        """
        if name not in self.row:
            text = f"no body has this name; choose one of {choices(self.row)}"
            raise ModelError(Problem(f"body {shown(name)}", "", text))
        return self.bodies[self.row[name]]

    def __contains__(self, name: Any) -> bool:
        """Return True if the model has a part `name`."""
        return any(part.name == name for key in PARTS for part in getattr(self, key))

    def __getitem__(self, name: str, /) -> Part:
        """Return the part called `name`, like `part(name)`."""
        return self.part(name)

    @overload
    def part(self, name: str, /, kind: Literal["body"]) -> Body: ...
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
            "body", "constraint", "contact", "force", "scenario", "site", "output" or "control",
            to choose among several parts with this name.

        Raises
        ------
        ModelError
            If there is none, or if several parts have this name and `kind` is not given.
        """
        if kind is not None and kind not in PARTS_OF:
            text = f"must be one of {', '.join(PARTS_OF)}; given {shown(kind)}"
            raise ModelError(Problem(f"part {shown(name)}", "kind", text))
        found: dict[str, Part] = {}
        for word in PARTS_OF if kind is None else (kind,):
            for part in getattr(self, PARTS_OF[word]):
                if part.name == name:
                    found[word] = part
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
        if isinstance(constraint, (AtPoints, Skate)) and constraint.point is not None:
            return constraint.point
        if isinstance(constraint, Rolling) and body.shape is not None:
            return body.shape.position
        return body.tip_point

    @cached_property
    def hash(self) -> str:
        """The SHA-256 hash of the description. Equal hashes mean equal physics."""
        return hashlib.sha256(self.to_json().encode()).hexdigest()

    # -- making and editing ------------------------------------------------------------------

    @classmethod
    def serial(cls, n: int) -> Self:
        """Return n rods in series, named "1" to "n", as in the first table of section 4.1.

        The rods are slender and 0.2 m long. They are aligned with x and connected by hinges about
        y, so they swing.

        Parameters
        ----------
        n : int
            Number of bodies.

        Examples
        --------
        >>> [body.parent for body in pg.Model.serial(3).bodies]
        ['ground', '1', '2']
        """
        count = whole(n)
        if count is None or count < 1:
            raise ModelError(Problem("model", "n", f"must be a whole number >= 1; given {n!r}"))
        inertia = ((2e-4, 0.0, 0.0), (0.0, 3.4e-3, 0.0), (0.0, 0.0, 3.4e-3))
        rod = Body(name="1", axes=((0, 1, 0),), com=(0.1, 0, 0), inertia=inertia, tip=(0.2, 0, 0))
        rows = [rod.unchecked_copy({"name": "1"})]
        linked = Body(**{**fields_of(rod), "link": rod.tip})
        for i in range(2, count + 1):
            rows.append(linked.unchecked_copy({"name": str(i), "parent": str(i - 1)}))
        return cls(name=f"serial {count}", bodies=tuple(rows))

    @classmethod
    def from_columns(
        cls,
        parent: Any,
        /,
        *,
        names: Iterable[str] | None = None,
        gravity: Any = None,
        **columns: Any,
    ) -> Self:
        """Return a model from a table of nb bodies given as NumPy columns.

        Parameters
        ----------
        parent : (nb,) array of int
            Row of each body's parent, from 1, with 0 for the ground.
        names : sequence of str, optional
            Names of the bodies, by default "1", "2", ...
        gravity : (3,) array, optional
            Gravity [m/s^2].
        **columns
            Fields of `Body`, such as `joint`, `link`, `mass` and `inertia`: nb entries, or one for
            all bodies.

        Raises
        ------
        ModelError
            If an entry does not fit. The message names the body and the column.
        """
        given = {} if gravity is None else {"gravity": gravity}
        return cls(name="columns", bodies=bodies_of(parent, names, columns), **given)

    def edit(self, name: str, /, **changes: Any) -> Self:
        """Return a new model in which fields of one part are changed.

        References follow a new name. A body's new `joint`, `dof` or other kinds of `motions` reset
        the joint's q, v and springs, and its axes unless the new joint has as many. Forces and
        initial values that do not fit are removed and listed in `notices`. This model stays
        unchanged.

        Parameters
        ----------
        name : str
            Name of a body or of another part. A body has priority, and `kind="contact"` or the like
            chooses one of several other parts.
        **changes
            New values by name of field. `parent` may be several names: the first is the parent in
            the tree, and the others close loops, cut at joints like the body's own.

        Raises
        ------
        ModelError
            If the part or a field does not exist, or a value is not permitted.

        Examples
        --------
        >>> heavier = pg.Model.serial(2).edit("2", mass=3.0)
        >>> heavier.body("2").mass
        3.0
        """
        which = changes.get("kind")
        if which in PARTS_OF:
            changes = {key: value for key, value in changes.items() if key != "kind"}
            part = self.part(name, which)
        else:
            part = self.part(name)
        if not isinstance(part, Body):
            return self._edit_part(part, changes)
        twins = [] if which in PARTS_OF else self._twins(name, changes.keys() - {"name"})
        if twins and (lacking := changes.keys() - Body.model_fields.keys() - {"dof"}):
            text = f"a body has no such field, but a {twins[0]} of this name has"
            field = next(iter(lacking))
            raise ModelError(
                Problem(f"body {shown(name)}", field, f'{text}; give kind="{twins[0]}"')
            )
        model = self._edit_body(name, changes)
        if not twins or model is self:
            return model
        text = f"body '{name}': its {', '.join(changes)} changed; a {twins[0]} of this name has "
        return model._made((*model.notices, f'{text}that too: give kind="{twins[0]}" to mean it'))

    def _twins(self, name: str, fields: Iterable[str]) -> list[str]:
        """Return the kinds of other parts that share a body's name and have these fields."""
        wanted = set(fields)
        found = [part for key in self._others() for part in getattr(self, key) if part.name == name]
        return [
            part.word() for part in found if wanted and wanted <= type(part).model_fields.keys()
        ]

    def _edit_part(self, old: Part, changes: Mapping[str, Any]) -> Self:
        """Return the model with an edited constraint, contact, force or scenario."""
        key, name = PARTS_OF[old.word()], old.name
        formulas: tuple[Formula, ...] = self.formulas
        if key not in ("scenarios", "sites", "outputs"):
            numbers, new_ones = cells_of({name: changes}, self.parameters, key)  # type: ignore[arg-type]
            changes, formulas = numbers[name], followed(formulas, new_ones, {}, key)  # type: ignore[arg-type]
        new, notices = edited_part(old, changes)
        if new == old and formulas == self.formulas:
            return self
        fields: dict[str, Any] = {
            key: tuple(new if part is old else part for part in getattr(self, key))
        }
        if new.name != name:
            names = {name: new.name}
            if key in ("constraints", "contacts"):
                fields["scenarios"], _ = renamed_in_scenarios(self.scenarios, key, names)
            if key == "sites":
                fields["outputs"] = tuple(renamed(o, names) for o in self.outputs)
            groups = SIGNALS_OF.get(key, ())
            if groups:
                fields |= in_expressions({**self._others(), **fields}, names, *groups)
            formulas = followed(formulas, (), names, key)  # type: ignore[arg-type]
        return self._with(notices, formulas=formulas, **fields)

    def _edit_body(self, name: str, changes: Mapping[str, Any]) -> Self:
        if any(formulas_in(changes, (), self.parameters)):
            return self._with_formulas(name, changes)
        old = self.body(name)
        if "length" in changes:
            hung = " and ".join(f"'{b.name}'" for b in self.bodies if b.parent == name)
            text = "no such field; the length of a link is `link` of what hangs on it"
            text += f" ({hung})" if hung else ""
            text += ", and its own com, inertia, tip and shape"
            raise ModelError(Problem(f"body '{name}'", "length", text))
        if isinstance(parents := listed(changes.get("parent")), tuple):
            return self._with_parents(name, parents, changes)
        new, notices = edited(old, changes)
        if new == old:
            return self
        bodies = [new if b is old else b for b in self.bodies]
        parts: dict[str, Any] = {"bodies": tuple(bodies)}
        behind = left_behind(old, new, self.bodies) if "tip" in changes else []
        if changes.keys() <= OF_ONE_ROW and self._carries(new):
            return self._made(behind, **parts)
        if notices:
            fitting, gone = fitted(new, old.name, self._others())
            parts, notices = {**parts, **fitting}, [*notices, *gone]
        if new.name != old.name:
            if new.name in self.row:
                text = f"'{new.name}' is already the name of row {self.row[new.name] + 1}"
                raise ModelError(Problem(f"body '{name}'", "name", f"{text}; choose another"))
            parts = renamed_all({**self._others(), **parts}, {old.name: new.name})
            parts["formulas"] = followed(self.formulas, (), {old.name: new.name})
        return self._with([*notices, *behind], **parts)

    def close_loop(
        self,
        body: str,
        parent: str,
        /,
        *,
        joint: str | None = None,
        name: str | None = None,
        point: Sequence[float] | None = None,
        other_point: Sequence[float] | None = None,
        axis: Sequence[float] | None = None,
        other_axis: Sequence[float] | None = None,
    ) -> Self:
        """Return a new model in which a second body carries `body`, closing a loop that is cut at
        that joint.

        The cut becomes a constraint of the joint's kind.

        Parameters
        ----------
        body, parent : str
            Names of the body and of its second parent.
        joint : str, optional
            Kind of the second joint, by default the kind of the body's joint.
        name : str, optional
            Name of the constraint.
        point, other_point : (3,) sequence, optional
            The place of the joint in the axes of the body, by default its tip, and in those of the
            parent, by default where that point is in the initial state [m].
        axis, other_axis : (3,) sequence, optional
            The axis of the joint in the axes of both bodies, by default the axis of the body's
            joint.

        Returns
        -------
        Model
            The model with the loop.

        Raises
        ------
        ModelError
            If the joint has no equivalent constraint.

        Examples
        --------
            loop = model.close_loop("coupler", "rocker")
        """
        if not isinstance(parent, str):
            text = f"must be the name of a body or 'ground'; given {shown(parent)}"
            raise ModelError(Problem(f"body {shown(body)}", "parent", text))
        given = {
            "joint": joint,
            "name": name,
            "point": point,
            "other_point": other_point,
            "axis": axis,
            "other_axis": other_axis,
        }
        cut = cut_joint(self.body(body), parent, [c.name for c in self.constraints], given)
        text = f"body '{body}': the loop through '{parent}' is cut at a {cut.kind} constraint, "
        model = self._with((), constraints=(*self.constraints, cut))
        if other_point is None and isinstance(cut, AtPoints):
            text += f"'{cut.name}', {model._where_cut(cut)}"
        else:
            text += f"'{cut.name}'"
        return model._made((*self.notices, text))

    def _where_cut(self, cut: AtPoints) -> str:
        """Return a message about where the loop closes in the initial state."""
        at = poses(self.bodies)
        place = at[cut.body].place(self.point_of(cut))
        other = at[cut.other]
        point = tuple((other.rotation.T @ (place - other.position)).round(12).tolist())
        near = shown(tuple(float(f"{x:.4g}") for x in point))
        text = f"at {near} of '{cut.other}', where its point is in the initial state"
        if cut.other == GROUND:
            return f"{text}; to close it elsewhere give other_point"
        tip = self.body(cut.other).tip_point
        away = math.dist(place, other.place(tip))
        if away < 1e-9:
            return f"{text}, the tip of '{cut.other}'"
        text += f", {away:.4g} m from the tip of '{cut.other}'; to close it there give "
        return f"{text}other_point={shown(tip)}"

    def _with_formulas(self, name: str, changes: Mapping[str, Any]) -> Self:
        """Return the model with a body in which formulas replace some numbers."""
        self.body(name)
        numbers, new = cells_of({name: changes}, self.parameters)
        model = self._edit_body(name, numbers[name])
        called = {name: changes.get("name", name)}
        formulas = followed(model.formulas, followed((), new, called), {})
        if model is self and formulas == self.formulas:
            return self
        return model._made(model.notices, formulas=formulas)

    def _with_parents(
        self, name: str, parents: tuple[Any, ...], changes: Mapping[str, Any]
    ) -> Self:
        """Return the model with a body that has several parents."""
        if not parents:
            raise ModelError(Problem(f"body '{name}'", "parent", "give at least one; given []"))
        model = self._edit_body(name, {**changes, "parent": parents[0]})
        model = model._with((), bodies=model.bodies) if model is self else model
        for parent in parents[1:]:
            model = model.close_loop(changes.get("name", name), parent)
        return model

    def add(self, part: Part, /, *, after: str | None = None) -> Self:
        """Return a new model with one additional part.

        Parameters
        ----------
        part : Body, Constraint, Contact, Force, Scenario, Site, Output or Control
            The part to add.
        after : str, optional
            Name of the part of the same kind that it follows. By default it becomes the last.

        Returns
        -------
        Model
            The model with the part.

        Raises
        ------
        ModelError
            If the part does not fit the model.
        """
        if not isinstance(part, Part):
            given = f"given {shown(part)} ({type(part).__name__})"
            if isinstance(part, type) and issubclass(part, Part):
                given = f"given its class; write pg.{part.__name__}(name=..., ...)"
            text = "must be a Body, Constraint, Contact, Force, Scenario, Site, Output or Control; "
            text += given
            raise ModelError(Problem("model", "add", text))
        key = PARTS_OF[part.word()]
        parts = list(getattr(self, key))
        at = len(parts)
        if after is not None:
            at = parts.index(self.part(after, part.word())) + 1
        return self._with((), **{key: (*parts[:at], part, *parts[at:])})

    def edit_all(self, changes: Mapping[str, Mapping[str, Any]], /) -> Self:
        """Return a new model with several bodies edited at once.

        Either all changes are made or none. Otherwise the rules of `edit` apply.

        Parameters
        ----------
        changes : dict
            Changed fields by present name of the body. A `parent` in them is given by its new name.

        Returns
        -------
        Model
            The changed model.

        Raises
        ------
        ModelError
            If a change does not fit. The message has all reasons.
        """
        for name in changes:
            self.body(name)
        numbers, new = cells_of(changes, self.parameters)
        parts, notices = edited_all(self.bodies, self._others(), numbers)
        names = {name: fields.get("name", name) for name, fields in changes.items()}
        parts["formulas"] = followed(self.formulas, new, names)
        return self._with(notices, **parts)

    def remove(
        self,
        name: str | Iterable[str],
        /,
        *,
        kind: str | None = None,
        children: Literal["attach", "delete"] = "attach",
    ) -> Self:
        """Return a new model without one or several parts.

        Parts that refer to them are also removed and listed in `notices`.

        Parameters
        ----------
        name : str or iterable of str
            Names of the parts. A body has priority over a part of another kind with the same name.
        kind : str, optional
            Kind of part, such as "contact", to choose among several parts with this name.
        children : {"attach", "delete"}, optional
            Whether the children of a removed body are attached to the next remaining body towards
            the ground, at the same position at q = 0, or deleted as well.

        Raises
        ------
        ModelError
            If a part does not exist.
        """
        names = [name] if isinstance(name, str) else list(name)
        if children not in ("attach", "delete"):
            text = f"must be 'attach' or 'delete'; given {shown(children)}"
            raise ModelError(Problem(f"body {shown(names[0])}", "children", text))
        parts = [self.part(each, kind) for each in names]
        model, notices = self, list[str]()
        for part in parts:
            if not isinstance(part, Body):
                model = model._without_part(part)
                notices += model.notices
        bodies = {part.name: part for part in parts if isinstance(part, Body)}
        if bodies:
            model = model._without_bodies(bodies, children)
            notices += model.notices
        return model._made(notices)

    def _without_part(self, part: Part) -> Self:
        """Return the model without a constraint, contact, force or scenario."""
        key, scenarios, notices = PARTS_OF[part.word()], self.scenarios, list[str]()
        if key in ("constraints", "contacts"):
            scenarios, notices = renamed_in_scenarios(scenarios, key, {part.name: None})
        fields: dict[str, Any] = {"scenarios": scenarios}
        fields[key] = tuple(x for x in fields.get(key, getattr(self, key)) if x is not part)
        if key == "sites":
            fields["outputs"] = tuple(o for o in self.outputs if o.at != part.name)
            gone = (o.name for o in self.outputs if o.at == part.name)
            notices += [f"output '{name}' was removed with its site" for name in gone]
        return self._with(notices, **fields)

    def _without_bodies(self, gone: Mapping[str, Body], children: str) -> Self:
        names = set(gone)
        if children == "delete":
            names = set(branch(self.bodies, names))
        bodies = tuple(attached(b, gone) for b in self.bodies if b.name not in names)
        kept, notices = without(self._others(), names)
        now = {b.name: b.parent for b in bodies}
        told = [
            f"body '{b.name}' hangs on '{now[b.name]}' now, at its place at q = 0"
            for b in self.bodies
            if b.parent in names and b.name in now
        ]
        return self._with([*told, *notices], bodies=bodies, **kept)

    def duplicate(self, name: str | Iterable[str], /, *, subtree: bool = True) -> Self:
        """Return a new model with a copy of a body and the parts that act on it, such as a second
        leg.

        The copies have the same parents as the originals, are inserted below them, and get unused
        names such as femur_2.

        Parameters
        ----------
        name : str or iterable of str
            Name of the body, or of several.
        subtree : bool
            Whether its descendants are also copied.

        Returns
        -------
        Model
            The model with the copies.

        Raises
        ------
        ModelError
            If there is no such body.
        """
        given = [name] if isinstance(name, str) else list(name)
        if not given:
            raise ModelError(Problem("model", "duplicate", "needs the name of a body; given none"))
        roots = [self.body(each).name for each in given]
        names = branch(self.bodies, roots) if subtree else roots
        return self._copied(names_of_copies(names, self.row, str), self.body(roots[0]))

    def mirror(self, name: str, /, plane: Literal["x", "y", "z"] = "z") -> Self:
        """Return a new model with a mirror image of a branch, such as a right leg from a left leg.

        Names change sides: left_femur, right_femur. Equal coordinates are mirrored poses, except
        for balls and free joints, whose rotations are axial vectors. Parts without a mirror image
        are not copied, and `notices` names them.

        Parameters
        ----------
        name : str
            Name of the body at the root of the branch.
        plane : {"x", "y", "z"}
            Normal of the mirror, an axis of the parent's frame at q = 0. The mirror goes through
            the origin of the parent.

        Returns
        -------
        Model
            The model with the image.

        Raises
        ------
        ModelError
            If the branch cannot be mirrored.
        """
        if plane not in ("x", "y", "z"):
            text = f"must be 'x', 'y' or 'z', the axis that it is normal to; given {shown(plane)}"
            raise ModelError(Problem(f"body {shown(name)}", "plane", text))
        root = self.body(name)
        names = names_of_copies(branch(self.bodies, [name]), self.row, other_side)
        return self._copied(names, root, Mirror("xyz".index(plane)))

    def _copied(self, names: Mapping[str, str], root: Body, mirror: Mirror | None = None) -> Self:
        all_parts = {**self._others(), "bodies": self.bodies}
        parts, notices = copied(all_parts, self.formulas, root, names, mirror)
        return self._with(notices, **parts)

    def move(self, name: str | Iterable[str], /, to: int) -> Self:
        """Return a new model with a body moved to another row, which changes the order of left
        children.

        Parameters
        ----------
        name : str or iterable of str
            Name of the body. Several bodies are moved together in their order.
        to : int
            Row of the first of them, from 0.

        Returns
        -------
        Model
            The model in the new order.
        """
        names = [name] if isinstance(name, str) else list(name)
        moved = {each: self.body(each) for each in names}
        row, last = whole(to), len(self.bodies) - len(moved)
        if row is None or not 0 <= row <= last:
            text = f"must be a row from 0 to {last}; given {shown(to)}"
            raise ModelError(Problem(f"body '{names[0]}'", "to", text))
        rest = [b for b in self.bodies if b.name not in moved]
        block = [b for b in self.bodies if b.name in moved]
        return self._with((), bodies=(*rest[:row], *block, *rest[row:]))

    def replace(self, **fields: Any) -> Self:
        """Return a new model with replaced fields.

        Parameters
        ----------
        **fields
            `gravity`, `up`, `ground`, `constraints`, `contacts` or the like. If `up` changes, the
            default gravity is rotated with it.

        Raises
        ------
        ModelError
            If a field does not exist or a value is not permitted.
        """
        if "up" in fields and self.gravity == DOWN[self.up]:
            fields = {"gravity": None, **fields}
        if self.formulas and not {"formulas", "parameters"} & fields.keys():
            now = {**fields_of(self), **fields}
            fields = {**fields, "formulas": still_true(self.formulas, now, self.parameters)}
        new = type(self)(**{**fields_of(self), **fields})
        vars(new)[TOLD] = self.told
        vars(new)[LOST] = self.lost
        return new

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return `replace(...)`, under the name that pydantic uses."""
        return self.replace(**update) if update else super().model_copy(deep=deep)

    def cells(
        self, part: Body | Constraint | Contact | Force | Control, kind: str = "bodies", /
    ) -> dict[str, Any]:
        """Return the fields of a part as in a file, with formulas in their cells."""
        mine = (f for f in self.formulas if (f.part, f.name) == (kind, part.name))
        return inlined(part, mine)

    def _with(self, notices: Iterable[str], **fields: Any) -> Self:
        """Return a copy with validated parts replaced, checking only relations between parts."""
        model = self._made(notices, **fields)
        if found := model_problems(model._parts(), model.ground, model.parameters):
            raise ModelError(found)
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

    def _carries(self, new: Body) -> bool:
        """Return True if the path from a row to the ground does not revisit the row."""
        name = new.parent
        while name in self.row and name != new.name:
            name = self.bodies[self.row[name]].parent
        return name == GROUND

    def _parts(self) -> dict[str, Any]:
        """Return all parts, grouped by field."""
        return {key: getattr(self, key) for key in PARTS}

    def _others(self) -> dict[str, Any]:
        """Return the parts other than bodies, grouped by field."""
        return {key: getattr(self, key) for key in PARTS if key != "bodies"}

    # -- files -------------------------------------------------------------------------------

    def to_json(self) -> str:
        """Return the description as JSON text, one body per line."""
        return files.to_json(self.model_dump(mode="json", exclude_none=True), self.formulas)

    @classmethod
    def from_json(
        cls,
        text: str,
        /,
        *,
        source: str = "text",
        folder: str | Path | None = None,
        roots: Iterable[str | Path] = (),
    ) -> Self:
        """Create a model from JSON text.

        Parameters
        ----------
        text : str
            Content of a Pgraph file.
        source : str, optional
            Name of the text in messages.
        folder : path, optional
            Folder from which relative paths of meshes start. The default is the current folder.
        roots : iterable of paths, optional
            Further folders in which meshes are permitted.

        Raises
        ------
        FileError
            If the text is not JSON, or was written by a later version.
        ModelError
            If the model is not valid.
        """
        return cls(**located(files.parse(text, source), folder, roots))

    @classmethod
    def load(cls, path: str | Path, /, *, roots: Iterable[str | Path] = ()) -> Self:
        """Load a model from a Pgraph JSON file.

        `pg.load` also reads files of other formats.

        Parameters
        ----------
        path : path
            The file. Paths of meshes are relative to the folder of the file.
        roots : iterable of paths, optional
            Further folders in which meshes are permitted.

        Raises
        ------
        FileError
            If the file cannot be read.
        ModelError
            If the model is not valid.
        """
        if Path(path).suffix.lower() in files.FOREIGN:
            text = "is not a Pgraph file; read it with pg.load, which converts it"
            raise FileError(Problem(files.shown_path(path), "", text))
        folder = Path(path).parent
        return cls.from_json(files.read(path), source=str(path), folder=folder, roots=roots)

    def save(self, path: str | Path, /) -> None:
        """Save the model to a Pgraph JSON file.

        An existing file is replaced atomically. The geometry of meshes from other folders is
        written to `meshes` next to the file, so that the folder opens on another machine.

        Parameters
        ----------
        path : path
            The file, with the suffix .json. Functions such as `pg.write_urdf` write other formats.

        Raises
        ------
        FileError
            If the file cannot be written or has the suffix of another format.
        """
        suffix = Path(path).suffix.lower()
        if suffix in files.FOREIGN:
            text = f"is not a Pgraph file; use pg.write_{files.FOREIGN[suffix]}"
            raise FileError(Problem(str(path), "", text))
        if suffix in files.NOT_JSON:
            text = f"is JSON, not {suffix}; use a name that ends in .json"
            raise FileError(Problem(str(path), "", text))
        folder, model = Path(path).parent, self
        if folder.is_dir():
            model = self.unchecked_copy({"bodies": gathered(self.bodies, folder)})
        files.write_atomic(path, model.to_json())
