// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/mesh.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "base/error.hpp"
#include "base/file.hpp"
#include "base/message_for_test.hpp"
#include "capture/bytes_for_test.hpp"
#include "capture/npz.hpp"

namespace matterfit::capture {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class MeshTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("matterfit_mesh_test_" + std::to_string(::getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  fs::path folder_;
};

void expect_sample(const Mesh& mesh) {
  ASSERT_EQ(mesh.vertices.size(), 5U);
  EXPECT_EQ(mesh.vertices[4], Vec3f(0.5F, 0.5F, 1.0F));
  EXPECT_THAT(mesh.face_sizes, ElementsAre(4, 3));
  EXPECT_THAT(mesh.face_vertices, ElementsAre(0, 1, 2, 3, 0, 1, 4));
}

constexpr const char* kObj =
    "# a comment\nmtllib none.mtl\no body\nv 0 0 0\nv 1 0 0 1.0\nv 1 1 0\nv 0 1 0\n"
    "vt 0 0\nvn 0 0 1\ns off\nf 1/1/1 2/1/1 3/1/1 4//1\nv .5 5e-1 1\nf 1 2 -1 # last\n";

TEST_F(MeshTest, ObjThenPlyThenNpz) {
  const Mesh mesh = parse_mesh_obj(bytes_of(kObj), "a.obj");
  expect_sample(mesh);

  write_mesh_ply(folder_ / "a.ply", mesh);
  expect_sample(read_mesh(folder_ / "a.ply"));

  Arrays arrays;
  arrays.emplace("vertices",
                 Array({5, 3}, std::vector<double>{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, .5, .5, 1}));
  arrays.emplace("face_sizes", Array({2}, std::vector<std::int32_t>{4, 3}));
  arrays.emplace("face_vertices", Array({7}, std::vector<std::int64_t>{0, 1, 2, 3, 0, 1, 4}));
  arrays.emplace("crease_edges", Array({1, 2}, std::vector<std::int32_t>{0, 1}));
  arrays.emplace("crease_sharpness", Array({1}, std::vector<float>{10.0F}));
  write_npz(folder_ / "a.NPZ", arrays);
  const Mesh cage = read_mesh(folder_ / "a.NPZ");
  expect_sample(cage);
  EXPECT_THAT(cage.crease_edges, ElementsAre(0, 1));
  EXPECT_THAT(cage.crease_sharpness, ElementsAre(10.0F));

  arrays.insert_or_assign("crease_edges", Array({1, 2}, std::vector<std::int32_t>{0, 5}));
  EXPECT_THAT(message_of([&] {
                const std::string bytes = format_npz(arrays);
                (void)parse_mesh_npz(bytes_of(bytes), "cage.npz");
              }),
              HasSubstr("crease 0 names a vertex that is not there"));
}

TEST_F(MeshTest, DamagedMeshesAreNamedByFace) {
  const auto refuse = [](const std::string& text, const char* words) {
    EXPECT_THAT(message_of([&] { (void)parse_mesh_obj(bytes_of(text), "a.obj"); }),
                HasSubstr(words))
        << text;
  };
  const std::string triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  refuse(triangle + "f 1 2 4\n", "face 0 names vertex 3 of 3");
  refuse(triangle + "f 1 2 -4\n", "line 4: a face names vertex -4 of 3");
  refuse(triangle + "f 1 2 0\n", "names vertex 0");
  refuse(triangle + "f 1 2\n", "at least three");
  refuse(triangle + "f 1 2 99999999999999999999\n", "no vertex of a face");
  refuse(triangle, "no faces");
  refuse("v 0 0\n", "line 1: a vertex needs three numbers");
  refuse("v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "vertex 0 is not finite");
  refuse("", "no vertices");
  EXPECT_THAT(message_of([&] { (void)read_mesh(folder_ / "a.stl"); }), HasSubstr("'.stl'"));
}

}  // namespace
}  // namespace matterfit::capture
