"""Notices about what the URDF reader omits: unknown elements and attributes, and repetitions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from .. import words
from ..errors import shown
from ..markup import Element, Source
from .conversion import Report
from .urdf_friction import BULLET, GAZEBO

ACTING = {"joint_properties"}  # friction and damping of other programs' exporters
SEEN = {"material", "visual"}  # elements that are drawn, and act nowhere
KNOWN = {"link", "joint", "material", "loop_joint"}  # children of <robot>
OF_LINK = {"inertial", "visual", "collision", BULLET}
OF_INERTIAL = {"origin", "mass", "inertia"}
OF_JOINT = {"origin", "parent", "child", "axis", "limit", "dynamics", "mimic"}
OF_ONE = OF_JOINT | {"inertial", "geometry", "mass", "inertia"}  # an element has one
ATTRIBUTES = {  # attributes of elements in links, joints and inertias
    "link": {"name"},
    "joint": {"name", "type"},
    "limit": {"lower", "upper", "effort", "velocity"},
    "parent": {"link"},
    "child": {"link"},
    "origin": {"xyz", "rpy", "quat_xyzw"},
    "axis": {"xyz"},
    "dynamics": {"damping", "friction"},
    "mimic": {"joint", "multiplier", "offset"},
    "mass": {"value"},
    "inertia": {"ixx", "ixy", "ixz", "iyy", "iyz", "izz"},
}
# elements whose further attributes are those of other programs, and act in no reader of URDF
MARKING = {"link", "joint", "limit", "parent", "child", "dynamics"}
SEVERAL = {"floating", "planar"}  # types of joints with several motions


def report_unread(
    report: Report,
    source: Source,
    robot: Element,
    links: Sequence[Element],
    joints: Sequence[Element],
) -> None:
    """Report each kind of unsupported element and attribute once, with its first location."""
    inertials = [element for link in links for element in link.all("inertial")]
    inside = [(robot, KNOWN), *((link, OF_LINK) for link in links)]
    for element in inertials:
        of_density = {"density"} if element.first("mass") is None else set[str]()
        inside.append((element, OF_INERTIAL | of_density))
    inside += [(joint, OF_JOINT) for joint in joints]
    _elements(report, source, inside)
    owners = [*links, *inertials, *joints]
    _attributes(report, source, [*owners, *(child for x in owners for child in x.children)])
    for joint in joints:
        if joint.get("type") in SEVERAL:
            _dynamics(report, source, joint)
    for element, tag, acts in _repeated(robot):
        text = f"a second {tag} in <{element.tag}>; only the first is read"
        report.add("left out", source.at(element.line), text, acts=acts)


def _elements(report: Report, source: Source, inside: Sequence[tuple[Element, set[str]]]) -> None:
    first: dict[str, list[Element]] = {}
    for parent, known in inside:
        for child in parent.children:
            of_link = child.tag == GAZEBO and child.get("reference")  # `urdf_friction` reads these
            if child.tag not in known and not of_link:
                first.setdefault(child.tag, []).append(child)
    read = sorted(KNOWN | OF_LINK | OF_JOINT | OF_INERTIAL)
    for tag, found in first.items():
        many = f"{len(found)} elements <{tag}>, the first here" if len(found) > 1 else f"<{tag}>"
        close = words.similar(tag, read, n=1, cutoff=0.75)  # misspelt, so it may act
        if tag in read:
            many += ", which means nothing inside of this element"
        elif close:
            many += f"; did you mean <{close[0]}>?"
        given = [x for e in found for y in e.inside() for x in (y.text, *y.attributes.values())]
        acting = tag.lower() in ACTING and any(map(_not_zero, given))
        acting = acting or bool(close and close[0] not in SEEN)
        report.add("left out", source.at(found[0]), many, acts=acting)


def _not_zero(text: str) -> bool:
    return bool(text.strip("0. \n\t"))


def _attributes(report: Report, source: Source, elements: Sequence[Element]) -> None:
    found: dict[tuple[str, str], list[Element]] = {}
    for element in elements:
        for name in element.attributes.keys() - ATTRIBUTES.get(element.tag, element.attributes):
            found.setdefault((element.tag, name), []).append(element)
    for (tag, name), owners in found.items():
        text = f"attribute {shown(name)} of <{tag}>"
        text += f", also of {len(owners) - 1} others" * (len(owners) > 1)
        close = words.similar(name, ATTRIBUTES[tag], n=1, cutoff=0.75)
        text += f"; did you mean {shown(close[0])}?" if close else ""
        acting = tag not in MARKING and any(_not_zero(owner.get(name)) for owner in owners)
        report.add("left out", source.at(owners[0]), text, acts=bool(close) or acting)


def _dynamics(report: Report, source: Source, joint: Element) -> None:
    """Report damping, friction and limits of a joint with several motions.

    URDF does not say on which of them they act.
    """
    for tag, names in (("dynamics", ("damping", "friction")), ("limit", ("lower", "upper"))):
        element = joint.first(tag)
        given = [x for x in names if element is not None and _not_zero(element.get(x))]
        if element is not None and given:
            text = f"{' and '.join(given)} of a {joint.get('type')} joint"
            where = source.at(element, f"joint {shown(joint.get('name'))}")
            report.add("left out", where, text, acts=True)


def _repeated(element: Element, acts: bool = True) -> Iterator[tuple[Element, str, bool]]:
    """Yield (element, property, whether it acts) for each property that is given more than once
    although an element has only one."""
    tags, acts = [child.tag for child in element.children], acts and element.tag != "visual"
    if element.tag == "geometry" and len(tags) > 1:
        yield element, f"solid, <{tags[1]}>,", acts
    for tag in OF_ONE & {*tags}:
        if tags.count(tag) > 1:
            yield element, f"<{tag}>", acts
    for child in element.children:
        if child.tag in OF_LINK | OF_ONE | {"link", "joint"}:
            yield from _repeated(child, acts)
