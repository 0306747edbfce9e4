"""Gait presets (stand, crawl, trot, bound, gallop) for a quadruped of about 33 kg with half-metre
legs.

Their gains were found by a search over short walks (cross entropy).
"""

from __future__ import annotations

from collections.abc import Sequence

from ..errors import explained, refusal, shown
from ..model import Footfall, Gains, Gait

FEET = ("left_front_foot", "right_front_foot", "left_hind_foot", "right_hind_foot")


@explained
def gaits(feet: Sequence[str] = FEET) -> dict[str, Gait]:
    """Return the built-in gaits by name.

    Parameters
    ----------
    feet : sequence of str, optional
        Names of the contacts of the left front, right front, left hind and right hind foot.

    Raises
    ------
    InputError
        If there are not four names.
    """
    if isinstance(feet, str) or len(feet) != 4:
        raise refusal("gaits", "feet", f"must be the names of four contacts; given {shown(feet)}")
    return {
        gait.name: gait
        for gait in (make(feet) for make in (_stand, _crawl, _trot, _bound, _gallop))
    }


def _falls(
    feet: Sequence[str],
    offsets: tuple[float, ...],
    duties: tuple[float, ...],
    ahead: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0),
) -> tuple[Footfall, ...]:
    return tuple(
        Footfall(foot=foot, offset=offset, duty=duty, ahead=far)
        for foot, offset, duty, far in zip(feet, offsets, duties, ahead)
    )


def _stand(feet: Sequence[str]) -> Gait:
    return Gait(
        name="stand",
        description="all feet on the ground",
        feet=_falls(feet, (0.0,) * 4, (1.0,) * 4),
        speed=0.0,
        height=0.5,
        gains=Gains(sway=40.0, surge=40.0),
    )


def _crawl(feet: Sequence[str]) -> Gait:
    return Gait(
        name="crawl",
        description="one foot after the other, three on the ground; the body sways over them",
        feet=_falls(feet, (0.25, 0.75, 0.0, 0.5), (0.785,) * 4),
        stride=0.8,
        speed=0.25,
        height=0.5,
        width=0.0094,
        landing=0.068,
        loading=0.0915,
        sway=(0.0128, -0.0024),
        least=12.7,
        gains=Gains(
            speed=4.5, drift=12.0, sway=8.86, roll=(158, 48), pitch=(34.8, 39.4), place=-0.0275,
            place_drift=0.0486, place_roll=-0.148, tight_torque=10.3, tight_force=1.58,
        ),
    )  # fmt: skip


def _trot(feet: Sequence[str]) -> Gait:
    return Gait(
        name="trot",
        description="diagonal pairs in turn; sideways balance by where the feet land",
        feet=_falls(feet, (0.0, 0.5, 0.5, 0.0), (0.5,) * 4),
        stride=0.38,
        speed=0.6,
        height=0.5,
        width=0.0024,
        landing=0.3085,
        loading=0.14,
        least=8.4,
        gains=Gains(
            speed=34.6, drift=13.2, sway=15.3, roll=(142, 42), pitch=(311, 24.8), place=-0.0362,
            place_drift=0.118, place_roll=-0.0542, tight_torque=22.9, tight_force=6.79,
        ),
    )  # fmt: skip


def _bound(feet: Sequence[str]) -> Gait:
    return Gait(
        name="bound",
        description="hind feet, then front feet; the spine bends and stretches with them",
        feet=_falls(feet, (0.4196, 0.4196, 0.0, 0.0), (0.4453, 0.4453, 0.4296, 0.4296),
                    (-0.0212, -0.0212, 0.0229, 0.0229)),
        stride=0.31,
        speed=1.2,
        acceleration=1.0,
        height=0.4786,
        clearance=0.069,
        landing=0.2575,
        loading=0.1392,
        push=0.9626,
        rise=1.0,
        nod=0.5906,
        flexion=(-0.0107, 0.0815),
        gains=Gains(
            speed=5.685, drift=0, height=(118, 5.98), roll=(100, 15), pitch=(48, 11.86),
            yaw=(40, 10), place=0.0376, place_drift=0, place_roll=0, tight_torque=10.35,
            tight_force=3.69,
        ),
    )  # fmt: skip


def _gallop(feet: Sequence[str]) -> Gait:
    return Gait(
        name="gallop",
        description="hind feet one after the other, then front feet; the spine bends and stretches",
        feet=_falls(feet, (0.3185, 0.4299, 0.0, 0.0891), (0.4348, 0.4348, 0.4173, 0.4173),
                    (-0.0523, -0.0523, 0.0796, 0.0796)),
        stride=0.307,
        speed=1.4,
        acceleration=0.5,
        height=0.4589,
        width=0.0195,
        clearance=0.069,
        landing=0.456,
        loading=0.205,
        push=1.054,
        rise=1.0,
        nod=1.1,
        flexion=(-0.0036, 0.0791),
        gains=Gains(
            speed=5.11, drift=0.743, height=(47.3, 4.09), roll=(189, 37.8), pitch=(1.77, 16.9),
            yaw=(40, 10), place=0.0712, place_drift=0.0713, place_roll=-0.0752,
            tight_torque=23.1, tight_force=1.62,
        ),
    )  # fmt: skip
