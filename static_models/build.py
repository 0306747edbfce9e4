"""Writes the files of the built-in models: `python -m pgraph_models.build`, by hand."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import wraps
from pathlib import Path

import pgraph_core as pg

from . import FOLDER
from .classics import (
    andrews,
    bricard,
    falling_rod,
    four_bar,
    four_bar_windows,
    heavy_top,
    rolling_disc,
    skate,
    slider_crank,
    spherical_pendulum,
    tennis_racket,
)
from .looks import STEEL, Vector, bar, hub, machine
from .quadruped import quadruped, quadruped_hips
from .quadruped_muscles import quadruped_muscles

BUILDERS: dict[str, Callable[[], pg.Model]] = {}


def built(builder: Callable[[], pg.Model]) -> Callable[[], pg.Model]:
    """A builder of a model that is drawn as a machine."""
    BUILDERS[builder.__name__] = wraps(builder)(lambda: machine(builder()))
    return builder


@built
def pendulum() -> pg.Model:
    """One rod on a hinge, let go at 60 degrees."""
    rods = (_hanging_rod("rod", "ground", link=(0, 0, 1.2), q=1.0471975512),)
    return pg.Model(name="pendulum", bodies=rods, scenarios=(_swing("one swing after another"),))


@built
def stiff_pendulum() -> pg.Model:
    """A point mass on a spring as stiff as a steel rod, let go where the spring carries it."""
    stiffness, angle = 1e6, 1.0
    bob = pg.Body(
        name="bob",
        joint="compound",
        motions=(("rotate", (0, 1, 0)), ("translate", (0, 0, -1))),
        link=(0, 0, 1.5),
        com=(0, 0, -1),
        inertia=((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        stiffness=(0.0, stiffness),
        q=(angle, 9.81 * math.cos(angle) / stiffness),
        shapes=(
            pg.Shape(kind="sphere", radius=0.08, position=(0, 0, -1)),
            hub((0, 0, 1), radius=0.012, length=1.0, colour=STEEL, at=(0, 0, -0.5)),
            hub((0, 1, 0), radius=0.03, length=0.1),
        ),
    )
    swing = pg.Scenario(
        name="swing", description="two seconds at steps far wider than the spring's period",
        t_end=2.0, step=0.01,
    )  # fmt: skip
    return pg.Model(name="stiff pendulum", bodies=(bob,), scenarios=(swing,))


@built
def double_pendulum() -> pg.Model:
    """Two rods, let go high enough to be chaotic."""
    rods = (
        _hanging_rod("upper", "ground", link=(0, 0, 2.2), q=1.5),
        _hanging_rod("lower", "upper", link=(0, 0, -1), q=0.5),
    )
    scenario = _swing("chaotic: small errors grow until two runs differ")
    return pg.Model(name="double pendulum", bodies=rods, scenarios=(scenario,))


@built
def fig1_tree() -> pg.Model:
    """The tree of the paper's fig. 1, spread out and hanging from its root."""
    model = pg.Model.serial(7)
    model = model.edit("4", parent="2").edit("5", parent="3").edit("6", parent="2")
    angles = {"1": 1.2, "3": -0.7, "4": 0.1, "5": -0.3, "6": 0.9, "7": 0.3}
    for name, angle in angles.items():
        model = model.edit(name, q=angle)
    scenario = _swing("the whole tree swings from body 1")
    return _with_bars(model.edit("1", link=(0, 0, 1.2)), "fig. 1 tree", scenario)


@built
def chain_10() -> pg.Model:
    """Ten links, let go from a gentle slope."""
    model = pg.Model.serial(10).edit("1", q=0.3, link=(0, 0, 2.2))
    return _with_bars(model, "chain of 10", _swing("the chain falls and whips"))


for _walker in (quadruped, quadruped_hips, quadruped_muscles):
    BUILDERS[_walker.__name__] = _walker
for _machine in (four_bar, slider_crank, bricard, andrews, rolling_disc, heavy_top, tennis_racket,
                 spherical_pendulum, skate, falling_rod, four_bar_windows):  # fmt: skip
    built(_machine)


def _hanging_rod(name: str, parent: str, link: Vector, q: float) -> pg.Body:
    """A uniform rod of 1 m and 1 kg along -z, hinged about y at its upper end."""
    return pg.Body(
        name=name,
        parent=parent,
        axes=((0, 1, 0),),
        link=link,
        com=(0, 0, -0.5),
        inertia=((1 / 12, 0, 0), (0, 1 / 12, 0), (0, 0, 1.25e-3)),
        tip=(0, 0, -1),
        q=(q,),
        shape=bar((0, 0, -1), radius=0.05),
    )


def _swing(description: str) -> pg.Scenario:
    return pg.Scenario(name="swing", description=description, t_end=5.0, step=1e-3, method="rk4")


def _with_bars(model: pg.Model, name: str, scenario: pg.Scenario) -> pg.Model:
    for body in model.bodies:
        model = model.edit(body.name, shape=bar(body.tip_point, radius=0.02))
    return model.replace(name=name, scenarios=(scenario,))


def write(folder: Path = FOLDER) -> None:
    """Build every model and write its file."""
    for name, builder in BUILDERS.items():
        builder().save(folder / f"{name}.json")


if __name__ == "__main__":
    write()
