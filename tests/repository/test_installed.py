"""The installed package: it has all its files, and a study with an effect of another package."""

import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest
from places import ROOT

from accelstudy.files.tables import read_origin, read_table

EXAMPLES = ROOT / "examples"
INSTALL = ("uv", "pip", "install", "--quiet", "--offline", "--no-deps", "--no-build-isolation")
"""As `pip install`, without a network: what a package needs is there."""


class Shell:
    """Commands in a folder, as they are typed in an environment with the package."""

    def __init__(self, environment, folder):
        self.python, self.folder = environment / "bin" / "python", folder
        known = ("HOME", "LANG", "XDG_CACHE_HOME", "OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES")
        self.variables = {name: os.environ[name] for name in known if name in os.environ}
        self.variables["PATH"] = f"{environment / 'bin'}:{os.environ['PATH']}"
        self.variables["OPENBLAS_NUM_THREADS"] = "1"

    def __call__(self, command):
        """Run a command, which must end well; return what it prints."""
        done = subprocess.run(
            shlex.split(command), cwd=self.folder, env=self.variables,
            capture_output=True, text=True,
        )  # fmt: skip
        assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
        return done.stdout

    def install(self, source):
        """Install a wheel, or the folder of a package."""
        subprocess.run([*INSTALL, "--python", self.python, source], check=True)


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """An environment with the package from its wheel; the libraries are those of this one."""
    folder = tmp_path_factory.mktemp("environment")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder], check=True)
    (site,) = folder.glob("lib/python*/site-packages")
    (site / "libraries.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    command = folder / "bin" / "snakemake"
    command.write_text(f"#!{folder}/bin/python\nfrom snakemake.cli import main\n\nmain()\n")
    command.chmod(0o755)
    build = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", folder]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    Shell(folder, folder).install(wheel)
    return folder


@pytest.fixture
def shell(environment, tmp_path):
    return Shell(environment, tmp_path)


def test_it_is_the_installed_package(shell, environment):
    where = 'python -c "import accelstudy; print(accelstudy.__file__)"'
    assert Path(shell(where).strip()).is_relative_to(environment)


def test_the_package_has_all_its_files(environment):
    (site,) = environment.glob("lib/python*/site-packages/accelstudy")
    for folder in ("accelstudy", "config", "profiles", "workflow"):
        within = site if folder == "accelstudy" else site / "shipped" / folder
        for path in (ROOT / folder).rglob("*"):
            if path.is_file() and "__pycache__" not in path.parts:
                assert (within / path.relative_to(ROOT / folder)).read_bytes() == path.read_bytes()
    assert (site / "py.typed").is_file()


def test_a_maintainer_studies_an_effect_of_a_package(shell):
    """The package of the tutorial, from its installation to the tables of a study."""
    package = shutil.copytree(EXAMPLES / "package", shell.folder / "package")
    for source in ("effect/ripple.py", "scheme/wedge.py"):
        shutil.copy(EXAMPLES / source, package / "our_sensors")
    shell.install(package)
    model = "bias-scale-nonorthogonality+ripple(period=5)"
    shell("accelstudy init my-study")
    config = shell.folder / "my-study" / "config" / "config.yaml"
    text = config.read_text(encoding="utf-8")
    text = text.replace("models: bias-scale-nonorthogonality", f'models: ["{model}"]')
    text = text.replace("[fibonacci-12, fibonacci-24, fibonacci-48]", "[wedge-sides-8]")
    text = text.replace("approaches: [gravity, robot]", "approaches: robot")
    text = text.replace("replicates: 1000", "replicates: 100")
    config.write_text(text, encoding="utf-8")
    table = "results/my-study/summary.parquet"
    shell(f"snakemake --cores 2 --directory my-study --snakefile my-study/Snakefile -- {table}")
    summary = read_table(shell.folder / "my-study" / table)
    assert {"a_ripple_x", "a_ripple_y", "a_ripple_z"} < {*summary["parameter"]}
    assert {*summary["cell"].map(str).str.split("/").str[1]} == {"wedge-sides-8"}
    plugins = read_origin(shell.folder / "my-study" / table)["plugins"]
    assert "our-sensors 1.0 (our_sensors.ripple)" in plugins
