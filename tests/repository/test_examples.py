"""Examples print what the tutorials show; what pages for beginners say of accuracies is so."""

import re

import numpy as np
import pytest
import quotes
from example_helpers import EXAMPLES, run_example
from golden import numbers
from pictures import BATCH, MADE_BY, REPORTS, overview, seen, stale
from places import ROOT
from usual import NINE

from accelstudy.approaches import get_approach
from accelstudy.basics.units import GON, MGON
from accelstudy.design.estimability import estimability
from accelstudy.diagnosis.rules import RULES
from accelstudy.leveling.error import cap_forces, tilt_error
from accelstudy.schemes import get_scheme
from accelstudy.simulation.sessions import Noise

NAMES = sorted(path.parent.name for path in EXAMPLES.glob("*/commands.sh"))


@pytest.mark.usefixtures("drawn")
def test_pictures_of_reports_show_what_the_reports_say(tmp_path):
    folders = {name: tmp_path / name for name in ("log", "hidden")}
    for name, folder in folders.items():
        run_example(name, folder)
    pages = {name: folders[of] / page for name, (of, page, _) in REPORTS.items()}
    pages[BATCH[0]] = overview(*folders.values(), tmp_path / "batch")
    old = stale({name: seen(page) for name, page in pages.items()})
    assert not old, f"docs/figures has {', '.join(old)} of other pages; `{MADE_BY}` makes them anew"


def of_lines(text):
    """First word of each line, and its numbers."""
    return {line.split()[0].rstrip(":"): numbers(line) for line in text.splitlines() if line}


def test_a_robot_halves_the_tilt_error_of_the_paper():
    lines = of_lines(quotes.printed("paper", "python"))
    for name, better in {"b_x": 0.41, "s_x": 0.28, "alpha_zx": 0.54, "roll": 0.5}.items():
        gravity, robot = lines[name][:2]
        assert 1 - robot / gravity == pytest.approx(better, abs=0.03)
    assert [lines[name][0] for name in ("gravity", "robot")] == [15, 63]


def test_the_log_levels_to_what_its_calibration_promised():
    raw, calibrated = map(numbers, quotes.printed("log", "python compare").splitlines())
    said = quotes.printed("log", "accelstudy calibrate")
    promised = numbers(re.search("tilt error of .*? in pitch", said)[0])
    assert min(raw) > 250
    assert max(calibrated) < 1.5 * max(promised) < 4
    assert "ACCEPTED" in said


def test_to_estimate_the_quadratic_term_pays_from_fifty_positions_on():
    printed = quotes.printed("sweep", "python read").splitlines()
    n, *errors = np.transpose([numbers(line) for line in printed if line[0].isdigit()])
    gravity, robot = (estimated < left_out for left_out, estimated in (errors[:2], errors[2:]))
    assert n.tolist() == [14, 18, 24, 36, 50, 72]
    assert gravity.tolist() == 4 * [False] + 2 * [True]
    assert robot.all()


@pytest.mark.parametrize("name", NAMES)
def test_each_section_of_an_example_stands_in_its_tutorial(name):
    page = next((ROOT / "docs" / "tutorials").glob(f"{name}.md")).read_text("utf-8")
    for path in sorted((EXAMPLES / name).glob("*.*")):
        marks = re.findall(r"\[start:(\w+)\]", path.read_text("utf-8"))
        wanted = [f"examples/{name}/{path.name}:{mark}" for mark in marks]
        assert all(f'"{one}"' in page for one in wanted or [f"examples/{name}/{path.name}"])


def linear_theory(scheme, approach="gravity", **noise):
    """Rms tilt error of the worse angle up to 30 gon, mgon."""
    ideal = np.zeros(NINE.n_parameters)
    error = tilt_error(NINE, ideal, NINE, ideal, cap_forces(30 * GON, 200))
    theory = estimability(get_scheme(scheme), NINE, get_approach(approach), Noise(**noise))
    return float(error.rms_of_all(theory.cofactors).max()) / MGON


def test_positions_by_hand_leave_what_a_geodesist_reads():
    text = (ROOT / "docs/start/geodesist.md").read_text("utf-8")
    rows = re.findall(r"\| `(\S+)` \| ([\d.]+) mgon \| ([\d.]+) mgon", text)
    assert len(rows) == 6
    for scheme, *told in rows:
        left = [linear_theory(scheme, sigma_force=sigma) for sigma in (0.001, 0.002)]
        assert [float(value) for value in told] == pytest.approx(left, abs=0.06), scheme


def test_a_robot_is_worth_what_a_robotics_engineer_reads():
    text = (ROOT / "docs/start/robotics.md").read_text("utf-8")
    assert "robot of 1 mgon | 3.2 mgon | 10 mgon | 32 mgon | 100 mgon" in text
    rows = re.findall(r"^\| ([\d.]+) mm/s² ((?:\| [\d.]+ ){6})\|", text, re.MULTILINE)
    assert len(rows) == 2
    for sigma, told in rows:
        noise = {"sigma_force": 1e-3 * float(sigma)}
        left = [linear_theory("mclaren-24", **noise)]
        left += [
            linear_theory("mclaren-24", "robot", sigma_angle=angle * MGON, **noise)
            for angle in (1, 3.2, 10, 32, 100)
        ]
        assert numbers(told) == pytest.approx(left, abs=0.06)


def test_the_theory_of_evidence_has_the_rules_of_the_code():
    text = (ROOT / "docs/theory/evidence.md").read_text("utf-8")
    assert f"from **{RULES.named:g}** on" in text
    assert f"hold **{RULES.credible:g}** together" in text
    assert f"with a probability of {1 - RULES.prior_sigma_wrong:g}" in text
