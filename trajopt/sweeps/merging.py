"""Merging Arrow tables of a store's parts: one schema for all, one row a case, one array a name."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

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
    """Sorted by case; of several rows of a case the finished one, else the latest."""
    if len(table) == 0:
        return table
    compute = arrow().compute
    keys = arrow().table(
        {"case": table["case"], "failed": compute.not_equal(table["status"], DONE)}
    )
    order = [("case", "ascending"), ("failed", "ascending")]
    if "run_started" in table.column_names:
        keys = keys.append_column("started", table["run_started"])
        order.append(("started", "descending"))
    places = compute.sort_indices(keys, sort_keys=order)
    cases = keys["case"].take(places).combine_chunks()
    first = np.ones(len(cases), dtype=bool)
    first[1:] = compute.not_equal(cases[1:], cases[:-1]).to_numpy(zero_copy_only=False)
    return table.take(places.filter(arrow().array(first)))


def one_array_a_name(table: Any) -> Any:
    """Sorted by case and name; of several arrays of a name the last."""
    frame = table.select(["case", "name"]).to_pandas()
    kept = np.flatnonzero(~frame.duplicated(keep="last").to_numpy())
    return table.take(arrow().array(kept)).sort_by([("case", "ascending"), ("name", "ascending")])
