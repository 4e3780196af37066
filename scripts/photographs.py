# SPDX-License-Identifier: GPL-3.0-or-later
"""E of two silicones, each from photographs of a hammer that hangs from a clamp at rest, by one camera.

The photographs are those of Arnavaz et al. 2022 (Differentiable Depth for Real2Sim Calibration of Soft Body
Simulations, github diku-dk/DiffCal at 5f810dc, GPL-3.0): `exp_data/h_m_c` (MoldStar 15) and `exp_data/h_e_c`
(Ecoflex 00-50), with the mesh in `CAD_models`. They are read from a checkout, FOLDER; nothing of them is kept
outside of build/photographs. The lens that the experiments state is that of the depth camera (1024 by 768);
what the colour camera's is, is not published: LENS is what cameras of that model have, within a hundredth, and
the published view of each photograph is the colour camera's.

The body begins straight and comes to rest under a drag that its final shape does not depend on. Fitted: E, and
the camera's pose within what is known of it. The first photographs are seen, the last ones are held out."""

import argparse
import json
import pathlib

import bpy
import clip_fit
import film_mattes
import numpy as np
from parts import BUILD, require_in_tree

import bmesh  # isort: skip: bpy brings it

# Density [kg/m³] and colour of each silicone: the first is the authors', the second the maker's.
BODIES = {"h_m_c": (1034, [0, .21, .265]), "h_e_c": (1070, [.54, .02, .13])}
LENS = {"fl_x": 905, "fl_y": 905, "cx": 640, "cy": 360, "w": 1280, "h": 720}
REFINED = {"shift": .005, "turn": .015, "focal": .01}
FPS, AT_REST, HELD_OUT, END = 20, 16, 18, 21
SETTLING = 20  # rate of the drag [1/s]
NOISE = 4  # of outlines [pixels]: edges of keys, and corners that particles 10 pixels apart round off
CLAMP = .01  # how far before the clamp's face the body is cut, as vertices lie on that [cm]


def experiment(path):
    """The settings of an experiment as numbers, where they are."""
    rows = (line.split("=", 1) for line in path.read_text().splitlines() if "=[" in line)
    return {name: json.loads(value.replace("-inf", "-1e9").replace("inf", "1e9")) for name, value in rows}


def write_png(path, pixels):
    """(h,w,3) bytes."""
    height, width, _ = pixels.shape
    image = bpy.data.images.new("photograph", width, height)
    shares = np.ones((height, width, 4), np.float32)
    shares[..., :3] = pixels[::-1] / np.float32(255)  # Blender has the lowest row first
    image.pixels.foreach_set(shares.ravel())
    image.file_format = "PNG"
    image.save(filepath=str(path))
    bpy.data.images.remove(image)


def write_free_part(source, path, face):
    """The part of a mesh before x = `face`, closed there."""
    vertices, faces = film_mattes.read_obj(source)
    mesh = bpy.data.meshes.new("body")
    mesh.from_pydata(vertices, [], faces)
    body = bmesh.new()
    body.from_mesh(mesh)
    bmesh.ops.bisect_plane(body, geom=body.verts[:] + body.edges[:] + body.faces[:], plane_co=(face, 0, 0),
                           plane_no=(1, 0, 0), clear_outer=True)
    bmesh.ops.holes_fill(body, edges=[edge for edge in body.edges if edge.is_boundary])
    bmesh.ops.triangulate(body, faces=body.faces[:])
    bmesh.ops.recalc_face_normals(body, faces=body.faces[:])
    body.verts.index_update()
    path.write_text("".join(f"v {v.co.x:.9g} {v.co.y:.9g} {v.co.z:.9g}\n" for v in body.verts)
                    + "".join(f"f {' '.join(str(v.index + 1) for v in f.verts)}\n" for f in body.faces))
    body.free()


def write_photographs(source, folder, count):
    """`count` photographs that differ, spread over those of an experiment, and the camera that took them."""
    differing = {}
    for path in sorted(source.glob("c_*.npy")):
        differing.setdefault(hash(path.read_bytes()), path)
    paths = list(differing.values())
    view = np.load(source / paths[0].name.replace("c_", "v_0_", 1)).astype(float)
    # Along +z with y down, as OpenCV has it; transforms.json has −z and y up.
    matrix = np.linalg.inv(np.diag([1, -1, -1, 1]) @ view).tolist()
    frames = []
    for k in range(count):
        name = f"{AT_REST + k:03d}.png"
        write_png(folder / name, np.load(paths[k * (len(paths) - 1) // (count - 1)]))
        frames.append({"file_path": name, "transform_matrix": matrix, "time": (AT_REST + k) / FPS})
    (folder / "transforms.json").write_text(json.dumps(LENS | {"frames": frames}))


def document(name, face, shift, options):
    """The fit of a body that is held at x = `face` [cm of its mesh]; `shift` of its mesh [cm]."""
    density, colour = BODIES[name]
    body = {"name": "hammer", "density": density, "source": {"mesh": "body.obj"},
            "placement": {"scale": .01, "position": (shift / 100).tolist()},
            "material": {"law": "neo_hookean", "E": options.start, "nu": .45},
            "pins": [{"region": {"shape": "plane", "point": [(face + shift[0]) / 100, 0, 0], "normal": [-1, 0, 0]}}]}
    return {"schema": "matterfit.job/1", "task": "fit",
            "scene": {"fps": FPS, "frames": [0, END], "particle_separation": options.separation,
                      "gravity": [0, -9.81, 0], "bodies": [body],
                      "effects": [{"effect": "drag_linear", "rate": SETTLING}]},
            "captures": [{"name": "photographs", "cameras": "transforms.json", "start_frame": 0,
                          "key": {"colour": colour}, "noise": NOISE, "refine": REFINED,
                          "holdout": {"frames": [HELD_OUT, END]}}],
            "output": {"folder": "out"},
            "fit": {"parameters": [{"path": "material.E", "start": options.start}], "iterations": 12}}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path, help="a checkout of the photographs")
    parser.add_argument("--separation", type=float, default=.005, help="of particles [m]; the bar is 30 mm thick")
    parser.add_argument("--start", type=float, default=2e5, help="E that the search begins with [Pa]")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--tool", type=pathlib.Path, help="another build of matterfit")
    options = parser.parse_args()
    require_in_tree()
    print("| photographs | E [kPa] | IoU, contour [px] before | fitted | held out | runs | seconds |\n"
          "|---|---|---|---|---|---|---|")
    for name in BODIES:
        source = options.folder / "exp_data" / name
        settings = experiment(source / f"{name}.exp")
        face = settings["object_dirichlet_boundary_conditions"][0] - CLAMP
        shift = np.array(settings["object_transform"]).reshape(4, 4)[:3, 3]
        folder = BUILD / "photographs" / name
        folder.mkdir(parents=True, exist_ok=True)
        write_photographs(source / "camera_data", folder, END - AT_REST)
        write_free_part(options.folder / "CAD_models" / "cantilever_coarse" / "cantilever_f640_v322.obj",
                        folder / "body.obj", face)
        path = folder / "job.json"
        path.write_text(json.dumps(document(name, face, shift, options), indent=1))
        result, words = clip_fit.run_tool(options, "fit", path, folder / "fit.log")
        if result is None:
            print(f"| {name} | {words} | | | | | |")
            continue
        print(row(name, result["fit"]), flush=True)


def row(name, fit):
    def agreement(part):
        return f"{part['iou']:.3f}, {part['contour_px']:.1f}"
    modulus = next(p for p in fit["parameters"] if p["path"].endswith("material.E"))
    seen = fit["silhouettes"]
    return (f"| {name} | {modulus['value'] / 1000:.0f} ± {modulus['standard_error'] / 1000:.0f} "
            f"| {agreement(seen['before']['fitted'])} | {agreement(seen['after']['fitted'])} "
            f"| {agreement(seen['after']['held_out'])} | {fit['evaluations']} | {fit['seconds']:.0f} |")


if __name__ == "__main__":
    main()
