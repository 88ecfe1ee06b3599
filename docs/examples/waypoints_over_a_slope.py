"""An own differential drive along waypoints from a file, up a slope: timed, explained, exported."""

from pathlib import Path

import numpy as np

import trajopt
from trajopt.formats import export
from trajopt.world.plane import Plane

here = Path(__file__).parent
robot = trajopt.Robot.differential(  # m, kg, N m; x forward, y left, from the axle's middle
    name="mine",
    mass=12.0,
    cog=(-0.05, 0.0, 0.1),
    chassis=(0.4, 0.3, 0.1),
    chassis_place=(-0.1, 0.0),
    clearance=0.05,
    track=0.34,
    radius=0.1,
    width=0.04,
    wheel_mass=0.8,
    torque=4.0,
    castor=(-0.22, 0.0),
    castor_radius=0.04,
    castor_trail=0.03,
    castor_mass=0.2,
)
path = trajopt.Path.through(np.loadtxt(here / "waypoints.csv", delimiter=",", skiprows=1))
limits = [trajopt.Speed(1.0), trajopt.WheelAcceleration(8.0), trajopt.Slip(0.5), trajopt.Tip()]
up = Plane(slope=np.radians(10), direction=0.0)
trajectory = trajopt.time_scale(path, limits, robot=robot, ground=up)
print(f"{trajectory.duration:.3f} s, at most {100 * trajectory.gap:.2g} % above the least")
for stretch in trajectory.active:
    print(f"from {stretch.start:.2f} to {stretch.end:.2f} m: {stretch.limit}")
print(export(trajectory, Path("commands.csv"), sample_time=0.1))
