"""Rows of benchmarks as text, Markdown, CSV and JSON, and compared with an earlier run."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any

from pgraph_core.study import figures

from .measure import Row

Found = Mapping[str, Any]  # {"machine": {...}, "benchmarks": {name: [row, ...]}}
TIMES = ("seconds", "low", "high")
FALL = 0.25  # of a ratio, which counts as slower: two shared cores move a median by less


def text(found: Found) -> str:
    """Tables for a terminal."""
    parts = [f"measured on {machine(found)}"]
    for name, rows in found["benchmarks"].items():
        parts.append(name)
        for cells in tables(rows):
            lines = figures.aligned(cells, [True] * len(cells[0]))
            parts.append("\n".join(f"  {line}" for line in lines))
    return "\n\n".join(parts)


def markdown(found: Found) -> str:
    """Tables for the documents."""
    parts = [f"Measured on {machine(found)}."]
    for name, rows in found["benchmarks"].items():
        parts.append(f"## {name}")
        for header, *cells in tables(rows):
            lines = (header, ["---"] * len(header), *cells)
            parts.append("\n".join(f"| {' | '.join(line)} |" for line in lines))
    return "\n\n".join(parts) + "\n"


def in_csv(found: Found) -> str:
    """One table of all rows: columns that a row lacks are empty."""
    rows = [
        {"benchmark": name, **row} for name, some in found["benchmarks"].items() for row in some
    ]
    columns = list(dict.fromkeys(key for row in rows for key in row))
    out = io.StringIO()
    writer = csv.DictWriter(out, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return out.getvalue()


def in_json(found: Found) -> str:
    """All that is known."""
    return json.dumps(found, indent=1) + "\n"


WRITERS = {".md": markdown, ".csv": in_csv, ".json": in_json, ".txt": text}


def machine(found: Found) -> str:
    """One line."""
    about = dict(found["machine"])
    return ", ".join([about.pop("cpu"), *(f"{key} {value}" for key, value in about.items())])


def tables(rows: Sequence[Row]) -> Iterator[list[list[str]]]:
    """Rows of the same columns as one table of texts, its header first; a case is named once."""
    for columns, some in groupby(rows, key=lambda row: tuple(row)):
        several, last = list(some), None
        kept = [c for c in columns if any(row[c] not in (None, "") for row in several)]
        cells = [[c for c in kept if c != "high"]]
        for row in several:
            line = [_cell(row, column) for column in cells[0]]
            if cells[0][0] == "case":
                line[0] = "" if row["case"] == last else line[0]
                last = row["case"]
            cells.append(line)
        cells[0] = ["quartiles" if c == "low" else "time" if c == "seconds" else c
                    for c in cells[0]]  # fmt: skip
        yield cells


def _cell(row: Row, column: str) -> str:
    value = row[column]
    if value is None:
        return ""
    if column == "low":
        return f"{duration(value)} - {duration(row['high'])}"
    if column in TIMES:
        return duration(value)
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def duration(seconds: float) -> str:
    """A time with its unit."""
    for name, scale in (("us", 1e6), ("ms", 1e3)):
        if seconds * scale < 1000:
            return f"{seconds * scale:.3g} {name}"
    return f"{seconds:.3g} s"


def fallen(now: Found, then: Found, fall: float = FALL) -> list[str]:
    """A sentence for every ratio that is more than `fall` below that of an earlier run."""
    before = _ratios(then)
    wrong = [
        f"{name}: the ratio fell from {before[name]:.3g} to {ratio:.3g}"
        for name, ratio in _ratios(now).items()
        if name in before and ratio < (1 - fall) * before[name]
    ]
    if wrong and then["machine"]["cpu"] != now["machine"]["cpu"]:
        wrong.append(f"the earlier run was on {then['machine']['cpu']}")
    return wrong


def _ratios(found: Found) -> dict[str, float]:
    """Ratios to peers by benchmark, case and side."""
    return {
        f"{name}, {row['case']}, {row['by']}": row["ratio"]
        for name, rows in found["benchmarks"].items()
        for row in rows
        if row.get("ratio") and not str(row.get("by", "pgraph")).startswith("pgraph")
    }
