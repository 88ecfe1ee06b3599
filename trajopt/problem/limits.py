"""The limits of a motion: what the problem asks for and what the robot's motors can do."""

from __future__ import annotations

from typing import Self

import numpy as np
from pydantic import Field, model_validator

from trajopt.limits.acceleration import Acceleration
from trajopt.limits.limit import Limit
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.limits.tip import Tip
from trajopt.limits.wheel_acceleration import WheelAcceleration
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.limits.yaw_rate import YawRate
from trajopt.robots.robot import Robot
from trajopt.schema import Positive, Section, Share, broken_rule

EachWheel = Positive | tuple[Positive, ...]


class LimitsSection(Section):
    """Limits of time scaling; leave a key out to leave that limit out."""

    speed: Positive | None = Field(None, description="translational speed, m/s")
    safety_speed: Positive | None = Field(None, description="to stop for obstacles, m/s")
    yaw_rate: Positive | None = Field(None, description="rad/s")
    wheel_speed: EachWheel | None = Field(
        None, description="one, or one a wheel that rolls, rad/s; motors bound it too"
    )
    wheel_acceleration: EachWheel | None = Field(
        None, description="one, or one a wheel that rolls, rad/s^2; motors bound it too"
    )
    slip: bool = Field(False, description="stay within the ground's friction")
    slip_share: Share | None = Field(
        None, description="use only this share of the friction, with slip; absent: all of it"
    )
    acceleration: Positive | None = Field(None, description="along the motion, m/s^2")
    deceleration: Positive | None = Field(
        None, description="braking along the motion, m/s^2, positive"
    )
    tip: bool = Field(False, description="keep every wheel on the ground")
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
        if self.variant is not None and not (self.slip or self.tip):
            raise broken_rule("variant", self.variant, "slip or tip, whose formulas it changes")
        return self

    def limits(self, robot: Robot, friction: float) -> tuple[Limit, ...]:
        """The limits that are given, as time scaling takes them, without a variant's."""
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
        if self.slip and self.variant is None:
            found.append(Slip(self.friction(friction)))
        if self.acceleration is not None and self.deceleration is not None:
            found.append(Acceleration(self.acceleration, self.deceleration))
        if self.tip and self.variant is None:
            found.append(Tip())
        return tuple(found)

    def friction(self, friction: float) -> float:
        """The coefficient that the slip limit may use."""
        return friction * (1.0 if self.slip_share is None else self.slip_share)


def each_wheel(
    asked: float | tuple[float, ...] | None, robot: Robot, motors: str
) -> float | tuple[float, ...] | None:
    """The lesser of what is asked and what the motors can do: one number where all are equal, None
    where nothing bounds. Raises the broken rule for another number of values than wheels."""
    count = len(robot.wheels)
    if isinstance(asked, tuple) and len(asked) != count:
        expected = f"one value, or {count}: one a wheel ({', '.join(robot.wheel_names)})"
        raise broken_rule(f"limits.wheel_{motors}", list(asked), expected)
    bound = np.minimum(np.inf if asked is None else asked, robot.motor_array(motors))
    if not np.isfinite(bound).any():
        return None
    values = tuple(bound.tolist())
    return values[0] if len(set(values)) == 1 else values
