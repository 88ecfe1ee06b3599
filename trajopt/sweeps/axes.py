"""What a sweep varies: axes of a sweep file, combined by product, zip and joint samples, as
columns.

``[axes."scene.friction"]`` holds one of ``values = [...]``, ``range = [from, to, count]``, ``log =
[from, to, count]``, or ``random = {...}`` with a distribution, ``count`` and ``seed``. Axes with
the same ``zip = "group"`` run in step; all others multiply. ``[sample]`` draws jointly (``method``
= "random", "latin-hypercube" or "sobol") over ``[sample.axes]`` and multiplies as one more axis.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, JsonValue, model_validator

from trajopt.arrays import AnyArray, Array
from trajopt.errors import ArgumentError
from trajopt.schema import Section, broken_rule
from trajopt.sweeps.cases import as_column
from trajopt.sweeps.expressions import evaluate, parse

MOST_CASES = 10_000_000  # beyond that the table itself takes gigabytes and minutes; chosen

Count = Annotated[int, Field(ge=1, le=MOST_CASES)]
Seed = Annotated[int, Field(ge=0, lt=2**63)]
Values = Annotated[tuple[JsonValue, ...], Field(min_length=1, max_length=MOST_CASES)]
Pair = tuple[float, float]


class Draw(Section):
    """A distribution, one of these: uniform = [low, high], log-uniform = [low, high], normal =
    [mean, deviation], choice = [...]."""

    uniform: Pair | None = None
    log_uniform: Pair | None = Field(None, alias="log-uniform")
    normal: Pair | None = None
    choice: Values | None = None

    @model_validator(mode="after")
    def _one(self) -> Self:
        if (self.uniform, self.log_uniform, self.normal, self.choice).count(None) != 3:
            raise broken_rule("", _given(self), "one of uniform, log-uniform, normal, choice")
        low, high = self.uniform or self.log_uniform or (0.0, 1.0)
        if not low < high or (self.log_uniform and not low > 0):
            raise broken_rule("", _given(self), "low < high, and low > 0 where it is logarithmic")
        if self.normal and not self.normal[1] > 0:
            raise broken_rule("normal", self.normal, "[mean, deviation] with a deviation > 0")
        return self

    def quantile(self, name: str, shares: Array) -> AnyArray:
        """Column of the values below which the given shares (n,) lie."""
        if self.choice:
            options = as_column(name, self.choice)
            return options[np.minimum((shares * len(options)).astype(np.int64), len(options) - 1)]
        if self.normal:
            from scipy.special import ndtri

            inner = np.clip(shares, 1e-12, 1 - 1e-12)
            return as_column(name, self.normal[0] + self.normal[1] * ndtri(inner))
        low, high = np.log(self.log_uniform) if self.log_uniform else self.uniform or (0.0, 1.0)
        with np.errstate(all="ignore"):  # what is beyond all numbers, the column refuses
            evenly = low + (high - low) * shares
            return as_column(name, np.exp(evenly) if self.log_uniform else evenly)


class Random(Draw):
    """Independent draws of one axis; the stream depends on ``seed`` and the axis' name."""

    count: Count
    seed: Seed


class Axis(Section):
    """Values of one name: one of ``values``, ``range``, ``log``, ``random``."""

    values: Values | None = None
    range: tuple[float, float, Count] | None = None
    log: tuple[float, float, Count] | None = None
    random: Random | None = None
    zip: str | None = None

    @model_validator(mode="after")
    def _one(self) -> Self:
        if (self.values, self.range, self.log, self.random).count(None) != 3:
            raise broken_rule("", _given(self), "one of values, range, log, random")
        if self.log and not min(self.log[:2]) > 0:
            raise broken_rule("log", self.log, "[from, to, count] with from and to > 0")
        return self

    def column(self, name: str) -> AnyArray:
        """Values (n,), for a table under ``name``. Raises ArgumentError for what no table holds."""
        if self.values:
            return as_column(f"axes.{name}", self.values)
        if self.random:
            digest = hashlib.blake2b(name.encode(), digest_size=8).digest()
            rng = np.random.default_rng([self.random.seed, int.from_bytes(digest, "little")])
            return self.random.quantile(f"axes.{name}", rng.random(self.random.count))
        with np.errstate(all="ignore"):
            evenly = (
                np.geomspace(*self.log) if self.log else np.linspace(*(self.range or (0, 0, 1)))
            )
        return as_column(f"axes.{name}", evenly)


class Sample(Section):
    """Joint draws over several names."""

    method: Literal["random", "latin-hypercube", "sobol"]
    count: Count
    seed: Seed
    axes: Annotated[dict[str, Draw], Field(min_length=1, max_length=1000)]

    def columns(self) -> dict[str, AnyArray]:
        """Values (n,) by name. Raises ArgumentError."""
        if self.count * len(self.axes) > MOST_CASES:
            raise ArgumentError("sample.count", self.count, f"at most {MOST_CASES} values in all")
        draws = _unit_draws(self.method, self.count, len(self.axes), self.seed)
        return {
            name: draw.quantile(f"sample.axes.{name}", draws[:, i])
            for i, (name, draw) in enumerate(self.axes.items())
        }


def combined(axes: Mapping[str, Axis], sample: Sample | None = None) -> dict[str, AnyArray]:
    """Columns of all combinations; the last axis varies fastest. Raises ArgumentError for a wrong
    axis."""
    groups: dict[str, dict[str, AnyArray]] = {}
    for name, axis in axes.items():
        key = f"axes.{name}" if axis.zip is None else f"zip {axis.zip}"
        groups.setdefault(key, {})[name] = axis.column(name)
    for key, columns in groups.items():
        if len({len(c) for c in columns.values()}) > 1:
            raise ArgumentError(
                key, {n: len(c) for n, c in columns.items()}, "zipped axes of equal length"
            )
    if sample:
        groups["sample"] = sample.columns()
    sizes = [len(next(iter(columns.values()))) for columns in groups.values()]
    total = math.prod(sizes) if sizes else 0
    if total > MOST_CASES:
        raise ArgumentError("axes", total, f"at most {MOST_CASES} cases")
    result: dict[str, AnyArray] = {}
    grid = np.unravel_index(np.arange(total), sizes) if sizes else ()
    for places, columns in zip(grid, groups.values(), strict=True):
        for name, column in columns.items():
            if name in result:
                raise ArgumentError(
                    f"axes.{name}", "given twice", "each name once, in axes or in sample.axes"
                )
            result[name] = column[places]
    return result


def with_derived(
    columns: dict[str, AnyArray], derived: Mapping[str, str], exclude: Sequence[str]
) -> dict[str, AnyArray]:
    """Columns with derived values (an expression a name) added and excluded cases (an expression
    each) removed. Raises ArgumentError, also for a name that another one starts with."""
    formulas = {name: parse(f"derived.{name}", text) for name, text in derived.items()}
    rules = [parse(f"exclude[{i}]", text) for i, text in enumerate(exclude)]
    if clash := set(formulas) & set(columns):
        raise ArgumentError("derived", sorted(clash), "names that are not axes")
    _check_names([*columns, *formulas])
    if not formulas and not rules:
        return columns
    names, lists = list(columns), [c.tolist() for c in columns.values()]
    made: dict[str, list[Any]] = {name: [] for name in formulas}
    kept = []
    for place, row in enumerate(zip(*lists, strict=True)):
        values = dict(zip(names, row, strict=True))
        for name, formula in formulas.items():
            values[name] = evaluate(formula, values)
        if any(evaluate(rule, values) for rule in rules):
            continue
        kept.append(place)
        for name in formulas:
            made[name].append(values[name])
    places = np.array(kept, dtype=np.int64)
    return {
        **{n: c[places] for n, c in columns.items()},
        **{n: as_column(f"derived.{n}", v) for n, v in made.items()},
    }


def _check_names(names: Sequence[str]) -> None:
    """Names must be told apart: ``a.b`` and the key b of a table ``a`` are the same key."""
    for name in names:
        if not name or not name.isprintable() or len(name) > 200:
            raise ArgumentError("axes", name, "a name of 1 to 200 printable characters")
        parts = name.split(".")
        for end in range(1, len(parts)):
            if (start := ".".join(parts[:end])) in names:
                raise ArgumentError(f"axes.{start}", name, "no name that another one starts with")


def _unit_draws(method: str, count: int, dimension: int, seed: int) -> Array:
    """(count, dimension) points in the open unit cube."""
    rng = np.random.default_rng(seed)
    if method == "random":
        return rng.random((count, dimension))
    from scipy.stats import qmc

    sampler = (
        qmc.LatinHypercube(dimension, rng=rng)
        if method == "latin-hypercube"
        else qmc.Sobol(dimension, rng=rng)
    )
    # Sobol points are balanced only in powers of two: draw up to the next one and keep the first.
    drawn = (
        sampler.random(count)
        if method == "latin-hypercube"
        else sampler.random_base2(max(0, math.ceil(math.log2(count))))[:count]
    )
    unit: Array = np.clip(np.asarray(drawn), 1e-12, 1 - 1e-12)
    return unit


def _given(section: Section) -> dict[str, Any]:
    return section.model_dump(exclude_none=True, by_alias=True)
