"""Strangers go from nothing to their last result, by the commands of the pages that they read.

A geodesist with a table and a CSV, a robotics engineer with a bag and a controller; and, with the
installed package and nothing else, a maintainer with an effect in a package of its own.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from calling import succeed
from log_helpers import session
from places import ROOT
from recorded import write_bag
from transcript import commands_of_page

from accelstudy.basics.units import GON
from accelstudy.files.tables import read_origin, read_table
from accelstudy.leveling.angles import roll_pitch
from accelstudy.schemes import get_scheme

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


@pytest.fixture
def typed_in(tmp_path, monkeypatch):
    """Function that runs a command in a folder of its own, and returns what it prints."""
    monkeypatch.chdir(tmp_path)
    return lambda line: succeed(*shlex.split(line)[1:]).stdout


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


# --- a geodesist with a table and a CSV ----------------------------------------------------------

GRAVITY = 9.80795
AXES = np.array([[1, 1e-3, -5e-4], [0, 1, 8e-4], [0, 0, 1]])


def read(force):
    """What a sensor with errors of its own reads, but for its noise."""
    return force @ AXES.T * [1.003, 0.998, 1.001] + [0.05, -0.02, 0.03]


def logged(seed, directions, moving, still):
    """True forces of a session, and its readings: each position is shaken before it rests."""
    true, _ = session(seed, sigma=0, still=still, moving=moving, forces=-GRAVITY * directions)
    noise = np.random.default_rng(seed).normal(0, 0.005, true.shape)
    return true, read(true) + noise


def test_a_geodesist_levels_a_log(typed_in):
    """By the commands of the page, with the best positions and gravity as it tells to give it."""
    typed = commands_of_page((ROOT / "docs/start/geodesist.md").read_text(encoding="utf-8"))
    commands = [line for line in typed if line.startswith("accelstudy ")]
    design, imported, calibrate, apply, advise = commands
    typed_in(design)
    positions = yaml.safe_load(Path("my-positions.yaml").read_text(encoding="utf-8"))
    true, readings = logged(1, np.array(positions["directions"]), 100, 600)
    timed = np.column_stack([0.01 * np.arange(len(true)), readings])
    np.savetxt("calibration.csv", timed, "%.5f", delimiter=",", header="t,ax,ay,az", comments="")
    assert "campaign: my-campaign (18 positions)" in typed_in(f"{imported} --gravity {GRAVITY}")
    said = typed_in(calibrate)
    assert "ACCEPTED" in said
    promised = [float(x) for x in re.findall(r"([\d.]+) mgon in (?:roll|pitch)", said)]
    typed_in(apply)
    leveled = pd.read_csv("leveled.csv")
    rested = (np.arange(len(true)) % 700 >= 100) & (leveled["near_pole"] == 0)
    angles = np.stack(roll_pitch(tuple(true[rested].T)), axis=1) / GON
    errors = leveled.loc[rested, ["roll_gon", "pitch_gon"]].to_numpy() - angles
    errors = (errors + 200) % 400 - 200
    positioned = np.repeat(np.arange(18), 600)[: len(errors)]
    flat = np.abs(angles).max(axis=1) < 50.01
    means = pd.DataFrame(errors[flat]).groupby(positioned[flat]).mean()
    assert 1e3 * np.sqrt((means**2).mean()).max() < 3 * max(promised) < 10
    assert "YOU CAN STOP" in typed_in(advise)
    assert Path("calibrated/report.html").is_file()


# --- a robotics engineer with a bag and a controller ----------------------------------------------

CONTROLLER = """
#include <math.h>
#include <stdio.h>
#include "calibration.h"

int main(void)
{
    float reading[3], force[3];
    while (scanf("%f %f %f", reading, reading + 1, reading + 2) == 3) {
        accel_calibrate(reading, force);
        float roll = atan2f(force[1], force[2]);
        float pitch = atan2f(-force[0], hypotf(force[1], force[2]));
        printf("%.7f %.7f %.7f %.7f %.7f\\n", force[0], force[1], force[2], roll, pitch);
    }
    return 0;
}
"""


def test_a_robotics_engineer_takes_a_bag_to_a_controller(typed_in, tmp_path):
    """A bag of rests in ROS axes, and C that is compiled and gets the readings of the sensor."""
    flu = np.array([1, -1, -1])  # x forward, y left, z up, as in ROS
    _, readings = logged(2, get_scheme("fibonacci-24").directions, 50, 300)
    time = np.arange(len(readings)) / 50
    write_bag(tmp_path / "session.bag", time, {"/imu/data": readings * flu})
    said = typed_in(f"accelstudy import session.bag --gravity {GRAVITY} --out arm")
    assert "campaign: arm (24 positions)" in said
    assert "ACCEPTED" in typed_in("accelstudy calibrate arm --out calibrated")
    header = typed_in("accelstudy export calibrated/calibration.json --form c")
    Path("calibration.h").write_text(header, encoding="utf-8")
    Path("controller.c").write_text(CONTROLLER, encoding="utf-8")
    compile_it = "cc -std=c99 -Wall -Wextra -Werror controller.c -o controller -lm"
    subprocess.run(shlex.split(compile_it), check=True)
    tilted = -GRAVITY * get_scheme("mclaren-24").directions
    lines = "\n".join(" ".join(map(repr, row)) for row in (read(tilted) * flu).tolist())
    done = subprocess.run(["./controller"], input=lines, capture_output=True,
                          text=True, check=True)  # fmt: skip
    given = np.array([line.split() for line in done.stdout.splitlines()], dtype=float)
    np.testing.assert_allclose(given[:, :3] * flu, tilted, atol=0.005)
    roll, pitch = roll_pitch(tuple(tilted.T))
    low = np.abs(pitch) < 1.2
    flat = np.cos(pitch[low])  # near the roll pole, roll means nothing
    off = (given[low, 3] - roll[low] + np.pi) % (2 * np.pi) - np.pi
    assert np.abs(off * flat).max() < 1e-3
    assert np.abs(given[low, 4] + pitch[low]).max() < 1e-3  # of flu: positive with the nose down


# --- a maintainer with an effect of a package of its own -----------------------------------------


def test_a_maintainer_studies_an_effect_of_a_package(shell):
    """The package of the tutorial, from its installation to the tables of a study."""
    package = shutil.copytree(EXAMPLES / "package", shell.folder / "package")
    for source in ("effect/ripple.py", "scheme/wedge.py"):
        shutil.copy(EXAMPLES / source, package / "our_sensors")
    shell.install(package)
    model = "bias-scale-nonorthogonality+ripple(period=5)"
    shell(
        "accelstudy simulate-campaign --scheme fibonacci-40 --out session "
        '--effect "ripple(period=5): 0.006, -0.004, 0.005"'
    )
    shell("accelstudy init my-study --sensor session")
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
