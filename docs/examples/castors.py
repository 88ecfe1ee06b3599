"""What every wheel does along a path: spin, steering and castor angles, with their rates."""

import numpy as np

import trajopt

robot = trajopt.robot("powerbot")
path = trajopt.Path.through([[0, 0], [2, 1], [4, 0]])
trajectory = trajopt.time_scale(
    path, [trajopt.Speed(1.0), trajopt.Acceleration(0.5, 0.5)], robot=robot
)
times = np.linspace(0, trajectory.duration, 6)
state = trajectory.at(times)
print("wheels:", ", ".join(wheel.name for wheel in robot.description.wheels))
for time, spin, turned in zip(times, state.spin_angles, state.steering_angles, strict=True):
    print(f"{time:5.2f} s  spin {spin.round(2)} rad  turned {np.degrees(turned).round(1)} deg")
