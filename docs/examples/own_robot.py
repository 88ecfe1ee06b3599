"""A robot described in Python, and the same as a file: mobility, limits of its motors, a motion."""

from pathlib import Path

import numpy as np

import trajopt
from trajopt.formats import write_robot

robot = trajopt.Robot.mecanum(
    name="porter",
    mass=30.0,
    cog=(0.0, 0.0, 0.2),
    chassis=(0.6, 0.4, 0.2),
    clearance=0.06,
    wheelbase=0.5,
    track=0.45,
    radius=0.1,
    width=0.06,
    wheel_mass=1.5,
    rollers=9,
    roller_radius=0.02,
    torque=5.0,
)
print(robot)
sideways = trajopt.Path.through([[0, 0], [0, 2]], heading=[0.0, 0.0])
limits = [trajopt.WheelSpeed(12.0), trajopt.WheelAcceleration(10.0)]
trajectory = trajopt.time_scale(sideways, limits, robot=robot)
print(
    f"2 m sideways in {trajectory.duration:.3f} s, wheels {np.round(trajectory.at(1.0).wheel_speeds, 2)}"
)
print(write_robot(robot, Path("porter.urdf")))
