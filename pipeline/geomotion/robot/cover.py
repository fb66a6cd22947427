"""Balls that together contain a convex body: few, and none reaching far beyond it.

Out of random balls around points inside, each as large as it may be, the fewest are chosen that contain samples of the
surface: a small integer programme. That they contain all of it is then not left to samples: the body is cut into the
balls' power cells, which are convex, and each ball made just so large that it contains the corners of its own cell.
"""

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, linprog, milp
from scipy.spatial import ConvexHull, HalfspaceIntersection

from geomotion.types import Float

CANDIDATES, SAMPLES = 600, 500
SHALLOWEST = 0.2  # candidates are at least that share of the largest depth inside
SLACK_M = 0.001  # by which chosen balls contain the samples, for the surface between them
MOST_NODES = 20  # of the search tree of the integer programme
LEAST_CELL_M = 1e-7  # inner radius below which a cell is left to its neighbours
ROUNDING_M = 1e-6

Corners = Float[np.ndarray, "corner 3"]
Centres = Float[np.ndarray, "ball 3"]
Radii = Float[np.ndarray, " ball"]
HalfSpaces = Float[np.ndarray, "face 4"]  # of points with normal · x + offset ≤ 0


def cover_hull(corners_m: Corners, excess_m: float) -> tuple[Centres, Radii]:
    """Centres and radii of balls whose union contains the convex hull of some points [m].

    Args:
        corners_m: Not all in one plane [m].
        excess_m: How far the balls should reach beyond the hull's faces at most [m]; where samples miss an edge, some
            reach up to about a third farther.
    """
    hull = ConvexHull(corners_m)
    faces = np.unique(hull.equations.round(12), axis=0)
    centres, radii = _fewest(_inside(hull, faces), faces, _surface(hull), excess_m)
    cells = [_power_cell(ball, centres, radii, faces) for ball in range(len(centres))]
    needed = [ball for ball, cell in enumerate(cells) if len(cell)]
    farthest = [np.linalg.norm(cells[ball] - centres[ball], axis=1).max() for ball in needed]
    return centres[needed], np.array(farthest) + ROUNDING_M


def _inside(hull: ConvexHull, faces: HalfSpaces) -> Float[np.ndarray, "candidate 3"]:
    """Random points that are not close to the surface, out of the box along the body's principal axes."""
    random = np.random.default_rng(0)
    middle = hull.points.mean(axis=0)
    axes = np.linalg.svd(hull.points - middle, full_matrices=False)[2]
    along = (hull.points - middle) @ axes.T
    found = middle + random.uniform(along.min(axis=0), along.max(axis=0), (20 * CANDIDATES, 3)) @ axes
    depth = _depth(found, faces)
    inside: Float[np.ndarray, "candidate 3"] = found[depth > SHALLOWEST * depth.max()][:CANDIDATES]
    return inside


def _surface(hull: ConvexHull) -> Float[np.ndarray, "sample 3"]:
    """Its corners, and random points of its triangles and of their edges, in proportion to the triangles' areas."""
    random = np.random.default_rng(1)
    triangles = hull.points[hull.simplices]
    sides = triangles[:, 1:] - triangles[:, :1]
    areas = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    chosen = triangles[random.choice(len(areas), SAMPLES, p=areas / areas.sum())]
    weights = random.dirichlet(np.ones(3), SAMPLES)
    weights[np.arange(0, SAMPLES, 2), random.integers(3, size=len(weights[::2]))] = 0
    weights /= weights.sum(axis=1, keepdims=True)
    return np.concatenate([hull.points[hull.vertices], (weights[:, :, None] * chosen).sum(axis=1)])


def _fewest(
    candidates: Float[np.ndarray, "candidate 3"],
    faces: HalfSpaces,
    samples: Float[np.ndarray, "sample 3"],
    excess_m: float,
) -> tuple[Centres, Radii]:
    """The smallest choice of balls that contain all samples that any of them contains."""
    radii = _depth(candidates, faces) + excess_m
    contains = np.linalg.norm(samples[:, None] - candidates, axis=2) < radii - SLACK_M
    rows = contains[contains.any(axis=1)].astype(float)
    solution = milp(
        np.ones(len(candidates)),
        integrality=np.ones(len(candidates)),
        bounds=Bounds(0, 1),
        constraints=LinearConstraint(rows, lb=1.0),
        options={"node_limit": MOST_NODES},
    )
    chosen = solution.x > 0.5
    return candidates[chosen], radii[chosen]


def _power_cell(ball: int, centres: Centres, radii: Radii, faces: HalfSpaces) -> Corners:
    """Corners of that part of the body of which no other ball has a smaller power; none if it is empty.

    The power of a point x is ‖x − c‖² − r². The cells of all balls fill the body, whatever the radii.
    """
    others = np.arange(len(centres)) != ball
    constants = np.einsum("ij,ij->i", centres, centres) - radii**2
    normals = 2 * (centres[others] - centres[ball])
    planes = np.column_stack([normals, constants[ball] - constants[others]])
    planes = np.concatenate([faces, planes / np.linalg.norm(normals, axis=1, keepdims=True)])
    ones = np.ones((len(planes), 1))
    deepest = linprog([0, 0, 0, -1], np.hstack([planes[:, :3], ones]), -planes[:, 3], bounds=(None, None)).x
    if deepest[3] < LEAST_CELL_M:
        return np.empty((0, 3))
    corners: Corners = HalfspaceIntersection(planes, deepest[:3]).intersections
    return corners


def _depth(points: Float[np.ndarray, "n 3"], faces: HalfSpaces) -> Float[np.ndarray, " n"]:
    """Distance to the nearest face, negative outside."""
    depth: Float[np.ndarray, " n"] = -(points @ faces[:, :3].T + faces[:, 3]).max(axis=1)
    return depth
