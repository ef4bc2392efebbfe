"""A bare QtInteractor with the app's mesh.

Alone, prints how long after the time given it was drawn, and what processor time that took.
"""

import sys
import time

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from PySide6.QtWidgets import QApplication
from pyvistaqt import QtInteractor

N = 65


def bare_window() -> tuple[QtInteractor, pv.PolyData, NDArray[np.float64]]:
    """The widget, its mesh of `N` x `N` points, and a shape (N, N) to give to it."""
    widget = QtInteractor(auto_update=False, multi_samples=0)
    widget.resize(1280, 800)
    x, y = np.meshgrid(np.linspace(0, 100, N), np.linspace(0, 100, N))
    index = np.arange(N * N).reshape(N, N)
    corners = [index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]]
    faces = np.stack([np.full_like(corners[0], 4), *corners], axis=-1).ravel()
    mesh = pv.PolyData(np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()]), faces=faces)
    mesh.point_data["value"] = np.zeros(N * N)
    widget.add_mesh(mesh, scalars="value", clim=(0, 1), show_scalar_bar=False)
    return widget, mesh, np.sin(np.pi * x / 100) * np.sin(np.pi * y / 100)


if __name__ == "__main__":
    started = float(sys.argv[1])
    application = QApplication([])
    widget = bare_window()[0]
    drawn: list[float] = []
    widget.renderer.AddObserver("EndEvent", lambda *_: drawn.append(time.monotonic()))
    widget.show()
    widget.update()
    while not drawn:
        application.processEvents()
    print(drawn[0] - started, time.process_time())
    widget.close()
