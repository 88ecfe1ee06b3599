"""trajopt plans, times and checks motions of wheeled ground robots as optimisation problems.

Everything public is reachable from here and is loaded when first used, so importing the package is cheap.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from trajopt.errors import (
        ArgumentError,
        InfeasibleError,
        MissingDependencyError,
        ProblemError,
        SimulationError,
        TrajoptError,
    )
    from trajopt.limits.acceleration import Acceleration
    from trajopt.limits.slip import Slip
    from trajopt.limits.speed import Speed
    from trajopt.limits.speed_bound import SpeedZones
    from trajopt.limits.tip import Tip
    from trajopt.limits.wheel_acceleration import WheelAcceleration
    from trajopt.limits.wheel_speed import WheelSpeed
    from trajopt.limits.yaw_rate import YawRate
    from trajopt.maneuver_problem import load_maneuver
    from trajopt.optimize.base import Budget, OptimizeResult, Status
    from trajopt.optimize.search import minimize
    from trajopt.path_problem import load_path_problem
    from trajopt.paths.path import Path
    from trajopt.pipeline import Solution, solve, time_path, validate
    from trajopt.problem import Problem, load_problem
    from trajopt.robots.loc8 import loc8
    from trajopt.robots.powerbot import powerbot
    from trajopt.simulate.check import ValidationReport
    from trajopt.timing.scaling import time_scale
    from trajopt.timing.trajectory import State, Trajectory
    from trajopt.world.terrain import Flat, Step

__version__ = "0.1.0"

# public name -> the module it lives in
_HOME = {
    "Acceleration": "trajopt.limits.acceleration",
    "Slip": "trajopt.limits.slip",
    "Speed": "trajopt.limits.speed",
    "SpeedZones": "trajopt.limits.speed_bound",
    "Tip": "trajopt.limits.tip",
    "WheelAcceleration": "trajopt.limits.wheel_acceleration",
    "WheelSpeed": "trajopt.limits.wheel_speed",
    "YawRate": "trajopt.limits.yaw_rate",
    "loc8": "trajopt.robots.loc8",
    "powerbot": "trajopt.robots.powerbot",
    "ArgumentError": "trajopt.errors",
    "Budget": "trajopt.optimize.base",
    "Flat": "trajopt.world.terrain",
    "InfeasibleError": "trajopt.errors",
    "MissingDependencyError": "trajopt.errors",
    "OptimizeResult": "trajopt.optimize.base",
    "Path": "trajopt.paths.path",
    "Problem": "trajopt.problem",
    "ProblemError": "trajopt.errors",
    "SimulationError": "trajopt.errors",
    "Solution": "trajopt.pipeline",
    "State": "trajopt.timing.trajectory",
    "Status": "trajopt.optimize.base",
    "Step": "trajopt.world.terrain",
    "Trajectory": "trajopt.timing.trajectory",
    "TrajoptError": "trajopt.errors",
    "ValidationReport": "trajopt.simulate.check",
    "load_maneuver": "trajopt.maneuver_problem",
    "load_path_problem": "trajopt.path_problem",
    "load_problem": "trajopt.problem",
    "minimize": "trajopt.optimize.search",
    "solve": "trajopt.pipeline",
    "time_path": "trajopt.pipeline",
    "time_scale": "trajopt.timing.scaling",
    "validate": "trajopt.pipeline",
}

__all__ = [
    "Acceleration",
    "ArgumentError",
    "Budget",
    "Flat",
    "InfeasibleError",
    "MissingDependencyError",
    "OptimizeResult",
    "Path",
    "Problem",
    "ProblemError",
    "SimulationError",
    "Slip",
    "Solution",
    "Speed",
    "SpeedZones",
    "State",
    "Status",
    "Step",
    "Tip",
    "Trajectory",
    "TrajoptError",
    "ValidationReport",
    "WheelAcceleration",
    "WheelSpeed",
    "YawRate",
    "load_maneuver",
    "load_path_problem",
    "load_problem",
    "loc8",
    "minimize",
    "powerbot",
    "solve",
    "time_path",
    "time_scale",
    "validate",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'trajopt' has no attribute '{name}'")
    return getattr(importlib.import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return [*_HOME, "__version__"]
