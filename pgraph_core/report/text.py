"""A study as text: a table, the orders, the recommendation, and what to know beside them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..errors import InputError
from .rows import Row

if TYPE_CHECKING:
    from .study import Study

HEADER = (
    "method", "setting", "error", "digits", "at the end", "largest", "energy", "constraints",
    "steps", "evaluations", "time", "quartiles", "us/step", "x real", "ratio", "",
)  # fmt: skip
WORDS = (0, 1, len(HEADER) - 1)  # columns that stand to the left
SHOWN = (0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 14, 15)  # on a terminal


def table(study: Study) -> str:
    """Everything that a person reads on a terminal."""
    cells = [[row[i] for i in SHOWN] for row in (HEADER, *map(cells_of, study.rows))]
    left = [i in WORDS for i in SHOWN]
    rows = peers(study)
    beside = ["", *aligned(rows, [i < 2 for i in range(len(rows[0]))])] if rows else []
    return "\n".join((*head(study), "", *aligned(cells, left), *beside, "", *foot(study)))


def aligned(cells: list[list[str]], left: list[bool]) -> list[str]:
    """Lines in columns."""
    widths = [max(len(row[i]) for row in cells) for i in range(len(left))]
    lines = []
    for row in cells:
        parts = (x.ljust(w) if to else x.rjust(w) for x, w, to in zip(row, widths, left))
        lines.append("  ".join(parts).rstrip())
    return lines


def cells_of(row: Row) -> tuple[str, ...]:
    """One row of the table, under HEADER."""
    counters, seconds, drift = row.counters or {}, row.seconds, row.constraint_drift
    return (
        row.method,
        str(row.setting),
        _e(row.error),
        digits(row),
        _e(row.error_end),
        _e(row.error_max),
        _e(row.energy_drift),
        _e(drift[0]) if drift and max(drift) > 0 else "",
        *(str(counters.get(name, "")) for name in ("steps", "evaluations")),
        duration(seconds[1]) if seconds else "",
        f"{duration(seconds[0])} .. {duration(seconds[2])}" if seconds else "",
        _g(row.us_per_step),
        _g(row.real_time_factor),
        _g(row.ratio[1] if row.ratio else None),
        row.reason or ("reference limit" if row.limited else ""),
    )


def digits(row: Row) -> str:
    """Digits that are right; at the reference's limit at least so many."""
    if row.digits is None:
        return ""
    return f">= {row.digits:.0f}" if row.limited else f"{row.digits:.1f}"


def duration(seconds: float) -> str:
    """A time with its unit."""
    if seconds < 1e-3:
        return f"{1e6 * seconds:.3g} us"
    return f"{1e3 * seconds:.3g} ms" if seconds < 1.0 else f"{seconds:.3g} s"


def head(study: Study) -> tuple[str, ...]:
    """What was compared, against what, on which machine."""
    scenario = f", scenario {study.scenario}" if study.scenario else ""
    given = study.reference
    return (
        f"{study.name}{scenario}: error against run time over {study.t_end:.6g} s at "
        f"{study.frames} times",
        f"reference        {given['source']}, good to {given['accuracy']:.1e}; errors below "
        f"{given['limit']:.1e} are not told apart",
        f"machine          {study.machine['cpu']}, one thread, medians of {study.rounds} rounds, "
        f"{study.clock} time",
    )


def foot(study: Study) -> tuple[str, ...]:
    """Orders, the recommendation, notes, times of the study."""
    orders = (
        f"{name} {'none seen' if seen is None else f'{seen:.2f}'} ({claimed:g})"
        for name, (seen, claimed) in study.orders.items()
    )
    spent = (f"{name} {duration(seconds)}" for name, seconds in study.timing.items() if seconds)
    return (
        f"observed orders  {', '.join(orders)}",
        *(f"recommended      {line}" for line in [advice(study)] if line),
        *(f"left out         {line}" for line in study.left_out),
        *(f"note             {line}" for line in study.notes),
        f"time             {', '.join(spent)}",
        *(["CANCELLED: rows that were not measured are missing"] if study.cancelled else []),
    )


def advice(study: Study) -> str:
    """The cheapest setting for the target, in words; "" without a target."""
    if study.target is None:
        return ""
    try:
        row = study.recommend()
    except InputError as unmet:
        return unmet.problems[0].text
    took = duration(row.time or 0.0)
    return f"{row.method}, {row.setting}: error {row.error:.1e} in {took} for {study.target:g}"


def peers(study: Study) -> list[list[str]]:
    """Times at equal error: ours, and of each peer with how many times longer it takes."""
    found = study.against_peers()
    if not found:
        return []
    names = list(dict.fromkeys(row["peer"] for row in found))
    cells = [["at equal error", "ours", "time", *names]]
    for level in dict.fromkeys(row["error"] for row in found):
        mine = {row["peer"]: row for row in found if row["error"] == level}
        ours = next(iter(mine.values()))
        theirs = (
            f"{duration(mine[n]['peer_seconds'])} ({mine[n]['ratio']:.3g} x)" if n in mine else "-"
            for n in names
        )
        cells.append([f"{level:.0e}", ours["ours"], duration(ours["seconds"]), *theirs])
    return cells


def _e(value: float | None) -> str:
    return "" if value is None else f"{value:.1e}"


def _g(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"
