# SPDX-License-Identifier: GPL-3.0-or-later
"""A scan of a deck of cards, in Gaussian splats, dropped on a ground: three frames side by side.

    blender -b --factory-startup --python-exit-code 1 -P scripts/thrown_splats.py -- OUT.jpg [SPLATS]

SPLATS: `academic_tarot_cards.splat` of ../shared/data/splats. The deck is cropped out of the scan, filled as
soft rubber, dropped askew, baked into `output.splats` and drawn by `matterfit render` (build/bin/matterfit),
all in build/thrown_splats.
"""

import argparse
import json
import math
import pathlib
import subprocess
import sys

import bpy
import numpy
from mathutils import Euler, Matrix, Quaternion, Vector

ROOT = pathlib.Path(__file__).resolve().parent.parent
SCAN = ROOT / ".." / "shared" / "data" / "splats" / "academic_tarot_cards.splat"
FOLDER = ROOT / "build" / "thrown_splats"
CROP = {"low": [-0.14, -0.52, -0.33], "high": [0.14, 0.40, 0.33]}  # the deck, in the file, whose y points down
OPACITY = 0.1
SIZE = 360
SHOWN = (1, 8, 14)
PALE = [0.93, 0.93, 0.93]


def view(place, target):
    """A frame of a `transforms.json` that looks from one point at another."""
    turn = (target - place).to_track_quat("-Z", "Y")
    matrix = Matrix.Translation(place) @ turn.to_matrix().to_4x4()
    return {"file_path": "view.png", "transform_matrix": [list(row) for row in matrix], "w": SIZE, "h": SIZE,
            "fl_x": 1.75 * SIZE, "fl_y": 1.75 * SIZE, "cx": SIZE / 2, "cy": SIZE / 2}


def job(splats):
    upright = Quaternion((1.0, 0.0, 0.0), -math.pi / 2)
    turn = Euler((0.0, math.radians(30), math.radians(65))).to_quaternion() @ upright
    kept = {"gaussians": str(splats), "crop": CROP, "opacity_threshold": OPACITY}
    return {
        "schema": "matterfit.job/1", "task": "render",
        "scene": {
            "fps": 24, "frames": [1, SHOWN[-1] + 1], "particle_separation": 0.03,
            "bodies": [{"name": "cards", "source": kept, "density": 300, "velocity": [0, 0, -1.5],
                        "placement": {"position": [0, 0, 0.75], "rotation": list(turn)},
                        "material": {"law": "neo_hookean", "E": 5e4, "nu": 0.35, "damping_shear": 30}}],
            "colliders": [{"name": "ground", "shape": "ground", "height": 0}]},
        "render": {"cameras": "transforms.json", "background": PALE},
        "output": {"folder": "out", "splats": [{"name": "cards", **kept}]}}


def pixels(path):
    image = bpy.data.images.load(str(path))
    width, height = image.size
    found = numpy.array(image.pixels[:], dtype=numpy.float32).reshape(height, width, 4)
    bpy.data.images.remove(image)
    return found


def main():
    parser = argparse.ArgumentParser(prog="thrown_splats.py")
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("splats", type=pathlib.Path, nargs="?", default=SCAN)
    arguments = parser.parse_args(sys.argv[sys.argv.index("--") + 1:])
    FOLDER.mkdir(parents=True, exist_ok=True)
    seen = view(Vector((1.9, -2.0, 1.2)), Vector((0.0, 0.0, 0.45)))
    (FOLDER / "transforms.json").write_text(json.dumps({"frames": [seen]}), encoding="utf-8")
    (FOLDER / "job.json").write_text(json.dumps(job(arguments.splats.resolve())), encoding="utf-8")
    tool = ROOT / "build" / "bin" / "matterfit"
    subprocess.run([tool, "render", FOLDER / "job.json", "--restart"], check=True)
    strip = numpy.concatenate([pixels(FOLDER / "out" / "render" / "camera_0" / f"{frame:04d}.png")
                               for frame in SHOWN], axis=1)
    sheet = bpy.data.images.new("strip", strip.shape[1], strip.shape[0], alpha=False)
    sheet.pixels.foreach_set(strip.ravel())
    bpy.context.scene.render.image_settings.file_format = "JPEG"
    bpy.context.scene.render.image_settings.quality = 88
    bpy.context.scene.view_settings.view_transform = "Standard"
    sheet.save_render(str(arguments.out.resolve()), scene=bpy.context.scene)


if __name__ == "__main__":
    main()
