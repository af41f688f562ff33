"""What another processor finds: the same designs, and the same estimates but for rounding."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from places import ROOT
from usual import NINE

from accelstudy.adjustment import calibrate
from accelstudy.approaches import get_approach
from accelstudy.basics.units import GON
from accelstudy.design.criteria import get_criterion
from accelstudy.design.search import Search
from accelstudy.design.task import Task
from accelstudy.positions.choice import first_best, stable_order
from accelstudy.schemes import get_scheme
from accelstudy.simulation.sessions import Noise, session

OTHER = {
    "OPENBLAS_CORETYPE": "Nehalem",
    "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR",
}


def found():
    """Designs, a bound, and estimates of simulated calibrations."""
    numbers = {}
    for approach, name, n, tilt in (("gravity", "I", 12, 30), ("robot", "I", 10, 50)):
        task = Task(NINE, get_approach(approach), tilt_range=tilt * GON)
        design = Search(task, get_criterion(name, task), n).optimum(starts=2, bounded=tilt == 30)
        numbers[f"design {approach}"] = design.directions.tolist()
        if tilt == 30:
            numbers["efficiency"] = design.efficiency
        ideal = session(NINE, np.full(9, 1e-4), get_scheme("icosidodecahedron-30").directions)
        observed = ideal.draw(Noise(), 200, np.random.default_rng(1))
        numbers[approach] = calibrate(NINE, get_approach(approach), observed).parameters.tolist()
    return numbers


def test_another_processor_finds_the_same_designs_and_estimates_but_for_rounding():
    command = "import json, test_processors as t; print(json.dumps(t.found()))"
    paths = [str(ROOT), str(ROOT / "tests/helpers"), str(ROOT / "tests/design")]
    done = subprocess.run(
        [sys.executable, "-c", command], check=True, capture_output=True, text=True,
        env={**os.environ, **OTHER, "PYTHONPATH": os.pathsep.join(paths)},
    )  # fmt: skip
    here, there = found(), json.loads(done.stdout)
    assert here["efficiency"] == pytest.approx(there["efficiency"], rel=1e-7)
    for approach in ("gravity", "robot"):
        assert here[f"design {approach}"] == there[f"design {approach}"]
        one, other = np.array(here[approach]), np.array(there[approach])
        sd = one.std(axis=0)
        np.testing.assert_allclose(one / sd, other / sd, rtol=0, atol=1e-10)
        np.testing.assert_allclose(sd, other.std(axis=0), rtol=1e-12)


def test_what_is_equal_but_for_rounding_keeps_its_order():
    rounding = np.array([2.0, -1.0, 0.0, 1.0]) * 1e-15
    assert first_best([3.0, *(1.0 + rounding), np.nan]) == 1
    assert stable_order([3.0, *(1.0 + rounding), 0.5]).tolist() == [5, 1, 2, 3, 4, 0]
