"""Pgraph: multibody dynamics from a four-column table. The public names, nothing else.

Names that need compiled code are imported when first used: describing, checking and numbering a
model costs no start of the compiler.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .errors import FileError as FileError
from .errors import InputError as InputError
from .errors import ModelError as ModelError
from .errors import PgraphError as PgraphError
from .errors import Problem as Problem
from .model import Body as Body
from .model import Constraint as Constraint
from .model import Contact as Contact
from .model import Footfall as Footfall
from .model import Force as Force
from .model import Gains as Gains
from .model import Gait as Gait
from .model import Ground as Ground
from .model import Model as Model
from .model import Polynomial as Polynomial
from .model import Scenario as Scenario
from .model import Shape as Shape
from .model import Sine as Sine
from .model import Step as Step
from .model import Switch as Switch
from .model import Table as Table
from .model import VectorTable as VectorTable
from .plan import Plan as Plan
from .topology import Topology as Topology
from .topology import jdof_of as jdof_of
from .topology import parent_of as parent_of
from .topology import pgraph_of as pgraph_of

if TYPE_CHECKING:
    from .columns import Columns as Columns
    from .constraints.assembly import Assembly as Assembly
    from .constraints.mobility import Mobility as Mobility
    from .gait.controller import Controller as Controller
    from .gait.footprints import Footprint as Footprint
    from .gait.footprints import footprints as footprints
    from .gait.footprints import footprints_csv as footprints_csv
    from .gait.ground import underfoot as underfoot
    from .gait.presets import gaits as gaits
    from .mechanism import Mechanism as Mechanism
    from .mechanism.batch import Batch as Batch
    from .paper import home_poses as home_poses
    from .paper.frame_update import frame_update_trace as frame_update_trace
    from .result import Result as Result
    from .result import Status as Status
    from .result.result import joined as joined
    from .simulation import simulate as simulate
    from .simulation.batches import BatchResult as BatchResult
    from .simulation.batches import simulate_batch as simulate_batch
    from .simulation.walk import Walk as Walk
    from .study.map import StabilityMap as StabilityMap
    from .study.reference import Reference as Reference
    from .study.stability import stability_map as stability_map
    from .study.study import Study as Study
    from .study.work_precision import work_precision as work_precision
    from .verification import Case as Case
    from .verification import Verdict as Verdict
    from .verification import load_cases as load_cases
    from .verification import verify as verify

_LAZY = {
    "Assembly": "constraints.assembly",
    "Batch": "mechanism.batch",
    "BatchResult": "simulation.batches",
    "simulate_batch": "simulation.batches",
    "Case": "verification",
    "Verdict": "verification",
    "load_cases": "verification",
    "verify": "verification",
    "Columns": "columns",
    "frame_update_trace": "paper.frame_update",
    "Controller": "gait.controller",
    "gaits": "gait.presets",
    "Footprint": "gait.footprints",
    "footprints": "gait.footprints",
    "footprints_csv": "gait.footprints",
    "underfoot": "gait.ground",
    "Walk": "simulation.walk",
    "joined": "result.result",
    "Mechanism": "mechanism",
    "Mobility": "constraints.mobility",
    "home_poses": "paper",
    "work_precision": "study.work_precision",
    "Reference": "study.reference",
    "Study": "study.study",
    "Result": "result",
    "Status": "result",
    "simulate": "simulation",
    "StabilityMap": "study.map",
    "stability_map": "study.stability",
}


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module 'pgraph_core' has no attribute '{name}'")
    value = getattr(import_module(f".{_LAZY[name]}", __name__), name)
    globals()[name] = value
    return value
