# SPDX-License-Identifier: GPL-3.0-or-later
"""Names of files, bodies named in any script, and what a refused run leaves."""

import os

import bpy
from matterfit.io import files, takes
from support import SceneCase, needs_library, select, tree


class NameTest(SceneCase):
    def test_names(self):
        """Letters of any script with their marks stay; what a file system may refuse does not."""
        for name, expected in (
                ("Cube.001", "Cube_001"), ("A b", "A_b"), ("a / b\\c:*?", "a_b_c"),
                ("..", None), ("_a__b_", "a__b"), ("-x-", "-x-"), ("球", "球"), ("箱 2", "箱_2"),
                ("Würfel", "Würfel"), ("Wu\u0308rfel", "Würfel"), ("कि", "कि"), ("का", "का")):
            with self.subTest(name):
                found = files.safe_name(name)
                if expected is None:
                    self.assertRegex(found, r"^unnamed_[0-9a-f]{8}$")
                else:
                    self.assertEqual(found, expected)

    def test_names_without_letters_differ(self):
        names = ["🔴", "🔵", "?", "!", "", "…"]
        self.assertEqual(len({files.safe_name(name) for name in names}), len(names))

    @needs_library
    def test_of_an_object_with_slashes(self):
        """Its row is named without them; a row that is renamed so is refused in the panel's words."""
        select(self.cube("left/upper\\arm"))
        bpy.ops.matterfit.add_body(role="BODY")
        body = self.settings.bodies[0]
        self.assertEqual(body.name, "left_upper_arm")
        self.assertEqual(bpy.ops.matterfit.write_job(), {"FINISHED"})
        body.name = "left/arm"
        self.fails(bpy.ops.matterfit.write_job, ["files are called after 'left/arm'", "Rename the row"])

    def test_two_bodies(self):
        """Names that had been one and the same file."""
        for name in ("球", "箱", "🔴"):
            self.body(self.cube(name, location=(len(self.settings.bodies), 0.0, 1.0)))
        document, folder = self.document()
        sources = [body["source"]["mesh"] for body in document["scene"]["bodies"]]
        self.assertEqual(sources[:2], ["input/body_球.npz", "input/body_箱.npz"])
        self.assertEqual(len(set(sources)), 3)
        for source in sources:
            self.assertTrue(os.path.isfile(os.path.join(folder, source)))
        entries = [entry["name"] for entry in document["output"]["mesh"]]
        self.assertEqual(entries, [files.safe_name(body.name) for body in self.settings.bodies])

    @needs_library
    def test_bake(self):
        """Its files are found again, attached and freed."""
        self.jelly(name="球", location=(0.0, 0.0, 0.3))
        self.assertEqual(bpy.ops.matterfit.bake(), {"FINISHED"}, self.error())
        take = self.settings.takes[0]
        tags = {item["matterfit"] for item in take.collection.objects}
        self.assertLessEqual({"mesh:球", "points:球", "volume:球"}, tags)
        folder = takes.locate(take).folder
        self.assertTrue(os.path.isfile(os.path.join(folder, "mesh", "球.pc2")))
        bpy.ops.matterfit.free()
        self.assertFalse(os.path.exists(folder))


class RefusedTest(SceneCase):
    """A collider that has no surface from frame 4 on: three frames of it were written by then."""

    def setUp(self):
        super().setUp()
        self.jelly(location=(0.0, 0.0, 2.0))
        item = self.cube("Wall")
        group = item.vertex_groups.new(name="all")
        group.add(range(8), 1.0, "REPLACE")
        mask = item.modifiers.new("Mask", "MASK")
        mask.vertex_group, mask.invert_vertex_group = group.name, True
        for frame, shown in ((1, False), (4, True)):
            mask.show_viewport = shown
            mask.keyframe_insert("show_viewport", frame=frame)
        self.body(item, "COLLIDER").collider_kind = "DEFORMING"

    @needs_library
    def test_the_first_bake(self):
        self.fails(bpy.ops.matterfit.bake, ["leaves no surface"])
        self.assertEqual(len(self.settings.takes), 0, "the row that was added for it goes")
        beside = os.path.dirname(bpy.data.filepath)
        self.assertEqual([name for name in os.listdir(beside) if name.startswith(takes.PREFIX)], [])
        self.assertFalse(bpy.ops.matterfit.free.poll())

    @needs_library
    def test_after_one_that_was_done(self):
        """What it has written stays, byte for byte."""
        self.scene.frame_end = 2
        self.assertEqual(bpy.ops.matterfit.bake(), {"FINISHED"}, self.error())
        folder = takes.locate(self.settings.takes[0]).folder
        before = tree(folder)
        self.scene.frame_end = 6
        self.fails(bpy.ops.matterfit.bake, ["leaves no surface"], onto="REPLACE")
        self.assertEqual(tree(folder), before)
