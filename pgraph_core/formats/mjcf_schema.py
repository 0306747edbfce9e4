"""The MJCF attributes that the reader supports, as of MuJoCo 4.0.

Each of them is read, is compiled away by MuJoCo, or is reported as left out. An attribute that a
later version of MuJoCo adds is in no row, so that a file which uses it is reported as well.
`mujoco.mj_printSchema` lists the attributes of the installed version.
"""

from __future__ import annotations

from collections.abc import Iterable

ATTRIBUTES = """
actuator: actdim actearly actlimited actrange area armature bias biasprm biastype body class
    cogging controller cranklength cranksite ctrllimited ctrlrange damping dampratio delay
    diameter dynprm dyntype ffrange force forcelimited forcerange fpmax fvmax gain gainprm
    gaintype gear group imax inductance inheritrange input instance interp joint jointinparent
    ki kp kv lengthrange lmax lmin lugre motorconst name nominal nsample plugin posrange range
    refsite resistance saturation scale site slewmax slidersite tausmooth tendon thermal
    timeconst user velrange vmax
attach: body frame model prefix
body: axisangle childclass euler fuse gravcomp mocap name pos quat simple sleep user xyaxes
    zaxis
compiler: alignfree angle assetdir autolimits balanceinertia boundinertia boundmass conflict
    coordinate discardvisual eulerseq fitaabb fusestatic inertiafromgeom inertiagrouprange
    meshdir passthrough savecanonical savecompiled saveinertial settotalmass strippath
    texturedir usethread
connect: active anchor body1 body2 class name site1 site2 solimp solref
equality: active solimp solref
exclude: body1 body2 name
fixed: actuatorfrclimited actuatorfrcrange armature class damping frictionloss group limited
    margin name range solimpfriction solimplimit solreffriction solreflimit springlength
    springyield stiffness user
flag: actuation autoreset clampctrl constraint contact damper diagexact energy equality
    eulerdamp filterparent frictionloss fwdinv gravity invdiscrete ipc island limit midphase
    multiccd nativeccd override refsafe sensor sleep speculative spring warmstart
freejoint: align group name
geom: adhesion axisangle castshadow class conaffinity condim contype density euler fitscale
    fluidcoef fluidshape friction fromto gap geom group hfield margin mass material mesh name
    pos priority quat rgba shellinertia sidesite size solimp solmix solref surfacevel type user
    xyaxes zaxis
hfield: content_type elevation file name ncol nrow size
inertial: axisangle diaginertia euler fullinertia mass pos quat xyaxes zaxis
joint: active actuatorfrclimited actuatorfrcrange actuatorgravcomp armature axis class coef
    damping frictionloss group joint joint1 joint2 limited margin name polycoef pos range ref
    solimp solimpfriction solimplimit solref solreffriction solreflimit springdamper springref
    springyield stiffness type user
lengthrange: accel interval inttotal maxforce mode timeconst timestep tolrange useexisting
    uselimit
mesh: builtin class content_type face file inertia material maxhullvert name normal params
    refpos refquat scale smoothnormal texcoord vertex
option: actuatorgroupdisable ccd_iterations ccd_tolerance cone density gravity impratio
    integrator iterations jacobian ls_iterations ls_tolerance magnetic noslip_iterations
    noslip_tolerance o_friction o_margin o_solimp o_solref sdf_initpoints sdf_iterations
    sleep_tolerance solver timestep tolerance viscosity wind
pair: adhesion class condim friction gap geom1 geom2 margin name solimp solref solreffriction
pulley: divisor
site: axisangle class euler fromto group material mesh name pos quat rgba site size type user
    xyaxes zaxis
spatial: actuatorfrclimited actuatorfrcrange armature class damping frictionloss group limited
    margin material name range rgba solimpfriction solimplimit solreffriction solreflimit
    springlength springyield stiffness user width
tendon: active actuatorfrclimited actuatorfrcrange armature class damping frictionloss group
    limited margin material name polycoef range rgba solimp solimpfriction solimplimit solref
    solreffriction solreflimit springlength springyield stiffness tendon1 tendon2 user width
weld: active anchor body1 body2 class name relpose site1 site2 solimp solref torquescale
"""

ACTUATORS = (
    "general", "motor", "position", "velocity", "intvelocity", "orientation", "pid", "damper",
    "cylinder", "muscle", "adhesion", "dcmotor",
)  # fmt: skip


def _rows() -> dict[str, frozenset[str]]:
    """Return the attributes by element. An indented line continues the previous line."""
    rows = (row.split(":") for row in ATTRIBUTES.replace("\n    ", " ").strip().splitlines())
    known = {tag: frozenset[str](names.split()) for tag, names in rows}
    actuator = known.pop("actuator")
    return known | dict.fromkeys(ACTUATORS, actuator)


KNOWN = _rows()  # attributes by element, without elements that have no effect on motion


def newer(tag: str, attributes: Iterable[str]) -> list[str]:
    """Return the attributes of an element that do not exist in MuJoCo 4.0."""
    known = KNOWN.get(tag)
    return [] if known is None or known.issuperset(attributes) else sorted(set(attributes) - known)
