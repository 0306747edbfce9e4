"""Trials of motion capture: files with markers and force plates, and what is odd about them."""

import numpy as np
import pytest

import pgraph_core as pg

from .refusals import assert_names, refusal

pytestmark = pytest.mark.quick

TRC = """PathFileType\t4\t(X/Y/Z)\twalk.trc
DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames
{rate}\t60\t{frames}\t{count}\t{unit}\t60\t1\t{frames}
Frame#\tTime\t{labels}
\t\t{axes}

{rows}
"""


def trc(path, markers, unit="mm", times=None):
    """Write markers {label: (n, 3)} as a .trc file."""
    n = len(next(iter(markers.values())))
    times = np.arange(n) / 60 if times is None else times
    rows = []
    for k, t in enumerate(times):
        cells = [x for m in markers.values() for x in m[k]]
        rows.append(
            "\t".join([str(k + 1), f"{t:.3f}", *("" if np.isnan(x) else f"{x:.6f}" for x in cells)])
        )
    text = TRC.format(
        rate=60, frames=n, count=len(markers), unit=unit, labels="\t\t\t".join(markers),
        axes="\t".join(f"{a}{i + 1}" for i in range(len(markers)) for a in "XYZ"),
        rows="\n".join(rows),
    )  # fmt: skip
    path.write_text(text)
    return path


def test_a_trc_file_is_read_in_metres_at_an_even_rate(tmp_path):
    heel, toe = np.arange(30.0).reshape(2, 5, 3) + 100
    toe[2] = np.nan
    trial = pg.read_trial(trc(tmp_path / "a.trc", {"S1:heel": heel, "S1:toe": toe}), up="y")
    assert [*trial.markers] == ["heel", "toe"]
    assert np.allclose(trial.markers["heel"], heel / 1000, atol=1e-9)
    assert np.array_equal(np.isnan(trial.markers["toe"][:, 0]), np.arange(5) == 2)
    assert trial.gaps == {"toe": 1}
    assert np.allclose(trial.t, np.arange(5) / 60, atol=1e-4)  # printed with three digits
    assert np.ptp(np.diff(trial.t)) < 1e-12
    assert_names(repr(trial), "prefix S1", "toe in 1", "rounded to 3 digits", "no force plates")


def test_what_is_odd_about_markers_is_named(tmp_path):
    place = np.arange(15.0).reshape(5, 3) + 1
    markers = {
        "A:x": place,
        "B:x": 2 * place,
        "*7": place,
        "zero": 0 * place,
        "gone": place * np.nan,
    }
    path = trc(tmp_path / "a.trc", markers, "m")
    text = repr(pg.read_trial(path))
    assert_names(text, "without a label", "A, B", "subject='A'", "zero is at exactly (0, 0, 0)",
                 "never seen: zero, gone", "vertical axis is unknown")  # fmt: skip
    assert [*pg.read_trial(path, subject="B").markers] == ["x"]
    assert_names(str(refusal(lambda: pg.read_trial(path, subject="C"))), "subject", "'C'", "A, B")
    text = path.read_text().replace("A:x", "x").replace("B:x", "x")
    path.write_text(text.replace("zero", "z"))
    assert_names(repr(pg.read_trial(path)), "two markers have the label x", "x#2")


def test_a_wrong_unit_is_named_and_can_be_given(tmp_path):
    walk = np.linspace(0, 2000, 15).reshape(5, 3)
    path = trc(tmp_path / "a.trc", {"heel": walk}, "m")  # of millimetres
    assert_names(repr(pg.read_trial(path)), "is their unit right", "units='mm'")
    right = pg.read_trial(path, units="mm")
    assert np.allclose(right.markers["heel"], walk / 1000)
    assert_names(repr(right), "unit mm as given, the file says m")
    odd = trc(tmp_path / "b.trc", {"heel": walk}, "furlong")
    assert_names(str(refusal(lambda: pg.read_trial(odd))), "units", "furlong", "units='mm'")


@pytest.mark.parametrize(
    ("name", "text", "facts"),
    [
        ("a.trc", "nonsense", ["PathFileType"]),
        ("a.mot", "time x\n0 1\n", ["endheader"]),
        ("a.sto", "endheader\ntime\tx\n0\t1\n0.1\ttwo\n", ["line 4", "'two'"]),
        ("a.sto", "endheader\ntime\tx\n0\t1\n0.1\n", ["row 2", "1 number", "2"]),
        ("a.sto", "endheader\ntime\tx\n0.1\t1\n0.1\t2\n", ["ascend", "row 2"]),
        ("a.sto", "endheader\nx\ty\n0.1\t1\n", ["time", "x, y"]),
        ("a.csv", "t\n", ["numbers"]),
        ("a.txt", "", [".c3d", ".trc"]),
    ],
)
def test_files_that_are_no_trial_are_refused(tmp_path, name, text, facts):
    path = tmp_path / name
    path.write_text(text)
    assert_names(str(refusal(lambda: pg.read_trial(path))), name, *facts)


MOT = "endheader\ntime\t{}\n{}\n"


def mot(path, **columns):
    n = len(next(iter(columns.values())))
    rows = zip(np.arange(n) / 100, *columns.values())
    text = "\n".join("\t".join(f"{x:.9g}" for x in row) for row in rows)
    path.write_text(MOT.format("\t".join(columns), text))
    return path


def plated(force, point, torque, name="ground_{}_", between="v"):
    """Columns of a plate as OpenSim names them."""
    stems = name.format("force") + between, name.format("force") + "p", name.format("torque")
    return {
        f"{s}{a}": x[:, i]
        for s, x in zip(stems, (force, point, torque))
        for i, a in enumerate("xyz")
    }


def test_a_storage_file_brings_plates_and_coordinates(tmp_path):
    rng = np.random.default_rng(0)
    force, point, torque = rng.normal(size=(3, 7, 3))
    force += [0, 600, 0]
    force[0] = 0.0
    path = mot(tmp_path / "a.mot", **plated(force, point, torque), angle=np.arange(7))
    trial = pg.read_trial(path)
    (plate,) = trial.plates
    assert trial.up == "y"
    assert [*trial.coordinates] == ["angle"]
    assert np.allclose(plate.force, force)
    assert np.allclose(plate.moment, torque + np.cross(point, force), atol=1e-5)
    assert np.array_equal(plate.loaded, np.arange(7) > 0)
    assert np.isnan(plate.point[0]).all()
    assert np.allclose(plate.point[1:], point[1:])
    # halfway between two samples
    wanted = (plate.moment[3] + plate.moment[4]) / 2
    assert np.allclose(plate.wrench(np.array([0.035]))[0, :3], wanted)
    assert not plate.wrench(np.array([-1.0, 9.0])).any()  # beyond the record


def test_a_plate_that_is_incomplete_or_upside_down_is_named(tmp_path):
    force = np.tile([0.0, 700.0, 0.0], (5, 1))
    columns = plated(-force, 0 * force, 0 * force)
    assert_names(repr(pg.read_trial(mot(tmp_path / "a.mot", **columns))), "on the plate")
    del columns["ground_force_py"]
    text = str(refusal(lambda: pg.read_trial(mot(tmp_path / "b.mot", **columns))))
    assert_names(text, "ground_force_vx", "ground_force_py")
    columns = plated(force, np.where(np.arange(5)[:, None] == 2, np.nan, 0 * force), 0 * force)
    text = str(refusal(lambda: pg.read_trial(mot(tmp_path / "c.mot", **columns))))
    assert_names(text, "centre of pressure", "t = 0.02 s")


def test_axes_turn_from_one_vertical_axis_to_another(tmp_path):
    rng = np.random.default_rng(1)
    force, point, torque = rng.normal(size=(3, 5, 3))
    force += [0, 0, 600]
    path = mot(tmp_path / "a.mot", **plated(force, point, torque))
    for up in "xyz":
        turned = pg.read_trial(path).with_up(up)
        (plate,) = turned.plates
        assert turned.up == up
        assert np.allclose(plate.force[:, "xyz".index(up)], force[:, 2])
        assert np.allclose(np.linalg.norm(plate.force, axis=1), np.linalg.norm(force, axis=1))
        arm = plate.moment - np.cross(plate.point, plate.force)  # a rotation keeps cross products
        assert np.allclose(np.linalg.norm(arm, axis=1), np.linalg.norm(torque, axis=1), atol=1e-6)


def test_a_table_of_commas_has_points_and_units(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t,heel.x [mm],heel.y [mm],heel.z [mm],knee [rad]\n0,1,2,3,0.1\n0.1,4,5,,0.2\n")
    trial = pg.read_trial(path, up="z")
    assert np.allclose(trial.markers["heel"][0], [0.001, 0.002, 0.003])
    assert trial.gaps == {"heel": 1}
    assert np.allclose(trial.coordinates["knee"], [0.1, 0.2])


# -- C3D -------------------------------------------------------------------------------------------


def c3d(path, plates, rate=100, each=10, frames=4, first=0, labels=("heel", "toe"), unit="mm"):
    """Write a C3D file with plates (type, corners, origin, signals (m, 6 or 8), matrix)."""
    ezc3d = pytest.importorskip("ezc3d")
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["UNITS"]["value"] = [unit]
    file["parameters"]["POINT"]["RATE"]["value"] = [rate]
    file["parameters"]["POINT"]["LABELS"]["value"] = list(labels)
    points = np.ones((4, len(labels), frames))
    points[:3] = 1 + np.arange(3 * len(labels) * frames).reshape(3, len(labels), frames)
    file["data"]["points"] = points
    file["header"]["points"]["first_frame"] = first
    file["parameters"]["ANALOG"]["RATE"]["value"] = [rate * each]
    signals = np.hstack([p[3] for p in plates])
    widths = [p[3].shape[1] for p in plates]
    starts = np.cumsum([0, *widths])
    file["parameters"]["ANALOG"]["LABELS"]["value"] = [f"c{i}" for i in range(signals.shape[1])]
    units = [
        x for w in widths for x in ["N"] * (8 if w == 8 else 3) + ["Nmm"] * (0 if w == 8 else 3)
    ]
    file["parameters"]["ANALOG"]["UNITS"]["value"] = units
    file["data"]["analogs"] = signals.T[None]
    channel = np.zeros((8, len(plates)))
    for k, w in enumerate(widths):
        channel[:w, k] = np.arange(starts[k], starts[k] + w) + 1
    file.add_parameter("FORCE_PLATFORM", "USED", [len(plates)])
    file.add_parameter("FORCE_PLATFORM", "TYPE", [p[0] for p in plates])
    file.add_parameter("FORCE_PLATFORM", "ZERO", [1, 0])
    file.add_parameter("FORCE_PLATFORM", "CORNERS", np.stack([p[1].T for p in plates], axis=2))
    file.add_parameter("FORCE_PLATFORM", "ORIGIN", np.stack([p[2] for p in plates], axis=1))
    file.add_parameter("FORCE_PLATFORM", "CHANNEL", channel)
    file.add_parameter("FORCE_PLATFORM", "CAL_MATRIX", np.stack([p[4] for p in plates], axis=2))
    for name in ("USED", "TYPE", "ZERO", "CHANNEL"):
        own = file["parameters"]["FORCE_PLATFORM"][name]
        own["type"], own["value"] = 2, own["value"].astype(int)  # whole numbers
    file.write(str(path))
    return path


CORNERS = np.array([[400.0, 600, 0], [0, 600, 0], [0, 0, 0], [400, 0, 0]])  # z of the plate: down


def channels(kind, force, at, free, origin):
    """What a plate records of a force on it at a point (m, 2) [mm] of its surface, with a torque
    about its normal, all in its own axes: the definitions of types 1 to 4."""
    m = len(force)
    r = np.hstack((at, np.zeros((m, 1))))
    moment = np.cross(r, force)
    moment[:, 2] += free
    if kind == 1:
        return np.column_stack((force, at, free))
    if kind in (2, 4):  # about the plate's own origin, which lies below the surface
        return np.hstack((force, moment - np.cross(force, origin)))
    a, b, down = origin
    mx, my, mz = (moment - np.cross(force, [0, 0, down])).T
    fz = force[:, 2]
    # four vertical forces in the corners (+-a, +-b) with one free unknown, and two pairs across
    fz1 = (fz + mx / b - my / a) / 4
    fz2 = (fz + mx / b + my / a) / 4
    fz3 = (fz - mx / b + my / a) / 4
    fz4 = (fz - mx / b - my / a) / 4
    x12 = force[:, 0] / 2 - mz / (4 * b)
    y14 = force[:, 1] / 2 + mz / (4 * a)
    return np.column_stack((x12, force[:, 0] - x12, y14, force[:, 1] - y14, fz1, fz2, fz3, fz4))


@pytest.mark.parametrize("kind", [1, 2, 3, 4])
def test_plates_of_all_types_give_the_force_on_the_foot(tmp_path, kind):
    """A known load comes back, and the centre of pressure is that of ezc3d within 1e-6 m."""
    ezc3d = pytest.importorskip("ezc3d")
    rng = np.random.default_rng(kind)
    force = rng.normal(size=(40, 3)) * 30 + [0, 0, 700]
    at, free = rng.uniform(-150, 150, size=(40, 2)), rng.normal(size=40) * 3000  # N mm
    origin = np.array([120.0, 200, -50]) if kind == 3 else np.array([3.0, -2, -40])
    signals = channels(kind, force, at, free, origin)
    mixing = np.eye(6) + (0.01 * rng.normal(size=(6, 6)) if kind == 4 else 0)
    stored = np.linalg.solve(mixing, signals.T).T if kind == 4 else signals
    path = c3d(tmp_path / "a.c3d", [(kind, CORNERS, origin, stored, mixing)])
    trial = pg.read_trial(path)
    (plate,) = trial.plates
    centre = CORNERS.mean(axis=0) / 1000
    assert trial.up == "z"
    # a file holds single precision: 1e-7 of the largest of these numbers
    assert np.allclose(plate.force, force, atol=1e-3)
    wanted = np.hstack((at, np.zeros((40, 1)))) / 1000 + centre
    assert np.abs(plate.point - wanted).max() < 1e-6
    torque = np.cross(wanted, force) + np.outer(free / 1000, [0, 0, 1])
    assert np.allclose(plate.moment, torque, atol=1e-3)
    theirs = ezc3d.c3d(str(path), extract_forceplat_data=True)["data"]["platform"][0]
    assert np.abs(plate.point - theirs["center_of_pressure"].T / 1000).max() < 1e-6


def test_the_force_on_a_plate_becomes_the_one_on_the_foot(tmp_path):
    down = np.tile([5.0, 0, -700, 0, 0, 0], (40, 1))
    path = c3d(tmp_path / "a.c3d", [(2, CORNERS, np.zeros(3), down, np.eye(6))])
    trial = pg.read_trial(path)
    assert np.allclose(trial.plates[0].force, [-5, 0, 700])
    assert_names(repr(trial), "plate 1 records the force on the plate")


def test_frames_rates_and_gaps_of_a_c3d_file(tmp_path):
    ezc3d = pytest.importorskip("ezc3d")
    signals = np.tile([0.0, 0, 700, 0, 0, 0], (40, 1))
    path = c3d(tmp_path / "a.c3d", [(2, CORNERS, np.zeros(3), signals, np.eye(6))], first=5)
    file = ezc3d.c3d(str(path))
    assert file["header"]["points"]["first_frame"] == 5
    file["data"]["meta_points"]["residuals"][0, 1, 2] = -1
    file["data"]["points"][:, 1, 2] = np.nan
    del file["data"]["meta_points"]
    file.write(str(path))
    trial = pg.read_trial(path)
    assert np.allclose(trial.t, (5 + np.arange(4)) / 100)
    assert np.allclose(trial.plates[0].t, 0.05 + np.arange(40) / 1000)
    assert trial.gaps == {"toe": 1}
    assert_names(repr(trial), "number 6", "100 Hz", "1000 Hz", "toe in 1")


def test_plates_that_are_not_read_and_damaged_files_are_named(tmp_path):
    signals = np.tile([0.0, 0, 700, 0, 0, 0], (40, 1))
    path = c3d(tmp_path / "a.c3d", [(7, CORNERS, np.zeros(3), signals, np.eye(6))])
    trial = pg.read_trial(path)
    assert not trial.plates
    assert_names(repr(trial), "plate 1 is of type 7", "1 to 4")
    path.write_bytes(b"\x02\x50" + bytes(500))
    assert_names(str(refusal(lambda: pg.read_trial(path))), "a.c3d", "C3D")
    assert_names(str(refusal(lambda: pg.read_trial(tmp_path / "none.c3d"))), "no such file")
