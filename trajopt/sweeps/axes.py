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
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from trajopt.arrays import AnyArray, Array
from trajopt.errors import ArgumentError
from trajopt.sweeps.cases import as_column
from trajopt.sweeps.expressions import evaluate, parse

MOST_CASES = 100_000_000  # beyond that the table itself does not fit a machine; chosen

_KINDS = ("values", "range", "log", "random")
_METHODS = ("random", "latin-hypercube", "sobol")


def combined(
    axes: Mapping[str, Mapping[str, Any]], sample: Mapping[str, Any] | None = None
) -> dict[str, AnyArray]:
    """Columns of all combinations; the last axis varies fastest. Raises ArgumentError for a wrong
    axis."""
    groups: dict[str, dict[str, AnyArray]] = {}
    for name, axis in axes.items():
        group = axis.get("zip")
        groups.setdefault(f"zip {group}" if group is not None else f"axis {name}", {})[name] = (
            axis_values(name, axis)
        )
    for key, columns in groups.items():
        if len({len(c) for c in columns.values()}) > 1:
            raise ArgumentError(
                key, {n: len(c) for n, c in columns.items()}, "zipped axes of equal length"
            )
    if sample:
        groups["sample"] = _joint(sample)
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


def axis_values(name: str, axis: Mapping[str, Any]) -> AnyArray:
    """Values (n,) of one axis."""
    where = f"axes.{name}"
    given = [kind for kind in _KINDS if kind in axis]
    unknown = set(axis) - {*_KINDS, "zip"}
    if unknown or len(given) != 1:
        raise ArgumentError(
            where, dict(axis), "one of values, range, log, random (and zip, where wanted)"
        )
    if given[0] == "random":
        return _independent(name, axis["random"])
    values = axis[given[0]]
    if given[0] == "values":
        if not isinstance(values, Sequence) or isinstance(values, str) or not values:
            raise ArgumentError(where, values, "a list with at least one value")
        return as_column(where, values)
    if (
        not isinstance(values, Sequence)
        or len(values) != 3
        or isinstance(values[2], bool)
        or not isinstance(values[2], int)
        or values[2] < 1
    ):
        raise ArgumentError(where, values, "[from, to, count] with a whole count >= 1")
    low, high, count = values
    if given[0] == "range":
        evenly: AnyArray = np.linspace(low, high, count)
        return as_column(where, evenly)
    if not (low > 0 and high > 0):
        raise ArgumentError(where, values, "[from, to, count] with from and to > 0")
    return as_column(where, np.geomspace(low, high, count))


def with_derived(
    columns: dict[str, AnyArray], derived: Mapping[str, str], exclude: Sequence[str]
) -> dict[str, AnyArray]:
    """Columns with derived values (an expression a name) added and excluded cases (an expression
    each) removed."""
    if not derived and not exclude:
        return columns
    formulas = {name: parse(str(text)) for name, text in derived.items()}
    rules = [parse(text) for text in exclude]
    clash = set(formulas) & set(columns)
    if clash:
        raise ArgumentError("derived", sorted(clash), "names that are not axes")
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
        **{n: as_column(n, v) for n, v in made.items()},
    }


def _independent(name: str, spec: Mapping[str, Any]) -> AnyArray:
    """Random draws of one axis; the stream depends on the seed and the axis' name."""
    seed, count = spec.get("seed"), spec.get("count")
    if not _whole(seed, 0) or not _whole(count, 1):
        raise ArgumentError(
            f"axes.{name}.random", dict(spec), "a whole seed >= 0 and a whole count >= 1"
        )
    digest = hashlib.blake2b(name.encode(), digest_size=8).digest()
    rng = np.random.default_rng([int(seed), int.from_bytes(digest, "little")])  # type: ignore[arg-type]
    draws: AnyArray = rng.random((int(count),))  # type: ignore[arg-type]
    shape = {k: v for k, v in spec.items() if k not in ("seed", "count")}
    return as_column(name, _quantile(f"axes.{name}.random", shape)(draws))


def _joint(sample: Mapping[str, Any]) -> dict[str, AnyArray]:
    unknown = set(sample) - {"method", "count", "seed", "axes"}
    method, count, seed, axes = (sample.get(k) for k in ("method", "count", "seed", "axes"))
    if unknown or method not in _METHODS or not _whole(count, 1) or not _whole(seed, 0) or not axes:
        raise ArgumentError(
            "sample", dict(sample), f"method ({', '.join(_METHODS)}), count, seed and axes"
        )
    assert isinstance(axes, Mapping)
    draws = _unit_draws(str(method), int(count), len(axes), int(seed))  # type: ignore[arg-type]
    return {
        name: as_column(name, _quantile(f"sample.axes.{name}", spec)(draws[:, i]))
        for i, (name, spec) in enumerate(axes.items())
    }


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


def _quantile(where: str, spec: Mapping[str, Any]) -> Callable[[AnyArray], AnyArray]:
    """Inverse distribution: uniform = [low, high], log-uniform, normal = [mean, deviation], choice
    = [...]."""
    if len(spec) != 1:
        raise ArgumentError(where, dict(spec), "one of uniform, log-uniform, normal, choice")
    ((kind, values),) = spec.items()
    if kind == "choice" and isinstance(values, list) and values:
        options = as_column(where, values)
        return lambda u: options[np.minimum((u * len(options)).astype(np.int64), len(options) - 1)]
    if not isinstance(values, list) or len(values) != 2:
        raise ArgumentError(where, dict(spec), "two numbers: [low, high] or [mean, deviation]")
    a, b = float(values[0]), float(values[1])
    if kind == "uniform" and a < b:
        return lambda u: a + (b - a) * u
    if kind == "log-uniform" and 0 < a < b:
        return lambda u: np.exp(np.log(a) + (np.log(b) - np.log(a)) * u)
    if kind == "normal" and b > 0:
        from scipy.special import ndtri

        return lambda u: a + b * ndtri(np.clip(u, 1e-12, 1 - 1e-12))
    raise ArgumentError(
        where,
        dict(spec),
        "uniform or log-uniform with low < high, normal with deviation > 0, or choice with a list",
    )


def _whole(value: Any, least: int) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= least
