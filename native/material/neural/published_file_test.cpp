// SPDX-License-Identifier: GPL-3.0-or-later
// Published weights from PyTorch's archive, and as a material file's tensors.
#include "material/neural/published_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.hpp"
#include "base/file.hpp"

namespace matterfit::material {
namespace {

std::filesystem::path jelly() {
  return std::filesystem::path(MATTERFIT_DATA_DIR) / "nclaw_weights" / "jelly_0300.pt";
}

TEST(PublishedFile, ArchiveGoesThroughTensors) {
  if (!std::filesystem::exists(jelly())) GTEST_SKIP() << jelly() << " is not there";
  const PublishedWeights weights = read_published_pt(jelly());
  const Tensors tensors = published_tensors(weights);
  EXPECT_EQ(tensors.tensors.size(), 6U);
  EXPECT_EQ(tensors.tensors.at("elastic.2").shape, (std::vector<std::size_t>{9, 64}));
  const PublishedWeights again = published_weights(tensors, "file");
  EXPECT_EQ(again.elastic, weights.elastic);
  EXPECT_EQ(again.plastic, weights.plastic);
}

TEST(PublishedFile, DamagedArchivesAreRefusedAtEveryLength) {
  if (!std::filesystem::exists(jelly())) GTEST_SKIP() << jelly() << " is not there";
  const std::vector<std::byte> bytes = read_file(jelly());
  for (std::size_t size = 0; size < bytes.size(); size += 997) {
    EXPECT_THROW((void)parse_published_pt(std::span(bytes).first(size), "cut"), Error) << size;
  }
}

TEST(PublishedFile, TensorsThatDoNotFitAreRefusedByName) {
  PublishedWeights weights;
  weights.elastic.assign(kNetWeights, 0.5F);
  weights.plastic.assign(kNetWeights, 0.25F);
  Tensors tensors = published_tensors(weights);
  tensors.tensors["plastic.1"].shape = {32, 128};
  try {
    (void)published_weights(tensors, "soft.safetensors");
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("soft.safetensors: tensor 'plastic.1'"));
  }
}

}  // namespace
}  // namespace matterfit::material
