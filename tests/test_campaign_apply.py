"""A calibration applied to readings, and leveling with its sigmas."""

import json

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from test_campaign_fit import GRAVITY, NINE, ROBOT, simulated_campaign

from accelstudy.campaign.applying import read_calibration
from accelstudy.campaign.document import calibration_document
from accelstudy.campaign.fit import fit_campaign
from accelstudy.campaign.log_leveling import level_log
from accelstudy.errors import InputError
from accelstudy.leveling import specific_force
from accelstudy.units import GON, MGON

TRUTH = {"b_x": 0.05, "b_y": 0.01, "s_z": 2e-4, "alpha_zx": 7e-4}


def calibration_file(folder, approach=ROBOT, seed=1):
    fit = fit_campaign(simulated_campaign(TRUTH, seed=seed), NINE, approach)
    path = folder / "calibration.json"
    path.write_text(json.dumps(calibration_document(fit), allow_nan=False), encoding="utf-8")
    return path


def test_the_file_gives_back_the_fit(tmp_path):
    fit = fit_campaign(simulated_campaign(TRUTH), NINE, GRAVITY)
    read = read_calibration(calibration_file(tmp_path, GRAVITY))
    np.testing.assert_array_equal(read.parameters, fit.parameters)
    np.testing.assert_allclose(np.sqrt(np.diag(read.covariance)), fit.sigma, rtol=1e-12)
    np.testing.assert_allclose(read.correct(fit.campaign.forces), fit.corrected, atol=1e-12)


def test_sigmas_of_leveling_hold_over_calibrations_and_readings(tmp_path):
    """Errors of roll and pitch over 300 calibrations, each with a reading, against the sigma."""
    attitude = np.array([30 * GON, -20 * GON])
    f_b = np.array(specific_force(*attitude, 9.80665))
    f_s = NINE.sense(f_b[None], NINE.vector(TRUTH))[0]
    rng = np.random.default_rng(5)
    errors, sigmas = [], []
    for seed in range(300):
        calibration = read_calibration(calibration_file(tmp_path, seed=seed))
        reading = f_s + 0.001 * rng.standard_normal(3)
        angles, sigma = calibration.level(reading[None], 0.001)
        errors.append(angles[0] - attitude)
        sigmas.append(sigma[0])
    normalised = np.array(errors) / np.array(sigmas)
    assert np.abs(normalised.mean(axis=0)).max() < 4 / np.sqrt(300)
    assert np.abs(normalised.std(axis=0) - 1).max() < 4 / np.sqrt(2 * 300)


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"parameters": 3}', "\x00"])
def test_what_is_no_calibration_is_one_line(tmp_path, content):
    path = tmp_path / "calibration.json"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(InputError) as error:
        read_calibration(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)
    with pytest.raises(InputError, match="No such file"):
        read_calibration(tmp_path / "none.json")


# --- Logs ----------------------------------------------------------------------------------------

N = 20


def mixed_log():
    """Columns whose chunks look like other types than the whole."""
    forces = np.random.default_rng(1).normal(0, 5, (N, 3)).round(4)
    return pd.DataFrame(
        {
            "fx": [9, *forces[1:, 0]],
            "note": ["1", "2", *[""] * (N - 4), "3", 'late, "quoted" é'],
            "fy": forces[:, 1],
            "count": np.arange(N),
            "gap": [1, 2, *[None] * (N - 3), 4],
            "fz": forces[:, 2],
            "still": np.arange(N) % 2 == 0,
            "big": [1, *[2**63 + 5] * (N - 1)],
            "never": [None] * N,
            "sparse": [True, *[None] * (N - 1)],
        }
    )


def read_back(path):
    return pd.read_parquet(path) if path.suffix == ".parquet" else pd.read_csv(path)


@pytest.mark.parametrize("chunk_size", [1, 7, N])
def test_a_log_in_pieces_is_the_whole_log(tmp_path, chunk_size):
    """The text is that of pandas, which has the whole table in memory."""
    calibration, log = read_calibration(calibration_file(tmp_path)), tmp_path / "log.csv"
    mixed_log().to_csv(log, index=False)
    level_log(calibration, log, tmp_path / "level.csv", chunk_size=chunk_size)
    whole = pd.read_csv(log)
    forces = whole[["fx", "fy", "fz"]].to_numpy(float)
    angles, sigmas = calibration.level(forces, calibration.content["sigma_position_mps2"])
    for i, axis in enumerate("xyz"):
        whole[f"f{axis}_calibrated_mps2"] = calibration.correct(forces)[:, i]
    for i, angle in enumerate(("roll", "pitch")):
        whole[f"{angle}_gon"] = angles[:, i] / GON
        whole[f"sigma_{angle}_mgon"] = sigmas[:, i] / MGON
    found = pd.read_csv(tmp_path / "level.csv")
    pd.testing.assert_frame_equal(found, whole, check_exact=False, rtol=1e-12)
    # What the log had is not only equal but written alike.
    given = [*mixed_log().columns]
    assert found[given].to_csv(index=False) == whole[given].to_csv(index=False)


@pytest.mark.parametrize("given", ["log.csv", "log.parquet"])
@pytest.mark.parametrize("wanted", ["level.csv", "level.parquet"])
def test_pieces_do_not_matter(tmp_path, given, wanted):
    calibration, log = read_calibration(calibration_file(tmp_path)), tmp_path / given
    table = mixed_log()
    table["when"] = pd.to_datetime(np.arange(N) // 5 * 500, unit="ms")
    table["roll_gon"] = 0.0  # is replaced
    if given == "log.csv":
        table.to_csv(log, index=False)
    else:
        table.index = table["count"] + 5
        kept = {"gap": "Int64", "sparse": "boolean"}
        table.drop(columns="never").astype(kept).rename_axis(None).to_parquet(log)
    outcomes = []
    for chunk_size in (3, 8, N):
        out = tmp_path / str(chunk_size) / wanted
        level_log(calibration, log, out, chunk_size=chunk_size)
        parquet = out.suffix == ".parquet"
        outcomes.append(pq.read_table(out) if parquet else out.read_text(encoding="utf-8"))
        assert len(read_back(out)) == N
        assert [path.name for path in out.parent.iterdir()] == [wanted]
        assert "__index_level_0__" not in read_back(out)
        assert list(read_back(out)).count("roll_gon") == 1
        assert read_back(out)["roll_gon"].abs().min() > 0
    assert outcomes[0] == outcomes[-1]
    assert outcomes[1] == outcomes[-1]


def test_parquet_keeps_its_types(tmp_path):
    calibration = read_calibration(calibration_file(tmp_path))
    log = pa.table(
        {
            "fx": pa.array([1, 2], pa.int16()),
            "fy": pa.array([1.5, 2.5], pa.float32()),
            "fz": pa.array([9.0, 9.5]),
            "n": pa.array([1, None], pa.uint8()),
            "when": pa.array([0, 1], pa.timestamp("ns")),
        }
    )
    pq.write_table(log, tmp_path / "log.parquet")
    level_log(calibration, tmp_path / "log.parquet", tmp_path / "out.parquet", chunk_size=1)
    assert pq.read_table(tmp_path / "out.parquet").select(log.column_names).equals(log)
    level_log(calibration, tmp_path / "log.parquet", tmp_path / "out.csv", chunk_size=1)
    text = (tmp_path / "out.csv").read_text(encoding="utf-8").splitlines()
    assert text[1].startswith("1,1.5,9.0,1,1970-01-01 00:00:00.000000000,")
    assert text[2].startswith("2,2.5,9.5,,1970-01-01 00:00:00.000000001,")


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("log.csv", "fx,fy,fz\n1,2,3\n4,5,6\n7,8,x\n", "row 3"),
        ("log.csv", "fx,fy,fz\n1,2,3\n4,5,6\n7,8\n", "row 3"),
        ("log.csv", "fx,fy,fz\n1,2,3,\n4,5,6,\n7,8,9,\n", "more values than there are names"),
        ("log.csv", "fx,fy,fz\n1,2,3\n4,5,6\n7,8,9,10\n", "no CSV table"),
        ("log.csv", "fx,fy,fx\n1,2,3\n", "three columns of fx, fy, fx.1"),
        ("log.csv", '"fx\n",fy,fz\n1,2,3\n', "three columns of fx, fy, fz"),
        ("log.parquet", "fx,fy,fz\n1,2,3\n", "not a whole Parquet file"),
    ],
)
def test_a_bad_log_leaves_nothing_behind(tmp_path, name, content, words):
    calibration, log = read_calibration(calibration_file(tmp_path)), tmp_path / name
    log.write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=words) as error:
        level_log(calibration, log, tmp_path / "out.csv", chunk_size=1)
    assert "\n" not in str(error.value)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["calibration.json", name]


def test_where_nothing_can_be_written(tmp_path):
    calibration, log = read_calibration(calibration_file(tmp_path)), tmp_path / "log.csv"
    log.write_text("fx,fy,fz\n1,2,3\n", encoding="utf-8")
    for out in (tmp_path, log / "out.csv"):
        with pytest.raises(InputError, match="cannot be written"):
            level_log(calibration, log, out)


def test_a_log_without_rows_stays_one(tmp_path):
    calibration, log = read_calibration(calibration_file(tmp_path)), tmp_path / "log.csv"
    log.write_text("fx,fy,fz\n", encoding="utf-8")
    level_log(calibration, log, tmp_path / "out.csv")
    text = (tmp_path / "out.csv").read_text(encoding="utf-8")
    assert text.startswith("fx,fy,fz,fx_calibrated_mps2,")
    assert len(text.splitlines()) == 1
