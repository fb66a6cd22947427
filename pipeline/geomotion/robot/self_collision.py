"""How near an arm's links come to each other, by the simulator's own distances."""

from itertools import combinations

import numpy as np

from geomotion.robot.simulated_arm import BASE, Joints, SimulatedArm

Pair = tuple[str, str]
SAMPLES, SEED = 32, 0
APART = 2  # joints between two links, at least; those that one joint joins touch each other there


class SelfCollision:
    """Pairs of links that can collide.

    Links that no joint of the arm moves against each other, such as hand and fingers, count as one body. Two bodies can
    collide where two joints or more lie between them, and if their links overlap neither while the arm rests, all its
    joints at zero or the limit nearest to it, nor in all of some random configurations: simulators take links as convex
    hulls, and hulls can overlap where the links do not. It is how MoveIt's assistant chooses pairs.

    Args:
        simulated: The arm, which is moved, and left anywhere.
    """

    def __init__(self, simulated: SimulatedArm) -> None:
        self.simulated = simulated
        joint = simulated.joint_before
        self.pairs = [pair for pair in combinations(joint, 2) if abs(joint[pair[0]] - joint[pair[1]]) >= APART]
        limits = simulated.arm.limits
        lower, upper = np.maximum(limits.lower_rad, -np.pi), np.minimum(limits.upper_rad, np.pi)
        random = np.random.default_rng(SEED).uniform(lower, upper, (SAMPLES, len(lower)))
        at_rest = self._overlapping(np.clip(0.0, limits.lower_rad, limits.upper_rad))
        never = at_rest | set.intersection(*(self._overlapping(joints_rad) for joints_rad in random))
        self.pairs = [pair for pair in self.pairs if self._bodies(pair) not in never]

    def distances(self, up_to_m: float) -> dict[Pair, float]:
        """Of the pairs that are no farther apart than `up_to_m` [m]; negative where they overlap."""
        index = self.simulated.link_index
        found = {pair: self._distance(pair[0], self.simulated.body, index[pair[1]], up_to_m) for pair in self.pairs}
        return {pair: apart_m for pair, apart_m in found.items() if apart_m <= up_to_m}

    def distances_of_held(self, held: int, up_to_m: float) -> dict[str, float]:
        """The same between links and what the arm's end holds, which counts as part of it.

        Args:
            held: Its number in the simulator.
            up_to_m: [m].
        """
        last = len(self.simulated.arm.joint_names) - 1
        links = [link for pair in self.pairs if last in self._bodies(pair) for link in pair]
        found = {link: self._distance(link, held, BASE, up_to_m) for link in links if self._joint(link) != last}
        return {link: apart_m for link, apart_m in found.items() if apart_m <= up_to_m}

    def _distance(self, link: str, body: int, number: int, up_to_m: float) -> float:
        """Between a link of the arm and a numbered link of a body [m]; infinite if farther than `up_to_m`."""
        simulated = self.simulated
        contacts = simulated.client.getClosestPoints(simulated.body, body, up_to_m, simulated.link_index[link], number)
        return min((contact[8] for contact in contacts), default=np.inf)

    def _overlapping(self, joints_rad: Joints) -> set[tuple[int, int]]:
        self.simulated.set_joints(joints_rad)
        return {self._bodies(pair) for pair, apart_m in self.distances(0.0).items() if apart_m < 0}

    def _bodies(self, pair: Pair) -> tuple[int, int]:
        """The joints that move them, the smaller number first."""
        one, other = sorted(self._joint(link) for link in pair)
        return one, other

    def _joint(self, link: str) -> int:
        return self.simulated.joint_before[link]
