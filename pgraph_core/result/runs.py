"""The runs of several initial states."""

from __future__ import annotations

from typing import Any

from .result import Result


class Runs(list[Result]):
    """A list of runs. `runs["arm"]` is the list of the column "arm" of each run."""

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, str):
            return [run[key] for run in self]
        found = super().__getitem__(key)
        return Runs(found) if isinstance(key, slice) else found

    def __getattr__(self, name: str) -> Any:
        """Refuse the attributes of a run."""
        text = f"the runs of a batch have no attribute '{name}'"
        if name in Result.__dataclass_fields__ or hasattr(Result, name):
            text += f"; each of them has: [run.{name} for run in runs]"
        raise AttributeError(text)

    def __repr__(self) -> str:
        first = f", the first {self[0]!r}" if self else ""
        return f"<Runs: {len(self)}{first}>"
