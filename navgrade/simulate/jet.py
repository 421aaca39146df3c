"""A value together with its time derivatives: arithmetic that differentiates exactly."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import factorial
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Jet:
    """A function of time known by its Taylor coefficients at some instants.

    ``Jet(f, f', f''/2, ...)``: coefficient k is the k-th derivative over k!. Operators and the
    NumPy functions sin, cos, sqrt and arctan act on all of them, so that a formula written for
    numbers or arrays gives the derivatives of its result as exactly as its value. A result is known
    to the lowest order of what it is made of.

    Parameters
    ----------
    *coefficients : ndarray or float
        Shapes broadcast.
    """

    __slots__ = ("_sin_cos", "coefficients")

    def __init__(self, *coefficients: Any) -> None:
        self.coefficients = coefficients
        self._sin_cos: tuple[Jet, Jet] | None = None

    @classmethod
    def time(cls, t: Array) -> Jet:
        """Time itself, s, to second order."""
        return cls(t, 1.0, 0.0)

    @classmethod
    def constant(cls, value: float) -> Jet:
        """What does not change, to second order."""
        return cls(value, 0.0, 0.0)

    @classmethod
    def of(cls, *derivatives: Any) -> Jet:
        """From a value and its derivatives."""
        return cls(*(x / factorial(k) for k, x in enumerate(derivatives)))

    @property
    def value(self) -> Any:
        """The function itself."""
        return self.coefficients[0]

    def derivatives(self) -> tuple[Any, ...]:
        """The value, the first derivative, the second, ..."""
        return tuple(factorial(k) * x if k > 1 else x for k, x in enumerate(self.coefficients))

    def rate(self) -> Jet:
        """The derivative, known to one order less."""
        return Jet(*((k + 1) * x if k else x for k, x in enumerate(self.coefficients[1:])))

    def integral(self, value: Any) -> Jet:
        """The function this is the derivative of, from its value; to one order more."""
        return Jet(value, *(x / (k + 1) if k else x for k, x in enumerate(self.coefficients)))

    def sin_cos(self) -> tuple[Jet, Jet]:
        """Sine and cosine, computed once."""
        if self._sin_cos is None:
            self._sin_cos = _sin_cos(self)
        return self._sin_cos

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        act = _UFUNCS.get(ufunc) if method == "__call__" and not options else None
        return NotImplemented if act is None else act(*inputs)

    def __neg__(self) -> Jet:
        return Jet(*(-x for x in self.coefficients))

    def __add__(self, other: Any) -> Jet:
        return _add(self, other)

    def __radd__(self, other: Any) -> Jet:
        return _add(self, other)

    def __sub__(self, other: Any) -> Jet:
        return _subtract(self, other)

    def __rsub__(self, other: Any) -> Jet:
        return _subtract(other, self)

    def __mul__(self, other: Any) -> Jet:
        return _multiply(self, other)

    def __rmul__(self, other: Any) -> Jet:
        return _multiply(self, other)

    def __truediv__(self, other: Any) -> Jet:
        return _divide(self, other)

    def __rtruediv__(self, other: Any) -> Jet:
        return _divide(other, self)


def _is_zero(x: Any) -> bool:
    """Whether a coefficient is the number 0: what does not change costs nothing."""
    return isinstance(x, float) and x == 0.0


def _sum(x: Any, y: Any) -> Any:
    return y if _is_zero(x) else x if _is_zero(y) else x + y


def _add(a: Any, b: Any) -> Jet:
    if not isinstance(a, Jet):
        a, b = b, a
    if not isinstance(b, Jet):
        return Jet(_sum(a.coefficients[0], b), *a.coefficients[1:])
    return Jet(*(_sum(x, y) for x, y in zip(a.coefficients, b.coefficients, strict=False)))


def _subtract(a: Any, b: Any) -> Jet:
    return _add(a, -b)


def _product(x: Any, y: Any) -> Any:
    return 0.0 if _is_zero(x) or _is_zero(y) else x * y


def _convolved(a: Sequence[Any], b: Sequence[Any], n: int, terms: range) -> Any:
    """Sum of a[k] b[n - k]."""
    total: Any = 0.0
    for k in terms:
        total = _sum(total, _product(a[k], b[n - k]))
    return total


def _multiply(a: Any, b: Any) -> Jet:
    if not isinstance(a, Jet):
        a, b = b, a
    if not isinstance(b, Jet):
        return Jet(*(_product(x, b) for x in a.coefficients))
    order = min(len(a.coefficients), len(b.coefficients))
    return Jet(*(_convolved(a.coefficients, b.coefficients, n, range(n + 1)) for n in range(order)))


def _divide(a: Any, b: Any) -> Jet:
    if not isinstance(b, Jet):
        return Jet(*(x / b for x in a.coefficients))
    if not isinstance(a, Jet):
        a = Jet(a, *(0.0 for _ in b.coefficients[1:]))
    quotient: list[Any] = []
    for n in range(min(len(a.coefficients), len(b.coefficients))):
        known = _convolved(b.coefficients, quotient, n, range(1, n + 1))
        rest = _sum(a.coefficients[n], -known)
        quotient.append(rest if _is_zero(rest) else rest / b.coefficients[0])
    return Jet(*quotient)


def _sin_cos(a: Jet) -> tuple[Jet, Jet]:
    slope = (0.0, *(k * x for k, x in enumerate(a.coefficients) if k))
    sin, cos = [np.sin(a.value)], [np.cos(a.value)]
    for n in range(1, len(slope)):
        terms = range(1, n + 1)
        sin_n, cos_n = _convolved(slope, cos, n, terms), _convolved(slope, sin, n, terms)
        sin.append(sin_n / n)
        cos.append(-cos_n / n)
    return Jet(*sin), Jet(*cos)


def _sqrt(a: Jet) -> Jet:
    root = [np.sqrt(a.value)]
    half = 0.5 / root[0]
    for n in range(1, len(a.coefficients)):
        rest = _sum(a.coefficients[n], -_convolved(root, root, n, range(1, n)))
        root.append(_product(rest, half))
    return Jet(*root)


def _arctan(a: Jet) -> Jet:
    return (a.rate() / (1.0 + a * a)).integral(np.arctan(a.value))


_UFUNCS: dict[Any, Callable[..., Jet]] = {
    np.add: _add,
    np.subtract: _subtract,
    np.multiply: _multiply,
    np.divide: _divide,
    np.sin: lambda a: a.sin_cos()[0],
    np.cos: lambda a: a.sin_cos()[1],
    np.sqrt: _sqrt,
    np.arctan: _arctan,
}
