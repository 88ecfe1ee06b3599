"""A folder that ``ros2 bag`` plays: MCAP with its metadata, written by rosbags.

Topics: ``/plan`` (nav_msgs/Path), ``/odom`` (nav_msgs/Odometry), ``/joint_states``
(sensor_msgs/JointState), ``/cmd_vel`` (geometry_msgs/Twist). Poses are those of the frame
``base_footprint`` (the body's origin, on the ground) in ``map``; joints are called as in the URDF
of the same robot. Time begins at 0 s.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError, MissingDependencyError
from trajopt.formats.names import BASE, spin_joint, turning_joints
from trajopt.simulate.model import quaternion_of
from trajopt.timing.states import State
from trajopt.timing.trajectory import Trajectory

WORLD = "map"
_TOPICS = {
    "/plan": "nav_msgs/msg/Path",
    "/odom": "nav_msgs/msg/Odometry",
    "/joint_states": "sensor_msgs/msg/JointState",
    "/cmd_vel": "geometry_msgs/msg/Twist",
}
_NO_COVARIANCE = np.zeros(36)  # ROS: all zeros where it is not known


def write(trajectory: Trajectory, folder: Path, sample_time: float) -> int:
    """Write the motion in steps of ``sample_time``, s, and its end; returns how many samples.

    Raises MissingDependencyError without rosbags, ArgumentError for a folder that is there."""
    try:
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise MissingDependencyError("rosbags", "formats", "writing for ROS 2") from error
    if folder.exists():
        raise ArgumentError("--out", str(folder), "the name of a folder that is not there yet")
    times = sample_times(trajectory, sample_time)
    state = trajectory.at(times)
    # of a distribution with these messages as they still are
    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        topics = {
            topic: bag.add_connection(topic, kind, typestore=store)
            for topic, kind in _TOPICS.items()
        }
        for topic, stamp, message in _messages(trajectory, times, state, store.types):
            kind = _TOPICS[topic]
            bag.write(topics[topic], stamp, store.serialize_cdr(message, kind))
    return len(times)


def sample_times(trajectory: Trajectory, sample_time: float) -> Array:
    """(N,): multiples of ``sample_time`` in the motion, and its end, s."""
    count = int(np.ceil(trajectory.duration / sample_time - 1e-9))
    return np.append(sample_time * np.arange(count), trajectory.duration)


def _messages(
    trajectory: Trajectory, times: Array, state: State, types: dict[str, Any]
) -> Iterator[tuple[str, int, Any]]:
    """Topic, time (ns) and message, in the order of time."""
    vector = types["geometry_msgs/msg/Vector3"]
    stamps = np.round(1e9 * times).astype(np.int64).tolist()

    def header(stamp: int, frame: str) -> Any:
        time = types["builtin_interfaces/msg/Time"](*divmod(stamp, 10**9))
        return types["std_msgs/msg/Header"](time, frame)

    poses = [
        types["geometry_msgs/msg/Pose"](
            types["geometry_msgs/msg/Point"](*place),
            types["geometry_msgs/msg/Quaternion"](x, y, z, w),
        )
        for place, turn in zip(state.position.tolist(), state.rotation, strict=True)
        for w, x, y, z in [quaternion_of(turn)]
    ]
    stamped = types["geometry_msgs/msg/PoseStamped"]
    plan = [stamped(header(t, WORLD), pose) for t, pose in zip(stamps, poses, strict=True)]
    yield "/plan", 0, types["nav_msgs/msg/Path"](header(0, WORLD), plan)
    names, angles, rates = _joints(trajectory, state)
    for i, (stamp, (vx, vy, wz)) in enumerate(zip(stamps, state.twist.tolist(), strict=True)):
        twist = types["geometry_msgs/msg/Twist"](vector(vx, vy, 0.0), vector(0.0, 0.0, wz))
        yield (
            "/odom",
            stamp,
            types["nav_msgs/msg/Odometry"](
                header(stamp, WORLD),
                BASE,
                types["geometry_msgs/msg/PoseWithCovariance"](poses[i], _NO_COVARIANCE),
                types["geometry_msgs/msg/TwistWithCovariance"](twist, _NO_COVARIANCE),
            ),
        )
        joints = types["sensor_msgs/msg/JointState"]
        none = np.zeros(0)
        yield (
            "/joint_states", stamp, joints(header(stamp, ""), names, angles[i], rates[i], none)
        )  # fmt: skip
        yield "/cmd_vel", stamp, twist


def _joints(trajectory: Trajectory, state: State) -> tuple[list[str], Array, Array]:
    """Names (J,), angles (N, J), rad, and rates (N, J), rad/s, of wheels and of what turns them."""
    robot = trajectory.robot
    assert robot is not None  # ``export`` has asked
    wheels = robot.description.wheels
    spins = [i for i, wheel in enumerate(wheels) if wheel.kind != "spherical"]
    turning = turning_joints(robot)
    names = [spin_joint(wheels[i].name) for i in spins] + list(turning)
    turns = list(turning.values())
    return (
        names,
        _rows(state.spin_angles[:, spins], state.steering_angles[:, turns]),
        _rows(state.spin_rates[:, spins], state.steering_rates[:, turns]),
    )


def _rows(*parts: Array) -> Array:
    """Side by side, each row in one piece, as rosbags wants it."""
    return np.ascontiguousarray(np.hstack(parts))
