"""Sensor models: forwards and backwards, against plain matrices and the effects themselves."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from usual import G

from accelstudy.basics.units import MGON
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import MODELS, get_model
from accelstudy.sensors.sensor import SensorModel

NINE = "bias-scale-nonorthogonality"
TWELVE = "bias-scale-nonorthogonality-crossaxis"
# Realistic sizes by unit: 0.5 m/s² of bias, 2 % of scale and nonlinearity, 2 gon of angle.
SIZE = {"m/s^2": 0.5, "1": 0.02, "rad": 2000 * MGON}
ALL_MODELS = pytest.mark.parametrize("name", MODELS)


def draw_parameters(model, data):
    unit_cube = st.lists(st.floats(-1, 1), min_size=model.n_parameters, max_size=model.n_parameters)
    return np.array(data.draw(unit_cube)) * [SIZE[p.unit] for p in model.parameters]


def random_parameters(model, *shape, seed=0):
    rng = np.random.default_rng(seed)
    size = [SIZE[p.unit] for p in model.parameters]
    return rng.uniform(-1, 1, (*shape, model.n_parameters)) * size


def forces():
    return -G * get_scheme("mclaren-24").directions


def t_matrix(yz, zy, zx, xz=0.0, xy=0.0, yx=0.0):
    """Eq. (3) of Thalmann & Neuner (2018)."""
    return np.array([[1, -yz, zy], [xz, 1, -zx], [-xy, yx, 1]])


@ALL_MODELS
@settings(max_examples=10)
@given(data=st.data())
def test_sense_and_correct_invert_each_other(name, data):
    model = get_model(name)
    p = draw_parameters(model, data)
    for back in (
        model.correct(model.sense(forces(), p), p),
        model.sense(model.correct(forces(), p), p),
    ):
        np.testing.assert_allclose(back, forces(), rtol=0, atol=1e-12 * G)


@pytest.mark.parametrize("name", [NINE, TWELVE])
@given(data=st.data())
def test_a_model_of_the_axes_is_that_of_the_paper(name, data):
    """Eq. (3) with twelve parameters, and eq. (5) with nine."""
    model = get_model(name)
    p = draw_parameters(model, data)
    b, s, axes = p[:3], p[3:6], t_matrix(*p[6:])
    np.testing.assert_allclose(model.axes_matrix(p), axes, rtol=0, atol=1e-14)
    expected = forces() @ (np.diag(1 + s) @ np.linalg.inv(axes)).T + b
    np.testing.assert_allclose(model.sense(forces(), p), expected, rtol=0, atol=1e-14 * G)


def test_vector_orders_a_mapping_and_fills_in_zeros():
    p = get_model(NINE).vector({"alpha_zx": 3.0, "b_y": 1.0})
    np.testing.assert_array_equal(p, [0, 1, 0, 0, 0, 0, 0, 0, 3])


# --- batches -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("forces_batch", "parameters_batch", "gravity_batch", "batch"), [
    ((), (), (), ()),
    ((), (5,), (), (5,)),
    ((5,), (), (), (5,)),
    ((5,), (5,), (5,), (5,)),
    ((), (), (5,), (5,)),
    ((4, 1), (5,), (), (4, 5)),
])  # fmt: skip
def test_batches_broadcast(forces_batch, parameters_batch, gravity_batch, batch):
    model = get_model("bias-scale-nonorthogonality-quadratic-cubic")
    rng = np.random.default_rng(1)
    f_b = forces() + rng.standard_normal((*forces_batch, 24, 3))
    p = random_parameters(model, *parameters_batch)
    g = G + 0.01 * rng.standard_normal(gravity_batch)
    f_s = model.sense(f_b, p, g)
    assert f_s.shape == (*batch, 24, 3)
    np.testing.assert_allclose(
        model.correct(f_s, p, g), np.broadcast_to(f_b, f_s.shape), rtol=0, atol=1e-12 * G
    )
    u = model.n_parameters
    every = [np.broadcast_to(*each) for each in ((f_b, f_s.shape), (p, (*batch, u)), (g, batch))]
    for index in np.ndindex(*batch):
        one = model.sense(*(part[index] for part in every))
        np.testing.assert_allclose(f_s[index], one, rtol=1e-14)


@pytest.mark.parametrize(("effect", "wrong"), [("quadratic_scale", -5.0), ("scale", -1.0)])
def test_an_inverse_that_does_not_exist_is_not_a_number(effect, wrong):
    """A quadratic beyond its turning point, and an axis without sensitivity; others have one."""
    model = SensorModel.of("one", [effect])
    result = model.correct(np.array([[G, 0.0, 0.0]]), np.array([[0.0, 0, 0], [wrong, 0, 0]]))
    np.testing.assert_allclose(result[0], [[G, 0, 0]], rtol=1e-14)
    assert np.isnan(result[1, 0, 0])
