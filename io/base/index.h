// Gives each kind of object an index type of its own, so that the compiler refuses to mix them up.
//
// GlobalIndex<Kind> is a dense 64-bit index in the block, LocalIndex<Kind> a dense 32-bit index in a tile. Names that
// users see are strings; they never serve as keys inside the program.
#pragma once

#include <compare>
#include <cstdint>
#include <functional>
#include <vector>

namespace megablock {

template <typename Kind>
struct GlobalIndex {
  std::int64_t value = -1;
  constexpr GlobalIndex() = default;
  constexpr explicit GlobalIndex(std::int64_t v) : value(v) {}
  constexpr bool valid() const { return value >= 0; }
  friend constexpr auto operator<=>(GlobalIndex, GlobalIndex) = default;
};

template <typename Kind>
struct LocalIndex {
  std::int32_t value = -1;
  constexpr LocalIndex() = default;
  constexpr explicit LocalIndex(std::int32_t v) : value(v) {}
  constexpr bool valid() const { return value >= 0; }
  friend constexpr auto operator<=>(LocalIndex, LocalIndex) = default;
};

struct CameraKind;
struct RigKind;
struct FrameKind;
struct ImageKind;
struct PointKind;
struct TileKind;

using CameraIndex = GlobalIndex<CameraKind>;
using RigIndex = GlobalIndex<RigKind>;
using FrameIndex = GlobalIndex<FrameKind>;
using ImageIndex = GlobalIndex<ImageKind>;
using TrackIndex = GlobalIndex<PointKind>;  // a track and its tie point share an index
using TileIndex = GlobalIndex<TileKind>;

using LocalCamera = LocalIndex<CameraKind>;
using LocalFrame = LocalIndex<FrameKind>;
using LocalImage = LocalIndex<ImageKind>;
using LocalPoint = LocalIndex<PointKind>;

// A vector that is addressed by one index type only.
template <typename Index, typename Value>
class IndexedVector : public std::vector<Value> {
 public:
  using Base = std::vector<Value>;
  using Base::Base;
  IndexedVector() = default;
  explicit IndexedVector(Base values) : Base(std::move(values)) {}
  decltype(auto) operator[](Index i) { return Base::operator[](static_cast<std::size_t>(i.value)); }
  decltype(auto) operator[](Index i) const { return Base::operator[](static_cast<std::size_t>(i.value)); }
  decltype(auto) at(Index i) { return Base::at(static_cast<std::size_t>(i.value)); }
  decltype(auto) at(Index i) const { return Base::at(static_cast<std::size_t>(i.value)); }
  bool contains(Index i) const { return i.value >= 0 && static_cast<std::size_t>(i.value) < this->size(); }
  Index next_index() const { return Index(static_cast<decltype(Index::value)>(this->size())); }
};

}  // namespace megablock

template <typename Kind>
struct std::hash<megablock::GlobalIndex<Kind>> {
  std::size_t operator()(megablock::GlobalIndex<Kind> i) const noexcept { return std::hash<std::int64_t>{}(i.value); }
};
template <typename Kind>
struct std::hash<megablock::LocalIndex<Kind>> {
  std::size_t operator()(megablock::LocalIndex<Kind> i) const noexcept { return std::hash<std::int32_t>{}(i.value); }
};
