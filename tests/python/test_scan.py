"""scan() on the twin's door: the true head, and the true depth of each pixel."""

import json
import unittest

import crosstie
import numpy as np
import twin


class Scan(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder, cls.job = twin.job("door")
        patterns = json.loads((cls.job / "scan" / "patterns.json").read_text())["images"]
        station = cls.job / "scan" / "x0000"
        cls.stacks = [
            np.stack([crosstie.read_image(path) for path in sorted((station / side).glob("*.png"))]) for side in ("left", "right")
        ]
        assert len(patterns) == len(cls.stacks[0])
        cls.manifest = cls.job / "scan" / "patterns.json"
        cls.rig = f"{cls.job}/truth/intrinsic.yml,{cls.job}/truth/extrinsic.yml"
        cls.truth = twin.float_tiff(cls.job / "truth" / "scan" / "x0000_depth.tiff")

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def test_depths_are_true_within_their_sigmas(self):
        scan = crosstie.scan(*self.stacks, self.manifest, self.rig)
        points, sigma = scan["points"], scan["fields"]["sigma_mm"]
        self.assertEqual(scan["frame"], "rig")
        self.assertEqual(points.shape, (len(sigma), 3))
        self.assertGreater(len(points), 15000)
        rows, columns = scan["fields"]["row"].astype(int), scan["fields"]["column"].astype(int)
        off = points[:, 2] - self.truth[rows, columns]
        sigma_z = sigma * points[:, 2] / np.linalg.norm(points, axis=1)
        self.assertLess(abs(np.median(off)), 0.05)
        scatter = 1.4826 * np.median(np.abs(off / sigma_z))
        self.assertTrue(0.7 < scatter < 1.5, scatter)
        self.assertTrue(np.allclose(scan["depth_mm"][rows, columns], points[:, 2], atol=1e-3))
        self.assertTrue((scan["status_left"][rows, columns] == 0).all())
        self.assertEqual(int(np.isfinite(scan["depth_mm"]).sum()), len(points))
        self.assertEqual(scan["summary"]["points"], len(points))

    def test_refuses_by_name(self):
        left, right = self.stacks
        for stacks, said in (((left[:-1], right), "images of"), ((right, left), "exchanged")):
            with self.assertRaises(crosstie.Error) as raised:
                crosstie.scan(*stacks, self.manifest, self.rig)
            self.assertIs(raised.exception.code, crosstie.ErrorCode.BAD_INPUT)
            self.assertIn(said, str(raised.exception))
