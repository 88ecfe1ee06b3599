"""Arithmetic in sweep files, for derived values and exclusions, without running code.

Names may have dots (``scene.friction``). Known: numbers, texts, lists, + - * / // % **,
comparisons, and, or, not, ``a if c else b``, and the functions and constants below.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from typing import Any

from trajopt.errors import ArgumentError

FUNCTIONS: dict[str, Callable[..., Any]] = {
    "abs": abs,
    "min": min,
    "max": max,
    "round": round,
    "sqrt": math.sqrt,
    "exp": math.exp,
    "log": math.log,
    "sin": math.sin,
    "cos": math.cos,
    "tan": math.tan,
    "atan2": math.atan2,
    "hypot": math.hypot,
    "floor": math.floor,
    "ceil": math.ceil,
}
CONSTANTS: dict[str, float] = {"pi": math.pi}
_BINARY: dict[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
}
_COMPARE: dict[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
_UNARY: dict[type[ast.AST], Callable[[Any], Any]] = {
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
    ast.Not: operator.not_,
}


def parse(text: str) -> ast.expr:
    """Syntax tree of an expression. Raises ArgumentError where it is none."""
    try:
        return ast.parse(text, mode="eval").body
    except SyntaxError as error:
        raise ArgumentError(
            "expression", text, f"arithmetic such as '2 * scene.friction' ({error.msg})"
        ) from None


def evaluate(tree: ast.expr, values: Mapping[str, Any]) -> Any:
    """Value of an expression where ``values`` are its names. Raises ArgumentError for what is not
    known."""
    try:
        return _value(tree, values)
    except (TypeError, ValueError, ArithmeticError, RecursionError) as error:
        if isinstance(error, ArgumentError):
            raise
        raise ArgumentError(
            "expression", ast.unparse(tree), f"values it can work on ({error})"
        ) from None


def _value(tree: ast.expr, values: Mapping[str, Any]) -> Any:
    match tree:
        case ast.Constant(value=bool() | int() | float() | str() as constant):
            return constant
        case ast.Name() | ast.Attribute():
            return _named(tree, values)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
            return _BINARY[type(op)](_value(left, values), _value(right, values))
        case ast.UnaryOp(op=unary, operand=operand) if type(unary) in _UNARY:
            return _UNARY[type(unary)](_value(operand, values))
        case ast.BoolOp(op=ast.And(), values=parts):
            return all(_value(p, values) for p in parts)
        case ast.BoolOp(op=ast.Or(), values=parts):
            return any(_value(p, values) for p in parts)
        case ast.Compare(left=left, ops=ops, comparators=rights) if all(
            type(o) in _COMPARE for o in ops
        ):
            sides = [_value(s, values) for s in (left, *rights)]
            return all(
                _COMPARE[type(o)](a, b) for o, a, b in zip(ops, sides[:-1], sides[1:], strict=True)
            )
        case ast.IfExp(test=test, body=body, orelse=other):
            return _value(body if _value(test, values) else other, values)
        case ast.List(elts=items) | ast.Tuple(elts=items):
            return [_value(i, values) for i in items]
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in FUNCTIONS:
            return FUNCTIONS[name](*(_value(a, values) for a in arguments))
    raise ArgumentError(
        "expression",
        ast.unparse(tree),
        "numbers, names, arithmetic, comparisons and " + ", ".join(FUNCTIONS),
    )


def _named(tree: ast.expr, values: Mapping[str, Any]) -> Any:
    name = ast.unparse(tree)
    if name in values:
        return values[name]
    if name in CONSTANTS:
        return CONSTANTS[name]
    raise ArgumentError("expression", name, "a name of this sweep: " + ", ".join(values))
