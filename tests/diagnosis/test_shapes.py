"""Smooth functions without a name: their covariances, their evidence, and what is said of them."""

import numpy as np
import pytest
from diagnosis_helpers import campaign, design, shuffled, some_holds
from usual import GRAVITY, NINE, ROBOT

from accelstudy.basics.units import GON
from accelstudy.diagnosis.space.shapes import MIN_TRACE_SHARE, LearnedShapes, coordinate_in_holds
from accelstudy.diagnosis.visibility import examine_campaign
from accelstudy.effects import get_effect
from accelstudy.effects.smooth import LENGTHS


@pytest.fixture(scope="module", params=[ROBOT, GRAVITY], ids=lambda approach: approach.name)
def frame(request):
    directions = shuffled("fibonacci-30")
    return design(directions, request.param, hold=some_holds(30), seed=7)


@pytest.fixture(scope="module")
def shapes(frame):
    return LearnedShapes.of(frame)


def covariances(shapes):
    pairs = zip(shapes.split(shapes.vectors), shapes.shares, strict=True)
    return [(vectors * share) @ vectors.T for vectors, share in pairs]


def test_shapes_live_in_the_space_of_the_residuals(frame, shapes):
    assert shapes.prior.sum() == pytest.approx(1)
    assert np.abs(frame.residuals.design.T @ shapes.vectors).max() < 1e-8
    for vectors, share in zip(shapes.split(shapes.vectors), shapes.shares, strict=True):
        assert share.sum() == pytest.approx(1)
        assert vectors.T @ vectors == pytest.approx(np.eye(len(share)), abs=1e-6)
    targets = {target for _, target in shapes.places}
    assert ("tilt" in targets) == ("reading" in targets) == frame.solution.approach.uses_angles


def shares(frame, shapes, change):
    """Share of what a change of the force (n, 3) shows that lies in a shape of each place."""
    residuals = frame.residuals
    row = residuals.by_observations[..., :3] @ change[..., None]
    row = residuals.project(residuals.stack(row))
    row /= np.linalg.norm(row)
    found = {}
    for place, vectors in zip(shapes.places, shapes.split(shapes.vectors), strict=True):
        found[place] = max(found.get(place, 0.0), float(np.sum((row.T @ vectors) ** 2)))
    return found


def test_a_shape_holds_any_smooth_function_of_its_coordinate(frame, shapes):
    """A bump in the temperature of a bias lies nearly all in one shape, and in no other place."""
    bump = np.exp(-(((frame.hold.temperature - 22) / 6) ** 2))
    share = shares(frame, shapes, np.outer(bump, [1.0, -0.4, 0.7]))
    assert share.pop(("temperature", "bias")) > 0.95
    # Few conditions leave room for chance: by gravity there are 21.
    if frame.solution.approach.uses_angles:
        assert max(share.values()) < 0.8


def test_a_rotation_of_the_mounting_has_its_place_where_a_robot_sees_it(frame, shapes):
    """Gravity alone is blind to it."""
    if not frame.solution.approach.uses_angles:
        assert not any(target == "mounting" for _, target in shapes.places)
        return
    angle = (frame.hold.vibration - 1) ** 2
    turned = np.cross(np.outer(angle - angle.mean(), [1.0, -0.4, 0.7]), frame.forces)
    assert shares(frame, shapes, turned)["vibration", "mounting"] > 0.95


@pytest.mark.parametrize("frame", [ROBOT], indirect=True)
def test_what_is_the_same_in_all_positions_is_no_function(frame):
    """A tilt of the base and offsets of its encoders are effects of the catalogue."""
    residuals, shapes = frame.residuals, LearnedShapes.of(frame)
    for name in ("base_tilt", "encoder_offset"):
        basis = np.linalg.qr(residuals.project(frame.rows(get_effect(name))))[0]
        for place, vectors in zip(shapes.places, shapes.split(shapes.vectors), strict=True):
            if place[1] in ("tilt", "reading") and place[0] != "angle":
                assert np.linalg.norm(basis.T @ vectors[:, -1]) < 0.75, place


def test_a_course_of_time_has_the_covariance_of_its_kernel(frame, shapes):
    """The biases follow a squared-exponential kernel, but near the ends of its domain."""
    residuals, time = frame.residuals, frame.hold.time
    t = 2 * (time - time[0]) / np.ptp(time) - 1
    kept = [k for place, k in zip(shapes.places, covariances(shapes), strict=True)
            if place == ("time", "bias")]  # fmt: skip
    for length, found in zip(LENGTHS[:2], kept, strict=False):
        kernel = np.exp(-((t[:, None] - t) ** 2) / 2 / length**2)
        root = np.linalg.svd(kernel)[0] * np.sqrt(np.linalg.svd(kernel)[1])
        change = np.einsum("nk,ab->nakb", root, np.eye(3)).reshape(len(t), 3, -1)
        rows = residuals.project(residuals.stack(residuals.by_observations[..., :3] @ change))
        expected = rows @ rows.T / np.sum(rows**2)
        assert np.linalg.norm(found - expected) < 0.15 * np.linalg.norm(expected)


def test_beside_an_effect_a_shape_is_what_the_effect_leaves(shapes):
    rng = np.random.default_rng(2)
    basis = np.linalg.qr(shapes.vectors @ rng.standard_normal((shapes.vectors.shape[1], 3)))[0]
    left = np.eye(len(basis)) - basis @ basis.T
    beside = shapes.orthogonal_to(basis)
    assert len(beside.places) == len(shapes.places)
    for before, after in zip(covariances(shapes), covariances(beside), strict=True):
        expected = left @ before @ left
        # Directions with a share of less than MIN_TRACE_SHARE are dropped.
        off = np.linalg.norm(after - expected / np.trace(expected))
        assert off < 20 * MIN_TRACE_SHARE


def test_coordinates_are_those_of_the_campaign():
    measured = campaign()
    frame = examine_campaign(measured, NINE)
    for name, expected in {
        "time": measured.time,
        "temperature": measured.temperature,
        "vibration": measured.vibration,
        "yaw": measured.yaw,
        "angle": measured.angles,
        "move": np.diff(measured.angles, axis=0, prepend=measured.angles[:1]),
    }.items():
        off = coordinate_in_holds(name, frame) - np.reshape(expected, (measured.n_positions, -1))
        # An angle may be a whole turn away.
        assert np.abs((off / (400 * GON) + 0.5) % 1 - 0.5).max() < 1e-12 or not off.any(), name
    force = coordinate_in_holds("force", frame)
    np.testing.assert_array_equal(coordinate_in_holds("previous", frame)[1:], force[:-1])
    np.testing.assert_allclose(coordinate_in_holds("next", frame)[:-1], np.diff(force, axis=0))
