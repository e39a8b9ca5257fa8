"""detect() and adjust() on the twin's photographs of the cross, by the example of docs/python.md, against the true points."""

import json
import os
import re
import signal
import threading
import time
import unittest

import crosstie
import numpy as np
import twin


class Network(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder, cls.job = twin.job("cross")
        cls.truth = twin.points_of(cls.job / "truth" / "points.csv")

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def test_the_example_of_the_documentation(self):
        page = (twin.SOURCE / "docs" / "python.md").read_text()
        example = re.search(r"```python\n(.*?)```", page, re.S).group(1)
        photographs = sorted((self.job / "net").glob("*.png"))
        height, width = crosstie.read_image(photographs[0]).shape
        name = next(iter(json.loads((self.job / "truth" / "images.json").read_text())["images"]))["camera"]
        camera = crosstie.Camera.read(self.job / "truth" / f"{name}.cameramodel")
        focal = 0.98 * camera.parameters[0]  # as a nominal one is off
        example = example.replace("width_px=1200, height_px=900, focal_px=1150.0", f"{width}, {height}, {focal}")
        example = example.replace("[(101, 102, 500.0131, 0.005)]", repr(str(self.job / "net" / "scale_bars.csv")))
        previous = os.getcwd()
        os.chdir(self.folder.name)
        try:
            names = {"photographs": photographs}
            exec(compile(example, "docs/python.md", "exec"), names)
        finally:
            os.chdir(previous)
        network = names["network"]
        points = network["points"][~network["points"]["uncoded"]]
        self.assertGreater(len(points), 30)

        # Where the points lie, over what their covariances say, after the rigid motion between the frames.
        true = np.array([self.truth[i] for i in points["id"]])
        measured, rotation = twin.aligned(points["xyz_mm"], true)
        off = measured - true
        sigma = np.sqrt(np.einsum("ij,njk,ik->ni", rotation, points["cov_mm2"], rotation))
        self.assertLess(np.sqrt((off**2).mean()), 0.05)
        ratio = np.sqrt((off**2).mean() / (sigma**2).mean())
        self.assertTrue(0.5 < ratio < 2.0, ratio)
        self.assertEqual(network["images"][0]["network_from_camera"].shape, (4, 4))
        self.assertEqual(network["images"][0]["cov"].shape, (6, 6))
        self.assertEqual(network["covariance"].shape, 2 * (len(network["covariance_labels"]),))
        self.assertLess(abs(network["lenses"]["hand"].parameters[0] - camera.parameters[0]), 3.0)
        at = network["covariance_labels"].index(f"point {points['id'][0]} x [mm]")
        self.assertAlmostEqual(network["covariance"][at, at], points["cov_mm2"][0, 0, 0], delta=1e-9)
        cloud = crosstie.read_cloud(os.path.join(self.folder.name, "points.ply"))
        self.assertTrue(np.array_equal(cloud["points"], network["points"]["xyz_mm"]))

    def test_a_network_without_scale_is_refused_by_name(self):
        seen = {}
        for path in sorted((self.job / "net").glob("*.png"))[:4]:
            image = crosstie.read_image(path)
            seen[path.stem] = ("hand", crosstie.detect(image, "ring10"))
        with self.assertRaises(crosstie.Error) as raised:
            crosstie.adjust(seen, {"hand": crosstie.Camera.nominal(image.shape[1], image.shape[0], 1.05 * image.shape[1])})
        self.assertIs(raised.exception.code, crosstie.ErrorCode.NO_UNIQUE_SOLUTION)
        self.assertIn("scale", str(raised.exception))

    def test_an_image_is_looked_at_where_it_lies(self):
        image = crosstie.read_image(sorted((self.job / "net").glob("*.png"))[0])
        wide = np.zeros((image.shape[0], image.shape[1] + 37), image.dtype)
        wide[:, 20 : 20 + image.shape[1]] = image
        for view in (wide[:, 20 : 20 + image.shape[1]], np.asfortranarray(image)):
            self.assertTrue(np.array_equal(crosstie.detect(view, "ring10"), crosstie.detect(image, "ring10")))
        only = crosstie.detect(image, "ring10", ids=[0])
        self.assertFalse((only["status"] == crosstie.Status.CODED).any() and (only["id"][only["status"] == crosstie.Status.CODED] != 0).any())
        self.assertTrue((only["status"] == crosstie.Status.REFUSED).any())
        with self.assertRaises(TypeError):
            crosstie.detect(image.astype(float), "ring10")


class Interrupt(unittest.TestCase):
    def test_ctrl_c_ends_a_call_and_others_run_meanwhile(self):
        noise = np.random.default_rng(1).integers(0, 256, (6000, 8000), np.uint8)
        begun = time.monotonic()
        turns = 0

        def interrupt():
            nonlocal turns
            while time.monotonic() < begun + 0.3:
                turns += 1
                time.sleep(0.001)
            os.kill(os.getpid(), signal.SIGINT)

        other = threading.Thread(target=interrupt)
        other.start()
        with self.assertRaises(KeyboardInterrupt):
            crosstie.detect(noise, "ring10")
        other.join()
        self.assertGreater(turns, 20)  # this thread had the interpreter while the call ran
