"""Vocabulary of other programs: synonyms for our names, and names that get a hint.

A name is accepted if its meaning and form are the same: `dt` is the step, and `axis` is the
direction of a joint. If the form differs, the message gives a hint: `tspan` is a pair, but `t_end`
is a number. The tables are read only after something was refused, so that a call in our own words
costs nothing.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from typing import Any

# ours: names of other programs for the same, in the same form
_SAME = """
step: dt timestep time_step step_size
t_end: tend t_final tf tmax stop_time end_time
t_start: t0
t_eval: times
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
point: pos position anchor
other_point: point2 other_anchor
axes: axis
at: body site
kind: type
joint: joint_type
stiffness: k spring_constant
damping: c d
friction: mu
body: child body1 body_a bodyA
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
t_end: duration tspan t_span time
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


SAME, NEAR = _table(_SAME), _table(_NEAR)


def ours(name: str, known: Iterable[str]) -> str:
    """Return the Pgraph name that corresponds to another program's `name`, or ""."""
    names = set(known)
    found = [each for each in SAME.get(name, ()) if each in names]
    return found[0] if name not in names and len(found) == 1 else ""


def renamed(given: Mapping[str, Any], known: Iterable[str]) -> dict[str, Any]:
    """Return arguments under Pgraph names, or {} if none is renamed or two have the same
    meaning."""
    names = list(known)
    pairs = [(ours(name, names) or name, value) for name, value in given.items()]
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


def synonym(name: Any, known: Iterable[str]) -> str:
    """Return the hint "did you mean revolute?" for another program's word for a choice."""
    listed = list(known)
    word = name.lower() if isinstance(name, str) else ""
    found = chosen(name, listed) or next((x for x in NEAR_CHOICES.get(word, ()) if x in listed), "")
    return f"; did you mean {found}?" if found else ""
