"""What a job of a workflow depends on, so that an edit of the package runs it again."""

import shutil
from pathlib import Path

import grimp
import pytest
from places import ROOT

import accelstudy
from accelstudy.jobs.code import code_files, code_hash

PACKAGE = Path(accelstudy.__file__).parent
SCRIPTS = {path.stem: path for path in (ROOT / "workflow" / "scripts").glob("*.py")}
STAGES = {"simulate", "sensitivity", "claims", "figures", "calibrate", "overview"}
BUT_OVERVIEW = STAGES - {"overview"}


@pytest.fixture(scope="module")
def names():
    """Of the files that each script depends on."""
    return {
        stage: {path.relative_to(PACKAGE).as_posix() for path in code_files(script)}
        for stage, script in SCRIPTS.items()
    }


@pytest.mark.parametrize(("name", "stages"), [
    ("effects/bias.py", STAGES),
    ("approaches/robot.py", STAGES),
    ("schemes/mclaren.py", STAGES),
    ("adjustment/gauss_helmert.py", BUT_OVERVIEW),
    ("simulation/sessions.py", BUT_OVERVIEW),
    ("noise_effects/base.py", BUT_OVERVIEW),
    ("simulation/hold_plan.py", BUT_OVERVIEW),
    ("leveling/error.py", BUT_OVERVIEW),
    ("study/config/schema.py", {"sensitivity", "claims", "figures"}),
    ("study/batches.py", {"simulate"}),
    ("study/quantiles.py", {"simulate", "claims"}),
    ("leveling/sensitivity.py", {"sensitivity", "claims", "figures"}),
    ("design/closed_forms.py", {"simulate"}),
    ("drawing/style.py", {"figures", "calibrate"}),
    ("study/figures/sweep.py", {"figures"}),
    ("study/beyond_linear_theory.py", {"claims", "figures"}),
    ("study/claims/claims.yaml", {"claims"}),
    ("study/claims/page.html.j2", {"claims"}),
    ("pages/base.html.j2", {"claims", "calibrate", "overview"}),
    ("campaign/gross_errors/base.py", {"calibrate"}),
    ("campaign/calibration/fit.py", {"calibrate"}),
    ("basics/levels.py", {"calibrate", "overview"}),
    ("campaign/batch/overview.html.j2", {"calibrate", "overview"}),
    ("adjustment/quality/tests.py", {"calibrate"}),
    ("commands/main.py", set()),
    ("commands/catalogue.py", set()),
    ("jobs/earlier.py", set()),
])  # fmt: skip
def test_stages_that_depend_on_a_file(name, stages, names):
    assert (PACKAGE / name).is_file()
    assert {stage for stage in STAGES if name in names[stage]} == stages


def test_no_import_is_overlooked(names):
    """As a library sees them; it sees no registries and templates."""
    graph = grimp.build_graph("accelstudy", exclude_type_checking_imports=True, cache_dir=None)
    files = {
        module: f"{'/'.join(module.split('.')[1:])}{'/__init__' if inner else ''}.py"
        for module in graph.modules
        for inner in [bool(graph.find_children(module))]
    }
    for stage, used in names.items():
        for module, name in files.items():
            if name in used:
                imported = graph.find_modules_directly_imported_by(module) - {"accelstudy"}
                assert {files[each] for each in imported} <= used, (stage, module)


def test_an_edit_or_a_new_file_makes_another_hash(tmp_path, monkeypatch):
    """Where the package lies makes no difference."""
    no_caches = shutil.ignore_patterns("__pycache__")
    copy = Path(shutil.copytree(PACKAGE, tmp_path / "accelstudy", ignore=no_caches))

    def hashes():
        return [code_hash(SCRIPTS[stage]) for stage in ("simulate", "figures")]

    before = hashes()
    monkeypatch.setattr(accelstudy, "__file__", str(copy / "__init__.py"))
    assert hashes() == before
    with (copy / "study" / "figures" / "sweep.py").open("a") as file:
        file.write("# an edit\n")
    simulate, figures = hashes()
    assert simulate == before[0]
    assert figures != before[1]
    (copy / "effects" / "new.py").touch()  # beside those of a registry
    assert hashes()[0] != simulate
