"""Parts of a STEP file, read by Open CASCADE: names, colours, exact mass properties, faces, meshes.

Only `parts_of` imports the library, which takes seconds and 400 MB: call it in a child process.
"""

# pyright: reportAttributeAccessIssue=false
# (the library has no types)

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import FileError, Problem, needed
from ..markup import content_of, reason_of
from ..mesh_files import UNITS
from ..model.files import kept_mesh
from ..tolerances import COINCIDENT, NOTABLE, TOUCHING
from .conversion import DENSEST, Kind
from .step_joints import Array, Face

MILLIMETRE = UNITS["mm"]
EXTRA = "cad"
PRECISION = NOTABLE**2  # relative, of the integrals over each face
UNITS_OF_STEP = {  # names of units [m]
    "millimetre": 0.001, "centimetre": 0.01, "metre": 1.0, "inch": 0.0254, "foot": 0.3048,
}  # fmt: skip
LARGEST = 500_000_000  # bytes of a file
MOST_PARTS = 2000
CHORD = TOUCHING  # largest distance of a mesh from its solid, relative to the size of the part
SIDES = 32  # least number of sides of a mesh around a cylinder
AUTOMATIC = re.compile(r"=>\[|NAUO\d+$|SOLID$|COMPOUND$|Open CASCADE", re.IGNORECASE)
UNCERTAINTY = re.compile(
    rb"UNCERTAINTY_MEASURE_WITH_UNIT\s*\(\s*LENGTH_MEASURE\s*\(\s*([-+.\dEe]+)"
)


@dataclass(frozen=True, eq=False)
class Part:
    """A rigid part of an assembly, in the axes of the assembly at the pose of the file [m].

    Its mass properties are those of the exact solid with the density 1 kg/m^3.
    """

    name: str
    product: str  # its name in the file, which others may have too
    within: str  # names of the assemblies around it
    volume: float  # [m^3], 0 for surfaces
    com: Array
    inertia: Array  # (3, 3) about the centre of mass
    place: Array  # position of the mesh
    turn: Array  # (3, 3) of the mesh
    file: str  # mesh, "" if there is none
    chord: float  # largest distance of the mesh from the solid [m]
    box: Array  # (2, 3)
    colour: tuple[float, float, float] | None
    density: float  # density of the file's material, 0 without one
    faces: tuple[Face, ...] = ()


class Parts(NamedTuple):
    """All parts of a file."""

    parts: list[Part]
    unit: str
    tolerance: float  # within which the file's features are at one place [m]
    notes: list[tuple[Kind, str, str]]  # (kind of entry, part, text)

    def unfaced(self) -> Parts:
        """Return the parts without their faces, which are large."""
        return self._replace(parts=[replace(part, faces=()) for part in self.parts])


def content_of_step(path: Path) -> bytes:
    """Return the content of a STEP file. Raises FileError."""
    try:
        content = content_of(path, LARGEST)
    except (OSError, ValueError) as error:
        text = f"cannot be read: {reason_of(error)}; give the path of a STEP file"
        raise FileError(Problem(path.name, "", text)) from None
    if b"ISO-10303-21" not in content[:1000]:
        text = "is not STEP: it does not begin with ISO-10303-21; save it as STEP from your CAD"
        raise FileError(Problem(path.name, "", text))
    if b"END-ISO-10303-21" not in content:
        text = "is cut short: it does not end with END-ISO-10303-21; export it again from your CAD"
        raise FileError(Problem(path.name, "", text))
    return content


def parts_of(path: Path, tolerance: float | None = None) -> Parts:
    """Read the parts of a STEP file. Raises FileError, MissingPackage."""
    needed("OCP", EXTRA)
    content = content_of_step(path)
    assembly = _Assembly(path)
    if not assembly.parts:
        text = "holds no solid, which alone has a mass; export solids, not surfaces or drawings"
        raise FileError(Problem(path.name, "", text))
    corners = np.array([part.box for part in assembly.parts])
    size = float(np.max(corners[:, 1].max(0) - corners[:, 0].min(0)))
    of_file = min(map(float, UNCERTAINTY.findall(content)), default=0.0) * UNITS_OF_STEP.get(
        assembly.unit, MILLIMETRE
    )
    given = max(of_file, NOTABLE * size) if tolerance is None else tolerance
    return Parts(assembly.parts, assembly.unit, given, assembly.notes)


@dataclass
class _Solids:
    """The geometry of a part in its own axes [m], shared by all of its instances."""

    shape: Any
    name: str
    volume: float = 0.0
    com: Array = field(default_factory=lambda: np.zeros(3))
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))
    chord: float = 0.0
    bare: int = 0  # faces that could not be meshed

    def __post_init__(self) -> None:
        self._measure()
        from OCP.Bnd import Bnd_Box
        from OCP.BRepAdaptor import BRepAdaptor_Surface
        from OCP.BRepBndLib import BRepBndLib
        from OCP.BRepMesh import BRepMesh_IncrementalMesh
        from OCP.GeomAbs import GeomAbs_SurfaceType
        from OCP.IMeshTools import IMeshTools_MeshAlgoType, IMeshTools_Parameters

        around = Bnd_Box()
        BRepBndLib.AddOptimal_s(self.shape, around, False, False)
        corners = np.array([x.Coord() for x in (around.CornerMin(), around.CornerMax())])
        reach = float(np.max(corners[1] - corners[0]))
        self.chord = CHORD * reach * MILLIMETRE
        how = IMeshTools_Parameters()
        how.Deflection, how.Angle = CHORD * reach, 2 * math.pi / SIDES
        # of planes with many holes, the default takes time of their second power; the other one
        # fails on curved faces
        how.MeshAlgo = IMeshTools_MeshAlgoType.IMeshTools_MeshAlgoType_Delabella
        for face in _each(self.shape, "FACE"):
            if BRepAdaptor_Surface(face).GetType() == GeomAbs_SurfaceType.GeomAbs_Plane:
                BRepMesh_IncrementalMesh(face, how)
        how.MeshAlgo = IMeshTools_MeshAlgoType.IMeshTools_MeshAlgoType_Watson
        BRepMesh_IncrementalMesh(self.shape, how)

    def _measure(self) -> None:
        from OCP.BRepGProp import BRepGProp
        from OCP.GProp import GProp_GProps

        volume, moment, second = 0.0, np.zeros(3), np.zeros((3, 3))  # about the origin
        for solid in _each(self.shape, "SOLID"):
            found = GProp_GProps()
            BRepGProp.VolumeProperties_s(solid, found, PRECISION, False, False)
            com, rows = np.array(found.CentreOfMass().Coord()), found.MatrixOfInertia()
            inertia = np.array([[rows.Value(i, j) for j in (1, 2, 3)] for i in (1, 2, 3)])
            volume += found.Mass()
            moment += found.Mass() * com
            second += inertia + found.Mass() * carried(com)
        self.sign = math.copysign(1.0, volume)  # negative if its faces look inwards
        self.volume = abs(volume) * MILLIMETRE**3
        com = moment / (volume or 1.0)
        self.com = com * MILLIMETRE
        self.inertia = self.sign * (second - volume * carried(com)) * MILLIMETRE**5

    @cached_property
    def surfaces(self) -> list[tuple[Any, Array, Array]]:
        """The faces with their points (n, 3) [m] and triangles (m, 3), which look outwards."""
        from OCP.BRep import BRep_Tool
        from OCP.TopAbs import TopAbs_Orientation
        from OCP.TopLoc import TopLoc_Location

        found = []
        for face in _each(self.shape, "FACE"):
            place = TopLoc_Location()
            mesh = BRep_Tool.Triangulation_s(face, place)
            if mesh is None:
                self.bare += 1
                continue
            nodes = [mesh.Node(k).Coord() for k in range(1, mesh.NbNodes() + 1)]
            rows = [mesh.Triangle(k).Get() for k in range(1, mesh.NbTriangles() + 1)]
            turn, at = _matrix(place.Transformation())
            points = np.array(nodes) @ turn.T + at
            triangles = np.array(rows).reshape(-1, 3) - 1
            if (face.Orientation() == TopAbs_Orientation.TopAbs_REVERSED) != (self.sign < 0):
                triangles = triangles[:, ::-1]
            found.append((face, points * MILLIMETRE, triangles))
        return found

    @cached_property
    def file(self) -> str:
        """The path of the stored mesh, or "" if there are no triangles."""
        if not self.surfaces:
            return ""
        starts = np.cumsum([0, *(len(points) for _, points, _ in self.surfaces)])
        points = np.vstack([points for _, points, _ in self.surfaces])
        rows = np.vstack([own + start for (_, _, own), start in zip(self.surfaces, starts)])
        near = np.round(points / (COINCIDENT * self.chord / CHORD))  # seams are closed twice
        _, first, to = np.unique(near, axis=0, return_index=True, return_inverse=True)
        rows = to.reshape(-1)[rows]
        flat = (rows == np.roll(rows, 1, axis=1)).any(axis=1)
        return str(kept_mesh(self.name, points[first], rows[~flat]))

    @cached_property
    def faces(self) -> tuple[Face, ...]:
        found = (_face(*surface, self.chord) for surface in self.surfaces if len(surface[2]))
        return tuple(face for face in found if face)

    @cached_property
    def box(self) -> Array:
        points = np.vstack([points for _, points, _ in self.surfaces])
        return np.array((points.min(0), points.max(0)))


def _face(shape: Any, points: Array, rows: Array, chord: float) -> Face | None:
    """Return a plane, cylinder, cone, sphere or torus, or None for other surfaces."""
    from OCP.BRepTools import BRepTools

    known = _elementary(shape, chord * NOTABLE / CHORD / MILLIMETRE)
    if known is None:
        return None
    kind: Any
    kind, solid, exact = known
    frame = solid.Position()
    at = solid.Apex() if kind == "cone" else frame.Location()
    point, axis = np.array(at.Coord()) * MILLIMETRE, np.array(frame.Direction().Coord())
    triangles = points[rows]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    given: dict[str, Any] = {"box": np.array((points.min(0), points.max(0))), "point": point}
    if kind == "plane":
        way = math.copysign(1.0, float(normals.sum(0) @ axis))
        more = {"triangles": triangles, "blur": _blur(shape, chord)}
        return Face("plane", axis=way * axis, **given, **more)
    turn, along = BRepTools.UVBounds_s(shape), (points - point) @ axis
    given |= {"low": float(along.min()), "high": float(along.max())}
    share = abs(turn[1] - turn[0]) / (2 * math.pi) if exact else 1.0
    out = triangles.mean(axis=1) - point
    if kind != "sphere":
        out -= (out @ axis)[:, None] * axis
    if kind == "torus":  # from the middle of the tube
        radii = np.linalg.norm(out, axis=1, keepdims=True)
        ring = out / np.where(radii > 0, radii, 1.0) * solid.MajorRadius() * MILLIMETRE
        out = triangles.mean(axis=1) - point - ring
    side = 1 if float(np.sum(out * normals)) > 0 else -1
    match kind:
        case "cylinder":
            given["radius"] = radius = solid.Radius() * MILLIMETRE
            if not exact and (length := given["high"] - given["low"]):
                share = float(areas.sum()) / (4 * math.pi * radius * length)
        case "sphere":
            given["radius"] = radius = solid.Radius() * MILLIMETRE
            share = float(areas.sum()) / (8 * math.pi * radius**2)
        case "cone":
            given["wide"] = abs(solid.SemiAngle())
            if along.mean() < 0:  # its axis points from the apex into it
                axis = -axis
                given |= {"low": -float(along.max()), "high": -float(along.min())}
        case _:
            given |= {
                "radius": solid.MinorRadius() * MILLIMETRE,
                "wide": solid.MajorRadius() * MILLIMETRE,
            }
    return Face(kind, axis=axis, side=side, share=share, **given)


def _elementary(face: Any, tolerance: float) -> tuple[str, Any, bool] | None:
    """Return (kind, solid, True), or False for a spline that is one within a tolerance [mm]."""
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.gp import gp_Cone, gp_Cylinder, gp_Pln, gp_Sphere
    from OCP.ShapeAnalysis import ShapeAnalysis_CanonicalRecognition

    surface = BRepAdaptor_Surface(face, True)
    kind = str(surface.GetType()).rpartition("_")[2].lower()
    if kind in ("plane", "cylinder", "cone", "sphere", "torus"):
        return kind, getattr(surface, kind.capitalize())(), True
    looked = ShapeAnalysis_CanonicalRecognition(face)
    for kind, solid in (
        ("Plane", gp_Pln()), ("Cylinder", gp_Cylinder()), ("Cone", gp_Cone()),
        ("Sphere", gp_Sphere()),
    ):  # fmt: skip
        if getattr(looked, f"Is{kind}")(tolerance, solid):
            return kind.lower(), solid, False
    return None


def _blur(face: Any, chord: float) -> float:
    """Return the largest distance of the triangles of a plane from its edges [m]."""
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.GeomAbs import GeomAbs_CurveType

    found = 0.0
    for edge in _each(face, "EDGE"):
        curve = BRepAdaptor_Curve(edge)
        if curve.GetType() == GeomAbs_CurveType.GeomAbs_Circle:
            sag = curve.Circle().Radius() * MILLIMETRE * (1 - math.cos(math.pi / SIDES))
            found = max(found, min(sag, chord))
        elif curve.GetType() != GeomAbs_CurveType.GeomAbs_Line:
            found = chord
    return found


def _each(shape: Any, kind: str) -> Iterator[Any]:
    """Yield the solids, faces or edges of a shape."""
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    found = TopExp_Explorer(shape, getattr(TopAbs_ShapeEnum, f"TopAbs_{kind}"))
    as_kind = getattr(TopoDS, kind.capitalize())
    while found.More():
        yield as_kind(found.Current())
        found.Next()


def _matrix(transform: Any) -> tuple[Array, Array]:
    """Return (matrix (3, 3), translation (3,) [mm]) of a transformation."""
    rows = np.array([[transform.Value(i, j) for j in (1, 2, 3, 4)] for i in (1, 2, 3)])
    return rows[:, :3], rows[:, 3]


class _Assembly:
    """The parts of a document of Open CASCADE, without the tree of assemblies."""

    def __init__(self, path: Path):
        self.path = path
        self.parts, self.notes = list[Part](), list[tuple[Kind, str, str]]()
        self.unit = ""
        self._known = dict[Any, _Solids]()
        self._names = dict[str, int]()
        self._tools(path)
        from OCP.TopLoc import TopLoc_Location

        roots = [label for label in self._children(self.shapes.Label()) if self._is_root(label)]
        leaves = [x for root in roots for x in self._leaves(root, root, TopLoc_Location(), ())]
        if len(leaves) > MOST_PARTS:
            text = f"has {len(leaves)} parts; {MOST_PARTS} at most: export a part of the assembly"
            raise FileError(Problem(path.name, "", text))
        solid = [leaf for leaf in self._parted(leaves) if self._is_solid(leaf)]
        counts = Counter(name for _, name, _, _, _ in solid)
        for shape, name, within, place, label in solid:
            self._add(shape, name, self._unused(name, counts), "/".join(within), place, label)

    def _is_solid(self, leaf: Any) -> bool:
        """Check whether a part has a solid, and note its name otherwise."""
        shape, name = leaf[:2]
        if next(_each(shape, "SOLID"), None) is not None:
            return True
        text = "has surfaces and no solid: it has no mass, and is no body"
        self.notes.append(("left out", name, text))
        return False

    def _tools(self, path: Path) -> None:
        """Read the document and the tools that its names, colours and materials are asked of."""
        from OCP.collections import Sequence_TCollection_AsciiString as Texts
        from OCP.IFSelect import IFSelect_ReturnStatus
        from OCP.Message import Message
        from OCP.STEPCAFControl import STEPCAFControl_Reader
        from OCP.TCollection import TCollection_ExtendedString
        from OCP.TDocStd import TDocStd_Document
        from OCP.XCAFDoc import XCAFDoc_DocumentTool

        Message.DefaultMessenger_s().ChangePrinters().Clear()
        reader = STEPCAFControl_Reader()
        for mode in (reader.SetNameMode, reader.SetColorMode, reader.SetMatMode):
            mode(True)
        self.document = TDocStd_Document(TCollection_ExtendedString("pgraph"))
        done = reader.ReadFile(str(path)) == IFSelect_ReturnStatus.IFSelect_RetDone
        if not (done and reader.Transfer(self.document)):
            text = "is damaged or holds no shape; export it again from your CAD system"
            raise FileError(Problem(path.name, "", text))
        self._name_damage(reader.ChangeReader().WS().Model())
        units = [Texts() for _ in range(3)]
        reader.ChangeReader().FileUnits(*units)
        self.unit = next((x.ToCString().lower() for x in units[0]), "")
        main = self.document.Main()
        self.shapes = XCAFDoc_DocumentTool.ShapeTool_s(main)
        self.colours = XCAFDoc_DocumentTool.ColorTool_s(main)

    def _name_damage(self, entries: Any) -> None:
        """Note errors of syntax and missing entries: the library omits parts that have them."""
        check = entries.GlobalCheck(True)
        if count := check.NbFails():
            text = f"{count} errors in the text of the file, and parts may be missing; the first: "
            self.notes.append(("left out", "", f"{text}{check.CFail(1)}; export it again"))

    # -- the tree ----------------------------------------------------------------------------------

    def _children(self, label: Any) -> Iterator[Any]:
        from OCP.TDF import TDF_ChildIterator

        found = TDF_ChildIterator(label, False)
        while found.More():
            yield found.Value()
            found.Next()

    def _is_root(self, label: Any) -> bool:
        return self.shapes.IsShape_s(label) and self.shapes.IsFree_s(label)

    def _leaves(
        self, label: Any, shown: Any, place: Any, within: tuple[str, ...]
    ) -> Iterator[tuple[Any, str, tuple[str, ...], Any, tuple[Any, Any]]]:
        """Yield (shape, name, names around it, place, labels) of the parts below a label."""
        from OCP.TDF import TDF_Label

        given = (_name(shown), _name(label), *reversed(within), "part")
        name = next(x for x in given if x and not AUTOMATIC.match(x))
        if not self.shapes.IsAssembly_s(label):
            yield self.shapes.GetShape_s(label), name, within, place, (shown, label)
            return
        inside = (*within, name)
        for component in self._children(label):
            if not self.shapes.IsComponent_s(component):
                continue
            target = TDF_Label()
            self.shapes.GetReferredShape_s(component, target)
            there = place.Multiplied(self.shapes.GetLocation_s(component))
            yield from self._leaves(target, component, there, inside)

    def _parted(self, leaves: list[Any]) -> list[Any]:
        """Return the solids of a file that has one part, where they are the parts."""
        if len(leaves) != 1:
            return leaves
        shape, name, within, place, labels = leaves[0]
        solids = [*_each(shape, "SOLID")]
        if len(solids) < 2:
            return leaves
        text = f"'{name}' is one part of {len(solids)} solids; each of them is a part here"
        self.notes.append(("converted", "", text))
        return [(solid, name, within, place, labels) for solid in solids]

    def _unused(self, name: str, counts: Mapping[str, int]) -> str:
        """Return a name with its number, if several parts have it."""
        name = " ".join("".join(x if x.isprintable() else " " for x in name).split()) or "part"
        if counts.get(name, 0) < 2 and name not in self._names and name not in ("ground", "*"):
            self._names[name] = 1
            return name
        while True:
            self._names[name] = self._names.get(name, 0) + 1
            numbered = f"{name} {self._names[name]}"
            if numbered not in self._names and numbered not in counts:
                self._names[numbered] = 1
                return numbered

    # -- parts -------------------------------------------------------------------------------------

    def _add(
        self, shape: Any, product: str, name: str, within: str, place: Any, labels: Any
    ) -> None:
        solids, turn, at = self._solids(shape, name, place)
        faces = tuple(_moved(face, turn, at) for face in solids.faces)
        self.parts.append(
            Part(
                name, product, within, solids.volume, turn @ solids.com + at,
                turn @ solids.inertia @ turn.T, at, turn, solids.file, solids.chord,
                _moved_box(solids.box, turn, at), self._colour(labels, shape),
                self._density(*labels), faces,
            )
        )  # fmt: skip

    def _solids(self, shape: Any, name: str, place: Any) -> tuple[_Solids, Array, Array]:
        """Return (geometry, rotation, translation [m]). One that mirrors or scales is in the
        first."""
        from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
        from OCP.TopLoc import TopLoc_Location

        transform = place.Multiplied(shape.Location()).Transformation()
        bare = shape.Located(TopLoc_Location())
        turn, at = _matrix(transform)
        rigid = abs(np.linalg.det(turn) - 1) < COINCIDENT
        key = (hash(bare), shape.Orientation(), () if rigid else tuple(turn.ravel()))
        if not rigid:
            self.notes.append(("converted", name, "is mirrored or scaled: it has its own mesh"))
            bare = BRepBuilderAPI_Transform(bare, transform, True).Shape()
            turn, at, key = np.eye(3), np.zeros(3), (*key, tuple(at))
        if key not in self._known:
            self._known[key] = made = _Solids(bare, name)
            count = len(made.surfaces) + made.bare
            if made.bare:
                text = f"{made.bare} of its {count} faces cannot be meshed: it is drawn with holes"
                self.notes.append(("approximated", name, text))
        return self._known[key], turn, at * MILLIMETRE

    def _colour(self, labels: Any, shape: Any) -> tuple[float, float, float] | None:
        """Return the colour of an instance, of its part, of a solid or of the first face."""
        from OCP.Quantity import Quantity_Color, Quantity_TypeOfColor
        from OCP.XCAFDoc import XCAFDoc_ColorType

        first = (next(_each(shape, kind), shape) for kind in ("SOLID", "FACE"))
        asked = [(self.colours.GetColor_s, label) for label in labels]
        asked += [(self.colours.GetColor, one) for one in (shape, *first)]
        found = Quantity_Color()
        for colour_of, one in asked:
            for kind in ("XCAFDoc_ColorSurf", "XCAFDoc_ColorGen"):
                if colour_of(one, getattr(XCAFDoc_ColorType, kind), found):
                    rgb = found.Values(Quantity_TypeOfColor.Quantity_TOC_sRGB)
                    red, green, blue = (round(min(max(x, 0.0), 1.0), 6) for x in rgb)
                    return red, green, blue
        return None

    def _density(self, *labels: Any) -> float:
        """Return the density of the material [kg/m^3], or 0."""
        from OCP.XCAFDoc import XCAFDoc_MaterialTool

        given = max(XCAFDoc_MaterialTool.GetDensityForShape_s(x) for x in labels) / MILLIMETRE**3
        # Open CASCADE takes grams of a derived unit for kilograms; no solid has such a density
        return given if given <= DENSEST else given * MILLIMETRE


def carried(arm: Array) -> Array:
    """Return the inertia (3, 3) of a unit mass at the end of an arm."""
    return arm @ arm * np.eye(3) - np.outer(arm, arm)


def _name(label: Any) -> str:
    from OCP.TDataStd import TDataStd_Name

    found = TDataStd_Name()
    return found.Get().ToExtString() if label.FindAttribute(TDataStd_Name.GetID_s(), found) else ""


def _moved(face: Face, turn: Array, at: Array) -> Face:
    """Return a face of a part in the axes of the assembly."""
    triangles = face.triangles @ turn.T + at
    box = _moved_box(face.box, turn, at)
    point, axis = turn @ face.point + at, turn @ face.axis
    return replace(face, point=point, axis=axis, box=box, triangles=triangles)


def _moved_box(box: Array, turn: Array, at: Array) -> Array:
    """Return the box around a moved box."""
    corners = np.array(np.meshgrid(*box.T)).reshape(3, -1).T @ turn.T + at
    return np.array((corners.min(0), corners.max(0)))
