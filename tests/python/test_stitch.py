"""stitch(): three windows of a drawn cylinder with markers; truth is where numpy put the stations."""

import unittest

import crosstie
import numpy as np

RANDOM = np.random.default_rng(3)
RADIUS, MARKER_SIGMA, POINT_SIGMA = 2000.0, 0.02, 0.05


def on_cylinder(z, turn):
    return np.column_stack([RADIUS * np.cos(turn) - RADIUS, RADIUS * np.sin(turn), z])


def pose(x, y, z, turns):
    """world_from_rig by small turns about x, y, z."""
    matrix = np.eye(4)
    for axis, turn in enumerate(turns):
        i, j = [(1, 2), (2, 0), (0, 1)][axis]
        one = np.eye(4)
        one[i, i] = one[j, j] = np.cos(turn)
        one[j, i], one[i, j] = np.sin(turn), -np.sin(turn)
        matrix = matrix @ one
    matrix[:3, 3] = x, y, z
    return matrix


class Stitch(unittest.TestCase):
    def test_stations_come_where_they_were(self):
        truth = [pose(1300.0, 0.0, 300.0 * k, (0.01 * k, -0.02 * k, 0.015 * k)) for k in range(3)]
        marks = on_cylinder(RANDOM.uniform(-250, 850, 24), RANDOM.uniform(-0.15, 0.15, 24))
        stations = []
        for k, world_from_rig in enumerate(truth):
            rig_from_world = np.linalg.inv(world_from_rig)
            into = lambda p: p @ rig_from_world[:3, :3].T + rig_from_world[:3, 3]
            points = into(on_cylinder(RANDOM.uniform(300 * k - 260, 300 * k + 260, 30000), RANDOM.uniform(-0.15, 0.15, 30000)))
            points += RANDOM.normal(scale=POINT_SIGMA, size=points.shape)
            seen = np.flatnonzero(np.abs(marks[:, 2] - 300 * k) < 260)
            markers = np.zeros(len(seen), crosstie.POINT)
            markers["id"] = seen
            markers["xyz_mm"] = into(marks[seen]) + RANDOM.normal(scale=MARKER_SIGMA, size=(len(seen), 3))
            markers["cov_mm2"] = MARKER_SIGMA**2 * np.eye(3)
            stations.append({"name": f"s{k}", "cloud": {"points": points}, "markers": markers})
        result = crosstie.stitch(stations, sigma_mm=POINT_SIGMA)

        # The frame is the rig of the first station.
        self.assertIn("s0", result["frame"])
        for k, station in enumerate(result["stations"]):
            expected = np.linalg.inv(truth[0]) @ truth[k]
            self.assertLess(np.abs(station["machine_from_rig"] - expected)[:3, :3].max(), 2e-4)
            centre = np.append(stations[k]["cloud"]["points"].mean(0), 1.0)
            self.assertLess(np.linalg.norm((station["machine_from_rig"] - expected) @ centre), 0.15)
            self.assertEqual(station["cov"].shape, (6, 6))
        self.assertEqual(result["covariance"].shape, (18, 18))
        cloud = result["cloud"]
        self.assertEqual(cloud["cov_mm2"].shape, (len(cloud["points"]), 3, 3))
        world = cloud["points"] @ truth[0][:3, :3].T + truth[0][:3, 3]
        off = np.hypot(world[:, 0] + RADIUS, world[:, 1]) - RADIUS
        self.assertLess(np.sqrt((off**2).mean()), 0.1)

    def test_a_station_that_nothing_ties_is_named(self):
        plane = lambda: np.column_stack([RANDOM.uniform(-200, 200, (2000, 2)), RANDOM.normal(1300.0, 0.05, 2000)])
        stations = [{"name": name, "cloud": {"points": plane()}} for name in ("first", "second")]
        with self.assertRaises(crosstie.Error) as raised:
            crosstie.stitch(stations, sigma_mm=0.05)
        self.assertIs(raised.exception.code, crosstie.ErrorCode.NO_UNIQUE_SOLUTION)
        self.assertIn("second", str(raised.exception))
