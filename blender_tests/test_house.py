# SPDX-License-Identifier: GPL-3.0-or-later
"""How the add-on is built: who may import whom, how long a file may be. docs/dev/tour.md says why."""

import ast
import os
import unittest

import matterfit
import support
from matterfit import quantities
from matterfit.props import reactions

PACKAGE = os.path.dirname(matterfit.__file__)
# From below to above; a room imports from itself and from those before it.
ROOMS = ("jobs", "compat", "i18n", "machine", "native", "library", "effects", "laws", "quantities", "names",
         "props", "io", "ops", "ui", "scene_job", "handlers", "__init__", "cli")
MOST_LINES = 300


def sources():
    """{'io.attach': path} of every module, packages by their own name."""
    found = {}
    for base, _folders, names in os.walk(PACKAGE):
        for name in names:
            if name.endswith(".py"):
                path = os.path.join(base, name)
                module = os.path.relpath(path, PACKAGE)[:-3].replace(os.sep, ".")
                if module != "__init__":
                    module = module.removesuffix(".__init__")
                found[module] = path
    return found


def imports(module, path, known):
    """Our modules that a module imports, wherever in it the import stands."""
    with open(path, encoding="utf-8") as stream:
        tree = ast.parse(stream.read(), path)
    package = module.split(".")
    if os.path.basename(path) != "__init__.py":
        package = package[:-1]
    elif module == "__init__":
        package = []
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.level:
            start = package[:len(package) - (node.level - 1)] + (node.module or "").split(".")
            base = ".".join(part for part in start if part)
            names = [f"{base}.{item.name}".strip(".") for item in node.names]
            found |= {name if name in known else base for name in names}
    return {name or "__init__" for name in found} - {module}


def circle(graph):
    """Modules that import each other in a ring, or [] where there is none."""
    done, path = set(), []

    def visit(module):
        if module in path:
            return [*path[path.index(module):], module]
        if module in done:
            return []
        path.append(module)
        for other in sorted(graph.get(module, ())):
            ring = visit(other)
            if ring:
                return ring
        path.pop()
        done.add(module)
        return []

    for module in sorted(graph):
        ring = visit(module)
        if ring:
            return ring
    return []


class ImportTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.sources = sources()
        cls.graph = {module: imports(module, path, cls.sources)
                     for module, path in cls.sources.items()}

    def test_the_walk_sees_imports(self):
        """A test that finds nothing proves nothing."""
        self.assertIn("io.cache", self.graph["io.takes"])
        self.assertIn("props.scene", self.graph["io.takes"])
        self.assertIn("props.reactions", self.graph["props.scene"])
        self.assertIn("ops.job_operator", self.graph["__init__"])
        self.assertEqual(circle({"a": {"b"}, "b": {"c"}, "c": {"b"}}), ["b", "c", "b"])

    def test_no_circle(self):
        # A package's own file collects its modules, which do not import it.
        self.assertEqual(circle(self.graph), [])

    def test_nothing_imports_upward(self):
        place = {room: index for index, room in enumerate(ROOMS)}
        for module, others in self.graph.items():
            room = module.split(".")[0]
            self.assertIn(room, place, f"{module}: its room is not in ROOMS")
            for other in others:
                self.assertIn(other, self.sources, f"{module} imports what is not there")
                above = place[other.split(".")[0]] > place[room]
                self.assertFalse(above, f"{module} imports {other}, which lies above it")

    def test_every_reaction_is_done_by_something(self):
        support.register_once()
        for name, item in vars(reactions).items():
            if isinstance(item, reactions.Reaction):
                self.assertIsNotNone(item._function, name)


class FileTest(unittest.TestCase):
    def test_lengths(self):
        for module, path in sources().items():
            if module.startswith("i18n."):
                continue  # a dictionary
            with open(path, encoding="utf-8") as stream:
                lines = len(stream.readlines())
            self.assertLess(lines, MOST_LINES, f"{module}: split it by subject")


class QuantityTest(unittest.TestCase):
    """The table agrees with the properties that are made from it, and with itself."""

    def test_every_material_parameter_is_a_property(self):
        from matterfit import laws
        from matterfit.props.body import MatterfitContact
        from matterfit.props.material import MatterfitMaterial, MatterfitMaxwell
        names = {name for each in laws.PARAMETERS.values() for name in each} | set(laws.DAMPING)
        groups = [(MatterfitMaterial, "material", names),
                  (MatterfitMaxwell, "material.maxwell", ("modulus", "time")),
                  (MatterfitContact, "contact", ("mu", "stiffness", "damping"))]
        for group, owner, keys in groups:
            for key in keys:
                row = quantities.find(f"{owner}.{key}")
                shown = group.bl_rna.properties[key]
                self.assertEqual(shown.name, row.label)
                self.assertEqual(shown.description, row.about)
                for ours, theirs in ((row.least, shown.hard_min), (row.most, shown.hard_max),
                                     (row.default, shown.default)):
                    self.assertAlmostEqual(ours, theirs, delta=1e-6 * max(abs(ours), 1e-6))

    def test_rows(self):
        for key, row in quantities._TABLE.items():
            self.assertEqual(row.key, key)
            self.assertLessEqual(row.least, row.soft[0], key)
            self.assertLessEqual(row.soft[1], row.most, key)
            self.assertTrue(row.about.strip(), key)
            if row.scale == quantities.LOG and row.low:
                self.assertGreater(row.low, 0.0, key)

    def test_branches(self):
        row = quantities.find("material.maxwell[1].time")
        self.assertEqual((row.key, row.label), ("material.maxwell[1].time", "2: Relaxation Time [s]"))
        self.assertEqual(quantities.branch_of("material.maxwell[3].modulus"), (3, "modulus"))
        self.assertIsNone(quantities.find("material.colour"))
        self.assertEqual(quantities.label_of("material.colour"), "material.colour")
