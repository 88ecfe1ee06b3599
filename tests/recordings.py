"""Made-up recordings of a four-wheeled robot, for tests of what reads them."""

from __future__ import annotations

from typing import Any

import numpy as np

from trajopt.simulate.engine import Recording


def made_up(times: np.ndarray, **known: Any) -> Recording:
    """Recording at ``times`` in which everything that is not ``known`` is zero."""
    flat, four, none = np.zeros(len(times)), np.zeros((len(times), 4)), np.zeros((len(times), 0))
    fields: dict[str, Any] = {
        "engine": "made-up", "version": "0.0", "times": times, "pose": np.zeros((len(times), 3)),
        "contacts": np.full(len(times), 4), "hits": (), "exploded": False, "reason": "",
        "wall_time": 1.25, "real_time_factor": 3.5, "picture": None, "angles": none,
        "swivels": none, "suspension": none, "sliding": np.zeros((len(times), 4, 2)),
    }  # fmt: skip
    fields |= dict.fromkeys(("height", "roll", "pitch", "speed"), flat)
    wheels = (
        "wheel_angles",
        "wheel_speeds",
        "wheel_torques",
        "wheel_heights",
        "loads",
        "slip",
        "spin_angles",
    )
    return Recording(**(fields | dict.fromkeys(wheels, four) | known))
