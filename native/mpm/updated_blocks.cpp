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

template <class S>
void clear_lane(UpdatedChunk<S>& chunk, std::size_t lane) {
  for (std::size_t a = 0; a < UpdatedChunk<S>::kAttributes; ++a) chunk.a[a][lane] = S(0);
  for (std::size_t a = 0; a < 3; ++a) chunk.a[UpdatedChunk<S>::kF + a][lane] = S(1);
  chunk.id[lane] = 0;
}

}  // namespace

template <class S>
void BodyBlock<S>::insert(const Crosser<S>& particle) {
  using Chunk = UpdatedChunk<S>;
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

template <class S>
void BodyBlock<S>::remove(const std::vector<Crosser<S>>& leaving) {
  using Chunk = UpdatedChunk<S>;
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

template <class S>
std::size_t BodyBlock<S>::size() const {
  std::size_t sum = 0;
  for (const auto& lanes : count) {
    for (const std::uint16_t n : lanes) sum += n;
  }
  return sum;
}

template <class S>
std::uint32_t UpdatedBlocks<S>::ensure(const Vec3i& coordinates) {
  const auto [place, fresh] =
      index_.try_emplace(key(coordinates), static_cast<std::uint32_t>(blocks_.size()));
  if (!fresh) return place->second;
  const std::uint32_t here = place->second;
  auto block = std::make_unique<UpdatedBlock<S>>();
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

template <class S>
void UpdatedBlocks<S>::occupy(std::uint32_t block) {
  if (blocks_[block]->occupied) return;
  blocks_[block]->occupied = true;
  blocks_[block]->halo.assign(4 * kHaloNodes, S(0));
  const Vec3i c = blocks_[block]->coordinates;
  for (int k = 1; k < 8; ++k) ensure(c + Vec3i(k / 4, k / 2 % 2, k % 2));
}

template <class S>
void UpdatedBlocks<S>::relink() {
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

template <class S>
void UpdatedBlocks<S>::tidy() {
  for (const auto& block : blocks_) {
    std::size_t particles = 0;
    for (const BodyBlock<S>& body : block->bodies) particles += body.size();
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
  std::vector<std::unique_ptr<UpdatedBlock<S>>> kept;
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

template <class S>
void UpdatedBlocks<S>::save(ByteWriter& out) const {
  out.put(static_cast<std::uint64_t>(blocks_.size()));
  for (const auto& block : blocks_) {
    out.put(
        std::array<int, 3>{block->coordinates[0], block->coordinates[1], block->coordinates[2]});
    out.put(block->occupied);
    out.put(block->halo);
    for (const BodyBlock<S>& body : block->bodies) {
      out.put(body.count);
      for (const auto& slab : body.slab) out.put(slab);
    }
  }
}

template <class S>
void UpdatedBlocks<S>::load(ByteReader& in) {
  std::uint64_t size = 0;
  in.get(size);
  blocks_.clear();
  for (std::uint64_t b = 0; b < size; ++b) {
    auto block = std::make_unique<UpdatedBlock<S>>();
    std::array<int, 3> c{};
    in.get(c);
    block->coordinates = Vec3i(c[0], c[1], c[2]);
    std::uint8_t occupied = 0;
    in.get(occupied);
    block->occupied = occupied != 0;
    in.get(block->halo);
    block->bodies.resize(bodies_);
    block->leaving.resize(bodies_);
    for (BodyBlock<S>& body : block->bodies) {
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

template struct BodyBlock<float>;
template struct BodyBlock<double>;
template class UpdatedBlocks<float>;
template class UpdatedBlocks<double>;

}  // namespace matterfit::mpm
