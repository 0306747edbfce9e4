"""Gymnasium environments for any model, and for a quadruped that learns to walk.

    env = pgraph_core.gym.make(model, dt=0.02, reward=lambda seen, action: -abs(seen[..., 0]))
    many = pgraph_core.gym.make(model, num_envs=256, dt=0.02, reward=...)

Importing the module registers "pgraph/Quadruped-v0" for `gymnasium.make` and `gymnasium.make_vec`;
"pgraph/QuadrupedRough-v0" walks over bars of random height, "pgraph/QuadrupedPush-v0" is pushed.
`numbers={"bodies.trunk.mass": (5, 7)}` says which numbers of the description differ from start to
start, and within which bounds. Needs gymnasium: pip install pgraph-dynamics[gym].
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from .batches.batch_stepper import BatchStepper
from .dynamics.arguments import finite
from .errors import InputError, Problem, choices, explained, needed, shown
from .forces import Driven, OnJoint
from .mechanism import Mechanism, mechanism_of
from .model import Model, Motor, Servo
from .simulation.stepper import Stepper

Array = npt.NDArray[Any]
gymnasium = needed("gymnasium", "gym")
ENVIRONMENTS: dict[str, dict[str, Any]] = {
    "pgraph/Quadruped-v0": {},
    "pgraph/QuadrupedRough-v0": {"terrain": "rough"},
    "pgraph/QuadrupedPush-v0": {"push": True},
}
PLACE = "pgraph_models.quadruped_env"
Reward = Callable[[Array, Array], Any]  # function of (observation, action), one or one per row
Ended = Callable[[Array], Any]  # function of an observation, one or one per row
Start = Callable[[np.random.Generator], tuple[Any, Any]]  # (q, v) of an episode

for _name, _options in ENVIRONMENTS.items():
    gymnasium.register(
        _name,
        entry_point=f"{PLACE}:QuadrupedEnv",
        vector_entry_point=f"{PLACE}:QuadrupedVectorEnv",
        max_episode_steps=1000,
        kwargs=_options,
    )


@explained
def make(
    model: Model | Mechanism,
    num_envs: int | None = None,
    *,
    dt: float = 0.02,
    reward: Reward | None = None,
    ended: Ended | None = None,
    start: Start | None = None,
    max_episode_steps: int | None = None,
    **options: Any,
) -> Any:
    """Create an environment for a model. If `num_envs` is given, a vector environment with one
    `BatchStepper` is returned.

    An action contains the inputs of the model's motors, servos, actuators and muscles, within their
    limits, or the torques of all joints if the model has none. It acts for `dt` [s]. The
    observation contains the model's outputs in order, or q and v if the model has none. `reward`
    and `ended` are functions of (observation, action) and of the observation, by default 0 and
    never. Vector environments call them with one row per instance. An episode also ends if the run
    fails. `start(rng)` returns the initial (q, v) of an episode, by default the initial state of
    the model. `options` are arguments of `Stepper` or `BatchStepper`. Raises InputError.
    """
    task = Task(mechanism_of(model, "gym.make"), dt, reward, ended, start)
    if num_envs is not None:
        many = Instances(task, num_envs, options)
        most = math.inf if max_episode_steps is None else max_episode_steps
        seen = task.observations(many.observed())
        return VectorEnv(many, num_envs, seen, many.actions, most)
    env = ModelEnv(task, options)
    if max_episode_steps is None:
        return env
    env = gymnasium.wrappers.OrderEnforcing(env, disable_render_order_enforcing=True)
    return gymnasium.wrappers.TimeLimit(env, max_episode_steps)


class Task:
    """The observations, actions and rewards for a model's environment."""

    def __init__(
        self,
        mech: Mechanism,
        dt: float,
        reward: Reward | None,
        ended: Ended | None,
        start: Start | None,
    ):
        if not (isinstance(dt, (int, float)) and 0.0 < dt < math.inf):
            text = f"must be a number > 0 [s], got {shown(dt)}"
            raise InputError(Problem("gym.make", "dt", text))
        self.mech, self.dt, self.start = mech, float(dt), start
        self.reward = reward or (lambda seen, action: np.zeros(seen.shape[:-1]))
        self.ended = ended or (lambda seen: np.zeros(seen.shape[:-1], dtype=bool))

    def rewarded(self, seen: Array, action: Array) -> Any:
        """Return the reward of a step. Raises InputError if it is not a finite number."""
        found = self.reward(seen, action)
        if not np.isfinite(found).all():
            text = f"must return finite numbers, got {shown(found)} for {shown(seen)}"
            raise InputError(Problem("gym.make", "reward", text))
        return found

    def substeps(self, options: dict[str, Any]) -> tuple[int, dict[str, Any]]:
        """Return the steps per action, and options with a step that divides the interval."""
        step = options.get("step") or Stepper(self.mech, **options).width
        n = max(1, math.ceil(self.dt / step - 0.5))
        return n, {**options, "step": self.dt / n}

    def drives(self, inputs: Sequence[str]) -> list[Driven]:
        """Return the forces that take the actions as inputs."""
        forces = self.mech.model.forces
        return [f for f in forces if isinstance(f, Driven) and f.name in inputs]

    def actions(self, drives: Sequence[Driven]) -> Any:
        """Return the action space."""
        bounds = [self._bounds(f) for f in drives] or [(-math.inf, math.inf)] * self.mech.nv
        low, high = np.array(bounds, dtype=np.float32).reshape(-1, 2).T
        return gymnasium.spaces.Box(low, high, dtype=np.float32)

    def _bounds(self, f: Driven) -> tuple[float, float]:
        """Return the limits of an input, narrowed by the motor's torque or the joint limits."""
        low, high = f.inputs
        if isinstance(f, Motor) and not f.integrates:
            low, high = max(low, f.torques[0]), min(high, f.torques[1])
        if isinstance(f, Servo) and not f.coefficients and f.gear == 1.0:
            limits = self.mech.model.body(f.body).limits[f.coordinate :]
            least, most = (limits[0] if limits else None) or (None, None)
            low = low if least is None else max(low, least)
            high = high if most is None else min(high, most)
        return low, high

    def observations(self, seen: Array) -> Any:
        """Return the observation space."""
        return gymnasium.spaces.Box(-np.inf, np.inf, seen.shape[-1:], np.float32)

    def seen(self, stepper: Stepper | BatchStepper, leading: tuple[int, ...]) -> Array:
        """Return the observation (..., n) in float32, which is the outputs, or q and v."""
        parts = stepper.outputs.values() if self.mech.model.outputs else (stepper.q, stepper.v)
        rows = [np.asarray(x).reshape(*leading, -1) for x in parts]
        return np.concatenate(rows, axis=-1).astype(np.float32)

    def state(self, rng: np.random.Generator) -> tuple[Any, Any]:
        """Return the initial (q, v) for an episode. If None, the initial state of the model is
        used."""
        return (None, None) if self.start is None else self.start(rng)

    def checked(self, action: Any, space: Any) -> Array:
        """Return an action as an array within the limits. Raises InputError."""
        given = finite("action", action, *space.shape)
        return np.clip(given, space.low, space.high)


class ModelEnv(gymnasium.Env):
    """An environment for a single instance of a model, see `make`."""

    metadata = {"render_modes": []}  # noqa: RUF012 (gymnasium's own protocol)

    def __init__(self, task: Task, options: dict[str, Any]):
        self.task, self.render_mode = task, None
        self._substeps, options = task.substeps(options)
        self.stepper = Stepper(task.mech, **options)
        self.drives = task.drives([*self.stepper.inputs])
        self.action_space = task.actions(self.drives)
        self.observation_space = task.observations(task.seen(self.stepper, ()))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Start an episode."""
        super().reset(seed=seed)
        self.stepper.reset(*self.task.state(self.np_random))
        return self.task.seen(self.stepper, ()), {}

    def step(self, action: Any) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Apply an action for `dt`. Raises InputError if the action is invalid."""
        given = self.task.checked(action, self.action_space)
        if self.drives:
            inputs = {f.name: x for f, x in zip(self.drives, given.tolist())}
            status = self.stepper.step(n=self._substeps, inputs=inputs)
        else:
            status = self.stepper.step(given, self._substeps)
        seen = self.task.seen(self.stepper, ())
        over = not status.ok or bool(self.task.ended(seen))
        info = {} if status.ok else {"message": self.stepper.message}
        return seen, float(self.task.rewarded(seen, given)), over, False, info


class Many(Protocol):
    """The instances that `VectorEnv` steps."""

    def start(self, which: Array, rngs: Sequence[np.random.Generator]) -> None:
        """Start episodes, sampling each one with the generator for its instance."""
        ...

    def step(
        self, action: Any, rngs: Sequence[np.random.Generator], over: Array
    ) -> tuple[Array, Array]:
        """Return rewards and a mask of ended episodes. Instances that are `over` restart."""
        ...

    def observed(self) -> Array:
        """Return the observations, one row per instance."""
        ...


class VectorEnv(gymnasium.vector.VectorEnv):
    """A batch of environments. The step after the end of an episode starts a new episode."""

    metadata = {  # noqa: RUF012 (gymnasium's own protocol)
        "render_modes": [], "autoreset_mode": gymnasium.vector.AutoresetMode.NEXT_STEP
    }  # fmt: skip

    def __init__(self, many: Many, num_envs: int, observation: Any, action: Any, most: float):
        """Create environments with the spaces of one instance and episodes of `most` steps."""
        self.many, self.num_envs, self._most = many, num_envs, most
        self.single_observation_space, self.single_action_space = observation, action
        self.observation_space = gymnasium.vector.utils.batch_space(observation, num_envs)
        self.action_space = gymnasium.vector.utils.batch_space(action, num_envs)
        self._over = np.zeros(num_envs, dtype=bool)
        self._count = np.zeros(num_envs, dtype=np.int64)  # steps of each episode
        self._rngs: list[np.random.Generator] = []

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Array, dict[str, Any]]:
        """Reset all instances. Instance i has seed + i, or the i-th of a list of seeds."""
        if seed is not None or not self._rngs:
            self._rngs = [gymnasium.utils.seeding.np_random(x)[0] for x in self._seeds(seed)]
        self._start(np.arange(self.num_envs))
        self._over[:] = False
        return self.many.observed(), {}

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        if seed is None:
            return [None] * self.num_envs
        if not isinstance(seed, Sequence):
            return [seed + i for i in range(self.num_envs)]
        if len(seed) != self.num_envs:
            text = f"must be one, or one for each of {self.num_envs}, got {len(seed)}"
            raise InputError(Problem("reset", "seed", text))
        return list(seed)

    def _start(self, which: Array) -> None:
        self.many.start(which, self._rngs)
        self._count[which] = 0

    def step(self, actions: Any) -> tuple[Array, Array, Array, Array, dict[str, Any]]:
        """Advance all instances by one step."""
        begun = np.flatnonzero(self._over)
        reward, ended = self.many.step(actions, self._rngs, self._over)
        self._count += 1
        if len(begun):
            self._start(begun)
            reward[begun], ended[begun] = 0.0, False
        late = self._count >= self._most
        self._over = ended | late
        return self.many.observed(), reward, ended, late, {}


class Instances:
    """Model instances in a `BatchStepper` that take motor and servo inputs, see `make`."""

    def __init__(self, task: Task, size: int, options: dict[str, Any]):
        of_batch = {k: options.pop(k) for k in ("threads", "set") if k in options}
        self._substeps, options = task.substeps(options)
        self.task, self.drives = task, task.drives([*Stepper(task.mech, **options).inputs])
        self._motors = [i for i, f in enumerate(self.drives) if isinstance(f, Motor)]
        model = task.mech.model
        for i in self._motors:  # whose torques an action brings
            model = model.edit(self.drives[i].name, torque=0.0)
        self.batch = BatchStepper(model, size, **of_batch, **options)
        if other := [f.name for f in self.drives if not isinstance(f, DRIVEN) or f.has_state]:
            text = f"takes motors and servos without lag or integral, not {choices(other)}; "
            text += "use gymnasium.vector.SyncVectorEnv of single environments"
            raise InputError(Problem("gym.make", "num_envs", text))
        motors = [f for f in self.drives if isinstance(f, Motor)]
        self._arms = np.array([_arms(task.mech, f) for f in motors])
        self.actions = task.actions(self.drives)
        self._space = gymnasium.vector.utils.batch_space(self.actions, size)

    def start(self, which: Array, rngs: Sequence[np.random.Generator]) -> None:
        """Start episodes."""
        states = [self.task.state(rngs[i]) for i in which.tolist()]
        q, v = ([x for x in part if x is not None] for part in zip(*states))
        self.batch.reset(q or None, v or None, which=which)

    def step(
        self, action: Any, rngs: Sequence[np.random.Generator], over: Array
    ) -> tuple[Array, Array]:
        """Return rewards and a mask of ended episodes after `dt`. Raises InputError by shape."""
        given = self.task.checked(action, self._space)
        tau = np.zeros((self.batch.size, self.task.mech.nv)) if self.drives else given
        for f, column in zip(self.drives, given.T):
            if isinstance(f, Servo):
                self.batch.target(f.name, column)
        if self._motors:
            tau = given[:, self._motors] @ self._arms
        ok = self.batch.step(tau, self._substeps)
        seen = self.observed()
        ended = np.array(self.task.ended(seen), dtype=bool) | ~ok
        return np.array(self.task.rewarded(seen, given), dtype=float), ended

    def observed(self) -> Array:
        """Return the observations, one row per instance."""
        return self.task.seen(self.batch, (self.batch.size,))


DRIVEN = (Motor, Servo)  # whose inputs a batch takes


def _arms(mech: Mechanism, f: OnJoint) -> Array:
    """Return the joint torques (nv,) for a unit motor force."""
    found = np.zeros(mech.nv)
    for name, k, factor in f.terms:
        found[mech.joints[name].v.start + k] += factor
    return found
