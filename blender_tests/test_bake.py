# SPDX-License-Identifier: GPL-3.0-or-later
"""With the native library: bake, resume, compare, verify, free, and the same bytes headless."""

import os
import shutil
import time
from unittest import mock

import bpy
import numpy
from matterfit import handlers, jobs, native
from matterfit.io import attached, cache, files, job_document, takes
from matterfit.jobs import State
from support import SceneCase, kill_cli, needs_library, printed_json, read, run_cli, second_process, tree

RESULTS = ("state", "mesh", "points", "volume", "attributes")


def results(folder):
    """{path: bytes} of what counts as result."""
    return {path: content for path, content in tree(folder).items()
            if path.split(os.sep)[0] in RESULTS}


@needs_library
class BakeTest(SceneCase):
    def setUp(self):
        super().setUp()
        self.row = self.jelly(location=(0.0, 0.0, 0.3))

    def folder_of(self, index=0):
        return takes.locate(self.settings.takes[index]).folder

    def test_bake_attaches(self):
        """A cube that falls freely for five frames: its mesh drops ½ g t²."""
        self.assertEqual(bpy.ops.matterfit.bake(), {"FINISHED"})
        take = self.settings.takes[0]
        self.assertTrue(take.baked)
        self.assertEqual((take.first_frame, take.frames_done, take.frame_count), (1, 6, 6))
        items = {item["matterfit"]: item for item in take.collection.objects}
        self.assertEqual({tag.split(":")[0] for tag in items},
                         {"mesh", "points", "surface", "volume"})
        mesh = items["mesh:Cube"]
        self.assertFalse(mesh.hide_render)
        self.assertTrue(items["points:Cube"].hide_render)
        for frame in (1, 4, 6):
            self.scene.frame_set(frame)
            evaluated = mesh.evaluated_get(bpy.context.evaluated_depsgraph_get())
            height = numpy.mean([(mesh.matrix_world @ vertex.co).z
                                 for vertex in evaluated.to_mesh().vertices])
            evaluated.to_mesh_clear()
            fallen = 0.5 * 9.81 * ((frame - 1) / 24.0) ** 2
            if fallen < 0.19:  # until it touches the ground
                self.assertAlmostEqual(height, 0.3 - fallen, delta=0.002)
        self.assertEqual(self.error(), "")

    def test_plays_in_a_bare_blender(self):
        """Saved, opened where nothing of ours is: mesh, particles with velocity, surface play."""
        bpy.ops.matterfit.bake()
        self.save("scene.blend")
        found = second_process("""
assert not hasattr(bpy.types.Scene, "matterfit")
scene = bpy.context.scene
found = {}
for item in scene.objects:
    tag = item.get("matterfit", "").split(":")[0]
    if tag in ("mesh", "points", "surface"):
        item.hide_viewport = False
        if tag == "points":
            # Points are no mesh: look at the vertices that they are made from.
            item.modifiers["Matterfit Particles"].show_viewport = False
        places = []
        for frame in (1, 6):
            scene.frame_set(frame)
            mesh = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
            heights = [(item.matrix_world @ vertex.co).z for vertex in mesh.vertices]
            places.append(sum(heights) / len(heights))
        found[tag] = places
print(json.dumps(found))
""", blend=os.path.join(self.folder, "scene.blend"))
        self.assertEqual(set(found), {"mesh", "points", "surface"})
        for tag, (first, last) in found.items():
            self.assertAlmostEqual(first, 0.3, delta=0.02, msg=tag)
            self.assertLess(last, 0.25, tag)

    def test_the_tool_gets_the_same_bytes(self):
        """job.json as the panel wrote it, run by cli.py in another process with another number of
        threads: the result hash and every result file are the same."""
        self.settings.solver.threads = 1
        bpy.ops.matterfit.bake()
        folder = self.folder_of()
        first = results(folder)
        expected = native.inspect(folder)["result_hash"]
        copy = os.path.join(self.folder, "farm")
        os.makedirs(copy)
        shutil.copy(os.path.join(folder, "job.json"), copy)
        shutil.copytree(os.path.join(folder, "input"), os.path.join(copy, "input"))
        report = os.path.join(self.folder, "report.json")
        done = run_cli("bake", os.path.join(copy, "job.json"), "--threads", "2", "--report", report,
                       "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(files.read_json(report)["result_hash"], expected)
        self.assertEqual(first.keys(), results(copy).keys())
        for path, content in results(copy).items():
            self.assertEqual(first[path], content, path)

    def test_baking_another_output_reuses_states(self):
        bpy.ops.matterfit.bake()
        states = {path: os.stat(os.path.join(self.folder_of(), path)).st_mtime_ns
                  for path in results(self.folder_of()) if path.startswith("state")}
        self.settings.output.density = True
        bpy.ops.matterfit.bake(onto="REPLACE")
        for path, stamp in states.items():
            self.assertEqual(os.stat(os.path.join(self.folder_of(), path)).st_mtime_ns, stamp)
        self.assertIn("density", files.read_json(
            os.path.join(self.folder_of(), "manifest.json"))["grids"])

    def test_takes_do_not_touch_each_other(self):
        bpy.ops.matterfit.bake()
        first = tree(self.folder_of(0))
        bpy.ops.matterfit.add_take()
        bpy.ops.matterfit.add_throw()
        self.settings.takes[1].throws[0].velocity = (2.0, 0.0, 0.0)
        bpy.ops.matterfit.bake()
        self.assertNotEqual(self.folder_of(0), self.folder_of(1))
        self.assertEqual(first, tree(self.folder_of(0)))
        self.assertTrue(self.settings.takes[0].collection.hide_render)
        self.assertFalse(self.settings.takes[1].collection.hide_render)
        mesh = next(item for item in self.settings.takes[1].collection.objects
                    if item["matterfit"] == "mesh:Cube")
        points = cache.read_pc2(os.path.join(self.folder_of(1), "mesh", "Cube.pc2"))
        end = cache.read_pc2_frame(points, points.samples - 1).mean(axis=0)
        self.assertAlmostEqual(float(end[0]), 2.0 * 5 / 24, delta=0.02)
        self.assertEqual(tuple(mesh.location), (0.0, 0.0, numpy.float32(0.3)))

    def test_changed_input_is_refused_on_resume(self):
        bpy.ops.matterfit.bake()
        self.settings.solver.gravity = (0.0, 0.0, -3.7)
        message = self.fails(bpy.ops.matterfit.resume, [
            "The scene changed since this bake", "Gravity", "-3.7", "Press Bake"])
        self.assertNotIn("--restart", message)

    def test_bake_after_a_refusal(self):
        """What is refused, or only writes, leaves Bake able to replace the results of other inputs."""
        bpy.ops.matterfit.bake()
        self.settings.solver.gravity = (0.0, 0.0, -3.7)
        self.fails(bpy.ops.matterfit.resume, ["Gravity", "Press Bake"])
        bpy.ops.matterfit.estimate()
        bpy.ops.matterfit.write_job()
        self.assertEqual(bpy.ops.matterfit.bake(onto="REPLACE"), {"FINISHED"})
        self.assertEqual(jobs.registry.current.result["frames_reused"], 0)
        self.assertEqual(files.read_json(os.path.join(self.folder_of(), "job.json"))
                         ["scene"]["gravity"], [0, 0, -3.7])
        points = cache.read_pc2(os.path.join(self.folder_of(), "points", "Cube.pc2"))
        fall = [cache.read_pc2_frame(points, sample)[:, 2].mean() for sample in (0, 5)]
        self.assertAlmostEqual(float(fall[0] - fall[1]), 0.5 * 3.7 * (5 / 24) ** 2, delta=0.002)

    def test_baking_again_does_not_simulate(self):
        """The states of the same inputs stay as they are on disk."""
        bpy.ops.matterfit.bake()
        states = {path: os.stat(os.path.join(self.folder_of(), path)).st_mtime_ns
                  for path in results(self.folder_of()) if path.startswith("state")}
        self.assertTrue(states)
        bpy.ops.matterfit.bake(onto="REPLACE")
        self.assertEqual(jobs.registry.current.result["frames_reused"], 6)
        for path, stamp in states.items():
            self.assertEqual(os.stat(os.path.join(self.folder_of(), path)).st_mtime_ns, stamp)

    def test_a_finished_take_is_kept(self):
        """Bake makes a new take, which is shown; the finished one keeps its files."""
        bpy.ops.matterfit.bake()
        first = tree(self.folder_of())
        self.row.velocity = (1.0, 0.0, 0.0)
        self.assertEqual(bpy.ops.matterfit.bake(), {"FINISHED"})
        self.assertEqual([take.name for take in self.settings.takes], ["Take 1", "Take 2"])
        self.assertEqual(self.settings.take_index, 1)
        self.assertTrue(self.settings.takes[0].baked and self.settings.takes[1].baked)
        self.assertEqual(first, tree(self.folder_of(0)))

    def test_a_take_that_undo_took_back_is_kept(self):
        """Undo of a bake takes back what the take says of it, and no file: they stay as well."""
        bpy.ops.matterfit.bake()
        first = tree(self.folder_of())
        take = self.settings.takes[0]
        attached.remove(attached.objects_of(self.scene, take))
        take.baked, take.frames_done, take.collection = False, 0, None
        handlers.look_after_undo()
        self.assertEqual(takes.finished_frames(take), 6)
        self.row.velocity = (1.0, 0.0, 0.0)
        self.assertEqual(bpy.ops.matterfit.bake(), {"FINISHED"})
        self.assertEqual([take.name for take in self.settings.takes], ["Take 1", "Take 2"])
        self.assertEqual(first, tree(self.folder_of(0)))

    def test_what_is_on_disk_is_shown(self):
        """After another file was opened: a cache that has gone, or that a farm has finished."""
        bpy.ops.matterfit.bake()
        self.save("scene.blend")
        away = self.folder_of() + "_away"
        os.rename(self.folder_of(), away)
        self.reopen()
        self.assertFalse(self.settings.takes[0].baked)
        self.assertEqual(self.settings.takes[0].frames_done, 0)
        self.save("scene.blend")
        os.rename(away, self.folder_of())
        self.reopen()
        self.assertTrue(self.settings.takes[0].baked)
        self.assertEqual(self.settings.takes[0].frames_done, 6)

    def test_verify(self):
        """A truncated and a missing file are named."""
        bpy.ops.matterfit.bake()
        self.assertEqual(bpy.ops.matterfit.verify(), {"FINISHED"})
        folder = self.folder_of()
        volume = next(path for path in sorted(results(folder)) if path.endswith("_0003.vdb"))
        with open(os.path.join(folder, volume), "r+b") as stream:
            stream.truncate(100)
        os.remove(os.path.join(folder, "mesh", "Cube.pc2"))
        self.fails(bpy.ops.matterfit.verify, ["Damaged in", "mesh/Cube.pc2 is missing, …", "Bake again"])
        report = bpy.context.window_manager.matterfit.verify
        self.assertIn(volume.replace(os.sep, "/"), report)
        self.assertIn("truncated", report)
        self.assertIn("mesh/Cube.pc2 is missing", report)

    def test_free(self):
        """Everything of ours goes, the artist's object comes back."""
        bpy.ops.matterfit.bake()
        folder = self.folder_of()
        bpy.ops.matterfit.free()
        self.assertFalse(os.path.exists(folder))
        self.assertFalse(self.settings.takes[0].baked or bpy.data.objects["Cube"].hide_render)
        self.assertEqual([item.name for item in self.scene.objects], ["Cube"])
        self.assertEqual(bpy.context.window_manager.matterfit.last_report, "", "that it was baked")

    def test_remove_output(self):
        bpy.ops.matterfit.bake()
        bpy.ops.matterfit.remove_output(kind="volume")
        self.assertFalse(os.path.exists(os.path.join(self.folder_of(), "volume")))
        tags = {item["matterfit"].split(":")[0] for item in self.settings.takes[0].collection.objects}
        self.assertEqual(tags, {"mesh", "points"})
        self.assertEqual(bpy.ops.matterfit.verify(), {"FINISHED"})
        bpy.ops.matterfit.bake()
        self.assertTrue(os.path.exists(os.path.join(self.folder_of(), "volume")))

    def test_preview(self):
        """Coarser, particles only, in a folder of its own that goes with the next bake."""
        self.assertEqual(bpy.ops.matterfit.preview(), {"FINISHED"})
        preview = self.settings.preview
        folder = takes.locate(preview).folder
        document = files.read_json(os.path.join(folder, "job.json"))
        self.assertAlmostEqual(document["scene"]["particle_separation"], 0.04, places=6)
        self.assertEqual([item["matterfit"] for item in preview.collection.objects],
                         ["points:Cube"])
        self.assertEqual(self.settings.takes[0].folder, "")
        bpy.ops.matterfit.bake()
        self.assertFalse(os.path.exists(folder))
        self.assertEqual(self.settings.preview.folder, "")

    def test_estimate_and_refusal(self):
        bpy.ops.matterfit.estimate()
        state = bpy.context.window_manager.matterfit
        self.assertIn("particles", state.estimate)
        self.settings.solver.memory_limit = 0.1
        self.settings.solver.particle_separation = 0.002
        self.fails(bpy.ops.matterfit.bake, ["memory", "limit", "Particle Separation"])

    def test_a_refused_bake_takes_no_result(self):
        """After Save As, and in a copied scene, the take is that of another until a bake begins."""
        bpy.ops.matterfit.bake()
        self.save("scene.blend")
        self.save("copy.blend")
        for scene_of in (lambda: bpy.context.scene,
                         lambda: bpy.ops.scene.new(type="FULL_COPY") and bpy.context.scene):
            scene = scene_of()
            take = scene.matterfit.takes[0]
            kept = take.folder, take.owner, take.baked, take.frames_done
            shown = len(attached.objects_of(scene, take))
            folders = sorted(os.listdir(self.folder))
            self.assertTrue(takes.locate(take).linked and take.baked and shown)
            solver = scene.matterfit.solver
            for name, value, words in (("particle_separation", 1e-6, "nothing can be simulated below"),
                                       ("memory_limit", 0.1, "memory")):
                before = getattr(solver, name)
                if name == "memory_limit":
                    solver.particle_separation = 0.002
                setattr(solver, name, value)
                self.fails(bpy.ops.matterfit.bake, [words])
                setattr(solver, name, before)
                self.assertEqual((take.folder, take.owner, take.baked, take.frames_done), kept)
                self.assertEqual(len(attached.objects_of(scene, take)), shown)
                self.assertFalse(take.collection.hide_viewport)
                self.assertEqual(sorted(os.listdir(self.folder)), folders)
            solver.particle_separation = 0.02

    def test_unsaved_is_refused(self):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.settings = bpy.context.scene.matterfit
        self.jelly()
        self.fails(bpy.ops.matterfit.bake, ["not saved", "Save the file first"])

    def test_error_of_the_solver_is_shown(self):
        """What the library says arrives whole, with the JSON path."""
        self.row.material.E = 1e-3
        self.row.pins.clear()
        self.settings.solver.use_ground = False
        self.row.material.nu = 0.2
        self.row.density = 1000.0
        document, folder = self.document()
        document["scene"]["bodies"][0]["density"] = -5
        path = job_document.write(document, folder)
        job = jobs.Job("test", lambda: native.start(path)).run()
        self.assertIs(job.state, State.FAILED)
        self.assertEqual(job.status, 2)
        self.assertIn("scene.bodies[0].density", job.error)


@needs_library
class ResumeTest(SceneCase):
    def setUp(self):
        super().setUp()
        self.row = self.jelly(separation=0.01, location=(0.0, 0.0, 0.3))
        self.scene.frame_end = 16
        self.settings.output.surface = False

    def test_cancel_then_resume(self):
        """Cancelled in the middle, resumed: the bytes of an unbroken bake."""
        take = takes.ensure_active(self.settings)
        folder = takes.claim(take)
        document = job_document.build(self.scene, take, folder, "bake")
        path = job_document.write(document, folder)
        job = jobs.registry.add(jobs.Job("bake", lambda: native.start(path), folder=folder))
        asked = []

        def cancel_after_some(running):
            if running.snapshot.frame >= 5 and not asked:
                asked.append(time.monotonic())
                running.cancel()

        job.run(on_tick=cancel_after_some, interval=0.01)
        self.assertIs(job.state, State.CANCELLED, job.error)
        self.assertEqual(job.status, 130)
        done = cache.manifest(folder)["frames_done"]
        self.assertTrue(0 < done < 16, done)
        self.assertEqual(bpy.ops.matterfit.resume(), {"FINISHED"})
        resumed = results(folder)
        expected = native.inspect(folder)["result_hash"]
        bpy.ops.matterfit.free()
        bpy.ops.matterfit.bake()
        unbroken = takes.locate(self.settings.takes[0]).folder
        self.assertEqual(native.inspect(unbroken)["result_hash"], expected)
        self.assertEqual(resumed, results(unbroken))

    def test_killed_then_resumed(self):
        """kill -9 in another process, Resume here."""
        take = takes.ensure_active(self.settings)
        folder = takes.claim(take)
        document = job_document.build(self.scene, take, folder, "bake")
        document["output"]["checkpoint"] = {"frames": 2, "seconds": 1000}
        path = job_document.write(document, folder)
        kill_cli("bake", path, when=lambda: cache.manifest(folder).get("frames_done", 0) >= 6)
        self.assertFalse(cache.manifest(folder)["complete"])
        done = run_cli("bake", path, "--json")
        result = printed_json(done)
        self.assertTrue(any("resumed" in note for note in result.get("notes", [])), result)
        resumed = results(folder)
        cache.free(folder)
        document = job_document.build(self.scene, take, folder, "bake")
        path = job_document.write(document, folder)
        native_run = jobs.Job("bake", lambda: native.start(path)).run()
        self.assertIs(native_run.state, State.DONE, native_run.error)
        self.assertEqual(resumed, results(folder))

    def test_opening_another_file_ends_the_job(self):
        """Nothing runs on behind another .blend."""
        document, folder = self.document()
        path = job_document.write(document, folder)
        job = jobs.registry.add(jobs.Job("bake", lambda: native.start(path), folder=folder))
        job.start()
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.assertTrue(job.ended)
        self.assertIsNone(jobs.registry.running)


@needs_library
class CompareTest(SceneCase):
    def test_against_its_own_flight(self):
        """A capture that is ballistic flight plus a known offset: the error is that offset."""
        self.jelly(location=(0.0, 0.0, 1.0))
        self.settings.solver.use_ground = False
        time_axis = numpy.arange(6) / 24.0
        grid = numpy.stack(numpy.meshgrid(*[(-0.06, 0.06)] * 3), axis=-1).reshape(-1, 3)
        positions = grid[None] + numpy.array([0, 0, 1.0])
        positions = positions - 0.5 * 9.81 * time_axis[:, None, None] ** 2 * numpy.array([0, 0, 1])
        positions[3:] += (0.003, 0.0, 0.0)  # 3 mm from the fourth frame on
        files.write_npz(os.path.join(self.folder, "clip.npz"),
                        {"positions": positions, "times": time_axis})
        bpy.ops.matterfit.import_capture(filepath=os.path.join(self.folder, "clip.npz"))
        capture = self.settings.captures[0]
        self.assertEqual(capture.filepath, "//clip.npz")
        self.assertIn("6", capture.summary)
        self.assertEqual(bpy.ops.matterfit.compare(), {"FINISHED"})
        compare = self.settings.compare
        self.assertTrue(compare.done)
        self.assertAlmostEqual(compare.mean_mm, 1.5, delta=0.1)
        self.assertAlmostEqual(compare.p95_mm, 3.0, delta=0.1)
        self.assertIn(compare.worst[0].frame, (4, 5, 6))
        self.assertAlmostEqual(compare.worst[0].mean, 3.0, delta=0.1)
        self.scene.frame_set(1)
        compare.worst_index = 1
        self.assertEqual(self.scene.frame_current, compare.worst[1].frame)
        # Other values: what was only compared is done anew, what was baked is kept.
        self.settings.bodies[0].material.E *= 2.0
        self.assertEqual(bpy.ops.matterfit.compare(), {"FINISHED"})
        bpy.ops.matterfit.bake()
        self.settings.bodies[0].material.E *= 2.0
        self.fails(bpy.ops.matterfit.compare, ["The scene changed since this bake"])

    def test_without_a_capture(self):
        self.jelly()
        self.fails(bpy.ops.matterfit.compare, ["no capture", "Import one"])

    def test_files_that_are_no_captures(self):
        path = os.path.join(self.folder, "cut.npz")
        files.write_npz(path, {"positions": numpy.zeros((3, 2, 3)), "times": numpy.arange(3.0)})
        with open(path, "r+b") as stream:
            stream.truncate(100)
        self.fails(bpy.ops.matterfit.import_capture, ["cut.npz"], filepath=path)
        self.assertEqual(len(self.settings.captures), 0)
        self.fails(bpy.ops.matterfit.import_capture, [".npz", "Choose one"],
                   filepath=os.path.join(self.folder, "scene.blend"))


@needs_library
class CliTest(SceneCase):
    def test_exit_statuses(self):
        """0 done, 2 wrong input with its JSON path, as the tool has them."""
        path = os.path.join(self.folder, "job.json")
        files.write_json(path, {"schema": "matterfit.job/1", "scene": {"fps": 24, "nonsense": 1}})
        done = run_cli("simulate", path)
        self.assertEqual(done.returncode, 2, done.stdout + done.stderr)
        self.assertIn("scene", done.stderr)
        done = run_cli("simulate", os.path.join(self.folder, "missing.json"))
        self.assertEqual(done.returncode, 2)
        self.assertIn("missing.json", done.stderr)
        done = run_cli("frobnicate")
        self.assertEqual(done.returncode, 2)

    def test_without_the_library(self):
        """A library that does not load is not status 0."""
        self.jelly()
        document, folder = self.document()
        path = job_document.write(document, folder)
        missing = os.path.join(self.folder, "nowhere.so")
        with mock.patch.dict(os.environ, MATTERFIT_LIBRARY=missing):
            done = run_cli("simulate", path)
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("nowhere.so", done.stderr)

    def test_the_open_scene(self):
        """Without JOB the scene's active take is baked, attached and saved."""
        if not bpy.app.binary_path:
            self.skipTest("a .blend on the command line needs Blender itself")
        self.jelly()
        takes.ensure_active(self.settings)
        self.save("scene.blend")
        done = run_cli("bake", "--save", "--json",
                       blend=os.path.join(self.folder, "scene.blend"))
        self.assertEqual(done.returncode, 0, done.stderr)
        self.reopen()
        take = self.settings.takes[0]
        self.assertTrue(take.baked)
        self.assertEqual(take.frames_done, 6)
        self.assertTrue(any(item["matterfit"] == "mesh:Cube" for item in take.collection.objects))

    def test_a_take_of_a_batch_stays(self):
        if not bpy.app.binary_path:
            self.skipTest("a .blend on the command line needs Blender itself")
        self.jelly()
        take = takes.ensure_active(self.settings)
        takes.claim(take)
        take.folder += "velocity.2=-1/"
        self.save("scene.blend")
        before = read(self.folder, "scene.blend")
        for verb in ("bake", "compare"):
            done = run_cli(verb, "--save", blend=os.path.join(self.folder, "scene.blend"))
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn("one of a batch", done.stderr)
        self.assertEqual(read(self.folder, "scene.blend"), before)

    def test_inspect(self):
        self.jelly()
        bpy.ops.matterfit.bake()
        folder = takes.locate(self.settings.takes[0]).folder
        done = run_cli("inspect", folder, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn(native.inspect(folder)["result_hash"], done.stdout)
        os.remove(os.path.join(folder, "mesh", "Cube.pc2"))
        done = run_cli("inspect", folder)
        self.assertEqual(done.returncode, 2)
        self.assertIn("mesh/Cube.pc2 is missing", done.stderr)
        self.assertIn(b"matterfit", read(folder, "manifest.json"))
