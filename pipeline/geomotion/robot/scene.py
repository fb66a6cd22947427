"""The Panda at its table in PyBullet, with obstacles and a grasped object: poses, distances, contacts.

The arm's base is the world frame; the table's top is at z = 0, the floor 0.63 m below. Quaternions are scalar-first
here and scalar-last only in calls of PyBullet. Nothing is printed.
"""

from types import TracebackType
from typing import Any

import numpy as np

from geomotion.errors import InvalidSetting, UnknownName
from geomotion.robot import panda
from geomotion.robot.grasp import Grasp, GraspedCylinder
from geomotion.robot.placed import PlacedObstacle
from geomotion.robot.quiet import quiet
from geomotion.robot.shapes import Shape, dots, shape_of
from geomotion.types import Float

Vector = Float[np.ndarray, "3"]
Quaternion = Float[np.ndarray, "4"]
Joints = Float[np.ndarray, "7"]

STEP_S = 1 / 240  # PyBullet's own time step, to which its solver is tuned
FLOOR_M = -0.63
TABLE_SIZE_M, TABLE_CENTRE_M = np.array([1.3, 1.8, 0.05]), np.array([0.35, 0.0, -0.025])
GRAVITY_M_PER_S2 = 9.81
POSITION_GAIN, VELOCITY_GAIN = 0.3, 1.0
FINGER_FORCE_N = 20.0
PROBE_RADIUS_M = 1e-4
FAR_M = 5.0
GRASPED, TABLE = "grasped", "table"
HOLDING_LINK = "panda_grasptarget"
TABLE_COLOUR = (0.80, 0.74, 0.66, 1.0)
NOWHERE = np.zeros(3)


class PandaScene:
    """A Panda in a simulator of its own; a context manager.

    Args:
        table: Whether a table stands under the arm.
    """

    def __init__(self, *, table: bool = True) -> None:
        with quiet():  # importing PyBullet prints already
            import pybullet
            from pybullet_utils.bullet_client import BulletClient

            self.client: Any = BulletClient(pybullet.DIRECT)
            self._load(table)
        self.obstacles: dict[str, PlacedObstacle] = {}
        self._grasped: Grasp | None = None
        self.set_joints(panda.HOME_RAD)

    def __enter__(self) -> "PandaScene":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.client.disconnect()

    def set_joints(self, joints_rad: Joints) -> None:
        """Put the arm there at rest, fingers and grasped object with it, without simulating the way [rad]."""
        for name, position in zip(panda.JOINTS, joints_rad, strict=True):
            self.client.resetJointState(self.arm, self.joint_index[name], float(position))
        for name in panda.FINGER_JOINTS:
            self.client.resetJointState(self.arm, self.joint_index[name], self._finger_m)
        if self._grasped is not None:
            self._grasped.place(self._link_pose(HOLDING_LINK))

    def joints(self) -> tuple[Joints, Joints]:
        """Measured positions [rad] and velocities [rad/s]."""
        states = self.client.getJointStates(self.arm, [self.joint_index[name] for name in panda.JOINTS])
        return np.array([state[0] for state in states]), np.array([state[1] for state in states])

    def end_effector_pose(self, frame: panda.Frame = "grasp_target") -> tuple[Vector, Quaternion]:
        """Measured position [m] and orientation (wxyz) of a frame of the arm."""
        position, xyzw = self._link_pose(panda.FRAME_LINKS[frame])
        return np.array(position), np.roll(xyzw, 1)

    def command(self, joints_rad: Joints, velocity_rad_per_s: Joints) -> None:
        """Where the joints should be now [rad], and how fast they should move until the next step [rad/s].

        The motors act on the position before a step: told that of its end, they would run a step ahead.
        """
        self.client.setJointMotorControlArray(
            self.arm,
            [self.joint_index[name] for name in panda.JOINTS],
            self.client.POSITION_CONTROL,
            targetPositions=joints_rad.tolist(),
            targetVelocities=velocity_rad_per_s.tolist(),
            positionGains=[POSITION_GAIN] * len(panda.JOINTS),
            velocityGains=[VELOCITY_GAIN] * len(panda.JOINTS),
            forces=panda.EFFORT_NM.tolist(),
        )

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
            InvalidSetting: If it holds one already.
        """
        if self._grasped is not None:
            raise InvalidSetting("robot.grasped", tool, "one object at a time")
        with quiet():
            self._grasped = Grasp(self.client, self.arm, self.link_index[HOLDING_LINK], tool)
        self._finger_m = min(tool.radius_m, panda.FINGERS_OPEN_M)
        self._hold_fingers()
        self.set_joints(self.joints()[0])

    def draw(self, points_m: Float[np.ndarray, "point 3"], radius_m: float, colour: tuple[float, ...]) -> None:
        """Show points in pictures [m]; nothing collides with them."""
        visual = self.client.createVisualShape(**dots(points_m, radius_m), rgbaColor=colour)
        self.client.createMultiBody(0, baseVisualShapeIndex=visual)

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
        return panda.SOLID_LINKS if self._grasped is None else (*panda.SOLID_LINKS, GRASPED)

    def _distances(self, placed: PlacedObstacle, up_to_m: float) -> dict[str, float]:
        found = placed.distances(self.arm, up_to_m)
        named = {name: found[self.link_index[name]] for name in panda.SOLID_LINKS if self.link_index[name] in found}
        if self._grasped is not None:
            for distance in placed.distances(self._grasped.body, up_to_m).values():
                named[GRASPED] = distance
        return named

    def _obstacle(self, name: str) -> PlacedObstacle:
        if name not in self.obstacles:
            raise UnknownName("obstacle", name, self.obstacles)
        return self.obstacles[name]

    def _link_pose(self, link: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
        state = self.client.getLinkState(self.arm, self.link_index[link], computeForwardKinematics=1)
        return state[4], state[5]

    def _load(self, table: bool) -> None:
        client = self.client
        client.setTimeStep(STEP_S)
        client.setGravity(0, 0, -GRAVITY_M_PER_S2)
        self.arm: int = client.loadURDF(str(panda.urdf_path()), useFixedBase=True)
        infos = [client.getJointInfo(self.arm, index) for index in range(client.getNumJoints(self.arm))]
        self.joint_index = {info[1].decode(): info[0] for info in infos}
        self.link_index = {info[12].decode(): info[0] for info in infos}
        self._finger_m = panda.FINGERS_OPEN_M
        self._hold_fingers()
        client.loadURDF(str(panda.urdf_path().parents[1] / "plane.urdf"), [0, 0, FLOOR_M])
        box = {"shapeType": client.GEOM_BOX, "halfExtents": (TABLE_SIZE_M / 2).tolist()}
        self.table = PlacedObstacle(client, Shape([box], box, TABLE_CENTRE_M), TABLE_COLOUR) if table else None
        ball = client.createCollisionShape(client.GEOM_SPHERE, radius=PROBE_RADIUS_M)
        self._probe: int = client.createMultiBody(0, ball, basePosition=[0, 0, 2 * FAR_M])
        client.setCollisionFilterGroupMask(self._probe, -1, 0, 0)

    def _hold_fingers(self) -> None:
        for name in panda.FINGER_JOINTS:
            self.client.setJointMotorControl2(
                self.arm,
                self.joint_index[name],
                self.client.POSITION_CONTROL,
                targetPosition=self._finger_m,
                force=FINGER_FORCE_N,
            )
