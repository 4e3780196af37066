# SPDX-License-Identifier: GPL-3.0-or-later
"""What Write Jobs gives a farm: a script for Slurm, a job and its type for Flamenco 3."""

import json
import os
import re
import shutil
import subprocess
import unittest

import bpy
from matterfit.io import takes
from support import needs_library, read
from test_batch import BatchCase

# The properties of SubmittedJob in Flamenco 3's OpenAPI document (POST /api/v3/jobs), and the types
# that a job type may name for its settings.
SUBMITTED_JOB = {"name": str, "type": str, "type_etag": str, "priority": int, "settings": dict,
                 "metadata": dict, "submitter_platform": str, "storage": dict, "worker_tag": str,
                 "initial_status": str, "delete_requested_at": str}
REQUIRED = {"name", "type", "submitter_platform"}
PLATFORMS = {"linux", "windows", "darwin", "manager"}
SETTING_TYPES = {"string": str, "int32": int, "float": float, "bool": bool}
TASK_TYPES = {"blender", "ffmpeg", "file-management", "misc"}
# Stands for the Manager: calls compileJob as it does and prints what the workers would get.
MANAGER = """
const tasks = [];
const author = {
    Task: (name, type) => {
        const task = { name, type, commands: [] };
        return { task, addCommand: (command) => task.commands.push(command) };
    },
    Command: (name, parameters) => ({ name, parameters }),
};
const job = JSON.parse(require("fs").readFileSync(process.argv[2], "utf-8"));
job.addTask = (added) => tasks.push(added.task);
compileJob(job);
console.log(JSON.stringify({ type: JOB_TYPE, tasks }));
"""


class FlamencoTest(BatchCase):
    def setUp(self):
        super().setUp()
        self.vary("Cube", "velocity[2]", "-1,-2")
        self.batch.farm = "FLAMENCO"

    def written(self):
        """(folder, the job that is submitted)"""
        bpy.ops.matterfit.write_batch()
        folder = takes.locate(self.batch.run).folder
        return folder, json.loads(read(folder, "flamenco.json"))

    @needs_library
    def test_the_job_that_is_submitted(self):
        folder, job = self.written()
        self.assertLessEqual(REQUIRED, set(job))
        for key, value in job.items():
            self.assertIs(type(value), SUBMITTED_JOB[key], key)
        self.assertIn(job["submitter_platform"], PLATFORMS)
        self.assertTrue(1 <= job["priority"] <= 100)
        self.assertEqual(job["settings"]["folder"], folder)
        members = json.loads(job["settings"]["members"])
        for member in members:
            self.assertTrue(os.path.isfile(os.path.join(folder, member, "job.json")))
        self.assertEqual(len(members), 2)

    @needs_library
    def test_the_type_that_it_names(self):
        """The Manager names a type by its file, with - for _; each setting of the job is declared, flat and
        of the declared type, and none that is required is missing."""
        folder, job = self.written()
        script, = (name for name in os.listdir(folder) if name.endswith(".js"))
        self.assertEqual(script[:-3].replace("_", "-"), job["type"])
        text = read(folder, script).decode()
        declared = dict(re.findall(r'\{ key: "(\w+)", type: "(\w+)"', text))
        self.assertEqual(set(declared), set(job["settings"]))
        for key, value in job["settings"].items():
            self.assertIs(type(value), SETTING_TYPES[declared[key]], key)

    @needs_library
    @unittest.skipUnless(shutil.which("node"), "there is no node to run Flamenco's job type")
    def test_what_the_workers_run(self):
        """A task a member, of a type and with a command that every worker knows; each, run as it stands,
        bakes its member."""
        folder, job = self.written()
        manager = os.path.join(folder, "manager.js")
        with open(manager, "w", encoding="utf-8") as stream:
            stream.write(read(folder, "matterfit_wedge.js").decode() + MANAGER)
        done = subprocess.run(["node", manager, os.path.join(folder, "flamenco.json")], capture_output=True,
                              text=True, check=True)
        compiled = json.loads(done.stdout)
        self.assertEqual({row["key"] for row in compiled["type"]["settings"] if row["required"]},
                         set(job["settings"]))
        self.assertEqual([task["name"] for task in compiled["tasks"]],
                         json.loads(job["settings"]["members"]))
        for task in compiled["tasks"]:
            self.assertIn(task["type"], TASK_TYPES)
            command, = task["commands"]
            self.assertEqual((command["name"], set(command["parameters"])), ("exec", {"exe", "args"}))
            subprocess.run([command["parameters"]["exe"], *command["parameters"]["args"]], check=True,
                           capture_output=True, timeout=300)
            baked = os.listdir(os.path.join(folder, task["name"]))
            self.assertIn("job.json", baked)
            self.assertGreater(len(baked), 3)


class SlurmScriptTest(BatchCase):
    @needs_library
    def test_slurm_script_alone(self):
        """Without Slurm a member runs by its number; MATTERFIT names another program."""
        self.vary("Cube", "velocity[2]", "-1,-2")
        self.batch.farm = "SLURM"
        bpy.ops.matterfit.write_batch()
        folder = takes.locate(self.batch.run).folder
        done = subprocess.run(["bash", os.path.join(folder, "slurm.sh"), "1"], capture_output=True,
                              text=True, check=True, env={**os.environ, "MATTERFIT": "/bin/echo"})
        self.assertEqual(done.stdout.split()[:2],
                         ["bake", os.path.join(folder, "bodies.Cube.velocity.2=-2", "job.json")])
