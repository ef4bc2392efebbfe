"""The skin as a cloud of points with its curvature, and the contact as a pose, for Foxglove."""

import base64
import json

import numpy as np
import scipy

from kappaskin.bases import CurvatureMap
from kappaskin.frames import COMPONENTS, Array
from kappaskin.pipeline import Pipeline
from kappaskin.publish.channels import FRAME, moment
from kappaskin.publish.message import Message

POINTS = 33
"""Points of the cloud along each side of the skin, edges included."""

NAMES = ("x", "y", "z", "displacement", *(f"curvature_{name}" for name in COMPONENTS))
"""What each point has: place and displacement in m, change of curvature in 1/m."""

_FLOAT32 = 7  # as Foxglove numbers types
_AT_ORIGIN = '{"position":{"x":0,"y":0,"z":0},"orientation":{"x":0,"y":0,"z":0,"w":1}}'
_FIELDS = json.dumps(
    [{"name": name, "offset": 4 * k, "type": _FLOAT32} for k, name in enumerate(NAMES)]
)


class _Grid:
    """Points of a skin, and the maps from coefficients to what they have; made once a setup."""

    def __init__(self, pipeline: Pipeline) -> None:
        basis = pipeline.basis
        x, y = basis.patch.grid(POINTS, POINTS)
        places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        self._on_skin = basis.patch.contains(places)
        self._at_rest, self._outward = basis.patch.at_rest(places[self._on_skin])
        self._maps = [
            basis.on_grid(x, y),
            *(CurvatureMap(basis, component, x, y) for component in COMPONENTS),
        ]

    def __call__(self, coefficients: Array) -> Array:
        """What the points have, (points, 7)."""
        values = [of(coefficients).ravel()[self._on_skin] for of in self._maps]
        points = self._at_rest - values[0][:, None] * self._outward
        return np.column_stack([points, *values])


class Cloud:
    """Messages to clouds of points."""

    def __init__(self) -> None:
        self._pipeline: Pipeline | None = None
        self._grid: _Grid | None = None

    def __call__(self, message: Message) -> bytes | None:
        """The skin as a foxglove.PointCloud in JSON; None when its shape is not known."""
        coefficients = message.estimate.coefficients
        if not np.isfinite(coefficients).all():
            return None
        if self._grid is None or self._pipeline is not message.pipeline:
            self._pipeline, self._grid = message.pipeline, _Grid(message.pipeline)
        data = base64.b64encode(self._grid(coefficients).astype("<f4").tobytes()).decode()
        return (
            f'{{"timestamp":{moment(message.timestamp)},"frame_id":"{FRAME}","pose":{_AT_ORIGIN},'
            f'"point_stride":{4 * len(NAMES)},"fields":{_FIELDS},"data":"{data}"}}'
        ).encode()


def pose(message: Message) -> bytes:
    """The contact as a foxglove.PoseInFrame in JSON: z is the skin's normal, x along the skin."""
    geometry = message.estimate.geometry
    x, y, z = geometry.position.tolist()
    turn = dict(
        zip(
            "xyzw",
            scipy.spatial.transform.Rotation.from_matrix(geometry.frame.T).as_quat().tolist(),
            strict=True,
        )
    )
    return (
        f'{{"timestamp":{moment(message.timestamp)},"frame_id":"{FRAME}","pose":{{"position":'
        f'{{"x":{x},"y":{y},"z":{z}}},"orientation":{json.dumps(turn)}}}}}'
    ).encode()
