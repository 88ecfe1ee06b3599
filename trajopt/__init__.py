"""trajopt plans, times and checks motions of wheeled ground robots as optimisation problems.

Everything public is reachable from here and is loaded when first used, so importing the package is
cheap.
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
    from trajopt.optimize.base import Budget, OptimizeResult, Status
    from trajopt.optimize.search import minimize
    from trajopt.paths.path import Path
    from trajopt.paths.segments import Arc, Clothoid, Straight
    from trajopt.pipeline import solve, validate
    from trajopt.problem import Problem, load_problem
    from trajopt.refine.jerk import limit_jerk
    from trajopt.refine.profile import follow
    from trajopt.robots.robot import Robot, robot, robot_names
    from trajopt.simulate.check import ValidationReport
    from trajopt.solution import Solution
    from trajopt.sweeps.sweeps import sweep
    from trajopt.timing.scaling import time_scale
    from trajopt.timing.states import State
    from trajopt.timing.trajectory import Trajectory
    from trajopt.world.terrain import Flat

__version__ = "0.1.0"

# public name -> the module it lives in
_HOME = {
    "Acceleration": "trajopt.limits.acceleration",
    "Arc": "trajopt.paths.segments",
    "ArgumentError": "trajopt.errors",
    "Budget": "trajopt.optimize.base",
    "Clothoid": "trajopt.paths.segments",
    "Flat": "trajopt.world.terrain",
    "InfeasibleError": "trajopt.errors",
    "MissingDependencyError": "trajopt.errors",
    "OptimizeResult": "trajopt.optimize.base",
    "Path": "trajopt.paths.path",
    "Problem": "trajopt.problem",
    "ProblemError": "trajopt.errors",
    "Robot": "trajopt.robots.robot",
    "SimulationError": "trajopt.errors",
    "Slip": "trajopt.limits.slip",
    "Solution": "trajopt.solution",
    "Speed": "trajopt.limits.speed",
    "SpeedZones": "trajopt.limits.speed_bound",
    "State": "trajopt.timing.states",
    "Status": "trajopt.optimize.base",
    "Straight": "trajopt.paths.segments",
    "Tip": "trajopt.limits.tip",
    "Trajectory": "trajopt.timing.trajectory",
    "TrajoptError": "trajopt.errors",
    "ValidationReport": "trajopt.simulate.check",
    "WheelAcceleration": "trajopt.limits.wheel_acceleration",
    "WheelSpeed": "trajopt.limits.wheel_speed",
    "YawRate": "trajopt.limits.yaw_rate",
    "follow": "trajopt.refine.profile",
    "limit_jerk": "trajopt.refine.jerk",
    "load_problem": "trajopt.problem",
    "minimize": "trajopt.optimize.search",
    "robot": "trajopt.robots.robot",
    "robot_names": "trajopt.robots.robot",
    "solve": "trajopt.pipeline",
    "sweep": "trajopt.sweeps.sweeps",
    "time_scale": "trajopt.timing.scaling",
    "validate": "trajopt.pipeline",
}

__all__ = [
    "Acceleration",
    "Arc",
    "ArgumentError",
    "Budget",
    "Clothoid",
    "Flat",
    "InfeasibleError",
    "MissingDependencyError",
    "OptimizeResult",
    "Path",
    "Problem",
    "ProblemError",
    "Robot",
    "SimulationError",
    "Slip",
    "Solution",
    "Speed",
    "SpeedZones",
    "State",
    "Status",
    "Straight",
    "Tip",
    "Trajectory",
    "TrajoptError",
    "ValidationReport",
    "WheelAcceleration",
    "WheelSpeed",
    "YawRate",
    "follow",
    "limit_jerk",
    "load_problem",
    "minimize",
    "robot",
    "robot_names",
    "solve",
    "sweep",
    "time_scale",
    "validate",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'trajopt' has no attribute '{name}'")
    return getattr(importlib.import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return [*_HOME, "__version__"]
