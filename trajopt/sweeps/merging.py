"""Merging Arrow tables of a store's parts: one schema for all, one row a case, one array a name."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from trajopt.arrays import BoolArray
from trajopt.sweeps.rows import DONE, arrow


def united(tables: Sequence[Any]) -> Any:
    """All rows in one table; a column that a table lacks is null there, one of different kinds
    becomes text."""
    pa = arrow()
    try:
        return pa.concat_tables(tables, promote_options="permissive")
    except pa.ArrowTypeError:
        common = common_schema(t.schema for t in tables)
        return pa.concat_tables([conformed(t, common) for t in tables])


def common_schema(schemas: Iterable[Any]) -> Any:
    """Schema that rows of all the given ones fit into: whole numbers beside others widen, kinds
    that exclude each other become text."""
    pa = arrow()
    fields: dict[str, Any] = {}
    for schema in schemas:
        for field in schema:
            plain = pa.field(field.name, field.type)
            known = fields.setdefault(field.name, plain)
            if known.type != field.type:
                try:
                    merged = pa.unify_schemas(
                        [pa.schema([known]), pa.schema([plain])], promote_options="permissive"
                    )
                    fields[field.name] = merged.field(0)
                except (pa.ArrowTypeError, pa.ArrowInvalid):
                    fields[field.name] = pa.field(field.name, pa.string())
    return pa.schema(list(fields.values()))


def conformed(table: Any, schema: Any) -> Any:
    """The table with exactly the columns and types of ``schema``, which holds all of its
    columns."""
    pa = arrow()
    columns = []
    for field in schema:
        if field.name not in table.column_names:
            columns.append(pa.nulls(len(table), field.type))
        elif pa.types.is_string(field.type) and not pa.types.is_string(table[field.name].type):
            texts = [None if v is None else json.dumps(v) for v in table[field.name].to_pylist()]
            columns.append(pa.array(texts, pa.string()))
        else:
            columns.append(table[field.name].cast(field.type))
    return pa.table(columns, schema=schema)


def one_row_a_case(table: Any) -> Any:
    """Sorted by case; of several rows of a case one of the code that ran last: the finished one,
    else the latest."""
    if len(table) == 0:
        return table
    compute = arrow().compute
    if len(compute.unique(table["case_code"])) > 1:
        places, first = _first_of_cases(table, [])
        codes = table["case_code"].take(places).dictionary_encode().combine_chunks()
        numbers = codes.indices.to_numpy(zero_copy_only=False)
        last = numbers[first][np.cumsum(first) - 1]
        table = table.take(places.filter(arrow().array(numbers == last)))
    failed = compute.not_equal(table["status"], DONE)
    places, first = _first_of_cases(table, [("failed", failed)])
    return table.take(places.filter(arrow().array(first)))


def _first_of_cases(table: Any, keys: Sequence[tuple[str, Any]]) -> tuple[Any, BoolArray]:
    """Places of all rows sorted by case, ``keys``, and start from the last on, and which of them
    are the first of their case."""
    compute = arrow().compute
    sorted_by = {"case": table["case"], **dict(keys), "started": table["run_started"]}
    order = [(name, "descending" if name == "started" else "ascending") for name in sorted_by]
    places = compute.sort_indices(arrow().table(sorted_by), sort_keys=order)
    cases = table["case"].take(places).combine_chunks()
    first = np.ones(len(cases), dtype=bool)
    first[1:] = compute.not_equal(cases[1:], cases[:-1]).to_numpy(zero_copy_only=False)
    return places, first
