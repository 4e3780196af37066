# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the Blender tests: every `test_*.py` beside this file, in one process.

    blender -b --factory-startup --python-exit-code 1 -P blender_tests/run.py -- [OPTION …] [PATTERN …]
    python blender_tests/run.py [OPTION …] [PATTERN …]           where `import bpy` works (bpy wheels)

PATTERN picks files by name (`test_job*`), --without PATTERN leaves some out. The add-on is importable
as `matterfit`. The JSON file holds {"passed": [name], "failed": [{"name", "detail"}],
"skipped": [{"name", "reason"}], "seconds": {file: of all its tests}}; the slowest files are said at the
end.
"""

import argparse
import fnmatch
import json
import os
import sys
import time
import traceback
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
SLOWEST = 12  # files that are said


class CollectingResult(unittest.TextTestResult):
    """A text result that also keeps what passed, failed and was skipped, by name."""

    def __init__(self, *arguments, **options):
        super().__init__(*arguments, **options)
        self.record = {"passed": [], "failed": [], "skipped": [], "seconds": {}}

    def startTest(self, test):
        self._begun = time.monotonic()
        super().startTest(test)

    def stopTest(self, test):
        super().stopTest(test)
        seconds, file = self.record["seconds"], test.id().split(".")[0]
        seconds[file] = seconds.get(file, 0.0) + time.monotonic() - self._begun

    def addSuccess(self, test):
        super().addSuccess(test)
        self.record["passed"].append(test.id())

    def addError(self, test, err):
        super().addError(test, err)
        self._failed(test, err)

    def addFailure(self, test, err):
        super().addFailure(test, err)
        self._failed(test, err)

    def addSubTest(self, test, subtest, err):
        super().addSubTest(test, subtest, err)
        if err is not None:
            self._failed(subtest, err)

    def addSkip(self, test, reason):
        super().addSkip(test, reason)
        self.record["skipped"].append({"name": test.id(), "reason": reason})

    def addExpectedFailure(self, test, err):
        super().addExpectedFailure(test, err)
        self.record["passed"].append(test.id())

    def addUnexpectedSuccess(self, test):
        super().addUnexpectedSuccess(test)
        self.record["failed"].append({"name": test.id(), "detail": "passed, but marked to fail"})

    def _failed(self, test, err):
        detail = "".join(traceback.format_exception(*err))
        self.record["failed"].append({"name": test.id(), "detail": detail})


def main():
    arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
    if "--" not in sys.argv and "blender" not in os.path.basename(sys.argv[0]):
        arguments = sys.argv[1:]
    parser = argparse.ArgumentParser(prog="run.py")
    parser.add_argument("--json")
    parser.add_argument("--without", action="append", default=[], metavar="PATTERN")
    parser.add_argument("patterns", nargs="*", default=[])
    options = parser.parse_args(arguments)

    sys.path[:0] = [os.path.join(os.path.dirname(HERE), "addon"), HERE]
    suite = unittest.TestSuite()
    for name in sorted(os.listdir(HERE)):
        module = name[:-3]
        wanted = not options.patterns or any(fnmatch.fnmatch(module, p) for p in options.patterns)
        left_out = any(fnmatch.fnmatch(module, p) for p in options.without)
        if fnmatch.fnmatch(name, "test_*.py") and wanted and not left_out:
            suite.addTests(unittest.defaultTestLoader.loadTestsFromName(module))
    runner = unittest.TextTestRunner(stream=sys.stderr, verbosity=2, resultclass=CollectingResult)
    result = runner.run(suite)
    seconds = result.record["seconds"]
    for file in sorted(seconds, key=seconds.get, reverse=True)[:SLOWEST]:
        print(f"  {file:24} {seconds[file]:6.1f} s", file=sys.stderr)
    if options.json:
        with open(options.json, "w", encoding="utf-8") as file:
            json.dump(result.record, file, indent=1)
    sys.stdout.flush()
    sys.stderr.flush()
    # Not sys.exit(): Blender turns a SystemExit of a script into its own status only sometimes.
    os._exit(0 if result.wasSuccessful() else 1)


main()
