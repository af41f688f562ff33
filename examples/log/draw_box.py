"""Draw how a box lies on a table: on a face, on an edge, on a corner."""

import matplotlib.pyplot as plt
import numpy as np
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) - 0.5
FACES = [np.insert(SQUARE, axis, side, axis=1) for axis in range(3) for side in (-0.5, 0.5)]
COLOURS = ["#d55e00", "#e9b08a", "#009e73", "#8fd0bc", "#0072b2", "#8dbbdd"]
TABLE = np.insert(2.2 * SQUARE, 2, 0, axis=1)


def lying(down):
    """Faces of the box, turned so that `down` in its axes points to the table."""
    z = -np.array(down) / np.linalg.norm(down)
    x = np.cross([0, 1, 0], z)
    x /= np.linalg.norm(x)
    faces = np.array(FACES) @ np.column_stack([x, np.cross(z, x), z])
    return faces - [0, 0, faces[..., 2].min()]


figure = plt.figure(figsize=(9, 3), layout="constrained")
kinds = [("6 faces", [0, 0, -1]), ("12 edges", [1, 0, -1]), ("8 corners", [1, -1, -1])]
for place, (title, down) in enumerate(kinds, start=1):
    panel = figure.add_subplot(1, 3, place, projection="3d", computed_zorder=False)
    panel.set_title(title, y=1)
    panel.add_collection3d(Poly3DCollection([TABLE], color="#e6e6e6"))
    panel.add_collection3d(Poly3DCollection(lying(down), facecolors=COLOURS, edgecolor="black"))
    panel.set(xlim=(-1.1, 1.1), ylim=(-1.1, 1.1), zlim=(0, 1.8))
    panel.set_box_aspect((2.2, 2.2, 1.8), zoom=1.25)
    panel.view_init(elev=20, azim=-60)
    panel.set_axis_off()
figure.savefig("box.png", dpi=120)
