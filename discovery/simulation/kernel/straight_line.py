"""Straight-line mathematics handed to the compiler as its own instructions.

All numbers of a kernel are of one type, and each name is assigned once after the other, without branches. Left to the
compiler's front end, a long loop body takes it ten seconds or more to find that out, many times longer than to optimise
it; so its statements are translated here, one by one, by the compiler's own implementations of the operators.
"""

from __future__ import annotations

import ast
import builtins
import operator
from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from typing import Any

from numba import types
from numba.extending import intrinsic

_OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}


def received(lines: Sequence[str]) -> list[str]:
    """Return the names that statements read and do not assign before, but for the array ``w`` and the index ``i``."""
    known = {"w", "i"}
    found: dict[str, None] = {}
    for statement in ast.parse("\n".join(lines)).body:
        nodes = list(ast.walk(statement))
        called = {id(n.func) for n in nodes if isinstance(n, ast.Call)}
        called |= {id(n.value) for n in nodes if isinstance(n, ast.Attribute)}
        names = [n for n in nodes if isinstance(n, ast.Name) and id(n) not in called]
        found.update(dict.fromkeys(n.id for n in names if isinstance(n.ctx, ast.Load) and n.id not in known))
        known |= {n.id for n in names if isinstance(n.ctx, ast.Store)}
    return list(found)


def straight_line(text: str, functions: Mapping[str, Any]) -> Any:
    """Return a compiled function ``f(w, i, given)`` of some statements.

    Parameters
    ----------
    text : str
        One assignment a line, to a name or to ``w[offset + i]``, of arithmetic, calls and choices ``a if b else c``,
        both sides of which are evaluated.
    functions : mapping of str to callable
        What the statements call, by name; modules for what is called as their attribute.

    Returns
    -------
    callable
        It takes an array of float, an index, and a tuple of the names that `received` tells; it changes the array.
    """

    @intrinsic
    def run(typing, w, i, given):
        def build(context, builder, signature, arguments):
            array, index, values = arguments
            data = context.make_array(signature.args[0])(context, builder, array).data
            # Only here: a function whose machine code is on disk is never built.
            known = {name: builder.extract_value(values, k) for k, name in enumerate(received(text.splitlines()))}
            translation = _Translation(context, builder, functions, known, data, index)
            for statement in ast.parse(text).body:
                translation.run(statement)
            return context.get_dummy_value()

        return types.none(w, i, given), build

    return run


def _refusal(node: ast.AST) -> NotImplementedError:
    return NotImplementedError(f"not straight-line mathematics: {ast.unparse(node)}")


class _Translation:
    """The instructions of one body, appended to what a builder holds."""

    def __init__(
        self, context: Any, builder: Any, functions: Mapping[str, Any], known: dict[str, Any], data: Any, index: Any
    ) -> None:
        self.context, self.builder, self.functions = context, builder, functions
        self.known, self.data, self.index = known, data, index
        self.implementations: dict[tuple[Any, int], Any] = {}

    def run(self, statement: ast.stmt) -> None:
        if isinstance(statement, ast.AugAssign):
            target: ast.expr = statement.target
            value = self.apply(_OPERATORS[type(statement.op)], self.value(target), self.value(statement.value))
        elif isinstance(statement, ast.Assign):
            (target,) = statement.targets
            value = self.value(statement.value)
        else:
            raise _refusal(statement)
        if isinstance(target, ast.Name):
            self.known[target.id] = value
        else:
            self.builder.store(value, self.place(target))

    def place(self, target: ast.expr) -> Any:
        """Return where ``w[offset + i]`` lies."""
        match target:
            case ast.Subscript(
                value=ast.Name(id="w"), slice=ast.BinOp(ast.Constant(value=int(offset)), ast.Add(), ast.Name(id="i"))
            ):
                index = self.builder.add(self.index.type(offset), self.index)
                return self.builder.gep(self.data, [index], inbounds=True)
        raise _refusal(target)

    def value(self, node: ast.expr) -> Any:
        """Return the value of an expression."""
        match node:
            case ast.Name(id=name):
                return self.known[name]
            case ast.Constant(value=int() | float() as number):
                return self.context.get_constant(types.float64, float(number))
            case ast.Subscript():
                return self.builder.load(self.place(node))
            case ast.BinOp(left=a, op=op, right=b) | ast.Compare(left=a, ops=[op], comparators=[b]) if (
                type(op) in _OPERATORS
            ):
                return self.apply(_OPERATORS[type(op)], self.value(a), self.value(b))
            case ast.BoolOp(op=op, values=parts):
                joined = self.builder.and_ if isinstance(op, ast.And) else self.builder.or_
                return reduce(joined, map(self.value, parts))
            case ast.UnaryOp(op=ast.Not(), operand=a):
                return self.builder.not_(self.value(a))
            case ast.UnaryOp(op=op, operand=a):
                return self.apply(_OPERATORS[type(op)], self.value(a))
            case ast.IfExp(test=test, body=a, orelse=b):
                return self.builder.select(self.value(test), self.value(a), self.value(b))
            case ast.Call(func=ast.Name(id=name), args=given):
                return self.apply(self.called(name), *map(self.value, given))
            case ast.Call(func=ast.Attribute(value=ast.Name(id=module), attr=name), args=given):
                return self.apply(getattr(self.called(module), name), *map(self.value, given))
        raise _refusal(node)

    def called(self, name: str) -> Any:
        return self.functions[name] if name in self.functions else getattr(builtins, name)

    def apply(self, function: Callable[..., Any], *values: Any) -> Any:
        """Return the value of a function of numbers."""
        key = function, len(values)
        if key not in self.implementations:
            typed = self.context.typing_context.resolve_value_type(function)
            numbers = (types.float64,) * len(values)
            signature = self.context.typing_context.resolve_function_type(typed, numbers, {})
            self.implementations[key] = self.context.get_function(typed, signature)
        return self.implementations[key](self.builder, values)
