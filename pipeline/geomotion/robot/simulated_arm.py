"""An arm in the simulator: where its joints and links are, and how its motors are driven."""

from typing import Any

import numpy as np

from geomotion.errors import InvalidSetting
from geomotion.robot.arm import Arm
from geomotion.robot.quiet import quiet
from geomotion.types import Float

Joints = Float[np.ndarray, " joint"]
Pose = tuple[tuple[float, ...], tuple[float, ...]]  # position [m] and quaternion xyzw, as PyBullet has them

POSITION_GAIN, VELOCITY_GAIN = 0.3, 1.0
STRONG = 1000.0  # effort of motors of which the URDF says nothing [N m or N]
BASE = -1  # PyBullet's index of a body's root link


class SimulatedArm:
    """A fixed base and the joints of an arm; joints that are not the arm's are held where they rest.

    Args:
        client: The simulator; importing PyBullet prints, and so does loading, which is silenced here.
        arm: What to load.

    Attributes:
        arm: What was loaded.
        body: Its number in the simulator.
        joint_index: PyBullet's number of every joint.
        link_index: The same of every link.
        joint_before: Of every link with a surface, the last of the arm's joints that moves it, from 0; −1 for the base
            and what is fixed to it.

    Raises:
        InvalidSetting: If the simulator cannot load the URDF, or one of its meshes.
    """

    def __init__(self, client: Any, arm: Arm) -> None:
        self.client, self.arm = client, arm
        self.body = self._load()
        infos = [client.getJointInfo(self.body, index) for index in range(client.getNumJoints(self.body))]
        self.joint_index: dict[str, int] = {info[1].decode(): info[0] for info in infos}
        self.link_index: dict[str, int] = {client.getBodyInfo(self.body)[0].decode(): BASE}
        self.link_index |= {info[12].decode(): info[0] for info in infos}
        self._moved = [self.joint_index[name] for name in arm.joint_names]
        self._effort = {info[0]: info[10] or STRONG for info in infos}
        self._resting = dict(arm.resting)
        self.joint_before = self._joints_before({info[0]: info[16] for info in infos})
        self.rest(arm.resting)

    @property
    def solid_links(self) -> tuple[str, ...]:
        """Links with a surface that the arm's joints move."""
        return tuple(link for link, joint in self.joint_before.items() if joint >= 0)

    def set_joints(self, joints_rad: Joints) -> None:
        """Put the arm there at rest, with everything that it carries [rad]."""
        for index, position in zip(self._moved, joints_rad, strict=True):
            self.client.resetJointState(self.body, index, float(position))
        for name, position in self._resting.items():
            self.client.resetJointState(self.body, self.joint_index[name], position)

    def joints(self) -> tuple[Joints, Joints]:
        """Measured positions [rad] and velocities [rad/s]."""
        states = self.client.getJointStates(self.body, self._moved)
        return np.array([state[0] for state in states]), np.array([state[1] for state in states])

    def command(self, joints_rad: Joints, velocity_rad_per_s: Joints) -> None:
        """Set what the motors strive for in the next step: positions [rad] and velocities [rad/s]."""
        self.client.setJointMotorControlArray(
            self.body,
            self._moved,
            self.client.POSITION_CONTROL,
            targetPositions=joints_rad.tolist(),
            targetVelocities=velocity_rad_per_s.tolist(),
            positionGains=[POSITION_GAIN] * len(self._moved),
            velocityGains=[VELOCITY_GAIN] * len(self._moved),
            forces=[self._effort[index] for index in self._moved],
        )

    def drive(self, velocity_rad_per_s: Joints) -> None:
        """Set the velocities that the motors keep in the next step, whatever their positions [rad/s]."""
        self.client.setJointMotorControlArray(
            self.body,
            self._moved,
            self.client.VELOCITY_CONTROL,
            targetVelocities=velocity_rad_per_s.tolist(),
            forces=self.effort.tolist(),
        )

    @property
    def effort(self) -> Joints:
        """The most that each motor can give [N m]."""
        return np.array([self._effort[index] for index in self._moved])

    def torques(self) -> Joints:
        """What the motors gave in the last step [N m]."""
        return np.array([state[3] for state in self.client.getJointStates(self.body, self._moved)])

    def push(self, force_n: Float[np.ndarray, "3"]) -> None:
        """Let a force act on the tip in the next step, in the base frame [N]."""
        position, _ = self.link_pose(self.arm.tip_link)
        link = self.link_index[self.arm.tip_link]
        self.client.applyExternalForce(self.body, link, force_n.tolist(), position, self.client.WORLD_FRAME)

    def rest(self, positions: dict[str, float]) -> None:
        """Hold joints that are not the arm's somewhere from now on [m or rad]."""
        self._resting |= positions
        for name, position in positions.items():
            index = self.joint_index[name]
            self.client.setJointMotorControl2(
                self.body,
                index,
                self.client.POSITION_CONTROL,
                targetPosition=position,
                force=self._effort[index],
            )

    def link_pose(self, link: str) -> Pose:
        """Measured pose of a link's frame [m]."""
        state = self.client.getLinkState(self.body, self.link_index[link], computeForwardKinematics=1)
        return state[4], state[5]

    def _load(self) -> int:
        from scipy.spatial.transform import Rotation

        root = self.arm.root
        turned = Rotation.from_matrix(root[:3, :3]).as_quat().tolist()
        try:
            with quiet():
                body: int = self.client.loadURDF(str(self.arm.urdf), root[:3, 3].tolist(), turned, useFixedBase=True)
        except Exception as error:  # pybullet.error, which exists only once PyBullet is imported
            raise InvalidSetting("arm.urdf", self.arm.urdf, "a URDF that PyBullet can load") from error
        return body

    def _joints_before(self, parents: dict[int, int]) -> dict[str, int]:
        """Only links of which the simulator knows a surface; it says nothing where it misses a mesh."""
        found = {}
        for link, index in self.link_index.items():
            if self.client.getCollisionShapeData(self.body, index):
                while index != BASE and index not in self._moved:
                    index = parents[index]
                found[link] = self._moved.index(index) if index != BASE else -1
        for shape in self.arm.shapes:
            if shape.link not in found:
                raise InvalidSetting("arm.urdf", f"link {shape.link!r}", "a link whose meshes PyBullet can read")
        return found
