"""The integration methods as data: their tableaus, kernels and uses."""

from .integrators import DOP853 as DOP853
from .integrators import DOPRI5 as DOPRI5
from .integrators import GAUSS6 as GAUSS6
from .integrators import GENERALISED_ALPHA as GENERALISED_ALPHA
from .integrators import METHODS as METHODS
from .integrators import MOREAU_JEAN as MOREAU_JEAN
from .integrators import RADAU5 as RADAU5
from .integrators import RK4 as RK4
from .integrators import ROS2 as ROS2
from .integrators import SEMI_IMPLICIT_EULER as SEMI_IMPLICIT_EULER
from .integrators import Method as Method
from .integrators import method_of as method_of
