"""A lap of a closed track: the spline is periodic, and the car arrives as fast as it set off."""

import numpy as np

import trajopt

turns = np.linspace(0, 2 * np.pi, 24, endpoint=False)
radius = 20 + 5 * np.cos(3 * turns)  # m
points = np.stack([radius * np.cos(turns), radius * np.sin(turns)], axis=1)
path = trajopt.Path.through(points, closed=True)
limits = [trajopt.Speed(12.0), trajopt.Acceleration(3.0, 5.0), trajopt.Slip(0.7)]
car = trajopt.robot("car")
standing = trajopt.time_scale(path, limits, robot=car)
speed = 6.0  # m/s over the line, at both ends
flying = trajopt.time_scale(path, limits, robot=car, start_speed=speed, end_speed=speed)
print(
    f"{path.length:.1f} m: {standing.duration:.2f} s from rest to rest, {flying.duration:.2f} s flying"
)
