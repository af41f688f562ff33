"""JAX: `vmap` over the sessions of the same adjustment, made of the same traced formulas.

It follows `accelstudy.adjustment.gauss_helmert`, which explains it, for one session. What JAX would
do by a routine of LAPACK for each small matrix is written out, which is faster.
"""

import os
from functools import partial
from importlib.util import find_spec

import numpy as np
import sympy as sp

from accelstudy.adjustment.calibration import CalibrationProblem
from accelstudy.adjustment.equations import equations_of
from accelstudy.adjustment.gauss_helmert import MAX_ITERATIONS, STEP_TOLERANCE
from problem import MODEL
from processes import scratch
from ways.base import Way, register

INSTALLED = find_spec("jax") is not None
if INSTALLED:
    # Read when JAX is imported; one thread, as all.
    os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_platforms", "cpu")
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_compilation_cache_dir", os.fspath(scratch()))


@register
class Vmap(Way):
    """Jitted, in double precision."""

    name, title = "jax", "JAX, `jit` and `vmap`"
    calibrations, difference = 1000, 1e-10

    @staticmethod
    def missing():
        """Return what to install."""
        return "" if INSTALLED else "uv pip install jax"

    def __init__(self, approach):
        self._approach = approach
        equations = equations_of(MODEL.trace, approach, False)
        fit = partial(_fit, equations, _function(_inner(equations)), _function(equations.linear))
        self._fit = jax.jit(jax.vmap(fit, in_axes=(0, None, None), out_axes=1))

    def solve(self, observed):
        """Solve them."""
        problem = CalibrationProblem.of(MODEL, self._approach, observed)
        sessions = np.moveaxis(problem.observations, 2, 1)
        return np.array(self._fit(sessions, problem.cofactors.T, problem.conditions.gravity))


def _inner(equations):
    return equations.sensitive if equations.knows_force else equations.trace.newton_step


def _function(traced):
    """A traced function in JAX's operations, of arrays (n,); its values (rows, columns, n)."""
    function = sp.lambdify(traced.arguments, list(traced.expressions), modules="jax", cse=True)

    def evaluate(n, known):
        values = function(*(known[symbol] for symbol in traced.arguments))
        rows = [jnp.broadcast_to(jnp.asarray(value, dtype=float), n) for value in values]
        return jnp.stack(rows).reshape(*traced.shape, n)

    return evaluate


def _fit(equations, inner, linear, observed, cofactors, gravity):
    """Estimates and standard deviations a posteriori, (2, u), of observations (o, n)."""
    formulas = equations.trace.formulas
    u, n = equations.n_parameters, observed.shape[1]
    unused = dict.fromkeys(formulas.arguments, 0.0)

    def step(x, v, f_a):
        adjusted = observed + v
        known = {**unused, formulas.g: gravity}
        known |= zip((*formulas.p, *equations.observations), (*x, *adjusted), strict=True)
        known |= zip(formulas.force, f_a, strict=True)
        f_a = inner(n, known)[:, 0] + (0.0 if equations.knows_force else f_a)
        values = linear(n, known | dict(zip(formulas.force, f_a, strict=True)))
        psi, a, b = values[:, 0], values[:, 1 : 1 + u], values[:, 1 + u :]

        bq = b * cofactors
        whitening = _cholesky(jnp.einsum("con,don->cdn", bq, b))
        a_white = _forward(whitening, a)
        w_white = _forward(whitening, psi - jnp.einsum("con,on->cn", b, v))
        normal = jnp.einsum("cin,cjn->ij", a_white, a_white)
        scale = jnp.sqrt(jnp.diagonal(normal))
        lower = _cholesky(normal / (scale[:, None] * scale))
        half = _forward(lower, -jnp.einsum("cun,cn->u", a_white, w_white) / scale)
        dx = _backward(lower, half) / scale

        misclosure = w_white + jnp.einsum("cun,u->cn", a_white, dx)
        v_new = -jnp.einsum("cn,con->on", _backward(whitening, misclosure), bq)
        sizes = (
            jnp.sqrt(half @ half),
            jnp.max(jnp.abs(v_new - v) / jnp.sqrt(cofactors)),
            jnp.max(jnp.abs(_forward(whitening, psi))),
        )
        inverse = _forward(lower, jnp.eye(u)) / scale
        sigma = jnp.sqrt(jnp.sum(inverse**2, axis=0) * jnp.sum(misclosure**2))
        return x + dx, v_new, f_a, jnp.max(jnp.stack(sizes)), sigma

    def going_on(state):
        number, (*_, size, _) = state
        return (number < MAX_ITERATIONS) & (size > STEP_TOLERANCE)

    def iteration(state):
        number, (x, v, f_a, *_) = state
        return number + 1, step(x, v, f_a)

    start = (jnp.zeros(u), jnp.zeros_like(observed), observed[:3], jnp.inf, jnp.zeros(u))
    _, (x, _, _, size, sigma) = jax.lax.while_loop(going_on, iteration, (0, start))
    conditions = equations.linear.shape[0]
    result = jnp.stack([x, sigma / np.sqrt(conditions * n - u)])
    return jnp.where(size <= STEP_TOLERANCE, result, jnp.nan)


def _cholesky(matrix):
    """Lower triangle of L, L Lᵀ = M, of the first two axes, as rows."""
    rows = []
    for i, row in enumerate(matrix):
        own = []
        for j in range(i + 1):
            rest = row[j] - sum(p * q for p, q in zip(own, rows[j] if j < i else own, strict=False))
            own.append(jnp.sqrt(rest) if i == j else rest / rows[j][j])
        rows.append(own)
    return rows


def _forward(lower, right):
    """Solve L y = b."""
    result = []
    for row, value in zip(lower, right, strict=True):
        known = sum(p * y for p, y in zip(row, result, strict=False))
        result.append((value - known) / row[-1])
    return jnp.stack(result)


def _backward(lower, right):
    """Solve Lᵀ x = y."""
    result = list(right)
    for i in reversed(range(len(result))):
        known = sum(lower[j][i] * result[j] for j in range(i + 1, len(result)))
        result[i] = (result[i] - known) / lower[i][i]
    return jnp.stack(result)
