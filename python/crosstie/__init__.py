"""crosstie ties what a welding machine sees to the machine's own frame; every number carries a sigma.

Lengths are in mm, angles in rad, image coordinates in px with (0, 0) in the centre of the first pixel. Frames are part of every name:
``machine_from_rig`` takes rig coordinates to machine coordinates. Covariances of poses are (6, 6) in the order [rotation rad,
translation mm], for a perturbation on the left (docs/conventions.md). What cannot be answered raises ``crosstie.Error``.
"""

from ._core import (
    OBSERVATION,
    POINT,
    Camera,
    Error,
    ErrorCode,
    Status,
    __version__,
    adjust,
    detect,
    families,
    fit,
    read_cloud,
    read_image,
    read_result,
    scan,
    stitch,
    write_cloud,
)

version = __version__

__all__ = [
    "OBSERVATION",
    "POINT",
    "Camera",
    "Error",
    "ErrorCode",
    "Status",
    "__version__",
    "adjust",
    "detect",
    "families",
    "fit",
    "read_cloud",
    "read_image",
    "read_result",
    "scan",
    "stitch",
    "version",
    "write_cloud",
]

for _thing in (Camera, Error, ErrorCode, Status, adjust, detect, families, fit, read_cloud, read_image, read_result, scan, stitch, write_cloud):
    try:
        _thing.__module__ = "crosstie"
    except (AttributeError, TypeError):
        pass  # a builtin's is fixed
del _thing
