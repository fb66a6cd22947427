"""A table with the Panda, a soft-looking object and a bin: what grasp-and-drop happens on, and what is seen of it.

The hand holds the object by friction alone. Whether it was lifted, and where it ended, is read from contacts and from
its place, never from the motion of the arm.
"""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from geomotion.robot import panda
from geomotion.robot.film import Frame
from geomotion.robot.panda_arm import panda_arm
from geomotion.robot.quiet import quiet
from geomotion.robot.scene import ArmScene
from geomotion.robot.scenery import Scenery, textures
from geomotion.robot.simulated_arm import Joints
from geomotion.robot.soft_object import Cushion, add_cushion
from geomotion.types import Float

Vector = Float[np.ndarray, "3"]
Place = Float[np.ndarray, "2"]

BIN_M, BIN_HALF_M, BIN_HEIGHT_M, BIN_WALL_M = (0.34, -0.46), 0.09, 0.10, 0.004
BIN_COLOUR = (0.35, 0.45, 0.60, 1.0)
FINGERS = ("panda_leftfinger", "panda_rightfinger")
OPEN_M, CLOSED_M = 0.04, 0.0  # of each finger's joint
CLOSING_S, FALLING_S = 0.5, 1.0  # that the hand waits until its fingers are closed, and the object has fallen
LYING_M = 0.001  # gap under the object when it is put down
FINGER_FRICTION = 1.0


class Tabletop:
    """The scene; a context manager. The object lies where :meth:`put_object` puts it."""

    def __init__(self) -> None:
        self.scene = ArmScene(panda_arm(), panda.GRIPPER, table=True)
        self.cushion = Cushion()
        client = self.client
        with quiet():
            self._object = add_cushion(client, self.cushion)
            self._add_bin()
            self._textures = _load(client, textures())
        self.seen: Scenery | None = None
        links = self.scene.simulated.link_index
        self._fingers = {links[name] for name in FINGERS}
        for finger in self._fingers:
            client.changeDynamics(self.scene.simulated.body, finger, lateralFriction=FINGER_FRICTION)

    def __enter__(self) -> "Tabletop":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.client.disconnect()

    @property
    def client(self) -> Any:
        """The simulator."""
        return self.scene.client

    def put_object(self, place_m: Place, turn_rad: float = 0.0) -> None:
        """Lay the object on the table [m], its long side turned from the x axis [rad]."""
        height = self.cushion.half_axes_m[2] + LYING_M
        turn = self.client.getQuaternionFromEuler([0.0, 0.0, turn_rad])
        self.client.resetBasePositionAndOrientation(self._object, [*place_m.tolist(), height], turn)
        self.client.resetBaseVelocity(self._object, [0.0] * 3, [0.0] * 3)

    def object_m(self) -> Vector:
        """Where the middle of the object is."""
        return np.array(self.client.getBasePositionAndOrientation(self._object)[0])

    def put_arm(self, joints_rad: Joints) -> None:
        """The arm there at rest, its hand open [rad]."""
        self.move_fingers(OPEN_M)
        self.scene.set_joints(joints_rad)

    def move_fingers(self, opening_m: float) -> None:
        """Let each finger strive for a place from now on, as strong as it is [m]."""
        assert self.scene.gripper is not None
        self.scene.simulated.rest(dict.fromkeys(self.scene.gripper.finger_joints, opening_m))

    def is_held(self) -> bool:
        """Whether both fingers touch the object and the table does not."""
        return self._touches(self.scene.simulated.body, self._fingers) == self._fingers and not self._is_on_table()

    def is_free(self) -> bool:
        """Whether no part of the arm touches the object."""
        return not self.client.getContactPoints(self._object, self.scene.simulated.body)

    def is_in_bin(self) -> bool:
        """Whether the object is between the walls of the bin, below their rim."""
        place = self.object_m()
        inside = np.abs(place[:2] - np.array(BIN_M)) < BIN_HALF_M
        return bool(inside.all() and 0 < place[2] < BIN_HEIGHT_M)

    def show(self, scenery: Scenery) -> None:
        """Let everything look like this in pictures taken from now on."""
        client, self.seen = self.client, scenery
        client.changeVisualShape(
            self._object, -1, rgbaColor=[*scenery.object_colour, 1], textureUniqueId=self._textures[scenery.texture]
        )
        assert self.scene.table is not None
        for piece in self.scene.table.pieces:
            client.changeVisualShape(piece, -1, rgbaColor=[*scenery.table_colour, 1])

    def picture(self) -> Frame:
        """What the camera of the scenery sees."""
        assert self.seen is not None
        return self.seen.camera.picture(self.scene)

    def _is_on_table(self) -> bool:
        assert self.scene.table is not None
        return any(self.client.getContactPoints(self._object, piece) for piece in self.scene.table.pieces)

    def _touches(self, body: int, links: set[int]) -> set[int]:
        return {contact[4] for contact in self.client.getContactPoints(self._object, body)} & links

    def _add_bin(self) -> None:
        x, y = BIN_M
        outer, wall, high = BIN_HALF_M + BIN_WALL_M, BIN_WALL_M, BIN_HEIGHT_M / 2
        self._add_box((outer, outer, wall), (x, y, wall))
        for side in (-1, 1):
            self._add_box((wall, outer, high), (x + side * outer, y, high))
            self._add_box((outer, wall, high), (x, y + side * outer, high))

    def _add_box(self, half_m: tuple[float, float, float], middle_m: tuple[float, float, float]) -> None:
        box = {"shapeType": self.client.GEOM_BOX, "halfExtents": list(half_m)}
        visual = self.client.createVisualShape(**box, rgbaColor=BIN_COLOUR)
        self.client.createMultiBody(0, self.client.createCollisionShape(**box), visual, basePosition=list(middle_m))


def _load(client: Any, pictures: Sequence[Frame]) -> list[int]:
    """Textures in the simulator, which reads them from files."""
    from PIL import Image

    found = []
    with tempfile.TemporaryDirectory() as folder:
        for number, picture in enumerate(pictures):
            path = Path(folder) / f"{number}.png"
            Image.fromarray(picture).save(path)
            found.append(client.loadTexture(str(path)))
    return found
