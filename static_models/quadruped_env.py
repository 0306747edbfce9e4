"""Environments for learning to walk: a robot of 12 motors on the ground, single and many at once.

`import pgraph_core.gym` registers them. The robot is a description like any other: what differs
from one instance to the next is named by its path there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from numbers import Integral
from typing import Any

import gymnasium as gym  # pyright: ignore[reportMissingImports]
import numpy as np

import pgraph_core as pg
from pgraph_core.errors import explained
from pgraph_core.gym import VectorEnv

STEP, SUBSTEPS = 1e-3, 20  # [s] step, and steps per action
LEGS = ("front_left", "front_right", "hind_left", "hind_right")
MOTORS = tuple(f"{leg}_{part}" for leg in LEGS for part in ("hip", "thigh", "shank"))
LENGTH = 0.2  # [m] length of thigh and shank
BEND = 0.7  # [rad] angle of a thigh at rest, half of that of its knee
REST = np.tile([0.0, BEND, -2 * BEND], 4)  # rad
HEIGHT = 2 * LENGTH * np.cos(BEND)  # m: of the trunk over the ground at rest
REACH = 0.4  # rad: what an action of 1 adds to a target
WANTED = 0.6  # m/s
LOW, TILTED = 0.55, 0.5  # a fall: lower than this part of HEIGHT, or its upright axis below it
BARS, BAR = 16, 0.25  # bars across rough ground, and their depth [m]
PUSH, PUSHED, OFTEN = 60.0, 5, 100  # force of a push [N], its duration and distance in actions
NUMBERS = {"bodies.trunk.mass": (5.0, 7.0), "ground.friction": (0.5, 0.9)}
Array = np.ndarray


def robot(terrain: str = "flat") -> pg.Model:
    """Return a trunk on four legs with three motors and a point foot each. Bars if "rough"."""
    half = np.array([0.2, 0.1, 0.05])
    bodies = [_body("trunk", "ground", 6.0, half, (0, 0, 0), joint="free", link=(0, 0, HEIGHT))]
    contacts, forces = [], []
    for leg in LEGS:
        x, y = 0.19 * (1 if "front" in leg else -1), 0.06 * (1 if "left" in leg else -1)
        out = np.array([0.0, 0.08 * np.sign(y), 0.0])
        down = np.array([0.0, 0.0, -LENGTH])
        size = np.array([0.02, 0.02, LENGTH / 2])
        bodies += [
            _body(f"{leg}_hip", "trunk", 0.6, np.full(3, 0.035), out / 2, (1, 0, 0), (x, y, 0)),
            _body(f"{leg}_thigh", f"{leg}_hip", 0.9, size, down / 2, (0, 1, 0), out, BEND),
            _body(
                f"{leg}_shank", f"{leg}_thigh", 0.2, size / 2, down / 2, (0, 1, 0), down, -2 * BEND
            ),
        ]
        contacts.append(pg.Contact(name=f"{leg}_foot", body=f"{leg}_shank", points=[down]))
    for name, rest in zip(MOTORS, REST):
        forces.append(
            pg.Servo(name=name, body=name, kp=40.0, kd=1.0, target=rest, torque_limit=33.0)
        )
    steps = [
        {"low": [0.5 + BAR * i, -5.0], "high": [0.5 + BAR * (i + 1), 5.0], "height": 0.01}
        for i in range(BARS if terrain == "rough" else 0)
    ]
    return pg.Model(
        name="walker", bodies=bodies, contacts=contacts, forces=forces,
        ground={"friction": 0.7, "steps": steps},
    )  # fmt: skip


def _body(
    name: str, parent: str, mass: float, half: Array, com: Any, axis: Any = (0, 1, 0),
    link: Any = (0, 0, 0), q: float | None = None, joint: Any = "revolute",
) -> pg.Body:  # fmt: skip
    """A box of half extents about its centre of mass."""
    squares = half**2
    inertia = mass / 3 * np.diag(squares.sum() - squares)
    shape = {"kind": "box", "size": 2 * half, "position": com, "role": "visual"}
    own: dict[str, Any] = {"axes": axis} if joint == "revolute" else {}
    own |= {} if q is None else {"q": q}
    return pg.Body(
        name=name, parent=parent, joint=joint, link=link, mass=mass, com=com, inertia=inertia,
        shapes=[shape], **own,
    )  # fmt: skip


@explained
class Walkers:
    """`size` robots with their observations and rewards.

    An action of 12 numbers within -1 and 1 moves the targets of the motors, for 20 steps of 1 ms.
    Observations (46,) are the height above the plane of the ground [m], the up direction (3,),
    velocity and spin of the trunk in world axes (6,), angles of the motors from their rest and
    speeds (24,), and the last action (12,).

    The reward of an action a after a' is exp(-4 (x' - 0.6)²) - y'²/2
    - 0.02 |a - a'|² - 2e-4 |w|², of the trunk's velocity (x', y') [m/s] and the joints' speeds w
    [rad/s] at its end. An episode ends if the trunk is lower than 0.55 of its height at rest, or
    its upright axis less than 0.5 along the world's.

    `numbers` {path: (low, high)} are drawn for each of `variants` robots, the same in all
    environments of these numbers. Each episode takes one variant.
    """

    def __init__(
        self, size: int, terrain: str = "flat", push: bool = False,
        numbers: Mapping[str, tuple[float, float]] | None = None, variants: int = 16,
        threads: int | None = None,
    ):  # fmt: skip
        """Raises InputError for an unknown terrain, bounds that are none, or an unknown path."""
        if terrain not in ("flat", "rough"):
            text = f"must be 'flat' or 'rough', got {terrain!r}"
            raise pg.InputError(pg.Problem("Quadruped", "terrain", text))
        self.size, self.push = size, push
        drawn = dict(NUMBERS if numbers is None else numbers)
        if terrain == "rough":
            drawn |= {f"ground.steps.{i}.height": (0.002, 0.03) for i in range(BARS)}
        self.variants = _whole(variants) if drawn else 0
        rng = np.random.default_rng(0)
        few = {path: rng.uniform(*_span(path, x), self.variants) for path, x in drawn.items()}
        values = {path: np.resize(x, max(size, self.variants)) for path, x in few.items()}
        self.batch = pg.BatchStepper(
            robot(terrain), size, step=STEP, set=values or None, threads=threads
        )
        self.action = np.zeros((size, 12))
        self.count = np.zeros(size, dtype=np.int64)  # actions since the start
        self._force = np.zeros((size, self.batch.v.shape[1]))
        self._start = self.batch.q[0].copy()

    def start(self, which: Array, rngs: Sequence[np.random.Generator]) -> None:
        """Start again: another variant, joints near rest, drawn by each robot's own generator."""
        k, own = len(which), [rngs[i] for i in which.tolist()]
        q = np.repeat(self._start[None], k, axis=0)
        q[:, 7:] += np.array([rng.uniform(-0.1, 0.1, 12) for rng in own])
        numbers = [rng.integers(self.variants) for rng in own] if self.variants else None
        self.batch.reset(q, np.zeros((k, self._force.shape[1])), which=which, numbers=numbers)
        self.action[which], self.count[which], self._force[which] = 0.0, 0, 0.0

    def step(
        self, action: Array, rngs: Sequence[np.random.Generator], over: Array | bool = False
    ) -> tuple[Array, Array]:
        """Return rewards and a mask of falls, (size,) each. Robots that are `over` get no push."""
        before, self.action = self.action, np.clip(self._numbers(action), -1.0, 1.0)
        targets = REST + REACH * self.action
        for name, column in zip(MOTORS, targets.T):
            self.batch.target(name, column)
        if self.push:
            self._pushes(rngs, over)
        ok = self.batch.step(self._force, SUBSTEPS)
        self.count += 1
        q, v = self.batch.q, self.batch.v
        self.up = _up(q[:, 3:7])
        fell = (q[:, 2] + HEIGHT < LOW * HEIGHT) | (self.up[:, 2] < TILTED) | ~ok
        speed, aside = v[:, 3], v[:, 4]
        reward = np.exp(-4.0 * (speed - WANTED) ** 2) - 0.5 * aside**2
        reward -= 0.02 * ((self.action - before) ** 2).sum(axis=1)
        reward -= 2e-4 * (v[:, 6:] ** 2).sum(axis=1)
        return reward, fell

    def _numbers(self, action: Any) -> Array:
        """An action (size, 12). Raises InputError, and nothing has changed then."""
        try:
            given = np.asarray(action, dtype=float)
        except (TypeError, ValueError):
            given = np.array(np.nan)
        if given.shape != self.action.shape or not np.isfinite(given).all():
            one = self.size == 1 and given.shape[:1] == (1,)  # the environment of a single robot
            shape = given.shape[1:] if one else given.shape
            wanted = "12 finite numbers" + (f" for each of {self.size}" if self.size > 1 else "")
            said = f"shape {shape}" if given.shape != self.action.shape else f"{action!r:.60}"
            raise pg.InputError(pg.Problem("step", "action", f"must be {wanted}, got {said}"))
        return given

    def _pushes(self, rngs: Sequence[np.random.Generator], over: Array | bool) -> None:
        """Now and then a force to the side and along on the trunk, for some actions."""
        begins, ends = self.count % OFTEN == OFTEN // 2, self.count % OFTEN == OFTEN // 2 + PUSHED
        self._force[ends, 3:5] = 0.0
        for i in np.flatnonzero(begins & ~np.asarray(over)).tolist():
            self._force[i, 3:5] = rngs[i].uniform(-PUSH, PUSH, 2)

    def observed(self) -> Array:
        """(size, 46) float32."""
        q, v = self.batch.q, self.batch.v
        parts = (q[:, 2:3] + HEIGHT, _up(q[:, 3:7]), v[:, 3:6], v[:, :3], q[:, 7:] - REST, v[:, 6:])
        return np.concatenate((*parts, self.action), axis=1).astype(np.float32)


def _refuse_drawing(render_mode: Any) -> None:
    if render_mode is not None:
        text = f"must be None: the environment draws nothing, got {render_mode!r:.60}"
        raise pg.InputError(pg.Problem("Quadruped", "render_mode", text))


def _whole(variants: Any) -> int:
    if isinstance(variants, bool) or not isinstance(variants, Integral) or variants < 1:
        text = f"must be a whole number >= 1, got {variants!r:.60}"
        raise pg.InputError(pg.Problem("Quadruped", "variants", text))
    return int(variants)


def _span(path: str, span: Any) -> tuple[float, float]:
    """The bounds within which a number is drawn. Raises InputError."""
    try:
        low, high = map(float, span)
    except (TypeError, ValueError):
        low = high = np.nan
    if not np.isfinite([low, high]).all() or low > high:
        text = f"must be (low, high), two finite numbers, got {span!r:.60}"
        raise pg.InputError(pg.Problem("Quadruped", f"numbers[{path!r}]", text))
    return low, high


def _up(quaternion: Array) -> Array:
    """(k, 3) the world's up in axes of the trunk."""
    w, x, y, z = quaternion.T
    return np.stack((2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)), axis=1)


OBSERVATION = gym.spaces.Box(-np.inf, np.inf, (46,), np.float32)
ACTION = gym.spaces.Box(-1.0, 1.0, (12,), np.float32)


class QuadrupedEnv(gym.Env[Array, Array]):
    """Environment of one robot, see `Walkers`."""

    metadata = {"render_modes": []}  # noqa: RUF012 (gymnasium's own protocol)
    observation_space, action_space = OBSERVATION, ACTION

    def __init__(self, render_mode: None = None, **options: Any):
        """`options` are those of `Walkers`. Raises InputError for a way of drawing."""
        _refuse_drawing(render_mode)
        self.render_mode = render_mode
        self.walkers = Walkers(1, threads=1, **options)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """At rest, joints within 0.1 rad of their home, feet within 2 cm of the ground's height.

        The first steps lift those below it.
        """
        super().reset(seed=seed)
        self.walkers.start(np.arange(1), [self.np_random])
        return self.walkers.observed()[0], {}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Twenty steps of 1 ms."""
        reward, fell = self.walkers.step(np.asarray(action)[None], [self.np_random])
        return self.walkers.observed()[0], float(reward[0]), bool(fell[0]), False, {}


class QuadrupedVectorEnv(VectorEnv):
    """Many robots in one batch; one that has ended is started by the next step."""

    def __init__(self, num_envs: int = 1, max_episode_steps: int = 1000, **options: Any):
        """`options` are those of `Walkers`. Raises InputError for a way of drawing."""
        _refuse_drawing(options.pop("render_mode", None))
        self.walkers = Walkers(num_envs, **options)  # which refuses a number that is none
        super().__init__(self.walkers, num_envs, OBSERVATION, ACTION, max_episode_steps)
