"""Limited jerk: how much longer a motion takes that a full glass survives."""

import numpy as np

import trajopt

path = trajopt.Path.through([[0, 0], [2, 0.5], [4, 0]])
limits = [trajopt.Speed(1.0), trajopt.Acceleration(1.0, 1.0), trajopt.YawRate(1.0)]
fast = trajopt.time_scale(path, limits, robot=trajopt.robot("powerbot"))
print(f"jerk without end: {fast.duration:.3f} s")
for jerk in (10.0, 2.0, 0.5):  # m/s^3
    smooth = trajopt.limit_jerk(fast, jerk)
    twist = smooth.at(np.linspace(0, smooth.duration, 201)).twist
    print(f"jerk {jerk:4.1f}: {smooth.duration:.3f} s, up to {twist[:, 0].max():.2f} m/s")
