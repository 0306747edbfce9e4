"""The walking controller, which applies a gait to a mechanism. A compiled run evaluates its torques
at every stage.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..dynamics.arguments import UserTorque
from ..engine import layout as at
from ..engine.compiler.address import _KEPT, WORDS, address_of, unnamed
from ..engine.compiler.jit import JIT, ready
from ..engine.gait import walking
from ..engine.gait.tables import (
    FLEXION,
    FOOT,
    GAIT_SETTINGS,
    HARMONICS,
    NOD,
    RISE,
    SURGE,
    SWAY,
    Walk,
)
from ..engine.records import table
from ..errors import InputError, Problem, explained
from ..mechanism import Mechanism, mechanism_of
from ..model import Gait, Model
from ..packing import Array
from ..packing.packed import Packed
from ..portable import Portable
from ..tolerances import EPS
from .anatomy import Anatomy, anatomy, standing
from .footing import terrain_of

SAMPLES = 400  # points per stride at which its waves are planned
LOW, UPRIGHT = 0.6, 0.5  # a fall: relative height, cosine of the tilt
LIMP = 15.0  # [1/s] rate at which joints slow down after a fall


@explained
class Controller(Portable):
    """A gait controller that computes joint torques as a function of (t, q, v).

    It has no internal state and can be passed to `simulate` as `tau`. Scenarios with a gait create
    a controller automatically. The controller uses the parameters of the model for which it was
    created. To study the effect of modelling errors, use it in simulations of another model with
    the same joints.

    Raises InputError if the model cannot walk on the feet of the gait, or if its legs cannot reach
    the speed.
    """

    def __init__(self, mech: Mechanism | Model, gait: Gait):
        """Create the controller. Compilation is deferred until the first use."""
        mech = mechanism_of(mech, "Controller")
        self.mech, self.gait = mech, gait
        self.anatomy = anatomy(mech, gait)
        self.settings = _settings(self.anatomy, gait, mech.model)
        self.legs = self.anatomy.legs.copy()
        self._share()
        _check_reach(self.anatomy, gait)
        self.terrain = terrain_of(mech.model)
        self.waves = self._waves()
        self.limit = np.full(mech.nv, gait.leg_torque)
        self.limit[self.anatomy.spine[:, 1]] = gait.spine_torque

    def __call__(self, t: float, q: Array, v: Array) -> Array:
        """Return the joint torques τ (nv,) [N m] at a state, as used in a run."""
        return self.acting().torque(t, q, v)

    def acting(self, room: int = 0) -> GaitTorque:
        """Return the compiled function for one run of states of at most `room` numbers, with its
        own workspace and settings.
        """
        return GaitTorque(self, room)

    def changed(self, t: float, /, **fields: object) -> Controller:
        """Return a controller of the changed gait, which continues from the clock of this one at
        t."""
        new = Controller(self.mech, self.gait.edit(**fields))
        old, s = self.settings[0], new.settings[0]
        rise = old["speed_to"] - old["speed_from"]
        most = old["speed_rate"] * max(t - old["speed_time"], 0.0)
        s["speed_from"] = old["speed_from"] + min(max(rise, -most), most)
        s["clock_phase"] = old["clock_phase"] + (t - old["clock_time"]) / old["stride"]
        s["heading"] = old["heading"] + old["turn_rate"] * (t - old["turn_time"])
        s["clock_time"] = s["speed_time"] = s["turn_time"] = t
        return new

    def ticks(self, t_start: float, t_end: float) -> Array:
        """Return the times [s] within an interval at which feet touch down or lift off and the
        torques jump.

        Each time is listed twice, shortly before and after the change.
        """
        s, f = self.settings[0], self.legs
        clock = s["clock_phase"] + (np.array([t_start, t_end]) - s["clock_time"]) / s["stride"]
        turns = np.arange(np.floor(clock[0]) - 1, np.ceil(clock[1]) + 1)
        feet = f[f["duty"] < 1]
        parts = np.concatenate((feet["offset"], feet["offset"] + feet["duty"]))
        phase = np.add.outer(turns, np.unique(parts % 1.0)).ravel()
        t = s["clock_time"] + (phase - s["clock_phase"]) * s["stride"]
        apart = 64 * EPS * np.maximum(np.abs(t), s["stride"])
        t = np.union1d(t - apart, t + apart)
        return t[(t > t_start) & (t < t_end)]

    def start(self) -> tuple[Array, Array]:
        """Return (q, v) at rest on the ground, at the gait's height, paws parallel to thighs."""
        return standing(self.mech, self.gait, self.anatomy)

    def _share(self) -> None:
        """Compute the peak loads. Their means over a stride support the weight without a pitching
        moment."""
        f, a = self.legs, self.anatomy
        x = a.hips[:, 0] + f["ahead"] - a.centre[0]
        hind = x[:2].mean() / (x[:2].mean() - x[2:].mean())
        part = np.array([1 - hind, 1 - hind, hind, hind]) / 2
        on = np.where(f["duty"] < 1, f["duty"] * (1 - self.gait.loading), 1.0)
        f["share"] = part / on * self.gait.push

    def _waves(self) -> Array:
        waves = np.zeros((5, 2 * HARMONICS))
        given = (self.gait.sway, self.gait.surge, self.gait.flexion)
        for row, wave in zip((SWAY, SURGE, FLEXION), given):
            waves[row, : len(wave)] = wave
        for row, part, shape in zip((RISE, NOD), (self.gait.rise, self.gait.nod),
                                    self._planned()):  # fmt: skip
            waves[row] = part * _twice_integrated(shape, self.gait.stride)
        return waves

    def _planned(self) -> tuple[Array, Array]:
        """Return the vertical and pitch accelerations over a stride under the planned loads."""
        gait, a = self.gait, self.anatomy
        x = np.arange(SAMPLES) / SAMPLES
        g = self.settings[0]["gravity"]
        up, nod = np.full(SAMPLES, -g), np.zeros(SAMPLES)
        for hip, f in zip(a.hips, self.legs):
            p, duty = (x - f["offset"]) % 1.0, f["duty"]
            near = np.clip(np.minimum(p, duty - p) / (gait.loading * duty), 0.0, 1.0)
            load = np.where(p < duty, near * near * (3 - 2 * near), 0.0) * f["share"] * g
            arm = hip[0] + f["ahead"] - a.centre[0] - gait.speed * gait.stride * (p - duty / 2)
            up += load
            nod += load * arm * a.mass / a.inertia[2]
        return up, nod


class GaitTorque(UserTorque):
    """A controller within one run, whose `settings` may change between chunks of steps."""

    interpreted = False

    def __init__(self, controller: Controller, room: int):
        """Compile the controller on the first call in the process."""
        mech = controller.mech
        nq, nv = mech.nq, mech.nv
        self.error = None
        self.address = address_of(walking.walking)
        width = max(nq, nv, room)
        self.exchange = np.zeros((3 + -(-TUPLE // width), width))
        self.answer = np.zeros(1, dtype=np.int64)
        self.settings, self.fallen = controller.settings.copy(), np.full(1, -1.0)
        self.waves = controller.waves.copy()
        self._q, self._v = self.exchange[0, :nq], self.exchange[1, :nv]
        self._tau, self._bad = self.exchange[2, :nv], np.full(1, -np.inf)
        rows, const = mech.packed.tree
        a = controller.anatomy
        self.kept = Walk(
            rows, const, np.zeros((len(rows), at.WORK)), np.zeros((len(rows), 3)),
            controller.legs, self.settings, self.waves, table(FOOT, 4), np.zeros((6, 7)), self._q,
            self._v, self._tau, np.zeros(nv), controller.limit, a.spine, self.fallen,
            controller.terrain, NO_RUN,
        )  # fmt: skip
        _store(self.exchange, self.kept)

    @property
    def memory(self) -> list[Array]:
        """The settings, and whether the quadruped has fallen."""
        return [self.settings, self.fallen]

    @property
    def numbers(self) -> list[Array]:
        """The arrays that depend on the model and the gait."""
        kept = self.kept
        return [kept.rows, kept.const, kept.legs, kept.waves, kept.limit, kept.spine]

    def keep_most(self) -> None:
        """Keep nothing, because the torques are within limits of their own."""

    def join(self, packed: Packed, work: Array) -> None:
        """Use frames, velocities and inertias from a run of the same bodies.

        The rows of the control states follow those of the bodies.
        """
        mine = self.kept.rows, self.kept.const
        if all(np.array_equal(a, b[: len(a)]) for a, b in zip(mine, packed.tree)):
            self.kept = self.kept._replace(theirs=work[: len(self.kept.rows)])
            _store(self.exchange, self.kept)

    def torque(self, t: float, q: Array, v: Array) -> Array:
        """Return the joint torques τ (nv,) at a state."""
        self._q[:], self._v[:] = q, v
        walking.walking(t, *(self.exchange[i].ctypes.data for i in range(3)))
        return self._tau.copy()

    def notices(self) -> list[str]:
        """Return a notice if the quadruped has fallen."""
        if self.fallen[0] < 0:
            return []
        return [f"it fell at t = {self.fallen[0]:.4g} s: its joints are only damped while it lies"]


NO_RUN = np.zeros((0, 0))
TUPLE = 192  # words that the controller's tuple takes


def _store(exchange: Array, kept: Walk) -> None:
    """Store the tuple after the three rows of the exchange, as expected by the kernel."""
    place = exchange[3:].reshape(-1).view(np.int64)
    if not JIT:
        _KEPT[place.ctypes.data] = kept
        return
    buffer = np.zeros(WORDS, dtype=np.int64)
    ready(walking.save_walk)(buffer, unnamed(kept))
    if buffer[len(place) :].any():
        raise RuntimeError(f"a walk takes more than the {len(place)} words of its exchange")
    place[:] = buffer[: len(place)]


def _settings(a: Anatomy, gait: Gait, model: Model) -> Any:
    """One GAIT_SETTINGS."""
    found, gains = table(GAIT_SETTINGS, 1), gait.gains
    s = found[0]
    s["stride"], s["height"], s["clearance"] = gait.stride, gait.height, gait.clearance
    s["landing"], s["ramp"], s["width"] = gait.landing, gait.loading, gait.width
    s["speed_to"], s["speed_rate"], s["drift"] = gait.speed, gait.acceleration, gait.drift
    s["turn_rate"], s["grip"], s["least_load"] = gait.turn, gait.grip, gait.least
    s["mass"], s["inertia"], s["gravity"] = a.mass, a.inertia, -model.gravity[1]
    n = model.ground_normal
    s["rise_x"], s["rise_z"] = -n[0] / n[1], -n[2] / n[1]
    along = a.hips[:2].mean(axis=0) - a.hips[2:].mean(axis=0)
    s["pitch"] = math.atan2(along[1], along[0])
    s["gain_speed"], s["gain_drift"], s["gain_sway"] = gains.speed, gains.drift, gains.sway
    s["gain_surge"] = gains.surge
    for name in ("height", "roll", "pitch", "yaw", "swing", "spine", "paw"):
        s[f"gain_{name}"] = getattr(gains, name)
    s["place_speed"], s["place_drift"] = gains.place, gains.place_drift
    s["place_roll"] = gains.place_roll
    s["tight_torque"], s["tight_force"] = gains.tight_torque, gains.tight_force
    s["lever"] = float((a.legs["v_spread"] >= 0).all())
    s["limp"], s["low"], s["upright"] = LIMP, LOW, UPRIGHT
    return found


def _check_reach(a: Anatomy, gait: Gait) -> None:
    """Raise InputError if a leg is too short for the height or the speed, or is stiff."""
    where = f"gait '{gait.name}'"
    stiff = [f.foot for f, leg in zip(a.feet, a.legs) if leg["v_spread"] < 0]
    if gait.drift and stiff:
        text = f"{gait.drift:g} m/s to the side needs hips that spread; that of '{stiff[0]}' turns"
        raise InputError(Problem(where, "drift", f"{text} about z alone"))
    for fall, hip, sole, most in zip(a.feet, a.hips, a.soles, a.longest):
        high = hip[1] - sole[1] - (a.centre[1] - sole[1] - gait.height)
        if high >= most:
            text = f"{gait.height:g} m puts a hip at {high:.3g} m; the leg of '{fall.foot}' reaches"
            raise InputError(Problem(where, "height", f"{text} {most:.3g} m"))
        half = math.sqrt(most**2 - high**2) - abs(sole[0] - hip[0] + fall.ahead)
        fastest = 2 * max(half, 0.0) / (fall.duty * gait.stride)
        if abs(gait.speed) > fastest and fall.duty < 1:
            text = f"{gait.speed:g} m/s is more than '{fall.foot}' can follow, {fastest:.3g} m/s at"
            text += f" this height; a shorter stride or duty allows more than {gait.stride:g} s"
            raise InputError(Problem(where, "speed", f"{text} and {fall.duty:g} do"))


def _twice_integrated(acceleration: Array, period: float) -> Array:
    """Integrate the periodic part of an acceleration twice into (8,) wave coefficients."""
    c = np.fft.rfft(acceleration) / len(acceleration)
    k = np.arange(1, HARMONICS + 1)
    over = 2.0 / (2 * math.pi * k / period) ** 2
    return np.stack((-c[k].real * over, c[k].imag * over), axis=1).ravel()
