// Gathers one value for each tile on every rank, in the order of the tiles. A sum over the gathered values therefore
// has the same bits on any number of ranks.
#pragma once

#include <cstdint>
#include <vector>

#include "merge/scratch/bytes.h"
#include "merge/step/tile_store.h"
#include "merge/tree/tree_communicator.h"

namespace megablock {

// Bytes of a value: by its own to_bytes(), or as it stands in memory.
namespace tile_bytes {

template <typename Value>
concept MakesBytes = requires(const Value& value) {
  value.to_bytes();
};

template <typename Value>
void write(ByteWriter& writer, const Value& value) {
  if constexpr (MakesBytes<Value>)
    writer.bytes(value.to_bytes());
  else
    writer.value(value);
}
inline void write(ByteWriter& writer, const UnknownList& unknowns) { writer.values(unknowns); }

template <typename Value>
void read(ByteReader& reader, Value& value) {
  if constexpr (MakesBytes<Value>)
    value = Value::from_bytes(reader.bytes());
  else
    value = reader.value<Value>();
}
inline void read(ByteReader& reader, UnknownList& unknowns) { unknowns = reader.values<Unknown>(); }

}  // namespace tile_bytes

// `tiles`: number of all tiles of the block; each is held by one rank or by none. `tile_of(i)` is the tile of
// values[i].
template <typename Value, typename TileOf>
std::vector<Value> gather_by_tile(TreeCommunicator& ranks, std::size_t tiles, const std::vector<Value>& values,
                                  const TileOf& tile_of) {
  ByteWriter writer;
  for (std::size_t i = 0; i < values.size(); ++i) {
    writer.value(static_cast<std::int64_t>(tile_of(i)));
    tile_bytes::write(writer, values[i]);
  }
  std::vector<Value> all(tiles);
  for (const Bytes& bytes : ranks.gather_all(writer.take())) {
    ByteReader reader(bytes);
    while (!reader.at_end()) {
      const auto tile = reader.value<std::int64_t>();
      tile_bytes::read(reader, all[static_cast<std::size_t>(tile)]);
    }
  }
  return all;
}

template <typename Value>
std::vector<Value> gather_by_tile(TreeCommunicator& ranks, std::size_t tiles, const TileStore& own,
                                  const std::vector<Value>& values) {
  return gather_by_tile(ranks, tiles, values, [&](std::size_t i) { return own.number(i); });
}

}  // namespace megablock
