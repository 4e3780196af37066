# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages of the library in the panel's words."""

from matterfit.io import words
from matterfit.ui import drawing
from support import SceneCase


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
                 "'Soft' sank 26 cm into Ground. Raise Ground, Stiffness (now 4e+06 Pa/m) if it "
                 "should not."),
                ("Starting guess estimated from the recording: bodies.Soft.material.E 9.1e+04 Pa",
                 "Starting guess estimated from the recording: 'Soft', Young's Modulus 9.1e+04 Pa")):
            self.assertEqual(self.said(text), wanted)

    def test_of_a_result(self):
        text = "bodies.Soft.material.E and bodies.Soft.velocity[2] are hard to tell apart."
        self.assertEqual(words.of_result(text, self.settings), "'Soft', Young's Modulus and 'Soft', "
                         "Velocity Z are hard to tell apart.")
        self.settings.bodies.remove(0)
        self.assertEqual(words.of_result(text, self.settings),
                         "Young's Modulus and Velocity Z are hard to tell apart.")

    def test_of_a_batch(self):
        """What is varied stands before the message, in the document's words."""
        for text, wanted in (
                ("particle_separation = 0.02: too fine", "Particle Separation = 0.02: too fine"),
                ("bodies.Soft.velocity[2] = -1, gravity[2] = -3: no",
                 "'Soft', Velocity Z = -1, Gravity Z = -3: no"),
                ("other = 3: no", "other = 3: no")):
            self.assertEqual(self.said(text), wanted)

    def test_stages(self):
        for text, wanted in (("Filling", "Filling"), ("Compare: Wedge, 2 of 12 done", "Compare: 2 of 12 done"),
                             ("Checking: Differentiating", "Checking: Trying each value")):
            self.assertEqual(words.stage(text), wanted)

    def test_a_fill_in_short(self):
        text = ("8000 particles 0.02 m apart (20 × 20 × 20 cells); the surface cuts {} cells; volume "
                "0.064 m³, particles hold {} % of it.")
        self.assertEqual(words.fill(text.format(0, "100.00")), "8000 particles; volume matched.")
        self.assertEqual(words.fill(text.format(12, "97.31") + " The surface crosses itself."),
                         "8000 particles; they hold 97.3 % of the volume. The surface crosses itself.")

    def test_a_body_that_is_off_does_not_count(self):
        self.settings.bodies[0].enabled = False
        self.assertEqual(self.said("bodies[0].density"), "'Soft', Density")

    def test_no_minus_zero(self):
        self.assertEqual([drawing.frame_text(frame) for frame in (-1e-9, 0.0, 499.0000001, -3.0)],
                         ["0", "0", "499", "-3"])

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
