"""Fig. 7: frames updated along Pgraph equal the absolute ones, naive increments drift."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pgraph_core as pg
from pgraph_core.paper import Operators
from pgraph_core.paper import frames as absolute
from pgraph_core.paper.frame_update import frame_update_trace, frame_vectors, increments, visits

from .trees import moved, random_body, random_case, random_state, scaled_error

pytestmark = pytest.mark.quick

seeds = st.integers(0, 2**32 - 1)
NESTED = (0, 1, 2, 3, 2, 5, 1, 7)  # parents: separation bodies 1 and, inside its branch, 2
KINDS = ("free", "spherical", "revolute", "compound", "prismatic", "revolute", "universal", "weld")


def nested(kinds=KINDS, seed=0):
    rng = np.random.default_rng(seed)
    rows = enumerate(zip([f"b{p}" if p else "ground" for p in NESTED], kinds), start=1)
    bodies = [random_body(rng, f"b{i}", parent, kind) for i, (parent, kind) in rows]
    return random_state(rng, pg.Model(bodies=tuple(bodies)))


def worst(frames, model, q):
    position, rotation = absolute(model, frames.topology, q)
    made = frame_vectors(model, q)
    found = (frames.vectors, frames.position, frames.rotation)
    return max(map(scaled_error, found, (made.vectors, position, rotation)))


@given(seeds)
@settings(max_examples=40)
def test_frames_and_one_exact_update_are_the_absolute_form(seed):
    """Every joint kind, forests too, and steps of up to half a turn."""
    s = random_case(seed)
    frames, op = frame_vectors(s.model, s.q), Operators(s.model, s.topology, s.q)
    assert worst(frames, s.model, s.q) < 1e-14
    assert scaled_error(frames.link, op.link) < 1e-14
    q = moved(s.model, s.q, s.v)
    frames = frames.updated(increments(s.model, s.q, q))
    assert worst(frames, s.model, q) < 1e-13  # rounding of at most 12 turns one after another


@pytest.mark.parametrize("kinds", [KINDS, ("revolute",) * 8], ids=["every kind", "hinges"])
def test_exact_increments_do_not_drift_in_a_thousand_steps(kinds):
    """Nested separation bodies (checklist C6)."""
    s, dt = nested(kinds), 1e-2
    frames, q = frame_vectors(s.model, s.q), s.q
    for i in range(1000):
        then = moved(s.model, q, dt * np.cos(i * dt + np.arange(len(s.v))) * s.v)
        frames, q = frames.updated(increments(s.model, q, then)), then
    assert worst(frames, s.model, q) < 1e-12


def naive_error(s, dt):
    """Error after 1 s of the paper's Δθ = θ' Δt with θ' = A cos t, taken at each step's start."""
    amplitude = np.linspace(0.8, 1.2, len(s.v))
    q0 = np.zeros(len(s.q))
    frames = frame_vectors(s.model, q0)
    steps = round(1 / dt)
    for i in range(steps):
        frames = frames.updated(amplitude * np.cos(i * dt) * dt)
    return worst(frames, s.model, q0 + amplitude * np.sin(1.0))


def test_naive_increments_drift_at_first_order():
    """R14 says 1.7e-3, 1.7e-4 and 1.7e-5 at 1e-2, 1e-3 and 1e-4 s for a chain of its own."""
    s = nested(kinds=("revolute",) * 8)
    sizes = np.array([1e-2, 5e-3, 2e-3, 1e-3])
    errors = np.array([naive_error(s, dt) for dt in sizes])
    slope = np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    assert slope == pytest.approx(1.0, abs=0.02)
    assert errors[-1] == pytest.approx(5.9e-4, rel=0.05)


@given(st.lists(st.integers(0, 2**32 - 1), min_size=1, max_size=15))
def test_a_joint_carries_its_subtree(picks):
    """For any canonical numbering, also where it is not depth-first."""
    parent = [pick % (i + 1) for i, pick in enumerate(picks)]
    parent[0] = 0
    carried = {i: {i} for i in range(1, len(parent) + 1)}
    for i in range(len(parent), 0, -1):
        if parent[i - 1]:
            carried[parent[i - 1]] |= carried[i]
    found = [visit for visit in visits(pg.pgraph_of(parent)) if visit.P]
    assert {visit.number: set(visit.P) for visit in found} == carried
    assert all(len(visit.P) == len(set(visit.P)) for visit in found)


def test_visits_of_fig_1():
    """Pgraph [1 2 3 5 2 4 2 6 7]: find is the first place, places 5 and 7 turn nothing."""
    found = visits([1, 2, 3, 5, 2, 4, 2, 6, 7])
    assert [visit.find for visit in found] == [1, 2, 3, 4, 2, 6, 2, 8, 9]
    carried = [(1, 2, 3, 5, 4, 6, 7), (2, 3, 5, 4, 6, 7), (3, 5), (5,), (), (4,), (), (6, 7), (7,)]
    assert [visit.P for visit in found] == carried
    assert [visit.P for visit in visits([0, 1, 2, 0, 3])] == [(), (1, 2), (2,), (), (3,)]


def test_trace_ends_in_the_absolute_frames():
    s = nested()
    q = moved(s.model, s.q, 0.1 * s.v)
    trace = frame_update_trace(s.model, s.q, q)
    assert worst(trace.frames, s.model, q) < 1e-13
    lines = str(trace).splitlines()
    assert len(lines) == 1 + len(s.topology.pgraph)
    assert [int(line.split()[1]) for line in lines[1:]] == s.topology.pgraph.tolist()
