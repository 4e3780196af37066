# SPDX-License-Identifier: GPL-3.0-or-later
"""What the operators make of a job's end, with a backend that computes nothing."""

import contextlib
import os
import tempfile
import unittest
from unittest import mock

import bpy
import numpy
from fake_cache import write_pc2
from matterfit import jobs, native, ops, ui
from matterfit.io import comparison, files, job_document, takes
from matterfit.jobs import JobError, Outcome, Snapshot
from matterfit.ops import job_operator
from matterfit.props.compare import store
from support import SceneCase, read, tree


class Backend:
    """Says a few frames, then ends as it was told; `work` is done in the last poll."""

    def __init__(self, frames=(1, 1), status=0, error="", result=None, work=None):
        self.frames = list(frames)
        self.status = status
        self.error = error
        self.result = result or {}
        self.work = work
        self.frame = self.frames[0]

    def poll(self):
        if self.frames:
            self.frame = self.frames.pop(0)
            if not self.frames and self.work is not None:
                self.work()
        return Snapshot(finished=not self.frames, fraction=0.5, frame=self.frame, last_frame=6)

    def cancel(self):
        self.status = jobs.EXIT_CANCELLED

    def wait(self):
        self.frames = []

    def outcome(self):
        return Outcome(self.status, self.result, self.error)

    def free(self):
        pass


class JobCase(SceneCase):
    """A jelly cube whose jobs are run by `self.backend`; the calls of native.start are kept."""

    def setUp(self):
        super().setUp()
        self.jelly(separation=0.1, location=(0.0, 0.0, 0.3))
        self.backend = Backend()
        self.started = []

        def start(path, **options):
            self.started.append((files.read_json(path), options))
            return self.backend

        for name, value in (("start", start), ("require", lambda: None),
                            ("estimate", lambda *_arguments: {"bytes": 1, "particles": 8})):
            patch = mock.patch.object(native, name, value)
            patch.start()
            self.addCleanup(patch.stop)

    def cached(self):
        """A take with a finished cache of the scene as it is: (take, folder)."""
        take = takes.ensure_active(self.settings)
        folder = takes.claim(take)
        document = job_document.build(self.scene, take, folder, "bake")
        job_document.write(document, folder)
        corners = numpy.zeros((6, 8, 3))
        write_pc2(os.path.join(folder, "mesh", "Cube.pc2"), corners)
        write_pc2(os.path.join(folder, "points", "Cube.pc2"), corners)
        files.write_json(os.path.join(folder, "manifest.json"), {"files": {}})
        return take, folder


class EndTest(JobCase):
    def test_bake_begins_afresh_only_where_changed(self):
        """The library decides by what it knows of the results, not by the job.json that lies there."""
        bpy.ops.matterfit.bake()
        bpy.ops.matterfit.resume()
        bpy.ops.matterfit.preview()
        self.assertEqual([options["restart"] for _document, options in self.started], [2, 0, 1])

    def test_a_finished_take_is_not_baked_over(self):
        """Without a word it goes into a new take; Replace goes into the same one. One that was
        refused before it began leaves no empty take."""
        take, folder = self.cached()
        take.baked = True
        files.write_json(os.path.join(folder, "manifest.json"), {"files": {}, "complete": True,
                                                                "frames_baked": 5})
        before = tree(folder)
        bpy.ops.matterfit.bake(onto="REPLACE")
        self.assertEqual(len(self.settings.takes), 1)
        self.settings.takes[0].baked = True
        before = tree(folder)
        bpy.ops.matterfit.bake()
        self.assertEqual([other.name for other in self.settings.takes], ["Take 1", "Take 2"])
        self.assertEqual(self.settings.take_index, 1)
        self.assertEqual(tree(folder), before)
        self.settings.take_index = 0
        self.settings.solver.memory_limit = 0.1
        with mock.patch.object(native, "estimate", lambda *_arguments: {"bytes": 10**9}):
            self.fails(bpy.ops.matterfit.bake, ["memory"])
        self.assertEqual((len(self.settings.takes), self.settings.take_index), (2, 0))

    def test_a_refused_resume_moves_nothing(self):
        """Neither while it reads nor at its end; job.json and the inputs are those of the results."""
        take, folder = self.cached()
        bpy.ops.matterfit.bake()
        mesh = next(item for item in take.collection.objects if item["matterfit"] == "mesh:Cube")
        self.assertAlmostEqual(mesh.location.z, 0.3, places=6)
        before = tree(folder)
        bpy.data.objects["Cube"].location.z = 2.0
        bpy.data.meshes["Cube"].vertices[0].co.x *= 1.1
        self.scene.frame_end = 4
        self.backend = Backend(frames=(1, 1, 1), status=2, error="other inputs. Run with --restart x")
        self.fails(bpy.ops.matterfit.resume, ["Press Bake"])
        self.assertEqual(self.started[-1][0]["scene"]["frames"], [1, 5])
        self.assertAlmostEqual(mesh.location.z, 0.3, places=6)
        self.assertEqual(take.frame_count, 6)
        self.assertEqual(tree(folder), before)

    def test_a_job_that_has_begun_keeps_its_document(self):
        """Once the run has written the manifest, the results are the new document's."""
        _take, folder = self.cached()
        self.scene.frame_end = 4
        manifest = os.path.join(folder, "manifest.json")
        self.backend = Backend(frames=(1,), status=3, error="the disk is full",
                               work=lambda: files.write_json(manifest, {"files": {}}))
        self.fails(bpy.ops.matterfit.bake, ["disk is full"])
        self.assertEqual(files.read_json(os.path.join(folder, "job.json"))["scene"]["frames"], [1, 5])

    def test_refused_by_the_estimate(self):
        """job.json stays the one of the results."""
        _take, folder = self.cached()
        before = read(folder, "job.json")
        self.scene.frame_end = 4
        with mock.patch.object(native, "estimate", lambda *_arguments: {"bytes": 10**15}):
            self.fails(bpy.ops.matterfit.bake, ["limit is 8.0 GB"])
        self.assertEqual(read(folder, "job.json"), before)
        self.assertEqual(self.started, [])

    def test_resume_is_offered_for_what_it_resumes(self):
        """Bake and Resume; not Preview."""
        found = {}
        for name in ("bake", "resume", "preview"):
            self.backend = Backend(status=jobs.EXIT_CANCELLED)
            with mock.patch.object(job_operator.JobOperator, "report", create=True) as report:
                operator = next(cls for cls in ops.CLASSES
                                if cls.bl_idname == "matterfit." + name)
                stub = mock.Mock(spec=operator, report=report, bl_options=operator.bl_options,
                                 onto="NEW")
                job = jobs.drained(operator.begin(stub, bpy.context)).run(interval=0.0)
                operator._result(stub, bpy.context, job)
            found[name] = (job.resumable, "Resume goes on" in report.call_args[0][1])
        self.assertEqual(found, {"bake": (True, True), "resume": (True, True),
                                 "preview": (False, False)})

    def test_a_run_forgets_what_was_said_of_the_one_before(self):
        """Whether it is done, cancelled or refused."""
        state = bpy.context.window_manager.matterfit
        for backend in (Backend(), Backend(status=jobs.EXIT_CANCELLED), Backend(status=2, error="no")):
            state.last_report, state.last_error = "said before", "failed before"
            self.backend = backend
            with contextlib.suppress(RuntimeError):
                bpy.ops.matterfit.preview()
            self.assertNotIn("before", state.last_report + state.last_error)

    def test_any_error_at_the_end_is_reported(self):
        """An exception that nobody foresaw ends the operator as an error with its text."""
        with mock.patch.object(ops.simulate.BakeJob, "show", side_effect=ValueError("odd mesh")), \
                mock.patch.object(job_operator.traceback, "print_exc"):
            self.fails(bpy.ops.matterfit.bake, ["ValueError: odd mesh", "system console"])
        self.assertIsNone(jobs.registry.running)

    def test_status_text_is_cleared_everywhere(self):
        """Blender clears the text of the context's workspace, whichever is asked."""
        cleared = []

        class Context:
            workspace = object()

            @staticmethod
            def temp_override(workspace):
                cleared.append(workspace.name)
                return bpy.context.temp_override(workspace=workspace)

        ops.base.status_text(Context, None)
        self.assertEqual(cleared, [workspace.name for workspace in bpy.data.workspaces])
        self.assertTrue(cleared)


class EstimateTest(JobCase):
    def test_leaves_nothing(self):
        """No folder is claimed, no file stays, neither beside the .blend nor in the temporary folder."""
        seen = []

        def estimate(_document, folder, *_threads):
            seen.append((folder, sorted(tree(folder))))
            return {"bytes": 1000, "particles": 8}

        before = sorted(tree(self.folder))
        with mock.patch.object(native, "estimate", estimate):
            self.assertEqual(bpy.ops.matterfit.estimate(), {"FINISHED"})
        self.assertEqual(len(self.settings.takes), 0)
        self.assertEqual(sorted(tree(self.folder)), before)
        self.assertIn(os.path.join("input", "body_Cube.npz"), seen[0][1])
        self.assertTrue(seen[0][0].startswith(os.path.realpath(tempfile.gettempdir())))
        self.assertFalse(os.path.exists(seen[0][0]))
        self.assertIn("1.0 kB", bpy.context.window_manager.matterfit.estimate)

    def test_of_files_beside_the_scene(self):
        """The document's relative paths are right from where it is estimated."""
        path = os.path.join(self.folder, "points.npz")
        files.write_npz(path, {"positions": numpy.zeros((1, 3))})
        body = self.settings.bodies[0]
        body.source, body.filepath = "POINTS", "//points.npz"
        found = []

        def estimate(document, folder, *_threads):
            source = document["scene"]["bodies"][0]["source"]["points"]
            found.append(os.path.isfile(os.path.join(folder, source)))
            return {"bytes": 1}

        with mock.patch.object(native, "estimate", estimate):
            bpy.ops.matterfit.estimate()
        self.assertEqual(found, [True])

    def test_a_linked_take_stays_linked(self):
        take, _folder = self.cached()
        self.save("scene.blend")
        self.save("copy.blend")
        take = bpy.context.scene.matterfit.takes[0]
        folder = take.folder
        bpy.ops.matterfit.estimate()
        self.assertEqual(take.folder, folder)
        self.assertTrue(takes.locate(take).linked)


class PollTest(JobCase):
    def test_greyed_while_a_job_runs(self):
        self.cached()
        names = ("bake", "resume", "preview", "compare", "verify", "estimate", "write_job",
                 "free", "remove_take", "remove_output")
        for name in names:
            self.assertTrue(getattr(bpy.ops.matterfit, name).poll(), name)
        jobs.registry.add(jobs.Job("long", lambda: Backend(frames=[1] * 1000))).start()
        for name in names:
            self.assertFalse(getattr(bpy.ops.matterfit, name).poll(), name)

    def test_what_deletes_or_runs_is_not_repeated(self):
        """Repeat Last takes registered operators, and asks nothing."""
        for cls in ops.CLASSES:
            if issubclass(cls, job_operator.JobOperator) or cls.bl_idname in (
                    "matterfit.free", "matterfit.remove_take", "matterfit.remove_output",
                    "matterfit.write_job", "matterfit.estimate"):
                self.assertNotIn("REGISTER", cls.bl_options, cls)
        kind = bpy.ops.matterfit.remove_output.get_rna_type().properties["kind"]
        self.assertTrue(kind.is_hidden and kind.is_skip_save)


class OverlayTest(JobCase):
    def test_simulated_points_beside_captured_ones(self):
        """Both at their places in Blender units; a point that was not seen is not drawn."""
        captured = numpy.zeros((1, 3, 3)) + [[0, 0, 0], [1, 0, 0], [2, 0, 0]]
        errors = numpy.array([[0.0, 10.0, numpy.nan]])
        found = comparison.Comparison(numpy.array([1.0]), captured, captured + [0, 0, 1], errors,
                                      ["a", "b", "c"])
        compare = self.settings.compare
        ghosts, seen = ui.overlay.point_sets(compare, found, 0, 0.5, 10.0)
        numpy.testing.assert_allclose(ghosts[0], [[0, 0, 0.5], [0.5, 0, 0.5]])
        numpy.testing.assert_allclose(seen[0], [[0, 0, 0], [0.5, 0, 0]])
        numpy.testing.assert_allclose(seen[1][:, :3], ui.overlay.STOPS[[0, -1]], atol=1e-6)
        self.assertLess(ghosts[2], seen[2])
        compare.show_simulation = False
        self.assertEqual(len(ui.overlay.point_sets(compare, found, 0, 0.5, 10.0)), 1)


class CompareTest(JobCase):
    def setUp(self):
        super().setUp()
        self.take, self.cache = self.cached()
        for name in ("one", "two"):
            capture = self.settings.captures.add()
            capture.name = name
        document = files.read_json(os.path.join(self.cache, "job.json"))
        document["captures"] = [{"name": name, "tracks": f"{name}.npz"} for name in ("one", "two")]
        job_document.write(document, self.cache)
        for name, error in (("one", 3.0), ("two", 7.0)):
            places = numpy.zeros((6, 2, 3))
            files.write_npz(os.path.join(self.cache, f"compare_{name}.npz"), {
                "error_mm": numpy.full((6, 2), error), "times": numpy.arange(6) / 24.0,
                "captured": places, "labels": numpy.array(["a", "b"])})
            files.write_npz(os.path.join(self.cache, f"simulated_{name}.npz"),
                            {"positions": places, "times": numpy.arange(6) / 24.0})
        self.take.compared = True
        store(self.settings.compare, comparison.load(self.cache, "one"))
        self.assertTrue(self.settings.compare.done)

    def test_another_capture_shows_its_own_numbers(self):
        self.settings.capture_index = 1
        self.assertTrue(self.settings.compare.done)
        self.assertAlmostEqual(self.settings.compare.mean_mm, 7.0)
        self.settings.captures.add().name = "three"
        self.settings.capture_index = 2
        self.assertFalse(self.settings.compare.done)

    def test_another_take(self):
        """What was compared lies on the disk: it is there again with the take."""
        bpy.ops.matterfit.add_take()
        self.assertFalse(self.settings.compare.done)
        self.settings.take_index = 0
        self.assertTrue(self.settings.compare.done)
        self.assertAlmostEqual(self.settings.compare.mean_mm, 3.0)
        self.settings.take_index = 1
        self.settings.captures[0].location.x = 1.0
        self.settings.take_index = 0
        self.assertFalse(self.settings.compare.done, "the capture stood elsewhere")

    def test_in_a_file_of_an_older_version(self):
        """Which take was compared was not known there."""
        self.settings.takes[0].compared = False
        bpy.ops.wm.save_mainfile()
        self.reopen()
        self.assertTrue(self.settings.compare.done and self.settings.takes[0].compared)

    def test_what_a_comparison_says(self):
        """Its notes too; and that nothing was seen, in the graph as well."""
        for capture in self.settings.captures:
            capture.source, capture.object = "OBJECT", bpy.data.objects["Cube"]
        path = os.path.join(self.cache, "compare_one.npz")
        with numpy.load(path) as arrays:
            held = dict(arrays)

        def run(error):
            def work():
                files.write_npz(path, {**held, "error_mm": numpy.full((6, 2), error)})
            note = ("captures.one: points lie up to 2 m off 'Cube' at rest; are unit, transform and "
                    "start_frame right?")
            self.backend = Backend(frames=(1, 2), result={"notes": [note]}, work=work)
            self.assertEqual(bpy.ops.matterfit.compare(), {"FINISHED"}, self.error())
            self.assertTrue(self.settings.takes[0].compared)
            return bpy.context.window_manager.matterfit.last_report

        said = run(2.5)
        self.assertIn("Mean error 2.5 mm", said)
        self.assertIn("'one': points lie up to 2 m off 'Cube' at rest. Are the capture's Unit", said)
        self.assertIn("No point of the recording is seen", run(numpy.nan))
        graph = mock.Mock()
        with mock.patch.object(ui.drawing, "Graph", graph):
            ui.drawing.error_over_time((0, 0, 1, 1), 1.0, comparison.load(self.cache, "one"), 1, "Error")
        self.assertEqual(graph.return_value.labels.call_args[0][1], "–")
        self.assertEqual(graph.call_args[0][3], (0.0, 1e-9))

    def test_a_changed_capture(self):
        self.settings.captures[0].location.x = 1.0
        self.assertFalse(self.settings.compare.done)
        store(self.settings.compare, comparison.load(self.cache, "one"))
        self.settings.captures[0].unit = "MM"
        self.assertFalse(self.settings.compare.done)

    def test_a_bake(self):
        self.settings.captures.clear()
        self.assertTrue(self.settings.compare.done)
        bpy.ops.matterfit.bake()
        self.assertFalse(self.settings.compare.done)

    def test_the_take_that_was_compared(self):
        """Its numbers are not shown for a take that was chosen meanwhile."""
        takes.add(self.settings, "Other")
        for capture in self.settings.captures:
            capture.source, capture.object = "OBJECT", bpy.data.objects["Cube"]

        def choose_another():
            self.settings.take_index = 1

        self.backend = Backend(frames=(1, 2), work=choose_another)
        self.assertEqual(bpy.ops.matterfit.compare(), {"FINISHED"})
        self.assertEqual(self.settings.take_index, 1)
        self.assertFalse(self.settings.compare.done)


class VerifyTest(JobCase):
    def test_errors_arrive(self):
        """What the library raises in its thread is what the panel shows."""
        self.cached()
        with mock.patch.object(native, "inspect", side_effect=JobError("manifest.json: is damaged")):
            self.fails(bpy.ops.matterfit.verify, ["manifest.json: is damaged"])

    def test_an_error_goes_with_the_next_success(self):
        """Whatever the operator, what is shown is of what was pressed last."""
        self.cached()
        with mock.patch.object(native, "inspect", side_effect=JobError("manifest.json: is damaged")):
            self.fails(bpy.ops.matterfit.verify, ["manifest.json: is damaged"])
        self.assertNotEqual(self.error(), "")
        self.assertEqual(bpy.ops.matterfit.add_take(), {"FINISHED"})
        self.assertEqual(self.error(), "")

    def test_sound(self):
        self.cached()
        with mock.patch.object(native, "inspect", return_value={"faults": []}) as inspect:
            self.assertEqual(bpy.ops.matterfit.verify(), {"FINISHED"})
        inspect.assert_called_once()
        self.assertIn("as they were written", bpy.context.window_manager.matterfit.verify)


class ShownTest(unittest.TestCase):
    """Frames are shown while a job runs, and Cancel is heard."""

    def test_the_window_is_left_alone_after_a_slow_frame(self):
        shown = []

        class Operator(job_operator.JobOperator):
            def progressed(self, context, job):
                shown.append(job.snapshot.frame)

        operator, job = Operator(), jobs.Job("long", lambda: None)
        job.state = jobs.State.RUNNING
        context = mock.Mock(workspace=None)

        def tick(frame, *clock):
            job.snapshot = Snapshot(frame=frame)
            with mock.patch.object(job_operator.time, "monotonic", side_effect=clock):
                operator._tick(context, job)

        tick(1, 0.0, 2.0)  # it took two seconds
        tick(2, 7.0)
        self.assertEqual(shown, [1])
        tick(3, 9.0, 9.0)
        self.assertEqual(shown, [1, 3])
        job.state = jobs.State.CANCELLING
        tick(4, 20.0)
        self.assertEqual(shown, [1, 3])
