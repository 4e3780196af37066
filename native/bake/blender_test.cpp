// SPDX-License-Identifier: GPL-3.0-or-later
// What Blender itself makes of our volumes and point caches, with no add-on.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "bake/pc2.hpp"
#include "bake/test_support.hpp"
#include "bake/volume.hpp"

namespace matterfit::bake {
namespace {

class BlenderTest : public FolderTest {};

TEST_F(BlenderTest, PlaysVolumesAndPointCaches) {
  int status = 0;
  run("blender --version", status);
  if (status != 0) GTEST_SKIP() << "blender is not installed";

  Arena arena(2);
  const Interrupter interrupter;
  Specimen body = ball(0.05, 0.4);
  body.move(Mat3d::Identity(), Vec3d(0.0, 0.0, 2.0), Mat3d::Identity());
  const capture::ParticleView view = body.view();
  VolumeOptions options;
  options.velocity = true;
  options.surface = true;
  write_volume(folder_ / "blob_0001.vdb", {&view, 1}, options, arena, interrupter);
  Pc2Writer writer(folder_ / "points.pc2", {3, 1.0F, 1.0F});
  for (int frame = 0; frame < 5; ++frame) {
    const auto t = static_cast<float>(frame);
    writer.append(
        std::vector<Vec3f>{Vec3f(t, 0.0F, 0.0F), Vec3f(0.0F, t, 1.0F), Vec3f(7.0F, 8.0F, t)});
  }
  writer.finish();
  spill(folder_ / "check.py", R"(
import bpy, os
here = os.path.dirname(os.path.abspath(__file__))
scene = bpy.context.scene
volume = bpy.data.volumes.new('blob')
volume.filepath = os.path.join(here, 'blob_0001.vdb')
volume.grids.load()
assert volume.grids.is_loaded, volume.grids.error_message
names = {g.name: g.data_type for g in volume.grids}
assert names == {'density': 'FLOAT', 'velocity': 'VECTOR_FLOAT', 'surface': 'FLOAT'}, names
source = bpy.data.objects.new('blob', volume)
scene.collection.objects.link(source)
mesh = bpy.data.meshes.new('surface')
surface = bpy.data.objects.new('surface', mesh)
scene.collection.objects.link(surface)
modifier = surface.modifiers.new('v', 'VOLUME_TO_MESH')
modifier.object, modifier.grid_name, modifier.threshold = source, 'surface', 0
points = bpy.data.objects.new('points', bpy.data.meshes.new('points'))
points.data.from_pydata([(0, 0, 0)] * 3, [], [])
scene.collection.objects.link(points)
cache = points.modifiers.new('c', 'MESH_CACHE')
cache.cache_format, cache.filepath = 'PC2', os.path.join(here, 'points.pc2')
cache.frame_start = 1
scene.frame_set(3)
depsgraph = bpy.context.evaluated_depsgraph_get()
moved = [tuple(v.co) for v in points.evaluated_get(depsgraph).data.vertices]
assert moved == [(2, 0, 0), (0, 2, 1), (7, 8, 2)], moved
vertices = surface.evaluated_get(depsgraph).data.vertices
radius = [(v.co[0] ** 2 + v.co[1] ** 2 + (v.co[2] - 2) ** 2) ** .5 for v in vertices]
assert len(radius) > 100 and .35 < min(radius) and max(radius) < .45, (len(radius), min(radius), max(radius))
print('PLAYED')
)");
  const std::string home = "HOME='" + folder_.string() + "' XDG_CONFIG_HOME='" + folder_.string() +
                           "' XDG_CACHE_HOME='" + folder_.string() + "' ";
  const std::string text = run(home + "blender -b --factory-startup --python-exit-code 1 -P '" +
                                   (folder_ / "check.py").string() + "'",
                               status);
  EXPECT_EQ(status, 0) << text;
  EXPECT_NE(text.find("PLAYED"), std::string::npos) << text;
}

}  // namespace
}  // namespace matterfit::bake
