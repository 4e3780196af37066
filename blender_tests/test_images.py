# SPDX-License-Identifier: GPL-3.0-or-later
"""Captures by images in the panel and in documents; splats drawn through Blender's camera."""

import json
import math
import os
import re
import struct

import bpy
import numpy
from mathutils import Matrix, Vector
from matterfit.io import blender_cameras, camera_frames, job_images
from matterfit.jobs import JobError
from support import SceneCase, needs_library

WIDTH, HEIGHT = 32, 24


def write_image(path, low, high):
    """White, opaque in the columns from `low` to `high`."""
    image = bpy.data.images.new("matte", WIDTH, HEIGHT, alpha=True)
    pixels = numpy.zeros((HEIGHT, WIDTH, 4), dtype=numpy.float32)
    pixels[:, low:high] = 1.0
    image.pixels.foreach_set(pixels.ravel())
    image.filepath_raw = path
    image.file_format = "PNG"
    image.save()
    bpy.data.images.remove(image)


def write_photo(path, low=0, high=0):
    """Grey, and a body of another colour in the columns from `low` to `high`; the name's ending says
    whether it is a JPEG, a PNG or an OpenEXR file."""
    kind = {"jpg": "JPEG", "png": "PNG", "exr": "OPEN_EXR"}[path.rsplit(".", 1)[1]]
    image = bpy.data.images.new("photo", WIDTH, HEIGHT, alpha=False, float_buffer=kind == "OPEN_EXR")
    pixels = numpy.full((HEIGHT, WIDTH, 4), 0.3, dtype=numpy.float32)
    pixels[:, low:high, :3] = (0.9, 0.1, 0.1)
    pixels[:, :, 3] = 1.0
    image.pixels.foreach_set(pixels.ravel())
    image.filepath_raw = path
    image.file_format = kind
    image.save()
    bpy.data.images.remove(image)


class ImagesCase(SceneCase):
    def camera(self, location=(0.0, -2.0, 0.5), rotation=(math.pi / 2, 0.0, 0.0)):
        bpy.ops.object.camera_add(location=location, rotation=rotation)
        self.scene.camera = bpy.context.active_object
        self.scene.render.resolution_x, self.scene.render.resolution_y = WIDTH, HEIGHT
        self.scene.render.resolution_percentage = 100
        return self.scene.camera

    def clip(self, count=3):
        """The file of a camera with `count` images."""
        camera = self.camera()
        bpy.context.view_layer.update()
        folder = os.path.join(self.folder, "clip")
        os.makedirs(folder, exist_ok=True)
        shots = []
        for k in range(count):
            name = f"c0_{k}.png"
            write_image(os.path.join(folder, name), 8 + k, 20 + k)
            shots.append(blender_cameras.shot(self.scene, camera, name))
        path = os.path.join(folder, "transforms.json")
        with open(path, "w", encoding="utf-8") as file:
            json.dump({"frames": shots}, file)
        return path


class CameraTest(ImagesCase):
    def test_a_shot_sees_what_the_camera_sees(self):
        """A point projected by the file's numbers lies where Blender says that it lies."""
        camera = self.camera(location=(1.0, -3.0, 1.2), rotation=(1.3, 0.1, 0.4))
        camera.data.shift_x, camera.data.shift_y, camera.data.lens = 0.1, -0.05, 40.0
        bpy.context.view_layer.update()
        shot = blender_cameras.shot(self.scene, camera, "a")
        from bpy_extras.object_utils import world_to_camera_view
        for point in ((0.0, 0.0, 0.3), (0.4, 0.2, 0.9)):
            x, y, z = Matrix(shot["transform_matrix"]).inverted() @ Vector(point)
            u = shot["cx"] + shot["fl_x"] * x / -z
            v = shot["cy"] - shot["fl_y"] * y / -z
            expected = world_to_camera_view(self.scene, camera, Vector(point))
            self.assertAlmostEqual(u / WIDTH, expected.x, places=5)
            self.assertAlmostEqual(1.0 - v / HEIGHT, expected.y, places=5)

    def test_no_camera_is_said(self):
        with self.assertRaises(JobError) as caught:
            blender_cameras.shot(self.scene, None, "a")
        self.assertIn("no camera", str(caught.exception))


class ImportTest(ImagesCase):
    @needs_library
    def test_summary_and_cameras(self):
        path = self.clip()
        bpy.ops.matterfit.import_images(filepath=path)
        capture = self.settings.captures[0]
        self.assertEqual((capture.name, capture.source), ("clip", "IMAGES"))
        self.assertIn("1 cameras, 3 images of 3 times", capture.summary)
        self.assertIn("32 × 24", capture.summary)
        added = bpy.data.collections["clip"].objects[0]
        seen = blender_cameras.shot(self.scene, added, "a")
        given = blender_cameras.shot(self.scene, self.scene.camera, "a")
        for key in ("fl_x", "fl_y", "cx", "cy"):
            self.assertAlmostEqual(seen[key], given[key], places=4)
        numpy.testing.assert_allclose(seen["transform_matrix"], given["transform_matrix"], atol=1e-6)

    @needs_library
    def test_photographs_behind_the_cameras(self):
        """Image by image where the recording has the scene's rate, else the first."""
        for fps, timed, source in ((24, False, "SEQUENCE"), (30, False, "SEQUENCE"), (30, True, "FILE")):
            self.scene.render.fps = fps
            path = self.clip()
            if timed:  # at 24 frames a second
                with open(path, encoding="utf-8") as file:
                    shots = json.load(file)["frames"]
                shots = [{**shot, "time": k / 24.0} for k, shot in enumerate(shots)]
                with open(path, "w", encoding="utf-8") as file:
                    json.dump({"frames": shots}, file)
            bpy.ops.matterfit.import_images(filepath=path)
            name = self.settings.captures[self.settings.capture_index].name
            camera = blender_cameras.of_capture(self.scene, name)[0]
            shown = camera.data.background_images[0]
            self.assertEqual(os.path.basename(shown.image.filepath), "c0_0.png")
            self.assertEqual((shown.image.source, shown.display_depth), (source, "BACK"))
            if source == "SEQUENCE":
                user = shown.image_user
                self.assertEqual((user.frame_start, user.frame_duration), (self.scene.frame_start, 3))
                self.assertTrue(shown.image.filepath.startswith("//"))
                # Frame `frame_start` shows the file of number 0.
                self.assertEqual(user.frame_offset, -1)

    @needs_library
    def test_photographs_of_another_aspect_than_the_scene(self):
        """The side that tells the lens fills the frame's, whatever the scene renders."""
        path = self.clip()
        self.scene.render.resolution_x, self.scene.render.resolution_y = 1920, 1080
        bpy.ops.matterfit.import_images(filepath=path)
        camera = blender_cameras.of_capture(self.scene, "clip")[0]
        shown = camera.data.background_images[0]
        self.assertEqual(shown.frame_method, "CROP")  # it is higher than the frame
        self.scene.render.resolution_x = 1080
        camera_frames.fill_all()
        self.assertEqual(shown.frame_method, "FIT")  # and wider
        # The file is opened anew, and what was changed outside of the window is seen.
        self.scene.render.resolution_x = 1920
        bpy.ops.wm.save_mainfile()
        self.reopen()
        shown = blender_cameras.of_capture(self.scene, "clip")[0].data.background_images[0]
        self.assertEqual(shown.frame_method, "CROP")
        # A picture of the frame's own aspect stays as it is, and one of a camera that is nobody's.
        self.scene.render.resolution_x, self.scene.render.resolution_y = WIDTH, HEIGHT
        shown.frame_method = "STRETCH"
        other = blender_cameras.set_background(self.camera(), shown.image)
        other.frame_method = "STRETCH"
        camera_frames.fill_all()
        self.assertEqual((shown.frame_method, other.frame_method), ("STRETCH", "STRETCH"))
        self.scene.render.resolution_x = 2 * WIDTH
        camera_frames.fill_all()
        self.assertEqual((shown.frame_method, other.frame_method), ("CROP", "STRETCH"))

    @needs_library
    def test_where_a_point_lies_in_such_a_photograph(self):
        """Upright images and a principal point off the middle too: where the photograph has it, the view has."""
        from bpy_extras.object_utils import world_to_camera_view
        capture = self.settings.captures.add()
        capture.name = "told"
        for width, height in ((40, 30), (30, 40)):
            matrix = [[1, 0, 0, 0.1], [0, 0, -1, -2.0], [0, 1, 0, 0.5], [0, 0, 0, 1]]
            place = {"width": width, "height": height, "fx": 44.0, "fy": 44.0, "cx": 0.5 * width + 3.0,
                     "cy": 0.5 * height - 2.0, "matrix": matrix}
            item = blender_cameras.add_cameras(capture, [place])[0]
            bpy.context.view_layer.update()
            image = bpy.data.images.new("photograph", width, height)
            shown = blender_cameras.set_background(item, image)
            point = Vector((0.3, 0.0, 0.7))
            u, v = place["cx"] + 44.0 * 0.2 / 2.0, place["cy"] - 44.0 * 0.2 / 2.0
            for x, y in ((1920, 1080), (1080, 1920), (300, 320), (320, 300)):
                self.scene.render.resolution_x, self.scene.render.resolution_y = x, y
                camera_frames.told(capture, [place])
                seen = world_to_camera_view(self.scene, item, point)
                # As Blender draws it: about the middle of the frame, of these widths and heights of it.
                aspect, frame = width / height, x / y
                by_width = (aspect > frame) == (shown.frame_method == "FIT")
                wide, high = (1.0, frame / aspect) if by_width else (aspect / frame, 1.0)
                self.assertAlmostEqual(0.5 + (u / width - 0.5) * wide, seen.x, places=5)
                self.assertAlmostEqual(0.5 - (v / height - 0.5) * high, seen.y, places=5)
            bpy.data.objects.remove(item)

    @needs_library
    def test_photographs_of_cameras_side_by_side(self):
        """What is numbered on is another camera's image, so each stands still."""
        path = self.clip()
        folder = os.path.dirname(path)
        paths = {k: os.path.join(folder, f"c0_{k}.png") for k in range(3)}
        places = [{"image": f"c0_{k}.png"} for k in range(3)]
        self.assertEqual(job_images.photographs(path, places), paths)
        camera = self.scene.camera
        blender_cameras.show_photographs([camera] * 3, paths, 1, 2)
        self.assertEqual([shown.image.source for shown in camera.data.background_images], ["FILE"] * 3)

    def test_photographs_of_a_colmap_model(self):
        """In the project's folder of images, however the model is named."""
        project = os.path.join(self.folder, "project")
        os.makedirs(os.path.join(project, "sparse", "0"))
        os.makedirs(os.path.join(project, "images"))
        photo = os.path.join(project, "images", "a.png")
        open(photo, "wb").close()
        model = os.path.join(project, "sparse", "0")
        for named in (project, model, model + "/", os.path.join(model, "images.bin")):
            self.assertEqual(job_images.photographs(named, [{"image": "a.png"}, {"image": "b.png"}]),
                             {0: photo}, named)

    def test_images_that_are_numbered_on(self):
        folder = os.path.join(self.folder, "numbers")
        os.makedirs(folder)
        for name in ("a_008.png", "a_009.png", "a_010.png", "a_012.png", "b.png"):
            open(os.path.join(folder, name), "wb").close()
        for name, count in (("a_008.png", 3), ("a_012.png", 1), ("b.png", 1)):
            self.assertEqual(len(blender_cameras.numbered_on(os.path.join(folder, name))), count)

    @needs_library
    def test_what_is_broken_leaves_no_row(self):
        path = self.clip()
        os.remove(os.path.join(self.folder, "clip", "c0_1.png"))
        self.fails(bpy.ops.matterfit.import_images, ["c0_1.png"], filepath=path)
        self.assertEqual(len(self.settings.captures), 0)

    @needs_library
    def test_document(self):
        path = self.clip()
        self.jelly()
        bpy.ops.matterfit.import_images(filepath=path, cameras=False)
        capture = self.settings.captures[0]
        capture.use_noise, capture.noise_pixels = True, 0.5
        capture.holdout, capture.holdout_start = "FRAMES", 4
        document, _folder = self.document(task="fit")
        found = document["captures"][0]
        self.assertEqual(found["noise"], 0.5)
        self.assertEqual(found["holdout"], {"frames": [4, 7]})
        self.assertTrue(found["cameras"].endswith("clip/transforms.json"))
        self.assertNotIn("tracks", found)
        capture.holdout, capture.holdout_tracks = "TRACKS", "0, 2"
        document, _folder = self.document(task="fit")
        self.assertEqual(document["captures"][0]["holdout"], {"cameras": [0, 2]})
        capture.holdout_tracks = "left"
        with self.assertRaises(JobError) as caught:
            self.document(task="fit")
        self.assertIn("no camera is named", str(caught.exception))


class ColmapTest(ImagesCase):
    def project(self, ending="jpg", count=3):
        """A COLMAP project of one camera, of whose images the model names the first, and its plate."""
        camera = self.camera(location=(1.0, -3.0, 1.2), rotation=(1.3, 0.1, 0.4))
        bpy.context.view_layer.update()
        shot = blender_cameras.shot(self.scene, camera, "a")
        folder = os.path.join(self.folder, f"project_{ending}")
        for name in ("sparse/0", "images/left", "plates"):
            os.makedirs(os.path.join(folder, name))
        for k in range(count):
            write_photo(os.path.join(folder, f"images/left/take_{k}.{ending}"), 8 + k, 20 + k)
        write_photo(os.path.join(folder, f"plates/plate_00.{ending}"))
        # COLMAP's camera looks along its z, y down.
        to_camera = (Matrix(shot["transform_matrix"]) @ Matrix.Diagonal((1, -1, -1, 1))).inverted()
        turn, shift = to_camera.to_quaternion(), to_camera.translation
        numbers = " ".join(repr(float(x)) for x in (*turn, *shift))
        model = {"cameras": f"# one\n1 PINHOLE {WIDTH} {HEIGHT} {shot['fl_x']} {shot['fl_y']} "
                            f"{shot['cx']} {shot['cy']}\n",
                 "images": f"# one\n1 {numbers} 1 left/take_0.{ending}\n\n"}
        for name, text in model.items():
            with open(os.path.join(folder, "sparse/0", name + ".txt"), "w", encoding="utf-8") as file:
                file.write(text)
        return folder

    @needs_library
    def test_a_project_with_a_clean_plate(self):
        for ending in ("jpg", "exr"):
            with self.subTest(ending):
                folder = self.project(ending)
                given = blender_cameras.shot(self.scene, self.scene.camera, "a")
                bpy.ops.matterfit.import_images(
                    filepath=os.path.join(folder, "sparse", "0", "images.txt"), up="Z",
                    plate=os.path.join(folder, "plates", f"plate_00.{ending}"))
                capture = self.settings.captures[-1]
                self.assertEqual(capture.name, f"project_{ending}")
                for found in ("1 cameras, 3 images of 3 times", "32 × 24 pixels",
                              "what differs from clean plates", "2 images that the model does not name"):
                    self.assertIn(found, capture.summary)
                low, high = re.search(r"covers ([\d.]+) to ([\d.]+) %", capture.summary).groups()
                self.assertAlmostEqual(float(low), 37.5, delta=2.0)  # JPEG smears the edge
                self.assertAlmostEqual(float(high), 37.5, delta=2.0)
                added = bpy.data.collections[capture.name].objects[0]
                seen = blender_cameras.shot(self.scene, added, "a")
                numpy.testing.assert_allclose(seen["transform_matrix"], given["transform_matrix"],
                                              atol=1e-5)

    @needs_library
    def test_the_document_names_folder_and_plates(self):
        folder = self.project()
        self.jelly()
        bpy.ops.matterfit.import_images(
            filepath=folder, cameras=False, plate=os.path.join(folder, "plates", "plate_00.jpg"))
        document, written = self.document(task="fit")
        found = document["captures"][0]
        self.assertEqual(os.path.normpath(os.path.join(written, found["cameras"])), folder)
        self.assertEqual([os.path.basename(name) for name in found["plate"]["images"]],
                         ["plate_00.jpg"])
        self.assertTrue(os.path.isfile(os.path.join(written, found["plate"]["images"][0])))
        self.settings.captures[0].images = os.path.join(folder, "images")
        document, _written = self.document(task="fit")
        self.assertTrue(document["captures"][0]["images"].endswith("project_jpg/images"))

    @needs_library
    def test_images_that_lie_elsewhere(self):
        folder = self.project()
        os.rename(os.path.join(folder, "images"), os.path.join(folder, "elsewhere"))
        self.fails(bpy.ops.matterfit.import_images, ["Image Folder"], filepath=folder, use_key=True,
                   key=(0.9, 0.1, 0.1))
        bpy.ops.matterfit.import_images(filepath=folder, images=os.path.join(folder, "elsewhere"),
                                        use_key=True, key=(0.9, 0.1, 0.1))
        self.assertIn("1 cameras, 3 images", self.settings.captures[-1].summary)

    @needs_library
    def test_a_key_in_place_of_a_matte(self):
        folder = self.project()
        bpy.ops.matterfit.import_images(filepath=folder, cameras=False, use_key=True, key=(0.9, 0.1, 0.1))
        self.assertIn("Mattes by the body's colour", self.settings.captures[0].summary)
        document, _folder = self.document(task="fit") if self.jelly() else None
        self.assertEqual([round(value, 3) for value in document["captures"][0]["key"]["range"]], [0.25, 0.75])
        self.settings.captures[0].key_range = (0.8, 0.2)
        self.fails(bpy.ops.matterfit.check_capture, ["Key Range goes from 0.8 to 0.2"])

    @needs_library
    def test_what_cannot_be_imported_is_said(self):
        folder = self.project()
        self.fails(bpy.ops.matterfit.import_images, ["cameras are a .json file"],
                   filepath=os.path.join(folder, "plates", "plate_00.jpg"))
        self.fails(bpy.ops.matterfit.import_images, ["clean plate", "does not exist"],
                   filepath=folder, plate=os.path.join(folder, "none.png"))
        self.fails(bpy.ops.matterfit.import_images, ["holds no COLMAP model"],
                   filepath=os.path.join(folder, "plates"))
        write_photo(os.path.join(folder, "plates", "plate_01.jpg"))
        self.fails(bpy.ops.matterfit.import_images, ["2 clean plates and 1 cameras"],
                   filepath=folder, plate=os.path.join(folder, "plates", "plate_01.jpg"))
        self.assertEqual(len(self.settings.captures), 0)
        bpy.ops.matterfit.import_images(filepath=self.clip(), cameras=False)
        capture = self.settings.captures[0]
        capture.use_key = capture.use_plate = True
        capture.plate = os.path.join(folder, "plates", "plate_00.jpg")
        self.fails(bpy.ops.matterfit.check_capture, ["both switched on"])
        capture.use_key, capture.plate = False, ""
        self.fails(bpy.ops.matterfit.check_capture, ["no clean plate is chosen"])


class RenderTest(ImagesCase):
    def splat(self):
        """One red, opaque ball of 5 cm in front of the camera, in a world whose y points down."""
        path = os.path.join(self.folder, "ball.splat")
        with open(path, "wb") as file:
            file.write(struct.pack("<6f8B", 0.0, -0.5, 0.0, 0.05, 0.05, 0.05,
                                   255, 0, 0, 255, 255, 128, 128, 128))
        return path

    @needs_library
    def test_splats_of_another_unit(self):
        """Half a unit below the origin of the file is half a decimetre below the scene's."""
        camera = self.camera(location=(0.0, -0.2, 0.05))
        self.scene.camera = camera
        bpy.context.view_layer.update()
        bpy.ops.matterfit.render_splats(filepath=self.splat(), up="-Y", scale=0.1)
        pixels = numpy.array(bpy.data.images["ball"].pixels[:]).reshape(HEIGHT, WIDTH, 4)
        self.assertGreater(pixels[HEIGHT // 2, WIDTH // 2, 0], 0.9)

    @needs_library
    def test_splats_behind_the_camera(self):
        camera = self.camera()
        bpy.ops.matterfit.render_splats(filepath=self.splat(), up="-Y")
        image = bpy.data.images["ball"]
        self.assertEqual(tuple(image.size), (WIDTH, HEIGHT))
        pixels = numpy.array(image.pixels[:]).reshape(HEIGHT, WIDTH, 4)
        rows, columns = numpy.nonzero(pixels[:, :, 3] > 0.5)
        self.assertGreater(len(rows), 0)
        self.assertAlmostEqual(rows.mean(), HEIGHT / 2 - 0.5, delta=0.6)
        self.assertAlmostEqual(columns.mean(), WIDTH / 2 - 0.5, delta=0.6)
        self.assertGreater(pixels[HEIGHT // 2, WIDTH // 2, 0], 0.9)
        self.assertEqual(camera.data.background_images[0].image, image)

    @needs_library
    def test_a_scene_without_a_camera_is_said(self):
        self.fails(bpy.ops.matterfit.render_splats, ["no camera"], filepath=self.splat())
