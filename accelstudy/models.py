"""The sensor models of the paper, and Table 1 as presets of a model and a scheme."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

from accelstudy.errors import UnknownNameError
from accelstudy.sensor import SensorModel

_NINE = ("bias", "scale", "nonorthogonality")

MODELS: dict[str, tuple[str, ...]] = {
    "bias-scale": ("bias", "scale"),
    "bias-scale-nonorthogonality": _NINE,
    "bias-scale-nonorthogonality-crossaxis": (*_NINE, "cross_axis_misalignment"),
    "bias-scale-nonorthogonality-quadratic": (*_NINE, "quadratic_scale"),
    "bias-scale-nonorthogonality-cubic": (*_NINE, "cubic_scale"),
    "bias-scale-nonorthogonality-quadratic-cubic": (*_NINE, "quadratic_scale", "cubic_scale"),
}
"""Name -> effects (Thalmann & Neuner 2018, section 2; nonlinear scale after Cai 2013)."""

TITLES = {
    "bias-scale": "6: bias, scale",
    "bias-scale-nonorthogonality": "9: + non-orthogonality",
    "bias-scale-nonorthogonality-crossaxis": "12: 9 + cross-axis",
    "bias-scale-nonorthogonality-quadratic": "12: 9 + quadratic",
    "bias-scale-nonorthogonality-cubic": "12: 9 + cubic",
    "bias-scale-nonorthogonality-quadratic-cubic": "15: 9 + quadratic + cubic",
}
"""Short titles for figures."""


def get_model(name: str, extra: Mapping[str, Sequence[str]] | None = None) -> SensorModel:
    """Return a model by its name.

    Parameters
    ----------
    name : str
    extra : mapping of name to names of effects, optional
        Models defined by the caller, beside the registered ones.

    Raises
    ------
    UnknownNameError
        If there is no such model, or an effect of it does not exist.
    """
    known = {**MODELS, **(extra or {})}
    if name not in known:
        raise UnknownNameError("model", name, known)
    return compose(name, tuple(known[name]))


@cache
def compose(name: str, effects: tuple[str, ...]) -> SensorModel:
    """Compose a model of effects; the same model, traced once, for the same arguments."""
    return SensorModel.of(name, effects)


@dataclass(frozen=True)
class Preset:
    """One row of the paper's Table 1 (or one of the schemes a row names)."""

    name: str
    source: str
    model: str
    scheme: str


_SIX_MODEL, _NINE_MODEL = "bias-scale", "bias-scale-nonorthogonality"
_CROSS_AXIS = "bias-scale-nonorthogonality-crossaxis"

PRESETS: tuple[Preset, ...] = (
    Preset("loetters-1998", "[21] Lötters 1998", _SIX_MODEL, "faces-6"),
    Preset("shin-2002", "[22] Shin & El-Sheimy 2002", _NINE_MODEL, "faces-edges-18"),
    Preset("skog-2006", "[14] Skog & Händel 2006", _NINE_MODEL, "faces-edges-18"),
    Preset("syed-2007", "[15] Syed 2007", _NINE_MODEL, "faces-edges-18"),
    Preset("syed-2007-26", "[15] Syed 2007, 26", _NINE_MODEL, "faces-edges-corners-26"),
    Preset("qureshi-2017", "[23] Qureshi 2017", _NINE_MODEL, "faces-edges-18"),
    Preset("fong-2008-18", "[20] Fong 2008, 18", _CROSS_AXIS, "faces-edges-18"),
    Preset("fong-2008-24", "[20] Fong 2008, 24", _CROSS_AXIS, "rings-24"),
    Preset("zhang-2010", "[17] Zhang 2010", _NINE_MODEL, "d-optimal-9"),
    Preset("cai-2013", "[24] Cai 2013", f"{_NINE_MODEL}-quadratic", "mclaren-24"),
    Preset("tedaldi-2014-36", "[25, 26] Tedaldi 2014, 36", _NINE_MODEL, "fibonacci-36"),
    Preset("tedaldi-2014-38", "[25, 26] Tedaldi 2014, 38", _NINE_MODEL, "xsens-38"),
    Preset("tedaldi-2014-50", "[25, 26] Tedaldi 2014, 50", _NINE_MODEL, "fibonacci-50"),
    Preset("lv-2017", "[19] Lv 2017", _CROSS_AXIS, "icosidodecahedron-30"),
)
"""Table 1 of Thalmann & Neuner (2018); the misalignment of [19] spans the cross-axis angles."""
