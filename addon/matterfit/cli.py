# SPDX-License-Identifier: GPL-3.0-or-later
"""The verbs of the matterfit tool under Blender:

    blender -b [scene.blend] --python-exit-code 1 -P addon/matterfit/cli.py -- bake JOB.json --json

The same document, the same native code, the same exit statuses. Without JOB the open scene's
active take is written as job.json and run; with --save the scene is saved as soon as it has its
folder, `bake` then attaches and saves the result, `fit` applies what it found and saves, `diagnose`
saves the scene with its report.
"""

import argparse
import importlib
import json
import os
import sys
import tempfile

EXIT_INPUT = 2
EXIT_COMPUTE = 3
QUESTIONS = ("estimate", "validate")  # that leave nothing in the take's folder

VERBS = {
    "simulate": "write the states of every frame, and simulated.npz at the captures' points",
    "fit": "identify materials from captures, with their uncertainty",
    "diagnose": "fit, and find what the simulation gets wrong",
    "compare": "simulate if need be, and measure the error against the captures",
    "bake": "simulate and write every cache under `output`",
    "render": "simulate if need be, and draw it through cameras",
    "estimate": "memory and time that a job needs",
    "validate": "check a document and print it as it was understood",
}


def package():
    """Our package, registered: the enabled add-on where there is one, else the one around this
    file. Blender cannot have both, nor one twice."""
    import bpy
    if hasattr(bpy.types.Scene, "matterfit"):
        # matterfit.props.scene, or bl_ext.user_default.matterfit.props.scene
        name = type(bpy.data.scenes[0].matterfit).__module__
        return sys.modules[name.rsplit(".", 2)[0]]
    here = os.path.dirname(os.path.realpath(__file__))
    sys.path.insert(0, os.path.dirname(here))
    module = importlib.import_module(os.path.basename(here))
    module.register()
    return module


def parser():
    top = argparse.ArgumentParser(prog="matterfit (in Blender)", description=__doc__,
                                  formatter_class=argparse.RawDescriptionHelpFormatter)
    verbs = top.add_subparsers(dest="verb", required=True)
    for verb, help_text in VERBS.items():
        sub = verbs.add_parser(verb, help=help_text)
        sub.add_argument("job", nargs="?", metavar="JOB", help="job document (docs/formats.md); "
                         "without it, the open scene's active take")
        sub.add_argument("--take", metavar="NAME", help="without JOB: this take of the scene in "
                         "place of the active one")
        sub.add_argument("--set", action="append", default=[], metavar="PATH=VALUE",
                         help="change the document, as in scene.gravity=[0,0,-3.7]")
        sub.add_argument("--threads", type=_count, default=0, help="0: as many as the machine has")
        sub.add_argument("--target", default="auto",
                         help="instruction set: auto, sse4, avx2, avx512")
        sub.add_argument("--report", help="write the result to this file too")
        sub.add_argument("--json", action="store_true", help="print the result as JSON")
        sub.add_argument("--restart", action="store_true",
                         help="begin afresh, removing the results that the manifest lists")
        sub.add_argument("--quiet", action="store_true", help="no progress on standard error")
        sub.add_argument("--save", action="store_true",
                         help="without JOB: attach the result (fit: apply it) and save the "
                         ".blend file; its cache folder is saved before the run")
    many = verbs.add_parser("wedge", help="run a document once for each combination of the values "
                            "given with --set")
    many.add_argument("job", metavar="JOB", help="job document (docs/formats.md)")
    many.add_argument("--set", action="append", default=[], metavar="PATH=VALUE,VALUE,…",
                      help="the values of one axis, as in velocity[2]=-1,-2,-3")
    many.add_argument("--output", required=True, help="folder of the members, one each")
    many.add_argument("--jobs", type=int, default=1, help="members that run side by side")
    many.add_argument("--write", default="", choices=("slurm", "flamenco"),
                      help="run nothing, write the file of a farm beside the members")
    many.add_argument("--threads", type=_count, default=0, help="0: as many as the machine has")
    many.add_argument("--report", help="write the result to this file too")
    many.add_argument("--json", action="store_true", help="print the result as JSON")
    many.add_argument("--quiet", action="store_true", help="no progress on standard error")
    look = verbs.add_parser("inspect", help="result hash of a cache folder; checks its files")
    look.add_argument("folder", metavar="FOLDER", help="a job's output folder")
    look.add_argument("--report", help="write the result to this file too")
    look.add_argument("--json", action="store_true", help="print the result as JSON")
    return top


class Progress:
    """One line on standard error for each frame; a rewritten one where that is a terminal."""

    def __init__(self, quiet):
        self.quiet = quiet
        self.last = None

    def __call__(self, job):
        snapshot = job.snapshot
        place = (snapshot.stage, snapshot.frame)
        if self.quiet or place == self.last:
            return
        self.last = place
        frame = f"  frame {snapshot.frame} of {snapshot.last_frame}" if snapshot.last_frame else ""
        print(f"{100.0 * job.fraction:5.1f} %  {snapshot.stage}{frame}", file=sys.stderr,
              flush=True)


def give(result, arguments, files):
    """The result where it was asked for."""
    text = json.dumps(result, indent=2, ensure_ascii=False)
    if arguments.report:
        files.write_bytes(os.path.abspath(arguments.report), (text + "\n").encode("utf-8"))
    if arguments.json:
        print(text, flush=True)


def run(module, arguments):
    native = module.native
    files = importlib.import_module(module.__name__ + ".io.files")
    native.require()
    if arguments.verb == "inspect":
        found = native.inspect(os.path.abspath(arguments.folder))
        give(found, arguments, files)
        for fault in found.get("faults", []):
            print(f"matterfit: {fault['path']} {fault['what']}", file=sys.stderr)
        return EXIT_INPUT if found.get("faults") else 0
    if arguments.verb == "wedge":
        return run_wedge(module, arguments, files)
    if arguments.job:
        if arguments.take is not None:
            raise module.jobs.JobError(f"--take {arguments.take}: takes are of the open scene, and a document "
                                       "was given. Leave one of them out.")
        return run_job(module, arguments, os.path.abspath(arguments.job))
    scene_job = importlib.import_module(module.__name__ + ".scene_job")
    if arguments.take is not None:
        scene_job.choose_take(arguments.take)
    if arguments.verb in QUESTIONS:
        with tempfile.TemporaryDirectory(prefix="matterfit_") as folder:
            return run_job(module, arguments, scene_job.question(folder))
    scene = scene_job.SceneJob(arguments.verb, arguments.save)
    return run_job(module, arguments, scene.path, scene)


def _count(text):
    """A number of threads."""
    try:
        value = int(text)
    except ValueError:
        value = -1
    if value < 0:
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number, 0 or more")
    return value


def run_wedge(module, arguments, files):
    native, jobs = module.native, module.jobs
    path, folder = os.path.abspath(arguments.job), os.path.abspath(arguments.output)
    if arguments.write:
        machine = importlib.import_module(module.__name__ + ".machine")
        found = native.wedge_write(path, arguments.set, folder, arguments.write, machine.tool())
        give(found, arguments, files)
        print("\n".join(found["files"]), file=sys.stderr)
        return 0
    job = jobs.Job("wedge", lambda: native.wedge_start(path, arguments.set, folder, arguments.jobs,
                                                       arguments.threads))
    jobs.registry.add(job)
    job.run(on_tick=Progress(arguments.quiet))
    if job.error:
        print(f"matterfit: {job.error}", file=sys.stderr)
    for member in job.result.get("members", []):
        print(f"{member['status']:9}  {member['label']}", file=sys.stderr)
    give(job.result or {"status": "error", "error": job.error, "exit_status": job.status},
         arguments, files)
    return job.status


def run_job(module, arguments, path, scene=None):
    """Runs a document; `scene` is the SceneJob that it comes from."""
    native, jobs = module.native, module.jobs
    files = importlib.import_module(module.__name__ + ".io.files")
    if arguments.verb in QUESTIONS:
        function = getattr(native, arguments.verb)
        give(function(files.read_text(path), os.path.dirname(path), arguments.threads, arguments.set,
                      arguments.target), argparse.Namespace(report=arguments.report, json=True), files)
        return 0
    job = jobs.Job(arguments.verb, lambda: native.start(
        path, task=arguments.verb, threads=arguments.threads, restart=arguments.restart,
        target=arguments.target, overrides=arguments.set))
    jobs.registry.add(job)
    job.run(on_tick=Progress(arguments.quiet))
    if job.error:
        print(f"matterfit: {job.error}", file=sys.stderr)
    result = job.result or {"status": "error", "error": job.error, "exit_status": job.status}
    give(result, arguments, files)
    if scene is not None:
        scene.end(job)
    return job.status


def main():
    arguments = parser().parse_args(
        sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else [])
    try:
        module = package()
    except Exception as error:  # whatever it is, the caller must not see status 0
        print(f"matterfit: the add-on could not be loaded: {error}", file=sys.stderr)
        return EXIT_COMPUTE
    try:
        return run(module, arguments)
    except module.jobs.JobError as error:
        print(f"matterfit: {error}", file=sys.stderr)
        if getattr(arguments, "json", False):
            print(json.dumps({"status": "error", "error": str(error),
                              "exit_status": error.status}, indent=2), flush=True)
        return error.status
    finally:
        module.jobs.registry.stop_all()


if __name__ == "__main__":
    sys.stdout.flush()
    try:
        status = main()
    except SystemExit as stop:  # argparse: usage or --help
        status = stop.code if isinstance(stop.code, int) else EXIT_INPUT
    sys.stdout.flush()
    sys.stderr.flush()
    # Not sys.exit(): the bpy wheels (4.5 seen) can wait for ever for a thread of their own in the
    # destructors that follow. Everything of ours is written and closed by now.
    os._exit(status)
