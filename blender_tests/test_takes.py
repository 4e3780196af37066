# SPDX-License-Identifier: GPL-3.0-or-later
"""Takes keep their caches apart, through renames, Save As and moves; migration of older files."""

import os
import shutil
from unittest import mock

import bpy
from matterfit import handlers, native
from matterfit.io import files, lost, takes, visibility
from matterfit.jobs import JobError
from matterfit.props import migration
from matterfit.props.scene import SCHEMA_VERSION
from support import SceneCase, needs_library, run_cli


class FolderTest(SceneCase):
    def test_each_has_its_own(self):
        bpy.ops.matterfit.add_take()
        bpy.ops.matterfit.add_take()
        folders = [takes.claim(take) for take in self.settings.takes]
        self.assertEqual(len(set(folders)), 2)
        for take, folder in zip(self.settings.takes, folders, strict=True):
            self.assertRegex(take.folder, r"^//cache_matterfit_[0-9a-f]{8}/$")
            self.assertEqual(takes.claim(take), folder, "a second claim keeps the folder")
            self.assertEqual(os.path.dirname(folder), self.folder)
        self.assertNotEqual(self.settings.takes[0].name, self.settings.takes[1].name)

    def test_unsaved(self):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        with self.assertRaisesRegex(JobError, "not saved.*Save the file first"):
            takes.require_saved()
        settings = bpy.context.scene.matterfit
        take = takes.ensure_active(settings)
        with self.assertRaises(JobError):
            takes.claim(take)
        self.assertEqual(take.folder, "")

    def test_save_as_links(self):
        """The copy shows the original's cache and never writes into it."""
        take = takes.ensure_active(self.settings)
        first = takes.claim(take)
        os.makedirs(first)
        self.save("scene.blend")
        self.save("copy.blend")
        take = bpy.context.scene.matterfit.takes[0]
        location = takes.locate(take)
        self.assertTrue(location.linked)
        self.assertEqual(location.folder, first)
        second = takes.claim(take)
        self.assertNotEqual(second, first)
        self.assertFalse(takes.locate(take).linked)

    def test_save_as_elsewhere_links(self):
        take = takes.ensure_active(self.settings)
        first = takes.claim(take)
        os.makedirs(first)
        self.save("scene.blend")
        os.makedirs(os.path.join(self.folder, "other"))
        self.save(os.path.join("other", "copy.blend"))
        location = takes.locate(bpy.context.scene.matterfit.takes[0])
        self.assertTrue(location.linked)
        self.assertEqual(location.folder, first)

    def test_renamed_and_moved_projects_keep_their_cache(self):
        take = takes.ensure_active(self.settings)
        name = os.path.basename(takes.claim(take))
        os.makedirs(os.path.join(self.folder, name))
        self.save("scene.blend")
        moved = os.path.join(self.folder, "moved")
        os.makedirs(moved)
        shutil.move(os.path.join(self.folder, "scene.blend"), os.path.join(moved, "new.blend"))
        shutil.move(os.path.join(self.folder, name), moved)
        self.reopen(os.path.join("moved", "new.blend"))
        location = takes.locate(self.settings.takes[0])
        self.assertFalse(location.linked)
        self.assertEqual(location.folder, os.path.join(moved, name))
        self.assertTrue(location.exists)

    def test_a_copied_project_has_its_own(self):
        """The folder copied whole while the original stays: the copy uses its own cache."""
        take = takes.ensure_active(self.settings)
        name = os.path.basename(takes.claim(take))
        os.makedirs(os.path.join(self.folder, name))
        self.save("scene.blend")
        copy = os.path.join(self.folder, "copy")
        os.makedirs(os.path.join(copy, name))
        shutil.copy(os.path.join(self.folder, "scene.blend"), copy)
        self.reopen(os.path.join("copy", "scene.blend"))
        location = takes.locate(self.settings.takes[0])
        self.assertEqual((location.folder, location.linked), (os.path.join(copy, name), False))

    def test_switching_shows_one(self):
        for index in range(2):
            bpy.ops.matterfit.add_take()
            collection = bpy.data.collections.new(f"C{index}")
            self.scene.collection.children.link(collection)
            self.settings.takes[index].collection = collection
            self.settings.takes[index].frames_done = 1
        self.settings.take_index = 0
        self.assertEqual([take.collection.hide_render for take in self.settings.takes],
                         [False, True])
        self.settings.take_index = 1
        self.assertEqual([take.collection.hide_viewport for take in self.settings.takes],
                         [True, False])

    @needs_library
    def test_a_cache_that_was_deleted(self):
        """The take shows nothing, so that the artist's own object does, until it is there again."""
        self.jelly(separation=0.05)
        bpy.ops.matterfit.bake()
        bpy.ops.wm.save_mainfile()
        take = self.settings.takes[0]
        folder, away = takes.locate(take).folder, os.path.join(self.folder, "away")
        for gone in (True, False):
            shutil.move(*((folder, away) if gone else (away, folder)))
            self.reopen()
            take, item = self.settings.takes[0], bpy.data.objects["Cube"]
            self.assertEqual(take.frames_done == 0, gone)
            self.assertEqual((take.collection.hide_viewport, take.collection.hide_render), (gone, gone))
            self.assertEqual((item.hide_viewport, item.hide_render), (not gone, not gone))
            bpy.ops.wm.save_mainfile()

    def test_copied_take_has_settings_but_no_cache(self):
        body = self.body(self.cube())
        body.velocity = (1, 2, 3)
        bpy.ops.matterfit.add_take()
        bpy.ops.matterfit.add_throw()
        self.settings.takes[0].throws[0].spin = (4, 5, 6)
        takes.claim(self.settings.takes[0])
        bpy.ops.matterfit.add_take()
        take = self.settings.takes[1]
        self.assertEqual(tuple(take.throws[0].velocity), (1, 2, 3))
        self.assertEqual(tuple(take.throws[0].spin), (4, 5, 6))
        self.assertEqual(take.folder, "")

    def test_remove(self):
        bpy.ops.matterfit.add_take()
        take = self.settings.takes[0]
        folder = takes.claim(take)
        os.makedirs(folder)
        bpy.ops.matterfit.remove_take()
        self.assertEqual(len(self.settings.takes), 0)
        self.assertFalse(os.path.exists(folder))

    def test_what_a_take_only_shows_stays(self):
        """Compare and Write Job would put a new cache in its place."""
        self.body(self.cube())
        capture = self.settings.captures.add()
        capture.source, capture.object = "OBJECT", bpy.data.objects["Cube"]
        take = takes.ensure_active(self.settings)
        os.makedirs(takes.claim(take))
        folder, take.frames_done = take.folder, 6
        bpy.ops.wm.save_mainfile()
        with mock.patch.object(native, "require"):
            self.save("copy.blend")
            self.settings = bpy.context.scene.matterfit
            for operator in (bpy.ops.matterfit.compare, bpy.ops.matterfit.write_job):
                self.fails(operator, ["belongs to another .blend file", "Press Bake"])
            self.reopen()
            self.settings.takes[0].frames_done = 6
            bpy.ops.scene.new(type="FULL_COPY")
            self.settings = bpy.context.scene.matterfit
            for operator in (bpy.ops.matterfit.compare, bpy.ops.matterfit.write_job):
                self.fails(operator, ["of the scene that was copied", "Press Bake"])
            self.reopen()
            self.settings.takes[0].folder = folder + "velocity.2=-1/"
            for operator in (bpy.ops.matterfit.compare, bpy.ops.matterfit.write_job):
                self.fails(operator, ["one of a batch", "another take"])
        self.assertEqual(self.settings.takes[0].folder, folder + "velocity.2=-1/")

    @needs_library
    def test_undo_of_what_deleted_files(self):
        """Blender brings back the take and its objects, and no file: what is gone is not played."""
        self.jelly(separation=0.05)
        self.settings.output.points = self.settings.output.surface = True
        bpy.ops.matterfit.bake()
        take = self.settings.takes[0]
        folder, item = takes.locate(take).folder, bpy.data.objects["Cube"]
        self.assertTrue(item.hide_render)
        # Not what is there; undo of a bake leaves what it has attached unknown, and that stays so.
        lost.forget(self.scene)
        tags = {each["matterfit"] for each in take.collection.objects}
        self.assertLessEqual({"points:Cube", "mesh:Cube"}, tags)
        self.assertTrue(take.baked)
        take.baked, take.frames_done = False, 0
        handlers.look_after_undo()
        self.assertFalse(take.baked)
        take.baked, take.frames_done = True, 6
        # One kind of files.
        shutil.rmtree(os.path.join(folder, "points"))
        handlers.look_after_undo()
        self.assertEqual({each["matterfit"] for each in take.collection.objects}, tags - {"points:Cube"})
        self.assertTrue(take.baked)
        # All of them; what is not ours keeps the folder.
        shutil.rmtree(folder)
        files.write_bytes(os.path.join(folder, "notes.txt"), b"mine")
        take.compared, self.settings.compare.done, self.settings.fit.done = True, True, True
        self.settings.batch.results.add()
        handlers.look_after_undo()
        take = self.settings.takes[0]
        self.assertEqual((take.baked, take.frames_done, take.compared), (False, 0, False))
        self.assertFalse(self.settings.compare.done or self.settings.fit.done)
        self.assertEqual(len(self.settings.batch.results), 0)
        self.assertIsNone(take.collection)
        self.assertEqual([each.name for each in self.scene.objects if each.get("matterfit")], [])
        self.assertFalse(item.hide_render or item.hide_viewport)
        for name in ("undo_post", "redo_post"):
            self.assertIn(handlers.look_after_undo, getattr(bpy.app.handlers, name))

    def test_throwing_twice_is_refused(self):
        self.body(self.cube())
        bpy.ops.matterfit.add_throw()
        self.fails(bpy.ops.matterfit.add_throw, ["already thrown"])


class CommandLineTest(SceneCase):
    def test_take_by_its_name(self):
        """cli.py --take: the document is of that take, whichever is active in the file."""
        from matterfit import scene_job
        self.jelly()
        bpy.ops.matterfit.add_take()
        bpy.ops.matterfit.add_take()
        bpy.ops.matterfit.add_throw()
        self.settings.takes[1].throws[0].velocity = (3.0, 0.0, 0.0)
        self.settings.take_index = 0
        scene_job.choose_take("Take 2")
        path = scene_job.question(self.folder)
        self.assertEqual(files.read_json(path)["scene"]["bodies"][0]["velocity"], [3, 0, 0])
        with self.assertRaisesRegex(JobError, "--take Night.*'Take 1', 'Take 2'"):
            scene_job.choose_take("Night")

    def test_what_is_not_understood(self):
        """A take beside a document, a take without a name, threads that are no number."""
        document = os.path.join(self.folder, "job.json")
        for arguments, words in ((("validate", document, "--take", "Take 1"), "--take Take 1: takes are of the open"),
                                 (("validate", "--take", ""), "--take : the scene has no such take"),
                                 (("validate", document, "--threads", "two"), "'two' is not a whole number")):
            done = run_cli(*arguments)
            self.assertEqual(done.returncode, 2, arguments)
            self.assertIn(words, done.stderr)
            self.assertNotIn("Traceback", done.stderr)


class MigrationTest(SceneCase):
    def test_a_new_scene_has_the_present_version(self):
        self.body(self.cube())
        self.save("scene.blend")
        self.reopen()
        self.assertEqual(self.settings.schema_version, SCHEMA_VERSION)

    def test_version_1(self):
        """Its takes knew no owner: the cache beside the file becomes this file's."""
        take = takes.ensure_active(self.settings)
        folder = takes.claim(take)
        os.makedirs(folder)
        take.owner = ""
        self.settings.schema_version = 1
        self.save("scene.blend")
        self.reopen()
        self.assertEqual(self.settings.schema_version, SCHEMA_VERSION)
        take = self.settings.takes[0]
        self.assertEqual(take.owner, os.path.join(self.folder, "scene.blend"))
        self.assertFalse(takes.locate(take).linked)

    def test_a_newer_file_is_said(self):
        self.body(self.cube())
        self.settings.schema_version = SCHEMA_VERSION + 1
        self.save("scene.blend")
        self.reopen()
        self.assertIn("newer Matterfit", self.error())
        self.assertIn("update the add-on", self.error())
        self.assertEqual(self.settings.schema_version, SCHEMA_VERSION + 1)

    def test_every_version_has_a_step(self):
        self.assertEqual(sorted(migration.STEPS), list(range(1, SCHEMA_VERSION)))

    def test_settings_survive(self):
        """What is set is there again after saving and opening."""
        body = self.body(self.cube())
        body.material.preset = "SAND"
        body.material.friction_angle = 33.0
        body.pins.add().name = "Hold"
        self.settings.solver.particle_separation = 0.015
        self.save("scene.blend")
        self.reopen()
        body = self.settings.bodies[0]
        self.assertEqual(body.material.preset, "SAND")
        self.assertAlmostEqual(body.material.friction_angle, 33.0, places=4)
        self.assertEqual(body.pins[0].name, "Hold")
        self.assertEqual(body.object.name, "Cube")
        self.assertAlmostEqual(self.settings.solver.particle_separation, 0.015)
        self.assertEqual(self.settings.solver.quality, "CUSTOM")

    def test_hidden_original_comes_back(self):
        item = self.cube()
        visibility.hide_original(item)
        visibility.hide_original(item)
        self.assertTrue(item.hide_render and item.hide_viewport)
        visibility.show_original(item)
        self.assertFalse(item.hide_render or item.hide_viewport)
