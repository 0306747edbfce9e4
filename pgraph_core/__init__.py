"""Pgraph: multibody dynamics from a four-column table. The public names, nothing else."""

from .errors import FileError as FileError
from .errors import InputError as InputError
from .errors import ModelError as ModelError
from .errors import PgraphError as PgraphError
from .errors import Problem as Problem
from .operators import home_poses as home_poses
from .schema import Body as Body
from .schema import Constraint as Constraint
from .schema import Force as Force
from .schema import Model as Model
from .schema import Scenario as Scenario
from .schema import Shape as Shape
from .schema import Table as Table
from .topology import Topology as Topology
from .topology import jdof_of as jdof_of
from .topology import parent_of as parent_of
from .topology import pgraph_of as pgraph_of
