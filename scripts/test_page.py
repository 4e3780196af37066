# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests of a diagnosis's page in a browser: small diagnoses are made, and their pages looked at in headless
Chromium.

    scripts/in_tree.sh python scripts/test_page.py

Pictures lie in build/screenshots. Skipped where Chromium is not installed.
"""

import json
import math
import os
import pathlib
import re
import shutil
import subprocess
import unittest

import chromium
import numpy as np
from parts import BUILD, ROOT, require_in_tree

TOOL = pathlib.Path(os.environ.get("MATTERFIT_TOOL", BUILD / "bin" / "matterfit"))
WORK = BUILD / "page"
PICTURES = BUILD / "screenshots"
WIDTHS = {"desktop": (1280, 900, False), "phone": (390, 844, True)}
LEAST = 20_000  # bytes of a picture that shows something
NOISE = 5e-4
FRAMES = 16

# The texts of a page and what stands beside each: the number of the report that it shows, if it is one.
TEXTS = """(() => {
  const found = [], walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    const text = walk.currentNode.textContent.trim(), marked = walk.currentNode.parentElement.closest("[data-value]");
    if (text) found.push([text, marked ? marked.dataset.value : null]);
  }
  return found;
})()"""
SHAPE = """({width: document.documentElement.scrollWidth, window: window.innerWidth,
  beyond: [...document.querySelectorAll("body *")].filter(e => !e.closest(".scroll")
    && e.getBoundingClientRect().right > window.innerWidth + 1).map(e => e.tagName + "." + e.className)})"""


def tool(*arguments):
    done = subprocess.run([str(a) for a in (TOOL, *arguments)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          text=True, check=False)
    if done.returncode != 0:
        raise AssertionError(f"{' '.join(map(str, arguments))}: {done.stdout[-800:]}")


def thrown_cube():
    """A light cube of 64 particles in flight."""
    return {
        "schema": "matterfit.job/1", "task": "simulate",
        "scene": {"fps": 24, "frames": [0, FRAMES], "particle_separation": 0.1, "bodies": [{
            "name": "cube", "density": 20, "velocity": [5.0, 2.0, 1.0],
            "source": {"box": {"low": [0, 0, 5.1], "high": [0.4, 0.4, 5.5]}},
            "material": {"law": "neo_hookean", "E": 3e4, "nu": 0.3}}]},
    }


def drag_report():
    """The report's path of the diagnosis of a cube that the air has dragged."""
    folder = WORK / "drag"
    folder.mkdir(parents=True, exist_ok=True)
    grid = np.stack(np.meshgrid(*[0.05 + 0.1 * np.arange(4)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    still, times = np.repeat((grid + [0, 0, 5.1])[None], FRAMES, axis=0), np.arange(FRAMES) / 24.0
    np.savez(folder / "still.npz", positions=still, times=times)
    truth = thrown_cube()
    truth["scene"]["effects"] = [{"effect": "drag_quadratic", "drag_coefficient": 1.0}]
    truth |= {"task": "compare", "captures": [{"tracks": "still.npz"}], "output": {"folder": "truth"}}
    (folder / "truth.json").write_text(json.dumps(truth), encoding="utf-8")
    tool("compare", folder / "truth.json", "--quiet", "--restart")
    moved = np.load(folder / "truth" / "simulated.npz")["positions"]
    noisy = moved + np.random.default_rng(5).normal(0.0, NOISE, moved.shape)
    np.savez(folder / "clip.npz", positions=noisy, times=times)
    job = thrown_cube() | {
        "task": "diagnose", "output": {"folder": "out"},
        "captures": [{"name": "clip", "tracks": "clip.npz", "noise": NOISE, "holdout": {"frames": [12, FRAMES]}}],
        "fit": {"parameters": ["velocity"], "levels": [1]},
        "diagnose": {"members": 6, "refits": 2, "most_causes": 1, "central": False},
    }
    (folder / "job.json").write_text(json.dumps(job), encoding="utf-8")
    tool("diagnose", folder / "job.json", "--quiet", "--restart", "--report", folder / "report.json")
    return folder / "report.json"


def machine_report():
    """The same of published tests of rubber in a testing machine."""
    WORK.mkdir(parents=True, exist_ok=True)
    report = WORK / "rubber.json"
    tool("diagnose", ROOT / "docs" / "examples" / "testing_machine" / "treloar_pulled.json", "--report", report)
    return report


def gathered(value):
    """(numbers, texts) of a report; names of numbers as a page has them."""
    numbers, texts = set(), []
    if isinstance(value, bool) or value is None:
        pass
    elif isinstance(value, int | float):
        numbers.add(float(value))
    elif isinstance(value, str):
        texts.append(value)
    else:
        parts = value
        if isinstance(value, dict):
            texts += value
            parts = value.values()
        for part in parts:
            more, said = gathered(part)
            numbers |= more
            texts += said
    return numbers, texts


def shows(text, value, factor):
    """Whether a text is that number to its digits, in the page's unit or in percent."""
    match = re.search(r"[-−]?\d+(\.\d+)?(e[+-]?\d+)?", text)
    if text.startswith(("<", ">")) or match is None:
        return text in ("< 1 %", "> 99 %") and (0.0 < value < 0.01 or 0.99 < value < 1.0)
    said = float(match.group().replace("−", "-"))
    for scale in (1.0, factor, 100.0):
        exact = scale * value
        step = 10.0 ** (math.floor(math.log10(abs(exact))) - 2) if exact else 1e-12
        if abs(said - exact) <= max(0.51 * step, 0.51 if "%" in text and scale == 100.0 else 0.0):
            return True
    return False


@unittest.skipUnless(chromium.program(), "Chromium is not installed (Debian: chromium)")
class PageTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        shutil.rmtree(WORK, ignore_errors=True)
        PICTURES.mkdir(parents=True, exist_ok=True)

    def looked_at(self, report, name):
        page = report.with_suffix(".html")
        self.assertTrue(page.exists(), "--report writes the page beside it")
        document = json.loads(report.read_text(encoding="utf-8"))
        with chromium.Page() as browser:
            for device, (width, height, phone) in WIDTHS.items():
                browser.open(page.as_uri(), width, height, phone)
                shape = browser.value(SHAPE)
                self.assertEqual((shape["window"], shape["beyond"]), (width, []), device)
                self.assertLessEqual(shape["width"], width, f"{device}: the page scrolls sideways")
                picture = PICTURES / f"page_{name}_{device}.png"
                browser.picture(picture)
                self.assertGreater(picture.stat().st_size, LEAST, device)
            self.numbers(browser.value(TEXTS), document)
            self.assertEqual(browser.complaints, [])
            asked = {url for url in browser.requests if not url.startswith("data:")}
            self.assertEqual(asked, {page.as_uri()})
        return document

    def numbers(self, texts, document):
        """Each number of the page is one of the report."""
        numbers, said = gathered(document)
        plain = "\n".join([*said, *(text.replace("_", " ") for text in said),
                           *(text.replace("_", " ").replace(".", ": ", 1) for text in said)])
        factor = document["shown"]["factor"]
        shown = 0
        for text, value in texts:
            if value is not None:
                self.assertIn(float(value), numbers, text)
                self.assertTrue(shows(text, float(value), factor), f"{text} is said of {value}")
                shown += 1
            elif re.search(r"\d", text):
                for part in text.split(", "):
                    self.assertIn(part, plain)
        self.assertGreater(shown, 50)

    def test_a_drag_that_is_named(self):
        document = self.looked_at(drag_report(), "drag")
        self.assertIn("drag_quadratic", document["class"], document["sentence"])

    def test_tests_of_a_machine(self):
        self.looked_at(machine_report(), "rubber")


if __name__ == "__main__":
    require_in_tree()
    unittest.main()
