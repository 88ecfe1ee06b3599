"""A shape of the ground of one's own: a road of waves, from its height and its derivatives."""

import numpy as np

import trajopt


class Waves:
    """h = ``crest`` sin(2 pi x / ``length``), m."""

    lines = ()  # along which derivatives jump: none
    bends = True  # on the scale of a robot: it stands on the heights under its wheels
    level = False

    def __init__(self, crest, length):
        self.crest, self.k, self.grain = crest, 2 * np.pi / length, length / 8

    def height(self, x, y):
        return self.partial(x, y, 0, 0)

    def partial(self, x, y, i, j):
        wave = self.crest * self.k**i * np.sin(self.k * np.asarray(x) + i * np.pi / 2)
        return wave * (j == 0) * np.ones(np.shape(y))

    def covers(self, x, y):
        return np.ones(np.broadcast(x, y).shape, dtype=bool)

    def check(self, path):
        pass  # any path can be driven


path = trajopt.Path.through([[0, 0], [4, 0.5], [8, 0]])
limits = [trajopt.Speed(2.0), trajopt.Acceleration(1.0, 1.0), trajopt.Slip(0.4), trajopt.Tip()]
for crest in (0.02, 0.04, 0.06):
    ground = Waves(crest, length=3.0)
    found = trajopt.time_scale(path, limits, robot=trajopt.robot("powerbot"), ground=ground)
    pitch = np.degrees(np.arcsin(found.at(np.linspace(0, found.duration, 500)).rotation[:, 2, 0]))
    print(f"waves of {crest} m: {found.duration:.2f} s, up to {np.ptp(pitch) / 2:.1f} deg steep")
