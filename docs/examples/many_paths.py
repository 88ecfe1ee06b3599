"""Many motions at once, on all cores: which of a hundred lane changes is fastest within a limit."""

import numpy as np

import trajopt
from trajopt.timing.many import time_scale_many

if __name__ == "__main__":  # workers are new processes
    lengths = np.linspace(6, 16, 100)  # m
    paths = [
        trajopt.Path.through([[0, 0], [1, 0], [length - 1, 2], [length, 2]]) for length in lengths
    ]
    robot = trajopt.robot("powerbot")
    limits = [trajopt.Speed(4.0), trajopt.Acceleration(1.5, 2.0), trajopt.Slip(0.35)]
    found = time_scale_many(paths, limits, robot=robot, gap=None)
    times = [trajectory.duration for trajectory in found]
    best = int(np.argmin(times))
    print(
        f"{len(times)} motions: {min(times):.3f} to {max(times):.3f} s; length {lengths[best]:.1f} m"
    )
