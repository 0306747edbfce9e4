"""Mass properties of heightfields against integrals over their columns."""

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.model.shape import mass_properties


@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.3, 0.0), (0.2, -0.4)])
def test_a_heightfield_with_a_plane_top_has_the_inertia_of_its_columns(slope):
    """Gauss-Legendre quadrature over the base is exact for a plane top."""
    size, density = (2.0, 1.2, 0.4), 700.0
    x, y = np.linspace(-1.0, 1.0, 5), np.linspace(-0.6, 0.6, 4)
    heights = 0.1 + slope[0] * x[:, None] + slope[1] * y[None, :]
    found = mass_properties(pg.Shape(kind="heightfield", size=size, heights=heights), density)

    nodes, weights = np.polynomial.legendre.leggauss(6)
    x, y = (grid.ravel() for grid in np.meshgrid(nodes, 0.6 * nodes, indexing="ij"))
    weight = 0.6 * density * np.outer(weights, weights).ravel()
    top, floor = 0.1 + slope[0] * x + slope[1] * y, heights.min() - 0.4
    column = weight * (top - floor)
    mass = column.sum()
    middle = (top + floor) / 2
    com = np.array((column @ x, column @ y, column @ middle)) / mass
    points = np.stack((x, y, middle)) - com[:, None]
    second = points * column @ points.T
    second[2, 2] += column @ (top - floor) ** 2 / 12
    assert found.mass == pytest.approx(mass, rel=1e-12)
    np.testing.assert_allclose(found.com, com, atol=1e-12)
    np.testing.assert_allclose(
        found.inertia, np.trace(second) * np.eye(3) - second, rtol=1e-10, atol=1e-9
    )
