"""Gaits for a quadruped of some 33 kg with legs of half a metre: stand, crawl, trot, bound, gallop.

Their gains were found by `benchmarks/gait_search.py`.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..schema import Footfall, Gains, Gait

FEET = ("left_front_foot", "right_front_foot", "left_hind_foot", "right_hind_foot")


def gaits(feet: Sequence[str] = FEET) -> dict[str, Gait]:
    """The presets by name; `feet` are contacts: left and right in front, left and right behind."""
    return {gait.name: gait for gait in (make(feet) for make in (_stand, _trot, _bound))}


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


def _trot(feet: Sequence[str]) -> Gait:
    return Gait(
        name="trot",
        description="diagonal pairs in turn; sideways balance by where the feet land",
        feet=_falls(feet, (0.0, 0.5, 0.5, 0.0), (0.5,) * 4),
        stride=0.38,
        speed=0.6,
        height=0.5,
        width=0.0042,
        landing=0.22,
        loading=0.044,
        gains=Gains(
            speed=18.2, drift=6.5, sway=5.85, roll=(98, 50), pitch=(373, 37), place=0.0235,
            place_drift=0.162, place_roll=-0.083, tight_torque=21, tight_force=3,
        ),
    )  # fmt: skip


def _bound(feet: Sequence[str]) -> Gait:
    return Gait(
        name="bound",
        description="hind feet, then front feet; the spine bends and stretches with them",
        feet=_falls(feet, (0.467, 0.467, 0.0, 0.0), (0.378, 0.378, 0.425, 0.425),
                    (-0.028, -0.028, 0.005, 0.005)),
        stride=0.328,
        speed=1.2,
        acceleration=1.0,
        height=0.4645,
        clearance=0.069,
        landing=0.364,
        loading=0.154,
        push=1.018,
        rise=1.0,
        nod=0.547,
        flexion=(0.0167, 0.066),
        gains=Gains(
            speed=5.54, drift=0, height=(44.8, 6.6), roll=(100, 15), pitch=(28.7, 11.7), yaw=(40, 10),
            place=0.0375, place_drift=0, place_roll=0, tight_torque=15.3, tight_force=2.4,
        ),
    )  # fmt: skip
