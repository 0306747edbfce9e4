"""Logs of runs for the viewers Foxglove (MCAP) and Rerun.

Both logs have the poses of all body frames in world axes, their shapes, every column of the run and
its events. Values in MCAP are exact. Rerun stores poses and shapes in single precision.
"""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from ..errors import FileError, Problem, needed
from ..packing import Array
from .columns import LEDGER, Column, columns_of, coordinates

# suffix of a log -> what it imports, and the extra that brings it
NEEDED = {".mcap": ("mcap.writer", "mcap"), ".rrd": ("rerun", "rerun")}
SECOND = 1_000_000_000  # ns
WORLD = "world"
Json = dict[str, Any]
OF_FRAMES = "foxglove.FrameTransforms"
OF_SCENE = "foxglove.SceneUpdate"
OF_EVENTS = "foxglove.Log"
INFO = 2  # level of a line in a log
NUMBER = {"type": ["number", "null"]}  # null: not finite, which JSON does not have
TEXT = {"type": "string"}
WHOLE = {"type": "integer"}


def objects(**properties: Any) -> Json:
    """Return the JSON schema of an object."""
    return {"type": "object", "properties": properties}


def lists(items: Json) -> Json:
    """Return the JSON schema of an array."""
    return {"type": "array", "items": items}


TIME = {**objects(sec=WHOLE, nsec=WHOLE), "title": "time"}
VECTOR = objects(x=NUMBER, y=NUMBER, z=NUMBER)
TURN = objects(x=NUMBER, y=NUMBER, z=NUMBER, w=NUMBER)
COLOR = objects(r=NUMBER, g=NUMBER, b=NUMBER, a=NUMBER)
TRIANGLES = objects(
    pose=objects(position=VECTOR, orientation=TURN), points=lists(VECTOR), color=COLOR,
    colors=lists(COLOR), indices=lists(WHOLE),
)  # fmt: skip
# what an entity has beside triangles, which viewers may expect as empty lists
OTHERS = ("metadata", "arrows", "cubes", "spheres", "cylinders", "lines", "texts", "models")
ENTITY = objects(
    timestamp=TIME, frame_id=TEXT, id=TEXT, lifetime={**TIME, "title": "duration"},
    frame_locked={"type": "boolean"}, triangles=lists(TRIANGLES),
    **{name: lists({"type": "object"}) for name in OTHERS},
)  # fmt: skip
FRAME = objects(
    timestamp=TIME, parent_frame_id=TEXT, child_frame_id=TEXT, translation=VECTOR, rotation=TURN
)
SCHEMAS = {
    OF_FRAMES: objects(transforms=lists(FRAME)),
    OF_SCENE: objects(deletions=lists({"type": "object"}), entities=lists(ENTITY)),
    OF_EVENTS: objects(timestamp=TIME, level=WHOLE, message=TEXT, name=TEXT, file=TEXT, line=WHOLE),
}


class Solid(NamedTuple):
    """A drawn solid of a body, in its axes."""

    body: str
    vertices: Array  # (n, 3) [m]
    faces: Any  # (m, 3)
    color: tuple[float, float, float, float]  # 0 to 1


def solids_of(run: Any) -> Iterator[Solid]:
    """Yield the drawn solids of all bodies, as pictures show them."""
    from ..show import shapes
    from ..show.bodies import looks
    from ..show.notebook import children_of, numbered

    bodies, parent = numbered(run.mechanism.model)
    for look in looks(bodies, children_of(parent), shapes.branch_colors(parent)):
        for piece in look.pieces:
            solid = shapes.mesh([piece])
            r, g, b = (x / 255 for x in piece.color or look.color)
            color = (r, g, b, float(piece.opacity))
            yield Solid(look.body.name, np.asarray(solid.vertices), np.asarray(solid.faces), color)


def tables_of(run: Any) -> dict[str, dict[str, Column]]:
    """Return the columns of a run by quantity, {quantity: {name: column}}, but for the time.

    They are those of `run.columns`: q has the coordinates, energy the columns of the ledger.
    """
    places = {place for place, _ in coordinates(run.mechanism)[0]}
    read = {o.name: o.name for o in run.mechanism.model.outputs}
    read |= {f"{o.name}.{part}": o.name for o in run.mechanism.model.outputs for part in "wxyz"}
    found: dict[str, dict[str, Column]] = {"q": {}}
    for name, column in columns_of(run).items():
        head, _, rest = name.partition(".")
        if name in places:
            head, rest = "q", name
        elif name in LEDGER:
            head, rest = "energy", name
        elif name in read:
            head, rest = "outputs", name
        if name != "t":
            found.setdefault(head, {})[rest or name] = column
    found["error"] = {"q": Column("rad, m", run.error_at)}
    return {head: table for head, table in found.items() if table}


# -- MCAP ------------------------------------------------------------------------------------------


def mcap_of(run: Any) -> bytes:
    """Return the run as an MCAP file with JSON messages, whose log time is in ns from 0.

    The topic /tf has the poses, /scene the shapes, /events the events, /time the exact times [s],
    and each quantity has one of its own: /q, /v, /contact_force. The model is attached.
    """
    if run.t[0] < 0.0:
        text = f"starts at t = {run.t[0]:g} s, and an MCAP file counts time from 0; save a .csv or "
        raise FileError(Problem("run", "t_start", f"{text}.rrd file, or start the run at 0"))
    writing = needed(*NEEDED[".mcap"])
    buffer = io.BytesIO()
    writer = writing.Writer(buffer)
    writer.start(library="pgraph")
    topics = _Topics(writer, run)
    for name, schema in SCHEMAS.items():
        topics.add(name, schema)
    topics.tell("/scene", OF_SCENE, _scene(run), 0)
    _write_frames(run, topics)
    for event in run.events:
        now = _ns(event.t)
        line = {"timestamp": _stamp(now), "level": INFO, "message": str(event), "name": "pgraph"}
        line |= {"file": "", "line": 0}
        topics.tell("/events", OF_EVENTS, line, now)
    told = {"status": run.status.name, "message": run.message, "notices": "\n".join(run.notices)}
    told |= {"model": run.mechanism.model.name, "accuracy": run.accuracy}
    writer.add_metadata("pgraph", {**told, "version": str(run.header.get("version", ""))})
    model = run.mechanism.model.to_json().encode()
    writer.add_attachment(0, 0, "model.json", "application/json", model)
    writer.finish()
    return buffer.getvalue()


class _Topics:
    """The schemas and channels of an MCAP file."""

    def __init__(self, writer: Any, run: Any):
        self._writer, self._schemas, self._channels = writer, dict[str, int](), dict[str, int]()
        self._units = {
            f"/{head}": {name: column.unit for name, column in table.items() if column.unit}
            for head, table in tables_of(run).items()
        }

    def add(self, name: str, schema: Json) -> None:
        """Register a schema."""
        data = json.dumps({"title": name, **schema}).encode()
        self._schemas[name] = self._writer.register_schema(name, "jsonschema", data)

    def tell(self, topic: str, schema: str, message: Json, now: int) -> None:
        """Write a message at `now` [ns]."""
        if topic not in self._channels:
            self._channels[topic] = self._writer.register_channel(
                topic, "json", self._schemas[schema], self._units.get(topic, {})
            )
        data = json.dumps(message, allow_nan=False).encode()
        self._writer.add_message(self._channels[topic], now, data, now)


def _write_frames(run: Any, topics: _Topics) -> None:
    """Write the messages of all frames, in the order of time."""
    names, pose, world = run.mechanism.names, np.asarray(run.body_pose).tolist(), _world(run)
    tables = {head: _rows(table) for head, table in tables_of(run).items()}
    topics.add("time", objects(t=NUMBER))
    for head, (schema, _) in tables.items():
        topics.add(head, schema)
    for i, t in enumerate(run.t.tolist()):
        now = _ns(t)
        topics.tell("/time", "time", {"t": t}, now)
        frames = [
            {
                "timestamp": _stamp(now), "parent_frame_id": world, "child_frame_id": name,
                "translation": dict(zip("xyz", place)), "rotation": dict(zip("wxyz", place[3:])),
            }
            for name, place in zip(names, pose[i])
        ]  # fmt: skip
        topics.tell("/tf", OF_FRAMES, {"transforms": frames}, now)
        for head, (_, rows) in tables.items():
            topics.tell(f"/{head}", head, next(rows), now)


def _rows(table: dict[str, Column]) -> tuple[Json, Iterator[Json]]:
    """Return the schema of a table, and its rows. The axes of a vector are within its name."""
    places = [_place(name, table) for name in table]
    schema, empty = objects(), dict[str, Any]
    for place, column in zip(places, table.values()):
        own = schema["properties"]
        for name in place[:-1]:
            own = own.setdefault(name, objects())["properties"]
        own[place[-1]] = TEXT if column.unit == "" and _is_text(column) else NUMBER
    values = (_plain(column) for column in table.values())

    def rows() -> Iterator[Json]:
        for row in zip(*values):
            found = empty()
            for place, x in zip(places, row):
                within = found
                for name in place[:-1]:
                    within = within.setdefault(name, {})
                within[place[-1]] = x
            yield found

    return schema, rows()


def _place(name: str, table: dict[str, Column]) -> tuple[str, ...]:
    head, _, part = name.rpartition(".")
    inner = head and head not in table and (part in ("w", "x", "y", "z") or part.isdecimal())
    return (head, part) if inner else (name,)


def _is_text(column: Column) -> bool:
    return np.asarray(column.values).dtype.kind not in "fiub"


def _plain(column: Column) -> list[Any]:
    values = np.asarray(column.values)
    if _is_text(column):
        return [str(x) for x in values]
    return [x if np.isfinite(x) else None for x in values.astype(float).tolist()]


def _scene(run: Any) -> Json:
    entities = [
        {
            "timestamp": _stamp(0), "frame_id": solid.body, "id": f"{solid.body} {k}",
            "lifetime": _stamp(0), "frame_locked": True,
            "triangles": [
                {
                    "pose": {
                        "position": dict.fromkeys("xyz", 0.0),
                        "orientation": {"w": 1.0, **dict.fromkeys("xyz", 0.0)},
                    },
                    "points": [dict(zip("xyz", point)) for point in solid.vertices.tolist()],
                    "color": dict(zip("rgba", solid.color)), "colors": [],
                    "indices": solid.faces.ravel().tolist(),
                }
            ],
            **{name: [] for name in OTHERS},
        }
        for k, solid in enumerate(solids_of(run))
    ]  # fmt: skip
    return {"deletions": [], "entities": entities}


def _world(run: Any) -> str:
    """Return a name for the frame of the world that no body has."""
    found = WORLD
    while found in run.mechanism.names:
        found += "_"
    return found


def _ns(t: float) -> int:
    return round(t * SECOND)


def _stamp(now: int) -> Json:
    return {"sec": now // SECOND, "nsec": now % SECOND}


# -- Rerun -----------------------------------------------------------------------------------------


def rerun_of(run: Any) -> Any:
    """Return a Rerun recording of the run, with the timeline `t` [s] of nanoseconds.

    Bodies are at `world/BODY`, columns at `QUANTITY/NAME`, events at `events`, and the exact times
    at `time`. Words are told where they change.
    """
    rr = needed(*NEEDED[".rrd"])
    model = run.mechanism.model
    recording = rr.RecordingStream("pgraph")
    recording.set_log_time_enabled(False)  # the time of day
    recording.send_recording_name(model.name)
    world = getattr(rr.ViewCoordinates, f"RIGHT_HAND_{model.up.upper()}_UP")
    recording.log(WORLD, world, static=True)
    times = [rr.TimeColumn("t", duration=np.round(run.t * SECOND).astype("timedelta64[ns]"))]
    for name, pose in zip(run.mechanism.names, np.asarray(run.body_pose).swapaxes(0, 1)):
        turns = pose[:, [4, 5, 6, 3]]  # x, y, z, w
        columns = rr.Transform3D.columns(translation=pose[:, :3], quaternion=turns)
        recording.send_columns(rr.new_entity_path([WORLD, name]), times, columns)
    for k, solid in enumerate(solids_of(run)):
        drawn = rr.Mesh3D(
            vertex_positions=solid.vertices, triangle_indices=solid.faces, albedo_factor=solid.color
        )
        recording.log(rr.new_entity_path([WORLD, solid.body, f"shape {k}"]), drawn, static=True)
    recording.send_columns("time", times, rr.Scalars.columns(scalars=run.t))
    lines = [(event.t, ["events"], str(event)) for event in run.events]
    for head, table in tables_of(run).items():
        for name, column in table.items():
            path, values = [head, *_place(name, table)], np.asarray(column.values)
            if _is_text(column):
                new = np.flatnonzero(np.append(True, values[1:] != values[:-1]))
                lines += [(float(run.t[i]), path, str(values[i])) for i in new]
                continue
            scalars = rr.Scalars.columns(scalars=values.astype(float))
            recording.send_columns(rr.new_entity_path(path), times, scalars)
    for t, path, text in sorted(lines, key=lambda line: line[0]):
        recording.set_time("t", duration=np.timedelta64(_ns(t), "ns"))
        recording.log(rr.new_entity_path(path), rr.TextLog(text))
    return recording


def rrd_of(run: Any) -> bytes:
    """Return the run as a file of Rerun."""
    return bytes(rerun_of(run).memory_recording().drain_as_bytes())
