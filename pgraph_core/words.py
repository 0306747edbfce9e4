"""Vocabulary of other programs: synonyms for our names, and names that get a hint.

A name of an argument, a field or an attribute is accepted if its meaning and form are the same:
`dt` is the step, and `qpos` is q. If the arguments are not equivalent, the message explains the
difference. For example, `x0` is the whole state, while `q` contains positions only. The tables in
`words.txt` are only read after an error, so valid calls have no overhead.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from . import hooks

# pairs of other programs that are two of our numbers
PAIRS = {
    "t_span": ("t_start", "t_end"), "tspan": ("t_start", "t_end"),
    "points": ("point", "other_point"),
    "forcerange": ("torque_low", "torque_limit"), "ctrlrange": ("input_low", "input_high"),
}  # fmt: skip
SPANS = ("t0", "t_span", "tspan")  # with a start of time, a duration does not end at its number
FLAGS = {  # flags of other programs that correspond to a name
    ("ground", True): ("other", "ground"), ("floating", True): ("base", "free"),
    ("floating_base", True): ("base", "free"), ("free_base", True): ("base", "free"),
    ("fixed_base", False): ("base", "free"), ("useFixedBase", False): ("base", "free"),
}  # fmt: skip
VERBS = re.compile("^(?:mj|calc|calculate|compute|eval|evaluate|get|set|num)_")
MOST_LETTERS = 200  # letters of a name with a typing error
OF_JOINTS = ("rest", "friction")  # no length, and no coefficient


def _tables(file: Path) -> dict[str, dict[str, list[str]]]:
    """Return {table: {their word: our words}} of a file with lines "ours: theirs theirs"."""
    found: dict[str, dict[str, list[str]]] = {}
    for block in file.read_text(encoding="utf-8").split("\n\n"):
        head, *lines = block.strip().split("\n")
        table = found.setdefault(head[1 : head.index("]")], {})
        for line in lines:
            ours, theirs = line.rsplit(": ", 1)
            for word in theirs.split():
                table.setdefault(word, []).append(ours)
    return found


_TABLES = _tables(Path(__file__).with_suffix(".txt"))
SAME, NEAR, ATTRIBUTES, CHOICES, NEAR_CHOICES = (
    _TABLES[name] for name in ("same", "near", "attributes", "choices", "near_choices")
)
SAME_ATTRIBUTES = {theirs: ours for theirs, (ours,) in _TABLES["same_attributes"].items()}
ADVICE: dict[str, list[tuple[str, str]]] = {}  # name -> (name of ours beside it, or "", advice)
for _name, _texts in _TABLES["advice"].items():
    _name, _, _beside = _name.partition("@")
    ADVICE.setdefault(_name, []).extend((_beside, text) for text in _texts)


def similar(name: str, known: Iterable[str], n: int = 3, cutoff: float = 0.6) -> list[str]:
    """Return at most n names that are spelt like `name`, the most similar first.

    `cutoff` is the least similarity, from 0 to 1 (`difflib.get_close_matches`). A text longer than
    MOST_LETTERS is no name, and comparing it would take a time that grows with its length.
    """
    if len(name) > MOST_LETTERS:
        return []
    return difflib.get_close_matches(name, list(known), n=n, cutoff=cutoff)


def spelt(name: str) -> str:
    """Return a name as it is spelt here: massMatrix is mass_matrix."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower() if len(name) > 2 else name


def _bare(name: str) -> str:
    """Return the letters of a name without a verb: CalcMassMatrix is massmatrix."""
    return VERBS.sub("", spelt(name)).replace("_", "")


def _alike(name: str, known: Iterable[str]) -> list[str]:
    """Return the known names, and the names in the tables, that are another spelling of `name`.

    What sets a quantity is not another spelling of the quantity.
    """
    bare, sets = _bare(name), spelt(name).startswith("set_")
    alike = [each for each in known if len(bare) > 2 and _bare(each) == bare and each != name]
    return [each for each in alike if sets or not spelt(each).startswith("set_")]


def same_attribute(name: str) -> str:
    """Return our attribute that is the same as another program's `name`, or `name` as spelt
    here."""
    if name.startswith("_"):
        return name
    return SAME_ATTRIBUTES.get(name) or SAME_ATTRIBUTES.get(spelt(name), spelt(name))


def ours(name: str, known: Iterable[str]) -> str:
    """Return the Pgraph name that corresponds to another program's `name`, or ""."""
    names, plain = set(known), spelt(name)
    other = OF_JOINTS if "joint" in names else ()  # fields of a body are those of its joint
    same = SAME.get(name) or (plain, *SAME.get(plain, ()))
    found = [each for each in same if each in names and each not in other]
    return found[0] if name not in names and len(found) == 1 else ""


def renamed(given: Mapping[str, Any], known: Iterable[str]) -> dict[str, Any]:
    """Return arguments under Pgraph names, or {} if none is renamed or two have the same
    meaning."""
    names = list(known)
    if "duration" in given and not {"t_start", *SPANS}.isdisjoint(given):
        return {}
    pairs: list[tuple[str, Any]] = []
    said = ((name, FLAGS.get((name, x))) for name, x in given.items() if isinstance(x, bool))
    flags = {name: flag for name, flag in said if flag}
    for name, value in given.items():
        two, flag = PAIRS.get(name, ("",)), flags.get(name, ("", ""))
        if name not in names and flag[0] in names:
            pairs.append(flag)
        elif {*two} <= {*names} and len(value if hasattr(value, "__len__") else ()) == 2:
            pairs += zip(two, value)
        else:
            pairs.append((ours(name, names) or name, value))
    changed = [name for name, _ in pairs] != list(given)
    found = dict(pairs)
    if len(found) < len(pairs) or not changed:
        return {}
    if "body" in names and found.get("other") is not None and found.get("body") is None:
        found["body"] = "ground"  # other programs use the ground without a first body
    return found


def advice(name: str, known: Iterable[str], around: Iterable[str] = ()) -> str:
    """Return the call that does what another program's `name` does, or "".

    `around` are names of the object whose method is called.
    """
    names = {*known}
    told = ADVICE.get(name) or [x for each in _alike(name, ADVICE) for x in ADVICE[each]]
    fit = [text for beside, text in told if not beside or beside in names.union(around)]
    return fit[0] if fit and name not in names else ""


def chosen(value: Any, known: Iterable[str]) -> str:
    """Return the keyword of Pgraph for that of another program, or "" if there is none."""
    word = value.lower() if isinstance(value, str) else ""
    names = list(known)
    return next((x for x in CHOICES.get(word, (word,)) if x in names and x != value), "")


def hint(name: str, known: Iterable[str], *, alike: bool = True) -> str:
    """Return the known name related to another program's `name`, or "".

    With `alike`, names with similar spelling are accepted as well.
    """
    names = list(known)
    near = [each for each in (*SAME.get(name, ()), *NEAR.get(name, ())) if each in names]
    if alike:
        near += _alike(name, names)
        near += similar(name, names, n=1, cutoff=0.7)
    return next(iter(near), "")


def attributes(
    name: str, known: Iterable[str], elsewhere: Mapping[str, str] | None = None
) -> list[str]:
    """Return the suggestion for an unknown attribute `name`, based on the names used by other
    programs and on spelling.

    `elsewhere` has names of other objects, each with what stands before it, such as "run.".
    """
    names = {*known}
    words = [name, *_alike(name, {**SAME_ATTRIBUTES, **ATTRIBUTES})]
    meant = [
        x for word in words for x in (SAME_ATTRIBUTES.get(word, word), *ATTRIBUTES.get(word, ()))
    ]
    meant += _alike(name, {*names, *(elsewhere or ())})
    head = lambda each: re.split(r"\W", each.lstrip("-"))[0]  # noqa: E731
    found = [each for each in meant if head(each) in names]
    found = found or [each for each in (*SAME.get(name, ()), *NEAR.get(name, ())) if each in names]
    far = elsewhere or {}
    found = found or [far[head(each)] + each for each in meant if head(each) in far]
    spelt_alike = partial(similar, name, cutoff=0.7)
    found = found[:2] or spelt_alike(sorted(names), n=3)
    return found or [far[each] + each for each in spelt_alike(sorted(far), n=1)]


class NoAttribute(AttributeError):
    """An unknown attribute. The message suggests the corresponding name and is only created when it
    is read."""

    def __init__(
        self,
        owner: str,
        attribute: str,
        known: Callable[[], Iterable[str]],
        told: Callable[[str], str] = lambda _: "",
    ):
        super().__init__(owner, attribute)
        self._known, self._told = known, told

    def __str__(self) -> str:
        owner, attribute = self.args
        known = dict.fromkeys(each for each in self._known() if not each.startswith("_"))
        told = self._told(attribute) or advice(attribute, known)
        near = told or " or ".join(attributes(attribute, known, hooks.elsewhere()))
        names = ", ".join(sorted(known, key=str.lower))
        hint = f"; did you mean {near}?" if near else f"; choose from {names}"
        hint = f"; {told}" if told else hint
        return f"{owner} has no attribute '{attribute}'{hint}"

    def __reduce__(self) -> tuple[Any, ...]:
        return AttributeError, (str(self),)


def synonym(name: Any, known: Iterable[str]) -> str:
    """Return the hint "did you mean revolute?" for another program's word for a choice."""
    listed = list(known)
    word = name.lower() if isinstance(name, str) else ""
    found = chosen(name, listed) or next((x for x in NEAR_CHOICES.get(word, ()) if x in listed), "")
    return f"; did you mean {found}?" if found else ""


def choice(name: Any, known: Iterable[str]) -> str:
    """Return the hint "did you mean position?" for a mistyped or shortened choice, or the
    `synonym`."""
    listed = list(known)
    word = name.lower() if isinstance(name, str) else ""
    longer = sorted((x for x in listed if word and x.startswith(word)), key=len)
    close = (longer or similar(word, listed, n=1))[:1]
    return synonym(name, listed) or "".join(f"; did you mean {x}?" for x in close)
