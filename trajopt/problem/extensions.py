"""Sections of systems: which module reads and solves them, loaded when a problem has one.

Such a module offers ``SCHEMAS`` (section -> model), and those of these that it needs:
``check(problem)`` raises the broken rule; ``variant_limits(problem)`` are the limits of a
``limits.variant``; ``solve(problem, **options)`` does the job of the section; ``details(solution)``
are what it adds to the solution of another job (``pipeline.Details``).
"""

from __future__ import annotations

import importlib
import json
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, Any

from pydantic import BaseModel, GetCoreSchemaHandler, GetJsonSchemaHandler, ValidationError
from pydantic_core import CoreSchema, core_schema

from trajopt.schema import broken_rule, translated

SECTIONS = MappingProxyType(
    {
        "climb": "trajopt.systems.smdw.entry",
        "encounters": "trajopt.systems.powerbot.entry",
        "printed": "trajopt.systems.powerbot.entry",
    }
)
VARIANTS = MappingProxyType({"thesis": "trajopt.systems.powerbot.entry"})  # of limits


def entry(section: str) -> Any:
    """The module of a section."""
    return importlib.import_module(SECTIONS[section])


def variant_entry(name: str) -> Any:
    """The module of a variant of limits. Raises the broken rule for an unknown one."""
    if name not in VARIANTS:
        raise broken_rule("limits.variant", name, "one of " + ", ".join(VARIANTS))
    return importlib.import_module(VARIANTS[name])


@dataclass(frozen=True)
class _ReadBy:
    """Has a field read by its section's model, or an array of tables by it one by one."""

    section: str
    many: bool = False

    @property
    def model(self) -> type[BaseModel]:
        found: type[BaseModel] = entry(self.section).SCHEMAS[self.section]
        return found

    def __get_pydantic_core_schema__(self, _: Any, __: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self._read)

    def __get_pydantic_json_schema__(self, _: CoreSchema, __: GetJsonSchemaHandler) -> Any:
        schema = self.model.model_json_schema()
        return {"type": "array", "items": schema} if self.many else schema

    def _read(self, value: Any) -> Any:
        if value is None:
            return None
        if not self.many:
            return self._one(value, "")
        if not isinstance(value, list):
            raise broken_rule("", value, "an array of tables")
        return tuple(self._one(element, f"[{i}].") for i, element in enumerate(value))

    def _one(self, value: Any, place: str) -> Any:
        try:
            return self.model.model_validate_json(json.dumps(value), strict=True)
        except ValidationError as error:
            found = translated(error, "", self.model)
            raise broken_rule(place + found.key, found.value, found.expected) from None


Climb = Annotated[Any, _ReadBy("climb")]
Encounters = Annotated[Any, _ReadBy("encounters", many=True)]
Printed = Annotated[Any, _ReadBy("printed")]
