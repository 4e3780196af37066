# SPDX-License-Identifier: GPL-3.0-or-later
"""Registration, names, and what every property owes its reader."""

import importlib.util
import os
import shutil
import sys
import tempfile
import unittest
from unittest import mock

import bpy
import matterfit
import support
from matterfit import i18n, laws, native, ops, props, ui
from matterfit.io import material_check, presets


class RegisterTest(unittest.TestCase):
    def setUp(self):
        support.register_once()

    def test_off_and_on(self):
        """Everything that register() adds, unregister() removes."""
        handlers = {name: len(getattr(bpy.app.handlers, name))
                    for name in ("load_pre", "load_post", "save_pre", "frame_change_post")}
        matterfit.unregister()
        self.assertFalse(hasattr(bpy.types.Scene, "matterfit"))
        self.assertFalse(hasattr(bpy.types.WindowManager, "matterfit"))
        self.assertFalse(hasattr(bpy.types, "MATTERFIT_PT_status"))
        self.assertEqual(len(bpy.app.handlers.load_pre), handlers["load_pre"] - 1)
        matterfit.register()
        for name, count in handlers.items():
            self.assertEqual(len(getattr(bpy.app.handlers, name)), count, name)

    def test_names(self):
        for cls in ops.CLASSES:
            self.assertRegex(cls.__name__, r"^MATTERFIT_OT_[a-z]+(_[a-z]+)*$")
            self.assertEqual(cls.bl_idname, "matterfit." + cls.__name__[len("MATTERFIT_OT_"):])
            self.assertTrue(cls.bl_description, cls)
        for cls in ui.CLASSES:
            self.assertRegex(cls.__name__, r"^MATTERFIT_(PT|UL)_[a-z_]+$")

    def test_every_property_says_what_it_is(self):
        """Description, and hard and soft limits that Blender did not make up."""
        for cls in props.CLASSES:
            for found in cls.bl_rna.properties:
                if found.identifier in ("rna_type", "name") and not found.description:
                    continue
                where = f"{cls.__name__}.{found.identifier}"
                if found.type in ("POINTER", "COLLECTION"):
                    continue
                self.assertTrue(found.description, where)
                if found.type in ("FLOAT", "INT"):
                    self.assertGreater(found.hard_min, -2e9, where)
                    self.assertLess(found.hard_max, 1.1e15, where)
                    self.assertLessEqual(found.hard_min, found.soft_min, where)
                    self.assertLessEqual(found.soft_max, found.hard_max, where)

    def test_translations(self):
        """Each translation keeps the braces of the text it stands for."""
        for texts in i18n._LANGUAGES.values():
            for english, text in texts.items():
                self.assertEqual(english.count("{"), text.count("{"), english)
        self.assertIn(("*", "Bake"), i18n.dictionary()["de_DE"])

    def test_no_frame_handlers(self):
        for name in ("frame_change_pre", "frame_change_post", "depsgraph_update_post"):
            for function in getattr(bpy.app.handlers, name):
                self.assertNotIn("matterfit", function.__module__)

    def test_manifest_and_bl_info_agree(self):
        path = os.path.join(os.path.dirname(matterfit.__file__), "blender_manifest.toml")
        with open(path, encoding="utf-8") as stream:
            text = stream.read()
        version = ".".join(str(part) for part in matterfit.bl_info["version"])
        self.assertIn(f'version = "{version}"', text)
        self.assertIn("GPL-3.0-or-later", text)
        self.assertIn(f'platforms = ["{native.PLATFORM}"]', text)


class OtherSystemTest(unittest.TestCase):
    """Where Matterfit does not run it says so, not how to install it again."""

    def load(self, system, machine, path="/nowhere/libmatterfit.so"):
        with (mock.patch.dict(os.environ, MATTERFIT_LIBRARY=path),
              mock.patch.object(native, "_library", None),
              mock.patch.object(native, "_load_error", ""),
              mock.patch.object(sys, "platform", system),
              mock.patch.object(native.platform, "machine", return_value=machine),
              mock.patch.object(native.platform, "system", return_value=system.title())):
            self.assertFalse(native.load())
            return native.load_error()

    def test_the_supported_one_is_named(self):
        for system, machine in (("win32", "AMD64"), ("darwin", "arm64"), ("linux", "aarch64")):
            message = self.load(system, machine)
            self.assertIn("64-bit Linux", message)
            self.assertIn(machine, message)
            self.assertNotIn("make build", message)

    def test_on_the_supported_one(self):
        self.assertIn("/nowhere/libmatterfit.so", self.load("linux", "x86_64"))

    def test_a_file_that_is_no_library(self):
        self.assertIn("64-bit Linux", self.load("linux", "aarch64", __file__))
        message = self.load("linux", "x86_64", __file__)
        self.assertIn("could not be loaded", message)
        self.assertIn("Install the package again", message)


class CommandLineTest(unittest.TestCase):
    """cli.py finds the add-on that is enabled, from wherever it is called itself."""

    def setUp(self):
        support.register_once()
        os.makedirs(support.SCRATCH, exist_ok=True)
        folder = tempfile.mkdtemp(prefix="cli_", dir=support.SCRATCH)
        self.addCleanup(shutil.rmtree, folder, True)
        self.addCleanup(setattr, sys, "path", list(sys.path))
        copy = os.path.join(folder, "matterfit")
        os.makedirs(copy)
        shutil.copy(support.CLI, copy)
        shutil.copy(matterfit.__file__, copy)
        found = importlib.util.spec_from_file_location("copied_cli", os.path.join(copy, "cli.py"))
        self.cli = importlib.util.module_from_spec(found)
        found.loader.exec_module(self.cli)

    def test_enabled_from_elsewhere(self):
        self.assertIs(self.cli.package(), matterfit)

    def test_imported_but_disabled(self):
        matterfit.unregister()
        self.assertIs(self.cli.package(), matterfit)
        self.assertTrue(hasattr(bpy.types.Scene, "matterfit"))


class PresetTest(unittest.TestCase):
    NAMES = {"JELLY", "RUBBER", "PLASTICINE", "CLAY", "SAND", "SNOW_LIKE", "WATER", "HONEY",
             "CREAM", "TOOTHPASTE"}

    def setUp(self):
        support.register_once()

    def test_all_there_with_source(self):
        found = presets.materials()
        self.assertEqual(set(found), self.NAMES)
        numbers = [document["number"] for document in found.values()]
        self.assertEqual(len(set(numbers)), len(numbers), "a preset's number is used twice")
        for name, document in found.items():
            self.assertGreater(len(document["source"]), 20, name)
            self.assertIn("licence", document)

    def test_a_wrong_parameter_is_named(self):
        document = dict(presets.materials()["WATER"], material={"law": "newtonian", "E": 1.0})
        with self.assertRaisesRegex(matterfit.jobs.JobError, "water.json: 'E' is not a parameter"):
            material_check.check(document, "water.json")

    def test_apply(self):
        """Choosing a preset fills law, parameters, density; editing shows as a difference."""
        bpy.ops.wm.read_factory_settings(use_empty=True)
        body = bpy.context.scene.matterfit.bodies.add()
        body.name = "Body"
        for identifier, document in presets.materials().items():
            body.material.preset = identifier
            values = document["material"]
            self.assertEqual(body.material.law, values["law"].upper())
            for name in laws.PARAMETERS[body.material.law]:
                if name in values:
                    self.assertAlmostEqual(getattr(body.material, name) / (values[name] or 1.0),
                                           1.0 if values[name] else 0.0, places=5)
            self.assertAlmostEqual(body.density, document["density"], places=3)
            self.assertFalse(presets.differs(body.material), identifier)
        body.material.viscosity *= 2.0
        self.assertTrue(presets.differs(body.material))
        bpy.ops.matterfit.reset_material()
        self.assertFalse(presets.differs(body.material))
