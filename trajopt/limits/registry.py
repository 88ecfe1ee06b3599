"""Limits by name: a new limit is one file and one line here."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from trajopt.limits.acceleration import Acceleration
from trajopt.limits.contact import Contact
from trajopt.limits.limit import Limit
from trajopt.limits.motor_curve import MotorCurve
from trajopt.limits.power import Power
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.limits.speed_bound import SpeedProfile, SpeedZones
from trajopt.limits.steering_acceleration import SteeringAcceleration
from trajopt.limits.steering_rate import SteeringRate
from trajopt.limits.tip import Tip
from trajopt.limits.wheel_acceleration import WheelAcceleration
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.limits.wheel_torque import WheelTorque
from trajopt.limits.yaw_rate import YawRate

LIMITS: Mapping[str, Callable[..., Limit]] = MappingProxyType(
    {
        "acceleration": Acceleration,
        "contact": Contact,
        "motor_curve": MotorCurve,
        "power": Power,
        "slip": Slip,
        "speed": Speed,
        "speed_profile": SpeedProfile,
        "speed_zones": SpeedZones,
        "steering_acceleration": SteeringAcceleration,
        "steering_rate": SteeringRate,
        "tip": Tip,
        "wheel_acceleration": WheelAcceleration,
        "wheel_speed": WheelSpeed,
        "wheel_torque": WheelTorque,
        "yaw_rate": YawRate,
    }
)
