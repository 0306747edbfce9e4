"""Model files in JSON with a schema version and one part per line, written atomically."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import stat
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileError, ModelError, Problem, choices, nearest_first, shown
from ..fields import GROUND, Frozen, OfKinds, facts
from ..file_kinds import MINE, MODELS, first_element, is_json, is_step, kind_of
from ..forces import Force
from ..joints import PER_MOTION
from ..markup import content_of, reason_of
from ..mesh_files import parsed_mesh
from ..signals.meaning import varies
from .beam import Beam
from .body import Body
from .constraint import Constraint
from .contact import Contact
from .control import Control
from .imperfect import Imperfect
from .output import OF_CONTACT, OF_SUBTREE, Output
from .parameters import CURVES, Formula, holds_formula, inlined, texts_in
from .scenario import Scenario
from .settings import STEP
from .shape import Shape
from .world import Ground

# 1: without parameters, formulas, several shapes, density and derived; 2: without tendons, inputs;
# 4: without bushings and struts; 5: without expressions; 6: without controls, moving surfaces;
# 7: without expressions in springs; 8: without expressions in contacts, `once` in switches, speed
# limits, outputs of subtrees and `rtol` in scenarios, with 0.01 kg m^2 for bodies without inertia;
# 9: without beams and imperfect outputs
SCHEMA_VERSION = 10
EXPRESSIONS, ONCE = 6, 9
SCHEMA = "pgraph-model"

FOREIGN = {
    ".urdf": "urdf",
    ".xacro": "urdf",
    ".xml": "mjcf",
    ".mjcf": "mjcf",
    ".osim": "osim",
    ".step": "step",
    ".stp": "step",
}  # suffixes of other formats
WRITTEN = ("urdf", "mjcf")

BUILT_IN = "pgraph.models"  # group of the entry point of the package of built-in models
NOT_OURS = "is not a Pgraph file; read it with pg.load, which converts it"
LARGEST = 64_000_000  # bytes of a file
MOST_VALUES = 5_000_000
MOST_BRACKETS = 100  # levels of brackets
STRINGS = re.compile(r'"[^"\\]*(?:\\.[^"\\]*)*"?', re.DOTALL)  # also one that does not end: linear
BRACKETS = re.compile(r"[\[\]{}]")
SHALLOW = 16  # levels of brackets, more than models have
SQUARE = bytes.maketrans(b"{}", b"[]")
OTHERS = bytes(set(range(256)) - set(b'[]{}"'))  # all but brackets and quotes


def to_json(fields: Mapping[str, Any], formulas: Sequence[Formula]) -> str:
    """Return a model's fields as JSON text, without implied values (motions, zeros)."""
    data: dict[str, Any] = {"$schema": SCHEMA, "schema_version": 1, **fields}
    _put_formulas(data, formulas)
    data["bodies"] = [_concise(body) for body in data["bodies"]]
    for i, c in enumerate(data["constraints"]):  # older versions ask for `other` of every kind
        first = {key: c[key] for key in ("name", "kind", "body")}
        data["constraints"][i] = {**first, "other": GROUND, **c}
    for holder, name, kinds in _of_kinds(data):
        holder[name] = [_without_new(kinds.class_for(x), x) for x in holder[name]]
    data["contacts"] = [_without_new(Contact, x) for x in data["contacts"]]
    data["beams"] = [_without_new(Beam, x) for x in data["beams"]]
    data["ground"] = _without_new(Ground, data["ground"])
    for scenario in data["scenarios"]:
        if not scenario["switches"]:
            del scenario["switches"]
    data["outputs"] = [
        _without_imperfect({k: x for k, x in o.items() if (k, x) != ("coordinate", 0)})
        for o in data["outputs"]
    ]
    data["schema_version"] = max(_versions(data))
    plain = Ground().model_dump(mode="json", exclude_none=True)
    if data["ground"] == _without_new(Ground, plain):
        del data["ground"]
    for key in ("beams", "contacts", "parameters", "sites", "outputs", "controls"):
        if not data[key]:
            del data[key]
    lines = []
    for key, value in data.items():
        if isinstance(value, list) and value and isinstance(value[0], dict):
            rows = ",\n".join("    " + json.dumps(item) for item in value)
            lines.append(f"  {json.dumps(key)}: [\n{rows}\n  ]")
        else:
            lines.append(f"  {json.dumps(key)}: {json.dumps(value)}")
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _without_imperfect(output: dict[str, Any]) -> dict[str, Any]:
    """Return an output whose imperfections have no default values."""
    if "imperfect" not in output:
        return output
    usual = {k: info.default for k, info in Imperfect.model_fields.items()}
    given = {k: x for k, x in output["imperfect"].items() if x != usual[k]}
    return {**output, "imperfect": given}


def _of_kinds(data: dict[str, Any]) -> Iterator[tuple[dict[str, Any], str, type[OfKinds]]]:
    """Yield (object, key, class) for each list of parts that have kinds."""
    yield data, "constraints", Constraint
    yield data, "controls", Control
    for holder in (data, *data["scenarios"]):
        yield holder, "forces", Force


def _without_new(kind: type[Frozen], data: dict[str, Any]) -> dict[str, Any]:
    """Return the fields of a part, without default values in fields that schema 1 lacks."""
    new = _new_fields(kind)
    return {k: x for k, x in data.items() if k not in new or x != new[k]}


@cache
def _new_fields(kind: type[Frozen]) -> dict[str, Any]:
    """Return the default values of the fields that schema 1 lacks, as JSON has them."""
    fields = {k: info.default for k, info in kind.model_fields.items() if facts(info).since > 1}
    return {k: [] if x == () else x for k, x in fields.items()}  # JSON has no tuples


@cache
def _since(kind: type[Frozen]) -> tuple[int, dict[str, int]]:
    """Return the first schema versions of a kind and of each of its fields."""
    fields = {k: facts(info).since for k, info in kind.model_fields.items()}
    return getattr(kind, "SINCE", 1), fields


def _versions(data: dict[str, Any]) -> Iterator[int]:
    """Yield the oldest schema version that supports each part."""
    yield 9 if any(x["kind"] in (*OF_SUBTREE, *OF_CONTACT) for x in data["outputs"]) else 1
    yield 3 if data["sites"] or data["outputs"] else 2 if data["parameters"] else 1
    yield 4 if any("step" not in scenario for scenario in data["scenarios"]) else 1
    parts = [(Ground, data["ground"]), *((Scenario, x) for x in data["scenarios"])]
    parts += [(Body, x) for x in data["bodies"]] + [(Output, x) for x in data["outputs"]]
    shaped = (x.get("shapes") or [x.get("shape")] for x in data["bodies"])
    parts += [(Shape, shape) for shapes in shaped for shape in shapes if shape]
    named = data["parameters"]
    own = [(kinds.class_for(x), x) for holder, name, kinds in _of_kinds(data) for x in holder[name]]
    parts += (own := own + [(Contact, x) for x in data["contacts"]])
    parts += [(Beam, x) for x in data["beams"]]
    for kind, part in own:
        texts = texts_in(part) if holds_formula(part) else ()
        bare = any(isinstance(part.get(key), str) for key in CURVES)
        if bare or any(varies(x, named) for x in texts):
            yield getattr(kind, "VARIES_SINCE", EXPRESSIONS)
    if any(holds_formula(f) for scenario in data["scenarios"] for f in scenario["forces"]):
        yield EXPRESSIONS
    switches = (x for s in data["scenarios"] for x in s.get("switches", ()))
    conditions = [x.get("when") or {} for x in switches]
    if any("holds" in when or "after" in when for when in conditions):
        yield EXPRESSIONS
    if any("once" in when for when in conditions):
        yield ONCE
    for kind, part in parts:
        own, since = _since(kind)
        yield max([own, *(since[key] for key in part if key in since)])


def _put_formulas(data: dict[str, Any], formulas: Sequence[Formula]) -> None:
    """Insert each formula into its field."""
    del data["formulas"]
    mine: dict[tuple[str, str], list[Formula]] = {}
    for formula in formulas:
        mine.setdefault((formula.part, formula.name), []).append(formula)
    for part in {formula.part for formula in formulas}:
        items = data[part]
        for i, item in enumerate(items):
            found = mine.get((part, item["name"]), [])
            if not _plain(item.get("shapes", ())):  # the first one is written as `shapes`
                found = [_of_first_shape(formula) for formula in found]
            items[i] = inlined(item, found) if found else item


def _of_first_shape(formula: Formula) -> Formula:
    """Return the formula with a path into `shapes`, whose first entry is also `shape`."""
    if formula.path[0] != "shape":
        return formula
    return formula.unchecked_copy({"path": ("shapes", 0, *formula.path[1:])})


def _concise(body: dict[str, Any]) -> dict[str, Any]:
    """Return a body without redundant fields: a kind's motions, a compound's axes, zeros."""
    implied = {"axes"} if body["joint"] == "compound" else {"motions"}
    for field in (*PER_MOTION, "v", "limits"):
        if not any(body[field]):
            implied.add(field)
    implied |= {"shapes"} if _plain(body["shapes"]) else {"shape"}
    implied |= {key for key in ("derived", "any_inertia") if not body[key]}
    kept = {key: value for key, value in body.items() if key not in implied}
    for key, shapes in (("shape", [kept.get("shape")]), ("shapes", kept.get("shapes", ()))):
        new = [{k: x for k, x in s.items() if USUAL.get(k) != x} for s in shapes if s]
        if new:
            kept[key] = new if key == "shapes" else new[0]
    return kept


USUAL = {  # default fields of shapes, which files omit
    "role": "both", "opacity": 1.0, "surface_velocity": [0.0] * 3, "surface_spin": [0.0] * 3,
}  # fmt: skip


def _plain(shapes: Sequence[Mapping[str, Any]]) -> bool:
    """Check whether there is at most one shape, as in schema 1."""
    if len(shapes) > 1:
        return False
    return all(
        all(shape[key] == value for key, value in USUAL.items())
        and "colour" not in shape
        and not isinstance(shape["scale"], list)
        for shape in shapes
    )


def parse(text: str, source: str) -> dict[str, Any]:
    """Parse JSON text into fields and check the version. Raises FileError."""
    try:
        text = text.removeprefix("\ufeff")  # the mark that some editors set
        _refuse_too_large(text, source)
        data = json.loads(text, parse_int=_number, object_pairs_hook=_no_twins)
    except json.JSONDecodeError as error:
        where = f"{source}, line {error.lineno}"
        found = f"not JSON: {error.msg} at column {error.colno}"
        raise FileError(Problem(where, "", f"{found}; models end in {MODELS}")) from None
    except RecursionError:
        raise FileError(Problem(source, "", "no model: its brackets nest too deeply")) from None
    except _Twin as twin:
        raise FileError(Problem(source, "", str(twin))) from None
    if not isinstance(data, dict):
        text = f"must contain a JSON object with the fields of a model, got {shown(data)}"
        raise FileError(Problem(source, "", text))
    data.pop("$schema", None)
    version = data.pop("schema_version", SCHEMA_VERSION)
    if not isinstance(version, int) or isinstance(version, bool) or version < 1:
        text = f"must be a whole number >= 1, got {shown(version)}"
        raise FileError(Problem(source, "schema_version", text))
    if version > SCHEMA_VERSION:
        text = f"is {version}, newer than {SCHEMA_VERSION}, the newest known; update Pgraph"
        raise FileError(Problem(source, "schema_version", text))
    bodies = data.get("bodies") if version < 9 else None
    for body in bodies if isinstance(bodies, list) else ():
        if isinstance(body, dict):
            follow = body.get("derived", ["inertia"] if "density" in body else [])
            if not (isinstance(follow, list) and "inertia" in follow):
                body.setdefault("inertia", [0.01, 0.01, 0.01])
    scenarios = data.get("scenarios") if version < 4 else None  # they had a step of their own
    for scenario in scenarios if isinstance(scenarios, list) else ():
        if isinstance(scenario, dict):
            scenario.setdefault("step", STEP)
    return data


def found(path: str | Path) -> str | Path:
    """Return the path of a built-in model for its name, unless a file has that name."""
    built_in = _built_in(path) if not Path(path).exists() else None
    return path if built_in is None or str(path) not in built_in.names() else built_in.path(path)


def _built_in(path: str | Path) -> Any:
    """Return the package of built-in models if `path` may be a name, and None if it is lacking."""
    points = entry_points(group=BUILT_IN) if str(path).isidentifier() else ()
    return next((point.load() for point in points), None)


def read(path: str | Path) -> str:
    """Return the text of a file. Raises FileError."""
    try:
        content = content_of(path, LARGEST)
        refuse_kind(path, content)
        foreign = Path(path).suffix.lower() in FOREIGN and not is_json(content)
        if foreign or first_element(content) in MINE or is_step(content):
            raise FileError(Problem(shown_path(path), "", NOT_OURS))
        return content.decode()
    except UnicodeDecodeError as error:
        text = f"not text in UTF-8 (byte {error.start}); models end in {MODELS}"
        raise FileError(Problem(str(path), "", text)) from None
    except (OSError, ValueError) as error:
        text = f"cannot be read: {reason_of(error)}; give the path of a model file"
        if built_in := _built_in(path):
            names = nearest_first(str(path), built_in.names())
            text += f", or the name of a built-in model: {choices(names)}"
        raise FileError(Problem(shown_path(path), "", text)) from None


def refuse_kind(path: str | Path, content: bytes) -> None:
    """Raise FileError with advice if a file does not contain a model."""
    if kind := kind_of(path, content):
        raise FileError(Problem(shown_path(path), "", kind.text))


WRITABLE = stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH


def write_atomic(path: str | Path, content: str | bytes) -> None:
    """Write a file atomically, so that the path contains either the old or the new content.

    Raises FileError.
    """
    data = content.encode() if isinstance(content, str) else content
    given, temporary = path, None
    try:
        path = Path(path).resolve()  # a link stays a link
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        if path.exists() and not path.is_file():
            raise OSError(errno.EINVAL, "it is not a regular file")
        if path.exists() and not (path.stat().st_mode & WRITABLE and os.access(path, os.W_OK)):
            raise OSError(errno.EACCES, "it is read-only")  # its folder alone would allow it
        handle, temporary = tempfile.mkstemp(prefix=".pgraph-", dir=path.parent)
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        mode = path.stat().st_mode & 0o777 if path.exists() else 0o666 & ~_umask()
        os.chmod(temporary, mode)
        os.replace(temporary, path)
    except (OSError, ValueError, RuntimeError) as error:
        text = f"cannot be written: {reason_of(error)}; choose another place"
        raise FileError(Problem(shown_path(given), "", text)) from None
    finally:
        if temporary is not None:  # gone if it took the path's place
            Path(temporary).unlink(missing_ok=True)


def user_folder(variable: str, below_home: str) -> Path:
    """Return the folder for files of the current user, which is $variable/pgraph or a folder in the
    home directory.

    If there is no home folder, as in some containers, a temporary folder is used.
    """
    given = os.environ.get(variable) or os.environ.get("LOCALAPPDATA")
    home = os.path.expanduser("~")
    if given or os.path.isabs(home):
        return Path(given or Path(home, below_home)) / "pgraph"
    return Path(tempfile.gettempdir(), f"pgraph-{os.getuid()}")


def shown_path(path: str | Path) -> str:
    """Return a path for display in a message."""
    return str(path) if str(path).isprintable() and str(path) else repr(str(path))


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _number(digits: str) -> int | float:
    """Parse an integer, or return infinity beyond the float range, for fields to reject."""
    return int(digits) if len(digits) < 310 else float(digits)


def _refuse_too_large(text: str, source: str) -> None:
    """Check the limits on size, values and depth in one pass. Raises FileError."""
    if len(text) > LARGEST:
        size = f"has {len(text) / 1e6:.0f} MB; {LARGEST / 1e6:.0f} MB at most"
        raise FileError(Problem(source, "", size))
    if _plainly_small(text):
        return
    bare = STRINGS.sub("", text)
    count = bare.count(",") + bare.count(":")
    if count > MOST_VALUES:
        raise FileError(Problem(source, "", f"has {count} values; {MOST_VALUES} at most"))
    depth = 0
    for bracket in BRACKETS.findall(bare):
        depth += 1 if bracket in "[{" else -1
        if depth > MOST_BRACKETS:
            text = f"no model: its brackets nest too deeply; {MOST_BRACKETS} levels at most"
            raise FileError(Problem(source, "", text))


def _plainly_small(text: str) -> bool:
    """Check whether text is within the limits, by counts ten times faster than exact ones."""
    if "\\" in text or text.count(",") + text.count(":") > MOST_VALUES:
        return False
    left = text.encode(errors="replace").translate(SQUARE, OTHERS)
    left = left.replace(b'""', b"")  # removes strings, but for quotes around brackets
    for _ in range(SHALLOW):
        left = left.replace(b"[]", b"")  # the innermost levels
    return not left


class _Twin(Exception):
    """A duplicate field, for which JSON would keep the last value."""


def _no_twins(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    data = dict(pairs)
    if len(data) < len(pairs):
        seen: set[str] = set()
        twin = next(key for key, _ in pairs if key in seen or seen.add(key))
        named = f" named {shown(data['name'])}" if "name" in data and twin != "name" else ""
        raise _Twin(f"field {shown(twin)} is given twice in one object{named}; keep one of them")
    return data


# -- mesh files ------------------------------------------------------------------------------------


FOLDER = "meshes"  # folder of meshes from elsewhere next to a saved model
ALLOWED = "PGRAPH_MESHES"  # environment: more folders whose meshes a model may name
ALLOW = "allow its folder: roots=[FOLDER] in Python, --root FOLDER in the terminal"

# -- meshes that a model file names ----------------------------------------------------------------


def located(
    data: dict[str, Any], folder: str | Path | None, roots: Iterable[str | Path] = ()
) -> dict[str, Any]:
    """Return the fields of a model with absolute mesh paths, resolved relative to `folder`.

    Without a folder, names are relative to the current folder and are not changed. Raises
    ModelError for meshes outside of the folder, `roots` and the folders in $PGRAPH_MESHES, also if
    `..` or a link leads out.
    """
    bodies = data.get("bodies")
    if not isinstance(bodies, list):
        return data
    start = Path(folder or "").absolute()
    allowed = (start, *map(Path, roots), *_allowed_always())
    problems: list[Problem] = []
    found = [_located(body, start, allowed, problems) for body in bodies]
    if problems:
        raise ModelError(problems)
    return data if folder is None else {**data, "bodies": found}


def _allowed_always() -> list[Path]:
    return [Path(each) for each in os.environ.get(ALLOWED, "").split(os.pathsep) if each]


def _located(body: Any, folder: Path, allowed: tuple[Path, ...], problems: list[Problem]) -> Any:
    if not isinstance(body, dict):
        return body

    def placed(shape: Any) -> Any:
        file = shape.get("file") if isinstance(shape, dict) else None
        if not isinstance(file, str) or not file:
            return shape
        try:
            path = folder / file
            inside = any(path.resolve().is_relative_to(each.resolve()) for each in allowed)
        except (OSError, ValueError, RuntimeError):  # a NUL, a circle of links
            inside, path = False, folder
        if not inside:
            where = f"body {shown(body.get('name', ''))}"
            problems.append(Problem(where, "shape", _outside(file, folder)))
        return {**shape, "file": str(path)}

    changed = dict(body)
    if "shape" in body:
        changed["shape"] = placed(body["shape"])
    if isinstance(shapes := body.get("shapes"), list):
        changed["shapes"] = [placed(shape) for shape in shapes]
    return changed


def _outside(file: str, folder: Path) -> str:
    return (
        f"the mesh file {shown(file, 200)} is outside the model's folder {folder}; copy it "
        f"into that folder, or {ALLOW}"
    )


# -- saving ----------------------------------------------------------------------------------------


def gathered(bodies: Iterable[Body], folder: Path) -> tuple[Body, ...]:
    """Return the bodies as stored in a model file in `folder`, with relative mesh paths.

    Meshes from other folders are copied to the subfolder `meshes`. The names of missing meshes are
    not changed. Raises FileError for a file that is no mesh, by the body's name.
    """
    folder, known = folder.absolute(), {}

    def carried(body: Body, shape: Shape) -> Shape:
        if not shape.file:
            return shape
        if shape.file not in known:
            known[shape.file] = _carried(body.name, Path(shape.file), folder)
        return shape.unchecked_copy({"file": known[shape.file]})

    def saved(body: Body) -> Body:
        if not any(shape.file for shape in body.shapes):
            return body
        shapes = tuple(carried(body, shape) for shape in body.shapes)
        return body.unchecked_copy({"shapes": shapes})

    return tuple(map(saved, bodies))


def _carried(body: str, file: Path, folder: Path) -> str:
    """Return the path of a mesh relative to `folder`, copying its geometry there if necessary."""
    try:
        inside = file.resolve().is_relative_to(folder.resolve())
        if inside and file.absolute().is_relative_to(folder):
            return file.absolute().relative_to(folder).as_posix()
        if inside:
            return file.resolve().relative_to(folder.resolve()).as_posix()
        to = folder / FOLDER / file.name
        if not file.is_file():
            return to.relative_to(folder).as_posix()
        to, content = _geometry(file, to)
        (folder / FOLDER).mkdir(exist_ok=True)
        if to.exists() and to.read_bytes() != content:
            to = to.with_stem(f"{to.stem}-{hashlib.sha256(content).hexdigest()[:8]}")
        if not to.exists():
            to.write_bytes(content)
        return to.relative_to(folder).as_posix()
    except FileError as error:
        do = "give the body another shape, or none"
        found = [Problem(f"body {shown(body)}", "shape", f"{p}; {do}") for p in error.problems]
        raise FileError(found) from None
    except (OSError, ValueError) as error:
        text = f"cannot be copied to {folder / FOLDER}: {reason_of(error)}; choose another place"
        raise FileError(Problem(f"mesh {file}", "", text)) from None


def _geometry(file: Path, to: Path) -> tuple[Path, bytes]:
    """Return the path and content of a mesh copy, which only contains vertices and faces.

    STL stays STL. Other formats become OBJ, which loses no digit.
    """
    mesh = parsed_mesh(file)
    if file.suffix.lower() == ".stl":
        return to, mesh.export(file_type="stl")
    return to.with_suffix(".obj"), obj_text(mesh.vertices, mesh.faces)


def obj_text(vertices: Any, faces: Any) -> bytes:
    """Return an OBJ file with vertices (n, 3) and faces (m, 3) at full precision."""
    rows = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(vertices, float).tolist()]
    rows += [f"f {a} {b} {c}" for a, b, c in (np.asarray(faces) + 1).tolist()]
    return ("\n".join(rows) + "\n").encode()


def mesh_folder() -> Path:
    """Return this user's folder for meshes that were uploaded or embedded in a model file."""
    return user_folder("XDG_DATA_HOME", ".local/share") / FOLDER


def kept_mesh(name: str, vertices: Any, faces: Any) -> Path:
    """Store a mesh embedded in a model file and return its path. Raises FileError."""
    content = obj_text(vertices, faces)
    stem = re.sub(r"[^\w-]+", "_", name)[:60] or "mesh"
    path = mesh_folder() / f"{stem}-{hashlib.sha256(content).hexdigest()[:8]}.obj"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        text = f"cannot be made: {reason_of(error)}"
        raise FileError(Problem(f"folder {path.parent}", "", text)) from None
    if not path.exists():
        write_atomic(path, content)
    return path
