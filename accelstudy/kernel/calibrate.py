"""Calibrations of many replicates by code that is compiled for this processor, and kept on disk."""

from __future__ import annotations

import ctypes
import hashlib
from functools import cache
from typing import Any

import llvmlite
import llvmlite.binding as llvm
import numpy as np

from accelstudy.adjustment.calibration import Block, CalibrationProblem
from accelstudy.adjustment.equations import CalibrationEquations
from accelstudy.adjustment.gauss_helmert import redundancy_of
from accelstudy.adjustment.observations import Observations
from accelstudy.approaches import Approach
from accelstudy.basics.arrays import Array
from accelstudy.files.cache import cached
from accelstudy.kernel.lanes import LANES
from accelstudy.kernel.writing import INTEGERS, NAME, POINTERS, KernelFunction, text_of
from accelstudy.sensors.sensor import SensorModel

KIND = "kernels"
"""Under which compiled functions are kept."""


class Kernel:
    """Compiled code for one kind of sensor model and one approach.

    Parameters
    ----------
    equations : CalibrationEquations
    """

    def __init__(self, equations: CalibrationEquations) -> None:
        self.function = KernelFunction(equations)
        self._below = np.tril_indices(self.function.u, -1)
        self._compiled = CompiledCode(text_of(self.function), NAME, len(INTEGERS), len(POINTERS))

    def calibrate(self, problem: CalibrationProblem) -> Block:
        """Calibrate the sessions of a problem; result and errors as of `calibrate`."""
        function = self.function
        count, n, _ = problem.observed[0].shape
        u = function.u
        redundancy = redundancy_of(function.c * n, problem.weights)
        padded = -(-count // LANES) * LANES
        results = np.empty((2 * u + 3, padded))
        correlations = np.zeros((u * (u - 1) // 2, LANES))
        # Without angles, the forces take their place and are not read.
        forces, angles = (np.ascontiguousarray(problem.observed[k]) for k in (0, -1))
        arrays = [
            self._known(problem),
            forces,
            angles,
            np.ascontiguousarray(problem.initial),
            problem.weights,
            _aligned(n * function.work * LANES),
            results,
            correlations,
        ]
        self._compiled.call(n, count, *(array.ctypes.data for array in arrays))
        correlation = np.diag(np.full(u, results[2 * u + 2, :count].sum()))
        correlation[self._below] = correlation.T[self._below] = correlations.sum(axis=1)
        return Block(
            estimates=results[:u, :count].T,
            sigma_priori=results[u : 2 * u, :count].T,
            omega=results[2 * u, :count],
            redundancy=redundancy,
            iterations=results[2 * u + 1, :count].astype(int),
            converged=results[2 * u + 2, :count] > 0,
            correlation_sum=correlation,
        )

    def _known(self, problem: CalibrationProblem) -> Array:
        """Numbers of the positions that are the same in all replicates, (n, columns)."""
        conditions, known = problem.conditions, self.function.known
        trace, n = conditions.equations.trace, len(problem.cofactors)
        sigmas = np.sqrt(problem.cofactors)
        columns = [sigmas, np.divide(1.0, sigmas, out=np.zeros_like(sigmas), where=sigmas > 0)]
        if known.shape[0]:
            unused, p = np.zeros((3, 1, n)), np.zeros((trace.n_parameters, 1))
            g = np.array([conditions.gravity], dtype=float)
            values = trace.evaluate(
                known, unused, unused, p, conditions.settings, g, conditions.hold
            )
            columns.append(values[:, 0, 0].T)
        return np.concatenate(columns, axis=1)


@cache
def kernel_of(equations: CalibrationEquations) -> Kernel:
    """Return the compiled code for some equations, made once, as that may take seconds."""
    return Kernel(equations)


def calibrate(model: SensorModel, approach: Approach, observed: Observations) -> Block:
    """Calibrate R sessions; parameters, numbers and errors as of `adjustment.calibrate`."""
    problem = CalibrationProblem.of(model, approach, observed)
    return kernel_of(problem.conditions.equations).calibrate(problem)


def _aligned(count: int) -> Array:
    """Memory for numbers, aligned for vectors."""
    memory = np.empty(count + LANES)
    return memory[-(memory.ctypes.data // 8) % LANES :][:count]


# From LLVM's text to a function ------------------------------------------------------------------


class CompiledCode:
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
