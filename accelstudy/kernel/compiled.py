"""From LLVM's text to a function, compiled for this processor once and kept on disk."""

from __future__ import annotations

import ctypes
import hashlib
from functools import cache
from typing import Any

import llvmlite
import llvmlite.binding as llvm

from accelstudy.files.cache import cached

KIND = "kernels"
"""Under which compiled functions are kept."""


class Compiled:
    """A compiled function.

    Parameters
    ----------
    text : str, of one function, as LLVM reads it
    name : str, of the function
    integers, pointers : int, how many arguments of either kind it takes, integers first
    """

    def __init__(self, text: str, name: str, integers: int, pointers: int) -> None:
        machine = _machine()
        described = (text, machine.triple, *_processor(), llvmlite.__version__)
        key = hashlib.sha256("\n".join(described).encode()).hexdigest()
        compiled = cached(KIND, key, lambda: _compiled(text, machine), llvm.ObjectFileRef.from_data)
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
        self._engine.add_object_file(compiled)
        self._engine.finalize_object()
        kinds = [ctypes.c_int64] * integers + [ctypes.c_void_p] * pointers
        address = self._engine.get_function_address(name)
        self._function = ctypes.CFUNCTYPE(None, *kinds)(address)

    def call(self, *arguments: int) -> None:
        """Call the function; a pointer is the address of an array."""
        # As a method, so that the engine lives until the function returns.
        self._function(*arguments)


def _processor() -> tuple[str, str]:
    return llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()


@cache
def _target() -> Any:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_default_triple()


def _machine() -> Any:
    cpu, features = _processor()
    # An engine takes the machine that it is given, so each has its own.
    return _target().create_target_machine(
        cpu=cpu, features=features, opt=2, reloc="pic", codemodel="jitdefault"
    )


def _compiled(text: str, machine: Any) -> bytes:
    """Machine code of a text, whose vectors and sums are written as they should be computed.

    LLVM's passes would take twice as long as all else, and make the code of large models slower.
    """
    return bytes(machine.emit_object(llvm.parse_assembly(text)))
