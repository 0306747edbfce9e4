"""The text of an .osim file: numbers, names and frames, in the grammars of versions 2.3 to 4.6."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..errors import FileError, choices, shown
from ..fields import GROUND
from ..markup import Element as Element
from ..markup import Source
from ..rotation import Quaternion, quaternion_of, rodrigues

Array = np.ndarray
FRAMES = ("PhysicalOffsetFrame",)
OLDEST = 20000  # versions before it describe joints by other elements
ENDINGS = {  # endings of the tags of parts in a set
    "BodySet": ("Body",),
    "JointSet": ("Joint",),
    "ConstraintSet": ("Constraint",),
    "ForceSet": ("Muscle", "Force", "Actuator", "Spring", "Ligament"),
    "MarkerSet": ("Marker",),
    "ControllerSet": ("Controller",),
    "ProbeSet": ("Probe",),
}
NAMES = {"inf": math.inf, "-inf": -math.inf, "infinity": math.inf, "-infinity": -math.inf}


class Pose(NamedTuple):
    """The position (3,) [m] and orientation (3, 3) of a frame in another one."""

    place: Array
    turn: Array

    def __matmul__(self, other: Pose) -> Pose:  # type: ignore[override]
        """Return the pose of a frame that is given in this one."""
        return Pose(self.place + self.turn @ other.place, self.turn @ other.turn)

    @property
    def inverse(self) -> Pose:
        """The pose of the other frame in this one."""
        return Pose(-self.turn.T @ self.place, self.turn.T)

    def point(self, x: Array | tuple[float, ...]) -> tuple[float, float, float]:
        """Return a point of this frame in the other one (3,) [m]."""
        a, b, c = (self.place + self.turn @ np.asarray(x)).tolist()
        return a, b, c

    @property
    def quaternion(self) -> Quaternion:
        """The orientation as a quaternion."""
        return quaternion_of(self.turn)


HOME = Pose(np.zeros(3), np.eye(3))


def turned(angles: tuple[float, ...]) -> Array:
    """Return the rotation (3, 3) by angles about x, then the new y, then the new z."""
    x, y, z = (rodrigues(axis, angle) for axis, angle in zip(np.eye(3), angles))
    found: Array = x @ y @ z
    return found


class Frame(NamedTuple):
    """A frame of the file: the path of its names, and its pose in its base or another frame."""

    path: tuple[str, ...]
    base: str  # path of another frame
    pose: Pose
    owner: Element | None = None  # the part that it belongs to, None for a body or the ground


class Document(Source):
    """The numbers, names and frames of a file."""

    def __init__(self, name: str, root: Element):
        super().__init__(name)
        if root.tag != "OpenSimDocument":
            text = f"holds <{root.tag}>, not the <OpenSimDocument> of a model of OpenSim"
            raise self.wrong(root, "", text)
        version = root.get("Version") or "none"
        if not version.isdigit() or int(version) < OLDEST:
            text = f"the document's version must be {OLDEST} or later, got {shown(version)}; "
            text += "open the file in OpenSim 3 or 4 and save it again"
            raise self.wrong(root, "Version", text)
        model = root.first("Model")
        if model is None:
            found = choices(x.tag for x in root.children) or "nothing"
            text = f"holds {found}, not a <Model>; give the file of the model"
            raise self.wrong(root, "", text)
        self.model = model
        self.frames: list[Frame] = []
        held = model.first("defaults")
        self.usual = {} if held is None else {x.tag: x.children for x in held.children}

    # -- numbers and words -----------------------------------------------------------------------

    def text(self, element: Element, name: str, default: str = "") -> str:
        """Return the text of a child."""
        child = element.first(name) or next(
            (x for x in self.defaults(element) if x.tag == name), None
        )
        return default if child is None else child.text.strip()

    def defaults(self, element: Element) -> list[Element]:
        """Return the children that the file gives to all elements of a tag without their own."""
        return self.usual.get(element.tag, [])

    def list_of(self, element: Element, name: str, *, finite: bool = False) -> list[float]:
        """Return the numbers in a child, none without one. Raises FileError."""
        given = self.text(element, name)
        try:
            if "_" in given:
                raise ValueError
            found = [NAMES[x] if (x := w.lower()) in NAMES else float(w) for w in given.split()]
        except ValueError:
            found = [math.nan]
        if not all(math.isfinite(x) if finite else x == x for x in found):
            what = "finite numbers" if finite else "numbers"
            child = element.first(name) or element
            text = f"must be {what} with blanks between them, got {shown(given)}"
            raise self.wrong(child, name, text, self.named(element))
        return found

    def numbers(  # type: ignore[override]
        self, element: Element, name: str, default: tuple[float, ...]
    ) -> tuple[float, ...]:
        """Return as many finite numbers in a child as `default` has. Raises FileError."""
        found = self.list_of(element, name, finite=True)
        if not found:
            return default
        if len(found) != len(default):
            text = f"takes {len(default)} numbers, got {shown(self.text(element, name))}"
            raise self.wrong(element.first(name) or element, name, text, self.named(element))
        return tuple(found)

    def number(  # type: ignore[override]
        self, element: Element, name: str, default: float = 0.0
    ) -> float:
        """Return a finite number in a child. Raises FileError."""
        return self.numbers(element, name, (default,))[0]

    def flag(self, element: Element, name: str, default: bool = False) -> bool:
        """Return whether a child says true."""
        return self.text(element, name, str(default)).lower() in ("true", "1")

    def named(self, element: Element) -> str:
        """Return the tag of an element with its name, for messages."""
        name = element.get("name")
        return f"{element.tag} {shown(name)}" if name else element.tag

    def where(self, element: Element) -> str:
        """Return the location of an element."""
        return self.at(element, self.named(element))

    def refuse(self, element: Element, field: str, text: str) -> FileError:
        """Return the error for a named element."""
        return self.wrong(element, field, text, self.named(element))

    def members(self, name: str) -> Iterator[Element]:
        """Iterate over the parts in a set of the model, such as BodySet, and beside the sets."""
        for found in self.model.all(name):
            held = found.first("objects")
            yield from () if held is None else held.children
        for found in self.model.all("components"):
            yield from (x for x in found.children if _set_of(x.tag) == name)

    def socket(self, element: Element, *names: str) -> str:
        """Return the path of a part to which an element is connected, in any grammar, or ""."""
        for name in names:
            for tag in (f"socket_{name}", f"socket_{name}_connectee_name", name):
                if (text := self.text(element, tag)) and not _holds_parts(element, tag):
                    return text
            held = element.first("connectors")
            for connector in held.children if held is not None else ():
                if connector.get("name") == name:
                    return self.text(connector, "connectee_name")
        return ""

    # -- frames ----------------------------------------------------------------------------------

    def collect(self, bodies: list[str]) -> None:
        """Find all frames, given the names of the bodies."""
        self.frames = [Frame((GROUND,), "", HOME)]
        self.frames += [Frame(("bodyset", name), "", HOME) for name in bodies]
        waiting: list[tuple[Element, tuple[str, ...], Element]] = [(self.model, (), self.model)]
        while waiting:
            element, path, owner = waiting.pop()
            if element.tag in FRAMES:
                base = self.socket(element, "parent")
                turn = turned(self.numbers(element, "orientation", (0.0, 0.0, 0.0)))
                place = np.array(self.numbers(element, "translation", (0.0, 0.0, 0.0)))
                own = (*path, element.get("name"))
                self.frames.append(Frame(own, base, Pose(place, turn), owner))
            name = element.get("name")
            inner = (*path, name) if name and element is not self.model else path
            waiting += [(child, inner, element if name else owner) for child in element.children]

    def frame(self, path: str, owner: Element, field: str = "frame") -> tuple[str, Pose]:
        """Return the body of a frame, and the pose of the frame in it. Raises FileError."""
        pose, seen = HOME, set[int]()
        near, holder = owner, owner
        while True:
            found = self._found(path, near)
            if found is None or id(found) in seen:
                known = choices(x.path[-1] for x in self.frames if x.owner is None)
                why = "which is no frame" if found is None else "whose frames name each other"
                text = f"names {shown(path)}, {why}; bodies are {known}"
                raise self.refuse(holder, field, text)
            seen.add(id(found))
            pose = found.pose @ pose
            if found.owner is None:
                return found.path[-1], pose
            path, near = found.base, found.owner or owner

    def _found(self, path: str, owner: Element) -> Frame | None:
        """Return the frame of a path, which may be relative to its owner or a name alone."""
        names = tuple(x for x in path.split("/") if x not in ("", ".", ".."))
        if not names and ".." in path and owner.tag in ("Body", "Ground"):
            names = (owner.get("name") or GROUND,)  # the body that owns the frame
        if not names:
            return None
        for k in range(len(names)):  # sets and models may have other names, or none
            ending = [x for x in self.frames if x.path[k - len(names) :] == names[k:]]
            own = [x for x in ending if x.owner is owner]
            if found := own or [x for x in ending if x.owner is None] or ending:
                return found[0]
        return None


def _set_of(tag: str) -> str:
    """Return the set to which a part beside the sets belongs."""
    return next((name for name, ends in ENDINGS.items() if tag.endswith(ends)), "ComponentSet")


def _holds_parts(element: Element, tag: str) -> bool:
    child = element.first(tag)
    return child is not None and bool(child.children)
