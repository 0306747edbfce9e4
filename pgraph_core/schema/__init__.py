"""The description of a multibody system: frozen, validated, with every problem said at once."""

from .body import Body as Body
from .body import Shape as Shape
from .constraint import Constraint as Constraint
from .force import Force as Force
from .force import Table as Table
from .model import Model as Model
from .model import Scenario as Scenario
