// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/updated_record.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "mpm/state_bytes.hpp"

namespace matterfit::mpm {

template <class S>
std::size_t UpdatedRecord<S>::bytes() const {
  std::size_t sum = bytes_of(node_mass) + bytes_of(node_velocity) + bytes_of(slab_chunks) +
                    chunks.size() * sizeof(KeptChunk<S>) +
                    velocities.size() * sizeof(KeptVelocity<S>);
  for (const UpdatedActsPtr& of_load : acts) sum += of_load ? of_load->bytes() : 0;
  for (const std::vector<S>& of_body : maxwell) sum += bytes_of(of_body);
  return sum;
}

template <class S>
void UpdatedRecord<S>::add_acts(std::vector<UpdatedActsPtr>&& of_block) {
  acts.resize(std::max(acts.size(), of_block.size()));
  for (std::size_t k = 0; k < of_block.size(); ++k) {
    if (!of_block[k]) continue;
    if (acts[k]) {
      acts[k]->append(*of_block[k]);
    } else {
      acts[k] = std::move(of_block[k]);
    }
  }
}

template <class S>
std::shared_ptr<const UpdatedTopology> take_topology(const UpdatedBlocks<S>& blocks) {
  auto topology = std::make_shared<UpdatedTopology>();
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    topology->coordinates.push_back(blocks[b].coordinates);
    topology->neighbours.push_back(blocks[b].neighbours);
  }
  return topology;
}

template <class S>
void keep_particles(Arena& arena, const UpdatedBlocks<S>& blocks,
                    const std::vector<UpdatedMember<S>>& members, bool velocities,
                    UpdatedRecord<S>& record) {
  record.slab_chunks.clear();
  std::size_t chunks = 0;
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    for (const BodyBlock<S>& body : blocks[b].bodies) {
      for (const auto& slab : body.slab) {
        record.slab_chunks.push_back(static_cast<std::uint32_t>(chunks));
        chunks += slab.size();
      }
    }
  }
  record.slab_chunks.push_back(static_cast<std::uint32_t>(chunks));
  record.chunks.resize(chunks);
  record.velocities.resize(velocities ? chunks : 0);
  const std::size_t slabs = members.size() * kSlabs;
  arena.parallel_for(0, blocks.size(), 4, [&](std::size_t b) {
    KeptChunk<S>* to = record.chunks.data() + record.slab_chunks[b * slabs];
    KeptVelocity<S>* velocity =
        velocities ? record.velocities.data() + record.slab_chunks[b * slabs] : nullptr;
    for (const BodyBlock<S>& body : blocks[b].bodies) {
      for (const auto& slab : body.slab) {
        for (const UpdatedChunk<S>& from : slab) {
          std::memcpy(to->a, from.a, sizeof(to->a));
          std::memcpy(to->id, from.id, sizeof(to->id));
          ++to;
          if (!velocities) continue;
          std::memcpy(velocity->v, from.a[UpdatedChunk<S>::kVelocity], sizeof(velocity->v));
          ++velocity;
        }
      }
    }
  });
  record.maxwell.resize(members.size());
  for (std::size_t m = 0; m < members.size(); ++m) record.maxwell[m] = members[m].maxwell;
}

template struct UpdatedRecord<float>;
template struct UpdatedRecord<double>;
template std::shared_ptr<const UpdatedTopology> take_topology<float>(const UpdatedBlocks<float>&);
template std::shared_ptr<const UpdatedTopology> take_topology<double>(const UpdatedBlocks<double>&);
template void keep_particles<float>(Arena&, const UpdatedBlocks<float>&,
                                    const std::vector<UpdatedMember<float>>&, bool,
                                    UpdatedRecord<float>&);
template void keep_particles<double>(Arena&, const UpdatedBlocks<double>&,
                                     const std::vector<UpdatedMember<double>>&, bool,
                                     UpdatedRecord<double>&);

}  // namespace matterfit::mpm
