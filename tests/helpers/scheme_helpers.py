"""Schemes of which tests know what they determine."""

KNOWN = (
    "faces-6",
    "d-optimal-9",
    "icosahedron-12",
    "faces-edges-18",
    "dodecahedron-20",
    "antipodal-free-24",
    "fibonacci-24",
    "mclaren-24",
    "rhombicuboctahedron-24",
    "rings-24",
    "faces-edges-corners-26",
    "icosidodecahedron-30",
    "fibonacci-36",
    "random-38",
    "xsens-38",
    "fibonacci-50",
)
"""Those of the literature and more, by the number of positions."""
