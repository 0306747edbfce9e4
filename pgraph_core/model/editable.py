"""Edits, which derive a new model from a model."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Literal, Self, cast

from .. import hooks
from ..errors import ModelError, Problem, explained, shown
from ..fields import GROUND, fields_of, listed, whole
from .beam import Beam
from .body import Body
from .constraint import AtPoints
from .copies import Mirror, branch, copied, names_of_copies, other_side
from .description import LOST, PARTS_OF, TOLD, Description, Part
from .editing import (
    attached,
    cut_joint,
    edited,
    edited_all,
    edited_part,
    fitted,
    in_expressions,
    left_behind,
    renamed,
    renamed_all,
    renamed_in_scenarios,
    without,
)
from .expressions import groups_of
from .parameters import Formula, cells_of, followed, formulas_in, still_true
from .poses import poses
from .segments import place_in, places_of, renamed_places
from .world import DOWN, Ground

# fields of a body that nothing else in a model depends on, but for the tree
OF_ONE_ROW = {"parent", "mass", "com", "inertia", "link", "rotation", "tip", "armature", "damping"}


@explained
class Editable(Description):
    """A description whose edits make new, validated ones. The original is unchanged."""

    def edit(self, name: str | Mapping[str, float], /, *number: float, **changes: Any) -> Self:
        """Return a new model in which fields of one part, or numbers at paths, are changed.

        References follow a new name. A body's new `joint`, `dof` or other kinds of `motions` reset
        the joint's q, v and springs, and its axes unless the new joint has as many. Forces and
        initial values that do not fit are removed and listed in `notices`. This model stays
        unchanged.

        Parameters
        ----------
        name : str
            Name of a body or of another part. A body has priority. To select another part, pass
            `kind="contact"`, for example. With a number, a path as in a sweep. A dictionary of
            paths and numbers, such as `values` of a fit, changes them all at once.
        number : float, optional
            The new number at a path.
        **changes
            New values by name of field. `parent` may be several names: the first is the parent in
            the tree, and the others close loops, cut at joints like the body's own.

        Raises
        ------
        ModelError
            If the part or a field does not exist, or a value is not permitted.
        InputError
            If a path does not lead to a number.

        Examples
        --------
        >>> heavier = pg.Model.serial(2).edit("2", mass=3.0)
        >>> heavier.body("2").mass
        3.0
        >>> heavier.edit("bodies.2.mass", 4.0).body("2").mass
        4.0
        """
        if number or isinstance(name, Mapping):
            return hooks.edited(self, name, number, changes)
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
        return model._made(
            (
                *model.notices,
                f'{text}that field as well; to change it give kind="{twins[0]}" to mean it',
            )
        )

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
        if isinstance(new, Beam) and new.name != name:
            names = renamed_places(self._parts(), {name: new.name})
            fields = renamed_all({**self._parts(), **fields}, names)
            return self._with(notices, formulas=followed(formulas, (), names, "beams"), **fields)
        if new.name != name:
            names = {name: new.name}
            groups = groups_of(key, old)
            if "force" in groups:
                fields["scenarios"], _ = renamed_in_scenarios(self.scenarios, key, names)
            if key == "sites":
                fields["outputs"] = tuple(renamed(o, names) for o in self.outputs)
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
            text = (
                "no such field; the length of a link is the field `link` of the body attached to it"
            )
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
            The position of the joint in body axes [m], which defaults to the tip, and in parent
            axes, which defaults to the initial position of this point.
        axis, other_axis : (3,) sequence, optional
            The joint axis in the axes of both bodies. The default is the axis of the body's joint.

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
            text = f"must be the name of a body or 'ground', got {shown(parent)}"
            raise ModelError(Problem(f"body {shown(body)}", "parent", text))
        given = {
            "joint": joint, "name": name, "point": point, "other_point": other_point,
            "axis": axis, "other_axis": other_axis,
        }  # fmt: skip
        cut = cut_joint(self.body(body), parent, [c.name for c in self.constraints], given)
        text = f"body '{body}': the loop through '{parent}' is cut at a {cut.kind} constraint, "
        text += f"'{cut.name}'"
        model = self._with((), constraints=(*self.constraints, cut))
        if other_point is None and isinstance(cut, AtPoints):
            text += f", {model._where_cut(cut)}"
        return model._made((*self.notices, text))

    def _where_cut(self, cut: AtPoints) -> str:
        """Return a message about the position at which the loop closes in the initial state."""
        at = poses(self.standing)
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
            raise ModelError(Problem(f"body '{name}'", "parent", "give at least one, got []"))
        model = self._edit_body(name, {**changes, "parent": parents[0]})
        model = model._with((), bodies=model.bodies) if model is self else model
        for parent in parents[1:]:
            model = model.close_loop(changes.get("name", name), parent)
        return model

    def add(
        self,
        part: Part | Ground | Sequence[Part | Ground],
        /,
        *more: Part | Ground,
        after: str | None = None,
    ) -> Self:
        """Return a new model with one additional part.

        Parameters
        ----------
        part, *more : Body, Beam, Constraint, Contact, Force, Scenario, Site, Output or Control
            The parts to add, or one list of them. A Ground replaces the existing ground.
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
        if more or (isinstance(part, (list, tuple)) and part):
            first, *others = (part, *more) if more else cast("Sequence[Part]", part)
            new = self.add(first, after=after)
            return new.add(*others) if others else new
        if isinstance(part, Ground):
            return self.replace(ground=part)
        if not isinstance(part, Part):
            given = f"given {shown(part)} ({type(part).__name__})"
            if isinstance(part, type) and issubclass(part, Part):
                given = f"given its class; write pg.{part.__name__}(name=..., ...)"
            text = "must be a Body, Beam, Constraint, Contact, Force, Scenario, Site, Output or "
            text += "Control; "
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
            A dictionary that maps the current name of each body to its changed fields. In
            `changes`, `parent` refers to the new name.

        Returns
        -------
        Model
            The changed model.

        Raises
        ------
        ModelError
            If a change does not fit. The message has all reasons.

        Examples
        --------
            model = model.edit_all({"arm": {"mass": 2.0}, "hand": {"mass": 0.5}})
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
            text = f"must be 'attach' or 'delete', got {shown(children)}"
            raise ModelError(Problem(f"body {shown(names[0])}", "children", text))
        parts = [self.part(each, kind) for each in names]
        model, notices = self, list[str]()
        for part in parts:
            if not isinstance(part, Body | Beam):
                model = model._without_part(part)
                notices += model.notices
        bodies = {part.name: part for part in parts if isinstance(part, Body)}
        beams = [part.name for part in parts if isinstance(part, Beam)]
        bodies |= {body.name: body for body in self.standing if self._is_on(body.name, beams)}
        if bodies:
            model = model._without_bodies(bodies, children)
            notices += model.notices
        return model._made(notices)

    def _without_part(self, part: Part) -> Self:
        """Return the model without a constraint, contact, force or scenario."""
        key, scenarios, notices = PARTS_OF[part.word()], self.scenarios, list[str]()
        if "force" in groups_of(key, part):
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
            names = set(branch(self.standing, names))
        bodies = tuple(attached(b, gone) for b in self.bodies if b.name not in names)
        beams = tuple(attached(b, gone) for b in self.beams if b.name not in names)
        kept, notices = without(self._others(), names)
        now = {b.name: b.parent for b in (*bodies, *beams)}
        told = [
            f"{b.word()} '{b.name}' hangs on '{now[b.name]}' now, at its place at q = 0"
            for b in (*self.bodies, *self.beams)
            if b.parent in names and b.name in now
        ]
        return self._with([*told, *notices], **{**kept, "bodies": bodies, "beams": beams})

    def _is_on(self, name: str, beams: Sequence[str]) -> bool:
        """Check whether a name means a place on one of these beams."""
        place = None if name in self.row else place_in(name, {b.name: b for b in self.beams})
        return place is not None and place[0] in beams

    def _row(self, name: str) -> Body:
        """Return a body, or the body that stands for the tip of a beam. Raises ModelError."""
        known = {body.name: body for body in self.standing}
        return known[name] if name in {b.name for b in self.beams} else self.body(name)

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
            raise ModelError(Problem("model", "duplicate", "needs the name of a body, got none"))
        roots = [self._row(each).name for each in given]
        names = self._branch(roots) if subtree else roots
        return self._copied(self._names_of_copies(names, str), self._row(roots[0]))

    def _branch(self, roots: Sequence[str]) -> list[str]:
        """Return bodies and beams with all that they carry, without places on beams."""
        places = places_of({b.name: b for b in self.beams}, self.row, self._parts())
        of = [x for x, (beam, _) in places.items() if beam in roots] if self.beams else []
        found = branch(self.standing, [*roots, *of])
        return [x for x in found if x not in places or places[x][0] == x]

    def _names_of_copies(
        self, names: Iterable[str], name: Callable[[str], str]
    ) -> Mapping[str, str]:
        found = names_of_copies(names, [*self.row, *(b.name for b in self.beams)], name)
        return renamed_places(self._parts(), found)

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
            Normal of the mirror, an axis of the parent's frame at q = 0. The mirror plane contains
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
            text = f"must be 'x', 'y' or 'z', the axis that it is normal to, got {shown(plane)}"
            raise ModelError(Problem(f"body {shown(name)}", "plane", text))
        root = self._row(name)
        names = self._names_of_copies(self._branch([name]), other_side)
        return self._copied(names, root, Mirror("xyz".index(plane)))

    def _copied(self, names: Mapping[str, str], root: Body, mirror: Mirror | None = None) -> Self:
        parts, notices = copied(
            self._parts(), self.formulas, root, names, mirror, self.standing[len(self.bodies) :]
        )
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
            text = f"must be a row from 0 to {last}, got {shown(to)}"
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

    def _carries(self, new: Body) -> bool:
        """Check whether the path from a row to the ground does not revisit the row."""
        name = new.parent
        while name in self.row and name != new.name:
            name = self.bodies[self.row[name]].parent
        return name == GROUND
