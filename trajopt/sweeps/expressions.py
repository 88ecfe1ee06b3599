"""Arithmetic in sweep files, for derived values and exclusions, without running code.

Names may have dots (``scene.friction``). Known: numbers, texts, lists, + - * / // % **,
comparisons, and, or, not, ``a if c else b``, and the functions and constants below. Arithmetic is
for numbers only, whole ones stay within 64 bits, and an expression is short: whatever a file says,
a value takes microseconds and little memory.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from trajopt.errors import ArgumentError

LONGEST, MOST_NODES, DEEPEST = 2_000, 500, 40  # characters, parts and levels; chosen
_LARGEST = 2**63


def _power(a: float, b: float) -> float:
    if isinstance(a, int) and isinstance(b, int) and abs(a) > 1 and b > 63:
        raise OverflowError("a whole number of more than 64 bits")
    return a**b  # type: ignore[no-any-return]


def _rounded(value: float, digits: int = 0) -> float:
    if not (isinstance(digits, int) and abs(digits) <= 15):
        raise ValueError("digits from -15 to 15")
    return round(value, digits) if digits else round(value)


FUNCTIONS: dict[str, Callable[..., Any]] = {
    "abs": abs,
    "min": min,
    "max": max,
    "round": _rounded,
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
_ARITHMETIC: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: _power,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
_COMPARE: dict[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}


class Expression:
    """An expression and the ``key`` of the file that it stands under."""

    def __init__(self, key: str, text: str, tree: ast.expr) -> None:
        self.key, self.text, self.tree = key, text, tree

    @property
    def names(self) -> set[str]:
        """Names that stand in it."""
        kinds = (ast.Name, ast.Attribute)
        return {ast.unparse(n) for n in ast.walk(self.tree) if isinstance(n, kinds)}


def parse(key: str, text: str) -> Expression:
    """An expression, read. Raises ArgumentError, naming ``key``, where it is none or too large."""
    if len(text) > LONGEST:
        raise ArgumentError(key, text, f"at most {LONGEST} characters")
    try:
        tree = ast.parse(text, mode="eval").body
    except SyntaxError as error:
        raise ArgumentError(
            key, text, f"arithmetic such as '2 * scene.friction' ({error.msg})"
        ) from None
    except (ValueError, RecursionError, MemoryError):  # NUL; nested too deep for the parser
        raise ArgumentError(key, text, "arithmetic such as '2 * scene.friction'") from None
    level: list[ast.AST] = [tree]
    nodes = depth = 0
    while level:
        nodes, depth = nodes + len(level), depth + 1
        if nodes > MOST_NODES or depth > DEEPEST:
            raise ArgumentError(key, text, f"at most {MOST_NODES} parts, {DEEPEST} levels deep")
        level = [child for node in level for child in ast.iter_child_nodes(node)]
    return Expression(key, text, tree)


def evaluate(expression: Expression, values: Mapping[str, Any]) -> Any:
    """Value of an expression where ``values`` are its names. Raises ArgumentError for what is not
    known."""
    try:
        return _value(expression.tree, values)
    except (TypeError, ValueError, ArithmeticError) as error:
        raise ArgumentError(
            expression.key, expression.text, f"values it can work on ({error})"
        ) from None


def _value(tree: ast.expr, values: Mapping[str, Any]) -> Any:
    match tree:
        case ast.Constant(value=bool() | int() | float() | str() as constant):
            return constant if isinstance(constant, str) else _number(constant)
        case ast.Name() | ast.Attribute():
            return _named(tree, values)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _ARITHMETIC:
            sides = (_number(_value(left, values)), _number(_value(right, values)))
            return _number(_ARITHMETIC[type(op)](*sides))
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return not _value(operand, values)
        case ast.UnaryOp(op=unary, operand=operand) if type(unary) in _ARITHMETIC:
            return _number(_ARITHMETIC[type(unary)](_number(_value(operand, values))))
        case ast.BoolOp(op=ast.And(), values=parts):
            return all(_value(p, values) for p in parts)
        case ast.BoolOp(op=ast.Or(), values=parts):
            return any(_value(p, values) for p in parts)
        case ast.Compare(left=left, ops=ops, comparators=rights) if all(
            type(o) in _COMPARE for o in ops
        ):
            sides = tuple(_value(s, values) for s in (left, *rights))
            return all(
                _COMPARE[type(o)](a, b) for o, a, b in zip(ops, sides[:-1], sides[1:], strict=True)
            )
        case ast.IfExp(test=test, body=body, orelse=other):
            return _value(body if _value(test, values) else other, values)
        case ast.List(elts=items) | ast.Tuple(elts=items):
            return [_value(i, values) for i in items]
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in FUNCTIONS:
            given = [_value(a, values) for a in arguments]
            return _number(FUNCTIONS[name](*_numbers(given)))
    raise ValueError(
        f"'{ast.unparse(tree)[:60]}' is none of numbers, names, arithmetic, comparisons and "
        + ", ".join(FUNCTIONS)
    )


def _numbers(given: list[Any]) -> Iterator[Any]:
    """Arguments of a function: numbers, or one list of them, as min and max take."""
    for value in given:
        yield list(_numbers(value)) if isinstance(value, list) else _number(value)


def _number(value: Any) -> Any:
    """A finite number, whole ones within 64 bits. Raises TypeError, OverflowError."""
    if not isinstance(value, (bool, int, float)):
        raise TypeError(f"{str(value)[:60]!r} is no number")
    if not (-_LARGEST <= value < _LARGEST if isinstance(value, int) else math.isfinite(value)):
        raise OverflowError("a finite number, or a whole one within 64 bits, is expected")
    return value


def _named(tree: ast.expr, values: Mapping[str, Any]) -> Any:
    name = tree.id if isinstance(tree, ast.Name) else ast.unparse(tree)
    if name in values:
        return values[name]
    if name in CONSTANTS:
        return CONSTANTS[name]
    raise ValueError(f"'{name[:60]}' is none of the names {', '.join(values)}")
