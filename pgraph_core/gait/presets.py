"""Gaits for a quadruped of some 33 kg with legs of half a metre: stand, crawl, trot, bound, gallop.

Their gains were found by `benchmarks/gait_search.py`.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..schema import Footfall, Gains, Gait

FEET = ("left_front_foot", "right_front_foot", "left_hind_foot", "right_hind_foot")


def gaits(feet: Sequence[str] = FEET) -> dict[str, Gait]:
    """The presets by name; `feet` are contacts: left and right in front, left and right behind."""
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
            speed=4.5, drift=0.126, sway=8.86, roll=(158, 48), pitch=(34.8, 39.4), place=-0.0275,
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
        feet=_falls(feet, (0.456, 0.456, 0.0, 0.0), (0.386, 0.386, 0.432, 0.432),
                    (-0.027, -0.027, 0.02, 0.02)),
        stride=0.325,
        speed=1.2,
        acceleration=1.0,
        height=0.466,
        clearance=0.069,
        landing=0.363,
        loading=0.1615,
        push=1.009,
        rise=1.0,
        nod=0.509,
        flexion=(0.0131, 0.0637),
        gains=Gains(
            speed=5.3, drift=0, height=(45.5, 6.75), roll=(100, 15), pitch=(25.3, 11.2),
            yaw=(40, 10), place=0.031, place_drift=0, place_roll=0, tight_torque=18.3,
            tight_force=3.17,
        ),
    )  # fmt: skip


def _gallop(feet: Sequence[str]) -> Gait:
    return Gait(
        name="gallop",
        description="hind feet one after the other, then front feet; the spine bends and stretches",
        feet=_falls(feet, (0.402, 0.5, 0.0, 0.08), (0.392, 0.392, 0.437, 0.437),
                    (-0.0485, -0.0485, 0.0728, 0.0728)),
        stride=0.3117,
        speed=1.4,
        acceleration=0.5,
        height=0.4614,
        width=0.0062,
        clearance=0.069,
        landing=0.372,
        loading=0.198,
        push=1.018,
        rise=1.0,
        nod=0.676,
        flexion=(0.0171, 0.0574),
        gains=Gains(
            speed=5.25, drift=2.31, height=(45, 5.95), roll=(134, 39.6), pitch=(4.42, 14.3),
            yaw=(40, 10), place=0.0595, place_drift=0.1115, place_roll=-0.0857,
            tight_torque=20.1, tight_force=2.12,
        ),
    )  # fmt: skip
