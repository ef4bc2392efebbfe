"""A file's tree with one thing in it changed, and how that is said on one line."""

import ast
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

_SWAPPED: dict[type[ast.AST], Callable[[], ast.AST]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Pow: ast.Mult,
    ast.Mod: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.And: ast.Or,
    ast.Or: ast.And,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
    ast.USub: ast.UAdd,
}


@dataclass(frozen=True)
class Change:
    """Of the `index`th node of a file's tree, as it is and as it becomes.

    It begins on `line`, and its statement on the line `begun`.
    """

    file: Path
    index: int
    line: int
    begun: int
    said: str


def places(file: Path) -> list[tuple[Path, int]]:
    """Every node of the file that can be changed, by its index."""
    tree = ast.parse(file.read_text("utf-8"))
    return [(file, index) for index, node in list(_that_matter(tree)) if _change(node)]


def changed(file: Path, index: int) -> tuple[ast.Module, Change]:
    """The file's tree with one node changed, and what that change is."""
    tree = ast.parse(file.read_text("utf-8"))
    node = list(ast.walk(tree))[index]
    statement = _innermost(tree, node)
    before = _head(statement)
    _change(node)
    line = getattr(node, "lineno", statement.lineno)
    said = Change(file, index, line, statement.lineno, _difference(before, _head(statement)))
    return ast.fix_missing_locations(tree), said


def _change(node: ast.AST) -> bool:
    """Whether the node is of a kind that is changed; then it has been, in place."""
    match node:
        case ast.Compare(ops=[first, *_]):
            node.ops[0] = _SWAPPED[type(first)]()
        case ast.BinOp() | ast.BoolOp() | ast.UnaryOp() if type(node.op) in _SWAPPED:
            node.op = _SWAPPED[type(node.op)]()
        case ast.Constant(value=bool(value)):
            node.value = not value
        case ast.Constant(value=int(value)):
            node.value = value + 1
        case ast.Constant(value=float(value)):
            node.value = 2 * value or 1.0
        case ast.If() | ast.While() | ast.IfExp():
            node.test = ast.UnaryOp(ast.Not(), node.test)
        case ast.comprehension(ifs=[first, *_]):
            node.ifs[0] = ast.UnaryOp(ast.Not(), first)
        case ast.Return(value=ast.expr()) | ast.Expr(value=ast.Call()):
            node.value = ast.Constant(None)
        case ast.Call(keywords=[*_, ast.keyword(arg=str())]):
            node.keywords.pop()
        case _:
            return False
    return True


def _that_matter(tree: ast.AST) -> Iterator[tuple[int, ast.AST]]:
    """The nodes of what runs: no annotation, decorator or message of an error."""
    left_out: set[int] = set()
    for node in ast.walk(tree):
        parts = list[ast.AST | None]()
        match node:
            case ast.arg() | ast.AnnAssign():
                parts = [node.annotation]
            case ast.FunctionDef():
                parts = [*node.decorator_list, node.returns]
            case ast.ClassDef():
                parts = [*node.decorator_list]
            case ast.Raise():
                parts = [node]
        left_out |= {id(inner) for part in parts if part for inner in ast.walk(part)}
    for index, node in enumerate(ast.walk(tree)):
        if id(node) not in left_out:
            yield index, node


def _innermost(tree: ast.AST, node: ast.AST) -> ast.stmt:
    """The innermost statement that the node belongs to."""
    found = [s for s in ast.walk(tree) if isinstance(s, ast.stmt) and node in ast.walk(s)]
    return found[-1]  # it is walked from the outside in


def _head(statement: ast.stmt) -> str:
    return ast.unparse(statement).split("\n")[0]


def _difference(before: str, after: str) -> str:
    """The line as it was, with what becomes another within braces."""
    shorter = min(len(before), len(after))
    start = next((k for k in range(shorter) if before[k] != after[k]), shorter)
    ends = range(shorter - start)
    stop = next((k for k in ends if before[-1 - k] != after[-1 - k]), shorter - start)
    was, becomes = (text[start : len(text) - stop] for text in (before, after))
    return f"{before[:start]}{{{was} -> {becomes}}}{before[len(before) - stop :]}"
