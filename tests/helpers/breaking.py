"""Break a copy of the package on purpose, in one place after the other, and see a test fail.

`make test-breaks` tries all faults, `python tests/helpers/breaking.py diagnosis` those of one room.
A fault is a line that is slightly wrong. It is looked up by its text, wherever in the package that
stands, and a test by its name, so that code and tests may move.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
FAILED, PASSED = 1, 0


@dataclass(frozen=True)
class Fault:
    """A text of the package, what becomes of it, and the tests that should fail then.

    Where no test has such a name any more, all tests of the folder `room` are run instead, which
    takes minutes.
    """

    room: str
    what: str
    right: str
    wrong: str
    tests: tuple[str, ...]


def fault(room: str, what: str, right: str, wrong: str, *tests: str) -> Fault:
    """Return a fault."""
    return Fault(room, what, right, wrong, tests)


FAULTS = (
    # --- diagnosis: evidence ----------------------------------------------------------------------
    fault(
        "diagnosis", "an effect has its size in each direction, not in all together",
        "g = SIZES[:, None] / dim", "g = SIZES[:, None] / 1",
        "test_densities_are_mixtures_of_t_distributions",
    ),
    fault(
        "diagnosis", "the level of the noise has half its degrees of freedom",
        "self._constants - half * logs", "self._constants - nu / 2 * logs",
        "test_densities_are_mixtures_of_t_distributions",
    ),
    fault(
        "diagnosis", "the determinant of the noise is not halved",
        "np.asarray(determinant, dtype=float)[..., None] / 2",
        "np.asarray(determinant, dtype=float)[..., None]",
        "test_axes_are_weighted_as_far_as_the_data_say",
    ),
    fault(
        "diagnosis", "simulated residuals with an effect are not weighted back to noise",
        "1 / (0.5 + 0.5 * np.exp(np.minimum(field.proposal(parts), 700.0)))",
        "np.ones(len(parts))",
        "test_noise_alone_counts_as_often_as_the_level_says",
    ),
    fault(
        "diagnosis", "the effects of the importance sampling are not those of its density",
        "np.sqrt(sizes / dims)", "np.sqrt(sizes)",
        "test_noise_is_not_noise_with_an_effect",
        "test_noise_alone_counts_as_often_as_the_level_says",
    ),
    fault(
        "diagnosis", "the level of a diagnosis takes no account of the test of sigma",
        "LEVEL_EFFECTS - REFUTED if sigma_known else LEVEL_EFFECTS", "LEVEL_EFFECTS",
        "test_a_diagnosis_decides_at_this_level",
    ),
    fault(
        "diagnosis", "a pair of bumped positions counts once, not twice",
        "twice = np.log(2.0) if", "twice = 0.0 if",
        "test_all_pairs_are_those_of_all_shapes_together",
    ),
    fault(
        "diagnosis", "the second effect of a pair is not freed of the first",
        "along / np.maximum(values, COLLINEAR)", "along",
        "test_all_pairs_are_those_of_all_shapes_together",
    ),
    fault(
        "diagnosis", "shapes of a smooth setting count evenly",
        "np.gradient(np.log([h.value for h in shapes]))",
        "np.gradient(np.arange(len(shapes)) * 1.0)",
        "test_all_pairs_are_those_of_all_shapes_together",
    ),
    fault(
        "diagnosis", "explanations that mean the same are not added",
        "np.logaddexp(strongest.log_weight, one.log_weight)", "strongest.log_weight",
        "test_the_posterior_merges_what_means_the_same",
    ),
    # --- diagnosis: noise -------------------------------------------------------------------------
    fault(
        "diagnosis", "the test of sigma takes a share of the level of the others",
        "LEVEL_NOISE / max(len(counted) - (level is not None), 1)",
        "LEVEL_NOISE / max(len(counted), 1)",
        "test_the_tests_beside_that_of_sigma_share_one_percent",
    ),
    fault(
        "diagnosis", "a wrong sigma is blamed before all else",
        ".index(t.name), default", ".index(t.name) * -1, default",
        "test_the_most_specific_finding_comes_first",
    ),
    fault(
        "diagnosis", "the lack of fit has the degrees of freedom of all residuals",
        "rest = residuals.redundancy - freedom", "rest = residuals.redundancy",
        "test_lack_of_fit_is_the_analysis_of_variance",
    ),
    fault(
        "diagnosis", "the noise of a robot counts as that of the axes",
        "taken) - left.sum(axis=1)", "taken)",
        "test_factors_of_the_axes_are_those_of_whole_matrices",
    ),
    fault(
        "diagnosis", "noise within the holds is not divided by the number of samples",
        "white = float(np.mean(sd**2 / n_samples[:, None]))", "white = float(np.mean(sd**2))",
        "test_the_test_within_holds_is_the_f_test",
        "test_white_noise_within_the_holds_explains_white_noise",
    ),
    fault(
        "diagnosis", "samples of a hold have a degree of freedom too many",
        "freedom = 3 * float(np.sum(n_samples - 1))", "freedom = 3 * float(np.sum(n_samples))",
        "test_white_noise_within_the_holds_explains_white_noise",
        "test_the_test_within_holds_is_the_f_test",
    ),
    fault(
        "diagnosis", "coloured noise has no memory from hold to hold",
        "lasting * (state + gain @ scaled)", "gain @ scaled",
        "test_coloured_noise_has_the_likelihood_of_whole_covariance_matrices",
    ),
    fault(
        "diagnosis", "a random walk goes backwards",
        "np.cumsum(v[..., ::-1, :], axis=-2)", "np.cumsum(v, axis=-2)",
        "test_coloured_noise_has_the_likelihood_of_whole_covariance_matrices",
    ),
    fault(
        "diagnosis", "the restricted likelihood is not restricted",
        "determinant + np.linalg.slogdet(design)[1]", "determinant",
        "test_coloured_noise_has_the_likelihood_of_whole_covariance_matrices",
    ),
    # --- diagnosis: signatures, shapes, slopes ----------------------------------------------------
    fault(
        "diagnosis", "an effect on the axes has the wrong sign",
        'force -= np.tile(np.einsum("nb,abk->nak", forces, axes), s)',
        'force += np.tile(np.einsum("nb,abk->nak", forces, axes), s)',
        "test_a_signature_is_the_derivative_of_what_is_observed",
    ),
    fault(
        "diagnosis", "the rate of an effect is that of half the time",
        "rate = (soon - shortly) / (2 * MOMENT)", "rate = (soon - shortly) / MOMENT",
        "test_rates_are_derivatives_of_the_definition_by_time",
    ),
    fault(
        "diagnosis", "a lag has no rate",
        "behind + self._dt * rate", "behind",
        "test_rates_are_derivatives_of_the_definition_by_time",
    ),
    fault(
        "diagnosis", "simulated effects have the random numbers of the noise",
        "(*self.seed.spawn_key, 0)", "(*self.seed.spawn_key,)",
        "test_no_random_number_is_drawn_twice",
    ),
    fault(
        "diagnosis", "a shape is refined on one side only",
        "(shapes[max(best - 1, 0)].value, ", "(shapes[best].value, ",
        "test_a_time_constant_is_the_best_of_a_fine_search",
    ),
    fault(
        "diagnosis", "jumps that were passed over stay out",
        "fine[max(best, near) : max(best, near)]", "fine[len(fine):][:0]",
        "test_of_very_many_times_of_a_jump_the_best_is_found",
    ),
    fault(
        "diagnosis", "slopes do not scatter more than they say",
        "variance = max(1.0, trimmed_mean_square(squares[shown]))", "variance = 1.0",
        "test_slopes_that_scatter_more_than_they_say_are_no_evidence",
    ),
    fault(
        "diagnosis", "slopes of the effects of the model are forgotten",
        "errors=chosen.T @ self.values + by_model @ parameters", "errors=chosen.T @ self.values",
        "test_slopes_of_the_models_own_effects_are_taken_into_account",
    ),
    # --- diagnosis: what else is said -------------------------------------------------------------
    fault(
        "diagnosis", "a detectable size is a noncentrality without its root",
        "root = np.sqrt(noncentrality(1, alpha, power))", "root = noncentrality(1, alpha, power)",
        "test_detectable_and_identifiable_sizes_by_hand",
    ),
    fault(
        "diagnosis", "an identifiable size takes no account of the rivals",
        "columns[easiest] - rival.basis @ (rival.basis.T @ columns[easiest])", "columns[easiest]",
        "test_detectable_and_identifiable_sizes_by_hand",
    ),
    fault(
        "diagnosis", "the parameters of an effect take no degree of freedom of its limit",
        "r = residuals.z - columns @ values, residuals.redundancy - columns.shape[1]",
        "r = residuals.z - columns @ values, residuals.redundancy",
        "test_the_limit_of_a_parameter_holds_where_no_noise_is_stated",
    ),
    fault(
        "diagnosis", "the next position is chosen by the derivatives of the right explanation",
        "second.growth(columns[1], seen[0]) + first.growth(columns[0], seen[1])",
        "second.growth(columns[0], seen[0]) + first.growth(columns[1], seen[1])",
        "test_each_position_adds_most_of_all_candidates",
    ),
    fault(
        "diagnosis", "a chosen position does not count for the next one",
        "separation = separation.taking(", "separation.taking(",
        "test_each_position_adds_most_of_all_candidates",
    ),
    fault(
        "diagnosis", "a group has its share by chance too",
        "(part - expected", "(part - 0 * expected",
        "test_a_share_is_that_of_the_excess",
    ),
    fault(
        "diagnosis", "by chance a group has as many conditions as the rest",
        "special.betainc((r - k) / 2, k / 2, 1 - NEARLY_ALL)",
        "special.betainc(k / 2, (r - k) / 2, 1 - NEARLY_ALL)",
        "test_a_share_is_told_where_chance_seldom_gives_nearly_all",
    ),
    fault(
        "diagnosis", "an effect shifts the other parameters the other way",
        "predicted = shift @ final.parameters[added]",
        "predicted = -shift @ final.parameters[added]",
        "test_what_an_effect_does_to_the_other_parameters_is_predicted",
    ),
    fault(
        "diagnosis", "a calibration in use has no uncertainty of its own",
        "np.mean(offset**2 + formal)", "np.mean(offset**2)",
        "test_the_old_simulation_lacks_the_measurement",
    ),
    fault(
        "diagnosis", "the prediction of held-out positions is certain",
        "float(d @ d + slope @ base.cofactors @ slope)", "float(d @ d)",
        "test_held_out_z_is_standard_normal_if_nothing_is_missing",
    ),
    fault(
        "diagnosis", "slopes have the random numbers of the positions",
        "(*self.seed.spawn_key, SLOPES)", "(*self.seed.spawn_key,)",
        "test_no_random_number_is_drawn_twice",
    ),
    # --- adjustment -------------------------------------------------------------------------------
    fault(
        "adjustment", "redundancy numbers lack the variances of the observations",
        'solution.variances * np.einsum("nco,ncd,ndo->no"', 'np.einsum("nco,ncd,ndo->no"',
        "test_redundancy_numbers_sum_up_to_r",
    ),
    fault(
        "adjustment", "the global test is one-sided",
        "p_value=float(2 * min(below, above))", "p_value=float(above)",
        "test_the_global_test_rejects_on_either_side",
    ),
    fault(
        "adjustment", "a studentised test takes no degree of freedom",
        "np.maximum(omega - statistic, 0.0) / (r - q)", "np.maximum(omega - statistic, 0.0) / r",
        "test_studentised_statistic_is_that_of_a_fit_without_the_position",
    ),
    fault(
        "adjustment", "Holm's step-down starts with one test too few",
        "np.arange(len(order), 0, -1) * p_values[order]",
        "np.arange(len(order) - 1, -1, -1) * p_values[order]",
        "test_holm",
    ),
    fault(
        "adjustment", "the a-posteriori variance is one of the cofactors alone",
        "self.variance_posteriori[:, None, None] * self.cofactors",
        "self.variance_priori * self.cofactors * 1.0",
        "test_york_line_is_the_published_one",
    ),
    # --- leveling ---------------------------------------------------------------------------------
    fault(
        "leveling", "the robot rolls the other way",
        "-g * xp.cos(pitch) * xp.sin(roll)", "g * xp.cos(pitch) * xp.sin(roll)",
        "test_leveling_inverts_the_specific_force",
    ),
    fault(
        "leveling", "the mean error of a calibration and its scatter are mixed once, not twice",
        "2 * delta @ self.linear.T", "delta @ self.linear.T",
        "test_a_large_error_of_the_mean_is_not_linearised",
        "test_scatter_of_calibrations",
    ),
    fault(
        "leveling", "Shapley effects weigh sets by the wrong size",
        "factorial(size - 1) * factorial(p - size) / factorial(p)",
        "factorial(size) * factorial(p - size) / factorial(p)",
        "test_the_definition",
    ),
    # --- basics -----------------------------------------------------------------------------------
    fault(
        "basics", "an arc second is one of time",
        '"arcsec": math.pi / 648000.0', '"arcsec": math.pi / 43200.0',
        "test_conversions",
    ),
    fault(
        "basics", "90 % intervals are called 95 %",
        "tail = (1 - level) / 2", "tail = 1 - level",
        "test_exact_intervals",
    ),
    # --- planning, designs, sequence --------------------------------------------------------------
    fault(
        "planning", "a share of calibrations has the degrees of freedom of a normal error",
        "mean**2 / np.sum(form**2, axis=(1, 2))", "1 + 0 * mean",
        "test_the_quantile_is_that_of_draws",
    ),
    fault(
        "planning", "the mean error of a pole is no error",
        "np.diagonal(self.covariance, axis1=-2, axis2=-1) + self.shift**2",
        "np.diagonal(self.covariance, axis1=-2, axis2=-1)",
        "test_each_source_has_its_closed_form",
        "test_linear_theory_agrees_with_the_exact_geometry",
    ),
    fault(
        "design", "a neglected effect shifts the estimates the other way",
        "(own - 2 * cross) * self.variance", "(own + 2 * cross) * self.variance",
        "test_the_error_by_a_neglected_effect_is_that_of_calibrations_without_it",
    ),
    fault(
        "sequential", "the noise of earlier positions has a degree of freedom too many",
        "self.statistic / c / (omega / redundancy)",
        "self.statistic / c / (omega / (redundancy + 1))",
        "test_the_test_of_a_new_position_is_that_of_the_last_of_all",
    ),
    # --- simulation and studies -------------------------------------------------------------------
    fault(
        "simulation", "the mean of a position is as noisy as a sample",
        "sigma_sample / math.sqrt(max(1, round(rate * duration)))",
        "sigma_sample / max(1, round(rate * duration))",
        "test_sigma_of_the_mean_of_a_position",
    ),
    fault(
        "simulation", "columns of a plan have the same random numbers",
        "spawn_key=(_STREAM, stream)", "spawn_key=(_STREAM,)",
        "test_what_is_drawn_is_uniform_and_independent",
    ),
    fault(
        "study", "moments of two chunks are merged without what their means differ by",
        "(weight * self.converged) * np.outer(step, step)", "0 * np.outer(step, step)",
        "test_merged_moments_are_those_of_all",
    ),
    fault(
        "study", "all blocks of a cell have the same random numbers",
        "np.random.SeedSequence([seed, *words], spawn_key=(block,))",
        "np.random.SeedSequence([seed, *words])",
        "test_every_cell_and_block_has_its_own_seed",
    ),
    # --- campaigns --------------------------------------------------------------------------------
    fault(
        "campaign", "the Allan variance lacks its factor of a half",
        "second.T @ second / (2.0 * m * m)", "second.T @ second / (m * m)",
        "test_definition",
    ),
    fault(
        "campaign", "the sigma of a mean is that of its samples",
        "np.sqrt(np.mean(sd**2 / n_samples[:, None]))", "np.sqrt(np.mean(sd**2))",
        "test_means",
    ),
    fault(
        "campaign", "the covariance of a calibration is that of the parameters before it",
        "covariance=covariance[np.ix_(stays, stays)]",
        "covariance=covariance[: len(stays), : len(stays)]",
        "test_the_rig_stays_where_it_was",
    ),
)  # fmt: skip


def main() -> None:
    """Exit with 0 if every fault of the chosen rooms is caught."""
    rooms, known = sys.argv[1:], list(dict.fromkeys(one.room for one in FAULTS))
    if unknown := [room for room in rooms if room not in known]:
        sys.exit(f"no faults in {', '.join(unknown)}; there are some in {', '.join(known)}")
    chosen = [one for one in FAULTS if not rooms or one.room in rooms]
    with tempfile.TemporaryDirectory(prefix="accelstudy-breaks-") as folder:
        package = Path(folder) / "accelstudy"
        shutil.copytree(ROOT / "accelstudy", package)
        missed = missed_of(chosen, package)
    print(f"{len(chosen) - missed} of {len(chosen)} faults are caught")
    sys.exit(missed > 0)


def missed_of(chosen: list[Fault], package: Path) -> int:
    """Print a line for each fault, and return how many no test catches."""
    used = python("-c", "import accelstudy; print(accelstudy.__file__)", package=package)
    if Path(used.stdout.strip()).parent != package:
        sys.exit(f"tests would use {used.stdout.strip()}, not the copy\n{used.stderr}")
    status, failed = run(sorted({test for one in chosen for test in places(one)}), package)
    if status != PASSED:
        sys.exit(f"before anything is broken, tests fail: {failed}")
    missed = 0
    for one in chosen:
        verdict = verdict_on(one, package)
        missed += not verdict.startswith("caught")
        print(f"{one.room + ':':12}{one.what}\n{'':12}{verdict}", flush=True)
    return missed


def verdict_on(one: Fault, package: Path) -> str:
    """Break the package, run the tests, and mend it."""
    texts = {path: path.read_text(encoding="utf-8") for path in package.rglob("*.py")}
    times = sum(text.count(one.right) for text in texts.values())
    if times != 1:
        return f"NOT TRIED: {one.right!r} is in the package {times} times, not once"
    path, text = next((path, text) for path, text in texts.items() if one.right in text)
    path.write_text(text.replace(one.right, one.wrong), encoding="utf-8")
    status, failed = run(places(one), package)
    path.write_text(text, encoding="utf-8")
    if status == FAILED:
        return f"caught by {failed}"
    return "NOT CAUGHT" if status == PASSED else f"NOT TRIED: pytest ends with status {status}"


def places(one: Fault) -> list[str]:
    """Where the tests are that should fail: files with names of tests, or a whole folder."""
    files = {path: path.read_text("utf-8") for path in (ROOT / "tests").rglob("test_*.py")}
    found = [
        f"{path.relative_to(ROOT)}::{name}"
        for name in one.tests
        for path, text in files.items()
        if f"\ndef {name}(" in text
    ]
    return found or [f"tests/{one.room}"]


def run(tests: list[str], package: Path) -> tuple[int, str]:
    """Exit status of pytest with a package, and the first test that fails."""
    options = ["-q", "-x", "-rfE", "--no-header", "--tb=no", "-p", "no:cacheprovider"]
    lines = (done := python("-m", "pytest", *options, *tests, package=package)).stdout.splitlines()
    failed = [line.split()[1] for line in lines if line.startswith(("FAILED", "ERROR"))]
    return done.returncode, " ".join(failed)


def python(*words: str, package: Path) -> subprocess.CompletedProcess[str]:
    """Run Python with a package, and with nothing of this folder."""
    environment = {
        **os.environ,
        "PYTHONPATH": str(package.parent),
        "PYTHONDONTWRITEBYTECODE": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }
    command = [sys.executable, "-P", *words]
    return subprocess.run(command, cwd=ROOT, env=environment, text=True, capture_output=True)


if __name__ == "__main__":
    main()
