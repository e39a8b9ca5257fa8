"""fit(), clouds, results: truth is what numpy drew."""

import pathlib
import tempfile
import unittest

import crosstie
import numpy as np

RANDOM = np.random.default_rng(7)


def sphere(count, sigma):
    directions = RANDOM.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return [10.0, -20.0, 1300.0] + 50.0 * directions + RANDOM.normal(scale=sigma, size=(count, 3))


class Fit(unittest.TestCase):
    def test_sphere_with_its_covariance(self):
        normalised = []
        for _ in range(100):
            ball = crosstie.fit(sphere(60, 0.05), "sphere", sigma_mm=0.05)
            self.assertEqual(list(ball["params"]), ["u_mm", "v_mm", "w_mm", "size_mm"])
            self.assertEqual(ball["params_cov"].shape, (4, 4))
            off = np.append(ball["point_mm"] - [10.0, -20.0, 1300.0], ball["diameter_mm"] / 2 - 50.0)
            normalised.append(off @ np.linalg.solve(ball["params_cov"], off))
        # Chi-square with 400 degrees of freedom: within 5 of its sigmas.
        self.assertLess(abs(sum(normalised) - 400.0), 5 * np.sqrt(800.0))

    def test_takes_views_of_other_types_and_names_strays(self):
        points = np.zeros((200, 6), np.float64)
        points[::2, 1:4] = sphere(100, 0.01)
        points[10, 1:4] += 30.0
        ball = crosstie.fit(points[::2, 1:4], "sphere", sigma_mm=0.01, robust=True)
        self.assertIn(5, ball["rejected"])
        self.assertLessEqual(len(ball["rejected"]), 3)  # of good ones 0.1 %
        self.assertGreater(ball["residuals_mm"][5], 1.0)
        self.assertEqual(ball["residuals_mm"].shape, (100,))

    def test_refuses(self):
        for points, shape, code in (
            (np.zeros((2, 3)), "sphere", crosstie.ErrorCode.NO_UNIQUE_SOLUTION),
            (sphere(10, 0.1), "blob", crosstie.ErrorCode.USAGE),
            (np.full((9, 3), np.nan), "plane", crosstie.ErrorCode.BAD_INPUT),
        ):
            with self.assertRaises(crosstie.Error) as raised:
                crosstie.fit(points, shape)
            self.assertIs(raised.exception.code, code)
        with self.assertRaises(ValueError):
            crosstie.fit(np.zeros((9, 2)), "plane")


class Files(unittest.TestCase):
    def test_cloud_comes_back(self):
        points = sphere(50, 0.1)
        covariance = np.einsum("ni,nj->nij", points, points) * 1e-9
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "cloud.ply"
            crosstie.write_cloud(path, {"frame": "rig", "points": points, "cov_mm2": covariance, "fields": {"sigma_mm": points[:, 0]}})
            header, body = path.read_bytes().split(b"end_header\n", 1)
            self.assertIn(b"binary_little_endian", header)
            self.assertTrue(np.array_equal(np.frombuffer(body, "<f8", 3), points[0]))
            cloud = crosstie.read_cloud(str(path))
            with self.assertRaises(crosstie.Error) as raised:
                crosstie.read_cloud(path.with_name("none.ply"))
            self.assertEqual(raised.exception.code, crosstie.ErrorCode.FILE_SYSTEM)
        self.assertEqual(cloud["frame"], "rig")
        self.assertTrue(np.array_equal(cloud["points"], points))
        self.assertTrue(np.allclose(cloud["cov_mm2"], covariance, rtol=1e-6))
        self.assertTrue(np.allclose(cloud["fields"]["sigma_mm"], points[:, 0]))
        self.assertIsNone(cloud["normals"])


class Lens(unittest.TestCase):
    def test_projects_as_the_formula_says(self):
        lens = crosstie.Camera("opencv5", 1200, 900, [1150.0, 1148.0, 600.0, 450.0, -0.1, 0.05, 1e-4, -2e-4, 0.01])
        points = RANDOM.uniform([-300, -200, 900], [300, 200, 1500], (40, 3))
        x, y = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2]
        r2 = x * x + y * y
        radial = 1 - 0.1 * r2 + 0.05 * r2**2 + 0.01 * r2**3
        u = x * radial + 2 * 1e-4 * x * y - 2e-4 * (r2 + 2 * x * x)
        v = y * radial + 1e-4 * (r2 + 2 * y * y) - 2 * 2e-4 * x * y
        expected = np.column_stack([1150 * u + 600, 1148 * v + 450])
        self.assertLess(np.abs(lens.project(points) - expected).max(), 1e-9)
        rays = lens.unproject(expected)
        self.assertLess(np.abs(rays - points / np.linalg.norm(points, axis=1)[:, None]).max(), 1e-9)
        self.assertTrue(np.isnan(lens.project([[0.0, 0.0, -1.0]])).all())
