"""Pgraph: multibody dynamics from a four-column table. `dir(pgraph_core)` lists the public names.

A name's module is imported when the name is first used: describing, checking and numbering a model
starts no compiler, and a pendulum loads no contact, gait or study module.

Each method of a model or a mechanism can also be called as a function. For example,
`pg.mass_matrix(model, q)` is the same as `pg.Mechanism(model).mass_matrix(q)`.
"""

import inspect
from functools import partial, wraps
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from . import hooks

if TYPE_CHECKING:
    from .analysis.activations import Activations as Activations
    from .analysis.assembly import Assembly as Assembly
    from .analysis.feedback import Feedback as Feedback
    from .analysis.feedback import lqr as lqr
    from .analysis.feedback import place_poles as place_poles
    from .analysis.kalman import Kalman as Kalman
    from .analysis.kalman import kalman as kalman
    from .analysis.mobility import Mobility as Mobility
    from .batches.batch_stepper import BatchStepper as BatchStepper
    from .capture.identify import Inertias as Inertias
    from .capture.identify import identify_inertia as identify_inertia
    from .capture.moments import Moments as Moments
    from .capture.moments import joint_moments as joint_moments
    from .capture.reading import read_trial as read_trial
    from .capture.scaling import Scaling as Scaling
    from .capture.scaling import scale as scale
    from .capture.tracking import Tracking as Tracking
    from .capture.tracking import track as track
    from .capture.trial import Plate as Plate
    from .capture.trial import Trial as Trial
    from .errors import FileError as FileError
    from .errors import InputError as InputError
    from .errors import ModelError as ModelError
    from .errors import PgraphError as PgraphError
    from .errors import Problem as Problem
    from .forces import Bushing as Bushing
    from .forces import LinearActuator as LinearActuator
    from .forces import Lines as Lines
    from .forces import Shift as Shift
    from .forces import Strut as Strut
    from .forces import Via as Via
    from .forces import Within as Within
    from .formats import load as load
    from .formats.conversion import Report as Report
    from .formats.mjcf import read_mjcf as read_mjcf
    from .formats.mjcf_out import write_mjcf as write_mjcf
    from .formats.osim import read_osim as read_osim
    from .formats.step import read_step as read_step
    from .formats.step_joints import Proposal as Proposal
    from .formats.urdf import read_urdf as read_urdf
    from .formats.urdf_out import write_urdf as write_urdf
    from .gait.controller import Controller as Controller
    from .gait.footing import Footprint as Footprint
    from .gait.footing import footprints as footprints
    from .gait.footing import gaits as gaits
    from .gait.footing import underfoot as underfoot
    from .mechanism import Mechanism as Mechanism
    from .model import PID as PID
    from .model import Actuator as Actuator
    from .model import Beam as Beam
    from .model import Body as Body
    from .model import Cable as Cable
    from .model import Cam as Cam
    from .model import CamSegment as CamSegment
    from .model import Constraint as Constraint
    from .model import Contact as Contact
    from .model import Control as Control
    from .model import Coupling as Coupling
    from .model import Curve as Curve
    from .model import CurvePoint as CurvePoint
    from .model import Cylindrical as Cylindrical
    from .model import Distance as Distance
    from .model import Drag as Drag
    from .model import Filter as Filter
    from .model import Footfall as Footfall
    from .model import Force as Force
    from .model import Gains as Gains
    from .model import Gait as Gait
    from .model import Gear as Gear
    from .model import Ground as Ground
    from .model import Imperfect as Imperfect
    from .model import Line as Line
    from .model import Model as Model
    from .model import Motion as Motion
    from .model import Motor as Motor
    from .model import Muscle as Muscle
    from .model import Orientation as Orientation
    from .model import Output as Output
    from .model import Plane as Plane
    from .model import Point as Point
    from .model import Polynomial as Polynomial
    from .model import Prismatic as Prismatic
    from .model import Relation as Relation
    from .model import Revolute as Revolute
    from .model import Rolling as Rolling
    from .model import Rope as Rope
    from .model import Sampled as Sampled
    from .model import Scenario as Scenario
    from .model import Servo as Servo
    from .model import Shape as Shape
    from .model import Sine as Sine
    from .model import Site as Site
    from .model import Skate as Skate
    from .model import SpeedServo as SpeedServo
    from .model import Spring as Spring
    from .model import State as State
    from .model import Step as Step
    from .model import Switch as Switch
    from .model import Table as Table
    from .model import Tendon as Tendon
    from .model import Torsion as Torsion
    from .model import Universal as Universal
    from .model import VectorTable as VectorTable
    from .model import Velocity as Velocity
    from .model import Weld as Weld
    from .model import Wrench as Wrench
    from .model.links import link as link
    from .model.rope import belt as belt
    from .native.reading import Fmu as Fmu
    from .native.reading import read_fmu as read_fmu
    from .native.writing import write_c as write_c
    from .native.writing import write_fmu as write_fmu
    from .paper import home_poses as home_poses
    from .paper.frame_update import frame_update_trace as frame_update_trace
    from .pulleys import Pulley as Pulley
    from .result import Result as Result
    from .result import Status as Status
    from .result.joining import joined as joined
    from .search.fit import Fit as Fit
    from .search.fit import fit as fit
    from .search.optimise import Optimum as Optimum
    from .search.optimise import optimise as optimise
    from .simulation import simulate as simulate
    from .simulation import simulate_batch as simulate_batch
    from .simulation.stepper import Stepper as Stepper
    from .simulation.walk import Walk as Walk
    from .study.map import StabilityMap as StabilityMap
    from .study.precision import work_precision as work_precision
    from .study.reference import Reference as Reference
    from .study.report import Study as Study
    from .study.stability import stability_map as stability_map
    from .sweeps.sweep import Sweep as Sweep
    from .sweeps.sweep import sweep as sweep
    from .topology import Topology as Topology
    from .topology import jdof_of as jdof_of
    from .topology import parent_of as parent_of
    from .topology import pgraph_of as pgraph_of
    from .tracks import Track as Track
    from .verification import Case as Case
    from .verification import Verdict as Verdict
    from .verification import load_cases as load_cases
    from .verification import verify as verify

with open(__file__, encoding="utf-8") as _source:
    _IMPORTS = [line.split() for line in _source if line.startswith("    from .")]
# {public name: its module}, from the imports above, which are for type checkers
_HOME = {words[3]: words[1][1:] for words in _IMPORTS if words[4:5] == ["as"]}
# objects of the main classes, as they are made
_SHOWN = {
    "Model": "model", "Mechanism": "pg.Mechanism(model)", "Result": "run", "Stepper": "stepper",
}  # fmt: skip
_TAKERS = (
    "Contact", "Ground", "Body", "Model", "simulate", "Shape", "Motor", "Servo", "PID", "Spring",
    "Torsion", "Tendon", "Bushing", "Scenario", "sweep",
)  # fmt: skip
__all__ = sorted(_HOME)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        value: Any = import_module(".portable", __name__).installed()
    elif name in _HOME:
        value = getattr(import_module(f".{_HOME[name]}", __name__), name)
    elif name == "gym":
        value = import_module(".gym", __name__)
    else:
        from .words import NoAttribute, same_attribute

        ours = same_attribute(name)
        value = __getattr__(ours) if ours in _HOME else _of_method(ours) or _of_shape(name)
        if not value:
            raise NoAttribute("module 'pgraph_core'", name, lambda: _HOME)
    globals()[name] = value
    return value


def _of_method(name: str) -> Any:
    """Return a function whose first argument is the model or mechanism, or None if there is no such
    method."""
    if name[0] == "_" or find_spec(f"{__name__}.{name}"):
        return None  # an import asks for its module here
    kinds = (__getattr__("Model"), __getattr__("Mechanism"))
    methods = [each for kind in kinds if inspect.isfunction(each := getattr(kind, name, None))]
    if not methods:
        return None

    from .mechanism import mechanism_of

    @wraps(methods[0])
    def call(model: Any, /, *args: Any, **named: Any) -> Any:
        own = type(model) is kinds[0] and hasattr(kinds[0], name)
        return getattr(model if own else mechanism_of(model, name), name)(*args, **named)

    return call


def _of_shape(name: str) -> Any:
    """Return a function that makes the shape of a kind, such as Sphere, or None."""
    if not name[0].isupper():
        return None
    from .shapes import KINDS
    from .words import chosen

    if not (kind := chosen(name, KINDS)):
        return None
    names = KINDS[kind].needs

    def shape(*size: Any, **fields: Any) -> Any:
        """Return the shape of this kind, with its size by position or by name."""
        size = (size,) if len(names) == 1 and len(size) == 3 else size
        return __getattr__("Shape")(kind, **dict(zip(names, size, strict=False)), **fields)

    return shape


def _elsewhere() -> dict[str, str]:
    """Return the prefix of each public name and of each attribute of the main classes."""
    found = dict.fromkeys(_HOME, "pg.")
    for owner, shown in _SHOWN.items():
        found |= {name: f"{shown}." for name in dir(__getattr__(owner)) if name[0] != "_"} | found
    return found


def _bound(owner: Any, name: str) -> Any:
    """Return a method of the mechanism, or a function that takes a model first, for a model.

    Return the function that loads a model of any format, if called on the class.
    """
    from .words import same_attribute

    if isinstance(owner, type):
        loads = owner.__name__ == "Model" and same_attribute(name) == "load"
        return __getattr__("load") if loads else None
    kind = type(owner).__name__
    if type(owner).__module__.split(".")[0] != __name__ or kind not in ("Model", "Mechanism"):
        return None
    ours = __getattr__(name) if name in _HOME else None
    if inspect.isfunction(ours):
        first = next(iter(inspect.signature(ours).parameters.values()))
        if any(each.__name__ in str(first.annotation) for each in type(owner).__mro__):
            return partial(ours, owner)
    if kind != "Model":
        return None
    from .mechanism import mechanism_of

    return getattr(mechanism_of(owner, name), name, None)


def _taken(name: str, given: Any = ()) -> str:
    """Return the calls that accept a field or an argument, with their units, or "" if none does.

    Those of which a model among the arguments `given` has a part come first.
    """
    from .fields import about
    from .words import ours

    known = {taker: inspect.signature(__getattr__(taker)).parameters for taker in _TAKERS}
    found = [(taker, name) for taker in known if name in known[taker]]
    found = found or [(taker, own) for taker in known if (own := ours(name, known[taker]))]
    models = [model for x in given if hasattr(model := getattr(x, "model", x), "bodies")]
    held = [parts for model in models for _, parts in model if isinstance(parts, tuple)]
    present = {type(part).__name__ for parts in held for part in parts}
    present |= {"Ground"} if "Contact" in present else set()
    said = list[str]()
    for taker, own in sorted(found, key=lambda pair: pair[0] not in present):
        fields = getattr(__getattr__(taker), "model_fields", {})
        unit = about(fields[own], own).unit if own in fields else ""
        said.append(f"pg.{taker}(..., {own}=...)" + f" [{unit}]" * bool(unit))
    return " or ".join(said)


def _passed(name: str) -> bool:
    """Check whether a function that passes arguments on to `simulate` takes this one."""
    from .words import ours

    known = inspect.signature(__getattr__("simulate")).parameters
    return name in known or bool(ours(name, known))


def _page(run: Any, fields: Any = (), live: bool = True) -> str:
    """Return the page of a figure, which reruns the mechanism if it is live."""
    from .live.export import page

    return page(run, fields, live)


def _edited(model: Any, path: Any, number: tuple[Any, ...], fields: Any) -> Any:
    """Return a model with other numbers at paths."""
    from .simulation.paths import edited

    return edited(model, path, number, fields)


hooks.page = _page
hooks.edited = _edited
hooks.elsewhere = _elsewhere
hooks.bound = _bound
hooks.taken = _taken
hooks.passed = _passed


def __dir__() -> list[str]:
    return list(__all__)
