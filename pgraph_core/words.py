"""Vocabulary of other programs: synonyms for our names, and names that get a hint.

A name of an argument, a field or an attribute is accepted if its meaning and form are the same:
`dt` is the step, and `qpos` is q. If the form differs, the message gives a hint: `duration` is a
length of time, but `t_end` is an instant. The tables are read only after something was refused, so
that a call in our own words costs nothing.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any

# ours: names of other programs for the same, in the same form
_SAME = """
step: dt timestep time_step step_size
t_end: tend t_final tf tmax stop_time end_time
t_start: t0
t_eval: times
place: position pos
q: q0 qpos
v: v0 qd dq qdot qvel
vdot: qdd ddq qacc
tau: torque torques controller
rtol: tol tolerance
method: solver integrator
stabilise: stabilize
workers: n_jobs num_workers processes
metric: metrics
size: n batch_size num_envs n_envs
mass: m
inertia: I
rest: rest_length free_length natural_length l0
link: pos position
point: pos position anchor point1
other_point: point2 other_anchor
axes: axis
at: body site joint
kind: type
joint: joint_type
stiffness: k spring_constant
damping: c d
friction: mu
body: child body1 body_a bodyA joint
other: body2 body_b bodyB
colour: color
forces: springs motors servos actuators
constraints: loops
bodies: links
"""
# ours: names that are near it, in another form
_NEAR = """
joint: type hinge revolute rotations slide slider prismatic translations
step: h max_step
t_end: duration time
t: time
q: x0 y0 initial state
tau: u ctrl control
inputs: ctrl control
max_steps: steps n_steps nsteps
n: steps n_steps nsteps
rest: length
targets: position pose place target
frames: fps
progress: callback
workers: jobs cores
set: values
mass: weight
link: offset
point: offset
stiffness: ks spring
damping: kd damper
friction: coefficient
restitution: e bounce
torque_limit: limit limits range effort
q_of_t: speed velocity value target
other: target parent
shape: geometry geom
forces: dampers
ground: floor
"""
# attributes: those of other programs for the same, in the same form
_SAME_ATTRIBUTES = """
pose: forward_kinematics fk
t: time sim_time
q: qpos
v: qvel qdot dq qd
vdot: qacc qddot ddq qdd
mass_matrix: M crba
bias_force: nle nonlinear_effects nonLinearEffects
inverse_dynamics: rnea
forward_dynamics: aba
to_pandas: to_dataframe to_df
objective: fun
covariance: pcov
"""
# ours, as it is written: attributes and public names of other programs for something near it
_ATTRIBUTES = """
bodies: joints links num_joints njoints nbody njnt
position["NAME"]: body link
q["NAME"]: joint joint_position joint_positions joint_angle joint_angles angle angles
t: times
q: y positions configuration
v: velocities
vdot: accelerations
inputs: ctrl control
counters: nfev njev n_steps stats
user_events: t_events y_events event_times
converged: success status
message: report summary info
values: x params parameters
objective: cost
evaluations: nfev nit
errors: perr stderr std
covariance: cov
energy: total_energy mechanical_energy kinetic_energy potential_energy
error_estimate: error error_bound
constraint_force: multipliers lambdas reactions reaction_forces
position: xpos positions body_position
body_pose: orientation xquat rotation
joint_torque: tau torque torques
controls: ctrl
to_pandas: as_dataframe dataframe df to_frame
to_film: to_gif to_mp4 to_video save_animation save_gif animation
show: animate animation play view visualize render
save: dump write export to_npz to_file
load: from_file read open load_model read_model from_urdf from_xml_path buildModelFromUrdf loadURDF
read_mjcf: from_xml_string MjModel load_mjcf
read_urdf: load_urdf
to_json: to_dict
from_json: from_dict
pose: frame_pose body_pose site_pose placement position site_position
poses: body_poses
velocity: frame_velocity site_velocity body_velocity xvel
jacobian: site_jacobian frame_jacobian body_jacobian geometric_jacobian jac point_jacobian
jacobian_bias: jacobian_dot jacobian_derivative drift
home: neutral
mass_matrix: H inertia_matrix joint_space_inertia
bias_force: bias qfrc_bias coriolis
bias_force(q,0*v): gravity gravity_compensation gravity_torque gravity_torques gravity_forces
forward_derivatives: forward_dynamics_derivatives aba_derivatives computeABADerivatives
inverse_kinematics: ik
linearise: linearization linearized
linearise().eigenvalues: natural_frequencies frequencies eigenfrequencies eigenvalues poles
linearise().modes: modes normal_modes eigenmodes modal_analysis mode_shapes
simulate: solve_ivp odeint integrate solve run rollout simulation Simulator Simulation
Stepper: Sim Env Environment MjData SimulationContext
Mechanism: MultibodyPlant MultibodySystem RigidBodySystem Robot System World Plant
Body: Link RigidBody
Body(joint=...): Joint Hinge RevoluteJoint PrismaticJoint FreeJoint BallJoint FixedJoint
Shape(kind=...): Box Sphere Cylinder Capsule Mesh Ellipsoid Geom Geometry
Torsion: TorsionSpring RotationalSpring
Spring: Damper SpringDamper LinearSpring
Result: Run Solution Trajectory
Distance: Rope Rod
Motor: TorqueActuator
Servo: PositionActuator
"""
# pairs of other programs that are two of our numbers
PAIRS = {
    "t_span": ("t_start", "t_end"), "tspan": ("t_start", "t_end"),
    "forcerange": ("torque_low", "torque_limit"), "ctrlrange": ("input_low", "input_high"),
}  # fmt: skip
CHOICES = {  # choices by the words of other programs
    "hinge": ("revolute",), "pin": ("revolute",), "continuous": ("revolute",),
    "ball": ("spherical", "sphere", "point"), "fixed": ("weld",), "slide": ("prismatic",),
    "slider": ("prismatic",), "floating": ("free",), "freejoint": ("free",), "cube": ("box",),
    "rk45": ("dopri5",), "ode45": ("dopri5",), "radau": ("radau5",),
    "local": ("body",), "local_world_aligned": ("world",), "world": ("ground",),
    "earth": ("ground",), "inertial": ("ground",),
}  # fmt: skip
NEAR_CHOICES = {
    "plate": ("box",), "rod": ("capsule", "distance"), "euler": ("semi_implicit_euler",),
    "base": ("ground",),
}  # fmt: skip


def _table(text: str) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for line in text.split("\n")[1:-1]:
        ours, theirs = line.split(": ")
        for word in theirs.split():
            found.setdefault(word, []).append(ours)
    return found


SAME, NEAR, ATTRIBUTES = _table(_SAME), _table(_NEAR), _table(_ATTRIBUTES)
SAME_ATTRIBUTES = {theirs: ours for theirs, (ours,) in _table(_SAME_ATTRIBUTES).items()}


def ours(name: str, known: Iterable[str]) -> str:
    """Return the Pgraph name that corresponds to another program's `name`, or ""."""
    names = set(known)
    found = [each for each in SAME.get(name, ()) if each in names]
    return found[0] if name not in names and len(found) == 1 else ""


def renamed(given: Mapping[str, Any], known: Iterable[str]) -> dict[str, Any]:
    """Return arguments under Pgraph names, or {} if none is renamed or two have the same
    meaning."""
    names = list(known)
    pairs: list[tuple[str, Any]] = []
    for name, value in given.items():
        two = PAIRS.get(name, ("",))
        if {*two} <= {*names} and len(value if hasattr(value, "__len__") else ()) == 2:
            pairs += zip(two, value)
        else:
            pairs.append((ours(name, names) or name, value))
    changed = [name for name, _ in pairs] != list(given)
    return dict(pairs) if changed and len(dict(pairs)) == len(pairs) else {}


def chosen(value: Any, known: Iterable[str]) -> str:
    """Return the Pgraph choice that corresponds to a word of another program, or ""."""
    word = value.lower() if isinstance(value, str) else ""
    names = list(known)
    return next((x for x in CHOICES.get(word, (word,)) if x in names and x != value), "")


def hint(name: str, known: Iterable[str], *, alike: bool = True) -> str:
    """Return the known name related to another program's `name`, or "".

    With `alike`, names with similar spelling are accepted as well.
    """
    names = list(known)
    near = [each for each in (*SAME.get(name, ()), *NEAR.get(name, ())) if each in names]
    if alike:
        near += difflib.get_close_matches(name, names, n=1)
    return next(iter(near), "")


def attributes(name: str, known: Iterable[str]) -> list[str]:
    """Return what is written here for an attribute `name`: other programs' words, then spelling."""
    names = {*known}
    found = [each for each in ATTRIBUTES.get(name, ()) if re.split(r"\W", each)[0] in names]
    found = found or [each for each in (*SAME.get(name, ()), *NEAR.get(name, ())) if each in names]
    return found[:2] or difflib.get_close_matches(name, sorted(names), n=3)


class NoAttribute(AttributeError):
    """An unknown attribute. The message names ours for it, and is made only when it is read."""

    def __init__(self, owner: str, attribute: str, known: Callable[[], Iterable[str]]):
        super().__init__(owner, attribute)
        self._known = known

    def __str__(self) -> str:
        owner, attribute = self.args
        known = [each for each in self._known() if not each.startswith("_")]
        near = " or ".join(attributes(attribute, known))
        hint = f"; did you mean {near}?" if near else f"; choose from {', '.join(known[:60])}"
        return f"{owner} has no attribute '{attribute}'{hint}"

    def __reduce__(self) -> tuple[Any, ...]:
        return AttributeError, (str(self),)


def synonym(name: Any, known: Iterable[str]) -> str:
    """Return the hint "did you mean revolute?" for another program's word for a choice."""
    listed = list(known)
    word = name.lower() if isinstance(name, str) else ""
    found = chosen(name, listed) or next((x for x in NEAR_CHOICES.get(word, ()) if x in listed), "")
    return f"; did you mean {found}?" if found else ""
