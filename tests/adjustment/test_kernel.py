"""The compiled adjustment against the NumPy path: the same numbers, whoever shares the lanes."""

from dataclasses import fields, replace

import numpy as np
import pytest
from study_helpers import grid, make_cells, simulated
from usual import GRAVITY, NINE, ROBOT

from accelstudy import adjustment
from accelstudy.adjustment.calibration import Block, CalibrationProblem
from accelstudy.adjustment.equations import equations_of
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import GON
from accelstudy.effects import HoldConditions, effect_names
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import get_model
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.sessions import BLOCK, Noise, session
from accelstudy.study import compiling
from accelstudy.study.compiling import POSITIONS_PER_PARAMETER

pytest.importorskip("llvmlite")

from accelstudy.kernel import calibrate
from accelstudy.kernel.formulas import Formulas
from accelstudy.kernel.lanes import LANES, Code

ODD = get_model("bias+scale+saturation(knee=8)+warm_up(tau=500)")


@pytest.fixture(scope="module", autouse=True)
def caches(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("caches")))
        yield


def drawn(model, noise, replicates, seed, scheme="mclaren-24"):
    """Sessions of a sensor with parameters at random."""
    rng = np.random.default_rng(seed)
    parameters = 1e-3 * rng.standard_normal(model.n_parameters)
    positions = get_scheme(scheme)
    n = positions.n_positions
    hold = HoldConditions(temperature=rng.uniform(0, 40, n), time=60.0 * np.arange(n))
    ideal = session(model, parameters, positions.directions, hold=hold)
    return ideal.draw(noise, replicates, rng)


def both(model, approach, observed):
    return (
        calibrate.calibrate(model, approach, observed),
        Block.of(adjustment.calibrate(model, approach, observed)),
    )


def assert_same(found, expected):
    """To 1e-10, relative to the numbers and to their standard deviations."""
    assert np.array_equal(found.converged, expected.converged)
    assert np.array_equal(found.iterations, expected.iterations)
    assert found.redundancy == expected.redundancy
    done = expected.converged
    sigma = expected.sigma_priori[done]
    size = sigma + np.abs(expected.estimates[done])
    assert np.max(np.abs(found.estimates - expected.estimates)[done] / size, initial=0) < 1e-10
    assert found.sigma_priori[done] == pytest.approx(sigma, rel=1e-10, abs=0)
    assert found.omega[done] == pytest.approx(expected.omega[done], rel=1e-10, abs=1e-10)
    assert found.correlation_sum == pytest.approx(expected.correlation_sum, abs=1e-10 * len(done))
    for name in ("estimates", "sigma_priori", "omega"):
        assert np.isnan(getattr(found, name)[~done]).all()


@pytest.mark.parametrize(
    ("model", "approach", "sigma_gravity"),
    [(NINE, ROBOT, 0), (ODD, GRAVITY, 1e-4)],
    ids=["robot", "odd-gravity"],
)
def test_random_cells(model, approach, sigma_gravity):
    rng = np.random.default_rng(5)
    converged = 0
    for seed in range(8):
        noise = Noise(
            # Below, rounding of the observations alone is more than 1e-10 of it.
            sigma_force=10 ** rng.uniform(-4, -1.5),
            sigma_angle=10 ** rng.uniform(-7, -3) if seed % 4 else 0.0,
            sigma_gravity=sigma_gravity,
            gravity_error=1e-3 * rng.standard_normal(),
            effects=[(), ("heavy_tails", "quantisation"), ("coloured_noise",)][seed % 3],
        )
        scheme = ["mclaren-24", "fibonacci-17", "faces-edges-corners-26"][seed % 3]
        observed = drawn(model, noise, 1 + 7 * seed, seed, scheme)
        found, expected = both(model, approach, observed)
        assert_same(found, expected)
        converged += found.converged.sum()
    assert converged > 150


def test_what_does_not_converge_and_what_is_singular():
    observed = drawn(NINE, Noise(sigma_force=2.0), 100, 1)
    found, expected = both(NINE, GRAVITY, observed)
    assert 0 < found.converged.sum() < 100
    assert_same(found, expected)
    observed = drawn(NINE, Noise(), 5, 1, "faces-6")
    with pytest.raises(InputError, match="6 condition equations cannot determine 9 parameters"):
        calibrate.calibrate(NINE, GRAVITY, observed)
    found, expected = both(NINE, ROBOT, drawn(NINE, Noise(), 5, 1).take(np.zeros(24, int)))
    assert not found.converged.any()
    assert_same(found, expected)
    # A robot that tells next to nothing, beside a good sensor, is no reason not to converge.
    found, expected = both(NINE, ROBOT, drawn(NINE, Noise(1e-5, 10 * GON), 20, 1))
    assert found.converged.all()
    assert expected.converged.all()


def test_who_shares_the_lanes_changes_no_bit():
    """Among sessions that end early, late and not at all, and in the lanes beyond the last."""
    observed = drawn(NINE, Noise(sigma_force=2.0), 3 * LANES + 1, 1)
    whole = calibrate.calibrate(NINE, GRAVITY, observed)
    assert len(set(whole.iterations[whole.converged])) > 1
    assert not whole.converged.all()
    for chosen in (slice(0, 3), slice(5, 2 * LANES), slice(None, None, -1)):
        part = calibrate.calibrate(NINE, GRAVITY, observed.sessions(chosen))
        for name in (field.name for field in fields(Block)):
            if name not in ("redundancy", "correlation_sum"):
                expected = getattr(whole, name)[chosen]
                assert getattr(part, name).tobytes() == expected.tobytes()


@pytest.mark.parametrize("approach", [GRAVITY, ROBOT], ids=["gravity", "robot"])
def test_the_formulas_of_every_effect(approach):
    names = effect_names()
    few = 3  # of seven together, the products make the compiler ten times as slow
    for first in range(0, len(names), few):
        model = SensorModel.of("some", names[first : first + few])
        equations = equations_of(model.trace, approach, False)
        traced = equations.linear
        n = len(traced.arguments)
        rng = np.random.default_rng(first)
        values = rng.uniform(-4, 4, (n, LANES))
        values[[a in model.trace.formulas.settings for a in traced.arguments]] = 0.7

        formulas = Formulas(list(traced.expressions), frozenset())
        code = Code("f", (), ("x", "y"))
        table = {symbol: code.load("x", k * LANES) for k, symbol in enumerate(traced.arguments)}
        for k, value in enumerate(formulas.write(code, table)):
            code.store(value, "y", k * LANES)
        result = np.empty((len(traced.expressions), LANES))
        calibrate.CompiledCode(code.text(), "f", 0, 2).call(values.ctypes.data, result.ctypes.data)
        expected = traced((LANES,), *values).reshape(result.shape)
        assert result == pytest.approx(expected, rel=1e-11, abs=1e-11)


def test_code_that_is_kept_is_compiled_once_and_needs_no_symbols(monkeypatch):
    made, make = [], calibrate._compiled
    monkeypatch.setattr(calibrate, "_compiled", lambda *given: made.append(1) or make(*given))
    model = get_model("scale+bias")  # which no other test compiles
    problem = CalibrationProblem.of(model, GRAVITY, drawn(model, Noise(), 5, 1))
    for _ in range(2):
        kernel = calibrate.Kernel(problem.conditions.equations)
        assert kernel.calibrate(problem).converged.all()
    assert "latent" not in vars(kernel.function)
    assert len(made) == 1


@pytest.mark.parametrize("approach", ["gravity", "robot"])
def test_a_compiled_cell_of_a_study(approach):
    (cell,) = make_cells(grid(approaches=approach, replicates=BLOCK + 30)).values()
    cell = replace(cell, compiled=True)
    found = simulated(cell)
    assert_same(found, simulated(replace(cell, compiled=False)))


def test_which_cells_are_compiled(monkeypatch):
    """Those of a code that takes NumPy longer than the compiler, over all cells that share it."""
    pays = -(-9 * POSITIONS_PER_PARAMETER // 24)

    def compiled_cells(*replicates):
        grids = [
            grid(schemes=["mclaren-24"], approaches="gravity", replicates=replicates[0]),
            grid(schemes=["mclaren-24"], approaches="robot", replicates=replicates[1]),
            grid(schemes=["rings-24"], approaches="gravity", replicates=replicates[2]),
        ]
        return [cell.compiled for cell in make_cells(*grids).values()]

    assert compiled_cells(pays - 1, pays, 1) == [True, True, True]
    assert compiled_cells(pays - 2, pays - 1, 1) == [False, False, False]
    monkeypatch.setattr(compiling, "find_spec", lambda name: None)
    assert compiled_cells(pays, pays, pays) == [False, False, False]
    (cell,) = make_cells(grid(approaches="gravity")).values()
    with pytest.raises(InputError, match=r"install accelstudy\[kernel\]"):
        simulated(replace(cell, compiled=True))


def test_parameters_with_a_prior():
    """Few positions, so that the prior counts; gravity is observed, too."""
    model = get_model("bias+learned(coordinate=time wave, target=bias, period=900, amplitude=3e-3)")
    observed = drawn(model, Noise(sigma_force=1e-3, sigma_gravity=1e-4), 9, 3, "fibonacci-17")
    found, expected = both(model, ROBOT, observed)
    assert found.converged.all()
    assert_same(found, expected)
