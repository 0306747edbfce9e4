"""The muscle of Millard et al. (2013), J Biomech Eng 135, 021005, with a damped fibre."""

from __future__ import annotations

from collections.abc import Mapping

from .model import Curves, MuscleModel, Smooth, bezier
from .thelen2003 import activation


def curves(shape: Mapping[str, float]) -> Curves:
    """Return the curves, in the form of the appendix."""
    return Curves(_active(shape), _passive(shape), _velocity(shape), _tendon(shape))


def _active(shape: Mapping[str, float]) -> Smooth:
    x0, x1, x3 = shape["shortest"], shape["transition"], shape["longest"]
    slope, low = shape["plateau_slope"], shape["least_active"]
    shoulder = shape["shoulder"]
    x2 = 1.0 - shoulder
    y1 = 1.0 - slope * (x2 - x1)
    down = 1.0 + shoulder
    corners = [
        (x0, low, 0.0),
        (0.5 * (x0 + x1), 0.5 * y1, 1.25 * y1 / (x1 - x0)),
        (0.5 * (x1 + x2), 0.5 * (1.0 + y1), slope),
        (1.0, 1.0, 0.0),
        (0.5 * (down + x3), 0.5, -1.0 / (x3 - shoulder - down)),
        (x3, low, 0.0),
    ]
    return bezier(corners, [1.0] * 5)


def _passive(shape: Mapping[str, float]) -> Smooth:
    zero, strain = shape["passive_zero"], shape["passive_strain"]
    stiffness = shape["passive_stiffness"] / (strain - zero)
    low, reach = shape["passive_low"], min(0.1 / stiffness, 0.1 * (strain - zero))
    corners = [
        (1.0 + zero, 0.0, 0.0),
        (1.0 + zero + reach, 0.5 * low * reach, low),
        (1.0 + strain, 1.0, stiffness),
    ]
    return bezier(corners, [shape["passive_curviness"]] * 2)


def _velocity(shape: Mapping[str, float]) -> Smooth:
    most, near = shape["lengthening"], 0.9
    shorten, lengthen = shape["shortening_slope"], shape["lengthening_slope"]
    corners = [
        (-1.0, 0.0, 0.0),
        (-near, 0.5 * shorten * (1.0 - near), shorten),
        (0.0, 1.0, shape["isometric_slope"]),
        (near, most - 0.5 * lengthen * (1.0 - near), lengthen),
        (1.0, most, 0.0),
    ]
    left, right = shape["shortening_curviness"], shape["lengthening_curviness"]
    return bezier(corners, [left, left, right, right])


def _tendon(shape: Mapping[str, float]) -> Smooth:
    strain = shape["tendon_strain"]
    stiffness, toe = shape["tendon_stiffness"] / strain, shape["toe_force"]
    end = 1.0 + strain + (toe - 1.0) / stiffness
    middle = 1.0 + strain + (0.5 * toe - 1.0) / stiffness
    foot = 1.0 + 0.1 * (end - 1.0)
    slope = 0.5 * toe / (middle - foot)
    between = 0.5 * (foot + middle)
    corners = [(1.0, 0.0, 0.0), (between, slope * (between - foot), slope), (end, toe, stiffness)]
    return bezier(corners, [shape["tendon_curviness"]] * 2)


MODEL = MuscleModel(
    about="Millard 2012: fitted curves and a damped fibre, as in OpenSim",
    shape={
        "shortest": 0.4441, "transition": 0.73, "longest": 1.8123, "plateau_slope": 0.8616,
        "shoulder": 0.05, "least_active": 0.0, "passive_zero": 0.0,
        "passive_strain": 0.7, "passive_stiffness": 2.0,
        "passive_low": 0.2, "passive_curviness": 0.75, "lengthening": 1.4,
        "shortening_slope": 0.25, "isometric_slope": 5.0, "lengthening_slope": 0.15,
        "shortening_curviness": 0.6, "lengthening_curviness": 0.9,
        "tendon_strain": 0.049, "tendon_stiffness": 1.375, "toe_force": 2.0 / 3.0,
        "tendon_curviness": 0.5,
    },
    curves=curves,
    activation=activation,
    rise=0.01,
    fall=0.04,
    fastest=10.0,
    damping=0.1,
)  # fmt: skip
