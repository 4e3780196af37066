# SPDX-License-Identifier: GPL-3.0-or-later
"""The particle separation that a quality asks for."""

from unittest import mock

import bpy
from matterfit import native
from matterfit.io import resolution
from matterfit.ui import solver as panel
from support import SceneCase, needs_library


class ResolutionTest(SceneCase):
    def test_faces_that_are_not_planar(self):
        """A ray from the centre of a warped face does not take the face itself for the far side."""
        for side in (-1.0, 1.0):
            item = self.cube(size=1.0)
            for vertex in item.data.vertices:
                if vertex.co.x > 0.0 and side * vertex.co.y > 0.0:
                    vertex.co.z *= 1.2
            self.body(item)
            found = list(resolution.seen(self.scene).values())[-1]
            self.assertAlmostEqual(found.thickness, 1.0, delta=0.15)
            self.assertAlmostEqual(found.volume, 1.0, delta=0.15)

    def test_standard_is_six_cells(self):
        """A slab of 6 cm: cells of 1 cm, particles .5 cm apart; typing makes it Custom."""
        item = self.cube(size=1.0)
        item.scale = (0.5, 0.25, 0.06)
        bpy.context.view_layer.update()
        self.body(item)
        solver = self.settings.solver
        self.assertAlmostEqual(solver.particle_separation, 0.005, places=5)
        self.assertEqual(solver.quality, "STANDARD")
        solver.quality = "PREVIEW"
        self.assertAlmostEqual(solver.particle_separation, 0.01, places=5)
        solver.most_particles = 1000000
        solver.quality = "FINE"
        self.assertAlmostEqual(resolution.cells_across(self.scene), 9.0, places=2)
        solver.particle_separation = 0.02
        self.assertEqual(solver.quality, "CUSTOM")
        document, _folder = self.document()
        self.assertEqual(document["scene"]["quality"], "custom")

    def test_the_shape_that_is_simulated(self):
        """A plane that Solidify makes 5 cm thick, also while it is hidden."""
        bpy.ops.mesh.primitive_plane_add(size=0.2)
        item = bpy.context.active_object
        item.modifiers.new("Solidify", "SOLIDIFY").thickness = 0.05
        bpy.context.view_layer.update()
        self.body(item)
        self.assertAlmostEqual(self.settings.solver.particle_separation, 0.05 / 12, places=5)
        item.hide_viewport = True
        self.settings.solver.quality = "PREVIEW"
        self.assertAlmostEqual(self.settings.solver.particle_separation, 0.05 / 6, places=5)
        self.assertAlmostEqual(resolution.thinnest(self.scene), 0.05, places=5)
        self.assertTrue(item.hide_viewport)

    @needs_library
    def test_what_pours_gets_many_particles(self):
        """As soon as a body pours: 40 000 in all, as a sheet of water needs; the thin parts of others
        still count, and so does the limit."""
        body = self.body(self.cube(size=0.4, location=(0.0, 0.0, 0.6)))
        solver = self.settings.solver
        solid = solver.particle_separation
        self.assertAlmostEqual(solid, 0.4 / 12, places=5)
        for preset in ("WATER", "HONEY", "SAND", "TOOTHPASTE"):
            body.material.preset = preset
            document, folder = self.document("simulate")
            count = native.estimate(document, folder)["particles"]
            self.assertTrue(35000 < count < 45000, (preset, count))
        self.assertEqual(solver.quality, "STANDARD")
        solver.quality = "PREVIEW"
        self.assertAlmostEqual(solver.particle_separation, (0.064 / 5000) ** (1 / 3), places=4)
        solver.quality = "FINE"
        self.assertAlmostEqual(solver.particle_separation, (0.064 / 100000) ** (1 / 3), delta=3e-4)
        solver.quality, solver.most_particles = "STANDARD", 10000
        self.assertGreaterEqual(solver.particle_separation, (0.064 / 10000) ** (1 / 3))
        self.assertEqual(resolution.limited_to(self.scene), (10000, "40 000 particles"))
        solver.most_particles = 100000
        self.assertIsNone(resolution.limited_to(self.scene))
        body.material.preset = "JELLY"
        self.assertAlmostEqual(solver.particle_separation, solid, places=5)
        # Beside a solid the count is of both; with a thinner one its cells ask for more.
        other = self.cube("Other", size=0.4, location=(1.0, 0.0, 0.6))
        other.scale.z = 0.5
        bpy.context.view_layer.update()
        self.body(other)
        self.assertAlmostEqual(solver.particle_separation, 0.2 / 12, places=5)
        body.material.preset = "WATER"
        self.assertAlmostEqual(solver.particle_separation, (0.096 / 40000) ** (1 / 3), places=4)
        other.scale.z = 0.35
        bpy.context.view_layer.update()
        bpy.ops.matterfit.set_resolution()
        self.assertAlmostEqual(solver.particle_separation, 0.14 / 12, places=5)

    def test_whatever_begins_or_ends_to_pour(self):
        """The weights of a law, a number of it, a body that is switched off, that collides, that goes."""
        body = self.body(self.cube(size=0.4, location=(0.0, 0.0, 0.6)))
        self.body(self.cube("Other", size=0.4, location=(1.0, 0.0, 0.6)))
        solver, material = self.settings.solver, body.material
        both, solid = (0.128 / 40000) ** (1 / 3), 0.4 / 12

        def check(wanted):
            self.assertAlmostEqual(solver.particle_separation, wanted, places=5)

        material.law = "NEURAL_ISOTROPIC"
        check(solid)
        for weights, wanted in (("WATER", both), ("PLASTICINE", solid), ("SAND", both), ("JELLY", solid)):
            material.weights = weights
            check(wanted)
        material.tear_strain = 0.1
        check(both)
        body.enabled = False
        check(solid)
        body.enabled = True
        check(both)
        body.role = "COLLIDER"
        check(solid)
        body.role = "BODY"
        check(both)
        self.settings.body_index = 0
        bpy.ops.matterfit.remove_body()
        check(solid)

    def test_what_was_typed_stays(self):
        """Another material does not measure anew what is Custom, nor one that pours as little."""
        body = self.body(self.cube(size=0.4))
        solver = self.settings.solver
        body.object.scale.x = 2.0  # not measured: it is not asked for
        found = solver.particle_separation
        body.material.preset = "RUBBER"
        self.assertEqual(solver.particle_separation, found)
        solver.particle_separation = 0.05
        body.material.preset = "WATER"
        self.assertAlmostEqual(solver.particle_separation, 0.05)

    def test_a_mesh_of_a_million_faces(self):
        """Its size is that of a coarse one."""
        sizes = []
        for cuts in (10, 500):
            bpy.ops.mesh.primitive_grid_add(x_subdivisions=cuts, y_subdivisions=cuts, size=1.0)
            item = bpy.context.active_object
            item.modifiers.new("Solidify", "SOLIDIFY").thickness = 0.1
            sizes.append(resolution._measure(item))
        self.assertAlmostEqual(sizes[0].thickness, sizes[1].thickness, places=4)
        self.assertAlmostEqual(sizes[0].volume, sizes[1].volume, places=3)

    def test_the_panel_measures_what_changed(self):
        """Also where the box and the number of vertices stay: what a modifier does, what was sculpted."""
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=6, y_subdivisions=6, size=0.2)
        item = bpy.context.active_object
        self.body(item)
        solidify = item.modifiers.new("Solidify", "SOLIDIFY")

        def measured():
            bpy.context.view_layer.update()
            with mock.patch.object(resolution, "seen", wraps=resolution.seen) as seen:
                panel._known(bpy.context)
            return seen.called

        def peak(*index):
            for vertex in item.data.vertices:
                vertex.co.z = 0.05 if vertex.index in index else 0.0
            item.data.update()

        self.assertTrue(measured())
        self.assertFalse(measured())
        solidify.thickness *= 2.0
        self.assertTrue(measured())
        item.modifiers.clear()
        peak(16)
        self.assertTrue(measured())
        box = tuple(item.dimensions)
        peak(17)
        self.assertTrue(measured())
        self.assertEqual(tuple(item.dimensions), box)
        self.assertFalse(measured())
        # What is typed changes no shape: a dense mesh is not measured at each step of a slider.
        self.settings.solver.particle_separation *= 0.5
        self.settings.bodies[0].material.preset = "WATER"
        self.assertFalse(measured())

    def test_another_file(self):
        """A hidden object is not what one of that name was in the file before."""
        item = self.cube(size=0.1)
        self.body(item)
        self.assertAlmostEqual(resolution.thinnest(self.scene), 0.1, places=5)
        panel._known(bpy.context)
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.assertEqual((resolution._known, panel._measured), ({}, {}))

    @needs_library
    def test_no_more_particles_than_the_limit(self):
        """A slab of a metre, 2 cm thick: 6 cells would be 4.3 million particles."""
        item = self.cube(size=1.0)
        item.scale = (1.0, 1.0, 0.02)
        bpy.context.view_layer.update()
        self.body(item)
        solver = self.settings.solver
        self.assertEqual(solver.quality, "STANDARD")
        document, folder = self.document("simulate")
        count = native.estimate(document, folder)["particles"]
        self.assertTrue(70000 < count <= 100000, count)
        self.assertEqual(resolution.limited_to(self.scene), (100000, "6 cells"))
        solver.most_particles = 10000000
        self.assertAlmostEqual(solver.particle_separation, 0.02 / 12, places=5)
        self.assertIsNone(resolution.limited_to(self.scene))

    def test_advice_for_thin_walls(self):
        """Less than three layers of a solid: what is that thin, and what to do, in the panel's words."""
        item = self.cube(size=1.0)
        item.scale = (1.0, 1.0, 0.02)
        bpy.context.view_layer.update()
        body = self.body(item)
        solver = self.settings.solver
        self.assertEqual(resolution.advice(self.scene), "")
        solver.most_particles = 20000
        self.assertRegex(resolution.advice(self.scene), (
            r"The thinnest part is 2 cm, as thick as [12] layers?: it bends and breaks too easily. Make it "
            r"\d\.?\d? cm thick, or raise Most Particles\."))
        solver.particle_separation = 0.02
        self.assertEqual(resolution.advice(self.scene), (
            "The thinnest part is 2 cm, as thick as 1 layer: it bends and breaks too easily. Make it 6 cm "
            "thick, or lower Particle Separation."))
        # Nearly three layers are never said to be three, nor advised to be as thick as they are.
        for share in (0.93, 0.97):
            solver.particle_separation = 0.02 / (2.0 * share * resolution.FEWEST_CELLS)
            self.assertEqual("2 layers: " in resolution.advice(self.scene), share < 0.95)
            self.assertNotIn("Make it 2 cm", resolution.advice(self.scene))
        body.material.preset = "WATER"
        self.assertEqual(resolution.advice(self.scene), "")

    @needs_library
    def test_the_limit_holds_for_what_is_filled(self):
        """Layers are whole: walls, and a body with a corner cut off, take more than volume / h³."""
        for kind in ("SOLIDIFY", "BOOLEAN", ""):
            for item in list(self.scene.objects):
                bpy.data.objects.remove(item)
            self.settings.bodies.clear()
            cutter = self.cube("Cutter", size=0.2, location=(0.45, 0.0, 0.75))
            item = self.cube(size=0.3, location=(0.3, 0.0, 0.6))
            if kind:
                modifier = item.modifiers.new(kind, kind)
                if kind == "BOOLEAN":
                    modifier.object = cutter
            solver = self.settings.solver
            solver.quality = "STANDARD"
            self.body(item)
            for limit in (3000, 5000, 9000):
                solver.most_particles = limit
                solver.quality = "FINE"
                document, folder = self.document("simulate")
                count = native.estimate(document, folder)["particles"]
                self.assertTrue(0.6 * limit < count <= limit, (kind, limit, count))


class PreviewTest(SceneCase):
    def test_thin_shapes(self):
        """A hollow box of walls 5 cm thick has hundreds of thousands of particles at twice the separation:
        its preview is coarser, with two layers across at least. A cube's is as it is asked for."""
        item = self.cube(size=1.0)
        self.body(item)
        solver = self.settings.solver
        self.assertAlmostEqual(resolution.for_preview(self.scene, 2.0 * solver.particle_separation),
                               2.0 * solver.particle_separation)
        self.assertAlmostEqual(resolution.for_preview(self.scene, 0.01), 0.01)  # a million, as typed
        modifier = item.modifiers.new("Solidify", "SOLIDIFY")
        modifier.thickness, modifier.use_even_offset = 0.05, True
        bpy.context.view_layer.update()
        solver.particle_separation = 0.005
        self.assertAlmostEqual(resolution.for_preview(self.scene, 0.01), 0.025, places=3)


class LimitTest(SceneCase):
    """No bake of a quality has more particles than Most Particles, whatever was measured when."""

    def count(self):
        document, folder = self.document("simulate")
        return native.estimate(document, folder)["particles"]

    @needs_library
    def test_wires(self):
        """Each wire of a Wireframe is filled, in as many particles as the limit leaves; the body is refused
        where most of it is thinner than any particle."""
        bpy.ops.mesh.primitive_monkey_add(size=0.5, location=(0.0, 0.0, 0.5))
        item = bpy.context.active_object
        wires = item.modifiers.new("Wireframe", "WIREFRAME")
        wires.thickness = 0.01
        bpy.context.view_layer.update()
        solver = self.settings.solver
        solver.most_particles = 3000
        self.body(item)
        self.assertTrue(1000 < self.count() <= 3000, self.count())
        self.assertIn("The thinnest part is ", resolution.advice(self.scene))
        self.assertIsNotNone(resolution.limited_to(self.scene))
        wires.thickness = 0.0005
        solver.particle_separation = 0.02
        self.fails(bpy.ops.matterfit.bake, ["'Suzanne': A Particle Separation of 2 cm is too large for the wires",
                                            "raise Most Particles"])

    @needs_library
    def test_wires_of_one_thickness(self):
        """Thin across as well as through, whichever way they lie to the lattice."""
        solver = self.settings.solver
        for thickness in (0.02, 0.005):
            self.settings.bodies.clear()
            item = self.cube(size=0.3)
            item.modifiers.new("Wireframe", "WIREFRAME").thickness = thickness
            bpy.context.view_layer.update()
            self.body(item)
            self.assertTrue(resolution.seen(self.scene)[item.name].wires)
            for limit in (1000, 3000):
                solver.most_particles = limit
                bpy.ops.matterfit.set_resolution()
                count = self.count()
                self.assertTrue(0.15 * limit < count <= limit, (thickness, limit, count))

    @needs_library
    def test_added_under_build(self):
        """A Build modifier leaves nothing at the first frame: measured is what stays once it is off."""
        for hidden in (False, True):
            self.settings.bodies.clear()
            item = self.cube(size=1.0, location=(0.0, 0.0, 1.0))
            item.modifiers.new("Build", "BUILD")
            bpy.context.view_layer.update()
            solver = self.settings.solver
            self.body(item)
            item.hide_set(hidden)
            self.fails(bpy.ops.matterfit.bake, ["its modifier 'Build' makes another mesh at every frame"])
            self.assertAlmostEqual(solver.particle_separation, 1.0 / 12, places=4)
            modifier = item.modifiers["Build"]
            self.assertTrue(modifier.show_viewport and modifier.show_render)
            modifier.show_viewport = modifier.show_render = False
            self.assertEqual(self.count(), 1728)

    @needs_library
    def test_where_the_simulation_begins(self):
        """An animated shape is measured as it is at the first frame, whichever is shown."""
        item = self.cube(size=0.2)
        self.body(item)
        solver = self.settings.solver
        solver.most_particles = 3000
        for frame, scale in ((1, 2.0), (6, 1.0)):
            item.scale = (scale,) * 3
            item.keyframe_insert("scale", frame=frame)
        self.scene.frame_set(6, subframe=0.5)
        bpy.ops.matterfit.set_resolution()
        self.assertEqual((self.scene.frame_current, self.scene.frame_subframe), (6, 0.5))
        self.assertEqual(solver.quality, "STANDARD")
        bpy.ops.matterfit.estimate()
        self.assertLessEqual(self.count(), 3000)
        self.assertAlmostEqual(solver.particle_separation, 0.4 / 12, places=4)

    @needs_library
    def test_shapes_that_have_grown(self):
        """A body that is scaled after it was added: the bake says what to press."""
        item = self.cube(size=0.2)
        solver = self.settings.solver
        solver.most_particles = 2000
        self.body(item)
        item.scale = (2.0, 2.0, 2.0)
        bpy.context.view_layer.update()
        self.assertEqual(self.count(), 13824)
        for press in (bpy.ops.matterfit.bake, bpy.ops.matterfit.estimate):
            self.fails(press, ["This makes 13 824 particles, more than Most Particles", "Press Set from Quality"])
        bpy.ops.matterfit.set_resolution()
        self.assertLessEqual(self.count(), 2000)
        bpy.ops.matterfit.estimate()
        # What is typed is meant.
        solver.particle_separation = 0.4 / 24
        bpy.ops.matterfit.estimate()
