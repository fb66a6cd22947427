import numpy as np
import pytest

from geomotion.robot.soft_object import Cushion


@pytest.mark.parametrize("cushion", [Cushion(), Cushion((0.03, 0.03, 0.03), roundness=2.0)])
def test_vertices_lie_on_the_superellipsoid(cushion):
    vertices, _, _ = cushion.surface()
    level = (np.abs(vertices / cushion.half_axes_m) ** cushion.roundness).sum(axis=1)
    np.testing.assert_allclose(level, 1.0, atol=1e-9)


def test_faces_look_outwards():
    vertices, faces, _ = Cushion().surface()
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("fi,fi->f", normals, corners.mean(axis=1)) >= -1e-15).all()
