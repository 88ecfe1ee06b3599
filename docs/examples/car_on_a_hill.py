"""A car over a hill that a formula shapes: how much friction it uses, and how its wheels bear."""

import numpy as np

import trajopt
from trajopt.world.height_map import HeightMap

x, y = np.linspace(-2, 14, 81), np.linspace(-4, 4, 41)
heights = 0.8 * np.exp(-(((x[None, :] - 6) / 2.5) ** 2) - (y[:, None] / 2.0) ** 2)  # m, rows of y
hill = HeightMap(heights, spacing=0.2, origin=(-2.0, -4.0))
car = trajopt.robot("car")
path = trajopt.Path.through([[0, 0], [4, 0.8], [8, 0.8], [12, 0]])
limits = [trajopt.Speed(3.0), trajopt.Acceleration(1.5, 1.5), trajopt.Slip(0.6), trajopt.Tip()]
trajectory = trajopt.time_scale(path, limits, robot=car, ground=hill)
times = np.linspace(0, trajectory.duration, 5)
state = trajectory.at(times)
for time, place, steering in zip(times, state.position, state.steering_angles, strict=True):
    print(f"{time:.2f} s  height {place[2]:.2f} m  steering {np.degrees(steering).round(1)} deg")
for name, margin in trajectory.margins().items():
    print(f"{name}: {100 * abs(margin):.1f} % left")
