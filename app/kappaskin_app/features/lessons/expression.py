"""Expressions of named figures, parsed and evaluated without running code."""

import ast
import math
import operator
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from kappaskin.errors import Refusal

LONGEST = 200  # letters of an expression
NUMBER, WORD, TRUTH = "a number", "a word", "yes or no"

Figures = Mapping[str, float | str]
_Operation = Callable[[Any, Any], Any]

_ARITHMETIC: dict[type[ast.operator], _Operation] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: lambda a, b: a / b if b else math.nan,
}
_COMPARED: dict[type[ast.cmpop], _Operation] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
_ORDER = (ast.Lt, ast.LtE, ast.Gt, ast.GtE)


@dataclass(frozen=True)
class Expression:
    """A parsed expression of figures: numbers, + - * /, comparisons, `and`, `or`, `not`."""

    text: str
    kind: str
    _tree: ast.expr

    def __call__(self, figures: Figures) -> float | str | bool:
        """Its value; NaN where a figure it needs is NaN."""
        return _value(self._tree, figures)


def expression(text: str, kinds: Mapping[str, str], wanted: str) -> Expression:
    """The expression in `text`, of figures with these `kinds` by name.

    Its kind is `wanted`; a `Refusal` where it is not.
    """
    if len(text) > LONGEST:
        raise Refusal(f"expected at most {LONGEST} characters, got {len(text)}; shorten it")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of Python about what is refused below
            tree = ast.parse(text.strip(), mode="eval").body
        kind = _kind(tree, kinds)
    except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
        if isinstance(error, Refusal):
            raise
        raise Refusal(
            f"expected something like 'force > 0.1 and functions_x == 8', got {text!r}"
        ) from error
    if kind != wanted:
        raise Refusal(
            f"expected an expression whose value is {wanted}, got {text!r}, whose value is {kind}"
        )
    return Expression(text, kind, tree)


def _kind(node: ast.expr, kinds: Mapping[str, str]) -> str:
    """The kind of a part of an expression; a `Refusal` for anything that is not allowed."""
    match node:
        case ast.Constant(value=bool()):
            pass
        case ast.Constant(value=int() | float()):
            return NUMBER
        case ast.Constant(value=str()):
            return WORD
        case ast.Name(id=name):
            if name not in kinds:
                raise Refusal(f"expected a figure or a setting, got {name!r}; see the guide")
            return kinds[name]
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return _all_of(NUMBER, [operand], kinds)
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return _all_of(TRUTH, [operand], kinds)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _ARITHMETIC:
            return _all_of(NUMBER, [left, right], kinds)
        case ast.BoolOp(values=values):
            return _all_of(TRUTH, values, kinds)
        case ast.Compare(left=left, ops=ops, comparators=others) if _comparable(ops):
            ordered = any(isinstance(op, _ORDER) for op in ops)
            _all_of(NUMBER if ordered else _kind(left, kinds), [left, *others], kinds)
            return TRUTH
        case _:
            pass
    raise Refusal(
        f"expected names, numbers, words in quotes, + - * /, comparisons, and, or, not; got "
        f"{ast.unparse(node)!r}"
    )


def _comparable(ops: list[ast.cmpop]) -> bool:
    return all(type(op) in _COMPARED for op in ops)


def _all_of(kind: str, nodes: list[ast.expr], kinds: Mapping[str, str]) -> str:
    for node in nodes:
        if (found := _kind(node, kinds)) != kind:
            raise Refusal(f"expected {kind}, got {ast.unparse(node)!r}, which is {found}")
    return kind


def _value(node: ast.expr, figures: Figures) -> Any:
    match node:
        case ast.Constant(value=str() as word):
            return word
        case ast.Constant(value=int() | float() as number):
            return float(number)
        case ast.Name(id=name):
            return figures[name]
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return not _value(operand, figures)
        case ast.UnaryOp(operand=operand):
            return -_value(operand, figures)
        case ast.BinOp(left=left, op=op, right=right):
            return _ARITHMETIC[type(op)](_value(left, figures), _value(right, figures))
        case ast.BoolOp(op=op, values=values):
            whole = all if isinstance(op, ast.And) else any
            return whole(_value(value, figures) for value in values)
        case ast.Compare(left=left, ops=ops, comparators=others):
            values = [_value(one, figures) for one in (left, *others)]
            pairs = zip(ops, values[:-1], values[1:], strict=True)
            return all(_COMPARED[type(op)](one, other) for op, one, other in pairs)
        case _:  # pragma: no cover
            raise TypeError(f"expected what `_kind` lets through, got {node!r}")
