"""Decoded grids."""

import numpy as np
import pytest

from geomotion.planning import manifold as module
from geomotion.planning.manifold import Surface
from geomotion.scores.pose_support import PoseSupport


@pytest.fixture
def surface(planner) -> Surface:
    return planner(points_per_axis=21).surface


def test_every_node_has_what_the_manifold_says_there(planner, surface):
    strip, nodes = planner().manifold, surface.grid.nodes
    np.testing.assert_array_equal(surface.decoded.states.position_m, strip.decode(nodes).states.position_m)
    np.testing.assert_array_equal(surface.decoded.progress, nodes[:, 0])
    for found, expected in zip((surface.position, surface.rest), strip.embed(nodes), strict=True):
        np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(surface.stretch, strip.stretch(nodes))


def test_a_grid_decoded_in_parts_is_the_grid_decoded_at_once(planner, surface, monkeypatch):
    monkeypatch.setattr(module, "NODES_AT_ONCE", 100)
    again = Surface.of(planner().manifold, surface.grid, PoseSupport.of([surface.decoded.states[:50]]))
    whole = planner().manifold.decode(surface.grid.nodes).states
    whole_m, whole_rad = PoseSupport.of([surface.decoded.states[:50]]).distances(whole)
    np.testing.assert_array_equal(again.decoded.states.orientation, surface.decoded.states.orientation)
    np.testing.assert_array_equal(again.rest, surface.rest)
    np.testing.assert_array_equal(again.apart_m, whole_m)
    np.testing.assert_array_equal(again.apart_rad, whole_rad)


def test_the_cap_is_on_both_distances(surface):
    assert surface.within(np.inf, np.inf).all()
    near, turned = surface.within(0.02, np.inf), surface.within(np.inf, 0.05)
    np.testing.assert_array_equal(near, surface.apart_m <= 0.02)
    np.testing.assert_array_equal(surface.within(0.02, 0.05), near & turned)
    assert near.any() and not near.all()


def test_outside_of_the_demonstrations_nodes_are_away_from_them(surface):
    across = np.abs(surface.grid.nodes[:, 1])
    along = surface.grid.nodes[:, 0]
    middle = (along > 0) & (along < 1)
    outside = middle & (across > 0.1)
    np.testing.assert_allclose(surface.apart_m[outside], across[outside] - 0.1, atol=5e-3)
    assert surface.apart_m[middle & (across < 0.1)].max() < 0.03
