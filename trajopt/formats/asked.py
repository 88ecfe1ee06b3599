"""What a robot needs and its file does not say: asked for by name, all at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from trajopt.errors import ProblemError

_NEEDED = {  # key -> an example of what --set takes
    "body.mass": "20.0",
    "body.cog": "[0.0, 0.0, 0.1]",
    "body.chassis": "[0.5, 0.3, 0.2]",
    "body.chassis_place": "[0.1, 0.0]",
    "body.clearance": "0.05",
    "motors": '[{name="drive", wheels=["NAME"], torque=2.0}]',
    "skid.effective_track": "0.6",
    "radius": "0.1",
    "width": "0.04",
    "mass": "0.5",
    "torque": "2.0",
}


def require_all(
    tables: dict[str, Any], changes: Mapping[str, Any], places: Mapping[str, Any], file: Path
) -> None:
    """Raises ProblemError with all keys that a robot needs and that are not said; ``places``:
    where steered wheels beside their axis are."""
    body = ("mass", "cog", "chassis", "chassis_place", "clearance")
    missing = [f"body.{key}" for key in body if key not in tables["body"]]
    for array, keys in (("wheels", ("width", "mass", "position")), ("motors", ("torque",))):
        for key in keys:
            without = [element["name"] for element in tables[array] if not element.get(key)]
            missing += _keys(array, key, without, len(tables[array]))
    if not tables["motors"] and "motors" not in changes:
        missing.append("motors")
    if tables.get("skid") == {}:
        if {wheel["kind"] for wheel in tables["wheels"]} == {"fixed"}:
            missing.append("skid.effective_track")
        del tables["skid"]
    _require(missing, file, places)


def _keys(array: str, key: str, names: Sequence[str], count: int) -> list[str]:
    """Keys of elements; ``all`` for all of them."""
    every = len(names) == count > 1 and key != "position"
    return [f"{array}.{name}.{key}" for name in (["all"] if every else names)]


def require_radii(radii: Mapping[str, float | None], file: Path) -> dict[str, float]:
    """The radii, all of them. Raises ProblemError with the wheels whose radius is not said."""
    _require([f"wheels.{name}.radius" for name, radius in radii.items() if not radius], file)
    return {name: radius for name, radius in radii.items() if radius}


def _require(missing: Sequence[str], file: Path, places: Mapping[str, Any] | None = None) -> None:
    if not missing:
        return
    examples = {**_NEEDED, **(places or {})}
    told = [f"--set '{key}={examples.get(key) or examples[key.split('.')[-1]]}'" for key in missing]
    why = "what the file does not say, by " + " ".join(told)
    if "skid.effective_track" in missing:
        why += " (fixed wheels that forbid every turn slide: approximated by a track)"
    if any(key.endswith("position") for key in missing):
        why += " (steered wheels beside their axis: approximated by one through that place)"
    raise ProblemError(str(file), missing[0], "missing", why)
