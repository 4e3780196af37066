# SPDX-License-Identifier: GPL-3.0-or-later
"""Render Take: the simulation's pictures behind the camera's view."""

import math
import os

import bpy
import numpy
from matterfit import jobs
from matterfit.io import batch, blender_cameras, files, job_render, lost, takes
from matterfit.ops import launch, preview_extended
from support import needs_library, run_cli, tree
from test_images import HEIGHT, WIDTH, ImagesCase


class RenderTakeTest(ImagesCase):
    def setUp(self):
        super().setUp()
        self.jelly()
        self.scene.frame_start, self.scene.frame_end = 1, 4
        self.scene.camera = self.camera()

    @needs_library
    def test_pictures_behind_the_camera(self):
        self.assertEqual(bpy.ops.matterfit.render_take(), {"FINISHED"})
        photographs, drawn = blender_cameras.backgrounds(self.scene.camera)
        self.assertEqual((photographs, len(drawn)), ([], 1))
        user, image = drawn[0].image_user, drawn[0].image
        self.assertEqual((image.source, user.frame_start, user.frame_duration), ("SEQUENCE", 1, 4))
        path = files.absolute(image.filepath)
        self.assertEqual(os.path.basename(path), "0001.png")
        self.assertEqual(len(os.listdir(os.path.dirname(path))), 4)
        seen = [self.height(os.path.join(os.path.dirname(path), f"{frame:04d}.png")) for frame in (1, 4)]
        self.assertLess(seen[1], seen[0], "it falls")
        # Again after a bake, and in place of the first.
        bpy.ops.matterfit.bake(onto="REPLACE")
        self.assertEqual(bpy.ops.matterfit.render_take(), {"FINISHED"})
        self.assertEqual(len(blender_cameras.backgrounds(self.scene.camera)[1]), 1)

    def second(self, name="Side", location=(2.0, 0.0, 0.5)):
        """Another camera, which is the scene's now."""
        camera = self.camera(location=location, rotation=(math.pi / 2, 0.0, math.pi / 2))
        camera.name = name
        bpy.context.view_layer.update()
        return camera

    def pictures(self, camera):
        """(folder, contents) of what is drawn behind the view."""
        found = blender_cameras.backgrounds(camera)[1]
        self.assertEqual(len(found), 1, camera.name)
        path = files.absolute(found[0].image.filepath)
        return os.path.basename(os.path.dirname(path)), tree(os.path.dirname(path))

    @needs_library
    def test_two_cameras_of_one_take(self):
        """Each has its own pictures, also where the take is simulated anew, and Free removes all."""
        first = self.scene.camera
        self.settings.bodies[0].object.scale = (1.0, 1.0, 2.0)
        self.settings.bodies[0].object.rotation_euler = (0.0, 0.5, 0.0)
        bpy.ops.matterfit.render_take()
        before = self.pictures(first)
        second = self.second()
        self.assertEqual(bpy.ops.matterfit.render_take(), {"FINISHED"}, self.error())
        self.assertEqual(self.pictures(first), before)
        folder, seen = self.pictures(second)
        self.assertEqual((before[0], folder), ("camera_0", "camera_1"))
        self.assertNotEqual(seen, before[1])
        # The first again: the numbers stay.
        self.scene.camera = first
        self.assertEqual(bpy.ops.matterfit.render_take(), {"FINISHED"}, self.error())
        self.assertEqual((self.pictures(first), self.pictures(second)), (before, (folder, seen)))
        # Another motion: what the second shows is of it too.
        self.settings.bodies[0].velocity = (0.0, 0.0, 3.0)
        bpy.ops.matterfit.bake(onto="REPLACE")
        self.assertEqual(self.images(), [])
        self.assertEqual(bpy.ops.matterfit.render_take(), {"FINISHED"}, self.error())
        self.scene.camera = second
        self.assertEqual(bpy.ops.matterfit.render_take(), {"FINISHED"}, self.error())
        self.assertEqual([self.pictures(camera)[0] for camera in (first, second)], ["camera_0", "camera_1"])
        self.assertNotEqual(self.pictures(second)[1], seen)
        folder = takes.locate(self.settings.takes[0]).folder
        self.assertEqual(bpy.ops.matterfit.free(), {"FINISHED"}, self.error())
        self.assertEqual((self.images(), os.path.isdir(folder)), ([], False))

    @needs_library
    def test_a_take_simulated_anew_by_what_draws_it(self):
        """Render Take through the second camera after a change draws the first's anew."""
        first = self.scene.camera
        bpy.ops.matterfit.render_take()
        before = self.pictures(first)[1]
        self.settings.bodies[0].velocity = (0.0, 0.0, 3.0)
        second = self.second()
        self.assertEqual(bpy.ops.matterfit.render_take(), {"FINISHED"}, self.error())
        self.assertNotEqual(self.pictures(first)[1], before)
        self.assertEqual(self.pictures(second)[0], "camera_1")

    @needs_library
    def test_a_copy_of_a_camera(self):
        """It begins with the pictures of the first, at whose place it stands, or with its lens."""
        first = self.scene.camera
        bpy.ops.matterfit.render_take()
        copy = first.copy()
        copy.data = first.data.copy()
        self.scene.collection.objects.link(copy)
        self.scene.camera = copy
        bpy.context.view_layer.update()
        self.assertEqual(bpy.ops.matterfit.render_take(), {"FINISHED"}, self.error())
        self.assertEqual(self.pictures(first), self.pictures(copy))
        copy.location.z += 0.3
        bpy.context.view_layer.update()
        self.assertEqual(bpy.ops.matterfit.render_take(), {"FINISHED"}, self.error())
        self.assertEqual([self.pictures(camera)[0] for camera in (first, copy)], ["camera_0", "camera_1"])
        self.assertNotEqual(self.pictures(first)[1], self.pictures(copy)[1])

    @needs_library
    def test_a_camera_that_moves_by_now(self):
        """Its pictures are not left to show another camera's."""
        first = self.scene.camera
        bpy.ops.matterfit.render_take()
        first.keyframe_insert("location", frame=1)
        first.location.x += 1.0
        first.keyframe_insert("location", frame=4)
        second = self.second()
        self.assertEqual(bpy.ops.matterfit.render_take(), {"FINISHED"}, self.error())
        self.assertEqual(blender_cameras.backgrounds(first)[1], [])
        self.assertEqual(self.pictures(second)[0], "camera_0")

    @needs_library
    def test_what_is_refused_leaves_no_folder(self):
        path = os.path.join(self.folder, "cut.ply")
        with open(path, "wb") as file:
            file.write(b"ply\nformat binary_little_endian 1.0\nelement vertex 9\n")
        row = self.settings.bodies.add()
        row.name, row.source, row.filepath = "Cut", "GAUSSIANS", path
        self.settings.takes.add().name = "Take"
        with self.assertRaises(RuntimeError):
            bpy.ops.matterfit.render_take()
        self.assertIn("cut.ply", self.error())
        self.assertEqual(self.settings.takes[0].folder, "")
        self.assertEqual([name for name in os.listdir(self.folder) if name.startswith("cache_")], [])
        # What a take holds from before stays.
        row.enabled = False
        self.assertEqual(bpy.ops.matterfit.render_take(), {"FINISHED"}, self.error())
        before = self.pictures(self.scene.camera)
        row.enabled = True
        with self.assertRaises(RuntimeError):
            bpy.ops.matterfit.render_take()
        self.assertEqual(self.pictures(self.scene.camera), before)

    def height(self, path):
        """Of what is seen, in rows from below."""
        image = bpy.data.images.load(path)
        self.assertEqual(tuple(image.size), (WIDTH, HEIGHT))
        alpha = numpy.array(image.pixels[:]).reshape(HEIGHT, WIDTH, 4)[:, :, 3]
        rows = numpy.arange(HEIGHT) @ alpha.sum(axis=1)
        self.assertGreater(alpha.sum(), 10.0)
        return rows / alpha.sum()

    def rendered(self):
        """The camera's only background, drawn of a take that was baked before."""
        bpy.ops.matterfit.bake(onto="REPLACE")
        self.assertEqual(bpy.ops.matterfit.render_take(), {"FINISHED"}, self.error())
        return self.drawn()[0]

    def drawn(self):
        return blender_cameras.backgrounds(self.scene.camera)[1]

    def photograph(self):
        """One behind the camera's view, which stays as it is."""
        image = bpy.data.images.new("photograph", WIDTH, HEIGHT)
        blender_cameras.set_background(self.scene.camera, image)
        return image

    @needs_library
    def test_a_bake_in_place_of_what_was_drawn(self):
        """The pictures of what a take held before are gone, and nothing points at them."""
        photograph = self.photograph()
        path = files.absolute(self.rendered().image.filepath)
        # The same states: the pictures are of these.
        bpy.ops.matterfit.bake(onto="REPLACE")
        self.assertTrue(os.path.isfile(path))
        self.assertEqual(len(self.drawn()), 1)
        copy = self.scene.camera.copy()
        copy.data = copy.data.copy()
        self.settings.bodies[0].velocity = (1.0, 0.0, 0.0)
        bpy.ops.matterfit.bake(onto="REPLACE")
        self.assertFalse(os.path.isfile(path))
        for camera in (self.scene.camera, copy):
            self.assertEqual([shown.image for shown in camera.data.background_images], [photograph])
        self.assertEqual(self.images(), [])
        self.assertIn("Render Take draws new ones", bpy.context.window_manager.matterfit.last_report)
        self.assertEqual(self.rendered().image.source, "SEQUENCE")
        self.assertNotIn("Render Take", bpy.context.window_manager.matterfit.last_report)

    def images(self):
        return [image for image in bpy.data.images if image.get(blender_cameras.DRAWN)]

    @needs_library
    def test_an_image_that_something_else_uses(self):
        image = self.rendered().image
        material = bpy.data.materials.new("screen")
        material.use_nodes = True
        material.node_tree.nodes.new("ShaderNodeTexImage").image = image
        self.settings.bodies[0].velocity = (1.0, 0.0, 0.0)
        bpy.ops.matterfit.bake(onto="REPLACE")
        self.assertEqual((self.drawn(), self.images(), image.users), ([], [image], 1))

    @needs_library
    def test_a_bake_into_a_new_take(self):
        """The pictures of the first stay, and are shown with it."""
        self.rendered()
        self.settings.bodies[0].velocity = (1.0, 0.0, 0.0)
        bpy.ops.matterfit.bake(onto="NEW")
        self.assertEqual(len(self.settings.takes), 2)
        self.assertEqual(self.drawn(), [])
        self.settings.take_index = 0
        self.assertEqual(len(self.drawn()), 1)

    def seen(self, camera):
        """The takes, from 0, whose pictures are seen in a view, and 'photograph' for another."""
        folders = [takes.locate(take).folder + os.sep for take in self.settings.takes]
        found = []
        for shown in camera.data.background_images:
            if shown.show_background_image:
                path = files.absolute(shown.image.filepath)
                found.append(next((index for index, folder in enumerate(folders) if path.startswith(folder)),
                                  shown.image.name))
        return found

    def two_takes(self):
        """Take 0 drawn through two cameras, which are returned, take 1 through the second alone."""
        first = self.scene.camera
        self.photograph()
        bpy.ops.matterfit.render_take()
        second = self.second()
        self.assertEqual(bpy.ops.matterfit.render_take(), {"FINISHED"}, self.error())
        bpy.ops.matterfit.add_take()
        self.settings.bodies[0].velocity = (0.0, 0.0, 3.0)
        self.assertEqual((self.seen(first), self.seen(second)), (["photograph"], []))
        self.assertEqual(bpy.ops.matterfit.render_take(), {"FINISHED"}, self.error())
        return first, second

    @needs_library
    def test_views_follow_the_active_take(self):
        first, second = self.two_takes()
        for index, wanted in ((1, (["photograph"], [1])), (0, (["photograph", 0], [0])),
                              (1, (["photograph"], [1])), (0, (["photograph", 0], [0]))):
            self.settings.take_index = index
            self.assertEqual((self.seen(first), self.seen(second)), wanted)
        # As they are saved.
        bpy.ops.wm.save_mainfile()
        self.reopen()
        first, second = (self.scene.objects[camera] for camera in ("Camera", "Side"))
        self.settings.take_index = 1
        self.assertEqual((self.seen(first), self.seen(second)), (["photograph"], [1]))
        # The one that is left is seen.
        self.assertEqual(bpy.ops.matterfit.remove_take(), {"FINISHED"}, self.error())
        self.assertEqual((self.seen(first), self.seen(second)), (["photograph", 0], [0]))
        self.assertEqual(len(second.data.background_images), 1)

    @needs_library
    def test_a_photograph_stays_in_front_of_another_take(self):
        """What Photograph or Splats has chosen holds for all takes, also past one without pictures."""
        first, _second = self.two_takes()
        self.scene.camera = first
        self.assertFalse(bpy.ops.matterfit.flip_photograph.poll())
        self.settings.take_index = 0
        bpy.ops.matterfit.flip_photograph()
        for index in (0, 1, 0):
            self.settings.take_index = index
            self.assertEqual(self.seen(first), ["photograph"])
        bpy.ops.matterfit.flip_photograph()
        self.assertEqual(self.seen(first), [0])

    @needs_library
    def test_two_cameras_that_show_the_same_pictures(self):
        """What is chosen in one's view is not chosen in the other's."""
        first = self.scene.camera
        self.photograph()
        copy = first.copy()
        copy.data = first.data.copy()
        copy.name = "Copy"
        self.scene.collection.objects.link(copy)
        bpy.ops.matterfit.render_take()
        self.scene.camera = copy
        self.assertEqual(bpy.ops.matterfit.render_take(), {"FINISHED"}, self.error())
        self.assertEqual([self.pictures(camera)[0] for camera in (first, copy)], ["camera_0", "camera_0"])
        bpy.ops.matterfit.add_take()
        for flipped, other in ((first, copy), (copy, first)):
            self.settings.take_index, self.scene.camera = 0, flipped
            bpy.ops.matterfit.flip_photograph()
            self.settings.take_index = 1
            self.settings.take_index = 0
            self.assertEqual((self.seen(flipped), self.seen(other)), (["photograph"], ["photograph", 0]))
            for shown in flipped.data.background_images:
                shown.show_background_image = True

    def drawn_again(self, index):
        """What job_render.show() takes of the take that was drawn last, which has that index."""
        folder = takes.locate(self.settings.takes[index]).folder
        return (self.scene, folder, launch.written_document(folder)["render"], jobs.registry.current.result)

    @needs_library
    def test_another_take_is_drawn_while_a_photograph_is_chosen(self):
        first, second = self.two_takes()
        self.photograph()  # of the second
        drawn = self.drawn_again(1)
        self.settings.take_index = 0
        bpy.ops.matterfit.flip_photograph()
        chosen = self.seen(second)
        self.assertEqual(len(chosen), 1)
        job_render.show(*drawn)
        self.assertEqual((self.seen(first), self.seen(second)), (["photograph", 0], chosen))
        self.settings.take_index = 1
        self.assertEqual(self.seen(second), chosen)
        # Who draws the active one wants to see it.
        job_render.show(*drawn)
        self.assertEqual(self.seen(second), [1, *chosen])

    @needs_library
    def test_pictures_that_cannot_be_loaded(self):
        """The active take's are shown still."""
        first, second = self.two_takes()
        scene, folder, render, result = self.drawn_again(1)
        self.settings.take_index = 0
        before = self.seen(first), self.seen(second)
        gone = [path.replace("0001", "9001") for path in result["render"]["files"]]
        with self.assertRaises(RuntimeError):
            job_render.show(scene, folder, render, {**result, "render": {**result["render"], "files": gone[:1]}})
        self.assertEqual((self.seen(first), self.seen(second)), before)

    def only_the_first(self, first, second, image):
        """Its take is left, and that image, of the second's, is behind no view."""
        self.assertEqual(len(self.settings.takes), 1)
        self.assertNotIn(image, [shown.image for shown in second.data.background_images])
        self.assertEqual((self.seen(first), self.seen(second)), (["photograph", 0], [0]))

    @needs_library
    def test_a_preview_that_makes_room(self):
        first, second = self.two_takes()
        image = self.pictures_seen(second)
        preview_extended.MATTERFIT_OT_preview_extended._remove(self.settings, 1)
        self.only_the_first(first, second, image)

    @needs_library
    def test_a_batch_that_is_freed(self):
        first, second = self.two_takes()
        image = self.pictures_seen(second)
        self.settings.batch.run.folder = "//cache_matterfit_batch/"
        self.settings.takes[1].folder = "//cache_matterfit_batch/velocity.2=-1/"
        image.filepath = "//cache_matterfit_batch/velocity.2=-1/render/camera_0/0001.png"
        batch.free(self.scene)
        self.only_the_first(first, second, image)

    def pictures_seen(self, camera):
        return next(shown.image for shown in camera.data.background_images if shown.show_background_image)

    @needs_library
    def test_a_linked_take_that_is_baked(self):
        """Its pictures are of what it was linked to: they go when it gets a folder of its own, and are there
        again where nothing comes of the bake."""
        first, second = self.two_takes()
        self.save("other.blend")
        self.settings.take_index = 0
        take = self.settings.takes[0]
        self.assertTrue(takes.locate(take).linked)
        path = os.path.join(self.folder, "cut.ply")
        with open(path, "wb") as file:
            file.write(b"ply\nformat binary_little_endian 1.0\nelement vertex 9\n")
        row = self.settings.bodies.add()
        row.name, row.source, row.filepath = "Cut", "GAUSSIANS", path
        folder, before = take.folder, self.sequences(first, second)
        self.fails(bpy.ops.matterfit.bake, ["cut.ply"])
        self.assertEqual((self.settings.takes[0].folder, self.sequences(first, second)), (folder, before))
        self.assertEqual((self.seen(first), self.seen(second)), (["photograph", 0], [0]))
        row.enabled = False
        self.assertEqual(bpy.ops.matterfit.bake(), {"FINISHED"}, self.error())
        self.assertNotEqual(self.settings.takes[0].folder, folder)
        self.assertEqual((self.seen(first), self.seen(second)), (["photograph"], []))
        self.assertEqual((len(first.data.background_images), len(second.data.background_images)), (1, 1))
        self.settings.take_index = 1
        self.assertEqual((self.seen(first), self.seen(second)), (["photograph"], [1]))

    def sequences(self, *cameras):
        """What is shown of each camera's sequences, in no order."""
        return [sorted((shown.image.filepath, shown.display_depth, shown.show_background_image, shown.alpha,
                        shown.frame_method, shown.image_user.frame_start, shown.image_user.frame_offset,
                        shown.image_user.frame_duration) for shown in camera.data.background_images
                       if shown.image.source == "SEQUENCE") for camera in cameras]

    @needs_library
    def test_a_take_that_is_drawn_while_another_is_active(self):
        """Its pictures are kept for it, and take the place of none of the other's."""
        first, second = self.two_takes()
        self.settings.take_index = 0
        take = self.settings.takes[1]
        folder, result = takes.locate(take).folder, jobs.registry.current.result
        for data in (first.data, second.data):
            for shown in list(data.background_images):
                if shown.image.get(blender_cameras.AWAY):
                    blender_cameras.remove_background(data, shown.image)
        job_render.show(self.scene, folder, launch.written_document(folder)["render"], result)
        self.assertEqual((self.seen(first), self.seen(second)), (["photograph", 0], [0]))
        self.settings.take_index = 1
        self.assertEqual((self.seen(first), self.seen(second)), (["photograph"], [1]))

    @needs_library
    def test_a_linked_take_that_is_removed(self):
        """Its files are another's and stay; its pictures are seen no more."""
        first, second = self.two_takes()
        self.save("other.blend")
        self.settings.take_index = 0
        folder = takes.locate(self.settings.takes[0]).folder
        self.assertTrue(takes.locate(self.settings.takes[0]).linked)
        self.assertEqual(bpy.ops.matterfit.remove_take(), {"FINISHED"}, self.error())
        self.assertEqual((self.seen(first), self.seen(second)), (["photograph"], [0]))
        self.assertEqual(len(second.data.background_images), 1)
        self.assertTrue(os.path.isdir(os.path.join(folder, "render")))

    @needs_library
    def test_pictures_that_go_with_the_cache(self):
        for end in ("free", "remove_take"):
            with self.subTest(end):
                self.rendered()
                self.assertEqual(getattr(bpy.ops.matterfit, end)(), {"FINISHED"}, self.error())
                self.assertEqual((self.drawn(), self.images()), ([], []))
        # Undo brings back what is shown, and no file.
        path = files.absolute(self.rendered().image.filepath)
        os.remove(path)
        lost.forget(self.scene)
        self.assertEqual((self.drawn(), self.images()), ([], []))

    @needs_library
    def test_compared_after_a_change(self):
        """A take that only Render Take has simulated is simulated anew."""
        self.assertEqual(bpy.ops.matterfit.render_take(), {"FINISHED"})
        camera = self.scene.camera
        bpy.ops.matterfit.import_images(filepath=self.clip(), cameras=False)
        self.scene.camera = camera
        self.assertEqual(bpy.ops.matterfit.compare(), {"FINISHED"}, self.error())
        self.assertEqual(len(self.drawn()), 1)
        self.settings.bodies[0].velocity = (1.0, 0.0, 0.0)
        self.assertEqual(bpy.ops.matterfit.compare(), {"FINISHED"}, self.error())
        self.assertEqual((self.drawn(), self.images()), ([], []))

    @needs_library
    def test_without_a_window(self):
        """What is saved shows the artist's object still, and the pictures behind the camera."""
        if not bpy.app.binary_path:
            self.skipTest("a bpy wheel opens no .blend from the command line")
        bpy.ops.wm.save_mainfile()
        path = bpy.data.filepath
        done = run_cli("render", "--save", "--quiet", blend=path)
        self.assertEqual(done.returncode, 0, done.stderr)
        bpy.ops.wm.open_mainfile(filepath=path)
        scene = bpy.context.scene
        self.assertFalse(scene.objects["Cube"].hide_render)
        self.assertFalse(scene.matterfit.takes[0].baked)
        self.assertEqual(len(blender_cameras.backgrounds(scene.camera)[1]), 1)

    @needs_library
    def test_a_camera_that_moves_is_refused(self):
        self.scene.camera.keyframe_insert("location", frame=1)
        self.scene.camera.location.x += 1.0
        self.scene.camera.keyframe_insert("location", frame=4)
        self.fails(bpy.ops.matterfit.render_take, ["moves: at frame"])

    @needs_library
    def test_as_a_capture_has_its_camera(self):
        bpy.ops.matterfit.import_images(filepath=self.clip())
        self.scene.camera = blender_cameras.of_capture(self.scene, "clip")[0]
        document, _folder = self.document(task="render")
        self.assertEqual(document["render"], {"capture": "clip", "camera": [0]})
        self.settings.captures[0].enabled = False
        document, folder = self.document(task="render")
        self.assertIn("cameras", document["render"])
        self.settings.captures[0].enabled = True
        self.scene.camera.location.z += 0.1  # it is another camera now
        bpy.context.view_layer.update()
        document, folder = self.document(task="render")
        self.assertTrue(os.path.isfile(os.path.join(folder, document["render"]["cameras"])))
