"""Friction and stiffness of links in the extensions of Gazebo and Bullet.

A URDF file has no contacts and no ground. The friction of its links is the default of the contacts
that a user adds.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from typing import Any

from ..errors import choices, shown
from ..markup import Element, Source
from .conversion import Report

# element of Gazebo, of Bullet -> meaning
MEANING = {
    "mu1": "friction", "mu": "friction", "lateral_friction": "friction",
    "mu2": "across", "kp": "stiffness", "kd": "damping", "stiffness": "stiffness",
    "damping": "damping", "rolling_friction": "rolling", "spinning_friction": "spinning",
}  # fmt: skip
ACTING = {"dampingfactor", "springstiffness"}  # names that act in Gazebo
WEIGHTLESS = "turnGravityOff"
NESTED = {"collision", "surface"}
GAZEBO, BULLET = "gazebo", "contact"
UNIT = {"stiffness": "N/m", "damping": "N s/m"}


def surfaces(report: Report, source: Source, robot: Element) -> dict[str, Any]:
    """Return the fields of the ground for the most frequent friction of links, and report the rest
    of what <gazebo reference="..."> and Bullet's <contact> say."""
    found: dict[str, dict[str, tuple[float, int]]] = {}  # meaning -> link -> (value, line)
    others: dict[str, list[Element]] = {}
    for link, element in _elements(robot):
        for child in (leaf for each in element.children for leaf in _leaves(each)):
            if child.tag == WEIGHTLESS:
                continue
            meaning = MEANING.get(child.tag)
            value = _number(child)
            if meaning is None or value is None:
                others.setdefault(child.tag, []).append(child)
            else:
                found.setdefault(meaning, {}).setdefault(link, (value, child.line))
    for tag, elements in others.items():
        text = f"{len(elements)} elements <{tag}>" if len(elements) > 1 else f"<{tag}>"
        given = (e.text.strip() or e.get("value") for e in elements)
        acts = tag.lower() in ACTING and any(
            x.lower() not in ("", "0", "0.0", "false") for x in given
        )
        report.add("left out", source.at(elements[0]), f"{text} of Gazebo or Bullet", acts=acts)
    fields: dict[str, Any] = {}
    for meaning, field in (
        ("friction", "friction"),
        ("rolling", "rolling_friction"),
        ("spinning", "spinning_friction"),
    ):
        if values := found.get(meaning):
            fields[field] = _most(report, source, field, values)
    across = found.get("across", {})
    odd = {
        link: x for link, x in across.items() if x[0] != found.get("friction", {}).get(link, x)[0]
    }
    _told(report, source, "friction across the first direction (mu2)", odd, "which is not read")
    for meaning, unit in UNIT.items():
        text = f"which a contact takes by law='penalty', {meaning}=... [{unit}]; others are rigid"
        _told(report, source, f"{meaning} of contacts", found.get(meaning, {}), text)
    return fields


def weightless(robot: Element) -> Iterator[tuple[str, int]]:
    """Yield (link, line) of the links without gravity."""
    for link, element in _elements(robot):
        for child in element.all(WEIGHTLESS):
            if child.text.strip().lower() in ("true", "1"):
                yield link, child.line


def _elements(robot: Element) -> Iterator[tuple[str, Element]]:
    """Yield (link, element) of all elements with properties of links."""
    for element in robot.all(GAZEBO):
        if link := element.get("reference"):
            yield link, element
    for link in robot.all("link"):
        for element in link.all(BULLET):
            yield link.get("name"), element


def _leaves(element: Element) -> list[Element]:
    """Return the properties of a surface in an element, which SDF nests, or the element itself."""
    nested = [x for x in element.inside() if x.tag in MEANING] if element.tag in NESTED else []
    return nested or [element]


def _number(element: Element) -> float | None:
    try:
        value = float(element.text.strip() or element.get("value"))
    except ValueError:
        return None
    return value if 0 <= value < math.inf else None


def _most(
    report: Report, source: Source, field: str, values: dict[str, tuple[float, int]]
) -> float:
    """Return the most frequent value, and report it together with the others."""
    most = Counter(value for value, _ in values.values()).most_common(1)[0][0]
    line = next(line for value, line in values.values() if value == most)
    text = f"the {field} {most:g} of links is that of the ground, the default of contacts"
    report.add("converted", source.at(line), text)
    others = {link: x for link, x in values.items() if x[0] != most}
    _told(report, source, field, others, f"which a contact of the link takes by {field}=...")
    return most


def _told(
    report: Report, source: Source, what: str, values: dict[str, tuple[float, int]], text: str
) -> None:
    if values:
        named = choices((f"{x:g} of {shown(link)}" for link, (x, _) in values.items()), 6)
        line = next(iter(values.values()))[1]
        report.add("left out", source.at(line), f"{what}: {named}, {text}")
