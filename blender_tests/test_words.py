# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages of the library in the panel's words."""

import ast
import unittest

import numpy
from matterfit.i18n import de
from matterfit.io import comparison, number_text, plain, words
from matterfit.ui import common, compare, diagnose, drawing
from support import SceneCase


class TranslationTest(unittest.TestCase):
    def test_every_sentence_said_plainly_is_translated(self):
        with open(plain.__file__, encoding="utf-8") as stream:
            calls = [node for node in ast.walk(ast.parse(stream.read()))
                     if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)]
        texts = [node.args[0].value for node in calls if node.func.id in ("translate", "_fixed")
                 and isinstance(node.args[0], ast.Constant)]
        self.assertGreater(len(texts), 10)
        self.assertEqual([text for text in texts if text not in de.TEXTS], [])


class LinesTest(unittest.TestCase):
    def test_a_number_keeps_its_unit(self):
        """Wherever a line ends."""
        units = ("kPa", "MPa", "Pa/m", "m/s", "mm", "%", "s", "min", "GB", "rad/s", "kg")
        text = "Between " + ", ".join(f"12.5 {unit} and" for unit in units) + " 4.0e6 Pa."
        wanted = {*units, "Pa"}
        for width in range(90, 400, 7):
            found = common.wrapped(text, width)
            self.assertEqual(" ".join(found), text)
            self.assertFalse([line for line in found if line.split()[0].strip(",.") in wanted], width)

    def test_errors_in_the_room_of_a_list(self):
        for error, wanted in ((0.03125, "0.031"), (22.94, "22.9"), (99.96, "100"), (1234.5, "1234"),
                              (2.4e9, "2e+09"), (0.0, "0"), (1e-7, "0")):
            self.assertEqual(compare._digits(error), wanted)


class WordsTest(SceneCase):
    def setUp(self):
        super().setUp()
        self.body(self.cube("Jelly Cube"))
        self.body(self.cube("Soft"))
        self.body(self.cube("Ramp"), "COLLIDER")

    def said(self, text):
        return words.in_panel(text, self.settings)

    def test_paths_become_objects_and_fields(self):
        for path, wanted in (
                ("scene.bodies[0].material.E is -1, expected a number.",
                 "'Jelly Cube', Young's Modulus is -1, expected a number."),
                ("scene.bodies[1] 'Soft' has no particles.", "'Soft' has no particles."),
                ("bodies.Soft.velocity[2]", "'Soft', Velocity Z"),
                ('bodies."Jelly Cube".material.maxwell[1].time', "'Jelly Cube', 2: Relaxation Time"),
                ("colliders[0].contact.mu", "Ground, Friction"),
                ("scene.colliders[1].contact.stiffness", "'Ramp', Stiffness"),
                ("scene.bodies[0].source.mesh: its content", "'Jelly Cube', Shape: its content"),
                ("scene.particle_separation is 0", "Particle Separation is 0"),
                ("scene.solver.cfl", "CFL"), ("scene.gravity[1]", "Gravity Y")):
            self.assertEqual(self.said(path), wanted)

    def test_sentences_of_the_library(self):
        for text, wanted in (
                ("'Soft' sank 26 cm into 'ground'. Raise scene.colliders.ground.contact.stiffness "
                 "(now 4e+06 Pa/m) if it should not.",
                 "'Soft' sank 26 cm into the ground. Raise Solver > Ground > Stiffness (now 4.0e6 Pa/m) "
                 "if it should not."),
                ("'Soft' sank 3 mm into 'my ramp'. Raise scene.colliders.\"my ramp\".contact.stiffness "
                 "if it should not.",
                 "'Soft' sank 3 mm into 'my ramp'. Raise Bodies > my ramp > Stiffness if it should not."),
                ("'ground' slopes by 2 °. 'Soft' lies on 'ground'.",
                 "The ground slopes by 2 °. 'Soft' lies on the ground."),
                ("Starting guess estimated from the recording: bodies.Soft.material.E 9.1e+04 Pa, "
                 "bodies.Soft.material.nu 0.31; not known to a factor of three: bodies.Soft.density",
                 "Starting guess estimated from the recording: 'Soft', Young's Modulus 91 kPa, 'Soft', "
                 "Poisson's Ratio 0.31; not known to a factor of three: 'Soft', Density"),
                ("captures.my clip: 12 of 30 samples lie outside the simulated time; they are NaN in "
                 "simulated.npz",
                 "'my clip': 12 of 30 samples lie outside the simulated frames, and are not compared."),
                ("captures.clip: points lie up to 2.04 m off 'Soft' at rest; are unit, transform and "
                 "start_frame right?",
                 "'clip': points lie up to 2 m off 'Soft' at rest. Are the capture's Unit, Location, "
                 "Rotation and Start Frame right?"),
                ("captures.clip: samples lie between frames and are interpolated; simulate at the "
                 "capture's rate to avoid it",
                 "'clip': samples lie between frames and are interpolated: Start Frame lies between "
                 "two, or the recording's rate is not the scene's Frame Rate."),
                ("no usable checkpoint: simulated from the first frame",
                 "No checkpoint was found: simulated from the first frame."),
                ("resumed after frame 12", "Went on after frame 12.")):
            self.assertEqual(self.said(text), wanted)

    def test_of_a_result(self):
        text = "bodies.Soft.material.E and bodies.Soft.velocity[2] are hard to distinguish."
        self.assertEqual(words.of_result(text, self.settings), "'Soft', Young's Modulus and 'Soft', "
                         "Velocity Z are hard to distinguish.")
        self.settings.bodies.remove(0)
        self.assertEqual(words.of_result(text, self.settings),
                         "Young's Modulus and Velocity Z are hard to distinguish.")

    def test_of_a_batch(self):
        """What is varied stands before the message, in the document's words."""
        for text, wanted in (
                ("particle_separation = 0.02: too fine", "Particle Separation = 0.02: too fine"),
                ("bodies.Soft.velocity[2] = -1, gravity[2] = -3: no",
                 "'Soft', Velocity Z = -1, Gravity Z = -3: no"),
                ("other = 3: no", "other = 3: no")):
            self.assertEqual(self.said(text), wanted)

    def test_stages(self):
        for text, wanted in (("Filling", "Filling"), ("Wedge, 2 of 12 done", "2 of 12 done"),
                             ("Checking: Differentiating", "Checking: Trying each value")):
            self.assertEqual(words.stage(text), wanted)

    def test_a_fill_in_short(self):
        text = ("8000 particles 0.02 m apart (20 × 20 × 20 cells); the surface cuts {} cells; volume "
                "0.064 m³, particles hold {} % of it.")
        self.assertEqual(words.fill(text.format(0, "100.00")), "8 000 particles; volume matched.")
        self.assertEqual(words.fill(text.format(12, "97.31") + " The surface crosses itself."),
                         "8 000 particles, which hold 97.3 % of the volume. The surface crosses itself.")

    def test_a_body_that_is_lost(self):
        """No number of a particle, no coordinates, no −0."""
        tail = " Use a smaller scene.solver.dt_safety or particle separation, or gentler motion."
        for text, wanted in (
                ("Body 'Soft', frame 1 (0.0116922 s): particle 145 at (-0.250021, -0.25, 0.334124) m is "
                 "turned inside out (volume ratio -0.000000)." + tail,
                 "Body 'Soft', frame 1: a part of it is turned inside out."),
                ("Body 'Soft', frame 12 (1.5e-05 s): particle 0 is not a number." + tail,
                 "Body 'Soft', frame 12: a part of it is torn away."),
                ("Body 'Soft', frame 3 (0.1 s): particle 7 at (0, 1, -2e-05) m moves more than a cell in one "
                 "substep, at 812.5 m/s." + tail, "Body 'Soft', frame 3: a part of it moves too fast."),
                ("Body 'Soft', frame 3: particle 7 at (0, 1, -2e-05) m is more than a cell beyond the walls.",
                 "Body 'Soft', frame 3: a part of it is more than a cell beyond the walls.")):
            said = self.said(text)
            self.assertEqual(said.removesuffix(
                " Use a smaller Particle Separation, or gentler motion."), wanted)

    def test_sentences_without_numbers_of_the_grid(self):
        for text, wanted in (
                ("output.mesh[0]: 8 or more points lie farther than two particle separations (up to "
                 "0.125 m) from 'Soft'; do they belong together?",
                 "Parts of the mesh of 'Soft' lie up to 12 cm outside the shape that is simulated, and "
                 "may not follow it well. Apply the modifiers if it does not."),
                ("Body 'Soft' starts up to 0.91685 m inside 'ground', at (-0.91685, -0.91685, -0.9) m. "
                 "Move one of them so that they touch at most.",
                 "Body 'Soft' starts up to 92 cm inside the ground. Move one of them so that they touch at "
                 "most."),
                ("The deformation is larger than this grid can follow: use a smaller particle separation, "
                 "a smaller scene.solver.dt_safety, gentler motion, or formulation 'updated' if the body "
                 "flows or tears.",
                 "Use a smaller Particle Separation, gentler motion, or the Formulation Updated Lagrangian "
                 "if the body flows or tears."),
                ("Use other start values or narrower bounds, or a lower solver.dt_safety.",
                 "Use other start values or narrower bounds."),
                ("captures: every sample is held out, not seen, or outside the scene's frames; nothing is left to "
                 "fit to (clip: its 500 frames go from 0 to 4.99 s of the scene, which ends at 0.3 s). Shorten a "
                 "'holdout', or look at start_frame, scene.frames and the file's times, which are in seconds.",
                 "Every sample is held out, not seen, before the end of Quiet Start, or outside the frame "
                 "range; nothing is left to fit to (clip: its 500 frames go from 0 to 4.99 s of the scene, which "
                 "ends at 0.3 s). Hold out less, or look at Quiet Start, Start Frame, the frame range and the "
                 "file's times, which are in seconds."),
                ("captures: every image is held out or outside of the scene's frames; nothing is left to fit "
                 "to. Shorten a 'holdout', or look at start_frame, fps and scene.frames.",
                 "Every image is held out, or lies outside the frame range; nothing is left to fit to. Hold out "
                 "less, or look at Start Frame, Rate and the frame range."),
                ("Frame 1 would need -9223372036854775808 substeps (CFL). Soften the material, use a larger "
                 "particle separation, or override scene.solver.dt.",
                 "Frame 1 would need too many steps in time (CFL). Soften the material or what it touches, slow "
                 "it down, or use a larger Particle Separation."),
                ("Frame 1 would need more than 5000000 substeps (CFL). Soften the material, use a larger "
                 "particle separation, or override scene.solver.dt.",
                 "Frame 1 would need too many steps in time (CFL). Soften the material or what it touches, slow "
                 "it down, or use a larger Particle Separation."),
                ("/a b/manifest.json: not valid JSON at line 1: parse error at line 1, column 2: unexpected end.",
                 "/a b/manifest.json is damaged: it is no whole JSON file."),
                ("clip.npz: no point is visible in any frame.",
                 "clip.npz: no point is seen in any frame: every place is missing. Export the recording again, "
                 "or choose another file."),
                ("mf_job_options.threads: -1, expected a number of threads, or 0.",
                 "Threads: -1, expected a number of threads, or 0."),
                ("Bodies 'A' and 'B' lie in each other, about (4.21e-17, 0.1, 0) m. Move one so that "
                 "they touch at most.",
                 "Bodies 'A' and 'B' lie in each other. Move one so that they touch at most."),
                ("The surface crosses or doubles itself near 12 cells; the winding number decided "
                 "there. Only 1 layer across the thinnest side (0 m); a separation of 4.2e-17 m gives "
                 "12. The mesh is not closed: 42 boundary edges around 4 holes, filled as if each were "
                 "covered straight across. 1 edge with more than two faces. 1 of 1 shell faced inward "
                 "and was turned.",
                 "The surface crosses itself in places. The thinnest side holds only 1 layer of "
                 "particles: lower Particle Separation. The mesh had 4 holes, which were closed "
                 "straight across. In places more than two faces share an edge. Faces looked inward and "
                 "were turned outward."),
                ("'Soft': Filling at a particle_separation of 1e-05 m makes about 2.7e+13 particles, "
                 "more than the limit of 50000000. Use a separation of at least 0.000822 m.",
                 "'Soft': A Particle Separation of 0.01 mm makes too many particles. Use at least "
                 "0.82 mm."),
                ("'Soft': Nothing to fill at a particle_separation of 10 m: the shape, 0.3 × 0.3 × 0.3 "
                 "m, holds no cell of which a part is inside. Use a smaller separation, or check that "
                 "the shape is closed and its unit.",
                 "'Soft': A Particle Separation of 10 m is too large for this shape. Use a smaller one, "
                 "or check that the shape is closed and its size is right."),
                ("'Soft': At a particle_separation of 0.02 m particles hold only 8 % of the shape: the rest is "
                 "wires and walls that are far thinner. Use a smaller separation, or make them thicker.",
                 "'Soft': A Particle Separation of 2 cm is too large for the wires and walls of this shape: "
                 "particles would hold 8 % of it. Use a smaller one, raise Most Particles, or make them "
                 "thicker.")):
            self.assertEqual(self.said(text), wanted)
        self.assertEqual(self.said("Volume matched. Limit surface of the cage at level 5."), "Volume matched.")

    def test_one_and_many(self):
        self.assertEqual([plain.counted(1, "frame"), plain.counted(2, "frame"),
                          plain.counted(1, "particle"), plain.counted(97308, "particle")],
                         ["1 frame", "2 frames", "1 particle", "97 308 particles"])

    def test_lengths(self):
        self.assertEqual([plain.length_text(metres) for metres in (12.0, 1.0, 0.99, 0.013, 2e-4, 0.0)],
                         ["12 m", "1 m", "99 cm", "1.3 cm", "0.2 mm", "0 mm"])

    def test_what_changed_of_the_only_body(self):
        self.settings.bodies.remove(0)
        text = ("/tmp/cache_matterfit_12345678 holds the results of other inputs. What changed:\n"
                "  scene.bodies[0].material.E: 200000.0, was 100000.0\n"
                "  scene.gravity[2]: -9.05, was -9.0\n")
        self.assertIn("The scene changed since this bake: Young's Modulus was 100000, now 200000; "
                      "Gravity Z was -9, now -9.05.", self.said(text))

    def test_a_body_that_is_off_does_not_count(self):
        self.settings.bodies[0].enabled = False
        self.assertEqual(self.said("bodies[0].density"), "'Soft', Density")

    def test_prefixes(self):
        self.assertEqual([number_text.with_prefix(value, "Pa") for value in
                          (9.1e4, 999999.0, 1e5, 2.34e9, -4e6, 0.0, 12.0, 3e-4)],
                         ["91 kPa", "1 MPa", "100 kPa", "2.3 GPa", "-4 MPa", "0 Pa", "12 Pa", "300 µPa"])

    def test_no_minus_zero(self):
        self.assertEqual([diagnose.percent(share) for share in (-0.004, -0.0, 0.0, 0.5, 0.004)],
                         ["0 %", "0 %", "0 %", "50 %", "< 1 %"])
        self.assertEqual(number_text.short(-0.0, 3), "0")
        self.assertEqual([drawing.frame_text(frame) for frame in (-1e-9, 0.0, 499.0000001, -3.0)],
                         ["0", "0", "499", "-3"])

    def test_a_graph_ends_where_what_is_compared_does(self):
        """A recording of 500 frames, of which a scene simulates 20."""
        def compared(errors):
            places = numpy.zeros((len(errors), 1, 3))
            return comparison.Comparison(numpy.arange(float(len(errors))), places, places,
                                         numpy.reshape(errors, (-1, 1)), ["a"])
        nan = float("nan")
        self.assertEqual(drawing.frames_compared(compared([nan, nan, 1.0, nan, 2.0, nan, nan, nan])), (2.0, 4.0))
        self.assertEqual(drawing.frames_compared(compared([nan, nan, nan])), (0.0, 2.0))

    def test_files_and_sentences_stay(self):
        for text in ("/home/me/scene.bodies/cache: could not be read", "All bodies. None of it moves",
                     "bodies[7].density", "12 particles, 3.4 mm"):
            self.assertEqual(self.said(text), text)

    def test_what_changed_is_a_sentence(self):
        text = ("/tmp/cache_matterfit_12345678 holds the results of other inputs. What changed:\n"
                "  scene.bodies[0].material.E: 200000, was 100000\n"
                "  scene.bodies[0].source.mesh: its content\n"
                "  scene.colliders[1].contact.mu: 0.5, was not there\n"
                "  scene.bodies[1].damping: gone, was 3\n"
                "Press Bake")
        self.assertEqual(self.said(text), (
            "The scene changed since this bake: 'Jelly Cube', Young's Modulus was 100000, now 200000; "
            "'Jelly Cube', Shape is another one; 'Ramp', Friction is new; 'Soft', damping is gone.\n"
            "Press Bake"))

    def test_of_a_fit(self):
        text = "/tmp/x holds an unfinished fit of other inputs. What changed:\n  version: 2, was 1\n"
        self.assertIn("The scene changed since this fit: Matterfit was 1, now 2.", self.said(text))
