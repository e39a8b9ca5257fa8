"""Types of the package crosstie; docstrings with units, shapes and frames stand in the functions themselves: help(crosstie.scan)."""

from enum import IntEnum
from os import PathLike
from typing import Any, Dict, List, Mapping, Optional, Sequence, Tuple, TypedDict, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str
version: str

_Path = Union[str, PathLike[str]]
_Image = Union[NDArray[np.uint8], NDArray[np.uint16]]  # (rows, columns)
_Images = Union[_Image, Sequence[_Image]]  # (patterns, rows, columns)
_Doubles = NDArray[np.float64]
_Records = NDArray[np.void]

# id i4, status i1, centre_px (2,), cov_px2 (2, 2), semi_major_px, semi_minor_px, angle_rad, margin
OBSERVATION: np.dtype[np.void]
# id i4, xyz_mm (3,), cov_mm2 (3, 3)
POINT: np.dtype[np.void]

class Status(IntEnum):
    CODED = 0
    UNCODED = 1
    AMBIGUOUS = 2
    UNREADABLE = 3
    REFUSED = 4

class ErrorCode(IntEnum):
    USAGE = 2
    BAD_INPUT = 3
    NO_UNIQUE_SOLUTION = 4
    FILE_SYSTEM = 5
    DEVICE = 6
    INTERNAL = 70
    CANCELLED = 130

class Error(RuntimeError):
    code: ErrorCode

class Cloud(TypedDict):
    frame: str
    points: _Doubles  # (N, 3) mm
    normals: Optional[_Doubles]  # (N, 3)
    cov_mm2: Optional[_Doubles]  # (N, 3, 3)
    fields: Dict[str, _Doubles]  # (N,) each

class Scan(Cloud):
    depth_mm: NDArray[np.float32]  # (rows, columns)
    status_left: NDArray[np.uint8]  # (rows, columns)
    status_right: NDArray[np.uint8]
    markers: _Records  # POINT
    summary: Dict[str, Any]

class Camera:
    def __init__(
        self, lens: str, width_px: int, height_px: int, parameters: ArrayLike, covariance: Optional[ArrayLike] = None
    ) -> None: ...
    @staticmethod
    def nominal(width_px: int, height_px: int, focal_px: float, lens: str = "opencv5") -> Camera: ...
    @staticmethod
    def read(path: _Path) -> Camera: ...
    def write(self, path: _Path) -> None: ...
    @property
    def lens(self) -> str: ...
    @property
    def width_px(self) -> int: ...
    @property
    def height_px(self) -> int: ...
    @property
    def parameters(self) -> _Doubles: ...
    @property
    def parameter_names(self) -> List[str]: ...
    @property
    def covariance(self) -> Optional[_Doubles]: ...
    def project(self, points: ArrayLike) -> _Doubles: ...
    def unproject(self, pixels: ArrayLike) -> _Doubles: ...

def families() -> List[str]: ...
def detect(
    image: _Image, family: str, ids: Optional[Sequence[int]] = None, polarity: str = "both", white_level: float = 0.0
) -> _Records: ...
def adjust(
    images: Mapping[str, Tuple[str, _Records]],
    cameras: Mapping[str, Camera],
    scale_bars: Optional[Union[Sequence[Tuple[int, int, float, float]], _Path]] = None,
    *,
    scale_is_free: bool = False,
    control: Optional[_Records] = None,
    datum: Optional[_Records] = None,
    rigs: Mapping[str, Tuple[Sequence[str], Sequence[Sequence[str]]]] = ...,
    held: Mapping[str, Sequence[str]] = ...,
    fixed: set[str] = ...,
    dot_diameter_mm: Optional[float] = None,
    uncoded: bool = True,
    reject_outliers: bool = True,
    significance: float = 0.001,
    full_covariance: bool = True,
) -> Dict[str, Any]: ...
def scan(
    left: _Images,
    right: _Images,
    manifest: _Path,
    rig: str,
    *,
    min_depth_mm: float = 0.0,
    max_depth_mm: float = 1e9,
    guard_px: int = 2,
    filter_px: int = 0,
    max_grazing_rad: float = 1.22,
    white_level: float = 0.0,
    markers: Optional[Tuple[_Records, _Records]] = None,
    thickness_mm: float = 0.0,
    dot_diameter_mm: Optional[float] = None,
    max_off_curve_px: Optional[float] = None,
) -> Scan: ...
def stitch(
    stations: Sequence[Mapping[str, Any]],
    *,
    commission: Optional[_Path] = None,
    calibration: Optional[_Path] = None,
    reference: Optional[_Records] = None,
    reference_in_part: bool = False,
    cell_mm: float = 2.0,
    sigma_mm: Optional[float] = None,
    reach_mm: Optional[float] = None,
) -> Dict[str, Any]: ...
def fit(
    points: ArrayLike,
    shape: str,
    *,
    sigma_mm: Optional[float] = None,
    cov_mm2: Optional[ArrayLike] = None,
    radius_mm: Optional[float] = None,
    radius_sigma_mm: float = 0.0,
    robust: bool = False,
) -> Dict[str, Any]: ...
def read_result(folder: _Path) -> Dict[str, Any]: ...
def read_cloud(path: _Path) -> Cloud: ...
def write_cloud(path: _Path, cloud: Mapping[str, Any]) -> None: ...
def read_image(path: _Path) -> _Image: ...
