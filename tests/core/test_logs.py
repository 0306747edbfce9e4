"""Logs of runs, read back by the libraries of their formats."""

import io
import json
from functools import cache

import numpy as np
import pytest

import pgraph_core as pg

from ..refusals import assert_names, refusal

reader = pytest.importorskip("mcap.reader")
chunks = pytest.importorskip("rerun.chunk")


@cache
def bouncing() -> pg.Result:
    """A body that falls on the ground, beside an arm with a coordinate called t."""
    ball = pg.Body(name="ball", joint="free", shape=pg.Shape(kind="sphere", radius=0.1), mass=1.0,
                   derived=("inertia",))  # fmt: skip
    arm = pg.Body(name="t", axes=(0, 1, 0), com=(0.2, 0, 0), link=(0, 1, 0))
    model = pg.Model(
        name="a ball — Größe",
        bodies=[ball, arm],
        contacts=[pg.Contact(name="floor", body="ball", other="ground", restitution=0.5)],
        outputs=[pg.Output(name="imu", kind="accelerometer", at="t")],
        controls=[pg.Filter(name="twice", input="=2*q.t", lag=0.1)],
    )
    return pg.simulate(model, q={"ball": (0, 0, 0.3)}, t_end=0.4, frames=41)


@cache
def topics() -> tuple[dict, dict]:
    """Return the messages and the schemas by topic."""
    from pgraph_core.result.logs import mcap_of

    messages, schemas = {}, {}
    for schema, channel, message in reader.make_reader(
        io.BytesIO(mcap_of(bouncing()))
    ).iter_messages():
        entry = message.log_time, json.loads(message.data)
        messages.setdefault(channel.topic, []).append(entry)
        schemas[channel.topic] = schema.name, json.loads(schema.data), channel.metadata
    return messages, schemas


def flat(message, before=""):
    for name, x in message.items():
        yield from flat(x, f"{before}{name}.") if isinstance(x, dict) else [(before + name, x)]


def test_an_mcap_file_has_every_column_exactly():
    run, (messages, schemas) = bouncing(), topics()
    assert [x["t"] for _, x in messages["/time"]] == run.t.tolist()
    assert [t for t, _ in messages["/time"]] == [round(1e9 * t) for t in run.t]
    found = {}
    for topic, rows in messages.items():
        if topic in ("/tf", "/scene", "/events", "/time", "/error"):
            continue
        assert len(rows) == len(run.t)
        for row in rows:
            for name, x in flat(row[1]):
                found.setdefault((topic[1:], name), []).append(x)
    for name, values in run.columns().items():
        if name == "t":
            continue
        head, _, rest = name.partition(".")
        keys = [("q", name), ("energy", name), ("outputs", name), (head, rest)]
        (key,) = [key for key in keys if key in found]
        wanted = np.asarray(values).tolist()
        assert found.pop(key) == [None if x != x else x for x in wanted], name
    assert not found
    assert schemas["/v"][2] == {"ball.0": "rad/s"} | schemas["/v"][2]


def test_an_mcap_file_has_poses_shapes_events_and_the_model():
    run, (messages, schemas) = bouncing(), topics()
    assert schemas["/tf"][0] == "foxglove.FrameTransforms"
    for i, (_, message) in enumerate(messages["/tf"]):
        for transform in message["transforms"]:
            pose = [*transform["translation"].values(), *(transform["rotation"][x] for x in "wxyz")]
            assert pose == run.body_pose[transform["child_frame_id"]][i].tolist()
    (_, scene), = messages["/scene"]  # fmt: skip
    ball = next(x for x in scene["entities"] if x["frame_id"] == "ball")["triangles"][0]
    radii = np.linalg.norm([[*point.values()] for point in ball["points"]], axis=1)
    assert np.allclose(radii, 0.1, rtol=1e-9)
    assert len(ball["indices"]) % 3 == 0
    assert [x["message"] for _, x in messages["/events"]] == [str(event) for event in run.events]
    from pgraph_core.result.logs import mcap_of

    own = reader.make_reader(io.BytesIO(mcap_of(run)))
    (attached,) = own.iter_attachments()
    assert pg.Model.from_json(attached.data.decode()) == run.model


def test_messages_fit_their_schemas():
    def check(schema, value, where):
        kinds = {"object": dict, "array": list, "string": str, "integer": int, "boolean": bool}
        kinds |= {"number": (int, float), "null": type(None)}
        names = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
        assert any(isinstance(value, kinds[name]) for name in names), where
        for name, x in value.items() if isinstance(value, dict) else ():
            check(schema["properties"][name], x, f"{where}.{name}")
        for x in value[:3] if isinstance(value, list) else ():
            check(schema["items"], x, where)

    messages, schemas = topics()
    for topic, rows in messages.items():
        for _, row in rows[:: max(len(rows) - 1, 1)]:
            check(schemas[topic][1], row, topic)


def test_messages_have_all_fields_of_the_schemas_of_foxglove():
    """As in the JSON schemas of foxglove.FrameTransforms, SceneUpdate and Log."""
    messages, _ = topics()
    (_, tf), (_, scene), (_, line) = (messages[x][0] for x in ("/tf", "/scene", "/events"))
    assert set(tf) == {"transforms"}
    frame = {"timestamp", "parent_frame_id", "child_frame_id", "translation", "rotation"}
    assert set(tf["transforms"][0]) == frame
    assert set(tf["transforms"][0]["rotation"]) == set("xyzw")
    assert set(scene) == {"deletions", "entities"}
    entity = {"timestamp", "frame_id", "id", "lifetime", "frame_locked", "metadata", "arrows"}
    entity |= {"cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models"}
    assert set(scene["entities"][0]) == entity
    drawn = scene["entities"][0]["triangles"][0]
    assert set(drawn) == {"pose", "points", "color", "colors", "indices"}
    assert set(drawn["pose"]) == {"position", "orientation"}
    assert set(line) == {"timestamp", "level", "message", "name", "file", "line"}
    assert set(line["timestamp"]) == {"sec", "nsec"}


def test_a_rerun_file_has_poses_shapes_columns_and_events(tmp_path):
    run = bouncing()
    run.save(tmp_path / "run.rrd")
    found, static = {}, {}
    for chunk in chunks.RrdReader(str(tmp_path / "run.rrd")).store().stream():
        rows = chunk.to_record_batch().to_pydict()
        kept = static if chunk.is_static else found
        for name, values in rows.items():
            if ":" in name or name == "t":
                kept.setdefault((chunk.entity_path, name), []).extend(values)
    exact = [x[0] for x in found["/time", "Scalars:scalars"]]
    assert exact == run.t.tolist()
    seconds = [x.total_seconds() for x in found["/time", "t"]]
    assert np.allclose(seconds, run.t, rtol=0, atol=1e-6)
    assert [x[0] for x in found["/q/t", "Scalars:scalars"]] == run["t"].tolist()
    assert [x[0] for x in found["/outputs/imu/z", "Scalars:scalars"]] == run["imu.z"].tolist()
    place = [x[0] for x in found["/world/ball", "Transform3D:translation"]]
    assert np.array_equal(place, run.position["ball"].astype(np.float32))
    points = static["/world/ball/shape\\ 0", "Mesh3D:vertex_positions"][0]
    assert np.allclose(np.linalg.norm(points, axis=1), 0.1, rtol=1e-6)
    texts = [x[0] for x in found["/events", "TextLog:text"]]
    assert texts == [str(event) for event in run.events]


def test_refusals(tmp_path, monkeypatch):
    early = pg.simulate(pg.Model.serial(1), t_start=-1.0, t_end=1.0)
    assert_names(str(refusal(lambda: early.save(tmp_path / "a.mcap"))), "-1 s", ".csv", ".rrd")
    early.save(tmp_path / "a.rrd")
    gone = tmp_path / "gone" / "a.mcap"
    assert_names(str(refusal(lambda: bouncing().save(gone))), "gone", "cannot be written")
    assert_names(str(refusal(lambda: bouncing().save(tmp_path / "a.bag"))), ".mcap", ".rrd")
    for suffix, module in (("mcap", "mcap.writer"), ("rrd", "rerun")):
        monkeypatch.setitem(__import__("sys").modules, module, None)
        text = str(refusal(lambda suffix=suffix: bouncing().save(tmp_path / f"b.{suffix}")))
        assert_names(text, "pip install 'pgraph-dynamics[")
    assert not [*tmp_path.glob("b.*")]
