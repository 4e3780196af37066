# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the Blender tests: every `test_*.py` beside this file, in one process.

    blender -b --factory-startup --python-exit-code 1 -P blender_tests/run.py -- [--json FILE] [PATTERN …]
    python blender_tests/run.py [--json FILE] [PATTERN …]        where `import bpy` works (bpy wheels)

PATTERN picks files by name (`test_job*`). The add-on is importable as `matterfit`. The JSON file
holds {"passed": [name], "failed": [{"name", "detail"}], "skipped": [{"name", "reason"}]}.
"""

import argparse
import fnmatch
import json
import os
import sys
import traceback
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))


class CollectingResult(unittest.TextTestResult):
    """A text result that also keeps what passed, failed and was skipped, by name."""

    def __init__(self, *arguments, **options):
        super().__init__(*arguments, **options)
        self.record = {"passed": [], "failed": [], "skipped": []}

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
    parser.add_argument("patterns", nargs="*", default=[])
    options = parser.parse_args(arguments)

    sys.path[:0] = [os.path.join(os.path.dirname(HERE), "addon"), HERE]
    suite = unittest.TestSuite()
    for name in sorted(os.listdir(HERE)):
        module = name[:-3]
        wanted = not options.patterns or any(fnmatch.fnmatch(module, p) for p in options.patterns)
        if fnmatch.fnmatch(name, "test_*.py") and wanted:
            suite.addTests(unittest.defaultTestLoader.loadTestsFromName(module))
    runner = unittest.TextTestRunner(stream=sys.stderr, verbosity=2, resultclass=CollectingResult)
    result = runner.run(suite)
    if options.json:
        with open(options.json, "w", encoding="utf-8") as file:
            json.dump(result.record, file, indent=1)
    sys.stdout.flush()
    sys.stderr.flush()
    # Not sys.exit(): Blender turns a SystemExit of a script into its own status only sometimes.
    os._exit(0 if result.wasSuccessful() else 1)


main()
