"""Imperfections of sensors: sampling, delay, noise, drift, resolution and range."""

from __future__ import annotations

from typing import Self

from pydantic import model_validator

from ..fields import Frozen, Number, Whole, field, refuse
from ..units import S

MOST_SEEDS = 1 << 53  # whole numbers that every program keeps


class Imperfect(Frozen):
    """The imperfections of an `Output`, whose samples are in `run.measured[name]`.

    Sample k is taken at t = k `sample` from the value x at t - `latency`. It is the value
    x + `offset` + bias + walk + noise, limited to [`low`, `high`] and then rounded to a multiple of
    `quantum`. The unit U is that of the output. White noise of a density N [U/√Hz] has the standard
    deviation N/√sample. The bias is a first-order Gauss-Markov process of standard deviation `bias`
    [U] and of the time constant `correlation`, and the walk is the integral of white noise, which
    grows as `walk` √t [U]. All numbers are functions of `seed`, the output's name, the component
    and k. They do not depend on the method, the step or the processor.

    Examples
    --------
    A gyroscope that is read 200 times a second:

        gyro = pg.Imperfect(sample=0.005, latency=0.002, density=1e-4, bias=2e-5, correlation=300.0)
        model = model.add(pg.Output(name="gyro", kind="gyro", at="arm", imperfect=gyro))
        run = pg.simulate(model, t_end=1.0)
        run.measured["gyro"].t, run.measured["gyro"].value
    """

    sample: Number = field("a time > 0 [s]", gt=0, dim=S, help="time between samples")
    latency: Number = field(
        "a time >= 0 [s]", default=0.0, ge=0, dim=S, help="age of the value that a sample has"
    )
    density: Number = field(
        "a number >= 0 [unit/√Hz]", default=0.0, ge=0, help="density of white noise"
    )
    bias: Number = field(
        "a number >= 0 [unit]", default=0.0, ge=0, help="standard deviation of a slow bias"
    )
    correlation: Number | None = field(
        "a time > 0 [s]", default=None, gt=0, dim=S, help="time constant of the bias"
    )
    walk: Number = field(
        "a number >= 0 [unit/√s]", default=0.0, ge=0, help="growth of a random walk"
    )
    offset: Number = field("a number [unit]", default=0.0, help="constant error")
    quantum: Number = field("a number >= 0 [unit]", default=0.0, ge=0, help="resolution")
    low: Number | None = field("a number [unit]", default=None, help="least value")
    high: Number | None = field("a number [unit]", default=None, help="largest value")
    seed: Whole = field(
        "a whole number >= 0", default=0, ge=0, le=MOST_SEEDS, help="of the random numbers"
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        found = list[tuple[str, str]]()
        if self.low is not None and self.high is not None and self.low >= self.high:
            found.append(("low", f"must be below high = {self.high:g}, got {self.low:g}"))
        if self.bias and self.correlation is None:
            found.append(("correlation", "is needed by a bias, whose time constant it is [s]"))
        if self.correlation is not None and self.correlation < self.sample:
            text = f"must be at least sample = {self.sample:g} s, got {self.correlation:g} s; a "
            found.append(("correlation", f"{text}bias that changes faster is white noise"))
        refuse(found)
        return self

    @property
    def random(self) -> bool:
        """Return True if samples have random errors."""
        return bool(self.density or self.bias or self.walk)
