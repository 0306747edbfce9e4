"""The description of a multibody system: frozen, validated, with every problem said at once."""

from .body import Body as Body
from .body import Shape as Shape
from .constraint import Constraint as Constraint
from .contact import Contact as Contact
from .curves import Polynomial as Polynomial
from .curves import Sine as Sine
from .curves import Table as Table
from .curves import VectorTable as VectorTable
from .force import Force as Force
from .gait import Footfall as Footfall
from .gait import Gains as Gains
from .gait import Gait as Gait
from .model import Model as Model
from .scenario import Scenario as Scenario
from .scenario import Switch as Switch
from .world import Ground as Ground
from .world import Step as Step
