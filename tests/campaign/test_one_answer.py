"""What a campaign determines, and how good it is, is the same in every command."""

import numpy as np
from calling import refusal, succeed

GOLDEN = (1 + 5**0.5) / 2
AXES = np.array([[0, 1, GOLDEN], [0, 1, -GOLDEN], [1, GOLDEN, 0], [1, -GOLDEN, 0], [GOLDEN, 0, 1]])
NINE = np.concatenate([AXES, -AXES[:4]]) / np.hypot(1, GOLDEN)
"""Nine faces of a dodecahedron on five axes: five sums and three biases, one too few."""
HEADER = """\
schema_version: 1
name: made-up
unit: m/s^2
gravity: {value_mps2: 9.80665, sigma_mps2: 0.0}
sensor_noise: {sigma_mps2: 0.002}
"""


def written(folder, directions, seed, outside=None):
    """Write the campaign of a sensor with known errors and a noise of 2 mm/s²."""
    folder.mkdir()
    (folder / "campaign.yaml").write_text(HEADER, encoding="utf-8")
    noise = 0.002 * np.random.default_rng(seed).standard_normal(directions.shape)
    forces = -9.80665 * directions * [1.004, 0.997, 1.006] + [0.12, -0.08, 0.2] + noise
    forces += 0 if outside is None else outside(directions)
    rows = [f"{i},{x},{y},{z}" for i, (x, y, z) in enumerate(forces, 1)]
    text = "\n".join(["position,fx,fy,fz", *rows, ""])
    (folder / "positions.csv").write_text(text, encoding="utf-8")
    return folder


def test_nine_positions_of_rank_eight(tmp_path):
    """Some draws of the noise made them nine, with scales of 100 000 ppm."""
    campaign = written(tmp_path / "nine", NINE, seed=24)
    says = "rank 8 of 9: "
    assert says in refusal("calibrate", campaign, "--out", tmp_path / "calibrated")
    assert says in refusal("diagnose", campaign, "--out", tmp_path / "diagnosis")
    assert says in refusal("effects", "--campaign", campaign)
    # By eye or with a ruler an attitude is known to a few digits.
    scheme = tmp_path / "nine.yaml"
    rows = "".join(f"- [{x:.3f}, {y:.3f}, {z:.3f}]\n" for x, y, z in NINE)
    scheme.write_text(f"directions:\n{rows}", encoding="utf-8")
    assert "8/9" in succeed("schemes", scheme).output
