"""Commands for motion capture: `pgraph track` and `pgraph moments`."""

from __future__ import annotations

from argparse import ArgumentTypeError, Namespace
from typing import Any

import numpy as np

import pgraph_core as pg
from pgraph_core.errors import FileError, Problem

from .terminal import MODEL, Answer, command, open_model, positive, progress_bar, takes


def pair(text: str) -> tuple[str, str]:
    """Parse NAME=VALUE."""
    name, _, value = text.rpartition("=")
    if not name or not value:
        raise ArgumentTypeError(f"must be NAME=VALUE, got {text!r}")
    return name, value


def weight(text: str) -> tuple[str, float]:
    """Parse SITE=NUMBER."""
    name, value = pair(text)
    try:
        return name, float(value)
    except ValueError:
        raise ArgumentTypeError(f"must be SITE=NUMBER, got {text!r}") from None


TRIAL = (
    *MODEL,
    takes("trial", metavar="TRIAL", help="markers: .c3d, .trc or .csv; coordinates: .mot or .sto"),
    takes("--forces", metavar="FILE", help="another file with the force plates, such as .mot"),
    takes("--up", choices=("x", "y", "z"), help="vertical axis of the file; default: by plates"),
    takes("--units", choices=("m", "cm", "mm"), help="unit of the markers; default: of the file"),
    takes("--weight", type=weight, action="append", default=[], metavar="SITE=NUMBER",
          help="weight of a site, by default 1; may be repeated"),
    takes("--marker", type=pair, action="append", default=[], metavar="SITE=LABEL",
          help="label of a site's marker with another name; may be repeated"),
    takes("--smooth", action="store_true", help="fit all frames at once, by cross-validation"),
    takes("-o", "--output", metavar="FILE", help="write the table to FILE: .csv"),
)  # fmt: skip


def _tracked(args: Namespace, bar: Any) -> tuple[pg.Mechanism, pg.Tracking | pg.Trial]:
    """Return the mechanism and its motion. Raises PgraphError."""
    if args.output and not args.output.lower().endswith(".csv"):
        raise FileError(Problem(args.output, "", "must end in .csv (a table)"))
    mech = pg.Mechanism(open_model(args))
    trial = pg.read_trial(args.trial, forces=args.forces, up=args.up, units=args.units)
    if not trial.markers and trial.coordinates:
        return mech, trial
    fit = pg.track(
        mech, trial, weights=dict(args.weight), markers=dict(args.marker),
        smooth=True if args.smooth else None, progress=lambda x: bar("tracking", x),
    )  # fmt: skip
    return mech, fit


def _written(args: Namespace, table: Any, text: str) -> str:
    if args.output:
        table.to_csv(args.output)
        text += f"\nwritten to {args.output}"
    return text


def _plain(text: str) -> str:
    """Return the text of an object without its angle brackets."""
    return text.removeprefix("<").removesuffix(">")


@command("track", "find the motion of a model that follows markers", *TRIAL)
def track(args: Namespace) -> Answer:
    bar = progress_bar()
    mech, fit = _tracked(args, bar)
    bar("", 1.0)
    if not isinstance(fit, pg.Tracking):
        raise FileError(Problem(args.trial, "", "has no markers; pgraph moments takes coordinates"))
    data = {
        "model": mech.model.name, "frames": len(fit.t), "markers": fit.markers,
        "rms": float(np.sqrt(np.nanmean(fit.residual**2))), "gradient": fit.gradient.max(),
        "undetermined": fit.undetermined, "report": fit.report, "output": args.output,
    }  # fmt: skip
    return Answer(data, _written(args, fit, _plain(repr(fit))))


@command(
    "moments",
    "compute joint moments of a trial with force plates",
    *TRIAL,
    takes("--plate", type=pair, action="append", default=[], metavar="PLATE=BODY",
          help="body that a plate bears; default: the nearest while it is loaded"),
    takes("--cutoff", type=positive, metavar="HZ", help="of the filter; default: 6"),
    takes("--band", action="store_true", help="compute the 95 %% band"),
)  # fmt: skip
def moments(args: Namespace) -> Answer:
    bar = progress_bar()
    mech, fit = _tracked(args, bar)
    loads = pg.joint_moments(
        mech, fit, plates=dict(args.plate) or "auto", cutoff=args.cutoff, band=args.band,
        progress=lambda x: bar("moments", x),
    )  # fmt: skip
    bar("", 1.0)
    most = {name: float(np.abs(loads[name]).max()) for name in loads.names}
    data = {
        "model": mech.model.name, "frames": len(loads.t), "largest": most, "bears": loads.bears,
        "residual": {x: float(np.abs(s).max()) for x, s in zip(loads.residual, loads.share.T)},
        "report": (*fit.report, *loads.report), "output": args.output,
    }  # fmt: skip
    lines = [_plain(repr(loads)), *fit.report]
    return Answer(data, _written(args, loads, "\n  ".join(lines)))
