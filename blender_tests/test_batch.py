# SPDX-License-Identifier: GPL-3.0-or-later
"""Batch: what can be varied, documents and farm files, results as takes, Free."""

import json
import os
import shutil
import unittest

import bpy
import numpy
import slurm_machine
from matterfit import machine, native
from matterfit.io import batch, batch_results, cache, files, fit_rows, job_document, takes
from support import SceneCase, printed_json, read, run_cli, tree
from test_filling import pressed


class BatchCase(SceneCase):
    def setUp(self):
        super().setUp()
        self.jelly(separation=0.05)
        self.scene.frame_end = 3
        self.batch = self.settings.batch

    @staticmethod
    def stamps(folder):
        """When each file was written, without the document, which every run writes."""
        return {name: os.stat(os.path.join(folder, name)).st_mtime_ns for name in os.listdir(folder)
                if name != "job.json"}

    def vary(self, owner, key, values):
        bpy.ops.matterfit.add_axis(quantity=f"{owner}\t{key}")
        self.batch.axes[len(self.batch.axes) - 1].values = values


class AxisTest(BatchCase):
    def test_candidates(self):
        keys = {(owner, key) for owner, key, _label in batch.candidates(self.settings)}
        self.assertLessEqual({("Cube", "material.E"), ("Cube", "velocity[2]"), ("", "gravity[0]"),
                              ("ground", "contact.mu"), ("", "particle_separation")}, keys)
        self.assertFalse({key for _owner, key in keys if "start_frame" in key or "height" in key})

    def test_assignments(self):
        self.assertEqual(batch.combinations(self.settings), 0)
        self.vary("Cube", "velocity[2]", " -1, -2,")
        self.vary("Cube", "material.E", "1e4")
        self.assertEqual(batch.combinations(self.settings), 2)
        document, _folder = self.document()
        self.assertEqual(batch.assignments(self.settings, document["scene"]),
                         ["bodies.Cube.velocity[2]=-1,-2", "bodies.Cube.material.E=1e4"])
        self.batch.axes[0].values = "-0, 1, -1e-3"
        self.assertEqual(batch.assignments(self.settings, document["scene"])[0],
                         "bodies.Cube.velocity[2]=0,1,-1e-3")
        # As people type them, and the document does not have them.
        self.batch.axes[0].values = ".5, -.25, +2, 3., 007"
        self.assertEqual(batch.assignments(self.settings, document["scene"])[0],
                         "bodies.Cube.velocity[2]=0.5,-0.25,2.0,3.0,7.0")

    def test_refused(self):
        document, _folder = self.document()
        with self.assertRaisesRegex(batch.JobError, "nothing is varied"):
            batch.assignments(self.settings, document["scene"])
        self.vary("Cube", "velocity[2]", "-1, two")
        with self.assertRaisesRegex(batch.JobError, "'two' among its values"):
            batch.assignments(self.settings, document["scene"])
        for values, words in ((" , ", "Cube Velocity Z has no values yet"), ("1, 2, 1.0", "the value 1.0 twice"),
                              ("1, nan", "'nan' among"), ("1,,2", "a comma with nothing before it"),
                              (",1", "a comma with nothing"), ("0, -0.0", "the value -0.0 twice"),
                              ("1_0", "'1_0' among"),
                              (",".join(map(str, range(10001))), "10001 combinations are more than 10000")):
            self.batch.axes[0].values = values
            with self.assertRaisesRegex(batch.JobError, words):
                batch.assignments(self.settings, document["scene"])
        self.batch.axes[0].values = "1"
        self.fails(bpy.ops.matterfit.add_axis, ["varied already"], quantity="Cube\tvelocity[2]")
        self.batch.axes[0].owner = "Gone"
        with self.assertRaisesRegex(batch.JobError, "not in the scene any more"):
            batch.assignments(self.settings, document["scene"])


@unittest.skipUnless(native.load(), native.load_error())
class RunTest(BatchCase):
    def test_results_are_takes(self):
        self.vary("Cube", "velocity[2]", "-1,-2")
        bpy.ops.matterfit.run_batch()
        names = [take.name for take in self.settings.takes]
        self.assertEqual(names[1:], ["Velocity Z = -1", "Velocity Z = -2"])
        take = self.settings.takes[2]
        self.assertTrue(take.baked and take.collection.all_objects)
        folder = takes.locate(take).folder
        self.assertEqual(json.loads(read(folder, "job.json"))["scene"]["bodies"][0]["velocity"][2],
                         -2)
        self.assertEqual(takes.find(folder)[1], take)
        stamp = os.stat(os.path.join(folder, "manifest.json")).st_mtime_ns
        # Pressed again, with one value more: what is finished is kept.
        self.batch.axes[0].values = "-1,-2,-3"
        bpy.ops.matterfit.run_batch()
        self.assertEqual(len(self.settings.takes), 4)
        self.assertEqual(os.stat(os.path.join(folder, "manifest.json")).st_mtime_ns, stamp)

    def test_a_bake_leaves_a_member_alone(self):
        self.vary("Cube", "velocity[2]", "-1")
        bpy.ops.matterfit.run_batch()
        self.settings.take_index = 1
        self.fails(bpy.ops.matterfit.resume, ["one of a batch"])
        folder = takes.locate(self.settings.takes[1]).folder
        bpy.ops.matterfit.bake()
        self.assertEqual(len(self.settings.takes), 3, "a bake makes a take of its own")
        self.assertEqual(takes.locate(self.settings.takes[1]).folder, folder)

    def test_write_jobs(self):
        self.vary("Cube", "material.E", "1e4,2e4")
        for farm, names in (("SLURM", ["slurm.sh"]),
                            ("FLAMENCO", ["flamenco.json", "matterfit_wedge.js"])):
            self.batch.farm = farm
            bpy.ops.matterfit.write_batch()
            folder = takes.locate(self.batch.run).folder
            for name in names:
                self.assertTrue(os.path.isfile(os.path.join(folder, name)), name)
        self.assertEqual(len(self.settings.takes), 1)
        bpy.ops.matterfit.show_batch()
        self.assertEqual(len(self.settings.takes), 1, "nothing is finished yet")
        bpy.ops.matterfit.free_batch()
        self.assertFalse(os.path.exists(folder))

    def test_refused_it_claims_no_folder(self):
        self.vary("Cube", "velocity[2]", "two")
        for press in (bpy.ops.matterfit.run_batch, bpy.ops.matterfit.write_batch):
            self.fails(press, ["'two' among its values"])
            self.assertEqual(self.batch.run.folder, "")
            self.assertFalse(bpy.ops.matterfit.free_batch.poll(), "there is no batch to delete")
        self.assertEqual([name for name in os.listdir(self.folder) if name.startswith("cache_")], [])
        self.batch.axes[0].values = "-1"
        bpy.ops.matterfit.write_batch()
        folder = takes.locate(self.batch.run).folder
        before = tree(folder)
        self.batch.axes[0].values = "two"
        self.fails(bpy.ops.matterfit.write_batch, ["'two' among its values"])
        self.assertEqual((takes.locate(self.batch.run).folder, tree(folder)), (folder, before))

    def test_all_are_checked_before_any_runs(self):
        self.vary("Cube", "material.nu", "0.3,0.7")
        self.fails(bpy.ops.matterfit.run_batch, ["Poisson's Ratio has the value 0.7; its field takes from"])
        self.assertEqual(len(self.settings.takes), 1)

    def test_free(self):
        self.vary("Cube", "velocity[2]", "-1,-2")
        bpy.ops.matterfit.run_batch()
        folder = takes.locate(self.batch.run).folder
        bpy.ops.matterfit.free_batch()
        self.assertEqual([take.name for take in self.settings.takes], ["Take 1"])
        self.assertFalse(os.path.exists(folder))
        self.assertEqual(cache.name_of(self.batch.run), "")

    def test_free_after_other_values(self):
        """Those of the values before are the batch's too; what somebody laid there is not."""
        self.vary("Cube", "velocity[2]", "-1")
        bpy.ops.matterfit.run_batch()
        self.batch.axes[0].values = "-2"
        bpy.ops.matterfit.run_batch()
        folder = takes.locate(self.batch.run).folder
        os.makedirs(os.path.join(folder, "notes=mine"))
        with open(os.path.join(folder, "notes=mine", "read me"), "w", encoding="utf-8") as stream:
            stream.write("kept")
        bpy.ops.matterfit.free_batch()
        self.assertEqual([name for _base, _folders, names in os.walk(folder) for name in names],
                         ["read me"])
        self.assertEqual([take.name for take in self.settings.takes], ["Take 1"])


    def test_free_what_is_damaged_or_a_copy(self):
        """A member whose manifest is broken keeps what it has, the others go; a copy made by hand is
        nobody's but who made it."""
        self.vary("Cube", "velocity[2]", "-1,-2")
        bpy.ops.matterfit.run_batch()
        folder = takes.locate(self.batch.run).folder
        broken, copy = (os.path.join(folder, f"bodies.Cube.velocity.2={name}") for name in ("-1", "-2 kept"))
        shutil.copytree(os.path.join(folder, "bodies.Cube.velocity.2=-2"), copy)
        before = tree(copy)
        with open(os.path.join(broken, "manifest.json"), "r+b") as stream:
            stream.truncate(40)
        for _press in range(2):
            self.assertEqual(bpy.ops.matterfit.free_batch(), {"FINISHED"}, self.error())
            self.assertEqual(tree(copy), before)
            self.assertEqual(sorted(os.listdir(folder)), list(map(os.path.basename, (broken, copy))))
        self.assertEqual([take.name for take in self.settings.takes], ["Take 1"])

    def test_names_of_members(self):
        """Those that the library gives, also where they are long."""
        long = "bodies.Cube.material.E=" + "1" * 97
        for name in ("bodies.Cube.velocity.2=-1", "a=1e-3_b.c=2.5", "a=.5", long, long + "_2"):
            self.assertTrue(batch._is_member(name), name)
        for name in ("a=1 copy", "a=1_old", "a=1.bak", "notes=mine", "a=1_2", "velocity", long + " copy"):
            self.assertFalse(batch._is_member(name), name)
        self.vary("Cube", "material.E", "1e4,2.5e4")
        self.vary("Cube", "velocity[2]", "-1,-.5")
        self.assertEqual(bpy.ops.matterfit.write_batch(), {"FINISHED"}, self.error())
        folder, wedge = batch.written(self.batch.run)
        self.assertEqual(sorted(map(os.path.basename, batch._every_member(folder))),
                         sorted(member["folder"] for member in wedge["members"]))


class RecordedBatch(BatchCase):
    """With a recording of a free fall that begins at -2 m/s."""

    def setUp(self):
        super().setUp()
        corners = numpy.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.1, 0.1)
                               for z in (0.4, 0.6)])
        times = numpy.arange(3) / 24.0
        fall = numpy.outer(times, (0.0, 0.0, -2.0)) + numpy.outer(times**2, (0.0, 0.0, -4.905))
        files.write_npz(os.path.join(self.folder, "clip.npz"),
                        {"positions": corners + fall[:, None], "times": times})
        capture = self.settings.captures.add()
        capture.name, capture.filepath = "clip", "//clip.npz"
        capture.use_noise, capture.noise = True, 5e-4

    def listed(self):
        return [(row.name, row.error) for row in self.batch.results]


@unittest.skipUnless(native.load(), native.load_error())
class CompareTest(RecordedBatch):
    def setUp(self):
        super().setUp()
        self.batch.task = "COMPARE"

    def test_the_best_first(self):
        """Takes that can be seen, with the error of each; that of a single comparison."""
        self.vary("Cube", "velocity[2]", "-1,-4,-2")
        self.assertEqual(bpy.ops.matterfit.run_batch(), {"FINISHED"}, self.error())
        names, errors = zip(*self.listed(), strict=True)
        self.assertEqual(names, ("-2", "-1", "-4"))
        self.assertEqual(self.batch.varied, "Velocity Z")
        self.assertLess(errors[0], 1.0)
        # Metres a second off, over 0, 1 and 2 frames.
        for error, off in ((errors[1], 1.0), (errors[2], 2.0)):
            self.assertAlmostEqual(error, 1e3 * off / 24.0, delta=1.0)
        self.assertIn("Best: -2 with", bpy.context.window_manager.matterfit.last_report)
        found = {take.name: batch_results.error_of(self.settings, take)
                 for take in self.settings.takes}
        self.assertEqual(found, {"Take 1": -1.0, "Velocity Z = -1": errors[1],
                                 "Velocity Z = -2": errors[0], "Velocity Z = -4": errors[2]})
        self.assertEqual({take.name for take in self.settings.takes if take.baked},
                         {"Velocity Z = -1", "Velocity Z = -2", "Velocity Z = -4"})
        self.assertTrue(all(take.collection.all_objects for take in self.settings.takes
                            if take.baked))
        self.settings.take_index = 0
        bpy.ops.matterfit.compare()
        self.assertAlmostEqual(self.settings.compare.mean_mm, 1e3 * 2.0 / 24.0, delta=1.0)

    def test_a_row_shows_its_take(self):
        """With its heat-map."""
        self.vary("Cube", "velocity[2]", "-1,-2")
        bpy.ops.matterfit.run_batch()
        for index, name in enumerate(("Velocity Z = -2", "Velocity Z = -1")):
            self.batch.result_index = index
            self.assertEqual(self.settings.takes[self.settings.take_index].name, name)
            self.assertTrue(self.settings.compare.done)
            self.assertAlmostEqual(self.settings.compare.mean_mm, self.batch.results[index].error,
                                   places=3)

    def test_pressed_again_what_is_finished_is_left_alone(self):
        """It is not read either: a run that only reads states writes its result anew."""
        self.vary("Cube", "velocity[2]", "-1")
        bpy.ops.matterfit.run_batch()
        folder = takes.locate(self.settings.takes[1]).folder
        before = self.stamps(folder)
        self.assertLessEqual({"result.json", "report.json", "manifest.json", "state"}, set(before))
        error = self.listed()[0][1]
        self.batch.axes[0].values = "-1,-2"
        bpy.ops.matterfit.run_batch()
        self.assertEqual([name for name, _error in self.listed()], ["-2", "-1"])
        self.assertEqual(self.listed()[1][1], error)
        self.assertEqual(self.stamps(folder), before)

    def test_another_recording_is_compared_with(self):
        """Under the name of the one before."""
        self.vary("Cube", "velocity[2]", "-2")
        bpy.ops.matterfit.run_batch()
        path = os.path.join(self.folder, "clip.npz")
        with numpy.load(path) as arrays:
            clip = {name: arrays[name] for name in arrays}
        clip["positions"] = clip["positions"] + [0.02, 0.0, 0.0]
        clip["positions"][0, :, 0] -= 0.02
        files.write_npz(path, clip)
        bpy.ops.matterfit.run_batch()
        self.assertAlmostEqual(self.listed()[0][1], 20.0 * 2.0 / 3.0, delta=1.0)

    def test_one_that_fails_leaves_the_others_compared(self):
        self.settings.solver.memory_limit = 0.1
        self.vary("", "particle_separation", "0.0028,0.05")
        self.fails(bpy.ops.matterfit.run_batch, ["Particle Separation = 0.0028: ", "the limit is 0.1 GB"])
        self.assertEqual([name for name, _error in self.listed()], ["0.05", "0.0028"])
        self.assertGreaterEqual(self.batch.results[0].error, 0.0)
        self.assertEqual(self.batch.results[1].error, -1.0)
        self.assertEqual([take.name for take in self.settings.takes][1:],
                         ["Particle Separation = 0.05"])

    def test_another_choice_while_it_runs(self):
        """What is shown at the end is what was run."""
        self.vary("Cube", "velocity[2]", "-2")
        stub, job = pressed("run_batch")
        self.batch.task = "FIT"
        job.join()
        stub._finish(bpy.context, job)
        self.assertEqual([name for name, _error in self.listed()], ["-2"])
        self.assertLess(self.batch.results[0].error, 1.0)
        self.assertGreaterEqual(self.batch.results[0].error, 0.0)

    def test_without_a_recording(self):
        self.settings.captures[0].enabled = False
        self.vary("Cube", "velocity[2]", "-1")
        self.fails(bpy.ops.matterfit.run_batch, ["no capture to compare with"])
        self.fails(bpy.ops.matterfit.write_batch, ["no capture to compare with"])

    def test_written_for_a_farm(self):
        self.vary("Cube", "velocity[2]", "-1,-2")
        self.batch.farm = "SLURM"
        bpy.ops.matterfit.write_batch()
        folder = takes.locate(self.batch.run).folder
        self.assertIn('"$tool" compare', read(folder, "slurm.sh").decode())
        # What the farm does, without one.
        for member in batch.written(self.batch.run)[1]["members"]:
            done = run_cli("compare", os.path.join(folder, member["folder"], "job.json"))
            self.assertEqual(done.returncode, 0, done.stderr)
        bpy.ops.matterfit.show_batch()
        self.assertEqual([name for name, _error in self.listed()], ["-2", "-1"])
        # Each was baked and compared: takes that can be seen, with their heat-map.
        self.assertEqual([(take.name, take.baked, take.compared) for take in self.settings.takes][1:],
                         [("Velocity Z = -1", True, True), ("Velocity Z = -2", True, True)])
        self.assertTrue(all(take.collection.all_objects for take in list(self.settings.takes)[1:]))

    def test_free(self):
        self.vary("Cube", "velocity[2]", "-1")
        bpy.ops.matterfit.run_batch()
        folder = takes.locate(self.batch.run).folder
        bpy.ops.matterfit.free_batch()
        self.assertFalse(os.path.exists(folder))
        self.assertEqual(len(self.batch.results), 0)
        self.assertEqual(bpy.context.window_manager.matterfit.last_report, "", "what it had said of them")


@unittest.skipUnless(native.load(), native.load_error())
class FitTest(RecordedBatch):
    def setUp(self):
        super().setUp()
        self.batch.task = "FIT"
        fit_rows.refresh(self.settings)
        for row in self.settings.fit.parameters:
            row.enabled = row.key == "velocity"
        self.settings.fit.windows, self.settings.fit.levels = False, 1

    def test_write_jobs(self):
        """A fit each, apart from what is baked, that begins at the values."""
        self.vary("Cube", "velocity[2]", "-1,-3")
        self.batch.farm = "SLURM"
        self.assertEqual(bpy.ops.matterfit.write_batch(), {"FINISHED"}, self.error())
        self.assertEqual(self.batch.run.folder, "")
        folder, wedge = batch.written(self.batch.fits)
        self.assertEqual(wedge["task"], "fit")
        self.assertIn('"$tool" fit', read(folder, "slurm.sh").decode())
        for member, value in zip(wedge["members"], (-1, -3), strict=True):
            document = json.loads(read(folder, member["folder"], "job.json"))
            self.assertEqual(document["fit"]["parameters"], ["bodies.Cube.velocity"])
            self.assertEqual(document["scene"]["bodies"][0]["velocity"][2], value)
        bpy.ops.matterfit.show_batch()
        self.assertEqual([error for _name, error in self.listed()], [-1.0, -1.0])
        bpy.ops.matterfit.free_batch()
        self.assertFalse(os.path.exists(folder))

    def test_run_here(self):
        self.vary("Cube", "material.E", "5e4,1e5")
        self.assertEqual(bpy.ops.matterfit.run_batch(), {"FINISHED"}, self.error())
        self.assertTrue(all(0.0 <= error < 1.0 for _name, error in self.listed()), self.listed())
        self.assertIn("2 of 2 are fitted", bpy.context.window_manager.matterfit.last_report)
        self.assertEqual(len(self.settings.takes), 1, "a fit is no take")
        # What was given is applied beside what was found.
        row = next(i for i, row in enumerate(self.batch.results) if row.name == "5e4")
        self.batch.result_index = row
        body = self.settings.bodies[0]
        body.velocity = (0.0, 0.0, 0.0)
        self.assertEqual(bpy.ops.matterfit.apply_batch(), {"FINISHED"}, self.error())
        self.assertAlmostEqual(body.velocity[2], -2.0, places=2)
        self.assertEqual(body.material.E, 5e4)
        self.batch.task = "BAKE"
        self.assertFalse(bpy.ops.matterfit.apply_batch.poll())
        folder = takes.locate(self.batch.fits).folder
        bpy.ops.matterfit.free_batch()
        self.assertFalse(os.path.exists(folder))


class ErrorTest(BatchCase):
    def test_of_several_captures(self):
        """The error is that of all samples, not of the captures' means."""
        files.write_json(os.path.join(self.folder, "report.json"), {"compare": {"captures": [
            {"mean_mm": 1.0, "samples": 30}, {"mean_mm": 5.0, "samples": 10}, {"samples": 0}]}})
        self.assertAlmostEqual(batch_results.compare_error(self.folder), 2.0)

    def test_none(self):
        self.assertIsNone(batch_results.compare_error(self.folder))
        self.assertIsNone(batch_results.fit_error(self.folder))
        for name in ("report.json", "result.json"):
            files.write_bytes(os.path.join(self.folder, name), b"{")
        self.assertIsNone(batch_results.compare_error(self.folder))
        self.assertIsNone(batch_results.fit_error(self.folder))

    def test_names(self):
        self.body(self.cube("Second"))
        for path, name in (("particle_separation", "Particle Separation"), ("gravity[2]", "Gravity Z"),
                           ("bodies.Second.material.E", "Second: Young's Modulus"),
                           ("colliders.ground.contact.mu", "Ground: Friction")):
            self.assertEqual(batch_results.axis_name(self.settings, path), name)


@unittest.skipUnless(native.load(), native.load_error())
class SlurmTest(BatchCase):
    def test_eight_throws(self):
        """An array job on this machine; its results stand beside each other as takes."""
        if not os.path.isfile(machine.tool()):
            self.skipTest("the matterfit program was not built")
        self.vary("Cube", "velocity[2]", "-1,-2,-3,-4")
        self.vary("Cube", "material.E", "1e4,2e4")
        self.batch.farm = "SLURM"
        bpy.ops.matterfit.write_batch()
        folder = takes.locate(self.batch.run).folder
        home = os.path.join(self.folder, "slurm")
        os.makedirs(home)
        try:
            with slurm_machine.Machine(home) as slurm:
                done = slurm.run("sbatch", "--wait", os.path.join(folder, "slurm.sh"))
        except slurm_machine.CannotRun as reason:
            if slurm_machine.is_required():
                raise
            self.skipTest(f"Slurm cannot run here: {reason}")
        self.assertEqual(done.returncode, 0, done.stderr)
        bpy.ops.matterfit.show_batch()
        members = list(self.settings.takes)[1:]
        self.assertEqual(len(members), 8)
        self.assertEqual(members[1].name, "Velocity Z = -1, Young's Modulus = 2e4")
        self.assertEqual(len({take.collection for take in members}), 8)
        # What Slurm made is what the panel would: nothing is left to do.
        folders = [takes.locate(take).folder for take in members]
        before = [self.stamps(folder) for folder in folders]
        bpy.ops.matterfit.run_batch()
        self.assertEqual(len(self.settings.takes), 9)
        self.assertEqual([self.stamps(folder) for folder in folders], before)


@unittest.skipUnless(native.load(), native.load_error())
class CommandTest(BatchCase):
    def test_wedge(self):
        """cli.py runs a written document as the tool does."""
        document, folder = self.document()
        path = job_document.write(document, folder)
        found = printed_json(run_cli("wedge", path, "--set", "velocity[2]=-1,-2", "--output",
                                     os.path.join(self.folder, "wedge"), "--json"))
        self.assertEqual([member["status"] for member in found["members"]], ["done", "done"])
        done = run_cli("wedge", path, "--set", "velocity[2]=-1,x", "--output",
                       os.path.join(self.folder, "other"))
        self.assertEqual(done.returncode, 2)
        self.assertIn("velocity[2] = x", done.stderr)
        self.assertFalse(os.path.exists(os.path.join(self.folder, "other")))
