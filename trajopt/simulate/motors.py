"""What motors can give at the speed of their wheels: torque that falls with speed, in physics."""

from __future__ import annotations

import numpy as np

from trajopt.arrays import Array
from trajopt.simulate.model import Model

LEAST = 1e-6  # N m, chosen: what an engine holds with nothing at all it may leave out


class Motors:
    """Most torque of the driven wheels of a model. A motor that drives gives what its curve has at
    the wheel's speed, and nothing beyond the curve's end; one that brakes its full torque, or as
    much as its curve where that ``brakes`` too."""

    def __init__(self, model: Model) -> None:
        links = [s for s, driven in zip(model.spins, model.driven, strict=True) if driven]
        joints = [model.links[link].joint for link in links]
        self.full = np.array([joint.effort for joint in joints])
        self.curves = [
            (k, *np.array(joint.curve).T, joint.brakes)
            for k, joint in enumerate(joints)
            if joint.curve
        ]

    def most(self, speeds: Array, wanted: Array) -> Array:
        """(D,): N m, at ``speeds`` (D,) rad/s of wheels that shall turn as ``wanted`` (D,)."""
        found = self.full.copy()
        for k, places, torques, brakes in self.curves:
            if brakes or (wanted[k] - speeds[k]) * speeds[k] >= 0:
                there = np.interp(abs(speeds[k]), places, torques, right=0.0)
                found[k] = min(found[k], max(float(there), LEAST))
        return found
