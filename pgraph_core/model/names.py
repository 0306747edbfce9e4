"""Names of parts."""

from __future__ import annotations

from .sentences import shown

GROUND = "ground"
EVERY = "*"  # in a contact: every body that has a shape


def name_problem(name: str) -> str:
    """What is wrong with the name of a part: it must show as what it is, in a table and a file."""
    if not name.strip():
        return f"must be text that is not empty; given {shown(name)}"
    if name != name.strip():
        return f"must not start or end with a space; given {shown(name)}"
    if not name.isprintable():
        return f"must be text on one line, without control characters; given {shown(name)}"
    return ""


def numbers(n: int) -> str:
    return f"{n} number" if n == 1 else f"{n} numbers"
