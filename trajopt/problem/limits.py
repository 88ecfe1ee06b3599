"""The limits of a motion: what the problem asks for and what the robot's motors can do."""

from __future__ import annotations

from typing import Self

import numpy as np
from pydantic import Field, model_validator

from trajopt.arrays import Array
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.contact import Contact
from trajopt.limits.friction import Friction
from trajopt.limits.limit import Limit
from trajopt.limits.motor_curve import MotorCurve
from trajopt.limits.power import Power
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.limits.speed_bound import SpeedZones
from trajopt.limits.steering_acceleration import SteeringAcceleration
from trajopt.limits.steering_rate import SteeringRate
from trajopt.limits.tip import Tip
from trajopt.limits.torques import knows_torques
from trajopt.limits.wheel_acceleration import WheelAcceleration
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.limits.wheel_torque import WheelTorque
from trajopt.limits.yaw_rate import YawRate
from trajopt.problem.ground import scaled
from trajopt.robots.description import Sharing
from trajopt.robots.robot import Robot
from trajopt.schema import NonNegative, OneOrEach, Positive, Section, Share, broken_rule


class SpeedZoneSection(Section):
    """A stretch of the path with a speed of its own."""

    start: NonNegative = Field(description="path parameter, m")
    end: Positive = Field(description="path parameter, m")
    speed: Positive = Field(description="m/s")

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not self.start < self.end:
            raise broken_rule("end", self.end, f"a place after start = {self.start} m")
        return self


class LimitsSection(Section):
    """Limits of time scaling; leave a key out to leave that limit out."""

    speed: Positive | None = Field(None, description="translational speed, m/s")
    safety_speed: Positive | None = Field(None, description="to stop for obstacles, m/s")
    yaw_rate: Positive | None = Field(None, description="rad/s")
    wheel_speed: OneOrEach | None = Field(
        None, description="one, or one a wheel that rolls, rad/s; motors bound it too"
    )
    wheel_acceleration: OneOrEach | None = Field(
        None, description="one, or one a wheel that rolls, rad/s^2; motors bound it too"
    )
    steering_rate: OneOrEach | None = Field(
        None, description="one, or one a [[steering]] of the robot, rad/s; its own bounds it too"
    )
    steering_acceleration: OneOrEach | None = Field(
        None, description="one, or one a [[steering]] of the robot, rad/s^2; its own bounds it too"
    )
    speed_zones: tuple[SpeedZoneSection, ...] = Field((), description="of a given path")
    power: Positive | None = Field(None, description="of all motors together, mechanical, W")
    slip: bool = Field(False, description="stay within the ground's friction")
    slip_share: Share | None = Field(
        None, description="use only this share of the friction, with slip; absent: all of it"
    )
    slip_rule: Sharing | None = Field(
        None,
        description="how wheels share the force, with slip: least_norm, capacity or load; absent: as "
        "the robot's file says",
    )
    acceleration: Positive | None = Field(None, description="along the motion, m/s^2")
    deceleration: Positive | None = Field(
        None, description="braking along the motion, m/s^2, positive"
    )
    tip: bool = Field(False, description="keep the robot from tipping over")
    contact: float | None = Field(
        None,
        description="least load on every wheel, as a share of an even one; 0: none lifts",
        ge=0,
        lt=1,
    )
    clearance: Positive | None = Field(
        None, description="least distance of the outline from what it keeps out of, m; absent: none"
    )
    variant: str | None = Field(
        None, description="other formulas for slip and tip, by name: thesis (004)"
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if (self.acceleration is None) != (self.deceleration is None):
            raise broken_rule(
                "deceleration",
                self.deceleration,
                "acceleration and deceleration both given or both left out",
            )
        if self.slip_share is not None and not self.slip:
            raise broken_rule("slip_share", self.slip_share, "slip = true with it")
        if self.slip_rule is not None and (not self.slip or self.variant is not None):
            raise broken_rule("slip_rule", self.slip_rule, "slip = true with it, and no variant")
        if self.variant is not None and not (self.slip or self.tip):
            raise broken_rule("variant", self.variant, "slip or tip, whose formulas it changes")
        return self

    def limits(self, robot: Robot, friction: Friction) -> tuple[Limit, ...]:
        """The limits that are given and those of the motors, as time scaling takes them, without a
        variant's. Torque alone is none: nothing then bounds the speed."""
        found: list[Limit] = []
        if self.speed is not None:
            found.append(Speed(self.speed))
        if self.safety_speed is not None:
            found.append(Speed(self.safety_speed, name="safety_speed"))
        if self.yaw_rate is not None:
            found.append(YawRate(self.yaw_rate))
        speed = each_wheel(self.wheel_speed, robot, "speed")
        if speed is not None:
            found.append(WheelSpeed(speed))
        rate = each_wheel(self.wheel_acceleration, robot, "acceleration")
        if rate is not None:
            found.append(WheelAcceleration(rate))
        found += self._motors(robot)
        turn = each_steering(self.steering_rate, robot, "rate")
        if turn is not None:
            found.append(SteeringRate(turn))
        bend = each_steering(self.steering_acceleration, robot, "acceleration")
        if bend is not None:
            found.append(SteeringAcceleration(bend))
        if self.speed_zones:
            zones = tuple((zone.start, zone.end, zone.speed) for zone in self.speed_zones)
            found.append(SpeedZones(zones))
        if self.slip and self.variant is None:
            found.append(Slip(scaled(friction, self.share), rule=self.slip_rule))
        if self.acceleration is not None and self.deceleration is not None:
            found.append(Acceleration(self.acceleration, self.deceleration))
        if self.tip and self.variant is None:
            found.append(Tip())
        if self.contact is not None:
            found.append(Contact(self.contact))
        return () if found == [WheelTorque()] else tuple(found)

    def _motors(self, robot: Robot) -> list[Limit]:
        """What torques bound, where they are known; a power is refused where they are not."""
        found: list[Limit] = []
        if knows_torques(robot):
            found.append(WheelTorque())
            if any(motor.curve is not None for motor in robot.description.motors):
                found.append(MotorCurve())
        if self.power is not None:
            if not found:
                expected = "a robot with motors and wheels that roll"
                raise broken_rule("limits.power", self.power, expected)
            found.append(Power(self.power))
        return found

    @property
    def share(self) -> float:
        """Of the friction, that the slip limit may use."""
        return 1.0 if self.slip_share is None else self.slip_share


def each_wheel(
    asked: float | tuple[float, ...] | None, robot: Robot, motors: str
) -> float | tuple[float, ...] | None:
    """The lesser of what is asked and what the motors can do, None where nothing bounds."""
    names = robot.wheel_names
    return _lesser(f"wheel_{motors}", asked, robot.motor_array(motors), names, "a wheel")


def each_steering(
    asked: float | tuple[float, ...] | None, robot: Robot, key: str
) -> float | tuple[float, ...] | None:
    """The lesser of what is asked and the ``key`` of every [[steering]], None where nothing
    bounds."""
    groups = robot.description.steering
    if asked is not None and not groups:
        raise broken_rule(f"limits.steering_{key}", asked, f"none: '{robot.name}' does not steer")
    own = np.array([getattr(group, key) or np.inf for group in groups])
    names = tuple(group.name for group in groups)
    return _lesser(f"steering_{key}", asked, own, names, "a [[steering]]")


def _lesser(
    key: str, asked: float | tuple[float, ...] | None, own: Array, names: tuple[str, ...], each: str
) -> float | tuple[float, ...] | None:
    """One number where all are equal. Raises the broken rule for another number of values."""
    if isinstance(asked, tuple) and len(asked) != len(own):
        expected = f"one value, or {len(own)}: one {each} ({', '.join(names)})"
        raise broken_rule(f"limits.{key}", list(asked), expected)
    bound = np.minimum(np.inf if asked is None else asked, own)
    if not np.isfinite(bound).any():
        return None
    values = tuple(bound.tolist())
    return values[0] if len(set(values)) == 1 else values
