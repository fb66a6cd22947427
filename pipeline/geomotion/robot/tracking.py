"""The simulated arm follows a timed motion, in real dynamics and under position control."""

from geomotion.robot.film import Film
from geomotion.robot.recording import AT_REST, Motions, Recorder, Tracking
from geomotion.robot.scene import STEP_S, ArmScene
from geomotion.robot.timed import TimedJoints


def follow(
    scene: ArmScene,
    timed: TimedJoints,
    motions: Motions = AT_REST,
    film: Film | None = None,
) -> Tracking:
    """Command a motion at 240 Hz, positions with velocities, and measure what the arm does.

    Args:
        scene: Its arm is put at the start of the motion.
        timed: The motion.
        motions: Obstacle -> function of the time [s] that gives its offset from its place [m]; the others rest.
        film: Takes pictures, if given.

    Raises:
        UnknownName: If a moving obstacle is not in the scene.
    """
    recorder = Recorder(scene, motions, film)
    scene.set_joints(timed.joints_rad[0])
    for step, time_s in enumerate(timed.time_s[1:].tolist()):
        now, then = timed.joints_rad[step : step + 2]
        recorder.prepare(time_s)
        scene.command(now, (then - now) / STEP_S)
        scene.step()
        recorder.note(time_s, then)
    return recorder.tracking()
