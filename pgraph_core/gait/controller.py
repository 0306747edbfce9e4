"""Controller: a gait on a mechanism, as torques that a compiled run calls at every stage."""

from __future__ import annotations

import math

import numpy as np

from ..dynamics.callback import UserTorque
from ..engine import layout as at
from ..engine.arrays import Walk
from ..engine.compiler.address import _KEPT, WORDS, address_of, unnamed
from ..engine.compiler.jit import JIT, compile_kernel, ready
from ..engine.gait import layout as go
from ..engine.gait import walking
from ..errors import InputError, Problem
from ..mechanism import Mechanism
from ..model import Gait
from ..packing.packed import Packed
from ..packing.system import Array
from ..portable import Portable
from .anatomy import Anatomy, anatomy
from .pose import standing

SAMPLES = 400  # of a stride, to plan its waves
G = 9.81
LOW, UPRIGHT, LIMP = 0.6, 0.5, 2.0  # what counts as a fall; damping after it [N m s/rad]
BLURRED = 1e-14  # of a time: the clock's rounding
REACH = 0.98  # of the longest leg that a step may use


class Controller(Portable):
    """Torques (nv,) of a gait from (t, q, v): no memory, no look ahead, limits kept.

    It is given to `simulate` as `tau`, or made there of a scenario's gait. Its numbers for the
    mechanism are those of the model it is made for: to see what a wrong mass does, give a
    controller of one model to runs of another with the same joints. Raises InputError for a model
    that cannot walk on the gait's feet, and for a speed that its legs cannot reach.
    """

    def __init__(self, mech: Mechanism, gait: Gait):
        """Nothing is compiled yet."""
        self.mech, self.gait = mech, gait
        self.anatomy = anatomy(mech, gait)
        self.settings = _settings(self.anatomy, gait)
        self.legs_f = self.anatomy.legs_f.copy()
        self._share()
        _check_reach(self.anatomy, gait)
        self.waves = self._waves()
        self.limit = np.full(mech.nv, gait.leg_torque)
        self.limit[self.anatomy.spine[:, 1]] = gait.spine_torque

    def __call__(self, t: float, q: Array, v: Array) -> Array:
        """τ (nv,) [N m] at a state, as a run gets it."""
        return self.acting().torque(t, q, v)

    def acting(self) -> GaitTorque:
        """The compiled function of one run, with its own workspace and settings."""
        return GaitTorque(self)

    def changed(self, t: float, /, **fields: object) -> Controller:
        """The controller of a gait with other fields, which goes on from this one's clock at t."""
        new = Controller(self.mech, self.gait.edit(**fields))
        old, s = self.settings, new.settings
        rise = old[go.SPEED_TO] - old[go.SPEED_FROM]
        most = old[go.SPEED_RATE] * max(t - old[go.SPEED_T], 0.0)
        s[go.SPEED_FROM] = old[go.SPEED_FROM] + min(max(rise, -most), most)
        s[go.CLOCK_PHASE] = old[go.CLOCK_PHASE] + (t - old[go.CLOCK_T]) / old[go.STRIDE]
        s[go.HEADING] = old[go.HEADING] + old[go.TURN] * (t - old[go.TURN_T])
        s[[go.CLOCK_T, go.SPEED_T, go.TURN_T]] = t
        return new

    def ticks(self, t_start: float, t_end: float) -> Array:
        """Times in between at which feet begin to carry or to swing: torques jump there [s].

        Two each, so near that rounding of the clock is between them.
        """
        s, f = self.settings, self.legs_f
        clock = s[go.CLOCK_PHASE] + (np.array([t_start, t_end]) - s[go.CLOCK_T]) / s[go.STRIDE]
        turns = np.arange(np.floor(clock[0]) - 1, np.ceil(clock[1]) + 1)
        feet = f[f[:, go.DUTY] < 1]
        parts = np.concatenate((feet[:, go.OFFSET], feet[:, go.OFFSET] + feet[:, go.DUTY]))
        phase = np.add.outer(turns, np.unique(parts % 1.0)).ravel()
        t = s[go.CLOCK_T] + (phase - s[go.CLOCK_PHASE]) * s[go.STRIDE]
        apart = BLURRED * np.maximum(np.abs(t), s[go.STRIDE])
        t = np.union1d(t - apart, t + apart)
        return t[(t > t_start) & (t < t_end)]

    def start(self) -> tuple[Array, Array]:
        """(q, v) at rest: on the ground at the gait's height, the paws parallel to the thighs."""
        return standing(self.mech, self.gait, self.anatomy)

    def _share(self) -> None:
        """Loads at full: those whose means over a stride carry the weight without a pitch."""
        f, a = self.legs_f, self.anatomy
        x = a.hips[:, 0] + f[:, go.AHEAD] - a.centre[0]
        hind = x[:2].mean() / (x[:2].mean() - x[2:].mean())
        part = np.array([1 - hind, 1 - hind, hind, hind]) / 2
        on = np.where(f[:, go.DUTY] < 1, f[:, go.DUTY] * (1 - self.gait.loading), 1.0)
        f[:, go.SHARE] = part / on * self.gait.push

    def _waves(self) -> Array:
        waves = np.zeros((5, 2 * go.HARMONICS))
        given = (self.gait.sway, self.gait.surge, self.gait.flexion)
        for row, wave in zip((go.SWAY, go.SURGE, go.FLEXION), given):
            waves[row, : len(wave)] = wave
        for row, part, shape in zip((go.RISE, go.NOD), (self.gait.rise, self.gait.nod),
                                    self._planned()):  # fmt: skip
            waves[row] = part * _twice_integrated(shape, self.gait.stride)
        return waves

    def _planned(self) -> tuple[Array, Array]:
        """Accelerations up and of pitch that the loads beforehand give over a stride."""
        gait, a = self.gait, self.anatomy
        x = np.arange(SAMPLES) / SAMPLES
        up, nod = np.full(SAMPLES, -G), np.zeros(SAMPLES)
        for hip, f in zip(a.hips, self.legs_f):
            p, duty = (x - f[go.OFFSET]) % 1.0, f[go.DUTY]
            near = np.clip(np.minimum(p, duty - p) / (gait.loading * duty), 0.0, 1.0)
            load = np.where(p < duty, near * near * (3 - 2 * near), 0.0) * f[go.SHARE] * G
            arm = hip[0] + f[go.AHEAD] - a.centre[0] - gait.speed * gait.stride * (p - duty / 2)
            up += load
            nod += load * arm * a.mass / a.inertia[2]
        return up, nod


class GaitTorque(UserTorque):
    """A controller at work in one run; `settings` may be changed between its chunks."""

    def __init__(self, controller: Controller):
        """Compiles the controller at the first call of the process."""
        mech = controller.mech
        nq, nv = mech.nq, mech.nv
        self.error = None
        self.address = address_of(walking.walking)
        width = max(nq, nv)
        self.exchange = np.zeros((3 + -(-TUPLE // width), width))
        self.answer = np.zeros(1, dtype=np.int64)
        self.settings, self.fallen = controller.settings.copy(), np.full(1, -1.0)
        self.waves = controller.waves.copy()
        self._q, self._v = self.exchange[0, :nq], self.exchange[1, :nv]
        self._tau = self.exchange[2, :nv]
        rows, const = mech.packed.tree
        a = controller.anatomy
        self._kept = Walk(
            rows, const, np.zeros((len(rows), at.WORK)), np.zeros((len(rows), 3)), a.legs_i,
            controller.legs_f, self.settings, self.waves, np.zeros((4, go.FOOT_F)),
            np.zeros((6, 7)), self._q, self._v, self._tau, np.zeros(nv), controller.limit, a.spine,
            self.fallen, NO_RUN,
        )  # fmt: skip
        _store(self.exchange, self._kept)

    def join(self, packed: Packed, work: Array) -> None:
        """Take frames, velocities and inertias from a run of the same bodies, not anew."""
        mine = self._kept.rows, self._kept.const
        if all(np.array_equal(a, b) for a, b in zip(mine, packed.tree)):
            self._kept = self._kept._replace(theirs=work)
            _store(self.exchange, self._kept)

    def torque(self, t: float, q: Array, v: Array) -> Array:
        """τ (nv,) at a state."""
        self._q[:], self._v[:] = q, v
        walking.walking(t, *(self.exchange[i].ctypes.data for i in range(3)))
        return self._tau.copy()

    def notices(self) -> list[str]:
        """The fall, if there was one."""
        if self.fallen[0] < 0:
            return []
        return [f"it fell at t = {self.fallen[0]:.4g} s: its joints are only damped while it lies"]


NO_RUN = np.zeros((0, 0))
TUPLE = 160  # words that the controller's tuple takes


def _store(exchange: Array, kept: Walk) -> None:
    """The tuple behind the three rows of the exchange, where the kernel looks for it."""
    place = exchange[3:].reshape(-1).view(np.int64)
    if not JIT:
        _KEPT[place.ctypes.data] = kept
        return
    compile_kernel("save_walk")
    buffer = np.zeros(WORDS, dtype=np.int64)
    ready(walking.save_walk)(buffer, unnamed(kept))
    assert not buffer[len(place) :].any()
    place[:] = buffer[: len(place)]


def _settings(a: Anatomy, gait: Gait) -> Array:
    s, gains = np.zeros(go.SETTINGS), gait.gains
    s[go.STRIDE], s[go.HEIGHT], s[go.CLEARANCE] = gait.stride, gait.height, gait.clearance
    s[go.LANDING], s[go.RAMP], s[go.WIDTH] = gait.landing, gait.loading, gait.width
    s[go.SPEED_TO], s[go.SPEED_RATE], s[go.DRIFT] = gait.speed, gait.acceleration, gait.drift
    s[go.TURN], s[go.GRIP], s[go.LEAST] = gait.turn, gait.grip, gait.least
    s[go.MASS], s[go.INERTIA : go.INERTIA + 3] = a.mass, a.inertia
    along = a.hips[:2].mean(axis=0) - a.hips[2:].mean(axis=0)
    s[go.PITCH] = math.atan2(along[1], along[0])
    s[go.GAIN_SPEED], s[go.GAIN_DRIFT], s[go.GAIN_SWAY] = gains.speed, gains.drift, gains.sway
    s[go.GAIN_SURGE] = gains.surge
    pairs = (gains.height, gains.roll, gains.pitch, gains.yaw, gains.swing, gains.spine, gains.paw)
    s[go.GAIN_HEIGHT : go.PLACE] = np.ravel(pairs)
    s[go.PLACE : go.TIGHT_TORQUE] = gains.place, gains.place_drift, gains.place_roll
    s[go.TIGHT_TORQUE], s[go.TIGHT_FORCE] = gains.tight_torque, gains.tight_force
    s[go.LEVER] = float((a.legs_i[:, go.V_SPREAD] >= 0).all())
    s[go.LIMP], s[go.LOW], s[go.UPRIGHT] = LIMP, LOW, UPRIGHT
    return s


def _check_reach(a: Anatomy, gait: Gait) -> None:
    """Raises InputError where a leg is too short for the height, or for the speed."""
    where = f"gait '{gait.name}'"
    for fall, hip, sole, longest in zip(a.feet, a.hips, a.soles, a.longest):
        high = hip[1] - sole[1] - (a.centre[1] - sole[1] - gait.height)
        most = REACH * longest
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
    """(8,) the wave whose second derivative is the periodic part of samples over a period."""
    c = np.fft.rfft(acceleration) / len(acceleration)
    k = np.arange(1, go.HARMONICS + 1)
    over = 2.0 / (2 * math.pi * k / period) ** 2
    return np.stack((-c[k].real * over, c[k].imag * over), axis=1).ravel()
