"""Success expression over metrics: parsed into a small tree of known operations, never run as code.

``complete and carry.arm_a.final_error < 0.005`` compares figures in SI units. There are ``and``, ``or``,
``not``, comparisons, ``+ - * /``, ``abs``, ``min``, ``max``, numbers, ``true`` and ``false``, and metrics by
name; one that is no chain of identifiers stands in quotes. What is not defined, NaN, stays so by Kleene's
three-valued logic: in comparisons and ``not``, and in ``and`` and ``or`` unless the other side decides them.
"""

import ast
import operator
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from math import nan
from types import MappingProxyType

from sms_handover.errors import ConfigurationError, UnknownNameError

_LONGEST = 1000  # [characters]


def _least(*values: float) -> float:
    """Return the least value, NaN if one is not defined."""
    return _defined(values, min(values))


def _greatest(*values: float) -> float:
    """Return the largest value, NaN if one is not defined."""
    return _defined(values, max(values))


_WORDS = {"true": True, "false": False, "True": True, "False": False}
_Operation = Callable[..., float | bool]
_BINARY: Mapping[type[ast.AST], _Operation] = MappingProxyType(
    {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv}
)
_COMPARED: Mapping[type[ast.AST], _Operation] = MappingProxyType(
    {
        ast.Lt: operator.lt,
        ast.LtE: operator.le,
        ast.Gt: operator.gt,
        ast.GtE: operator.ge,
        ast.Eq: operator.eq,
        ast.NotEq: operator.ne,
    }
)
_CALLED: Mapping[str, _Operation] = MappingProxyType({"abs": abs, "min": _least, "max": _greatest})
Metrics = Mapping[str, float | None]


@dataclass(frozen=True)
class Constant:
    """A number, or true or false."""

    value: float | bool

    def of(self, metrics: Metrics) -> float | bool:
        """Return its value for some metrics, NaN where that is not defined."""
        return self.value


@dataclass(frozen=True)
class Metric:
    """A metric by its name."""

    name: str

    def of(self, metrics: Metrics) -> float | bool:
        """Return its value for some metrics, NaN where that is not defined."""
        value = metrics[self.name]
        return nan if value is None else value


@dataclass(frozen=True)
class Applied:
    """An operation on what other nodes give."""

    operation: _Operation
    nodes: tuple["Node", ...]

    def of(self, metrics: Metrics) -> float | bool:
        """Return its value for some metrics, NaN where that is not defined."""
        try:
            return self.operation(*(node.of(metrics) for node in self.nodes))
        except (ZeroDivisionError, OverflowError):
            return nan


Node = Constant | Metric | Applied


@dataclass(frozen=True)
class SuccessExpression:
    """An expression as it was written, and its tree."""

    text: str
    tree: Node

    @property
    def names(self) -> tuple[str, ...]:
        """The metrics that it is about, each once."""
        return tuple(dict.fromkeys(_names(self.tree)))

    def holds(self, metrics: Metrics) -> bool:
        """Return whether it is true; one that is not defined, as a metric of it is not, does not hold."""
        value = self.tree.of(metrics)
        return value == value and bool(value)

    def require_known(self, known: Mapping[str, object]) -> None:
        """Raise UnknownNameError unless all its metrics are known."""
        for name in self.names:
            if name not in known:
                raise UnknownNameError("metric", name, known, f"success {self.text!r}", "sms-handover check")


def success_expression(text: str) -> SuccessExpression:
    """Return the expression that a text says; raises ConfigurationError with what is not understood."""
    if len(text) > _LONGEST:
        raise ConfigurationError(f"success has {len(text)} characters, must be <= {_LONGEST}")
    try:
        tree = _node(ast.parse(text, mode="eval").body)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        if isinstance(error, ConfigurationError):
            raise ConfigurationError(f"success {text!r}: {error}") from None
        raise ConfigurationError(f"success {text!r} is not an expression over metrics") from None
    return SuccessExpression(text, tree)


def _node(node: ast.AST) -> Node:
    """Return the tree of a piece of syntax; raises ConfigurationError on what is not allowed."""
    if isinstance(node, ast.Constant) and isinstance(node.value, bool | int | float):
        return Constant(node.value)
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return Metric(node.value)
    if isinstance(node, ast.Name | ast.Attribute):
        name = ast.unparse(node)
        return Constant(_WORDS[name]) if name in _WORDS else Metric(_dotted(node))
    if isinstance(node, ast.BoolOp):
        every = isinstance(node.op, ast.And)
        return Applied(_all if every else _any, tuple(map(_node, node.values)))
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        return Applied(_not, (_node(node.operand),))
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        return Applied(operator.neg, (_node(node.operand),))
    if isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
        return Applied(_BINARY[type(node.op)], (_node(node.left), _node(node.right)))
    if isinstance(node, ast.Compare) and all(type(one) in _COMPARED for one in node.ops):
        terms = [_node(term) for term in (node.left, *node.comparators)]
        pairs = zip(node.ops, terms[:-1], terms[1:], strict=True)
        links = tuple(Applied(_compared(_COMPARED[type(one)]), (left, right)) for one, left, right in pairs)
        return links[0] if len(links) == 1 else Applied(_all, links)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in _CALLED:
        few = 1 if node.func.id == "abs" else 2
        if node.keywords or len(node.args) < few or (few == 1 and len(node.args) > 1):
            raise ConfigurationError(
                f"{node.func.id} takes {'one value' if few == 1 else 'two values or more'}"
            )
        return Applied(_CALLED[node.func.id], tuple(map(_node, node.args)))
    raise ConfigurationError(f"{ast.unparse(node)!r} is not allowed: see docs/campaigns.md for what is")


def _dotted(node: ast.AST) -> str:
    """Return a chain of identifiers as a name; raises ConfigurationError on anything else."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute):
        return f"{_dotted(node.value)}.{node.attr}"
    raise ConfigurationError(f"{ast.unparse(node)!r} is not the name of a metric")


def _all(*values: float | bool) -> float | bool:
    """Return whether all are true: false if one is, else not defined if one is not."""
    return False if any(value == 0 for value in values) else _defined(values, True)


def _any(*values: float | bool) -> float | bool:
    """Return whether one is true: true if one is, else not defined if one is not."""
    is_true = any(value == value and bool(value) for value in values)
    return True if is_true else _defined(values, False)


def _not(value: float | bool) -> float | bool:
    """Return the contrary; that of what is not defined is not defined either."""
    return _defined([value], not value)


def _compared(operation: _Operation) -> _Operation:
    """Return a comparison that is not defined where one of its sides is not."""
    return lambda left, right: _defined([left, right], operation(left, right))


def _defined(values: Iterable[float | bool], result: float | bool) -> float | bool:
    """Return a result, NaN if one of the values that it is of is not defined."""
    return nan if any(value != value for value in values) else result


def _names(node: Node) -> Iterator[str]:
    """Yield the metrics below a node."""
    if isinstance(node, Metric):
        yield node.name
    elif isinstance(node, Applied):
        for inner in node.nodes:
            yield from _names(inner)
