"""Small motions in both layouts of the Master Motor Map."""

import numpy as np

TIMES = [0.0, 0.01, 0.02, 0.03]
NAMES = ("BTx_joint", "LKx_joint", "RKx_joint")


def text(values):
    return " ".join(f"{value:.9g}" for value in np.atleast_1d(values))


def joint_elements(names):
    return "".join(f"<Joint name='{name}'/>" for name in names)


def swinging(times, joints=3):
    return np.sin(10 * np.asarray(times)[:, None] + np.arange(joints))


def legacy(times=TIMES, names=NAMES, joints=None, height="1.8", edit=lambda number, frame: frame):
    """A motion of the legacy layout; `edit` may change the text of each frame."""
    joints = swinging(times, len(names)) if joints is None else joints
    frames = [
        f"<MotionFrame><Timestep>{time}</Timestep><RootPosition>{text([10 * number, 20, 950])}</RootPosition>"
        f"<RootRotation>{text([0.1, 0.2, 0.3 + number])}</RootRotation><JointPosition>{text(row)}</JointPosition>"
        "</MotionFrame>"
        for number, (time, row) in enumerate(zip(times, joints, strict=True))
    ]
    edited = "".join(edit(number, frame) for number, frame in enumerate(frames))
    return (
        "<MMM><Motion name='walk'><Model><File>body.xml</File></Model>"
        f"<ModelProcessorConfig type='Winter'><Height>{height}</Height></ModelProcessorConfig>"
        f"<JointOrder>{joint_elements(names)}</JointOrder><MotionFrames>{edited}</MotionFrames>"
        "</Motion></MMM>"
    )


def measurements(times, tag, values):
    return "".join(
        f"<Measurement timestep='{time}'><{tag}>{text(row)}</{tag}></Measurement>"
        for time, row in zip(times, values, strict=True)
    )


def kinematic(times, names, joints=None):
    """A Kinematic sensor."""
    joints = swinging(times, len(names)) if joints is None else joints
    data = measurements(times, "JointPosition", joints)
    return (
        f"<Sensor type='Kinematic'><Configuration>{joint_elements(names)}</Configuration><Data>{data}</Data></Sensor>"
    )


def model_pose(times, positions, rotations):
    """A ModelPose sensor."""
    data = "".join(
        f"<Measurement timestep='{time}'><RootPosition>{text(position)}</RootPosition>"
        f"<RootRotation>{text(rotation)}</RootRotation></Measurement>"
        for time, position, rotation in zip(times, positions, rotations, strict=True)
    )
    return f"<Sensor type='ModelPose'><Configuration/><Data>{data}</Data></Sensor>"


def motion(*sensors, name="walk", kind="MMM"):
    """A motion of the newer layout."""
    height = "<ModelProcessorConfig type='Winter'><Height>1.7</Height></ModelProcessorConfig>"
    model = f"<Model path='../body.xml'>{height}</Model>"
    return f"<Motion name='{name}' type='{kind}'>{model}<Sensors>{''.join(sensors)}</Sensors></Motion>"


def document(*motions):
    return f"<MMM version='2.0'>{''.join(motions)}</MMM>"


BODY = """<Robot Type='body' RootNode='hip'>
<RobotNode name='hip'><Child name='BTx_joint'/><Child name='LKx_joint'/></RobotNode>
<RobotNode name='BTx_joint'>
<Transform><Matrix4x4 units='mm'><row1 c1='1' c2='0' c3='0' c4='0'/><row2 c1='0' c2='1' c3='0' c4='0'/>
<row3 c1='0' c2='0' c3='1' c4='250'/><row4 c1='0' c2='0' c3='0' c4='1'/></Matrix4x4></Transform>
<Joint type='revolute'><axis x='1' y='0' z='0'/></Joint><Child name='head'/></RobotNode>
<RobotNode name='head'><Transform><Translation x='0' y='0' z='0.2' units='m'/></Transform></RobotNode>
<RobotNode name='LKx_joint'>
<Transform><Translation x='-100' y='0' z='0'/><RollPitchYaw roll='0' pitch='0' yaw='90' units='degree'/></Transform>
<Joint type='prismatic'><translationdirection x='2' y='0' z='0'/></Joint></RobotNode>
</Robot>
"""
