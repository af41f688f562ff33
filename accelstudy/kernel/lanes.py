"""Arithmetic on lanes: as many replicates side by side as a vector has places.

The operations on `Lanes` write code of LLVM instead of computing. So formulas in ordinary Python
become code that is compiled afterwards. A plain number is a constant in all lanes; structural zeros
and ones cost nothing. The lanes are independent, and every operation is rounded by IEEE 754 (no
fused multiply-adds but those that are written). So a result depends neither on the other lanes nor
on the processor.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeAlias

from llvmlite import ir

LANES = 8
_NUMBER, _INTEGER = ir.DoubleType(), ir.IntType(64)
_VECTOR, _MASK = ir.VectorType(_NUMBER, LANES), ir.VectorType(ir.IntType(1), LANES)


@dataclass(frozen=True, eq=False)
class Lanes:
    """A number in each lane."""

    code: Code
    value: Any

    def __add__(self, other: Term) -> Lanes:
        return self if _is(other, 0) else self.code.binary("fadd", self, other)

    __radd__ = __add__

    def __sub__(self, other: Term) -> Lanes:
        return self if _is(other, 0) else self.code.binary("fsub", self, other)

    def __rsub__(self, other: Term) -> Lanes:
        return -self if _is(other, 0) else self.code.binary("fsub", other, self)

    def __mul__(self, other: Term) -> Term:
        if _is(other, 0):
            return 0.0
        if _is(other, 1):
            return self
        return -self if _is(other, -1) else self.code.binary("fmul", self, other)

    __rmul__ = __mul__

    def __truediv__(self, other: Term) -> Lanes:
        return self.code.binary("fdiv", self, other)

    def __rtruediv__(self, other: Term) -> Lanes:
        return self.code.binary("fdiv", other, self)

    def __neg__(self) -> Lanes:
        return Lanes(self.code, self.code.builder.fneg(self.value))

    def __gt__(self, other: Term) -> Mask:
        return self.code.compare(">", self, other)


@dataclass(frozen=True, eq=False)
class Mask:
    """Yes or no in each lane."""

    code: Code
    value: Any

    def __and__(self, other: Mask) -> Mask:
        return Mask(self.code, self.code.builder.and_(self.value, other.value))

    def __invert__(self) -> Mask:
        return Mask(self.code, self.code.builder.xor(self.value, ir.Constant(_MASK, [1] * LANES)))

    def select(self, yes: Term, no: Term) -> Lanes:
        """`yes` in the lanes of the mask, `no` in the others."""
        return Lanes(self.code, self.code.builder.select(self.value, operand(yes), operand(no)))

    def any(self) -> Any:
        """Whether the mask is set in any lane, as one bit."""
        bits = self.code.builder.bitcast(self.value, ir.IntType(LANES))
        return self.code.builder.icmp_unsigned("!=", bits, bits.type(0))


Term: TypeAlias = Lanes | float


class Variable:
    """A value that changes in a loop."""

    def __init__(self, code: Code, start: Term) -> None:
        self._code = code
        self._place = code.place(_VECTOR)
        self.set(start)

    def get(self) -> Lanes:
        """Present value."""
        return Lanes(self._code, self._code.builder.load(self._place))

    def set(self, value: Term) -> None:
        """Replace the value."""
        self._code.builder.store(operand(value), self._place)


class Code:
    """The code of one function; what its methods write comes after what they wrote before.

    Parameters
    ----------
    name : str
    integers, pointers : names of the arguments, 64-bit integers first, then pointers to doubles
    """

    def __init__(self, name: str, integers: Sequence[str], pointers: Sequence[str]) -> None:
        kinds = [_INTEGER] * len(integers) + [_NUMBER.as_pointer()] * len(pointers)
        self._module = ir.Module()
        function = ir.Function(self._module, ir.FunctionType(ir.VoidType(), kinds), name)
        self.arguments = dict(zip([*integers, *pointers], function.args, strict=True))
        for pointer in pointers:
            self.arguments[pointer].add_attribute("noalias")
        self.builder = ir.IRBuilder(function.append_basic_block("entry"))
        self._exits: list[Any] = []

    def text(self) -> str:
        """End the function, and return it as LLVM reads it."""
        self.builder.ret_void()
        return "".join(str(function) + "\n" for function in self._module.functions)

    def place(self, kind: Any) -> Any:
        """Memory of the function for one value of a kind."""
        with self.builder.goto_entry_block():
            return self.builder.alloca(kind)

    def binary(self, operation: str, a: Term, b: Term) -> Lanes:
        """Write an operation of two numbers."""
        return Lanes(self, getattr(self.builder, operation)(operand(a), operand(b)))

    def compare(self, how: str, a: Term, b: Term) -> Mask:
        """Write a comparison, which is false of NaN."""
        return Mask(self, self.builder.fcmp_ordered(how, operand(a), operand(b)))

    def intrinsic(self, name: str, *arguments: Term) -> Lanes:
        """Write an operation that LLVM knows by name."""
        return Lanes(self, self._call(f"llvm.{name}.v{LANES}f64", _VECTOR, map(operand, arguments)))

    def library(self, name: str, *arguments: Term) -> Lanes:
        """Call a function of the C library, lane by lane."""
        values = []
        for lane in range(LANES):
            of_lane = (self.builder.extract_element(operand(a), _INTEGER(lane)) for a in arguments)
            values.append(self._call(name, _NUMBER, of_lane))
        return self._together(values)

    def _call(self, name: str, kind: Any, arguments: Any) -> Any:
        values = [*arguments]
        function = self._module.globals.get(name) or ir.Function(
            self._module, ir.FunctionType(kind, [kind] * len(values)), name
        )
        return self.builder.call(function, values)

    def _together(self, values: Sequence[Any]) -> Lanes:
        """Numbers of the lanes as one; a single one is that of all."""
        result = ir.Constant(_VECTOR, ir.Undefined)
        for lane, value in enumerate(values):
            result = self.builder.insert_element(result, value, _INTEGER(lane))
        if len(values) == 1:
            first = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
            result = self.builder.shuffle_vector(result, result, first)
        return Lanes(self, result)

    @contextmanager
    def loop(self, count: Any) -> Iterator[Any]:
        """Write a loop over an index from 0 to below `count`."""
        builder, counter = self.builder, self.place(_INTEGER)
        head, body, after = (builder.append_basic_block(name) for name in ("head", "body", "after"))
        builder.store(_INTEGER(0), counter)
        builder.branch(head)
        builder.position_at_end(head)
        index = builder.load(counter)
        builder.cbranch(builder.icmp_signed("<", index, _integer(count)), body, after)
        builder.position_at_end(body)
        self._exits.append(after)
        yield index
        self._exits.pop()
        builder.store(self.integer("add", index, 1), counter)
        builder.branch(head)
        builder.position_at_end(after)

    def leave_unless(self, bit: Any) -> None:
        """Leave the innermost loop unless a bit is set."""
        on = self.builder.append_basic_block("on")
        self.builder.cbranch(bit, on, self._exits[-1])
        self.builder.position_at_end(on)

    def integer(self, operation: str, a: Any, b: Any) -> Any:
        """Write an operation of two integers."""
        return getattr(self.builder, operation)(_integer(a), _integer(b))

    def smaller(self, a: Any, b: Any) -> Any:
        """Return the smaller of two integers."""
        return self.builder.select(self.builder.icmp_signed("<", a, b), a, b)

    def _at(self, pointer: str, offset: Any) -> Any:
        return self.builder.gep(self.arguments[pointer], [_integer(offset)], inbounds=True)

    def load(self, pointer: str, offset: Any) -> Lanes:
        """Load a number for each lane from consecutive places."""
        place = self.builder.bitcast(self._at(pointer, offset), _VECTOR.as_pointer())
        return Lanes(self, self.builder.load(place, align=8))

    def store(self, value: Term, pointer: str, offset: Any) -> None:
        """Store the numbers of all lanes in consecutive places."""
        place = self.builder.bitcast(self._at(pointer, offset), _VECTOR.as_pointer())
        self.builder.store(operand(value), place, align=8)

    def load_each(self, pointer: str, offsets: Sequence[Any]) -> Lanes:
        """Load a number for each lane, from an offset of its own, or the same one for all."""
        places = (self._at(pointer, offset) for offset in offsets)
        return self._together([self.builder.load(place, align=8) for place in places])

    def lane_numbers(self) -> Lanes:
        """0, 1, 2, … in the lanes."""
        return Lanes(self, ir.Constant(_VECTOR, [float(lane) for lane in range(LANES)]))

    def of_integer(self, value: Any) -> Lanes:
        """Return an integer as the number of all lanes."""
        return self._together([self.builder.sitofp(value, _NUMBER)])


def operand(value: Term) -> Any:
    """Return a number of all lanes as LLVM knows it."""
    return value.value if isinstance(value, Lanes) else ir.Constant(_VECTOR, [value] * LANES)


def _integer(value: Any) -> Any:
    return _INTEGER(value) if isinstance(value, int) else value


def _is(value: Term, number: float) -> bool:
    return not isinstance(value, Lanes) and value == number


def fma(a: Term, b: Term, c: Term) -> Term:
    """Product and sum a b + c, rounded once."""
    code = next((x.code for x in (a, b) if isinstance(x, Lanes)), None)
    if code is None or _is(c, 0) or any(_is(x, number) for x in (a, b) for number in (-1, 0, 1)):
        return a * b + c
    return code.intrinsic("fma", a, b, c)


def sqrt(a: Term) -> Term:
    """Square root; NaN of a negative number."""
    return a.code.intrinsic("sqrt", a) if isinstance(a, Lanes) else math.sqrt(a)


def absolute(a: Term) -> Term:
    """|a|."""
    return a.code.intrinsic("fabs", a) if isinstance(a, Lanes) else abs(a)


def larger(a: Term, b: Term) -> Term:
    """Return the larger of two numbers, and `b` where either is NaN."""
    if isinstance(a, Lanes):
        return (a > b).select(a, b)
    return b.code.compare(">", a, b).select(a, b) if isinstance(b, Lanes) else max(a, b)


def above(a: Term, least: float) -> Term:
    """Return values above a number, and NaN instead of others."""
    if isinstance(a, Lanes):
        return (a > least).select(a, math.nan)
    return a if a > least else math.nan
