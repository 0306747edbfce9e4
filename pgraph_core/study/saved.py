"""Results of studies, which are saved as pages, figures, data or text."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any, ClassVar

from ..errors import FileError, Problem, choices, explained
from ..model.files import write_atomic
from ..portable import Portable


@explained
class Saved(Portable, ABC):
    """A result of a study. `print` shows it as text."""

    SUFFIXES: ClassVar[tuple[str, ...]] = (".html", ".json", ".svg", ".txt")  # files

    @abstractmethod
    def _drawn(self, narrow: bool) -> str:
        """Return the figure as SVG text."""

    @abstractmethod
    def html(self) -> str:
        """Return the result as a standalone HTML page."""

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON, with None for numbers that are not finite."""

    def figure(self, *, narrow: bool = False) -> str:
        """Return the figure as standalone SVG text.

        Parameters
        ----------
        narrow : bool, optional
            Whether the figure must fit the width of a column.
        """
        return self._drawn(narrow)

    def to_json(self) -> str:
        """Return the values of `to_dict` as a JSON object."""
        return json.dumps(self.to_dict(), allow_nan=False)

    def save(self, path: str | Path, /) -> None:
        """Save the result to a file.

        Parameters
        ----------
        path : path
            A page (.html), the data (.json), the figure (.svg) or the text (.txt).

        Raises
        ------
        FileError
            If the file cannot be written or has another suffix.
        """
        kinds = dict(zip(self.SUFFIXES, (self.html, self.to_json, self.figure, self.__str__)))
        suffix = Path(path).suffix.lower()
        if suffix not in kinds:
            text = f"must end in {choices(kinds)}; given {suffix!r}"
            raise FileError(Problem(str(path), "", text))
        write_atomic(path, kinds[suffix]())
