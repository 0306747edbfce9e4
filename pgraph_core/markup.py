"""Bounded reading of untrusted files, including XML with line numbers but no entities or external
files.

The standard library's Expat parses. A document type, through which entity bombs and local files
enter, is refused before it is read.
"""

from __future__ import annotations

import errno
import math
import os
import re
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO
from xml.parsers import expat

from .errors import FileError, Problem, shown

LARGEST_XML = 64_000_000  # bytes of a file
MOST_ELEMENTS = 1_000_000  # elements
DEEPEST_ELEMENT = 200  # elements inside elements
LONGEST_PATH = 4096  # bytes of a path on Linux
LFS = b"version https://git-lfs"  # start of a file that stands for one in Git LFS
POINTER = "is a Git LFS pointer, not the file itself; fetch it: git lfs pull"
LONGEST_ATTRIBUTE = 1_000_000  # characters of one attribute


class Element:
    """An XML element with its attributes, children and line number."""

    __slots__ = ("attributes", "children", "encoding", "line", "tag", "text")

    def __init__(self, tag: str, attributes: dict[str, str], line: int):
        self.tag, self.attributes, self.line = tag, attributes, line
        self.children: list[Element] = []
        self.text = ""
        self.encoding = ""  # encoding of the file, set at the root

    def all(self, *tags: str) -> Iterator[Element]:
        """Return the children with any of these tags."""
        return (child for child in self.children if child.tag in tags)

    def first(self, tag: str) -> Element | None:
        """Find the first child with this tag."""
        return next(self.all(tag), None)

    def inside(self) -> Iterator[Element]:
        """Iterate over this element and all its descendants, in file order."""
        waiting: list[Element] = [self]
        while waiting:
            element = waiting.pop()
            yield element
            if element.children:
                waiting += reversed(element.children)

    def get(self, name: str, default: str = "") -> str:
        """Return the text of an attribute."""
        return self.attributes.get(name, default)


class Source:
    """A file being read, with its name for messages.

    If a list of `faults` is given, invalid numbers are appended to it, and their default is
    returned.
    """

    def __init__(self, name: str, faults: list[Any] | None = None):
        self.name, self.faults = name, faults

    def at(self, element: Element | int, what: str = "") -> str:
        """Return a description of the location, such as 'robot.urdf, line 12, joint 'knee''."""
        line = element if isinstance(element, int) else element.line
        return f"{self.name}, line {line}" + (f", {what}" if what else "")

    def wrong(self, element: Element | int, field: str, text: str, what: str = "") -> FileError:
        """Return the error for an element."""
        return FileError(Problem(self.at(element, what), field, text))

    def numbers(
        self,
        element: Element | None,
        name: str,
        default: tuple[float, ...],
        what: str = "",
        *,
        infinite: bool = False,
    ) -> tuple[float, ...]:
        """Return the numbers in an attribute, which must have the same length as `default`.

        The numbers must be finite unless `infinite` is True. Raises FileError.
        """
        if element is None or name not in element.attributes:
            return default
        given = element.attributes[name]
        try:
            if not given.isascii() or "_" in given:  # Python reads these, no other reader does
                raise ValueError
            found = tuple(float(x) for x in given.split())
        except ValueError:
            found = ()
        allowed = (x == x if infinite else math.isfinite(x) for x in found)
        if len(found) != len(default) or not all(allowed):
            word = "" if infinite else "finite "
            count = f"{len(default)} {word}numbers" if len(default) > 1 else f"a {word}number"
            why = ""
            if "," in given:
                why = ", which has a comma: decimals have a point, and spaces separate numbers"
            fault = self.wrong(element, name, f"must be {count}, got {shown(given)}{why}", what)
            if self.faults is None:
                raise fault
            self.faults.append(fault)
            return default
        return found

    def number(
        self,
        element: Element | None,
        name: str,
        default: float = 0.0,
        what: str = "",
        *,
        infinite: bool = False,
    ) -> float:
        """Return one number from an attribute. Raises FileError."""
        return self.numbers(element, name, (default,), what, infinite=infinite)[0]


def read_markup(path: Path) -> Element:
    """Return the root element of an XML file. Raises FileError, also for one beyond limits."""
    try:
        content = content_of(path, LARGEST_XML)
    except FileNotFoundError:
        raise FileError(Problem(str(path), "", "the file does not exist")) from None
    except (OSError, ValueError) as error:
        raise FileError(Problem(str(path), "", f"cannot be read: {reason_of(error)}")) from None
    return parse_markup(content, path.name)


def content_of(path: str | Path, most: int) -> bytes:
    """Return the content of a regular file of at most `most` bytes. Raises OSError, ValueError."""
    with ordinary(path) as file:
        size = os.fstat(file.fileno()).st_size
        if size > most:
            text = f"it has {size / 1e6:.0f} MB; {most / 1e6:.0f} MB at most"
            raise OSError(errno.EFBIG, text)
        return file.read(size)


def ordinary(path: str | Path) -> BinaryIO:
    """Open a regular file. Raises ValueError for pipes and devices, OSError."""

    def opener(path: str, flags: int) -> int:
        return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))  # a pipe waits for its writer

    file = open(path, "rb", opener=opener)  # noqa: SIM115 - the caller closes it
    if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        file.close()
        raise OSError(errno.EINVAL, "it is not a regular file")
    return file


def reason_of(error: Exception) -> str:
    """Return the reason why a file cannot be read or written, for use in a sentence."""
    if isinstance(error, OSError):
        return error.strerror or str(error)
    text = str(error)
    if "null byte" in text:
        return "its path contains a NUL character"
    return "its links form a cycle" if "Symlink loop" in text else text


def parse_markup(content: bytes, name: str) -> Element:
    """Return the root element of XML text. Raises FileError.

    As by the readers of MuJoCo and of URDF, blanks may be missing between attributes, an ampersand
    may stand for itself, and elements may be closed once more after the root.
    """
    source = Source(name)
    content, encoding = _in_utf8(content, source)
    if stands_for := stand_in(content):
        raise FileError(Problem(name, "", stands_for))
    content = SKIPPED.sub(_without_comment, content)
    begun = content.lstrip()
    if begun.startswith(b"<?xml"):  # blank lines before it are common, and expat refuses them
        first, mark, rest = begun.partition(b"?>")
        content = first + mark + content[: len(content) - len(begun)] + rest
    try:
        root = _tree(content, encoding, source)
    except expat.ExpatError:
        try:
            root = _tree(BARE.sub(b"&amp;", TAG.sub(_apart, content)), encoding, source)
        except expat.ExpatError as error:
            reason = f"{expat.ErrorString(error.code)}, column {error.offset + 1}"
            raise source.wrong(error.lineno, "", f"not XML: {reason}") from None
    root.encoding = encoding or "utf-8"
    return root


def _tree(content: bytes, encoding: str, source: Source) -> Element:
    """Return the root element. Raises ExpatError if it is not XML, and FileError beyond limits."""
    open_elements, roots = list[Element](), list[Element]()
    parser = expat.ParserCreate("utf-8" if encoding else None)
    count, long = 0, len(content) > LONGEST_ATTRIBUTE

    def refuse(text: str) -> FileError:
        return source.wrong(parser.CurrentLineNumber, "", text)

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        if count > MOST_ELEMENTS:
            raise refuse(f"has more than {MOST_ELEMENTS} elements")
        if len(open_elements) >= DEEPEST_ELEMENT:
            raise refuse(f"nests more than {DEEPEST_ELEMENT} elements")
        if long and max(map(len, attributes.values()), default=0) > LONGEST_ATTRIBUTE:
            raise refuse(f"has an attribute of more than {LONGEST_ATTRIBUTE} characters")
        element = Element(tag, attributes, parser.CurrentLineNumber)
        (open_elements[-1].children if open_elements else roots).append(element)
        open_elements.append(element)

    def end(_: str) -> None:
        open_elements.pop()

    def text(characters: str) -> None:
        if open_elements:
            open_elements[-1].text += characters

    def doctype(*_: object) -> None:
        raise refuse("has a document type (<!DOCTYPE>), which is not allowed; remove it")

    parser.buffer_text = True
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = text
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(content, True)
    except expat.ExpatError:
        if not roots or open_elements or not CLOSED.fullmatch(content, parser.ErrorByteIndex - 1):
            raise
    except (ValueError, LookupError):  # raised by the codec that the file names
        told = "not XML: its encoding is unknown; save it in UTF-8"
        raise source.wrong(1, "", told) from None
    return roots[0]


TAG = re.compile(rb"<[A-Za-z_][^<>]*>")
BARE = re.compile(rb"&(?!#?\w+;)")  # an ampersand that begins no reference
TOUCHING = re.compile(rb"""(=\s*(?:"[^"]*"|'[^']*'))(?=[A-Za-z_:])""")  # value, name of the next
CLOSED = re.compile(rb"\s*<?(?:/[\w:.-]+\s*>\s*<?)+")  # closing tags alone


def _apart(found: re.Match[bytes]) -> bytes:
    """Return a tag with blanks between its attributes."""
    return TOUCHING.sub(rb"\1 ", found[0])


SKIPPED = re.compile(rb"<!\[CDATA\[.*?\]\]>|<\?.*?\?>|<!--.*?-->", re.DOTALL)  # no markup inside
LINKED = re.compile(rb"[\w./ -]+\.\w+\s*")  # a link that Git stored as text: only a path


def _without_comment(found: re.Match[bytes]) -> bytes:
    """Return the line breaks of a comment alone. Comments with --, which only expat refuses, are
    common."""
    return b"\n" * found[0].count(b"\n") if found[0].startswith(b"<!--") else found[0]


def stand_in(content: bytes) -> str:
    """Return a remedy if a file only stands for another one, as Git leaves it, or ""."""
    if content.startswith(LFS):
        return POINTER
    if len(content) < LONGEST_PATH and LINKED.fullmatch(content):
        path = shown(content.decode().strip())
        return f"holds only the path {path}: a symbolic link stored as text; copy that file here"
    return ""


ASCII = bytes(range(128))  # characters of markup
DECLARED = re.compile(rb"""\s*<\?xml[^>]*?encoding\s*=\s*["']([\w.-]+)["']""")


def _in_utf8(content: bytes, source: Source) -> tuple[bytes, str]:
    """Return XML text as UTF-8, and the encoding declared in its first line.

    The encoding is "" if the text has a byte-order mark for UTF-8 or UTF-16. Python decodes
    the others, because Expat knows few. An encoding that does not contain ASCII is refused, since
    its markup would read as other text. Raises FileError.
    """
    if content.startswith((b"\xff\xfe", b"\xfe\xff", b"\xef\xbb\xbf")):
        return content, ""
    declared = DECLARED.match(content)
    encoding = declared[1].decode("ascii").lower() if declared else "utf-8"
    try:
        if ASCII.decode(encoding, errors="replace") != ASCII.decode("ascii"):
            raise LookupError
        return content.decode(encoding).encode(), encoding
    except LookupError:
        text = f"not XML: its encoding {shown(encoding)} is unknown; save it in UTF-8"
        raise source.wrong(1, "", text) from None
    except UnicodeError as error:
        start = getattr(error, "start", 0)
        line = content[:start].count(b"\n") + 1
        text = f"is not text in {encoding} (byte {start}); save it in UTF-8, "
        text += "or name its encoding in the first line"
        raise source.wrong(line, "", text) from None
