"""A motion for ROS tools, Choreo and race-line software, and a race line back in."""

from pathlib import Path

import trajopt
from trajopt.formats import export
from trajopt.paths.race_line import read_race_line

path = trajopt.Path.through([[0, 0], [3, 1], [6, 0]])
limits = [trajopt.Speed(2.0), trajopt.Acceleration(1.0, 1.0)]
trajectory = trajopt.time_scale(path, limits, robot=trajopt.robot("powerbot"))
for file in ("motion.mcap", "motion.traj", "motion.json"):
    print(export(trajectory, Path(file)))
export(trajectory, Path("line.csv"), "tum")
line = read_race_line("line.csv")
print(f"{len(line.speed)} places, up to {line.speed.max():.2f} m/s")
