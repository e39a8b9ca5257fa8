"""Jobs that the twin makes, each once for a test."""

import csv
import os
import pathlib
import subprocess
import tempfile

import numpy as np

SOURCE = pathlib.Path(os.environ["CROSSTIE_SOURCE_DIR"])


def job(name):
    """(TemporaryDirectory, path of the job): keep the first as long as the second is used."""
    folder = tempfile.TemporaryDirectory()
    path = pathlib.Path(folder.name) / name
    subprocess.run([os.environ["CROSSTIE_TWIN"], name, path], check=True)
    return folder, path


def points_of(path):
    """{id: xyz} of a list with x_mm, y_mm, z_mm."""
    with open(path, newline="") as file:
        return {int(row["id"]): np.array([float(row[c]) for c in ("x_mm", "y_mm", "z_mm")]) for row in csv.DictReader(file)}


def float_tiff(path):
    """A float32 TIFF without compression, in one strip."""
    data = path.read_bytes()
    at = int.from_bytes(data[4:8], "little")
    tags = {}
    for i in range(int.from_bytes(data[at : at + 2], "little")):
        entry = data[at + 2 + 12 * i : at + 14 + 12 * i]
        tags[int.from_bytes(entry[:2], "little")] = int.from_bytes(entry[8:12], "little")
    assert tags[259] == 1 and tags[339] == 3
    return np.frombuffer(data, "<f4", tags[256] * tags[257], tags[273]).reshape(tags[257], tags[256])


def aligned(points, onto):
    """`points` moved rigidly onto `onto` by least squares (Kabsch), with the rotation."""
    a, b = points - points.mean(0), onto - onto.mean(0)
    u, _, vt = np.linalg.svd(a.T @ b)
    rotation = (u @ np.diag([1, 1, np.sign(np.linalg.det(u @ vt))]) @ vt).T
    return a @ rotation.T + onto.mean(0), rotation
