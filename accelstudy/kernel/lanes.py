"""Arithmetic on lanes: as many replicates side by side as a vector has places.

The operations on `Lanes` write LLVM's text instead of computing. So formulas in ordinary Python
become text that is compiled afterwards. A plain number is a constant in all lanes; structural zeros
and ones cost nothing. The lanes are independent, and every operation is rounded by IEEE 754 (no
fused multiply-adds but those that are written). So a result depends neither on the other lanes nor
on the processor.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeAlias

LANES = 8
_VECTOR = f"<{LANES} x double>"
_MASK = f"<{LANES} x i1>"
_INTRINSIC = f"v{LANES}f64"


@dataclass(frozen=True, eq=False)
class Lanes:
    """A number in each lane."""

    code: Code
    name: str

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
        return Lanes(self.code, self.code.line(f"fneg {_VECTOR} {self.name}"))

    def __gt__(self, other: Term) -> Mask:
        return self.code.compare("ogt", self, other)


@dataclass(frozen=True, eq=False)
class Mask:
    """Yes or no in each lane."""

    code: Code
    name: str

    def __and__(self, other: Mask) -> Mask:
        return Mask(self.code, self.code.line(f"and {_MASK} {self.name}, {other.name}"))

    def __invert__(self) -> Mask:
        return Mask(self.code, self.code.line(f"xor {_MASK} {self.name}, splat (i1 true)"))

    def select(self, yes: Term, no: Term) -> Lanes:
        """`yes` in the lanes of the mask, `no` in the others."""
        operands = f"{_VECTOR} {text(yes)}, {_VECTOR} {text(no)}"
        return Lanes(self.code, self.code.line(f"select {_MASK} {self.name}, {operands}"))

    def any(self) -> str:
        """Whether the mask is set in any lane, as one bit."""
        bits = self.code.line(f"bitcast {_MASK} {self.name} to i{LANES}")
        return self.code.line(f"icmp ne i{LANES} {bits}, 0")


Term: TypeAlias = Lanes | float


class Variable:
    """A value that changes in a loop."""

    def __init__(self, code: Code, start: Term) -> None:
        self._code = code
        self._place = code.place(_VECTOR)
        self.set(start)

    def get(self) -> Lanes:
        """Present value."""
        return Lanes(self._code, self._code.line(f"load {_VECTOR}, ptr {self._place}"))

    def set(self, value: Term) -> None:
        """Replace the value."""
        self._code.do(f"store {_VECTOR} {text(value)}, ptr {self._place}")


class Code:
    """The text of one function, written line by line.

    Parameters
    ----------
    name : str
    integers, pointers : names of the arguments, 64-bit integers first, then pointers to doubles
    """

    def __init__(self, name: str, integers: Sequence[str], pointers: Sequence[str]) -> None:
        arguments = [f"i64 %{a}" for a in integers] + [f"ptr noalias %{a}" for a in pointers]
        self._head = f"define void @{name}({', '.join(arguments)}) {{\nentry:"
        self._places: list[str] = []
        self._lines: list[str] = []
        self._declared: set[str] = set()
        self._count = 0
        self._exits: list[str] = []

    def __str__(self) -> str:
        body = "\n".join([*self._places, *self._lines])
        declarations = "\n".join(sorted(self._declared))
        return f"{self._head}\n{body}\n  ret void\n}}\n{declarations}\n"

    def _new(self, prefix: str = "v") -> str:
        self._count += 1
        return f"{prefix}{self._count}"

    def do(self, line: str) -> None:
        """Write an instruction without a result."""
        self._lines.append("  " + line)

    def line(self, line: str) -> str:
        """Write an instruction and name its result."""
        name = "%" + self._new()
        self._lines.append(f"  {name} = {line}")
        return name

    def place(self, kind: str) -> str:
        """Memory of the function for one value of a kind."""
        name = "%" + self._new("m")
        self._places.append(f"  {name} = alloca {kind}")
        return name

    def binary(self, operation: str, a: Term, b: Term) -> Lanes:
        """Write an operation of two numbers."""
        return Lanes(self, self.line(f"{operation} {_VECTOR} {text(a)}, {text(b)}"))

    def compare(self, how: str, a: Term, b: Term) -> Mask:
        """Write a comparison."""
        return Mask(self, self.line(f"fcmp {how} {_VECTOR} {text(a)}, {text(b)}"))

    def intrinsic(self, name: str, *arguments: Term) -> Lanes:
        """Write an operation that LLVM knows by name."""
        function = f"@llvm.{name}.{_INTRINSIC}"
        kinds = ", ".join([_VECTOR] * len(arguments))
        self._declared.add(f"declare {_VECTOR} {function}({kinds})")
        operands = ", ".join(f"{_VECTOR} {text(a)}" for a in arguments)
        return Lanes(self, self.line(f"call {_VECTOR} {function}({operands})"))

    def library(self, name: str, *arguments: Term) -> Lanes:
        """Call a function of the C library, lane by lane."""
        self._declared.add(f"declare double @{name}({', '.join(['double'] * len(arguments))})")
        result = "poison"
        for lane in range(LANES):
            taken = [
                self.line(f"extractelement {_VECTOR} {text(a)}, i64 {lane}") for a in arguments
            ]
            value = self.line(f"call double @{name}({', '.join(f'double {t}' for t in taken)})")
            result = self.line(f"insertelement {_VECTOR} {result}, double {value}, i64 {lane}")
        return Lanes(self, result)

    @contextmanager
    def loop(self, count: str) -> Iterator[str]:
        """Write a loop over an index from 0 to below `count`."""
        counter = self.place("i64")
        head, body, after = (self._new(part) for part in ("head", "body", "after"))
        self.do(f"store i64 0, ptr {counter}")
        self.do(f"br label %{head}")
        self._lines.append(f"{head}:")
        index = self.line(f"load i64, ptr {counter}")
        going = self.line(f"icmp slt i64 {index}, {count}")
        self.do(f"br i1 {going}, label %{body}, label %{after}")
        self._lines.append(f"{body}:")
        self._exits.append(after)
        yield index
        self._exits.pop()
        following = self.line(f"add i64 {index}, 1")
        self.do(f"store i64 {following}, ptr {counter}")
        self.do(f"br label %{head}")
        self._lines.append(f"{after}:")

    def leave_unless(self, bit: str) -> None:
        """Leave the innermost loop unless a bit is set."""
        on = self._new("on")
        self.do(f"br i1 {bit}, label %{on}, label %{self._exits[-1]}")
        self._lines.append(f"{on}:")

    @contextmanager
    def when(self, bit: str) -> Iterator[None]:
        """Write instructions that are run only if a bit is set."""
        then, after = self._new("then"), self._new("after")
        self.do(f"br i1 {bit}, label %{then}, label %{after}")
        self._lines.append(f"{then}:")
        yield
        self.do(f"br label %{after}")
        self._lines.append(f"{after}:")

    def integer(self, operation: str, a: str | int, b: str | int) -> str:
        """Write an operation of two integers."""
        return self.line(f"{operation} i64 {a}, {b}")

    def smaller(self, a: str, b: str) -> str:
        """Return the smaller of two integers."""
        return self.line(f"select i1 {self.line(f'icmp slt i64 {a}, {b}')}, i64 {a}, i64 {b}")

    def _at(self, pointer: str, offset: str) -> str:
        return self.line(f"getelementptr inbounds double, ptr %{pointer}, i64 {offset}")

    def load(self, pointer: str, offset: str) -> Lanes:
        """Load a number for each lane from consecutive places."""
        return Lanes(self, self.line(f"load {_VECTOR}, ptr {self._at(pointer, offset)}, align 8"))

    def store(self, value: Term, pointer: str, offset: str) -> None:
        """Store the numbers of all lanes in consecutive places."""
        self.do(f"store {_VECTOR} {text(value)}, ptr {self._at(pointer, offset)}, align 8")

    def load_same(self, pointer: str, offset: str) -> Lanes:
        """Load one number for all lanes."""
        return self.load_each(pointer, [offset])

    def load_each(self, pointer: str, offsets: Sequence[str]) -> Lanes:
        """Load a number for each lane, from an offset of its own."""
        result = "poison"
        for lane, offset in enumerate(offsets):
            value = self.line(f"load double, ptr {self._at(pointer, offset)}, align 8")
            result = self.line(f"insertelement {_VECTOR} {result}, double {value}, i64 {lane}")
        return self._alike(result) if len(offsets) == 1 else Lanes(self, result)

    def _alike(self, first: str) -> Lanes:
        """The number of the first lane in all lanes."""
        zero = f"<{LANES} x i32> zeroinitializer"
        return Lanes(self, self.line(f"shufflevector {_VECTOR} {first}, {_VECTOR} poison, {zero}"))

    def lane_numbers(self) -> Lanes:
        """0, 1, 2, … in the lanes."""
        return Lanes(self, f"<{', '.join(f'double {_bits(float(i))}' for i in range(LANES))}>")

    def of_integer(self, value: str) -> Lanes:
        """Return an integer as the number of all lanes."""
        one = self.line(f"sitofp i64 {value} to double")
        return self._alike(self.line(f"insertelement {_VECTOR} poison, double {one}, i64 0"))


def text(value: Term) -> str:
    """Return an operand as LLVM reads it."""
    return value.name if isinstance(value, Lanes) else f"splat (double {_bits(value)})"


def _bits(value: float) -> str:
    return f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016X}"


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
    return b.code.compare("ogt", a, b).select(a, b) if isinstance(b, Lanes) else max(a, b)


def above(a: Term, least: float) -> Term:
    """Return values above a number, and NaN instead of others."""
    if isinstance(a, Lanes):
        return (a > least).select(a, math.nan)
    return a if a > least else math.nan
