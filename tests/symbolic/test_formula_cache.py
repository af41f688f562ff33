"""What is made of formulas is kept on disk: the same numbers without SymPy, or made again."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import accelstudy
from accelstudy.adjustment import calibrate
from accelstudy.adjustment.equations import equations_of
from accelstudy.approaches import approach_names, get_approach
from accelstudy.effects import Effect, HoldConditions, get_effect
from accelstudy.files.cache import cache_folder
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import get_model
from accelstudy.sensors.sensor import not_affine
from accelstudy.sensors.trace import trace_of
from accelstudy.simulation.sessions import Noise, session
from accelstudy.symbolic import formula_cache
from accelstudy.symbolic.tracing import TracedFunction

MODEL = "bias+scale+saturation(knee=8)[k_sat_z]+thermal_bias+encoder_offset"
PACKAGE = Path(accelstudy.__file__).parent


@pytest.fixture(autouse=True)
def caches(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    forget()
    yield
    forget()


def forget():
    """Forget what this process has traced."""
    trace_of.cache_clear()
    equations_of.cache_clear()
    formula_cache._versions.cache_clear()


def numbers():
    """Bytes of a simulated session and of its calibrations, and what is known of the model."""
    forget()
    model, scheme = get_model(MODEL), get_scheme("fibonacci-30")
    temperature = np.random.default_rng(1).uniform(0, 40, scheme.n_positions)
    x = np.linspace(-1e-3, 1e-3, model.n_parameters)
    ideal = session(model, x, scheme.directions, hold=HoldConditions(temperature=temperature))
    observed = ideal.draw(Noise(), 3, np.random.default_rng(2))
    found = [model.trace.conditions, not_affine(model), ideal.forces.tobytes()]
    found.append(model.correction_jacobian(ideal.forces, x, hold=ideal.hold).tobytes())
    for approach in approach_names():
        result = calibrate(model, get_approach(approach), observed)
        found += [result.parameters.tobytes(), result.cofactors.tobytes()]
    return found


def test_kept_functions_give_the_same_bits_and_are_not_made_again(monkeypatch):
    first = numbers()
    monkeypatch.setattr(TracedFunction, "_generate", None)
    assert numbers() == first


LATER = """\
import sys
import accelstudy.campaign.format, accelstudy.study.config
print([name for name in ("sympy.core", "matplotlib", "scipy.stats") if name in sys.modules])
from accelstudy.sensors.models import get_model
print(get_model("bias-scale").sense([[0.0, 0.0, -9.8]], [0.001] * 6).tolist())
print("sympy.core" in sys.modules)
"""


def test_a_later_process_loads_no_sympy():
    """Neither to check a configuration nor to compute."""
    here = get_model("bias-scale").sense([[0.0, 0.0, -9.8]], [0.001] * 6).tolist()
    ran = subprocess.run([sys.executable, "-c", LATER], capture_output=True, text=True, check=True)
    assert ran.stdout.splitlines() == ["[]", str(here), "False"]


def test_different_formulas_have_different_keys():
    specs = (
        *("bias", "saturation", "saturation[k_sat_z]", "saturation[k_sat_x]", "learned"),
        *("learned(coordinate=yaw)", "learned(target=scale)", "learned(length=0.25)"),
    )
    key_of, kinds = formula_cache.key_of, [type(get_effect(spec)) for spec in specs]
    keys = [key_of(kind) for kind in kinds]
    assert None not in keys
    assert len({*keys, key_of(*kinds), key_of(*kinds[::-1])}) == len(specs) + 2
    assert key_of(type(get_effect("saturation(knee=9)"))) == keys[1]  # settings are symbols


def test_what_is_not_of_the_package_is_not_kept():
    class Own(Effect):
        name = "own"
        parameters = get_effect("bias").parameters

    assert formula_cache.key_of(type(get_effect("bias")), Own) is None
    assert formula_cache.cached_by_key(None, "name", lambda: [1]) == [1]
    assert not cache_folder(formula_cache.KIND).exists()
    patched = type("Patched", (type(get_effect("bias")),), {"output": lambda *_: (1, 1, 1)})
    assert formula_cache.key_of(patched) is None


def test_another_formula_or_processor_makes_other_keys(tmp_path, monkeypatch):
    """In a copy of the package, of whose files keys are made."""
    for room in formula_cache.ROOMS:
        shutil.copytree(PACKAGE / room, tmp_path / room)
    monkeypatch.setattr(accelstudy, "__file__", str(tmp_path / "__init__.py"))
    kind = type(get_effect("bias"))
    before = formula_cache.key_of(kind)
    with (tmp_path / "effects" / "scale.py").open("a", encoding="utf-8") as file:
        file.write("# changed\n")
    forget()
    changed = formula_cache.key_of(kind)
    monkeypatch.setattr(formula_cache, "version", lambda name: "0")
    forget()
    assert len({before, changed, formula_cache.key_of(kind)}) == 3


def test_keys_have_all_files_on_which_formulas_depend():
    names = ("sensors.trace", "adjustment.equations", "kernel.writing", "leveling.angles")
    modules = ", ".join(f"accelstudy.{name}" for name in names)
    code = f"import sys, {modules}; print(*(m for m in sys.modules if m[:11] == 'accelstudy.'))"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    rooms = {name.split(".")[1] for name in ran.stdout.split()}
    assert rooms - {"config_names"} <= {*formula_cache.ROOMS}
