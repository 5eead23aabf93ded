"""What is known of a model of arm, from a package or from a spec."""

from __future__ import annotations

from dataclasses import dataclass

from drillc.kernels.arm import ArmGeometry, Floats

JOINT_NAMES = ("A1", "A2", "A3", "A4", "A5", "A6")


@dataclass(frozen=True, eq=False)
class ArmModel:
    """A six-axis arm: its dimensions, its joints' limits and full speeds, and where they are from.

    `maker` is "kuka", "abb" or "other": whose configuration bits its programs carry.
    """

    name: str
    title: str
    maker: str
    geometry: ArmGeometry
    low_rad: Floats  # (6,)
    high_rad: Floats  # (6,)
    speed_rad_s: Floats  # (6,)
    source: str
