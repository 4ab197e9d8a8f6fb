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
from math import isfinite, nan
from types import MappingProxyType

from sms_handover.errors import ConfigurationError, UnknownNameError

_LONGEST = 1000  # [characters]
_LONGEST_TOLD = 120  # [characters] of it, or of a part, in a message
_MOST_TOLD = 4  # metrics of it


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
class Part:
    """A piece of an expression that all of it needs to be true, as it was written."""

    text: str
    node: Node

    def in_words(self, metrics: Metrics) -> str:
        """Return that it does not hold, with the values of its metrics, as ``not a < 1 (a is 1.2)``."""
        told = _short(self.text)
        names = dict.fromkeys(_names(self.node))
        if isinstance(self.node, Metric) and self.node.of(metrics) == 0:  # its value says nothing more
            names = {}
        values = ", ".join(f"{name} is {_told(metrics[name])}" for name in list(names)[:_MOST_TOLD])
        return f"not {told} ({values})" if values else f"not {told}"


@dataclass(frozen=True)
class SuccessExpression:
    """An expression as it was written, its tree, and the operands of an ``and`` that it may be of."""

    text: str
    tree: Node
    parts: tuple[Part, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The metrics that it is about, each once."""
        return tuple(dict.fromkeys(_names(self.tree)))

    def holds(self, metrics: Metrics) -> bool:
        """Return whether it is true; one that is not defined, as a metric of it is not, does not hold."""
        value = self.tree.of(metrics)
        return value == value and bool(value)

    def why_not(self, metrics: Metrics) -> str:
        """Return the first part that is false, or else not defined, with the values of its metrics.

        It is the whole expression where that is no ``and``.
        """
        values = [part.node.of(metrics) for part in self.parts]
        false = [part for part, value in zip(self.parts, values, strict=True) if value == 0]
        undefined = [part for part, value in zip(self.parts, values, strict=True) if value != value]
        return (false or undefined or list(self.parts))[0].in_words(metrics)

    def require_known(self, known: Mapping[str, object]) -> None:
        """Raise UnknownNameError unless all its metrics are known."""
        for name in self.names:
            if name not in known:
                raise UnknownNameError(
                    "metric", name, known, f"success {self.text!r}", "sms-handover list metrics"
                )


def success_expression(text: str) -> SuccessExpression:
    """Return the expression that a text says; raises ConfigurationError with what is not understood."""
    if len(text) > _LONGEST:
        raise ConfigurationError(f"success has {len(text)} characters, must be <= {_LONGEST}")
    try:
        body = ast.parse(text, mode="eval").body
        tree = _node(body)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        told = f"success {_short(text)!r}"
        if isinstance(error, ConfigurationError):
            raise ConfigurationError(f"{told}: {error}") from None
        raise ConfigurationError(f"{told} is not an expression over metrics") from None
    if isinstance(body, ast.BoolOp) and isinstance(body.op, ast.And):
        parts = tuple(Part(ast.get_source_segment(text, one) or text, _node(one)) for one in body.values)
    else:
        parts = (Part(text, tree),)
    return SuccessExpression(text, tree, parts)


def _node(node: ast.AST) -> Node:
    """Return the tree of a piece of syntax; raises ConfigurationError on what is not allowed."""
    if isinstance(node, ast.Constant) and isinstance(node.value, bool | int | float):
        return _constant(node.value)
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
        left, right = _node(node.left), _node(node.right)
        if isinstance(node.op, ast.Div) and not any(_names(right)) and not right.of({}):
            raise ConfigurationError(f"{ast.unparse(node)!r} divides by zero")
        return Applied(_BINARY[type(node.op)], (left, right))
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


def _constant(value: float | bool) -> Constant:
    """Return a number; raises ConfigurationError on one that no float can be."""
    try:
        is_finite = isfinite(value)
    except OverflowError:  # a whole number of more than 308 digits
        is_finite = False
    if not is_finite:
        raise ConfigurationError("a number in it is larger than any that can be computed with, 1.8e308")
    return Constant(value)


def _short(text: str) -> str:
    """Return a text, of a long one its beginning."""
    return text if len(text) <= _LONGEST_TOLD else f"{text[:_LONGEST_TOLD]}..."


def _told(value: float | None) -> str:
    """Return the value of a metric in words."""
    return "not defined" if value is None else f"{value:.4g}"


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
