"""Plug-ins: a file or an installed package adds to the registries; what is wrong is one line."""

import importlib
import shutil
import sys
from pathlib import Path

import pytest
import yaml
from calling import call, refusal, refused, succeed
from places import ROOT
from plugin_helpers import forgotten
from snakemake_helpers import jobs, snakemake

from accelstudy import catalogue
from accelstudy.approaches import base as approaches
from accelstudy.basics import plugins
from accelstudy.basics.errors import InputError
from accelstudy.data_sheets import data_sheet_names, get_data_sheet
from accelstudy.drawing.style import symbol
from accelstudy.effects import effect_names, get_effect
from accelstudy.files.reading import config_hash
from accelstudy.files.tables import read_origin
from accelstudy.jobs import code_version
from accelstudy.noise_effects import base as noise_effects
from accelstudy.schemes import get_scheme
from accelstudy.schemes import register as register_scheme
from accelstudy.sensors.models import get_model
from accelstudy.study.config import read_study

EXAMPLES = ROOT / "examples"
RIPPLE = EXAMPLES / "effect" / "ripple.py"
STUDY = {
    "study": "mine", "seed": 1, "plugins": "ripple.py",
    "sensor": {"ripple": {"value": [0.006, 0.004, 0.005], "unit": "m/s^2"}},
    "grids": [{
        "models": ["bias-scale+ripple"], "schemes": ["fibonacci-24"], "approaches": ["gravity"],
        "replicates": 20,
    }],
}  # fmt: skip


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    """A folder with the plug-in of the tutorial; all plug-ins are forgotten at the end."""
    shutil.copy(RIPPLE, tmp_path)
    monkeypatch.chdir(tmp_path)
    with forgotten():
        yield


# --- files ---------------------------------------------------------------------------------------


def test_the_catalogue_shows_it_and_whose_it_is():
    text = succeed("effects", "--plugin", "ripple.py").stdout
    assert "\nripple: a_i sin(2π f_i / P)\n" in text
    assert text.count("plugin: ") == text.count("plugin: ripple.py") == 1


def test_the_help_loads_none():
    Path("bad.py").write_text("x = (")
    assert call("effects", "--plugin", "bad.py", "--help").exit_code == 0


def test_a_file_is_loaded_once_wherever_it_is_named():
    shutil.copy("ripple.py", "copy.py")
    plugins.load_files(["ripple.py", "ripple.py", Path("ripple.py").resolve(), "copy.py"])
    assert plugins.loaded_files() == ["ripple.py"]


# --- code of a program ---------------------------------------------------------------------------


def run(cell):
    """Run code as a notebook does."""
    exec(cell, {"__name__": "notebook"})


def bump(body="p[0] * f[0], 0, 0", name="Bump"):
    """Code of an effect."""
    return f"""
from accelstudy.effects.base import Effect, per_axis, register

@register
class {name}(Effect):
    name = "bump"
    parameters = per_axis("a_bump", "1", "a_%", "x")

    def output(self, f, p, g, hold, xp):
        return {body}
"""


def test_a_cell_that_runs_again_replaces_what_it_registered():
    assert symbol("b_x")
    run(bump())
    assert plugins.source_of("effect", "bump") == ("notebook", "Bump")
    first = get_model("bias-scale+bump")
    run(bump("p[0] * f[1], 0, 0"))
    assert "f_y" in get_effect("bump").equation
    assert get_model("bias-scale+bump") != first
    assert symbol("a_bump_x") == "$a_x$"
    with pytest.raises(InputError, match="is there already"):
        run(bump(name="Other"))


def test_an_imported_file_is_the_one_that_a_configuration_names(monkeypatch):
    monkeypatch.syspath_prepend(Path.cwd())
    monkeypatch.delitem(sys.modules, "ripple", raising=False)
    ripple = importlib.import_module("ripple")
    assert plugins.loaded_files() == [plugins.source_of("effect", "ripple")[0]] == ["ripple.py"]
    assert read_study(written()).cells
    importlib.reload(ripple)
    Path("ripple.py").write_text(Path("ripple.py").read_text() + "\n# Changed.\n")
    assert read_study(written()).cells


@pytest.mark.parametrize(("attributes", "message"), [
    ({"n_conditions": 3, "uses_angles": True}, "has 1 conditions, not 3"),
    ({"n_conditions": 1}, "lacks uses_angles"),
    ({"n_conditions": 1, "uses_angles": False}, "has conditions on angles, but .*"),
])  # fmt: skip
def test_an_approach_has_the_conditions_that_it_says(attributes, message):
    conditions = lambda self, f, angles, g, xp: (f[0] - g * xp.sin(angles[1]),)  # noqa: E731
    content = {"name": "one_axis", "conditions": conditions, **attributes}
    with pytest.raises(InputError, match=f"^approach 'one_axis': {message}$"):
        approaches.register(type("OneAxis", (approaches.Approach,), content))


def test_a_scheme_without_directions_is_one_line():
    register_scheme("flat", title="", status="generated", source="")(lambda: [[1, 0], [0, 1]])
    with pytest.raises(
        InputError, match=r"^scheme 'flat': directions must have the shape \(n, 3\)"
    ):
        get_scheme("flat")


def test_a_noise_effect_needs_no_setting_and_keeps_the_shape_of_noise():
    double = {"name": "double", "equation": "2 v", "typical": (1, 1)}
    noise_effects.register(type("Double", (noise_effects.NoiseEffect,), double))
    assert catalogue("effects").loc["double", "typical"] == ""
    sums = {**double, "disturb": lambda self, noise, sigma, hold, rng: noise.sum(axis=2)}
    with pytest.raises(InputError, match=r"^noise effect 'sums': disturb returns .* \(2, 5\) "):
        noise_effects.register(type("Sums", (noise_effects.NoiseEffect,), {**sums, "name": "sums"}))


# --- configurations ------------------------------------------------------------------------------


def written(**changes):
    Path("study.yaml").write_text(yaml.safe_dump({**STUDY, **changes}))
    return "study.yaml"


def test_a_configuration_names_it():
    assert "ripple" not in effect_names()
    study = read_study(written())
    assert study.plugins == ["ripple.py"]
    assert "ripple" in effect_names()
    content = study.model_dump(mode="json")
    assert config_hash(content) == config_hash({**content, "plugins": ["other/ripple.py"]})


def test_a_configuration_of_0_2_may_have_digests():
    with forgotten():
        assert read_study(written(plugins={"ripple.py": "0" * 16})).plugins == ["ripple.py"]
        assert "ripple" in effect_names()


# --- files of data, which may be of anybody ------------------------------------------------------


def model_file(named):
    content = {"plugins": named, "models": {"mine": ["bias", "ripple"]}}
    Path("model.yaml").write_text(yaml.safe_dump(content))
    return "model.yaml"


@pytest.mark.parametrize("named", ["ripple.py", ["ripple.py"], {"ripple.py": "12ab"}])
def test_a_model_in_a_file_names_it_and_loads_nothing(named):
    with refused("unknown effect 'ripple'", "needs the plug-in ripple.py", "give it with --plugin"):
        get_model(model_file(named))
    assert plugins.loaded_files() == []
    plugins.load_files(["ripple.py"])
    assert get_model("model.yaml").effects[1].name == "ripple"


def test_jobs_load_it_and_run_again_when_it_changes(tmp_path):
    table = "results/mine/tables/bias-scale+ripple(period=8)/fibonacci-24/gravity/summary.parquet"

    def run(*words):
        """As a new process does: nothing is loaded."""
        given = ("--snakefile", ROOT / "workflow" / "Snakefile", "--configfile", written())
        with forgotten():
            result = snakemake(tmp_path, "--cores", 1, *words, *given, "--", table)
        assert result.returncode == 0, result.stdout
        return result.stdout

    run()
    assert [*read_origin(table)["plugins"]] == ["ripple.py"]
    assert "Nothing to be done" in run()
    with Path("ripple.py").open("a") as file:
        file.write("# an edit\n")
    assert jobs(run("--dry-run")) == {"simulate": 1}


# --- packages ------------------------------------------------------------------------------------


@pytest.fixture
def package(tmp_path, monkeypatch):
    """The package of the tutorial, as an installer lays it down."""
    site = tmp_path / "site"
    shutil.copytree(EXAMPLES / "package" / "our_sensors", site / "our_sensors")
    shutil.copy(RIPPLE, site / "our_sensors")
    shutil.copy(EXAMPLES / "scheme" / "wedge.py", site / "our_sensors")
    info = site / "our_sensors-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: our-sensors\nVersion: 1.0\n")
    text = (EXAMPLES / "package" / "pyproject.toml").read_text(encoding="utf-8")
    entries = text[text.index("[project.entry-points") :]
    entries = entries.replace("[project.entry-points.", "[").replace('"', "")
    (info / "entry_points.txt").write_text(entries)
    monkeypatch.syspath_prepend(site)
    yield site / "our_sensors"
    for name in [name for name in sys.modules if name.split(".")[0] == "our_sensors"]:
        del sys.modules[name]


@pytest.mark.usefixtures("package")
def test_an_installed_package_is_found_when_it_is_looked_for():
    assert "our_sensors" not in sys.modules
    assert get_scheme("wedge-8").n_positions == 16
    assert "our_sensors.ripple" not in sys.modules
    assert get_effect("ripple(period=5)").settings == {"period": 5}
    assert "our-box" in data_sheet_names()
    assert get_data_sheet("our-box").title == "The sensor in our box"
    assert "plugin: our-sensors 1.0 (our_sensors.ripple)" in succeed("effects").stdout


def test_jobs_depend_on_the_content_of_a_package(package):
    before = code_version()
    assert "our_sensors" not in sys.modules
    with (package / "ripple.py").open("a") as file:
        file.write("# an edit\n")
    assert code_version() != before


def test_a_bad_package_is_one_line(package):
    (package / "ripple.py").write_text("x = 1")
    line = refusal("effects")
    assert line.startswith("error: our-sensors 1.0 (our_sensors.ripple): registers nothing")


def test_a_bad_data_sheet_of_a_package_is_one_line(package):
    (package / "sheets" / "our-box.yaml").rename(package / "sheets" / "adxl355.yaml")
    start = "our-sensors 1.0 (our_sensors.sheets): the sensor 'adxl355' is there already"
    with refused(start=start):
        data_sheet_names()
    (package / "sheets" / "adxl355.yaml").unlink()
    with refused("no data sheet (*.yaml) lies in this package"):
        data_sheet_names()
