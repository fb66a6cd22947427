"""An arm in PyBullet, with obstacles and a grasped object: poses, distances, contacts.

The arm's base is the world frame; the table's top is at z = 0, the floor 0.63 m below, and only seen. Quaternions are
scalar-first here and scalar-last only in calls of PyBullet. Nothing is printed.
"""

from types import TracebackType
from typing import Any

import numpy as np

from geomotion.errors import InvalidSetting, UnknownName
from geomotion.robot.arm import Arm
from geomotion.robot.grasp import Grasp, GraspedCylinder
from geomotion.robot.gripper import Gripper
from geomotion.robot.placed import PlacedObstacle
from geomotion.robot.quiet import quiet
from geomotion.robot.self_collision import Pair, SelfCollision
from geomotion.robot.shapes import Shape, dots, shape_of
from geomotion.robot.simulated_arm import Joints, SimulatedArm
from geomotion.types import Float

Vector = Float[np.ndarray, "3"]
Quaternion = Float[np.ndarray, "4"]

STEP_S = 1 / 240  # PyBullet's own time step, to which its solver is tuned
FLOOR_M = -0.63
TABLE_SIZE_M, TABLE_CENTRE_M = np.array([1.3, 1.8, 0.05]), np.array([0.35, 0.0, -0.025])
GRAVITY_M_PER_S2 = 9.81
PROBE_RADIUS_M = 1e-4
FAR_M = 5.0
GRASPED, TABLE = "grasped", "table"
TABLE_COLOUR = (0.80, 0.74, 0.66, 1.0)
NOWHERE = np.zeros(3)


class ArmScene:
    """An arm in a simulator of its own, its joints at zero or the limit nearest to it; a context manager.

    Args:
        arm: Any serial arm.
        gripper: With what it can hold an object, if it can.
        table: Whether a table stands under the arm.

    Raises:
        InvalidSetting: If the simulator cannot load the arm's URDF, or one of its meshes.
    """

    def __init__(self, arm: Arm, gripper: Gripper | None = None, *, table: bool = False) -> None:
        self.arm, self.gripper = arm, gripper
        with quiet():  # importing PyBullet prints already
            import pybullet
            from pybullet_utils.bullet_client import BulletClient

            self.client: Any = BulletClient(pybullet.DIRECT)
            self._furnish(table)
            self.simulated = SimulatedArm(self.client, arm)
        self.obstacles: dict[str, PlacedObstacle] = {}
        self._grasped: Grasp | None = None
        self._self_collision = SelfCollision(self.simulated)
        self.set_joints(np.clip(0.0, arm.limits.lower_rad, arm.limits.upper_rad))

    def __enter__(self) -> "ArmScene":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.client.disconnect()

    def set_joints(self, joints_rad: Joints) -> None:
        """Put the arm there at rest, fingers and grasped object with it, without simulating the way [rad]."""
        self.simulated.set_joints(joints_rad)
        if self.gripper is not None and self._grasped is not None:
            self._grasped.place(self.simulated.link_pose(self.gripper.holding_link))

    def joints(self) -> tuple[Joints, Joints]:
        """Measured positions [rad] and velocities [rad/s]."""
        return self.simulated.joints()

    def end_effector_pose(self) -> tuple[Vector, Quaternion]:
        """Measured position [m] and orientation (wxyz) of the arm's tip."""
        position, xyzw = self.simulated.link_pose(self.arm.tip_link)
        return np.array(position), np.roll(xyzw, 1)

    def command(self, joints_rad: Joints, velocity_rad_per_s: Joints) -> None:
        """Where the joints should be now [rad], and how fast they should move until the next step [rad/s].

        The motors act on the position before a step: told that of its end, they would run a step ahead.
        """
        self.simulated.command(joints_rad, velocity_rad_per_s)

    def step(self) -> None:
        """Simulate 1/240 s."""
        self.client.stepSimulation()

    def add_obstacle(self, name: str, body: object, offset_m: Vector = NOWHERE) -> None:
        """Place an obstacle, at an offset from where it says it is [m].

        Args:
            name: How results call it.
            body: A sphere, box, ellipsoid, mesh or point cloud in three dimensions.
            offset_m: [m].

        Raises:
            InvalidSetting: If the name is taken.
            ShapeMismatch: If the body has another number of dimensions.
        """
        if name in {*self.obstacles, GRASPED, TABLE}:
            raise InvalidSetting("obstacle", name, "a name that no other body of the scene has")
        with quiet():
            self.obstacles[name] = PlacedObstacle(self.client, shape_of(body))
        self.move_obstacle(name, offset_m)

    def move_obstacle(self, name: str, offset_m: Vector) -> None:
        """Put an obstacle at an offset from where it says it is [m].

        Raises:
            UnknownName: If there is none of that name.
        """
        self._obstacle(name).move(offset_m)

    def attach(self, tool: GraspedCylinder) -> None:
        """Let the hand hold a cylinder from now on.

        Raises:
            InvalidSetting: If it holds one already, or nothing is known of a hand.
        """
        if self.gripper is None:
            expected = f"0: nothing is known of a hand of arm {self.arm.name!r} that could hold an object"
            raise InvalidSetting("planning.tool_radius_m", tool.radius_m, expected)
        if self._grasped is not None:
            raise InvalidSetting("robot.grasped", tool, "one object at a time")
        simulated = self.simulated
        with quiet():
            link = simulated.link_index[self.gripper.holding_link]
            self._grasped = Grasp(self.client, simulated.body, link, tool)
        simulated.rest({name: min(tool.radius_m, self.arm.resting[name]) for name in self.gripper.finger_joints})
        self.set_joints(self.joints()[0])

    def draw(self, points_m: Float[np.ndarray, "point 3"], radius_m: float, colour: tuple[float, ...]) -> int:
        """Show points in pictures [m], which nothing collides with; what to :meth:`erase` them by."""
        visual = self.client.createVisualShape(**dots(points_m, radius_m), rgbaColor=colour)
        return int(self.client.createMultiBody(0, baseVisualShapeIndex=visual))

    def erase(self, drawn: int) -> None:
        """Show points no longer."""
        self.client.removeBody(drawn)

    def clearances(self, max_distance_m: float = 0.2) -> dict[str, float]:
        """Distance of every moving link, and of the grasped object, to the nearest obstacle [m].

        Negative where they overlap, though never inside a mesh or cloud, which are surfaces here; farther than
        `max_distance_m` counts as `max_distance_m`.
        """
        nearest = dict.fromkeys(self.body_names, max_distance_m)
        for name in self.obstacles:
            for link, distance in self.clearances_from(name, max_distance_m).items():
                nearest[link] = min(nearest[link], distance)
        return nearest

    def clearances_from(self, obstacle: str, max_distance_m: float) -> dict[str, float]:
        """Distance of links and grasped object to one obstacle [m], without those farther than `max_distance_m`.

        Raises:
            UnknownName: If there is no such obstacle.
        """
        return self._distances(self._obstacle(obstacle), max_distance_m)

    def self_clearances(self, up_to_m: float = 0.2) -> dict[Pair, float]:
        """Distances between links of the arm that can collide [m], without those farther apart than `up_to_m`.

        Which pairs these are is said in :class:`geomotion.robot.self_collision.SelfCollision`; a grasped object
        counts as part of the hand.
        """
        found = self._self_collision.distances(up_to_m)
        if self._grasped is not None:
            held = self._self_collision.distances_of_held(self._grasped.body, up_to_m)
            found |= {(link, GRASPED): apart_m for link, apart_m in held.items()}
        return found

    def touching(self) -> dict[str, tuple[str, ...]]:
        """For every obstacle, and the table, that is touched: the links, or the grasped object, that touch it."""
        solids = self.obstacles if self.table is None else self.obstacles | {TABLE: self.table}
        found = {name: tuple(self._distances(placed, 0.0)) for name, placed in solids.items()}
        return {name: links for name, links in found.items() if links}

    def probe_distance(self, point_m: Vector, obstacle: str) -> float:
        """Distance of a point to an obstacle by PyBullet's own query [m]; 5 m if it is farther.

        Negative inside a sphere, box or ellipsoid; inside a mesh it is the distance to the surface.

        Raises:
            UnknownName: If there is no such obstacle.
        """
        placed = self._obstacle(obstacle)
        self.client.resetBasePositionAndOrientation(self._probe, point_m.tolist(), [0, 0, 0, 1])
        found = placed.distances(self._probe, FAR_M)
        self.client.resetBasePositionAndOrientation(self._probe, [0, 0, 2 * FAR_M], [0, 0, 0, 1])
        return min(found.values(), default=FAR_M) + PROBE_RADIUS_M

    @property
    def body_names(self) -> tuple[str, ...]:
        """The links with a surface that move, and the grasped object if there is one."""
        links = self.simulated.solid_links
        return links if self._grasped is None else (*links, GRASPED)

    def _distances(self, placed: PlacedObstacle, up_to_m: float) -> dict[str, float]:
        simulated = self.simulated
        found = placed.distances(simulated.body, up_to_m)
        named = {name: found[at] for name in simulated.solid_links if (at := simulated.link_index[name]) in found}
        if self._grasped is not None:
            for distance in placed.distances(self._grasped.body, up_to_m).values():
                named[GRASPED] = distance
        return named

    def _obstacle(self, name: str) -> PlacedObstacle:
        if name not in self.obstacles:
            raise UnknownName("obstacle", name, self.obstacles)
        return self.obstacles[name]

    def _furnish(self, table: bool) -> None:
        """Everything but the arm."""
        import pybullet_data

        client = self.client
        client.setTimeStep(STEP_S)
        client.setGravity(0, 0, -GRAVITY_M_PER_S2)
        floor = client.loadURDF(f"{pybullet_data.getDataPath()}/plane.urdf", [0, 0, FLOOR_M])
        client.setCollisionFilterGroupMask(floor, -1, 0, 0)  # no arm's own floor is known
        box = {"shapeType": client.GEOM_BOX, "halfExtents": (TABLE_SIZE_M / 2).tolist()}
        self.table = PlacedObstacle(client, Shape([box], box, TABLE_CENTRE_M), TABLE_COLOUR) if table else None
        ball = client.createCollisionShape(client.GEOM_SPHERE, radius=PROBE_RADIUS_M)
        self._probe: int = client.createMultiBody(0, ball, basePosition=[0, 0, 2 * FAR_M])
        client.setCollisionFilterGroupMask(self._probe, -1, 0, 0)
