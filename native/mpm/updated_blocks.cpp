// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/updated_blocks.hpp"

#include <algorithm>
#include <limits>
#include <tuple>

#include "base/error.hpp"

namespace matterfit::mpm {
namespace {

constexpr std::size_t kMiddle = 13;

Vec3i neighbour_step(std::size_t k) {
  const int i = static_cast<int>(k);
  return {i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1};
}

std::array<int, 3> key(const Vec3i& c) { return {c[0], c[1], c[2]}; }

void clear_lane(Chunk& chunk, std::size_t lane) {
  for (std::size_t a = 0; a < Chunk::kAttributes; ++a) chunk.a[a][lane] = 0.0F;
  for (std::size_t a = 0; a < 3; ++a) chunk.a[Chunk::kF + a][lane] = 1.0F;
  chunk.id[lane] = 0;
}

}  // namespace

void BodyBlock::insert(const Crosser<float>& particle) {
  const std::size_t s = particle.cell / kLanes;
  const std::size_t lane = particle.cell % kLanes;
  if (count[s][lane] == std::numeric_limits<std::uint16_t>::max()) {
    throw_compute(
        "More than 65535 particles lie in one cell of the grid: the material has collapsed, or its "
        "points are far closer than the particle separation. Use fewer points or a stiffer "
        "material.");
  }
  const std::size_t slot = count[s][lane]++;
  if (slot == slab[s].size()) {
    slab[s].emplace_back();
    for (std::size_t l = 0; l < kLanes; ++l) clear_lane(slab[s].back(), l);
  }
  Chunk& chunk = slab[s][slot];
  for (std::size_t c = 0; c < 3; ++c) {
    chunk.a[Chunk::kF + c][lane] = particle.f[c];
    chunk.a[Chunk::kVelocity + c][lane] = particle.velocity[c];
  }
  for (std::size_t c = 0; c < 9; ++c) chunk.a[Chunk::kH + c][lane] = particle.h[c];
  chunk.a[Chunk::kVolume][lane] = particle.volume;
  chunk.a[Chunk::kStrain][lane] = particle.strain;
  chunk.id[lane] = particle.id;
}

void BodyBlock::remove(const std::vector<Crosser<float>>& leaving) {
  // From the back: the last of a lane is then always one that stays.
  for (auto p = leaving.rbegin(); p != leaving.rend(); ++p) {
    std::uint16_t& n = count[p->slab][p->lane];
    --n;
    std::vector<Chunk>& chunks = slab[p->slab];
    if (p->chunk != n) {
      for (std::size_t a = 0; a < Chunk::kAttributes; ++a) {
        chunks[p->chunk].a[a][p->lane] = chunks[n].a[a][p->lane];
      }
      chunks[p->chunk].id[p->lane] = chunks[n].id[p->lane];
    }
    clear_lane(chunks[n], p->lane);
  }
  for (std::size_t s = 0; s < kSlabs; ++s) {
    const std::size_t needed = *std::max_element(count[s].begin(), count[s].end());
    slab[s].resize(needed);
  }
}

std::size_t BodyBlock::size() const {
  std::size_t sum = 0;
  for (const auto& lanes : count) {
    for (const std::uint16_t n : lanes) sum += n;
  }
  return sum;
}

std::uint32_t UpdatedBlocks::ensure(const Vec3i& coordinates) {
  const auto [place, fresh] =
      index_.try_emplace(key(coordinates), static_cast<std::uint32_t>(blocks_.size()));
  if (!fresh) return place->second;
  const std::uint32_t here = place->second;
  auto block = std::make_unique<UpdatedBlock>();
  block->coordinates = coordinates;
  block->bodies.resize(bodies_);
  block->leaving.resize(bodies_);
  for (std::size_t k = 0; k < 27; ++k) {
    const auto other = index_.find(key(coordinates + neighbour_step(k)));
    block->neighbours[k] = other == index_.end() ? kNoBlock : other->second;
    if (other != index_.end() && k != kMiddle) {
      blocks_[other->second]->neighbours[26 - k] = here;
    }
  }
  blocks_.push_back(std::move(block));
  return here;
}

void UpdatedBlocks::occupy(std::uint32_t block) {
  if (blocks_[block]->occupied) return;
  blocks_[block]->occupied = true;
  blocks_[block]->halo.assign(4 * kHaloNodes, 0.0F);
  const Vec3i c = blocks_[block]->coordinates;
  for (int k = 1; k < 8; ++k) ensure(c + Vec3i(k / 4, k / 2 % 2, k % 2));
}

void UpdatedBlocks::relink() {
  index_.clear();
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    index_.emplace(key(blocks_[b]->coordinates), static_cast<std::uint32_t>(b));
  }
  for (const auto& block : blocks_) {
    for (std::size_t k = 0; k < 27; ++k) {
      const auto other = index_.find(key(block->coordinates + neighbour_step(k)));
      block->neighbours[k] = other == index_.end() ? kNoBlock : other->second;
    }
  }
}

void UpdatedBlocks::tidy() {
  for (const auto& block : blocks_) {
    std::size_t particles = 0;
    for (const BodyBlock& body : block->bodies) particles += body.size();
    if (particles == 0 && block->occupied) {
      block->occupied = false;
      block->halo.clear();
      block->halo.shrink_to_fit();
    }
  }
  std::vector<std::uint8_t> needed(blocks_.size(), 0);
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    for (int k = 0; k < 8; ++k) {
      // Nodes of this block are touched from blocks at (−a, −b, −c).
      const std::size_t n =
          kMiddle - static_cast<std::size_t>(9 * (k / 4) + 3 * (k / 2 % 2) + k % 2);
      const std::uint32_t other = blocks_[b]->neighbours[n];
      if (other != kNoBlock && blocks_[other]->occupied) needed[b] = 1;
    }
  }
  std::vector<std::unique_ptr<UpdatedBlock>> kept;
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    if (needed[b] != 0) kept.push_back(std::move(blocks_[b]));
  }
  blocks_ = std::move(kept);
  std::sort(blocks_.begin(), blocks_.end(), [](const auto& a, const auto& b) {
    const Vec3i& p = a->coordinates;
    const Vec3i& q = b->coordinates;
    return std::tie(p[0], p[1], p[2]) < std::tie(q[0], q[1], q[2]);
  });
  relink();
}

void UpdatedBlocks::save(ByteWriter& out) const {
  out.put(static_cast<std::uint64_t>(blocks_.size()));
  for (const auto& block : blocks_) {
    out.put(
        std::array<int, 3>{block->coordinates[0], block->coordinates[1], block->coordinates[2]});
    out.put(block->occupied);
    out.put(block->halo);
    for (const BodyBlock& body : block->bodies) {
      out.put(body.count);
      for (const auto& slab : body.slab) out.put(slab);
    }
  }
}

void UpdatedBlocks::load(ByteReader& in) {
  std::uint64_t size = 0;
  in.get(size);
  blocks_.clear();
  for (std::uint64_t b = 0; b < size; ++b) {
    auto block = std::make_unique<UpdatedBlock>();
    std::array<int, 3> c{};
    in.get(c);
    block->coordinates = Vec3i(c[0], c[1], c[2]);
    std::uint8_t occupied = 0;
    in.get(occupied);
    block->occupied = occupied != 0;
    in.get(block->halo);
    block->bodies.resize(bodies_);
    block->leaving.resize(bodies_);
    for (BodyBlock& body : block->bodies) {
      in.get(body.count);
      for (std::size_t s = 0; s < kSlabs; ++s) {
        in.get(body.slab[s]);
        const std::size_t most = *std::max_element(body.count[s].begin(), body.count[s].end());
        if (most > body.slab[s].size()) ByteReader::fail();
      }
    }
    if (block->halo.size() != (block->occupied ? 4 * kHaloNodes : 0)) ByteReader::fail();
    blocks_.push_back(std::move(block));
  }
  relink();
  for (const auto& block : blocks_) {
    for (int k = 1; k < 8 && block->occupied; ++k) {
      const int there = static_cast<int>(kMiddle) + 9 * (k / 4) + 3 * (k / 2 % 2) + k % 2;
      if (block->neighbours[static_cast<std::size_t>(there)] == kNoBlock) ByteReader::fail();
    }
  }
}

}  // namespace matterfit::mpm
