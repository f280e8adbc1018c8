#include "partition/candidates/places.h"

#include <algorithm>
#include <map>
#include <tuple>

#include "io/base/disjoint_sets.h"
#include "io/base/error.h"

namespace megablock {

namespace {

using Rows = std::vector<std::int64_t>;

std::size_t at(std::int64_t row) { return static_cast<std::size_t>(row); }

// Neighbours of each position along interior and normal edges.
std::vector<Rows> neighbours_of(std::size_t count, const std::vector<PanoramaEdge>& edges) {
  std::vector<Rows> neighbours(count);
  for (const PanoramaEdge& edge : edges) {
    if (edge.kind != EdgeClass::kInterior && edge.kind != EdgeClass::kNormal) continue;
    neighbours[at(edge.a)].push_back(edge.b);
    neighbours[at(edge.b)].push_back(edge.a);
  }
  return neighbours;
}

// Number of the connected component of each position.
std::vector<std::int32_t> components_of(const std::vector<Rows>& neighbours) {
  DisjointSets sets(static_cast<std::int64_t>(neighbours.size()));
  for (std::size_t row = 0; row < neighbours.size(); ++row)
    for (const std::int64_t other : neighbours[row]) sets.unite(static_cast<std::int64_t>(row), other);
  std::vector<std::int32_t> component(neighbours.size(), -1);
  std::int32_t count = 0;
  for (std::size_t row = 0; row < neighbours.size(); ++row) {
    const std::int64_t root = sets.find(static_cast<std::int64_t>(row));
    if (at(root) == row) component[row] = count++;
    component[row] = component[at(root)];
  }
  return component;
}

// Position of each frame within its pass.
Rows order_in_pass(const std::vector<std::int64_t>& pass) {
  std::map<std::int64_t, std::int64_t> next;
  Rows order;
  for (const std::int64_t p : pass) order.push_back(next[p]++);
  return order;
}

// Positions reached over at most `hops` edges, ascending.
Rows around(std::int64_t row, int hops, const std::vector<Rows>& neighbours) {
  Rows reached{row}, front{row};
  for (int hop = 0; hop < hops; ++hop) {
    Rows next;
    for (const std::int64_t from : front)
      for (const std::int64_t to : neighbours[at(from)])
        if (std::find(reached.begin(), reached.end(), to) == reached.end()) reached.push_back(to), next.push_back(to);
    front = std::move(next);
  }
  std::sort(reached.begin(), reached.end());
  return reached;
}

struct Meeting {
  double squared_distance;
  std::int64_t a, c;
  friend auto operator<=>(const Meeting&, const Meeting&) = default;
};

}  // namespace

void PlaceOptions::check() const {
  if (!(alpha_m > 0)) throw InputError("alpha_m must be positive");
  if (!(z_stretch > 0)) throw InputError("z_stretch must be positive");
  if (registration_spacing < 1) throw InputError("registration_spacing must be at least 1");
  if (revisit_frames < 1) throw InputError("revisit_frames must be at least 1");
  if (hops < 1) throw InputError("hops must be at least 1");
  if (!(max_distance_m > 0)) throw InputError("max_distance_m must be positive");
}

std::vector<Place> choose_places(const std::vector<Eigen::Vector3d>& positions, const std::vector<std::int64_t>& pass,
                                 const std::vector<PanoramaEdge>& edges, const PlaceOptions& options) {
  const std::vector<Rows> neighbours = neighbours_of(positions.size(), edges);
  const std::vector<std::int32_t> component = components_of(neighbours);
  const Rows order = order_in_pass(pass);
  // Next frame of the pass, else the previous one, else -1.
  const auto next_to = [&](std::int64_t row) -> std::int64_t {
    for (const std::int64_t other : {row + 1, row - 1})
      if (other >= 0 && other < static_cast<std::int64_t>(pass.size()) && pass[at(other)] == pass[at(row)])
        return other;
    return -1;
  };
  // The nearest frames of each stretch of one visit with each stretch of another. a comes before c, so that every pair
  // of visits counts once.
  using Stretch = std::tuple<std::int64_t, std::int64_t, std::int64_t, std::int64_t>;
  std::map<Stretch, Meeting> meetings;
  for (std::int64_t a = 0; a < static_cast<std::int64_t>(positions.size()); ++a)
    for (const std::int64_t c : around(a, options.hops, neighbours)) {
      const bool same_pass = pass[at(a)] == pass[at(c)];
      if (c <= a || (same_pass && order[at(c)] - order[at(a)] <= options.revisit_frames)) continue;
      Eigen::Vector3d off = positions[at(c)] - positions[at(a)];
      off.z() *= options.z_stretch;
      if (off.norm() > options.max_distance_m) continue;
      const Stretch stretch{pass[at(a)], order[at(a)] / options.registration_spacing, pass[at(c)],
                            order[at(c)] / std::max(options.registration_spacing, options.revisit_frames)};
      const Meeting meeting{off.squaredNorm(), a, c};
      const auto [entry, added] = meetings.try_emplace(stretch, meeting);
      if (!added) entry->second = std::min(entry->second, meeting);
    }
  std::vector<Place> places;
  for (const auto& [stretch, meeting] : meetings) {
    const std::int64_t b = next_to(meeting.a), d = next_to(meeting.c);
    if (b < 0 || d < 0) continue;  // a pass of one frame
    places.push_back(
        {FrameIndex(meeting.a), FrameIndex(b), FrameIndex(meeting.c), FrameIndex(d), component[at(meeting.a)]});
  }
  std::sort(places.begin(), places.end(),
            [](const Place& x, const Place& y) { return std::pair(x.a, x.c) < std::pair(y.a, y.c); });
  return places;
}

}  // namespace megablock
