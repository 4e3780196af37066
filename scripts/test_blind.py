# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests of the blind benchmark: the scorer, the finite elements, the seal, the strength of what is hidden.

    python scripts/test_blind.py
"""

import hashlib
import itertools
import json
import pathlib
import tempfile
import unittest
import unittest.mock

import blind_effects
import blind_elements
import blind_hide
import blind_open
import blind_scoring as scoring
import numpy as np
from blind_elements import Obstacle, Run


def verdict(kind, names=(), **more):
    report = {"verdict": kind, "class": list(names), "causes": [], "not_observable": [],
              "residual": {"train": {"rms": 2e-3}}, "noise": {"sigma": 1e-3}, "probability": {"nothing": 0.0}}
    return {"case": "000", "seconds": 60.0, "report": report | more}


def label(kind, *effects, **more):
    return {"tier": "T2", "kind": kind, "effects": list(effects), "strength": 4.0, "lambda": 1e4, "keep": 0.5, **more}


def row(hidden, said):
    return scoring.judged(hidden, said)


class Scoring(unittest.TestCase):
    def test_a_name_where_nothing_is_hidden_is_a_false_alarm(self):
        self.assertTrue(row(label("nothing"), verdict("cause", ["wind"]))["false_alarm"])
        for quiet in ("nothing", "numerical", "unknown"):
            self.assertFalse(row(label("nothing"), verdict(quiet))["false_alarm"])

    def test_ties_count_as_the_class_but_not_as_the_single_name(self):
        tied = row(label("single", "gravity_size"), verdict("measurement", ["scale"]))
        self.assertTrue(tied["first"] and tied["single"] and tied["single_class_right"])
        self.assertFalse(tied["single_right"])
        self.assertEqual(tied["false_names"], [])

    def test_the_first_name_counts_not_any(self):
        late = row(label("single", "wind"), verdict("class", ["gravity_direction", "wind"]))
        self.assertFalse(late["first"])
        self.assertTrue(late["all"])
        self.assertEqual(late["false_names"], ["gravity_direction"])

    def test_what_is_true_as_well_is_neither_right_nor_false(self):
        said = row(label("single", "wind", also=["drag_quadratic"]), verdict("several", ["drag_quadratic", "wind"]))
        self.assertFalse(said["first"])
        self.assertTrue(said["all"])
        self.assertEqual(said["false_names"], [])

    def test_ties_of_one_recording_alone(self):
        drop = label("single", "drag_quadratic", ties=["scale"])
        self.assertTrue(row(drop, verdict("measurement", ["scale"]))["first"])
        self.assertFalse(row(drop, verdict("measurement", ["scale"]))["all"])

    def test_pairs_need_both(self):
        pair = label("pair", "wind", "frame_rate")
        self.assertTrue(row(pair, verdict("several", ["scale", "wind"]))["all"])
        self.assertFalse(row(pair, verdict("cause", ["wind"]))["all"])

    def test_outside_the_catalogue(self):
        rows = [row(label("outside", "kick"), verdict("unknown")),
                row(label("outside", "kick"), verdict("cause", ["wind"])),
                row(label("outside", "gust", also=["force_field"]), verdict("cause", ["force_field"]))]
        found = scoring.figures(rows)
        self.assertAlmostEqual(found["unknown_found"]["value"], 1 / 3)
        self.assertAlmostEqual(found["outside_named"]["value"], 1 / 3)

    def test_a_diagnosis_that_failed_names_nothing(self):
        failed = row(label("single", "wind"), {"case": "000", "seconds": 1.0, "failed": "out of time"})
        self.assertFalse(failed["first"])
        self.assertEqual(scoring.figures([failed])["failed"], 1)

    def test_weak_effects_are_in_the_power_curve_only(self):
        rows = [row(label("single", "wind", strength=s), verdict("cause", ["wind"] if s > 3 else ["friction"]))
                for s in (0.5, 1.5, 5.0, 20.0)]
        self.assertEqual(scoring.figures(rows)["first"]["count"], 2)
        self.assertEqual([p["value"] for p in scoring.power(rows)], [0.0, 0.0, 1.0, 1.0])

    def test_calibration(self):
        def said(probability, effect):
            return verdict("cause", [effect], causes=[{"effect": effect, "probability": probability}])

        rows = [row(label("single", "wind"), said(0.9, "wind")) for _ in range(9)]
        rows.append(row(label("single", "wind"), said(0.9, "friction")))
        found = scoring.calibration(rows)
        self.assertAlmostEqual(found["expected_error"], 0.0)
        self.assertAlmostEqual(found["brier"], 0.9 * 0.01 + 0.1 * 0.81)
        quiet = scoring.calibration([row(label("nothing"), verdict("nothing", probability={"nothing": 0.8}, causes=[
            {"effect": "wind", "probability": 0.1}]))])
        self.assertAlmostEqual(quiet["expected_error"], 0.2)

    def test_the_size_of_what_was_named(self):
        hidden = label("single", "drag_linear", sizes={"drag_linear": {"number": "rate", "expected": 2.0}})
        cause = {"effect": "drag_linear", "accepted": True, "parameters": {"rate": {"value": 2.2, "stderr": 0.1}}}
        found = row(hidden, verdict("cause", ["drag_linear"], causes=[cause]))["parameter"]
        self.assertAlmostEqual(found["relative"], 0.1)
        self.assertFalse(found["covered"])

    def test_vectors_are_compared_as_a_whole(self):
        def said(effect, names, values):
            return verdict("cause", [effect], causes=[{"effect": effect, "accepted": True, "parameters": {
                n: {"value": v, "stderr": 0.1} for n, v in zip(names, values, strict=True)}}])

        def error(effect, names, values):
            hidden = label("single", effect, sizes={effect: {
                "number": "", "expected": 2.0, "direction": [0.6, 0.8, 0.0]}})
            return row(hidden, said(effect, names, values))["parameter"]

        wind = error("wind", ["velocity[0]", "velocity[1]", "velocity[2]"], [1.2, 1.6, 0.2])
        self.assertAlmostEqual(wind["relative"], 0.1)
        self.assertAlmostEqual(wind["angle"], np.degrees(np.arctan(0.1)), 3)
        self.assertTrue(wind["covered"])
        self.assertFalse(error("ground_tilt", ["x", "y"], [1.2, 1.9])["covered"])
        # Gravity's numbers are along y and x.
        self.assertAlmostEqual(error("gravity_direction", ["first", "second"], [1.6, 1.2])["relative"], 0.0)

    def test_localisation(self):
        places = {"left": [[3, 0], [3, 1], [4, 0]], "raw": [[f, 0] for f in range(8)]}
        wrong = [{"capture": "a", "frame": f, "region": r, "sigmas": 5.0} for f, r in ((3, 0), (4, 0), (9, 1))]
        residual = {"train": {"rms": 2e-3}, "wrong": wrong}
        found = row(label("single", "wind", places=places), verdict("unknown", residual=residual))["localisation"]
        self.assertAlmostEqual(found["left"], 2 * 2 / 6)
        self.assertAlmostEqual(found["raw"], 2 * 2 / 11)
        self.assertIsNone(row(label("nothing", places={"left": [], "raw": []}), verdict("nothing"))["localisation"])

    def test_false_discoveries_are_of_verdicts_that_name_several(self):
        rows = [row(label("pair", "wind", "friction"), verdict("several", ["wind", "friction", "yield"])),
                row(label("single", "wind"), verdict("cause", ["friction"]))]
        found = scoring.figures(rows)
        self.assertAlmostEqual(found["false_discoveries"]["value"], 1 / 3)
        self.assertAlmostEqual(found["false_names"]["value"], 2 / 4)

    def test_unknown_counts_in_the_calibration(self):
        said = verdict("unknown", probability={"nothing": 0.1, "unknown": 0.7},
                       causes=[{"effect": "wind", "probability": 0.2}])
        self.assertAlmostEqual(scoring.calibration([row(label("outside", "kick"), said)])["expected_error"], 0.3)
        self.assertAlmostEqual(scoring.calibration([row(label("single", "wind"), said)])["expected_error"], 0.7)

    def test_the_list_of_what_cannot_be_seen(self):
        late = label("unobservable", "time_offset")
        rows = [row(late, verdict("nothing", not_observable=["velocity"])), row(late, verdict("nothing")),
                row(label("single", "wind"), verdict("nothing", not_observable=["wind"]))]
        found = scoring.figures(rows)
        self.assertEqual(found["listed"]["value"], 0.5)
        self.assertEqual(found["listed_wrongly"]["value"], 1.0)

    def test_power_by_lambda_and_tier(self):
        rows = [row(label("single", "wind", **{"lambda": x}, tier=t), verdict("cause", ["wind"]))
                for x, t in ((30.0, "T0"), (2e3, "T0"), (2e3, "T2"))]
        found = scoring.power_by_lambda(rows)
        self.assertEqual([(p["from"], p["count"]) for p in found["T0"]], [(10.0, 1), (1e3, 1)])
        self.assertEqual(scoring.figures(rows)["power_30"]["count"], 1)
        # Of our own solver weak ones count as well, from λ = 100 on.
        weak = [row(label("single", "wind", strength=0.5, tier=t), verdict("cause", ["wind"])) for t in ("T0", "T1")]
        self.assertEqual(scoring.figures(weak)["first"]["count"], 1)

    def test_worst_tenth_of_the_share_of_the_true_gain(self):
        rows = [row(label("single", "wind"), verdict("cause", ["wind"])) | {"gain_ratio": k / 10} for k in range(11)]
        found = scoring.figures(rows)
        self.assertAlmostEqual(found["gain_ratio"], 0.5)
        self.assertAlmostEqual(found["gain_ratio_worst"], 0.1)

    def test_the_error_of_the_throw_that_an_extension_leaves(self):
        def fitted(value, error):
            return {"parameters": [{"path": f"bodies.body.velocity[{k}]", "value": value * (k == 0),
                                    "standard_error": error} for k in range(3)]}

        hidden = label("single", "wind", truth={"velocity": [1.0, 0.0, 0.0]})
        model = {"bodies": [{"velocity": [1.02, 0.0, 0.0]}]}
        said = verdict("cause", ["wind"], fit=fitted(1.2, 0.01), model=model)
        self.assertAlmostEqual(row(hidden, said)["bias"], 0.1)
        self.assertIsNone(row(hidden, verdict("cause", ["wind"], fit=fitted(1.2, 0.1), model=model))["bias"])

    def test_the_error_of_the_material_that_an_extension_leaves(self):
        fit = {"parameters": [{"path": "bodies.body.material.E", "value": 1.5e4, "standard_error": 10.0},
                              {"path": "bodies.body.material.nu", "value": 0.4, "standard_error": 0.1}]}
        hidden = label("single", "wind", truth={"E": 1e4, "nu": 0.3})
        model = {"bodies": [{"material": {"E": 1.1e4, "nu": 0.3}}]}
        found = row(hidden, verdict("cause", ["wind"], fit=fit, model=model))["biases"]
        self.assertEqual(set(found), {"E"})  # the other's error is within three of what was stated
        self.assertAlmostEqual(found["E"], 0.2)

    def test_interval_of_a_share(self):
        low, high = scoring.wilson(8, 10)  # Wilson 1927; as in statistics packages
        self.assertAlmostEqual(low, 0.4902, 3)
        self.assertAlmostEqual(high, 0.9433, 3)

    def test_the_table_holds_every_case(self):
        rows = [row(label("single", "wind"), verdict("cause", ["wind"])), row(label("nothing"), verdict("nothing"))]
        table, scores = blind_open.tables(rows)
        must, goal = blind_open.ASKED["first"]
        self.assertIn(f"| class first, λ ≥ 100 (T0), else strength ≥ 2 σ | {must} | {goal} | 100 %", table)
        self.assertIn("| 10000 to 100000 | T2 | 100 %", table)
        self.assertEqual(len(scores["cases"]), 2)
        json.dumps(scores)


def block(shape, size):
    cells = np.array(list(itertools.product(*map(range, shape))))
    return blind_elements.tetrahedra(cells, lambda p: p * size + [0.0, 0.0, 1.0])


# Few elements: what is tested does not depend on how many.
coarse = unittest.mock.patch.dict(blind_hide.SHAPES, {"cube": (2, 2, 2)}, clear=True)


class Elements(unittest.TestCase):
    def test_the_mesh_is_closed_and_its_volume_right(self):
        mesh = block((3, 2, 2), 0.1)
        a, b, c = (mesh.nodes[mesh.skin[:, k]] for k in range(3))
        self.assertAlmostEqual((a * np.cross(b, c)).sum() / 6.0, 0.012, 9)
        edges = np.sort(mesh.skin[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        self.assertTrue((np.unique(edges, axis=0, return_counts=True)[1] == 2).all())

    def test_stress_of_a_uniform_stretch(self):
        mesh, young, nu, stretch = block((2, 2, 2), 0.1), 1e5, 0.3, 1.1
        batch = blind_elements._Batch(mesh, [Run(young, nu, 1000.0, (0, 0, 0), (0, 0, 0))])
        x = mesh.nodes.T[:, None] * np.array([1.0, 1.0, stretch])[:, None, None]
        force = batch.internal(x.astype(np.float32), np.zeros_like(x), 0.0)[2, 0]
        mu, lam = young / (2 * (1 + nu)), young * nu / ((1 + nu) * (1 - 2 * nu))
        pull = mu * (stretch - 1 / stretch) + lam * np.log(stretch) / stretch  # first Piola–Kirchhoff
        top = mesh.nodes[:, 2] > 1.2 - 1e-9
        self.assertAlmostEqual(-force[top].sum() / (pull * 0.04), 1.0, 4)

    def test_flight_is_a_parabola_and_drag_decays(self):
        mesh, rate, fps, frames = block((2, 2, 2), 0.1), 2.0, 60, 20
        runs = [Run(1e4, 0.3, 100.0, (1, 0, 2), (1, 2, 3)),
                Run(1e4, 0.3, 100.0, (1, 0, 0), (0, 0, 0), gravity=(0, 0, 0), drag_rate=rate)]
        moved = blind_elements.simulate(mesh, runs, fps, frames).mean(axis=2)
        t = (frames - 1) / fps
        self.assertAlmostEqual(moved[0, -1, 2] - moved[0, 0, 2], 2.0 * t - 0.5 * 9.81 * t * t, 2)
        self.assertAlmostEqual(moved[1, -1, 0] - moved[1, 0, 0], (1.0 - np.exp(-rate * t)) / rate, 2)

    def test_what_slides_stops_by_friction(self):
        mesh = block((3, 3, 1), 0.1)
        mesh.nodes[:, 2] -= 1.0
        floor = Obstacle("plane", np.zeros(3), np.array([0.0, 0.0, 1.0]), friction=0.5)
        run = Run(2e5, 0.3, 1000.0, (1.0, 0, 0), (0, 0, 0), obstacles=[floor])
        path = blind_elements.simulate(mesh, [run], 60, 30)[0].mean(axis=1)[:, 0]
        self.assertAlmostEqual(path[-1] - path[0], 1.0 / (2.0 * 0.5 * 9.81), delta=0.02)

    @coarse
    def test_every_effect_moves_the_body(self):
        random = np.random.default_rng(3)
        for name, hidden in blind_effects.ALL.items():
            if not hidden.act:
                continue
            floor = hidden.scene == "floor"
            scene = blind_hide.draw_scene(random, floor, name in blind_effects.LIGHT)
            where = hidden.draw(scene, random) if hidden.draw else {}
            runs = [blind_hide.run_of(scene, 0.3, effects) for effects in ((), [(hidden, hidden.start, where)])]
            a, b = blind_elements.simulate(scene.mesh, runs, 60, 20)
            self.assertGreater(np.abs(a - b).max(), 1e-3, name)


class Hiding(unittest.TestCase):
    def test_what_a_fit_takes_along_has_no_strength(self):
        random = np.random.default_rng(5)
        base = random.normal(size=(blind_hide.FRAMES, 6, 3))
        times = np.arange(blind_hide.FRAMES) / 60.0
        used = np.ones((blind_hide.USED, 6, 3), bool)
        throw = times[:, None, None] * np.ones((1, 6, 1)) * np.array([1.0, 0.0, 0.0])
        fall = (times**2)[:, None, None] * np.ones((1, 6, 1)) * np.array([1.0, 0.0, 0.0])
        jacobian = throw[: blind_hide.USED][used][:, None]
        s, keep = blind_hide.strength_of([], base, base + 0.1 * throw, times, jacobian, used, 1e-3)
        self.assertLess(keep, 1e-6)
        s, keep = blind_hide.strength_of([], base, base + 0.1 * fall, times, jacobian, used, 1e-3)
        self.assertAlmostEqual(keep, 0.25, 2)  # of t², what is left beside t: √(1/5 − (1/4)²·3) / √(1/5)
        self.assertGreater(s, 1.0)

    @coarse
    def test_effects_get_the_strength_that_is_wanted(self):
        scene = blind_hide.draw_scene(np.random.default_rng(2), False, False)
        effects = [(blind_effects.EFFECTS[n], blind_effects.EFFECTS[n].start, {}) for n in ("gravity_size",)]
        _, s, keep, sized, apart = blind_hide.Hider.record(scene, 0.3, effects, 5.0, 1e-3)
        self.assertAlmostEqual(s, 5.0, delta=0.3)
        # A fall of ½ a t², less what a throw from the same place imitates: √(1/5 − 3/16) of it.
        end = (blind_hide.USED - 1) / blind_effects.FPS
        self.assertAlmostEqual(sized[0][1] * 0.5 * end**2 / np.sqrt(80.0) / np.sqrt(3.0), 5e-3, delta=4e-4)
        self.assertGreater(keep, 0.1)
        self.assertEqual(apart["left"].shape, (blind_hide.USED, len(scene.mesh.surface), 3))
        self.assertLess(np.linalg.norm(apart["left"]), np.linalg.norm(apart["raw"]))

    def test_places_are_where_a_region_is_another(self):
        random = np.random.default_rng(4)
        first = random.uniform(-1.0, 1.0, (64, 3)) * [2.0, 1.0, 0.1]
        first[5] = np.nan
        region = scoring.body_regions(first)
        self.assertEqual(region[5], -1)
        self.assertEqual(set(region), {-1, 0, 1, 2, 3})  # flat: not divided along z
        self.assertTrue((first[(region == 1) | (region == 3), 0] > np.nanmedian(first[:, 0]) - 1e-9).all())
        apart = np.zeros((3, 64, 3))
        apart[2, region == 3] = [0.0, 0.0, 1e-3]
        apart[1] = 1e-5
        visible = np.ones((3, 64), bool)
        places = blind_hide.places_of({"left": apart}, 1e-3, first, visible)
        self.assertEqual(places, {"left": [[2, 3]]})

    def test_correlated_noise_has_its_size(self):
        noise = blind_hide.add_noise(np.random.default_rng(1), np.zeros((400, 200, 3)), 2.0, "correlated")
        self.assertAlmostEqual(noise.std(), 2.0, delta=0.1)
        lagged = (noise[1:] * noise[:-1]).mean() / (noise * noise).mean()
        self.assertAlmostEqual(lagged, 0.8, delta=0.03)

    def test_the_full_set_has_its_shares_and_is_the_same_again(self):
        rows = blind_hide.plan("full", 400, 1)
        self.assertEqual(rows, blind_hide.plan("full", 400, 1))
        self.assertEqual(len(rows), 400)
        drawn = [effects for tier, effects, *_ in rows if tier != "T4"]
        self.assertGreaterEqual(sum(not e for e in drawn), 100)
        self.assertGreaterEqual(sum(len(e) == 2 for e in drawn), 40)
        self.assertGreaterEqual(sum(e[:1] != [] and e[0] in blind_effects.OUTSIDE for e in drawn), 40)

    def test_a_broken_seal_is_refused(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            (folder / "sealed").mkdir()
            (folder / "sealed" / "labels.json").write_text("{}", encoding="utf-8")
            seal = {"sealed/labels.json": hashlib.sha256(b"{}").hexdigest()}
            (folder / "seal.json").write_text(json.dumps(seal), encoding="utf-8")
            self.assertEqual(blind_open.check_seal(folder), seal["sealed/labels.json"])
            (folder / "sealed" / "labels.json").write_text("{ }", encoding="utf-8")
            with self.assertRaises(SystemExit):
                blind_open.check_seal(folder)


if __name__ == "__main__":
    unittest.main()
