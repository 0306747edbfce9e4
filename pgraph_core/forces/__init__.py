"""Forces besides gravity. Each file defines one kind completely.

Each file contains the description (fields and validation) of a force, its packing for the kernels,
its force law and its energy. To add a kind that acts on bodies, write a file with a `LOAD` and list
it here. Signs and angles are in docs/description.md.
"""

# isort: off
# in the order in which kinds are listed; the first one stands for no known kind
from .base import VIA as VIA
from .base import Between as Between
from .base import Activated as Activated
from .base import Driven as Driven
from .base import DrivenByKnots as DrivenByKnots
from .base import Force as Force
from .base import Load as Load
from .base import OnBody as OnBody
from .base import Places as Places
from .joint import Actuator as Actuator
from .joint import Motor as Motor
from .joint import OnJoint as OnJoint
from .joint import Servo as Servo
from .joint import SpeedServo as SpeedServo
from .tendon import Tendon as Tendon
from .wrench import Wrench as Wrench
from .riding import Shift as Shift
from .riding import Within as Within
from .path import BetweenPoints as BetweenPoints
from .path import Via as Via
from .path import at_state as at_state
from .path import legs_of as legs_of
from .path import lines_of as lines_of
from .path import ways_past as ways_past
from .path import path_of as path_of
from .path import points_of as points_of
from .spring import Spring as Spring
from .torsion import Torsion as Torsion
from .drag import Drag as Drag
from .bushing import Bushing as Bushing
from .cable import Cable as Cable
from .strut import Lines as Lines
from .strut import Strut as Strut
from .linear_actuator import LinearActuator as LinearActuator
from .muscle import Muscle as Muscle
from . import bushing, cable, drag, linear_actuator, muscle, spring, strut, torsion, wrench

# kinds of force on bodies, in the order of their tables
STRUTS = strut.LOAD._replace(others={LinearActuator: linear_actuator.pack})
LOADS = (
    wrench.LOAD, spring.LOAD, torsion.LOAD, drag.LOAD, bushing.LOAD, STRUTS, cable.LOAD,
    muscle.LOAD,
)  # fmt: skip
