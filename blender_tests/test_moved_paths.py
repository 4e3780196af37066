# SPDX-License-Identifier: GPL-3.0-or-later
"""Save As to another folder: relative paths of ours name the same files as before."""

import os
import shutil

import bpy
from matterfit import handlers
from matterfit.io import files
from support import SceneCase


class MovedPathsTest(SceneCase):
    def setUp(self):
        super().setUp()
        self.row = self.body(self.cube())
        self.row.source, self.row.filepath = "POINTS", "//clips/body.npz"
        self.row.material.weights_file = "//clips/weights.safetensors"
        self.capture = self.settings.captures.add()
        self.capture.filepath, self.capture.images = "//clips/a.npz", "//clips/"
        self.capture.poses, self.capture.summary = "[]", "552 points"
        for name in ("body.npz", "weights.safetensors", "a.npz"):
            self.file("clips", name)
        self.save("scene.blend")

    def file(self, *path, content=b"1"):
        path = os.path.join(self.folder, *path)
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with open(path, "wb") as stream:
            stream.write(content)

    def check(self, folder):
        """All paths name the files in that folder, and nothing was forgotten of them."""
        self.settings = bpy.context.scene.matterfit
        row, capture = self.settings.bodies[0], self.settings.captures[0]
        for path, name in ((row.filepath, "body.npz"), (capture.filepath, "a.npz"),
                           (row.material.weights_file, "weights.safetensors"), (capture.images, "")):
            self.assertTrue(path.startswith("//"), path)
            self.assertEqual(files.absolute(path),
                             os.path.normpath(os.path.join(self.folder, folder, name)))
        self.assertEqual((capture.poses, capture.summary), ("[]", "552 points"))

    def test_save_as(self):
        """At once, and in the file that was written."""
        os.makedirs(os.path.join(self.folder, "versions", "second"))
        self.save("versions/second/scene.blend")
        self.check("clips")
        self.assertEqual(self.settings.captures[0].filepath, "//../../clips/a.npz")
        self.reopen("versions/second/scene.blend")
        self.check("clips")
        self.save("versions/second/again.blend")
        self.reopen("versions/second/again.blend")
        self.check("clips")

    def test_a_copy(self):
        """The open file stays where it is."""
        os.makedirs(os.path.join(self.folder, "copies"))
        path = os.path.join(self.folder, "copies", "scene.blend")
        bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
        self.assertEqual(self.settings.captures[0].filepath, "//clips/a.npz")
        self.reopen("copies/scene.blend")
        self.check("clips")

    def test_moved_along(self):
        """In a project that was copied whole the copies are used."""
        for name in ("scene.blend", "clips"):
            source, target = (os.path.join(self.folder, *way, name) for way in ((), ("moved",)))
            if name == "clips":
                shutil.copytree(source, target)
            else:
                os.makedirs(os.path.dirname(target))
                shutil.copy2(source, target)
        self.reopen("moved/scene.blend")
        self.check("moved/clips")
        self.assertEqual(self.settings.captures[0].filepath, "//clips/a.npz")

    def test_another_file_of_that_name(self):
        """It lies beside the new place: the path names the first one, at once and after opening again."""
        self.file("versions", "clips", "a.npz", content=b"another")
        self.file("versions", "clips", "b.npz")  # another list of images
        for name in ("body.npz", "weights.safetensors"):
            self.file("versions", "clips", name, content=b"2")
        self.save("versions/scene.blend")
        self.check("clips")
        self.reopen("versions/scene.blend")
        self.check("clips")

    def test_where_blender_says_the_target(self):
        """From 4.0 on: the file is written with paths that hold there; a copy, or a save that failed,
        leaves the open one as it was."""
        os.makedirs(os.path.join(self.folder, "versions"))
        handlers.stamp_version(os.path.join(self.folder, "versions", "scene.blend"), None)
        self.assertEqual(self.capture.filepath, "//../clips/a.npz")
        self.assertEqual(self.settings.saved_in, os.path.join(self.folder, "versions"))
        handlers.follow_paths()
        self.assertEqual((self.capture.filepath, self.capture.images), ("//clips/a.npz", "//clips/"))
        self.check("clips")
        handlers.stamp_version(bpy.data.filepath, None)
        handlers.stamp_version("", None)
        self.assertEqual(self.capture.filepath, "//clips/a.npz")

    def test_what_is_nowhere_stays(self):
        shutil.rmtree(os.path.join(self.folder, "clips"))
        os.makedirs(os.path.join(self.folder, "versions"))
        self.save("versions/scene.blend")
        self.assertEqual(self.settings.captures[0].filepath, "//clips/a.npz")
