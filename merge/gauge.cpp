#include "merge/gauge.h"

#include <algorithm>

#include "geometry/decompositions.h"
#include "geometry/rotation.h"
#include "io/disjoint_sets.h"
#include "merge/unknowns.h"

namespace megablock {

namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;

constexpr double kNullDirection = 1e-11;  // of the largest eigenvalue; the matrix itself carries errors of 1e-15
constexpr double kHeldDirection = 1e-6;   // of the largest singular value: what a frame can hold
constexpr double kOnePlace = 1e-9;        // of the coordinates: extent of frames that are all at one place
constexpr double kNoScale = 1e6;          // weight of a scale that moves nothing

// All parts of one component.
struct PartGroup {
  std::vector<const GaugePart*> parts;
  std::int64_t lowest_frame = -1;
};

// Similarity parameters about (to.centre, to.extent) in terms of those about the part's own centre and extent.
Matrix77 change_of_reference(const GaugePart& from, const BlockComponent& to) {
  const Eigen::Vector3d shift = from.centre - to.centre;
  Matrix77 change = Matrix77::Identity();
  change.block<3, 3>(3, 0) = -skew<double>(shift) / from.extent;
  change.block<3, 3>(3, 3) *= to.extent / from.extent;
  change.block<3, 1>(3, 6) = shift / from.extent;
  return change;
}

// Orthonormal directions of (phi, t, s) that the normal matrix leaves free: shifts in its null space, and rotations and
// scales whose information, shifts estimated along with them, is less than 1 / rad^2.
Eigen::MatrixXd free_directions(const Matrix77& normal) {
  constexpr double kDetermined = 1;
  constexpr int kOrder[] = {0, 1, 2, 6, 3, 4, 5};  // rotation and scale, then shift
  Matrix77 ordered;
  for (int i = 0; i < 7; ++i)
    for (int j = 0; j < 7; ++j) ordered(i, j) = normal(kOrder[i], kOrder[j]);
  const double limit = kNullDirection * symmetric_eigen(normal).values(6);

  const SymmetricEigen shift = symmetric_eigen(ordered.bottomRightCorner<3, 3>());
  std::int64_t free_shifts = 0;
  Eigen::Matrix3d inverse = Eigen::Matrix3d::Zero();
  for (int i = 0; i < 3; ++i) {
    if (shift.values(i) <= limit)
      ++free_shifts;
    else
      inverse += shift.vectors.col(i) * shift.vectors.col(i).transpose() / shift.values(i);
  }
  const Eigen::Matrix<double, 3, 4> following = -inverse * ordered.bottomLeftCorner<3, 4>();
  const Eigen::Matrix4d turning = ordered.topLeftCorner<4, 4>() + ordered.topRightCorner<4, 3>() * following;
  const SymmetricEigen turn = symmetric_eigen(0.5 * (turning + turning.transpose()));
  std::int64_t free_turns = 0;
  while (free_turns < 4 && turn.values(free_turns) <= std::max(limit, kDetermined)) ++free_turns;

  Eigen::MatrixXd found = Eigen::MatrixXd::Zero(7, free_shifts + free_turns);
  found.block(4, 0, 3, free_shifts) = shift.vectors.leftCols(free_shifts);
  found.block(0, free_shifts, 4, free_turns) = turn.vectors.leftCols(free_turns);
  found.block(4, free_shifts, 3, free_turns) = following * turn.vectors.leftCols(free_turns);
  Eigen::MatrixXd directions(7, found.cols());
  for (int i = 0; i < 7; ++i) directions.row(kOrder[i]) = found.row(i);
  if (directions.cols() == 0) return directions;
  return orthonormal_basis(directions);
}

// Projection on the directions of (phi, t, s) along which held positions stay where they are.
Matrix77 movable_directions(const Matrix77& held) {
  Matrix77 movable = Matrix77::Identity();
  const SymmetricEigen movement = symmetric_eigen(held);
  for (int i = 0; i < 7; ++i)
    if (movement.values(i) > kNullDirection * movement.values(6))
      movable -= movement.vectors.col(i) * movement.vectors.col(i).transpose();
  return movable;
}

BlockComponent component_of(const PartGroup& group) {
  BlockComponent c;
  c.lowest_frame = group.lowest_frame;
  for (const GaugePart* part : group.parts) {
    c.frames += part->frames;
    c.centre += static_cast<double>(part->frames) * part->centre;
  }
  c.centre /= static_cast<double>(c.frames);
  double extent = 0;
  for (const GaugePart* part : group.parts)
    extent = std::max(extent, (part->extreme_centres.colwise() - c.centre).colwise().norm().maxCoeff());
  const bool one_place = extent <= kOnePlace * (1 + c.centre.norm());
  if (!one_place) c.extent = extent;
  Matrix77 normal = Matrix77::Zero(), held = Matrix77::Zero();
  for (const GaugePart* part : group.parts) {
    const Matrix77 change = change_of_reference(*part, c);
    normal += change.transpose() * part->normal * change;
    held += change.transpose() * part->held * change;
  }
  c.movable = movable_directions(held);
  c.pivot = c.centre;
  if (held(3, 3) > 0) c.pivot += c.extent * held.block<3, 1>(3, 6) / held(3, 3);
  if (one_place) normal(6, 6) += kNoScale;  // a frame alone, say, known by its position only
  const Eigen::MatrixXd free = free_directions(normal);
  c.defect = free.cols();
  c.directions.leftCols(c.defect) = free;
  return c;
}

// Holds the lowest frame along all directions it can hold, and the farthest one along the rest.
void hold_frames(const PartGroup& group, const BlockComponent& c, std::vector<GaugeConstraint>& constraints) {
  const Vector6 unit = c.weights().cwiseSqrt();
  const auto hold = [&](std::int64_t frame, const Eigen::Vector3d& centre, const Eigen::MatrixXd& free) {
    const Eigen::MatrixXd moves = c.move(centre).leftCols(c.defect) * free;
    const SingularValues svd = singular_values(unit.asDiagonal() * moves);
    const double largest = svd.values.size() > 0 ? svd.values(0) : 0;
    std::int64_t rank = 0;
    while (rank < svd.values.size() && svd.values(rank) > kHeldDirection * largest) ++rank;
    if (rank > 0 && largest > 0) {
      GaugeConstraint constraint;
      constraint.frame = frame;
      constraint.count = rank;
      constraint.directions.leftCols(rank) = moves * svd.v.leftCols(rank);
      constraints.push_back(constraint);
    }
    return Eigen::MatrixXd(free * svd.v.rightCols(free.cols() - rank));
  };
  const GaugePart* lowest = nullptr;
  std::int64_t second = -1;
  Eigen::Vector3d second_centre;
  double distance = 0;
  for (const GaugePart* part : group.parts)
    if (part->lowest_frame == c.lowest_frame && lowest == nullptr) lowest = part;
  for (const GaugePart* part : group.parts)
    for (int side = 0; side < 6; ++side) {
      const double d = (part->extreme_centres.col(side) - lowest->lowest_centre).norm();
      if (d <= distance) continue;
      distance = d;
      second = part->extreme_frames[static_cast<std::size_t>(side)];
      second_centre = part->extreme_centres.col(side);
    }
  const Eigen::MatrixXd left =
      hold(c.lowest_frame, lowest->lowest_centre, Eigen::MatrixXd::Identity(c.defect, c.defect));
  if (left.cols() > 0 && second >= 0) hold(second, second_centre, left);
}

}  // namespace

Matrix37 similarity_of_point(const Eigen::Vector3d& position, const Eigen::Vector3d& centre, double extent) {
  const Eigen::Vector3d arm = position - centre;
  Matrix37 move;
  move << -skew<double>(arm), extent * Eigen::Matrix3d::Identity(), arm;
  return move;
}

Matrix67 similarity_of_frame(const Eigen::Vector3d& position, const Eigen::Vector3d& centre, double extent) {
  Matrix67 move = Matrix67::Zero();
  move.topLeftCorner<3, 3>() = -Eigen::Matrix3d::Identity();
  move.bottomRows<3>() = similarity_of_point(position, centre, extent);
  return move;
}

Matrix67 BlockComponent::move(const Eigen::Vector3d& centre_of_frame) const {
  return similarity_of_frame(centre_of_frame, centre, extent) * directions;
}
Matrix37 BlockComponent::move_point(const Eigen::Vector3d& position) const {
  return similarity_of_point(position, centre, extent) * directions;
}
Vector6 BlockComponent::weights() const {
  Vector6 w = Vector6::Ones();
  w.tail<3>() /= extent * extent;
  return w;
}

std::int64_t BlockGauge::defect() const {
  std::int64_t sum = 0;
  for (const BlockComponent& c : components) sum += c.defect;
  return sum;
}

BlockGauge make_gauge(const std::vector<TileGauge>& tiles) {
  // Parts of different tiles belong together where they share a frame.
  std::vector<std::pair<std::size_t, std::size_t>> all;  // (tile, part)
  for (std::size_t t = 0; t < tiles.size(); ++t)
    for (std::size_t p = 0; p < tiles[t].parts.size(); ++p) all.emplace_back(t, p);
  const auto part_at = [&](std::size_t i) -> const GaugePart& { return tiles[all[i].first].parts[all[i].second]; };
  std::vector<std::pair<std::int64_t, std::size_t>> shared;  // (frame, row of all)
  for (std::size_t i = 0; i < all.size(); ++i)
    for (std::int64_t frame : part_at(i).boundary_frames) shared.emplace_back(frame, i);
  std::sort(shared.begin(), shared.end());
  DisjointSets rows(static_cast<std::int32_t>(all.size()));
  for (std::size_t s = 1; s < shared.size(); ++s)
    if (shared[s].first == shared[s - 1].first)
      rows.unite(static_cast<std::int32_t>(shared[s].second), static_cast<std::int32_t>(shared[s - 1].second));

  std::vector<PartGroup> groups(all.size());  // by first part; others stay empty
  for (std::size_t i = 0; i < all.size(); ++i) {
    PartGroup& group = groups[at(rows.find(static_cast<std::int32_t>(i)))];
    group.parts.push_back(&part_at(i));
    const std::int64_t lowest = part_at(i).lowest_frame;
    group.lowest_frame = group.lowest_frame < 0 ? lowest : std::min(group.lowest_frame, lowest);
  }
  BlockGauge gauge;
  std::vector<std::int64_t> component_of_group(all.size(), -1);
  std::int64_t column = 0;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    if (groups[g].parts.empty()) continue;
    BlockComponent component = component_of(groups[g]);
    component.first_column = column;
    column += component.defect;
    if (component.defect > 0) hold_frames(groups[g], component, gauge.constraints);
    component_of_group[g] = static_cast<std::int64_t>(gauge.components.size());
    gauge.components.push_back(component);
  }
  for (const TileGauge& tile : tiles) gauge.part_component.emplace_back(tile.parts.size(), 0);
  for (std::size_t i = 0; i < all.size(); ++i)
    gauge.part_component[all[i].first][all[i].second] = component_of_group[at(rows.find(static_cast<std::int32_t>(i)))];
  return gauge;
}

std::vector<const BlockComponent*> free_component_of_frame(const BlockGauge& gauge, std::int64_t tile,
                                                           const TilePlan& plan) {
  std::vector<const BlockComponent*> components(plan.part_of_frame.size(), nullptr);
  for (std::size_t f = 0; f < components.size(); ++f) {
    if (plan.part_of_frame[f] < 0) continue;
    const BlockComponent& c = gauge.components[at(gauge.part_component[at(tile)][at(plan.part_of_frame[f])])];
    if (c.defect > 0) components[f] = &c;
  }
  return components;
}

TileDatum tile_datum(const BlockGauge& gauge, std::int64_t tile, const TileProblem& problem, const TilePlan& plan,
                     const TileState& state, bool with_columns) {
  TileDatum datum;
  if (!gauge.free()) return datum;
  for (const GaugeConstraint& c : gauge.constraints) {
    const UnknownId id{UnknownKind::kFrame, 0, c.frame};
    if (find_unknown(plan.owned, id) >= 0) datum.holds.push_back({id, c.directions.leftCols(c.count)});
  }
  if (!with_columns) return datum;
  const auto components = free_component_of_frame(gauge, tile, plan);
  Step& columns = datum.columns;
  columns.columns = gauge.defect();
  for (const Unknown& u : plan.owned)
    if (u.id.kind == UnknownKind::kFrame) columns.unknowns.push_back(u);
  const std::int64_t n = total_dimension(columns.unknowns);
  columns.values.assign(at(n * columns.columns), 0);
  for (std::size_t i = 0; i < columns.unknowns.size(); ++i) {
    const auto row = static_cast<std::size_t>(
        std::lower_bound(problem.frames.begin(), problem.frames.end(), FrameIndex(columns.unknowns[i].id.index)) -
        problem.frames.begin());
    const BlockComponent* c = components[row];
    if (c == nullptr) continue;
    const Matrix67 weighted = c->weights().asDiagonal() * c->move(state.frames[row].centre);
    for (std::int64_t k = 0; k < c->defect; ++k)
      for (std::int64_t r = 0; r < 6; ++r)
        columns.values[at(6 * static_cast<std::int64_t>(i) + r + (c->first_column + k) * n)] = weighted(r, k);
  }
  return datum;
}

GaugeReport judge_gauge(const SubtreeSums& root, const BlockGauge& gauge, const UnknownName& name) {
  GaugeReport report;
  report.defect = gauge.defect();
  for (const HeldUnknown& held : root.held) {
    // Without a BlockGauge a free datum shows as vanished pivots.
    const bool datum = gauge.components.empty() && held.ratio != 0;
    (datum ? report.defect : report.undetermined) += 1;
  }
  if (gauge.components.empty() && report.defect > 0)
    report.text = "free: defect " + std::to_string(report.defect) + ", held at " + name(root.held.back().id);
  if (gauge.free()) {
    report.text = "free, inner constraints:";
    constexpr std::size_t kNamed = 5;
    std::size_t free = 0;
    for (const BlockComponent& c : gauge.components) {
      if (c.defect == 0 || ++free > kNamed) continue;
      report.text += (free > 1 ? ", defect " : " defect ") + std::to_string(c.defect) + " of the part that holds " +
                     name({UnknownKind::kFrame, 0, c.lowest_frame});
    }
    if (free > kNamed) report.text += " and " + std::to_string(free - kNamed) + " more parts";
  }
  if (report.undetermined > 0)
    report.text += "; " + std::to_string(report.undetermined) + " parameters held that too little observes, first of " +
                   name(root.held.front().id);
  if (root.held_points > 0)
    report.text += "; " + std::to_string(root.held_points) + " undetermined point coordinates held";
  return report;
}

}  // namespace megablock
