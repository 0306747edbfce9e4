"""Ctrl+C ends calls in which compiled code calls Python, or threads share the work."""

import signal

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.batches.instances import WORK_AT_ONCE
from pgraph_core.interrupts import Deferred
from pgraph_core.simulation import stepper as stepping
from pgraph_core.simulation.loop import PIECE, paced
from pgraph_core.simulation.options import STEPS_ALLOWED

MODEL = pg.Model.serial(2)
START = {"q": [0.3, 0.1], "t_end": 50.0, "step": 1e-2}


@pytest.fixture(autouse=True)
def heard():
    """Ctrl+C raises KeyboardInterrupt, also if a shell runs the tests in its background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


class Pressed:
    """A function of (t, q, v) in whose 100th call Ctrl+C is pressed."""

    def __init__(self, answer):
        self.calls, self.answer = 0, answer

    def __call__(self, t, q, v):
        self.calls += 1
        if self.calls == 100:
            signal.raise_signal(signal.SIGINT)
        return self.answer(q, v)


@pytest.mark.parametrize("method", ["rk4", "dop853", "radau5", "semi_implicit_euler"])
@pytest.mark.parametrize("as_event", [True, False])
def test_a_run_that_calls_python_ends_with_the_interrupt(method, as_event):
    pressed = Pressed(lambda q, v: 10.0 + q[0] if as_event else -q - 0.1 * v)
    given = {"events": pressed} if as_event else {"tau": pressed}
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        pg.simulate(MODEL, **START, **given, method=method)
    assert signal.getsignal(signal.SIGINT) is before
    assert pressed.calls < 1000  # of 10000 and more
    assert pg.simulate(MODEL, q=[0.3, 0.1], t_end=0.1, **given).status is pg.Status.DONE


def test_a_run_within_a_torque_function_ends_too():
    within = Pressed(lambda q, v: -q)

    def tau(t, q, v):
        return -pg.simulate(MODEL, q=q, t_end=1.0, tau=within, step=1e-2, method="rk4").q[-1]

    with pytest.raises(KeyboardInterrupt):
        pg.simulate(MODEL, **START, tau=tau, method="rk4")
    assert within.calls < 1000


def test_a_stepper_keeps_a_state_of_its_steps():
    pressed = Pressed(lambda q, v: -q)
    stepper = pg.Stepper(MODEL, step=1e-2, method="rk4", tau=pressed)
    with pytest.raises(KeyboardInterrupt):
        stepper.step(n=1000)
    other = pg.Stepper(MODEL, step=1e-2, method="rk4", tau=lambda t, q, v: -q)
    other.step(n=round(stepper.t / 1e-2))
    np.testing.assert_array_equal(stepper.q, other.q)
    assert stepper.step(n=10) is other.step(n=10)
    np.testing.assert_array_equal(stepper.q, other.q)


def test_a_stepper_whose_function_raised_needs_a_reset():
    def tau(t, q, v):
        if t > 0.05:
            raise ValueError("mine")
        return -q

    stepper = pg.Stepper(MODEL, step=1e-2, method="rk4", tau=tau)
    with pytest.raises(pg.InputError, match="mine"):
        stepper.step(n=100)
    with pytest.raises(pg.InputError, match="reset"):
        stepper.step()
    stepper.reset()
    assert stepper.step(n=3) is stepper.status


@pytest.mark.parametrize("model", [pg.Model.serial(3), pg.load("four_bar")], ids=["tree", "loop"])
@pytest.mark.parametrize("threads", [1, 2])
def test_all_instances_of_a_batch_have_taken_the_same_steps(monkeypatch, model, threads):
    options = {"step": 1e-3, "method": "rk4"}
    batch, other = (pg.BatchStepper(model, 40, threads=threads, **options) for _ in range(2))
    work = batch._many
    spread = work.spread

    def pressed(*given):
        signal.raise_signal(signal.SIGINT)
        spread(*given)

    monkeypatch.setattr(work, "spread", pressed)
    with pytest.raises(KeyboardInterrupt):
        batch.step(n=10 * WORK_AT_ONCE)
    monkeypatch.undo()
    taken = round(batch.t[0] / 1e-3)
    assert 1 <= taken <= WORK_AT_ONCE
    assert np.all(batch.t == batch.t[0])
    other.step(n=taken)
    batch.step(n=5)
    other.step(n=5)
    np.testing.assert_array_equal(batch.q, other.q)


@pytest.mark.parametrize("tau", [None, lambda t, q, v: -q], ids=["compiled", "python"])
def test_steps_do_not_depend_on_their_pieces(monkeypatch, tau):
    found = []
    for piece in (1, 7, 1000):
        monkeypatch.setattr(stepping, "paced", lambda *_, piece=piece: piece)
        stepper = pg.Stepper(MODEL, step=1e-2, method="rk4", tau=tau)
        stepper.step(n=100)
        found.append(stepper.q.copy())
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[0], found[2])


def test_a_piece_takes_its_time_and_grows_by_four_at_most():
    assert paced(100, PIECE) == 100
    assert paced(100, 10.0 * PIECE) == 10
    assert paced(100, 1e6 * PIECE) == 1
    assert paced(100, 0.0) == 400
    assert paced(STEPS_ALLOWED, 0.0) == STEPS_ALLOWED


def test_the_handler_of_a_program_is_called_at_once_and_its_exception_waits():
    seen = []

    def mine(*_):
        seen.append("called")
        raise RuntimeError("mine")

    def work():
        with Deferred():
            signal.raise_signal(signal.SIGINT)
            seen.append("goes on")

    before = signal.signal(signal.SIGINT, mine)
    try:
        with pytest.raises(RuntimeError, match="mine"):
            work()
        assert seen == ["called", "goes on"]
        assert signal.getsignal(signal.SIGINT) is mine
    finally:
        signal.signal(signal.SIGINT, before)
