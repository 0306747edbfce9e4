"""STEP files that tests write with Open CASCADE: solids [mm] by name, with place and colour."""

import math

from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder, BRepPrimAPI_MakeSphere
from OCP.gp import gp_Ax1, gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
from OCP.Interface import Interface_Static
from OCP.Message import Message
from OCP.Quantity import Quantity_Color, Quantity_TypeOfColor
from OCP.STEPCAFControl import STEPCAFControl_Writer
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDataStd import TDataStd_Name
from OCP.TDocStd import TDocStd_Document
from OCP.TopLoc import TopLoc_Location
from OCP.XCAFDoc import XCAFDoc_ColorType, XCAFDoc_DocumentTool


def box(size, at=(0, 0, 0)):
    """A box around a point."""
    corner = [x - s / 2 for x, s in zip(at, size)]
    return BRepPrimAPI_MakeBox(gp_Pnt(*corner), *map(float, size)).Shape()


def rod(radius, start, axis, length):
    return BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(*start), gp_Dir(*axis)), radius, length).Shape()


def ball(radius, at):
    return BRepPrimAPI_MakeSphere(gp_Pnt(*at), radius).Shape()


def fused(first, *others):
    for other in others:
        first = BRepAlgoAPI_Fuse(first, other).Shape()
    return first


def cut(first, *others):
    for other in others:
        first = BRepAlgoAPI_Cut(first, other).Shape()
    return first


def moved(at=(0, 0, 0), axis=(0, 0, 1), angle=0.0):
    """A turn about an axis through the origin [degrees], and then a translation."""
    turn, shift = gp_Trsf(), gp_Trsf()
    turn.SetRotation(gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(*axis)), math.radians(angle))
    shift.SetTranslation(gp_Vec(*at))
    return shift.Multiplied(turn)


def placed(shape, transform):
    return BRepBuilderAPI_Transform(shape, transform, True).Shape()


def link(length, thick, radius, height=0.0, bore=True, pin=True):
    """A flat link along x above z = 0, with a bore at its start and a pin up at its end."""
    solid = box((length, 4 * radius, thick), (length / 2, 0, thick / 2))
    for x in (0, length):
        solid = fused(solid, rod(2 * radius, (x, 0, 0), (0, 0, 1), thick))
    if bore:
        solid = cut(solid, rod(radius, (0, 0, -1), (0, 0, 1), thick + 2))
    if pin:
        solid = fused(solid, rod(radius, (length, 0, thick), (0, 0, 1), height or thick))
    return solid


def write(path, parts, *, unit="MM", whole=None, name="assembly"):
    """Write {name: solid, or (solid, transform), or with a colour} as an assembly.

    Instances of one solid share it in the file. `whole` moves the whole assembly.
    """
    Message.DefaultMessenger_s().ChangePrinters().Clear()
    STEPCAFControl_Writer()  # makes the settings
    Interface_Static.SetCVal_s("write.step.unit", unit)
    document = TDocStd_Document(TCollection_ExtendedString("test"))
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    colours = XCAFDoc_DocumentTool.ColorTool_s(document.Main())
    top, known = shapes.NewShape(), {}
    TDataStd_Name.Set_s(top, TCollection_ExtendedString(name))
    for part, given in parts.items():
        solid, transform, colour = (*(given if isinstance(given, tuple) else (given,)), None, None)[
            :3
        ]
        if id(solid) not in known:
            known[id(solid)] = shapes.AddShape(solid, False)
            TDataStd_Name.Set_s(known[id(solid)], TCollection_ExtendedString(part))
            if colour:
                rgb = Quantity_Color(*colour, Quantity_TypeOfColor.Quantity_TOC_sRGB)
                kind = XCAFDoc_ColorType.XCAFDoc_ColorSurf
                colours.SetColor(known[id(solid)], rgb, kind)
        transform = (whole or gp_Trsf()).Multiplied(transform or gp_Trsf())
        label = shapes.AddComponent(top, known[id(solid)], TopLoc_Location(transform))
        TDataStd_Name.Set_s(label, TCollection_ExtendedString(part))
    shapes.UpdateAssemblies()
    writer = STEPCAFControl_Writer()
    writer.Transfer(document)
    writer.Write(str(path))
    Interface_Static.SetCVal_s("write.step.unit", "MM")
    return path


# -- mechanisms, with the joints that they have ----------------------------------------------------

UP = (0, 0, 1)


def _angle(v):
    return math.degrees(math.atan2(v[1], v[0]))


def four_bar():
    """Parts and {pair: (kind, point [m], axis)}. All is 10 mm thick, with pins of 10 mm."""
    th, r, crank, coupler, rocker, ground = 10, 5, 50.0, 170.0, 110.0, 150.0
    far = math.hypot(crank, ground)
    along = (coupler**2 - rocker**2 + far**2) / (2 * far)
    height = math.sqrt(coupler**2 - along**2)
    d = (ground / far, -crank / far)
    top = (along * d[0] - height * d[1], crank + along * d[1] + height * d[0])
    base = fused(
        box((200, 40, th), (75, 0, -th / 2)),
        rod(r, (0, 0, 0), UP, th),
        rod(2 * r, (ground, 0, 0), UP, 2 * th),
        rod(r, (ground, 0, 2 * th), UP, th),
    )
    last = cut(link(rocker, th, r, pin=False), rod(r, (rocker, 0, -1), UP, th + 2))
    parts = {
        "base": base,
        "crank": (link(crank, th, r), moved(axis=UP, angle=90), (0.2, 0.4, 0.6)),
        "coupler": (
            link(coupler, th, r),
            moved((0, crank, th), UP, _angle((top[0], top[1] - crank))),
        ),
        "rocker": (
            last,
            moved((ground, 0, 2 * th), UP, _angle((top[0] - ground, top[1]))),
        ),
    }
    pins = {
        ("base", "crank"): (0, 0), ("crank", "coupler"): (0, crank),
        ("coupler", "rocker"): top, ("base", "rocker"): (ground, 0),
    }  # fmt: skip
    joints = {pair: ("revolute", (x / 1e3, y / 1e3, 0), UP) for pair, (x, y) in pins.items()}
    return parts, joints, 1


def slider_crank():
    """A piston in a bore, whose pin turns in the rod."""
    th, r, crank, length = 10, 5, 40.0, 120.0
    reach = math.sqrt(length**2 - crank**2)
    bore = cut(box((80, 60, 60), (reach + 30, 0, 0)), rod(20, (reach - 50, 0, 0), (1, 0, 0), 200))
    frame = fused(
        bore, box((20, 60, 10), (0, 0, -35)), box((reach, 20, 10), (reach / 2, 0, -35)),
        rod(r, (0, 0, -30), UP, 30),
    )  # fmt: skip
    frame = cut(frame, box((4 * length, 200, 10), (0, 0, -25)))
    frame = fused(frame, rod(2 * r, (0, 0, -30), UP, 20), rod(r, (0, 0, -10), UP, 10))
    piston = cut(rod(20, (reach - 10, 0, 0), (1, 0, 0), 50), box((60, 60, th), (reach, 0, th / 2)))
    piston = fused(piston, rod(r, (reach, 0, -1), UP, th + 2))
    rod_ = cut(link(length, th, r, pin=False), rod(r, (length, 0, -1), UP, th + 2))
    parts = {
        "frame": frame,
        "crank": (link(crank, th, r), moved((0, 0, -th), UP, 90)),
        "rod": (rod_, moved((0, crank, 0), UP, _angle((reach, -crank)))),
        "piston": piston,
    }
    joints = {
        ("frame", "crank"): ("revolute", (0, 0, 0), UP),
        ("crank", "rod"): ("revolute", (0, crank / 1e3, 0), UP),
        ("rod", "piston"): ("revolute", (reach / 1e3, 0, 0), UP),
        ("frame", "piston"): ("cylindrical", (0, 0, 0), (1, 0, 0)),
    }
    return parts, joints, 1


def scissor_lift():
    """Two crossed arms between a base and a platform, each with a block in a slot."""
    w, h, r, th = 160.0, 120.0, 5, 10
    length = math.hypot(w, h)

    def arm(angle, at, first, last):
        solid = link(length, th, r, bore=first, pin=False)
        if last:
            solid = cut(solid, rod(r, (length, 0, -1), UP, th + 2))
        return solid, moved(at, UP, angle)

    up, back = math.degrees(math.atan2(h, w)), math.degrees(math.atan2(h, -w))
    one, place = arm(up, (0, 0, 0), True, True)
    one = fused(one, rod(r, (length / 2, 0, th), UP, th))
    other, back_place = arm(back, (w, 0, th), True, True)
    other = cut(other, rod(r, (length / 2, 0, -1), UP, th + 2))
    base = cut(box((260, 60, 20), (w / 2, 0, -10)), box((100, 20, 15), (w, 0, -7.5)))
    base = fused(base, rod(r, (0, 0, 0), UP, th))
    top = cut(box((260, 60, 20), (w / 2, h, 30)), box((100, 20, 15), (w, h, 27.5)))
    top = fused(top, rod(r, (0, h, 10), UP, th))
    block = fused(
        box((30, 20, 15), (0, 0, -7.5)), rod(2 * r, (0, 0, 0), UP, th), rod(r, (0, 0, th), UP, th)
    )
    parts = {
        "base": base, "arm": (one, place), "other arm": (other, back_place), "platform": top,
        "block": (block, moved((w, 0, 0))),
        "upper block": (block, moved((w, h, 20), (1, 0, 0), 180)),
    }  # fmt: skip
    pins = {
        ("base", "arm"): (0, 0), ("arm", "other arm"): (w / 2, h / 2),
        ("block", "other arm"): (w, 0), ("arm", "upper block"): (w, h),
        ("other arm", "platform"): (0, h),
    }  # fmt: skip
    joints = {pair: ("revolute", (x / 1e3, y / 1e3, 0), UP) for pair, (x, y) in pins.items()}
    for pair in (("base", "block"), ("platform", "upper block")):
        joints[pair] = ("prismatic", (0, 0, 0), (1, 0, 0))
    return parts, joints, 1


def gripper():
    """A slide between two rails that opens two fingers by links."""
    th, r = 10, 4
    start, end, pivot = (20.0, 15.0), (45.0, 55.0), (70.0, 40.0)
    base = fused(
        box((180, 130, 20), (15, 0, -10)),
        *(box((60, 10, th), (-30, side * 15, th / 2)) for side in (1, -1)),
        *(rod(2 * r, (pivot[0], side * pivot[1], 0), UP, 2 * th) for side in (1, -1)),
        *(rod(r, (pivot[0], side * pivot[1], 2 * th), UP, th) for side in (1, -1)),
    )
    slide = fused(box((90, 20, th), (-25, 0, th / 2)), box((16, 50, th), (start[0], 0, th / 2)))
    slide = fused(slide, *(rod(r, (start[0], s * start[1], th), UP, th) for s in (1, -1)))
    bar = link(math.dist(start, end), th, r)
    finger = link(math.dist(pivot, end), th, r, pin=False)
    finger = cut(finger, rod(r, (math.dist(pivot, end), 0, -1), UP, th + 2))
    parts, joints = {"base": base, "slide": slide}, {}
    joints["base", "slide"] = ("prismatic", (0, 0, 0), (1, 0, 0))
    for side, name in ((1, "left"), (-1, "right")):
        a, b, c = ((x, side * y) for x, y in (start, end, pivot))
        parts[f"{name} link"] = (bar, moved((*a, th), UP, _angle((b[0] - a[0], b[1] - a[1]))))
        parts[f"{name} finger"] = (
            finger, moved((*c, 2 * th), UP, _angle((b[0] - c[0], b[1] - c[1]))),
        )  # fmt: skip
        pins = {("slide", f"{name} link"): a, (f"{name} link", f"{name} finger"): b,
                ("base", f"{name} finger"): c}  # fmt: skip
        joints |= {pair: ("revolute", (x / 1e3, y / 1e3, 0), UP) for pair, (x, y) in pins.items()}
    return parts, joints, 1


def framed(x, y, z, at):
    """Return the transformation to these axes at a point."""
    found = gp_Trsf()
    found.SetValues(*(n for row in zip(x, y, z, at) for n in map(float, row)))
    return found


def stewart():
    """Six legs of a cross, a square tube, a square rod and a ball between base and platform."""
    up, parts, joints = 130.0, {"base": None, "platform": None}, {}
    base = rod(120, (0, 0, -32), UP, 20)
    top = rod(90, (0, 0, up + 8), UP, 10)
    cross = fused(
        box((10, 10, 10)), rod(3, (-9, 0, 0), (1, 0, 0), 18), rod(3, (0, -9, 0), (0, 1, 0), 18)
    )
    lower = upper = None
    for k in range(6):
        turn, way = 120 * (k // 2), 1 if k % 2 else -1
        a, b = (math.radians(turn + way * x) for x in (15, 45))
        at = (100 * math.cos(a), 100 * math.sin(a), 0.0)
        ball_at = (70 * math.cos(b), 70 * math.sin(b), up)
        length = math.dist(at, ball_at)
        d = [(q - p) / length for p, q in zip(at, ball_at)]
        u = [-d[1], d[0], 0.0]
        u = [x / math.hypot(*u) for x in u]
        v = [d[1] * u[2] - d[2] * u[1], d[2] * u[0] - d[0] * u[2], d[0] * u[1] - d[1] * u[0]]
        here = framed(u, v, d, at)
        fork = fused(
            box((18, 9, 20), (0, 0, -24)),
            *(
                cut(box((4, 9, 26), (s * 7, 0, -8.5)), rod(3, (-20, 0, 0), (1, 0, 0), 40))
                for s in (1, -1)
            ),
        )
        base = fused(base, placed(fork, here))
        if lower is None:
            lower = cut(
                fused(
                    box((16, 18, 66), (0, 0, 48)),
                    *(box((9, 4, 24.5), (0, s * 7, 7.75)) for s in (1, -1)),
                ),
                rod(3, (0, -20, 0), (0, 1, 0), 40), box((10, 10, 60), (0, 0, 60)),
            )  # fmt: skip
            upper = fused(
                box((10, 10, 70), (0, 0, 75)), rod(3, (0, 0, 105), UP, length - 105),
                ball(6, (0, 0, length)),
            )  # fmt: skip
        holder = cut(
            box((20, 20, 20), ball_at), ball(6, ball_at),
            placed(rod(4, (0, 0, -30), UP, 30), framed(u, v, d, ball_at)),
        )  # fmt: skip
        top = cut(fused(top, holder), ball(6, ball_at))
        names = [f"{part} {k}" for part in ("cross", "lower", "upper")]
        parts |= dict(zip(names, ((cross, here), (lower, here), (upper, here))))
        place, end = ([x / 1e3 for x in point] for point in (at, ball_at))
        joints |= {
            ("base", names[0]): ("revolute", place, u),
            (names[0], names[1]): ("revolute", place, v),
            (names[1], names[2]): ("prismatic", place, d),
            (names[2], "platform"): ("spherical", end, d),
        }  # fmt: skip
    parts |= {"base": base, "platform": top}
    return parts, joints, 6
