"""Problem files: what robot, from where to where, in what scene, within what limits.

A problem is a TOML file, read into frozen pydantic models that reject what they do not know.
Lengths are metres, angles radians, times seconds; axes are right-handed (x forward, y left, yaw
counter-clockwise).
"""

from __future__ import annotations

import difflib
import json
import math
import tomllib
from collections.abc import Mapping
from pathlib import Path as FilePath
from types import UnionType
from typing import Annotated, Any, Literal, Self, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from trajopt.errors import ProblemError
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.limit import Limit
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.limits.tip import Tip
from trajopt.limits.wheel_acceleration import WheelAcceleration
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.limits.yaw_rate import YawRate

WheelName = Literal["front-left", "front-right", "rear-left", "rear-right"]
WHEELS: tuple[WheelName, ...] = ("front-left", "front-right", "rear-left", "rear-right")
FreeVariable = Literal["p1", "p2", "heading", "duration"]

Model = TypeVar("Model", bound=BaseModel)
Pose = tuple[float, float, float]
Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Interval = tuple[float, float]
Wheels4 = tuple[float, float, float, float]

# Final wheel angles along any path obey theta1 + theta2 = theta3 + theta4 and the heading identity:
# two of the four are free, and for the diagonal pairs not even two (thesis 000; both are fixed by
# one turn).
FREE_ANGLES = 2
_SINGULAR_PAIRS = ({"front-left", "rear-right"}, {"front-right", "rear-left"})


class Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class RobotSection(Section):
    """Which robot moves."""

    name: Literal["loc8"] = Field("loc8", description="robot of the package")


class Start(Section):
    """Where the motion starts, at rest."""

    pose: Pose = Field(description="x, y, yaw: m, m, rad")
    wheels: Wheels4 = Field((0.0, 0.0, 0.0, 0.0), description="wheel angles FL, FR, RL, RR, rad")


class Goal(Section):
    """Where it ends: pose and wheel angles; only the critical wheels' angles count."""

    pose: Pose = Field(description="x, y, yaw: m, m, rad")
    wheels: Wheels4 = Field(description="wanted wheel angles FL, FR, RL, RR, rad")
    critical: tuple[WheelName, ...] = Field(
        description="one or two wheels whose final angle counts",
        min_length=1,
        json_schema_extra={"maxItems": FREE_ANGLES},
    )

    @property
    def critical_indices(self) -> tuple[int, ...]:
        """Positions of the critical wheels in per-wheel arrays (0 = front-left)."""
        return tuple(WHEELS.index(w) for w in self.critical)

    @model_validator(mode="after")
    def _independent(self) -> Self:
        if len(set(self.critical)) != len(self.critical):
            raise broken_rule("critical", list(self.critical), "each wheel once")
        if len(self.critical) > FREE_ANGLES:
            raise broken_rule(
                "critical",
                list(self.critical),
                "one or two wheels: pose and two of the final angles "
                "fix the other two (FL + FR = RL + RR, and FR - FL + RR - RL follows from the turn)",
            )
        if len(self.critical) == 2 and set(self.critical) in _SINGULAR_PAIRS:
            raise broken_rule(
                "critical",
                list(self.critical),
                "two wheels that are not diagonally opposite "
                "(diagonal wheels cannot be set independently)",
            )
        return self


class Space(Section):
    """Navigation space: where control points may lie."""

    x: Interval = Field(description="from, to, m")
    y: Interval = Field(description="from, to, m")

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        for axis in ("x", "y"):
            low, high = getattr(self, axis)
            if not low < high:
                raise broken_rule(axis, [low, high], "an interval [from, to] with from < to")
        return self

    def contains(self, x: float, y: float) -> bool:
        return self.x[0] <= x <= self.x[1] and self.y[0] <= y <= self.y[1]


class Spline(Section):
    """Natural cubic spline through start, P1, P2, goal; which of its control values are
    searched."""

    duration: Positive = Field(
        description="nominal duration, s: what a search through actuators assumes"
    )
    free: tuple[FreeVariable, ...] = Field(
        ("p2",), min_length=1, description="searched control values"
    )

    @model_validator(mode="after")
    def _once(self) -> Self:
        if len(set(self.free)) != len(self.free):
            raise broken_rule("free", list(self.free), "each name once")
        if set(self.free) == {"duration"}:
            raise broken_rule("free", list(self.free), "at least one of p1, p2, heading")
        return self


class ObjectiveSection(Section):
    """Terminal cost of thesis 000, Table 4.4, or the duration that time scaling needs."""

    kind: Literal["terminal", "duration"] = "terminal"
    pose_gains: tuple[NonNegative, NonNegative, NonNegative] = Field(
        (3.0, 0.125, 2.5), description="on |dx|, |dy| (1/m), |dyaw| (1/rad): Table 5.8"
    )
    wheel_gain: NonNegative = Field(
        12.5, description="on each critical wheel's deviation, 1/rad: Table 5.8"
    )
    wheel_period: Literal["2pi", "pi"] = Field(
        "2pi", description="2pi: the tables; pi: hubs half a turn apart"
    )
    wheel_tolerance: Positive = Field(1e-3, description="rad; a solution holds within it; chosen")
    pose_tolerance: Positive = Field(
        1e-3, description="m and rad; a solution holds within it; chosen"
    )

    @property
    def period(self) -> float:
        """Period of the wheel angle, rad."""
        return 2 * math.pi if self.wheel_period == "2pi" else math.pi


class ActuatorSection(Section):
    """Saturation and dead-zone of the wheel drives, for searches that predict through them."""

    enabled: bool = False
    saturation: Positive = Field(30.0, description="rad/s")
    dead_zone: NonNegative = Field(2.3, description="rad/s")

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.dead_zone >= self.saturation:
            raise broken_rule(
                "dead_zone", self.dead_zone, f"a speed below saturation = {self.saturation} rad/s"
            )
        return self


class Limits(Section):
    """Limits of time scaling; leave a key out to leave that limit out."""

    speed: Positive | None = Field(None, description="translational speed, m/s")
    yaw_rate: Positive | None = Field(None, description="rad/s")
    acceleration: Positive | None = Field(None, description="along the motion, m/s^2")
    deceleration: Positive | None = Field(
        None, description="braking along the motion, m/s^2, positive"
    )
    wheel_speed: Positive | None = Field(None, description="rad/s")
    wheel_acceleration: Positive | None = Field(None, description="rad/s^2")
    friction: Positive | None = Field(None, description="friction coefficient for the slip limit")
    tip: bool = Field(False, description="keep every wheel on the ground")

    @model_validator(mode="after")
    def _both_or_none(self) -> Self:
        if (self.acceleration is None) != (self.deceleration is None):
            raise broken_rule(
                "deceleration",
                self.deceleration,
                "acceleration and deceleration both given or both left out",
            )
        return self

    def as_limits(self) -> tuple[Limit, ...]:
        """The limits that are given, as time scaling takes them."""
        found: list[Limit] = []
        for name, make in (
            ("speed", Speed),
            ("yaw_rate", YawRate),
            ("wheel_speed", WheelSpeed),
            ("wheel_acceleration", WheelAcceleration),
            ("friction", Slip),
        ):
            value = getattr(self, name)
            if value is not None:
                found.append(make(value))
        if self.acceleration is not None and self.deceleration is not None:
            found.append(Acceleration(self.acceleration, self.deceleration))
        if self.tip:
            found.append(Tip())
        return tuple(found)


class Scene(Section):
    """What the robot meets at the goal."""

    obstacle_height: NonNegative = Field(0.0, description="step height, m (0: flat)")
    motion: Literal["forward", "lateral"] = Field("forward", description="how the obstacle is met")
    friction: Positive = Field(0.8, description="ground friction in the physics check")


class Problem(Section):
    """A whole problem. ``source`` is the file it came from; ``replace`` makes changed copies."""

    title: str
    robot: RobotSection = RobotSection()  # type: ignore[call-arg]
    start: Start
    goal: Goal
    space: Space
    spline: Spline
    objective: ObjectiveSection = ObjectiveSection()  # type: ignore[call-arg]
    actuator: ActuatorSection = ActuatorSection()  # type: ignore[call-arg]
    limits: Limits
    scene: Scene = Scene()  # type: ignore[call-arg]
    source: str = Field("<problem>", exclude=True, repr=False)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for name, pose in (("start", self.start.pose), ("goal", self.goal.pose)):
            if not self.space.contains(pose[0], pose[1]):
                raise broken_rule(
                    f"{name}.pose",
                    list(pose),
                    f"a position inside space x {list(self.space.x)}, y {list(self.space.y)}",
                )
        if math.dist(self.start.pose[:2], self.goal.pose[:2]) < 1e-6:
            raise broken_rule(
                "goal.pose", list(self.goal.pose), "a position different from start.pose"
            )
        if self.objective.kind == "duration" and self.actuator.enabled:
            raise broken_rule(
                "actuator.enabled",
                True,
                'false with objective.kind = "duration": a time-scaled '
                "motion keeps wheel speeds within limits, so no actuator saturates",
            )
        if self.objective.kind == "duration" and "duration" in self.spline.free:
            raise broken_rule(
                "spline.free", list(self.spline.free), "no duration: time scaling chooses it"
            )
        if "duration" in self.spline.free and not self.actuator.enabled:
            raise broken_rule(
                "spline.free",
                list(self.spline.free),
                "no duration without actuator.enabled = true: "
                "ideal wheels end at the same angles whatever the duration",
            )
        if not self.limits.as_limits():
            raise broken_rule("limits", {}, "at least one limit")
        return self

    def replace(self, changes: Mapping[str, Any] | None = None, /, **sections: Any) -> Problem:
        """Copy with changes, checked like a file.

        ``changes`` maps dotted keys to values ({"goal.wheels": [0, 0, 0, 0]}); keyword arguments
        name whole sections or parts of them (actuator={"enabled": True}). Raises ProblemError.
        """
        data = self.model_dump(mode="json", exclude_none=True)
        for key, value in (changes or {}).items():
            set_key(data, key.split("."), value, self.source)
        for name, value in sections.items():
            if "." in name:  # replace(**{"goal.wheels": ...})
                set_key(data, name.split("."), value, self.source)
            elif isinstance(value, Mapping) and isinstance(data.get(name), dict):
                data[name].update(value)
            else:
                data[name] = value
        return validated(Problem, data, self.source)


def broken_rule(key: str, value: Any, expected: str) -> PydanticCustomError:
    """A broken rule of this module; carried through pydantic to become a ProblemError."""
    return PydanticCustomError(
        "trajopt_rule", "{expected}", {"key": key, "given": value, "expected": expected}
    )


def load_problem(path: str | FilePath, overrides: Mapping[str, Any] | None = None) -> Problem:
    """Problem from a TOML file; ``overrides`` maps dotted keys to values.

    Raises ProblemError, in one line: file, key, value, and what would be right. Files with a table
    [path] or [obstacle] are of other kinds (``problem_kind``) and have loaders of their own.
    """
    data = read_tables(path, overrides)
    for kind, loader in OTHER_KINDS.items():
        if kind in data:
            expected = f"no such table in this kind of problem; read the file with {loader}"
            raise ProblemError(str(path), kind, "a table", expected)
    return validated(Problem, data, str(path))


# table that marks another kind of problem file -> the function that reads it
OTHER_KINDS = {
    "path": "trajopt.load_path_problem (command line: trajopt explain)",
    "obstacle": "trajopt.load_maneuver (command line: trajopt plan)",
}


def problem_kind(path: str | FilePath) -> str:
    """What a problem file asks for: "search" (control points), "path" (timing) or "obstacle" (a
    manoeuvre)."""
    tables = read_tables(path)
    return next((kind for kind in OTHER_KINDS if kind in tables), "search")


def read_tables(path: str | FilePath, overrides: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Tables of a TOML file with ``overrides`` (dotted keys) applied. Raises ProblemError."""
    try:
        data = tomllib.loads(FilePath(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ProblemError(
            str(path), "file", "missing", "an existing problem file (*.toml)"
        ) from None
    except (NotADirectoryError, PermissionError, TypeError) as error:
        raise ProblemError(
            str(path), "file", str(error), "a readable problem file (*.toml)"
        ) from None
    except IsADirectoryError:
        raise ProblemError(str(path), "file", "a directory", "a problem file (*.toml)") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ProblemError(str(path), "file", str(error), "valid TOML in UTF-8") from None
    for key, value in (overrides or {}).items():
        set_key(data, key.split("."), value, str(path))
    return data


def problem_schema() -> str:
    """JSON schema of problem files, for editors."""
    schema = Problem.model_json_schema()
    schema["properties"].pop("source", None)
    return json.dumps(schema, indent=2) + "\n"


def set_key(data: dict[str, Any], keys: list[str], value: Any, file: str) -> None:
    """Set a nested key, making tables on the way; unknown names are left to validation."""
    table: Any = data
    for depth, key in enumerate(keys[:-1]):
        table = table.setdefault(key, {})
        if not isinstance(table, dict):
            none = ".".join(keys[: depth + 1])
            raise ProblemError(file, ".".join(keys), value, f"a key below a table ({none} is none)")
    table[keys[-1]] = value


def validated(model: type[Model], data: dict[str, Any], file: str) -> Model:
    """``data`` as a model with its ``source`` set. Raises ProblemError in one line."""
    if "source" in data:
        raise ProblemError(file, "source", data["source"], "no such key: it is set by the loader")
    try:
        # Through JSON, because only there does strict mode take arrays for tuples.
        return model.model_validate_json(
            json.dumps({**data, "source": file}, default=_as_json), strict=True
        )
    except ValidationError as error:
        raise translated(error, file, model) from None


def translated(error: ValidationError, file: str, model: type[BaseModel]) -> ProblemError:
    """One line for the first finding, in the words of problem files."""
    first = error.errors()[0]
    place = [str(part) for part in first["loc"]]
    if first["type"] == "trajopt_rule":
        context = first["ctx"]
        return ProblemError(
            file, ".".join([*place, context["key"]]), context["given"], context["expected"]
        )
    key = _joined(first["loc"])
    if first["type"] == "extra_forbidden":
        known = _known_keys(place[:-1], model)
        near = difflib.get_close_matches(place[-1], known, n=1, cutoff=0.0)
        return ProblemError(file, key, first["input"], f"a known key; the nearest is '{near[0]}'")
    if first["type"] == "missing":
        return ProblemError(file, key, "missing", "this key to be given")
    message = first["msg"].removeprefix("Input should be ").replace("a valid array", "an array")
    message = message.replace("an object", "a table")  # what JSON calls an object
    if first["type"] == "too_long":
        message = (
            f"at most {first['ctx']['max_length']} values, not {first['ctx']['actual_length']}"
        )
    return ProblemError(file, key, first["input"], message[0].lower() + message[1:])


def _as_json(value: Any) -> Any:
    """NumPy values and sections as JSON; anything else as text, which validation then refuses."""
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json", exclude_none=True)
    return value.tolist() if hasattr(value, "tolist") else str(value)


def _joined(location: tuple[int | str, ...]) -> str:
    text = ""
    for part in location:
        text += f"[{part}]" if isinstance(part, int) else (f".{part}" if text else part)
    return text


def _known_keys(section: list[str], whole: type[BaseModel]) -> list[str]:
    model: Any = whole
    for name in section:
        if name.isdigit():  # an element of an array of tables
            continue
        model = model.model_fields[name].annotation
        model = get_args(model)[0] if get_origin(model) in (tuple, Union, UnionType) else model
    return [key for key in model.model_fields if key != "source"]
