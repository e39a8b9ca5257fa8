"""The types say what the module has: names, arguments, defaults that are there, numbers of the enumerations."""

import ast
import enum
import re
import unittest

import crosstie
import twin

STUB = ast.parse((twin.SOURCE / "python" / "crosstie" / "__init__.pyi").read_text())


def arguments_of(function):
    """Names in order, and which of them have a default, from the signature that pybind11 writes first."""
    text = re.match(r"\w+\((.*)\) -> ", function.__doc__.split("\n")[0]).group(1)
    names = re.findall(r"(?:^|, )(\w+): ", text)
    return names


class Types(unittest.TestCase):
    def test_name_what_there_is(self):
        names = {node.name for node in STUB.body if isinstance(node, (ast.FunctionDef, ast.ClassDef))}
        names |= {node.target.id for node in STUB.body if isinstance(node, ast.AnnAssign)}
        names -= {"Cloud", "Scan"}  # of the types alone
        self.assertEqual(names, set(crosstie.__all__))

    def test_have_the_arguments_of_the_functions(self):
        for node in STUB.body:
            if not isinstance(node, ast.FunctionDef):
                continue
            with self.subTest(node.name):
                stub = [argument.arg for argument in node.args.args + node.args.kwonlyargs]
                self.assertEqual(stub, arguments_of(getattr(crosstie, node.name)))

    def test_have_the_numbers_of_the_enumerations(self):
        for node in STUB.body:
            if not isinstance(node, ast.ClassDef) or [base.id for base in node.bases] != ["IntEnum"]:
                continue
            stub = {line.targets[0].id: line.value.value for line in node.body}
            self.assertEqual(stub, {one.name: int(one) for one in getattr(crosstie, node.name)})
            self.assertTrue(issubclass(getattr(crosstie, node.name), enum.IntEnum))

    def test_have_the_properties_of_camera(self):
        camera = next(node for node in STUB.body if isinstance(node, ast.ClassDef) and node.name == "Camera")
        for node in camera.body:
            self.assertTrue(hasattr(crosstie.Camera, node.name), node.name)

    def test_every_function_is_documented(self):
        for name in crosstie.__all__:
            thing = getattr(crosstie, name)
            if callable(thing):
                self.assertGreater(len(thing.__doc__.split("\n\n", 1)[-1]), 20, name)

    def test_the_version_is_the_programs(self):
        self.assertRegex(crosstie.version, r"^\d+\.\d+\.\d+$")
        self.assertIn(f"VERSION {crosstie.version}", (twin.SOURCE / "CMakeLists.txt").read_text())
