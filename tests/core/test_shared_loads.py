"""Forces of contacts that the motion does not determine are named, others are not."""

import numpy as np
import pytest

import pgraph_core as pg

BOX = {"kind": "box", "size": (0.2, 0.2, 0.2)}


def box(name="box", z=0.1, size=1.0, **fields):
    shape = {"kind": "box", "size": tuple(size * x for x in BOX["size"])}
    return pg.Body(
        name=name, joint="free", q=(0, 0, z * size, 1, 0, 0, 0), mass=size**3, shape=shape,
        derived=("inertia",), **fields,
    )  # fmt: skip


def cart(wheels, friction=0.7):
    """A plate on as many wheels, each with a contact of its own."""
    plate = pg.Body(name="plate", joint="free", q=(0, 0, 0.15, 1, 0, 0, 0), mass=3.0,
                    inertia=np.eye(3))  # fmt: skip
    bodies, contacts = [plate], []
    for n in range(wheels):
        angle = 2 * np.pi * n / wheels + 0.3
        bodies.append(
            pg.Body(
                name=f"w{n}", parent="plate", axes=(0, 1, 0), mass=0.2, derived=("inertia",),
                link=(np.cos(angle), np.sin(angle), -0.1),
                shape={"kind": "sphere", "radius": 0.05},
            )
        )  # fmt: skip
        contacts.append(pg.Contact(name=f"c{n}", body=f"w{n}", friction=friction))
    return pg.Model(bodies=bodies, contacts=contacts)


def gripped():
    """A box between two fingers that servos press, with friction."""
    fingers = [
        pg.Body(
            name=name, joint="prismatic", axes=(side, 0, 0), mass=0.5, q=(-0.15,),
            shape={"kind": "box", "size": (0.1, 0.1, 0.1)}, inertia=np.eye(3) * 1e-3,
        )
        for name, side in (("left", 1), ("right", -1))
    ]  # fmt: skip
    contacts = [pg.Contact(name=f.name, body=f.name, other="box", friction=0.8) for f in fingers]
    drives = [pg.Motor(name=f"m {f.name}", body=f.name, torque=20.0) for f in fingers]
    return pg.Model(bodies=[*fingers, box(z=0.0)], contacts=contacts, forces=drives)


def shared(run):
    return [text for text in run.notices if "not unique" in text]


METHODS = ["moreau_jean", "rk4"]  # time stepping, and from event to event
WHEELS = "w0 w1 w2 w3"


@pytest.mark.parametrize(
    ("model", "names", "method"),
    [
        *((cart(4), WHEELS, method) for method in METHODS),
        *((cart(4, 0.0), WHEELS, method) for method in METHODS),
        (gripped(), "left right", "moreau_jean"),
    ],
)
def test_loads_that_are_not_unique_are_named(model, names, method):
    run = pg.simulate(model, t_end=0.1, step=1e-3, method=method)
    (text,) = shared(run)
    assert all(f"'{name}'" in text for name in names.split())
    assert "least norm" in text


FLOOR = pg.Contact(name="floor", body="box", friction=0.5)


@pytest.mark.parametrize(
    "model",
    [
        pg.Model(bodies=[box()], contacts=[FLOOR]),
        pg.Model(bodies=[box(size=100.0)], contacts=[FLOOR]),
        pg.Model(bodies=[box(v=(0, 0, 0, 1.0, 0, 0))], contacts=[FLOOR]),
        pg.Model(
            bodies=[box("a"), box("b", 0.3), box("c", 0.5)],
            contacts=[pg.Contact(name="f", body="*"), pg.Contact(name="g", body="*", other="*")],
        ),
        cart(3, 0.0),
    ],
)
def test_loads_that_are_unique_are_not_named(model):
    assert not shared(pg.simulate(model, t_end=0.1, step=1e-3))
    if all(contact.other == "ground" for contact in model.contacts):
        assert not shared(pg.simulate(model, t_end=0.1, step=1e-3, method="rk4"))


def stool(legs, spin=5.0, speed=2.0, friction=0.5):
    """A body on as many given points, which spins and slides."""
    angles = 2 * np.pi * np.arange(legs) / legs + 0.3
    feet = tuple((0.1 * np.cos(x), 0.1 * np.sin(x), -0.1) for x in angles)
    body = box(v=(0, 0, spin, speed, 0, 0))
    floor = pg.Contact(name="floor", body="box", points=feet, friction=friction)
    return pg.Model(bodies=[body], contacts=[floor])


def between_methods(model):
    """Return the difference in v of runs with time stepping and from event to event."""
    runs = [pg.simulate(model, t_end=0.05, step=2e-4, method=method) for method in METHODS]
    return runs, abs(runs[0].v[-1] - runs[1].v[-1]).max()


@pytest.mark.parametrize("legs", [3, 4, 6])
def test_more_than_three_points_that_slide_and_spin_may_share_their_load(legs):
    """Four normal forces have three conditions, and their friction has several directions.

    With three points, methods differ by their steps, 3e-5 at 0.2 ms and 6e-6 at 0.05 ms. With more
    they differ by 8e-4 to 2e-3 at any step.
    """
    runs, difference = between_methods(stool(legs))
    assert (difference > 2e-4) == (legs > 3)
    assert (difference < 1e-4) == (legs == 3)
    for run in runs:
        assert len(shared(run)) == (legs > 3)
        assert not [text for text in run.notices if "face" in text]
    for text in (text for run in runs for text in shared(run)):
        assert "'box' on the ground has" in text
        assert "another motion" in text


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    "model",
    [stool(2), stool(4, spin=0.0), stool(4, speed=0.0), stool(4, friction=0.0), stool(4, 0.0, 0.0)],
)
def test_points_whose_sharing_has_no_effect_are_not_named(model, method):
    """Parallel friction, that of a spin about the middle of a square, and none."""
    run = pg.simulate(model, t_end=0.02, step=1e-3, method=method)
    assert run.status.ok
    assert not shared(run)


def balls(gap, e=1.0):
    """Two balls at rest, `gap` apart, and a third one that hits the first."""
    row = [(0.0, 1.0), (0.3, 0.0), (0.5 + gap, 0.0)]
    bodies = [
        pg.Body(
            name=f"b{n}", joint="prismatic", axes=(1, 0, 0), mass=1.0, q=(x,), v=(v,),
            shape={"kind": "sphere", "radius": 0.1},
        )
        for n, (x, v) in enumerate(row)
    ]  # fmt: skip
    contacts = [
        pg.Contact(name=f"c{n}", body=f"b{n}", other=f"b{n + 1}", restitution=e, friction=0)
        for n in range(2)
    ]
    return pg.Model(bodies=bodies, contacts=contacts, gravity=(0, 0, 0))


@pytest.mark.parametrize(("gap", "e", "told"), [(0.0, 1.0, True), (1e-4, 1.0, False),
                                                (0.0, 0.5, True), (0.0, 0.0, False)])  # fmt: skip
def test_an_impact_of_several_that_touch_is_named(gap, e, told):
    run = pg.simulate(balls(gap, e), t_end=0.3, step=1e-3)
    assert any("with gaps" in text for text in run.notices) == told


@pytest.mark.parametrize(
    ("shape", "spin", "speed", "told"),
    [
        ({"kind": "cylinder", "radius": 0.1, "length": 0.2}, 5.0, 0.0, True),
        (BOX, 5.0, 0.0, True),
        (BOX, 5.0, 2.0, True),
        (BOX, 0.5, 2.0, True),
        (BOX, 0.0, 1.0, False),
        ({"kind": "sphere", "radius": 0.1}, 5.0, 0.0, False),
    ],
)
def test_a_face_that_spins_on_a_plane_is_named(shape, spin, speed, told):
    body = pg.Body(
        name="b", joint="free", q=(0, 0, 0.1, 1, 0, 0, 0), v=(0, 0, spin, speed, 0, 0), mass=1.0,
        shape=shape, derived=("inertia",),
    )  # fmt: skip
    floor = pg.Contact(name="floor", body="b", friction=0.3)
    model = pg.Model(bodies=[body], contacts=[floor])
    located = shape["kind"] != "cylinder"  # not where its end lies flat
    for method in METHODS if located else METHODS[:1]:
        run = pg.simulate(model, t_end=0.1, step=1e-3, method=method)
        assert any("spins on a flat face" in text for text in run.notices) == told


def test_loads_that_no_body_joins_are_searched_apart(monkeypatch):
    """The work grows as the number of stacks: no decomposition has the rows of two of them."""

    def largest(count):
        floor = [pg.Contact(name="all", body="*", other="*"), pg.Contact(name="floor", body="*")]
        bodies = [
            pg.Body(name=f"{z}{k}", joint="free", shape=pg.Box((0.2, 0.2, 0.2)),
                    q=(k, 0, z, 1, 0, 0, 0))
            for k in range(count) for z in (0.1, 0.3)
        ]  # fmt: skip
        sizes, svd = list[int](), np.linalg.svd
        with monkeypatch.context() as patch:
            patch.setattr(
                np.linalg, "svd", lambda x, *a, **n: sizes.append(x.size) or svd(x, *a, **n)
            )
            model = pg.Model(bodies=bodies, contacts=floor)
            pg.simulate(model, t_end=0.05, step=1e-3, method="moreau_jean", frames=3)
        return max(sizes)

    assert largest(6) == largest(1) > 100


@pytest.mark.parametrize("seed", range(20))
def test_blocks_that_are_searched_apart_give_what_the_whole_gives(seed):
    """The part of the total forces without an effect, by the null space of all rows."""
    from scipy.linalg import null_space

    from pgraph_core.simulation.shared_loads import Columns, _free

    rng = np.random.default_rng(seed)
    sizes = rng.integers(1, 5, (5, 3))  # points, other forces and velocities of each block
    rows, held = (
        np.zeros((sizes[:, k].sum(), sizes[:, 2].sum() + 2)) for k in (0, 1)
    )  # no force moves the last velocities
    (a, b, c) = (np.append(0, np.cumsum(sizes[:, k])) for k in range(3))
    for k in range(5):
        for matrix, at in ((rows, a), (held, b)):
            matrix[at[k] : at[k + 1], c[k] : c[k + 1]] = rng.normal(
                size=(at[k + 1] - at[k], c[k + 1] - c[k])
            )
    mixed = rng.permutation(rows.shape[1])
    names = [f"pair {k}" for k in range(len(rows))]
    wrenches = np.zeros((6 * len(rows), len(rows)))
    wrenches[6 * np.arange(len(rows)) + 2, np.arange(len(rows))] = 1.0
    left = null_space(np.vstack((rows, held)).T)[: len(rows)]
    expected = [name for name, row in zip(names, left) if np.abs(row).max(initial=0.0) > 1e-6]
    columns = Columns(rows, rows, wrenches, names)
    assert _free(rows[:, mixed], columns, held[:, mixed]) == expected
