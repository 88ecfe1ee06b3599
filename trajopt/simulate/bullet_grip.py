"""Friction of wheels in Bullet, which knows two directions of it for each contact."""

from __future__ import annotations

import math

import numpy as np

from trajopt.simulate.bullet import Client
from trajopt.simulate.model import Model

ERROR = 0.01  # share by which friction may be off before it is set anew, chosen


class Grip:
    """Friction of all wheels of a robot, set anew where what they hold has turned.

    Bullet bounds two directions of friction, of which the first has no x, each by itself. A tyre
    that pulls between them would hold too well: it gets the friction at which the bounds' corner
    holds what it should. ``rollers``, where these have to share the load, have both directions laid
    along their axes, each as long as its share: together they hold |c1| + |c2| times what one does.
    """

    def __init__(
        self, bullet: Client, model: Model, robot: int, joint: list[int], friction: float,
        *, rollers: bool,
    ) -> None:  # fmt: skip
        self.bullet, self.robot, self.model = bullet, robot, model
        # links of each wheel that touch the ground; of those with rollers the lowest one's axis
        found = [np.flatnonzero(model.is_roller & (model.parents == foot)) for foot in model.feet]
        self.links = [
            links.tolist() if len(links) else [foot]
            for links, foot in zip(found, model.feet, strict=True)
        ]
        rims = [k for k, links in enumerate(found) if len(links)]
        self.rolling = rims if rollers else []
        lowest = [min(self.links[k], key=lambda i: model.frames[i][0][2]) for k in self.rolling]
        self.axes = np.array([model.frames[i][1][:, 2] for i in lowest]).reshape(-1, 3)
        tyres = [k for k in range(len(model.feet)) if k not in rims]
        self.tyre_of = {joint[self.links[k][0]]: k for k in tyres}
        self.joint, self.friction = joint, friction
        self.shares = np.ones(len(model.feet))

    def update(self) -> None:
        """Before a step, as the last one was."""
        wanted = self.shares.copy()
        if self.rolling:
            _, attitude = self.bullet.getBasePositionAndOrientation(self.robot)
            turn = np.array(self.bullet.getMatrixFromQuaternion(attitude)).reshape(3, 3)
            first = np.array([0.0, -turn[2, 2], turn[1, 2]]) / math.hypot(turn[1, 2], turn[2, 2])
            share = np.abs(self.axes @ turn.T @ first)
            wanted[self.rolling] = 1.0 / (share + np.sqrt(np.maximum(1.0 - share**2, 0.0)))
        if self.tyre_of:
            for point in self.bullet.getContactPoints(bodyA=self.robot):
                wheel, forces = self.tyre_of.get(point[3]), (abs(point[10]), abs(point[12]))
                if wheel is not None and any(forces):
                    wanted[wheel] = max(forces) / math.hypot(*forces)
        for k in np.flatnonzero(np.abs(wanted - self.shares) > ERROR * wanted):
            self.shares[k] = wanted[k]
            for i in self.links[k]:
                grip = float(wanted[k]) * self.model.links[i].grip * self.friction
                self.bullet.changeDynamics(self.robot, self.joint[i], lateralFriction=grip)
