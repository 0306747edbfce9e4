"""Gradients of a final coordinate, beside MJX (`jax.grad`) and Drake (`AutoDiffXd`).

Errors are relative to the largest derivative, against complex steps through the equations of a
planar chain, or against the closed form of a ball that bounces without loss. The ball meets a limit
in Pgraph and a stiff spring in MJX, for 7 ms. Drake takes no dissipation from Python with AutoDiff.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

import pgraph_core as pg
from pgraph_peers import drake as in_drake
from pgraph_peers import mujoco as in_mujoco
from pgraph_peers.rows import rows_of

from .machine import absent, has
from .measure import Effort, Row, in_turns
from .scenes import STEP, Scene, State

MINUTES = 4.0
PEERS = ("jax", "mujoco-mjx", "drake")
MASS, COM, INERTIA, GRAVITY = 1.0, 0.5, 1.0 / 12.0, 9.81
RADIUS, STIFFNESS = 0.1, 2e5  # of the ball [m], of what it meets [N/m]
TOLERANCE = 1e-10  # of runs with chosen steps
TINY = 1e-200  # of a complex step
Sides = tuple[Callable[[], float], Callable[[], np.ndarray]]  # a run, and its gradient


class Case(NamedTuple):
    """A model, the end of its run, and the numbers by which its last coordinate is derived."""

    name: str
    model: pg.Model
    end: float  # s
    paths: tuple[str, ...]
    values: np.ndarray
    exact: np.ndarray  # derivatives by the numbers

    @property
    def state(self) -> State:
        """The initial state."""
        mech = pg.Mechanism(self.model)
        q, v = mech.home()
        return State(self.model, mech.topology, q, v, 0 * v, 0 * v, np.zeros((mech.nb, 6)))

    @property
    def scene(self) -> Scene:
        """The model in rows, in its initial state."""
        return Scene(self.name, self.state, rows_of(self.model))


def rows(effort: Effort) -> Iterator[Row]:
    end = effort.pick(1.0, 0.02)
    for case in (chain(2, end), *effort.pick((chain(10, end),), ()), ball(effort.pick(0.5, 0.1))):
        engines = dict(sides(case))
        both = {f"{by} {k}": one[k] for by, one in engines.items() for k in (0, 1)}
        seconds = in_turns(both, effort.pick(5, 1), effort.shortest)
        ours = float(np.median(seconds["pgraph 1"]))
        for by, one in engines.items():
            error = np.abs(one[1]() - case.exact).max() / np.abs(case.exact).max()
            run, gradient = (float(np.median(seconds[f"{by} {k}"])) for k in (0, 1))
            yield {
                "case": f"{case.name}, {len(case.paths)} numbers", "by": by, "error": float(error),
                "seconds": gradient, "low": min(seconds[f"{by} 1"]),
                "high": max(seconds[f"{by} 1"]), "ratio": gradient / ours,
                "own runs": gradient / run,
            }  # fmt: skip


def sides(case: Case) -> Iterator[tuple[str, Sides]]:
    """Every installed engine."""
    steps: dict[str, Any] = {"method": "rk4", "step": STEP}
    chosen: dict[str, Any] = {"method": "dop853", "rtol": TOLERANCE}
    bounces = case.name == "ball"
    yield "pgraph", in_pgraph(case, {"method": "moreau_jean", "step": STEP} if bounces else steps)
    if not bounces:
        yield "pgraph dop853", in_pgraph(case, chosen)
    if not absent(("jax", "mujoco-mjx")):
        yield "mjx", (ball_in_mjx if bounces else chain_in_mjx)(case)
    if has("drake") and not bounces:
        yield "drake", in_autodiff(case)


# -- cases -----------------------------------------------------------------------------------------


def chain(n: int, end: float) -> Case:
    """Rods that hang on each other, released to one side."""
    given: dict[str, Any] = {
        "axes": (0, 1, 0), "com": (0, 0, -COM), "mass": MASS, "inertia": INERTIA * np.eye(3)
    }  # fmt: skip
    bodies = [pg.Body(name="0", q=[0.8], v=[0.3], **given)]
    bodies += [
        pg.Body(name=f"{i}", parent=f"{i - 1}", link=(0, 0, -1), q=[0.2], **given)
        for i in range(1, n)
    ]
    paths = ("bodies.0.mass", f"bodies.{n - 1}.mass", "bodies.1.link.2", "q.0", "v.0")
    values = np.array([MASS, MASS, -1.0, 0.8, 0.3])

    def final(p: np.ndarray) -> complex:
        mass, length = np.full(n, MASS, complex), np.ones(n, complex)
        mass[0], mass[-1], length[0] = p[0], p[1], -p[2]
        q, v = np.full(n, 0.2, complex), np.zeros(n, complex)
        q[0], v[0] = p[3], p[4]
        y = np.concatenate((q.cumsum(), v.cumsum()))
        rates = equations(mass, length)
        found = solve_ivp(rates, (0, end), y, "DOP853", rtol=1e-13, atol=1e-14).y[:n, -1]
        return found[-1] - found[-2]

    model = pg.Model(bodies=bodies, gravity=(0, 0, -GRAVITY))
    name = "double pendulum" if n == 2 else f"chain of {n}"
    return Case(name, model, end, paths, values, by_complex_steps(final, values))


def equations(mass: np.ndarray, length: np.ndarray) -> Callable[[float, np.ndarray], np.ndarray]:
    """The rates of angles from the vertical and of their speeds [Lagrange], for complex numbers."""
    n = len(mass)
    beyond = mass[::-1].cumsum()[::-1] - mass  # on the end of each rod
    arms = mass * COM + length * beyond
    coupling = np.minimum.outer(np.arange(n), np.arange(n))
    last = np.maximum.outer(np.arange(n), np.arange(n))
    weights = length[coupling] * arms[last]
    weights[np.diag_indices(n)] = INERTIA + mass * COM**2 + length**2 * beyond

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        angles, speeds = y[:n], y[n:]
        apart = angles[:, None] - angles
        pull = (weights * np.sin(apart)) @ speeds**2 + GRAVITY * arms * np.sin(angles)
        return np.concatenate((speeds, -np.linalg.solve(weights * np.cos(apart), pull)))

    return rates


def ball(end: float) -> Case:
    """A ball that falls, and bounces once without loss."""
    body = pg.Body(
        name="b", joint="prismatic", axes=(0, 0, 1), mass=MASS, q=[0.5], v=[-0.2],
        limits=[(RADIUS, None)], limit_restitution=(1.0,),
    )  # fmt: skip

    def final(p: np.ndarray) -> complex:
        z, v, g = p
        speed = np.sqrt(v * v - 2.0 * g * (z - RADIUS))
        fall = (v + speed) / -g
        if fall.real > end:
            return z + v * end + g * end * end / 2.0
        left = end - fall
        return RADIUS + speed * left + g * left * left / 2.0

    values = np.array([0.5, -0.2, -GRAVITY])
    model = pg.Model(bodies=[body], gravity=(0, 0, -GRAVITY))
    paths = ("q.b", "v.b", "gravity.2")
    return Case("ball", model, end, paths, values, by_complex_steps(final, values))


def by_complex_steps(final: Callable[[np.ndarray], complex], values: np.ndarray) -> np.ndarray:
    """The derivatives of an analytic function."""
    return np.array([final(values + 1j * TINY * e).imag / TINY for e in np.eye(len(values))])


# -- engines ---------------------------------------------------------------------------------------


def in_pgraph(case: Case, options: dict[str, Any]) -> Sides:
    given: dict[str, Any] = {"t_end": case.end, "frames": 2, "estimate": False, **options}

    def gradient() -> np.ndarray:
        run, place = pg.simulate(case.model, wrt=case.paths, **given), len(case.model.bodies) - 1
        return np.array([run.sensitivity(path)[-1, place] for path in case.paths])

    return lambda: pg.simulate(case.model, **given).q[-1, -1], gradient


def jitted(final: Callable[[Any], Any], values: np.ndarray) -> Sides:
    """A compiled run and its gradient by reverse mode."""
    jax: Any = import_module("jax")
    run, slopes = jax.jit(final), jax.jit(jax.grad(final))
    return lambda: float(run(values)), lambda: np.array(slopes(values))


def in_doubles() -> Any:
    """MJX in double precision."""
    import_module("jax").config.update("jax_enable_x64", True)
    return import_module("mujoco.mjx")


def stepped(mjx: Any, model: Any, data: Any, end: float) -> Any:
    """The last coordinate at the end of a run in MJX."""

    def step(data: Any, _: Any) -> tuple[Any, None]:
        return mjx.step(model, data), None

    return import_module("jax").lax.scan(step, data, None, round(end / STEP))[0].qpos[-1]


def chain_in_mjx(case: Case) -> Sides:
    mjx = in_doubles()
    own, data, _ = in_mujoco.loaded(case.scene, STEP, "rk4")
    model, start = mjx.put_model(own), mjx.put_data(own, data)

    def final(p: Any) -> Any:
        changed = model.replace(
            body_mass=model.body_mass.at[1].set(p[0]).at[-1].set(p[1]),
            body_pos=model.body_pos.at[2, 2].set(p[2]),
        )
        q, v = start.qpos.at[0].set(p[3]), start.qvel.at[0].set(p[4])
        return stepped(mjx, changed, start.replace(qpos=q, qvel=v), case.end)

    return jitted(final, case.values)


BALL = f"""<mujoco><option timestep="{STEP}" integrator="RK4" iterations="1" ls_iterations="4">
<flag eulerdamp="disable"/></option><worldbody><geom type="plane" size="5 5 0.1" condim="1"
 solref="-{STIFFNESS} 0" solimp="0.9999 0.9999 0.001"/><body><joint type="slide" axis="0 0 1"/>
<geom type="sphere" size="{RADIUS}" mass="{MASS}" condim="1" solref="-{STIFFNESS} 0"
 solimp="0.9999 0.9999 0.001"/></body></worldbody></mujoco>"""


def ball_in_mjx(case: Case) -> Sides:
    mujoco: Any = import_module("mujoco")

    mjx = in_doubles()
    own = mujoco.MjModel.from_xml_string(BALL)
    model, start = mjx.put_model(own), mjx.make_data(own)

    def final(p: Any) -> Any:
        gravity = model.opt.gravity.at[2].set(p[2])
        changed = model.replace(opt=model.opt.replace(gravity=gravity))
        data = start.replace(qpos=start.qpos.at[0].set(p[0]), qvel=start.qvel.at[0].set(p[1]))
        return stepped(mjx, changed, data, case.end)

    return jitted(final, case.values)


def drake(name: str) -> Any:
    """A module of Drake."""
    return import_module(f"pydrake.{name}")


def in_autodiff(case: Case) -> Sides:
    """A run with numbers and one with AutoDiffXd, both with steps chosen by their error."""
    auto, analysis = drake("autodiffutils"), drake("systems.analysis")
    plants = {kind: chain_in_drake(case, kind) for kind in (float, auto.AutoDiffXd)}

    def simulated(kind: Any, values: Any) -> Any:
        plant, begin = plants[kind]
        context = plant.CreateDefaultContext()
        begin(context, values)
        simulator = analysis.Simulator_[kind](plant, context)
        analysis.ResetIntegratorFromFlags(simulator, "runge_kutta3", kind(0.1))
        simulator.get_mutable_integrator().set_target_accuracy(TOLERANCE)
        simulator.AdvanceTo(case.end)
        return plant.GetPositions(context)[-1:]

    def gradient() -> np.ndarray:
        numbers = auto.InitializeAutoDiff(case.values).ravel()
        return auto.ExtractGradient(simulated(auto.AutoDiffXd, numbers).reshape(-1, 1))[0]

    return lambda: float(simulated(float, case.values)[0]), gradient


def chain_in_drake(case: Case, kind: Any) -> tuple[Any, Callable[..., None]]:
    tree, place = drake("multibody.tree"), drake("math").RigidTransform_[kind]
    plant, joints = in_drake.build(case.scene)
    plant = plant if kind is float else plant.ToAutoDiffXd()
    last, state = len(case.model.bodies) - 1, case.state

    def begin(context: Any, p: Any) -> None:
        for i, mass in ((0, p[0]), (last, p[1])):
            about = INERTIA / mass + COM**2  # over the mass, about the joint
            unit = tree.UnitInertia_[kind](about, about, INERTIA / mass)
            inertia = tree.SpatialInertia_[kind](mass, np.array([0.0, 0.0, -COM]), unit)
            plant.GetBodyByName(f"{i}").SetSpatialInertiaInBodyFrame(context, inertia)
        arm = place(np.array([0 * p[2], 0 * p[2], p[2]]))
        plant.GetFrameByName("1.at").SetPoseInParentFrame(context, arm)
        for i, name in enumerate(joints):
            joint = plant.GetJointByName(name)
            joint.set_angle(context, p[3] if i == 0 else kind(state.q[i]))
            joint.set_angular_rate(context, p[4] if i == 0 else kind(state.v[i]))
        force = plant.get_applied_generalized_force_input_port()
        force.FixValue(context, np.zeros(len(joints)))

    return plant, begin
