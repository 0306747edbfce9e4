"""Environments for learning: Gymnasium's own checks, seeds, falls, and what is refused."""

import numpy as np
import pytest

import pgraph_core as pg
from tests.refusals import assert_names, refusal

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402

import pgraph_core.gym  # noqa: E402
from pgraph_core.gym import ENVIRONMENTS  # noqa: E402
from pgraph_models.quadruped_env import robot  # noqa: E402


def many(name: str = "pgraph/Quadruped-v0", n: int = 3, **options):
    return gymnasium.make_vec(name, num_envs=n, threads=2, **options)


@pytest.mark.filterwarnings("ignore:.*infinity:UserWarning")
@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_gymnasium_finds_nothing_wrong(name: str):
    check_env(gymnasium.make(name).unwrapped)


def test_it_stands_where_its_motors_hold_it():
    env = many()
    seen, _ = env.reset(seed=0)
    for _ in range(50):
        seen, _, fell, late, _ = env.step(np.zeros((3, 12)))
        assert not fell.any()
        assert not late.any()
    assert seen[:, 0] == pytest.approx(0.29, abs=0.03)


def test_one_that_falls_ends_and_starts_again_while_the_others_go_on():
    env = many()
    env.reset(seed=0)
    action = np.zeros((3, 12))
    action[1] = np.where(np.arange(12) % 3 == 0, 20.0, 0.0)
    env.unwrapped.walkers.batch.reset(
        np.r_[0, 0, -0.25, 1, 0, 0, 0, np.zeros(12)], np.zeros(18), which=[1]
    )
    _, _, fell, _, _ = env.step(action)
    assert fell.tolist() == [False, True, False]
    seen, reward, fell, _, _ = env.step(action)
    assert reward[1] == 0.0
    assert not fell.any()
    assert seen[1, 0] == pytest.approx(0.306, abs=0.01)
    assert env.unwrapped.walkers.batch.t.tolist() == pytest.approx([0.04, 0.0, 0.04])


def test_a_robot_that_is_torn_apart_fails_alone_and_among_others():
    """Hinges turn by 10 rad per step, and the last state has no orientation for warnings."""
    model = robot()
    one, batch = pg.Stepper(model), pg.BatchStepper(model, 4)
    v = np.zeros((4, 18))
    v[2, 6:] = 1e4
    one.reset(v=v[2])
    batch.reset(v=v)
    assert one.step(n=20) is pg.Status.NOT_FINITE
    assert batch.step(n=20).tolist() == [True, True, False, True]
    assert one.notices == ()
    assert batch.failures[2] in one.message


def test_pushes_move_the_trunk():
    """After 50 actions a force of up to 60 N acts on 8 kg and more."""
    fast = []
    for name in ("pgraph/Quadruped-v0", "pgraph/QuadrupedPush-v0"):
        env = many(name)
        seen, _ = env.reset(seed=2)
        for _ in range(54):
            seen, *_ = env.step(np.zeros((3, 12)))
        fast.append(np.abs(seen[:, 4:6]).max())
    assert fast[1] > 3 * fast[0]


@pytest.mark.parametrize("seeds", [5, [7, 3]])
def test_each_robot_of_many_is_the_single_one_of_its_seed(seeds):
    """Each robot has its own random generator, also where an episode ends in a push."""
    action = np.random.default_rng(3).uniform(-1, 1, (110, 2, 12)).astype(np.float32)
    options = {"variants": 4, "max_episode_steps": 50}
    many = gymnasium.make_vec("pgraph/QuadrupedPush-v0", num_envs=2, **options)
    found = [many.reset(seed=seeds)[0], *(many.step(a) for a in action)]
    assert not np.array_equal(*found[0])
    for i in range(2):
        one = gymnasium.make("pgraph/QuadrupedPush-v0", **options)
        assert np.array_equal(one.reset(seed=5 + i if seeds == 5 else seeds[i])[0], found[0][i])
        over = False
        for k, a in enumerate(action):
            seen, _, fell, late, _ = (
                (one.reset()[0], 0.0, False, False, {}) if over else one.step(a[i])
            )
            over = fell or late
            assert np.array_equal(found[k + 1][0][i], seen)
            assert (found[k + 1][2][i], found[k + 1][3][i]) == (fell, late)


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"variants": 0}, "variants"), ({"variants": -3}, "variants"), ({"nubmers": {}}, "numbers"),
        ({"numbers": {"bodies.trunk.mass": (7, 5)}}, "trunk.mass"), ({"terrain": "moon"}, "flat"),
        ({"numbers": {"bodies.trunk.mass": (np.nan, 5)}}, "trunk.mass"), ({"n": 0}, ">= 1"),
        ({"numbers": {"bodies.trunk.mas": (1, 2)}}, r"bodies.trunk.mas\b"), ({"n": -1}, ">= 1"),
        ({"render_mode": "human"}, "render_mode.*'human'"),
    ],
)  # fmt: skip
def test_options_that_are_wrong_are_refused(options: dict, field: str):
    with pytest.raises(pg.InputError, match=field):
        many(**options)


@pytest.mark.parametrize("action", [np.full((3, 12), np.nan), np.zeros((3, 2)), "x"])
def test_a_refused_action_changes_nothing(action):
    env = many()
    env.reset(seed=0)
    env.step(np.zeros((3, 12)))
    before = env.unwrapped.walkers.observed()
    with pytest.raises(pg.InputError, match="12"):
        env.unwrapped.step(action)
    np.testing.assert_array_equal(env.unwrapped.walkers.observed(), before)
    assert np.isfinite(env.step(np.zeros((3, 12)))[1]).all()


# -- environments of any model ---------------------------------------------------------------------


def pole(**motor) -> pg.Model:
    cart = pg.Body(name="cart", joint="prismatic", axes=(1, 0, 0), mass=1.0)
    rod = pg.Body(
        name="rod", parent="cart", axes=(0, 1, 0), com=(0, 0, 0.5), inertia=(0.1, 0.1, 0.01)
    )
    return pg.Model(bodies=[cart, rod], forces=[pg.Motor(name="push", body="cart", **motor)])


def servo() -> pg.Model:
    drive = pg.Servo(name="drive", body="rod", kp=20.0, kd=1.0)
    return pole().remove("push").edit("rod", limits=((-1.0, 2.0),)).add(drive)


def seen() -> pg.Model:
    return pole().add(pg.Output(name="tip", kind="position", at="rod"))


MODELS = {
    "motor": (pole(torque_limit=3.0), (-3.0, 3.0), 4),
    "geared motor": (pole(gear=2.0, input_low=-1.0, input_high=2.0), (-1.0, 2.0), 4),
    "servo": (servo(), (-1.0, 2.0), 4),
    "outputs": (seen(), (-np.inf, np.inf), 3),
    "no drives": (pole().remove("push"), (-np.inf, np.inf), 4),
}


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("name", MODELS)
def test_any_model_is_an_environment_alone_and_among_many(name: str):
    """Many in one batch see and earn what each would alone, to rounding of float32."""
    model, (low, high), width = MODELS[name]
    given = {
        "dt": 0.03,
        "reward": lambda seen, action: -abs(seen[..., 0]),
        "ended": lambda seen: abs(seen[..., 0]) > 0.5,
        "start": lambda rng: (rng.uniform(-0.1, 0.1, 2), np.zeros(2)),
    }
    one, many = (pgraph_core.gym.make(model, n, **given) for n in (None, 3))
    check_env(one)
    assert one.action_space.low[0] == low == many.single_action_space.low[0]
    assert one.action_space.high[0] == high
    assert one.observation_space.shape == (width,)
    alone, _ = one.reset(seed=1)
    rows, _ = many.reset(seed=1)
    np.testing.assert_allclose(rows[0], alone, rtol=1e-5, atol=1e-6)
    many.action_space.seed(0)
    for _ in range(20):
        action = many.action_space.sample()
        rows, earned, ended, *_ = many.step(action)
        alone, reward, over, *_ = one.step(action[0])
        np.testing.assert_allclose(rows[0], alone, rtol=1e-4, atol=1e-5)
        assert earned[0] == pytest.approx(reward, abs=1e-5)
        assert ended[0] == over
        if over:
            break


def test_an_episode_lasts_as_long_as_its_actions_and_its_limit():
    env = pgraph_core.gym.make(pole(), dt=0.05, max_episode_steps=4)
    env.reset(seed=0)
    ends = [env.step(np.zeros(1))[3] for _ in range(4)]
    assert ends == [False, False, False, True]
    assert env.unwrapped.stepper.t == pytest.approx(0.2)
    many = pgraph_core.gym.make(pole(), 2, dt=0.05, max_episode_steps=4)
    many.reset(seed=0)
    assert [many.step(np.zeros((2, 1)))[3].tolist() for _ in range(5)][2:] == [
        [False, False], [True, True], [False, False],
    ]  # fmt: skip


def test_an_action_beyond_the_limits_acts_as_the_limit():
    one, other = (pgraph_core.gym.make(pole(torque_limit=3.0)) for _ in range(2))
    for env in (one, other):
        env.reset(seed=0)
    assert np.array_equal(one.step(np.array([30.0]))[0], other.step(np.array([3.0]))[0])


@pytest.mark.parametrize(
    ("make", "facts"),
    [
        (lambda: pgraph_core.gym.make(pole(), dt=0.0), ("dt", "> 0")),
        (lambda: pgraph_core.gym.make(pole(), dt="1"), ("dt", "'1'")),
        (lambda: pgraph_core.gym.make("pole"), ("mechanism", "'pole'")),
        (lambda: pgraph_core.gym.make(pole(lag=0.1), 2), ("num_envs", "push")),
        (lambda: pgraph_core.gym.make(pole(), 0), ("size", "0")),
        (lambda: pgraph_core.gym.make(pole(), 2, workers=2), ("workers",)),
        (lambda: pgraph_core.gym.make(pole()).step([1.0, 2.0]), ("action",)),
        (lambda: pgraph_core.gym.make(pole()).step([np.nan]), ("action", "nan")),
    ],
)
def test_what_no_environment_is_made_of_is_refused(make, facts):
    assert_names(str(refusal(make)), *facts)


@pytest.mark.parametrize("reward", [np.nan, -np.inf])
def test_a_reward_that_is_no_finite_number_is_refused(reward):
    """A learner would go on with it in silence."""
    model = pg.Model.serial(2)
    one = pgraph_core.gym.make(model, reward=lambda seen, action: reward)
    some = pgraph_core.gym.make(
        model, num_envs=2, reward=lambda seen, action: np.full(len(seen), reward)
    )
    for env in (one, some):
        env.reset(seed=0)
        told = refusal(lambda env=env: env.step(env.action_space.sample()))
        assert_names(str(told), "gym.make, reward", "finite", str(reward))


def test_a_step_before_reset_is_refused_if_episodes_end():
    env = pgraph_core.gym.make(pole(), dt=0.05, max_episode_steps=2)
    with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
        env.step(env.action_space.sample())
    env.reset(seed=1)
    assert [env.step(env.action_space.sample())[3] for _ in range(2)] == [False, True]


def test_an_action_excites_muscles_and_feeds_actuators():
    arm = pg.Body(name="arm", mass=1.0, com=(0, 0, -0.2), inertia=(0.02, 0.02, 0.002), q=(0.5,))
    places = {"body": "arm", "point": (0, 0, -0.1)}
    muscle = pg.Muscle("flexor", other_point=(0.05, 0, 0.15), f_max=300, l_opt=0.15, l_slack=0.1,
                       **places)  # fmt: skip
    jack = pg.LinearActuator("jack", other_point=(-0.05, 0, 0.15), input_low=-1, input_high=1,
                             gain=10, **places)  # fmt: skip
    model = pg.Model(bodies=[arm], forces=[muscle, jack])
    env = pgraph_core.gym.make(model, dt=0.02)
    assert env.action_space.low.tolist() == [0, -1]
    assert env.action_space.high.tolist() == [1, 1]
    run = pg.simulate(model, t_end=0.2, inputs={"flexor": 0.75, "jack": 0.25}, rtol=1e-10,
                      method="dop853")  # fmt: skip
    for _ in range(2):  # an episode begins without the excitation of the last one
        env.reset(seed=0)
        for _ in range(10):
            seen, *_ = env.step(np.array([0.75, 0.25]))
        assert seen == pytest.approx([run.q[-1, 0], run.v[-1, 0]], rel=1e-5)
    problem = refusal(lambda: pgraph_core.gym.make(model, num_envs=2))
    assert_names(str(problem), "num_envs", "flexor", "jack")
