"""Shared helpers for commands: argument parsing, text and JSON output, a progress bar."""

from __future__ import annotations

import json
import math
import os
import re
import sys
import time
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pgraph_core as pg
import pgraph_models
from pgraph_core import words
from pgraph_core.errors import FileError, InputError, ModelError, Problem, choices, plain
from pgraph_core.fields import about
from pgraph_core.markup import content_of, reason_of
from pgraph_core.model.files import mesh_folder
from pgraph_core.model.links import is_link
from pgraph_core.model.settings import Settings
from pgraph_core.portable import jsonable
from pgraph_core.study import figures

LARGEST = 100_000  # bodies of a new model: more is a typing error
FREE = "none"  # stands for no scenario
WIDTH = 30  # characters of the bar

SILENCE = 5.0  # [s] between two lines about long work, if output is piped
SHORT = 2.0  # [s] after which the time left is worth a word


# -- arguments -------------------------------------------------------------------------------------


class Parser(ArgumentParser):
    """A parser that suggests the flag meant by an unknown one, such as --step for --dt."""

    def __init__(self, *args: Any, **named: Any):
        super().__init__(*args, **named)
        # values begin like negative numbers, also such as -30,130deg
        self._negative_number_matcher = re.compile(r"-\.?\d")

    def read(self, words: Sequence[str]) -> Namespace:
        """Return the values of the arguments, or end the program with a message."""
        found, unknown = self.parse_known_args(words)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}{self._meant(unknown)}")
        return found

    def _meant(self, unknown: Sequence[str]) -> str:
        flags = {
            flag.lstrip("-").replace("-", "_"): flag
            for action in self._actions for flag in action.option_strings
        }  # fmt: skip
        given = (
            x.lstrip("-").partition("=")[0].replace("-", "_") for x in unknown if x.startswith("-")
        )
        close = (name if name in flags else words.hint(name, flags) for name in given)
        found = dict.fromkeys(flags[name] for name in close if name)
        return f"; did you mean {' and '.join(found)}?" if found else ""


Takes = Callable[[ArgumentParser], object]  # adds an argument to a parser


def takes(*flags: str, **how: Any) -> Takes:
    """Return a function that adds this argument to a parser."""
    return lambda parser: parser.add_argument(*flags, **how)


def given(text: str) -> tuple[str, str]:
    """Parse a name and its value."""
    name, mark, value = text.partition("=")
    if not (name and mark):
        raise ArgumentTypeError(f"must be NAME=VALUE, got {text!r}")
    return name, value


def open_model(args: Namespace, *, told: bool = False) -> pg.Model:
    """Load a model file, or the built-in model with this name. Raises PgraphError.

    Parts of the file that affect results and are missing or approximated go to stderr, unless the
    command has `told` them itself.
    """
    if is_link(args.model):
        return pg.load(args.model)
    path = model_path(args.model)
    if path.suffix.lower() == ".zip":
        read, report = read_file(args)
        model = report.noted(read)
    else:
        model = pg.load(path, roots=roots(args), arguments=dict(args.argument))
    for text in () if told else model.lost:
        print(plain(text), file=sys.stderr)
    return model


def read_file(args: Namespace) -> tuple[pg.Model, pg.Report]:
    """Return (model, report) for a file, an archive or a built-in model. Raises PgraphError."""
    from pgraph_core.formats import read_model  # other formats need kernels

    if is_link(args.model):
        return read_model(args.model)
    path = model_path(args.model)
    if path.suffix.lower() != ".zip":
        return read_model(path, roots(args), dict(args.argument))
    from ..core.cells import Refusal
    from ..model import archive

    try:
        content = content_of(path, archive.LARGEST_WITHIN)
        return archive.unpacked(content, mesh_folder(), args.member)
    except archive.Several as several:
        text = f"holds {len(several.members)} models; name one: --member FILE, one of "
        raise InputError(Problem(str(path), "", text + choices(several.members, 40))) from None
    except Refusal as refusal:
        raise FileError(Problem(str(path), "", str(refusal))) from None
    except (OSError, ValueError) as error:
        raise FileError(Problem(str(path), "", f"cannot be read: {reason_of(error)}")) from None


def roots(args: Namespace) -> list[str]:
    """Return the folders given by `--root`. Raises FileError if one does not exist."""
    for root in args.root:
        if not Path(root).is_dir():
            raise FileError(Problem(f"--root {root}", "", "the folder does not exist"))
    return args.root


def model_path(name: str) -> Path:
    """Return the path to a model. Built-in names take precedence, so a file may need ./name."""
    if name in pgraph_models.names():
        return pgraph_models.path(name)
    path = Path(name)
    if path.exists() or path.suffix or os.sep in name:
        return path
    known = choices(pgraph_models.names(), 40)
    text = f"is neither a file nor a built-in model; the built-in models are {known}"
    raise InputError(Problem(f"model '{name}'", "", text))


def first_scenario(model: pg.Model, given: str | None) -> str | None:
    """Return the given scenario, or the model's first one, or None if there are none.

    "none" is the model as it is, unless a scenario has this name.
    """
    names = [s.name for s in model.scenarios]
    if given == FREE and FREE not in names:
        return None
    return given or next(iter(names), None)


def whole(least: int, most: int | None = None, about: str = "") -> Callable[[str], int]:
    """Return an integer parser that enforces these bounds."""
    allowed = f">= {least}" if most is None else f"from {least}{about} to {most}"

    def parsed(text: str) -> int:
        try:
            number = int(text) if text.isascii() and text.isdigit() else least - 1
        except ValueError:  # thousands of digits
            number = least - 1
        if number < least or (most is not None and number > most):
            raise ArgumentTypeError(f"must be a whole number {allowed}, got {text!r}")
        return number

    return parsed


def positive(text: str) -> float:
    """Parse a finite number > 0."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < math.inf:
        raise ArgumentTypeError(f"must be a finite number > 0, got {text!r}")
    return value


def setting(name: str) -> Takes:
    """Return the argument for a setting of a run, as its field says."""
    known = about(Settings.model_fields[name], name)

    def parsed(text: str) -> Any:
        try:
            return Settings.read(name, text)
        except ModelError as error:
            raise ArgumentTypeError(error.problems[0].text) from None

    help = known.help + (f" [{known.unit}]" if known.unit else "")
    flag = f"--{name.replace('_', '-')}"
    # a name is checked with the model, by the core
    kind = str if name in Settings.CHOICES else parsed
    return takes(flag, type=kind, metavar=known.label.upper(), help=help)


def settings(args: Namespace) -> dict[str, Any]:
    """Return the given settings of a run."""
    given = {name: getattr(args, name, None) for name in Settings.model_fields}
    return {name: value for name, value in given.items() if value is not None}


def names(text: str) -> tuple[str, ...]:
    """Parse names separated by commas."""
    return tuple(x.strip() for x in text.split(",") if x.strip())


def numbers(text: str) -> tuple[float, ...]:
    """Parse numbers separated by commas."""
    try:
        return tuple(float(x) for x in names(text))
    except ValueError:
        raise ArgumentTypeError(f"must be numbers separated by commas, got {text!r}") from None


# -- answers ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Answer:
    """The answer to a command, as data for programs and as text for people."""

    data: Mapping[str, Any]  # with --json, under the names of the Python API
    text: str
    problem: str = ""  # failure of a run, printed on stderr with exit code 1


@dataclass(frozen=True)
class Command:
    """The command `pgraph NAME`: its one-line help, its arguments, and its function."""

    help: str
    arguments: tuple[Takes, ...]
    answer: Callable[[Namespace], Answer]  # raises PgraphError


COMMANDS: dict[str, Command] = {}


def command(name: str, help: str, *arguments: Takes) -> Callable[[Any], Any]:
    """Make a function (arguments) -> Answer the command `pgraph NAME`."""

    def keep(answer: Callable[[Namespace], Answer]) -> Callable[[Namespace], Answer]:
        COMMANDS[name] = Command(help, arguments, answer)
        return answer

    return keep


# -- arguments of several commands -----------------------------------------------------------------


count = whole(1, LARGEST)
FILES = (
    takes(
        "--root", action="append", default=[], metavar="FOLDER",
        help="additional folder for meshes and included files; may be repeated",
    ),
    takes(
        "--argument", type=given, action="append", default=[], metavar="NAME=VALUE",
        help="a value for an argument of a xacro file, which is a program; may be repeated",
    ),
    takes("--member", default="", metavar="FILE", help="model in a zip file with several models"),
)  # fmt: skip
NAMED = "a file or the name of a built-in model"
MODEL = (takes("model", metavar="MODEL", help=NAMED), *FILES)
SCENARIO = takes(
    "--scenario", metavar="NAME",
    help=f"default: the model's first one; {FREE}: the model as it is, without a scenario",
)  # fmt: skip
T_END, *OTHERS = map(setting, Settings.model_fields)
RUN = (SCENARIO, T_END, *OTHERS)  # arguments of `simulate`
METHODS = takes("--methods", type=names, metavar="M,M", help="default: all that fit")


def print_answer(answer: Answer, as_json: bool) -> None:
    """Print the text, or one JSON object, to stdout."""
    print(to_json(answer.data) if as_json else plain(answer.text))


def print_problems(problems: Iterable[Problem], as_json: bool) -> None:
    """Print each problem to stderr, and with --json also one object to stdout."""
    problems = tuple(problems)
    for problem in problems:
        print(problem, file=sys.stderr)
    if as_json:
        print(to_json({"problems": [vars(problem) for problem in problems]}))


def to_json(data: Any) -> str:
    """Serialise to JSON text, with arrays as lists and non-finite numbers as null."""
    return json.dumps(jsonable(data), allow_nan=False)


def aligned(rows: Iterable[Iterable[Any]], header: Iterable[str]) -> str:
    """Format a table in columns, with numbers right-aligned and text left-aligned."""
    cells = [[*header], *([*row] for row in rows)]
    left = [
        not all(isinstance(row[i], (int, float)) for row in cells[1:]) for i in range(len(cells[0]))
    ]
    texts = [[f"{x:g}" if isinstance(x, float) else str(x) for x in row] for row in cells]
    return "\n".join(figures.aligned(texts, left))


# -- progress --------------------------------------------------------------------------------------


class Bar:
    """The progress of a command with the time left, on stderr.

    A terminal shows a bar, below a table if there is one. Elsewhere, long work writes a line now
    and then.
    """

    def __init__(self) -> None:
        self.drawn = sys.stderr.isatty() and sys.stdout.isatty()
        self.table: tuple[str, ...] = ()  # lines to show above the bar
        self._above = 0  # lines of it on the terminal
        self._began = self._told = time.perf_counter()

    def __call__(self, what: str, fraction: float) -> bool:
        """Show the fraction done, or erase the bar if `what` is empty. Return True to continue."""
        if self.drawn:
            self._draw(what, fraction)
        elif what and time.perf_counter() - self._told > SILENCE:
            self._told = time.perf_counter()
            print(f"{what}: {fraction:.0%}{self._left(fraction)}", file=sys.stderr, flush=True)
        return True

    def _left(self, fraction: float) -> str:
        """Return the time left at the pace so far, or "" at the beginning."""
        gone = time.perf_counter() - self._began
        if not (gone > SHORT and fraction > 0.0):
            return ""
        return f", about {gone * (1.0 / fraction - 1.0):.0f} s left"

    def _draw(self, what: str, fraction: float) -> None:
        done = round(WIDTH * fraction)
        bar = f"{what:10}[{'#' * done}{'.' * (WIDTH - done)}] {fraction:4.0%}" if what else ""
        above = f"\033[{self._above}A\033[J" if self._above else ""
        table = "".join(f"{line}\n" for line in self.table) if what else ""
        self._above = len(self.table) if what else 0
        line = f"{bar}{self._left(fraction)}" if bar else ""
        text = f"\r{above}{table}{line:{WIDTH + 40}}"
        print(text, end="" if what else "\r", file=sys.stderr, flush=True)


def progress_bar() -> Bar:
    """Return the progress of a command that begins now."""
    return Bar()
