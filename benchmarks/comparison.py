"""Other programs beside this one, on public data.

    uv pip install --python .venv/bin/python imucal
    python benchmarks/comparison.py [folder of public data] [page]

calibrates the data of imucal by imucal and by this package: parameters, what is left, and the time.
The MPU-9150 are compared with what their authors published, who made mikoff/imu-calib. The tables
go into a page, if one is given. Missing data are downloaded.
"""

import json
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pandas as pd

from accelstudy.approaches import get_approach
from accelstudy.campaign.calibration.fit import fit_campaign
from accelstudy.campaign.importing.logs import import_log
from accelstudy.campaign.importing.public import import_settings, public_file
from accelstudy.campaign.session import Campaign
from accelstudy.sensors.models import get_model
from page import put
from timing import in_turns, median, table

FOLDER = "resources/public"
FACES = {
    "x_p": (0, 90), "x_a": (0, -90), "y_p": (-90, 0), "y_a": (90, 0), "z_p": (180, 0), "z_a": (0, 0)
}  # fmt: skip
"""Sections of imucal's data, and the roll and pitch that they should have, in degrees."""
PLACED = 0.1 / 0.9 * 1e3
"""mgon, sd of how well the faces were placed (0.1°), as stated to the adjustment."""
RATE, G = 204.8, 9.81
AXES = ["acc_x", "acc_y", "acc_z"]
AUTHORS = {
    "mpu9150-0": ((0.363, 0.315, 0.647), (0.103, 0.097, 0.344)),
    "mpu9150-1": ((0.471, 0.482, 0.932), (0.09, 0.07, 0.338)),
    "mpu9150-2": ((0.382, 0.355, 0.780), (0.096, 0.008, -0.045)),
}
"""Published scales in % and biases in m/s² (Mikov, Reginya and Moschevikin 2020)."""
ROUNDS = 20


def sections(folder):
    """Log of imucal, and its sections: a table of samples and {name: (start, end)}."""
    log = pd.read_csv(public_file("ferraris", folder), index_col=0)
    noted = json.loads(public_file("ferraris-sections", folder).read_text(encoding="utf-8"))
    return log, {name: (at["start"], at["end"]) for name, at in noted.items()}


def campaigns(folder):
    """Holds that were found in the log of imucal, and the six that it names."""
    found, _ = import_log(public_file("ferraris", folder), import_settings("ferraris"))
    log, noted = sections(folder)
    means = np.array([log[AXES][slice(*noted[name])].mean() for name in FACES])
    header = {"name": "six", "gravity": {"value_mps2": G}}
    six = Campaign.of(header, forces=means).with_sigma(found.sigma_force)
    return found, six


def by_imucal(folder):
    """Work that calibrates by imucal."""
    from imucal import FerrarisCalibration, ferraris_regions_from_section_list

    log, noted = sections(folder)
    regions = ferraris_regions_from_section_list(log, pd.DataFrame(noted, index=["start", "end"]).T)
    return lambda: FerrarisCalibration(grav=G).compute(regions, RATE, "m/s^2", "deg/s")


def ours(campaign, model, approach="gravity"):
    """Work that calibrates by this package."""
    return lambda: fit_campaign(campaign, get_model(model), get_approach(approach))


def affine(fit):
    """K and b of f = K (reading − b)."""
    return fit.model.affine(fit.parameters)


def left(k, b, forces):
    """Rms of |f| − g, mm/s²."""
    norms = np.linalg.norm((forces - b) @ np.transpose(k), axis=1)
    return f"{1e3 * np.sqrt(np.mean((norms - G) ** 2)):.1f}"


def with_sigma(fit, name):
    """Estimate and sigma of a parameter, in thousandths."""
    i = fit.model.parameter_names.index(name)
    return f"{minus(1e3 * fit.parameters[i], 2)} ± {1e3 * fit.sigma[i]:.2f}"


def minus(value, digits):
    """Write a number with a sign of its own."""
    return f"{value:.{digits}f}".replace("-", "−")


def test_of(fit):
    """What the global test says."""
    if fit.global_test is None:
        return "no redundancy"
    test = fit.global_test
    said = "rejected" if not test.accepted else "cannot tell" if test.powerless else "accepted"
    return f"{said}, r = {test.dof}"


def ferraris(folder):
    """Tables of the parameters, and of the time, of the data of imucal."""
    found, six = campaigns(folder)
    roll_pitch = np.radians(list(FACES.values()))
    placed = six.with_header(robot={"angle_sigma_mgon": PLACED})
    placed = placed.with_arrays(angles=roll_pitch, yaw=np.zeros(6))
    twelve = "bias-scale-nonorthogonality-crossaxis"
    works = {
        "imucal": by_imucal(folder),
        "six": ours(six, "bias-scale"),
        "found": ours(found, "bias-scale"),
        "placed": ours(placed, twelve, "robot"),
    }
    cal, *fits = (work() for work in works.values())
    k_imucal = np.linalg.inv(cal.R_a) @ np.linalg.inv(cal.K_a)
    rows = [
        ("", f"imucal {version('imucal')}", *(f"accelstudy, {n}"
         for n in
         ("six positions", f"{found.n_positions} holds", "six positions as placed"))),
        ("assumes", "the six faces are exact", "nothing of the attitudes",
         "nothing of the attitudes", "the faces are within 0.1° (sd)"),
        ("parameters", 12, *(fit.model.n_parameters for fit in fits)),
    ]  # fmt: skip
    for i, axis in enumerate("xyz"):
        said = [with_sigma(fit, f"b_{axis}") for fit in fits]
        rows.append((f"bias {axis} / (mm/s²)", minus(1e3 * cal.b_a[i], 2), *said))
    for i, axis in enumerate("xyz"):
        said = [with_sigma(fit, f"s_{axis}") for fit in fits]
        # The scale of an axis is what its reading gains along it, without the rotation.
        scale = 1e3 * (np.diag(cal.K_a @ cal.R_a)[i] - 1)
        rows.append((f"scale {axis} / 10⁻³", minus(scale, 2), *said))
    all_of_them = [(k_imucal, cal.b_a), *map(affine, fits)]
    for what, forces in (
        ("the six positions", six.forces),
        ("three other holds", found.forces[6:]),
    ):
        cells = [left(*each, forces) for each in all_of_them]
        cells[2] += ", fitted to all"
        rows.append((f"rms error of g in {what} / (mm/s²)", *cells))
    rows.append(("global test", "none", *map(test_of, fits)))
    seconds = in_turns(works, ROUNDS)
    rows.append(("time / ms", *(median(1e3 * seconds[name]) for name in works)))
    return table(*rows)


def authors(folder):
    """Table of the parameters of the MPU-9150 beside those of their authors."""
    rows = [("sensor", "", "x", "y", "z")]
    for name, (scales, offsets) in AUTHORS.items():
        campaign, _ = import_log(public_file(name, folder), import_settings(name))
        fit = ours(campaign, "bias-scale-nonorthogonality")()
        k, b = affine(fit)
        # Theirs is a triangle, and they took 9.81 m/s².
        k = np.linalg.cholesky(k.T @ k).T * G / campaign.gravity
        # Theirs are errors of the readings, of which K takes away those of the scales.
        scale, offset = 100 * (1 / np.diag(k) - 1), b
        sigma = fit.sigma[:6]
        for what, their, our, s in (
            ("scale / %", scales, scale, 100 * sigma[3:]),
            ("bias / (m/s²)", offsets, offset, sigma[:3]),
        ):
            cells = (
                f"{minus(a, 3)}, {minus(o, 3)} ± {e:.3f}"
                for a, o, e in zip(their, our, s, strict=True)
            )
            rows.append((name, what, *cells))
    return table(*rows)


def main(folder=FOLDER, page=None):
    """Print the tables, and put them into a page."""
    tables = {"ferraris": ferraris(folder), "authors": authors(folder)}
    print("\n\n".join(tables.values()))
    if page is not None:
        text = Path(page).read_text(encoding="utf-8")
        for name, each in tables.items():
            text = put(text, name, each)
        Path(page).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
