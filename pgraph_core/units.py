"""Physical dimensions of fields, with their display units and conversion factors."""

from __future__ import annotations

from typing import NamedTuple


class Dim(NamedTuple):
    """Exponents of length, mass, time, angle, and of a coordinate, which is a length or an angle.

    A sum of coordinates is a length if all its terms are.
    """

    length: float = 0
    mass: float = 0
    time: float = 0
    angle: float = 0
    coordinate: float = 0

    def __mul__(self, other: object) -> Dim:
        if not isinstance(other, Dim):
            return NotImplemented
        return Dim(*(a + b for a, b in zip(self, other)))

    def __truediv__(self, other: Dim) -> Dim:
        return Dim(*(a - b for a, b in zip(self, other)))

    def __pow__(self, n: float) -> Dim:
        return Dim(*(n * a for a in self))

    def factor(self, length: float, mass: float, time: float, coordinate: float = 1.0) -> float:
        """Return the conversion factor for this dimension, given the factors for the base units."""
        of_base = length**self.length * mass**self.mass * time**self.time
        return of_base * coordinate**self.coordinate


NONE = Dim()
M, KG, S, RAD, Q = (Dim(*(float(i == k) for i in range(5))) for k in range(5))
N = KG * M / S**2
J = N * M
PA = N / M**2

UNITS = {  # "length" and "angle" follow the page's units
    NONE: "", NONE / S: "1/s", M: "length", RAD: "angle", KG: "kg", S: "s", M / S: "m/s",
    M / S**2: "m/s²", KG * M**2: "kg m²", PA: "Pa",
    N * M**2: "N m²", KG / M: "kg/m", KG * M: "kg m", KG / M**3: "kg/m³", PA * S: "Pa s",
    N: "N", N / M: "N/m", N * S / M: "N s/m", N / M**1.5: "N/m^1.5", S / M: "s/m",
    RAD / S: "rad/s", J: "N m", J / RAD: "N m/rad", J * S / RAD: "N m s/rad",
    Q: "rad, m", Q / S: "rad/s, m/s",
    J * S**2 / Q**2: "kg m², kg", J / Q: "N m, N",
    J / Q**2: "N m/rad, N/m", J * S / Q**2: "N m s/rad, N s/m",
}  # fmt: skip
