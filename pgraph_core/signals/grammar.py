"""A parser for expressions, using precedence climbing [Pratt 1973].

    number  name  q.arm  q["upper arm"][1]  v.arm  out.tip[2]  x.speed  (x)  f(x, ...)
    x ^ y (also **), -x, x * y, x / y, x + y, x - y, x < y (<=, >, >=), not x, x and y, x or y

The text and its brackets are bounded, so that every text is read or refused in bounded time.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import NamedTuple, NoReturn

from ..errors import nearest_name, shown

LONGEST_EXPRESSION = 2000  # characters of an expression
MOST_LEVELS = 50  # brackets and signs inside each other
MOST_INSIDE = 250  # operations inside each other: a sum of that many terms
KEPT = 512  # trees of the last texts
# coordinates, velocities, outputs, controls, inputs of drives and the torques that they give,
# forces of contacts and constraints
GROUPS = ("q", "v", "out", "x", "u", "f", "force")
SAMPLED = "y"  # the usual word for samples of sensors, which only programs read

_DECIMAL = r"(?:\d[\d_]*\.?[\d_]*|\.\d[\d_]*)(?:[eE][+-]?\d[\d_]*)?"
TOKEN = re.compile(
    rf"(?P<number>0[xX][\da-fA-F_]+|0[oO][0-7_]+|0[bB][01_]+|{_DECIMAL})"
    r"|(?P<name>[^\W\d]\w*)|(?P<text>\"(?:[^\"]|\"\")*\"|'(?:[^']|'')*')|(?P<sign>\*\*|<=|>=|[-+*/^<>()\[\],.])"
)
# operator -> (operation, how tightly it binds)
BINARY = {
    "or": ("or", 1), "and": ("and", 2), "<": ("less", 4), "<=": ("at_most", 4), ">": ("more", 4),
    ">=": ("at_least", 4), "+": ("add", 5), "-": ("sub", 5), "*": ("mul", 6), "/": ("div", 6),
    "^": ("pow", 8), "**": ("pow", 8),
}  # fmt: skip
COMPARISONS = ("less", "at_most", "more", "at_least")
NOT, SIGN, POWER = 3, 7, 8
# function -> least and largest number of arguments
FUNCTIONS: dict[str, tuple[int, int]] = {
    "sqrt": (1, 1), "sin": (1, 1), "cos": (1, 1), "tan": (1, 1), "asin": (1, 1), "acos": (1, 1),
    "atan": (1, 1), "exp": (1, 1), "log": (1, 1), "abs": (1, 1), "min": (2, 50), "max": (2, 50),
    "if": (3, 3), "smoothstep": (3, 3), "table": (3, 101),
}  # fmt: skip
RESERVED = (*FUNCTIONS, "and", "or", "not", "pi")
# more functions where names are columns of a run: of a whole curve, or of its vector
OF_CURVES: dict[str, tuple[int, int]] = {
    "min": (1, 50), "max": (1, 50), "final": (1, 1), "mean": (1, 1), "rms": (1, 1), "peak": (1, 1),
    "range": (1, 1), "settle": (1, 1), "integral": (1, 1), "norm": (1, 50), "window": (3, 3),
}  # fmt: skip


class Unreadable(ValueError):
    """A syntax error in an expression, with a message and the column, counted from 1."""

    def __init__(self, column: int, text: str):
        super().__init__(f"column {column}: {text}")
        self.column = column


class Node(NamedTuple):
    """An operation on other nodes, or a `number`, `name` or `signal`."""

    op: str
    args: tuple[Node, ...] = ()
    value: float = 0.0  # value of a number
    signal: tuple[str, str, int] = ("", "", 0)  # group, name and entry; without a group a name
    column: int = 1  # column of its first character
    span: tuple[int, int] = (0, 0)  # range of its name in the text
    depth: int = 1


class _Token(NamedTuple):
    kind: str  # number, name, text, sign or end
    text: str
    start: int


def is_expression(value: object) -> bool:
    """Check whether a cell contains '=...'."""
    return isinstance(value, str) and value.lstrip().startswith("=")


@lru_cache(KEPT)
def parsed(text: str) -> Node:
    """Parse an expression, with or without a leading '='. Raises Unreadable."""
    return _Reader(text).whole()


@lru_cache(KEPT)
def parsed_of_columns(text: str) -> Node:
    """Parse an expression whose names are columns of a run, as energy or joint_force.crank.x.

    A column is a signal without a group. A name that is no word stands in quotes: "v.upper arm".
    Raises Unreadable.
    """
    return _OfColumns(text).whole()


class _Reader:
    """The tokens of an expression, with the position of the next one."""

    functions: Mapping[str, tuple[int, int]] = FUNCTIONS

    def __init__(self, text: str):
        if len(text) > LONGEST_EXPRESSION:
            reason = f"an expression has at most {LONGEST_EXPRESSION} characters, got {len(text)}"
            raise Unreadable(LONGEST_EXPRESSION + 1, reason)
        self.tokens = list(_tokens(text))
        self.k = 0

    @property
    def next(self) -> _Token:
        return self.tokens[self.k]

    def take(self) -> _Token:
        self.k += 1
        return self.tokens[self.k - 1]

    def refuse(self, text: str, at: _Token | None = None) -> NoReturn:
        raise Unreadable((at or self.next).start + 1, text)

    def expect(self, sign: str) -> None:
        if self.next.text != sign or self.next.kind != "sign":
            self.refuse(f"expects '{sign}', got {_seen(self.next)}")
        self.take()

    def whole(self) -> Node:
        found = self.expression(0, 0)
        if self.next.kind != "end":
            self.refuse(f"expects an operator or the end, got {_seen(self.next)}{self.after_dot()}")
        return found

    def after_dot(self) -> str:
        """Return the remedy if the next token begins with a dot, or ""."""
        if self.next.text[:1] != ".":
            return ""
        if self.next.kind == "number":
            return f'; a name that begins with a digit is written as in q["{self.next.text[1:]}"]'
        (kind, module, _), name = self.tokens[self.k - 1], self.tokens[self.k + 1].text
        if name in RESERVED:
            return f"; write {name}, without {module}."
        if module == SAMPLED:
            text = f"; expressions do not read samples of sensors: write out.{name} for its exact"
            return f"{text} value, or read run.measured in a loop of pg.Stepper"
        return f"; before a dot stands one of {', '.join(GROUPS)}" if kind == "name" else ""

    def made(self, op: str, args: tuple[Node, ...], at: _Token) -> Node:
        depth = 1 + max(x.depth for x in args)
        if depth > MOST_INSIDE:
            self.refuse(f"has more than {MOST_INSIDE} nested operations", at)
        return Node(op, args, column=at.start + 1, depth=depth)

    def expression(self, least: int, level: int) -> Node:
        """Parse an expression whose operators bind at least as tightly as `least`."""
        left = self.prefix(level)
        while self.next.text in BINARY and self.next.kind in ("sign", "name"):
            at = self.next
            op, tight = BINARY[at.text]
            if tight < least:
                break
            self.take()
            if op in COMPARISONS and left.op in COMPARISONS:
                self.refuse("compares twice; write a < b and b < c", at)
            right = self.expression(tight if tight == POWER else tight + 1, level + 1)
            left = self.made(op, (left, right), at)
        return left

    def prefix(self, level: int) -> Node:
        at = self.next
        if level > MOST_LEVELS:
            self.refuse(f"nests deeper than {MOST_LEVELS} levels")
        if at.kind == "sign" and at.text in "+-":
            self.take()
            inside = self.expression(SIGN, level + 1)
            return inside if at.text == "+" else self.made("neg", (inside,), at)
        if at.kind == "name" and at.text == "not":
            self.take()
            return self.made("not", (self.expression(NOT, level + 1),), at)
        return self.operand(level)

    def operand(self, level: int) -> Node:
        at = self.take()
        if at.kind == "number":
            return Node("number", value=self.number(at), column=at.start + 1)
        if at.kind == "sign" and at.text == "(":
            inside = self.expression(0, level + 1)
            self.expect(")")
            return inside
        if at.kind != "name" or at.text in BINARY:
            self.k -= 1
            self.refuse(f"expects a number, a name or '(', got {_seen(at)}")
        if self.next.text == "(":
            return self.call(at, level)
        return self.named(at)

    def named(self, at: _Token) -> Node:
        """Parse the rest of a signal or a name."""
        if at.text in GROUPS and self.next.text in (".", "["):
            return self.signal(at)
        span = (at.start, at.start + len(at.text))
        return Node("name", signal=("", at.text, 0), column=at.start + 1, span=span)

    def number(self, at: _Token) -> float:
        try:
            return float(int(at.text, 0)) if at.text[:2].lower() in _BASES else float(at.text)
        except (ValueError, OverflowError):
            self.refuse(f"{shown(at.text)} is not a number", at)

    def call(self, at: _Token, level: int) -> Node:
        if at.text not in self.functions:
            do = nearest_name(at.text, self.functions)
            self.refuse(f"no function is named {shown(at.text)}; {do}", at)
        self.take()
        args: list[Node] = []
        while self.next.text != ")" or self.next.kind != "sign":
            if args:
                self.expect(",")
            args.append(self.expression(0, level + 1))
        self.take()
        least, most = self.functions[at.text]
        if not least <= len(args) <= most or (at.text == "table" and len(args) % 2 == 0):
            self.refuse(f"{at.text} takes {TAKES.get(at.text, 'one argument')}", at)
        return self.made(at.text, tuple(args), at)

    def signal(self, at: _Token) -> Node:
        """Parse q.name or q["name"], optionally followed by an index in brackets."""
        quoted = self.take().text == "["
        name = self.take()
        wanted = "text" if quoted else "name"
        if name.kind != wanted:
            form = f'{at.text}["the name"]' if quoted else f"{at.text}.name"
            self.refuse(f"expects {form}, got {_seen(name)}", name)
        inside = _unquoted(name.text) if quoted else name.text
        span = (name.start - 1, name.start + len(name.text) + (1 if quoted else 0))
        if quoted:
            self.expect("]")
        index = 0
        if self.next.text == "[":
            self.take()
            which = self.take()
            if which.kind != "number" or not which.text.isdecimal() or len(which.text) > 2:
                self.refuse(f"expects the number of an entry, from 0, got {_seen(which)}", which)
            index = int(which.text)
            self.expect("]")
        return Node("signal", signal=(at.text, inside, index), column=at.start + 1, span=span)


class _OfColumns(_Reader):
    """The tokens of an expression whose names are columns of a run."""

    functions = FUNCTIONS | OF_CURVES

    def operand(self, level: int) -> Node:
        if self.next.kind != "text":
            return super().operand(level)
        at = self.take()
        return _column(at, _unquoted(at.text))

    def named(self, at: _Token) -> Node:
        """Parse the rest of joint_force.crank.x, trunk.0 or v["upper arm"]."""
        if at.text == "pi":
            return super().named(at)
        name, end = at.text, at.start + len(at.text)
        while self.next.start == end and self.next.text[:1] in (".", "["):
            first = self.take()
            if first.kind == "number":  # .0 of trunk.0
                name, end = name + first.text, end + len(first.text)
                continue
            part = self.take()
            wanted = ("name", "number") if first.text == "." else ("text", "number")
            if part.kind not in wanted:
                self.refuse(f"expects the rest of a column after {name!r}, got {_seen(part)}", part)
            end = part.start + len(part.text)
            if first.text == ".":
                name += f".{part.text}"
                continue
            self.expect("]")
            end += 1
            name += f".{_unquoted(part.text)}" if part.kind == "text" else f"[{part.text}]"
        return _column(at, name)


def _column(at: _Token, name: str) -> Node:
    return Node("signal", signal=("", name, 0), column=at.start + 1)


def _unquoted(text: str) -> str:
    """Return a name without its quotes, which are written twice within it."""
    return text[1:-1].replace(2 * text[0], text[0])


_BASES = ("0x", "0o", "0b")
TAKES = {
    "if": "three arguments: if(condition, then, otherwise)",
    "smoothstep": "three arguments: smoothstep(x, from, to), which goes from 0 to 1",
    "table": "x, then a place and a value each: table(x, 0, 1.5, 2, 3.0)",
    "min": "two or more arguments", "max": "two or more arguments",
    "window": "a curve and two times: window(x, 0.5, 2)",
}  # fmt: skip


def _tokens(text: str) -> Iterator[_Token]:
    """Split a text into tokens, followed by an end token. Raises Unreadable."""
    at = len(text) - len(text.lstrip())
    at += text[at : at + 1] == "="
    while at < len(text):
        if text[at].isspace():
            at += 1
            continue
        found = TOKEN.match(text, at)
        if found is None:
            open_ = text[at] in "\"'"
            reason = "a name in quotes does not end" if open_ else f"unexpected {shown(text[at])}"
            raise Unreadable(at + 1, reason)
        kind = found.lastgroup or ""
        yield _Token(kind, found[0], at)
        at = found.end()
    yield _Token("end", "", len(text))


def _seen(token: _Token) -> str:
    return "the end" if token.kind == "end" else shown(token.text)


def walk(node: Node) -> Iterator[Node]:
    """Yield a node and all of its descendants."""
    left = [node]
    while left:
        one = left.pop()
        yield one
        left += one.args


def filled(text: str, **given: Node) -> Node:
    """Return the tree of a text with trees in place of its names."""

    def put(node: Node) -> Node:
        if node.op == "name" and node.signal[1] in given:
            return given[node.signal[1]]
        return node._replace(args=tuple(map(put, node.args)))

    return put(parsed(text))


def signals_in(text: str) -> set[tuple[str, str, int]]:
    """Return the signals in a text, or nothing if it cannot be parsed."""
    try:
        return {n.signal for n in walk(parsed(text)) if n.op == "signal"}
    except Unreadable:
        return set()


def names_in(text: str) -> set[str]:
    """Return the bare names used in a text, or nothing if it cannot be parsed."""
    try:
        return {n.signal[1] for n in walk(parsed(text)) if n.op == "name"}
    except Unreadable:
        return set()


def with_names(text: str, names: Mapping[str, str], groups: tuple[str, ...]) -> str:
    """Rename bodies ("q", "v"), outputs ("out"), controls ("x"), drives ("u", "f"), contacts and
    constraints ("force") or parameters ("") in a text.
    """
    found = [n for n in walk(parsed(text)) if n.op in ("name", "signal")]
    for n in sorted(found, key=lambda n: n.span, reverse=True):
        group, name, _ = n.signal
        if group in groups and name in names:
            new = names[name]
            plain = written(group, new)[len(group) :] if group else new
            text = text[: n.span[0]] + plain + text[n.span[1] :]
    return text


def written(group: str, name: str, index: int | None = None) -> str:
    """Return a signal as text: q.arm, q["upper arm"], or q.arm[1] with an index."""
    plain = f".{name}" if name.isidentifier() else f"[{_quoted(name)}]"
    return group + plain + ("" if index is None else f"[{index}]")


def _quoted(name: str) -> str:
    """Return a name in quotes, which are written twice within it."""
    quote = "'" if '"' in name and "'" not in name else '"'
    return quote + name.replace(quote, 2 * quote) + quote
