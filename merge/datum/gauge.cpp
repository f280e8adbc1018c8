// The information of a component about its datum is the 7 x 7 matrix of gauge.h, in blocks of phi (r), t and s:
//
//     | N_rr  N_rt  n_rs |
//     |       N_tt  n_ts |
//     |             n_ss |
//
// The free directions are found in the order shift, rotation, scale. Each is eliminated before the next is judged, so
// that a direction is called determined only by what is left once the earlier ones are estimated along with it:
//
//     t   = -N_tt^+ (N_tr phi + n_ts s)                                    to_rotation, to_scale
//     A   = N_rr - N_rt N_tt^+ N_tr,   a = n_rs - N_rt N_tt^+ n_ts         turning, both
//     phi = -A^+ a s                                                       turned
//     information about s = n_ss - n_st N_tt^+ n_ts - a'A^+ a              scale_information
//
// Rotations and the scale have natural units, and their information is compared with one (kDetermined). Shifts have
// none; they are free in the null space alone, which is a share of the largest eigenvalue. Pseudo-inverses leave out
// the eigenvectors that are free.
#include "merge/datum/gauge.h"

#include <algorithm>

#include "geometry/numbers/decompositions.h"
#include "geometry/transform/rotation.h"
#include "io/base/disjoint_sets.h"
#include "merge/plan/unknowns.h"

namespace megablock {

namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Vector7 = Eigen::Matrix<double, 7, 1>;

constexpr double kNullDirection = 1e-11;  // share of the largest eigenvalue; the matrix itself has errors of 1e-15
constexpr double kHeldDirection = 1e-6;   // share of the largest singular value: a frame holds the directions above it
constexpr double kOnePlace = 1e-9;  // share of the coordinates: frames within a smaller extent are all at one place
// Information of a rotation (1 / rad^2) or of a scale, below which it is free; the second where it was held before.
constexpr double kDetermined = 1, kReleased = 16;

// All parts of one component.
struct PartGroup {
  std::vector<const GaugePart*> parts;
  std::int64_t lowest_frame = -1;
};

// Expresses similarity parameters about the part's own centre and extent (c, L) by those about (c', L') of the
// component. From phi x (X - c') + L't' + s (X - c') = phi x (X - c) + L t + s (X - c) for all X, with u = c - c',
//
//     t = (L't' - [u]x phi + s u) / L.
Matrix77 change_of_reference(const GaugePart& from, const BlockComponent& to) {
  const Eigen::Vector3d shift = from.centre - to.centre;
  Matrix77 change = Matrix77::Identity();
  change.block<3, 3>(3, 0) = -skew<double>(shift) / from.extent;
  change.block<3, 3>(3, 3) *= to.extent / from.extent;
  change.block<3, 1>(3, 6) = shift / from.extent;
  return change;
}

// The information of a component's normal matrix about (phi, t, s).
struct Freedom {
  Eigen::MatrixXd directions;  // [7 x free], orthonormal: the free directions that leave the scale unchanged
  Vector7 scaling;             // a scale of one, with the rotation and shift that follow from it
  double scale_information = 0;
  double limit = 0;  // below, the information of a direction is rounding
  bool has_scale = false;
  std::int32_t turns_against_priors = 0;  // free rotations with information that is not rounding
};

// Shifts are free in the null space. Rotations are free where their information is less than 1 / rad^2, with the shifts
// estimated along with them, and the `turns_before` least known ones where it is less than 16.
Freedom freedom_of(const Matrix77& normal, std::int32_t turns_before) {
  Freedom freedom;
  freedom.limit = kNullDirection * symmetric_eigen(normal).values(6);
  const SymmetricEigen shift = symmetric_eigen(normal.block<3, 3>(3, 3));
  std::int64_t free_shifts = 0;
  Eigen::Matrix3d inverse = Eigen::Matrix3d::Zero();
  for (int i = 0; i < 3; ++i) {
    if (shift.values(i) <= freedom.limit)
      ++free_shifts;
    else
      inverse += shift.vectors.col(i) * shift.vectors.col(i).transpose() / shift.values(i);
  }
  const Eigen::Matrix3d to_rotation = -inverse * normal.block<3, 3>(3, 0);
  const Eigen::Vector3d to_scale = -inverse * normal.block<3, 1>(3, 6);
  const Eigen::Matrix3d turning = normal.block<3, 3>(0, 0) + normal.block<3, 3>(0, 3) * to_rotation;
  const Eigen::Vector3d both = normal.block<3, 1>(0, 6) + normal.block<3, 3>(0, 3) * to_scale;
  const double scaling = normal(6, 6) + normal.block<1, 3>(6, 3) * to_scale;

  const SymmetricEigen turn = symmetric_eigen(0.5 * (turning + turning.transpose()));
  std::int64_t free_turns = 0;
  Eigen::Vector3d turned = Eigen::Vector3d::Zero();  // the rotation that follows from a scale of one
  for (int i = 0; i < 3; ++i) {
    const double determined = freedom.turns_against_priors < turns_before ? kReleased : kDetermined;
    if (turn.values(i) <= std::max(freedom.limit, determined)) {  // the values ascend
      ++free_turns;
      freedom.turns_against_priors += turn.values(i) > freedom.limit;
    } else {
      turned -= turn.vectors.col(i) * turn.vectors.col(i).dot(both) / turn.values(i);
    }
  }
  // A free rotation takes along the shift that follows from it.
  freedom.directions = Eigen::MatrixXd::Zero(7, free_shifts + free_turns);
  freedom.directions.block(3, 0, 3, free_shifts) = shift.vectors.leftCols(free_shifts);
  freedom.directions.block(0, free_shifts, 3, free_turns) = turn.vectors.leftCols(free_turns);
  freedom.directions.block(3, free_shifts, 3, free_turns) = to_rotation * turn.vectors.leftCols(free_turns);
  if (freedom.directions.cols() > 0) freedom.directions = orthonormal_basis(freedom.directions);
  freedom.scaling << turned, to_rotation * turned + to_scale, 1;
  freedom.scale_information = scaling + both.dot(turned);
  return freedom;
}

// The projection on the directions of (phi, t, s) that leave held positions where they are.
Matrix77 movable_directions(const Matrix77& held) {
  Matrix77 movable = Matrix77::Identity();
  const SymmetricEigen movement = symmetric_eigen(held);
  for (int i = 0; i < 7; ++i)
    // Where no position is held, all values are zero and nothing is taken out.
    if (movement.values(i) > kNullDirection * movement.values(6))
      movable -= movement.vectors.col(i) * movement.vectors.col(i).transpose();
  return movable;
}

// Sets up a component, and finds the free directions of it alone.
BlockComponent component_of(const PartGroup& group, std::int32_t turns_before, Freedom& freedom) {
  BlockComponent c;
  c.lowest_frame = group.lowest_frame;
  // The sums go in the order of the tiles.
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
  // The held positions give sum L^2 I as the block of t and sum L (X - c) as the column of t and s.
  if (held(3, 3) > 0) c.pivot += c.extent * held.block<3, 1>(3, 6) / held(3, 3);
  freedom = freedom_of(normal, turns_before);
  c.against_priors.rotations = freedom.turns_against_priors;
  // A scale moves no frame where all frames are at one place: a single frame that is known by its position only, for
  // example.
  freedom.has_scale = !one_place;
  return c;
}

// For each component, the lowest component that has its scale in common with it. Components have a common scale when
// they see the same free mount.
std::vector<std::size_t> scale_groups(const std::vector<PartGroup>& components) {
  std::vector<std::pair<UnknownId, std::size_t>> seen;
  for (std::size_t c = 0; c < components.size(); ++c)
    for (const GaugePart* part : components[c].parts)
      for (const UnknownId& mount : part->mounts) seen.emplace_back(mount, c);
  std::sort(seen.begin(), seen.end());
  DisjointSets sets(std::ssize(components));
  for (std::size_t s = 1; s < seen.size(); ++s)
    if (seen[s].first == seen[s - 1].first)
      sets.unite(static_cast<std::int64_t>(seen[s].second), static_cast<std::int64_t>(seen[s - 1].second));
  std::vector<std::size_t> group(components.size());
  for (std::size_t c = 0; c < group.size(); ++c) group[c] = at(sets.find(static_cast<std::int64_t>(c)));
  return group;
}

// Numbers the free directions. A common scale is numbered in the first component with frames that it moves; the others
// take over its number.
void number_columns(const std::vector<std::size_t>& scale_group, const std::vector<Freedom>& freedoms,
                    double determined, std::vector<BlockComponent>& components) {
  struct Scale {
    double information = 0, rounding = 0, limit = 0;
    std::int64_t component = -1, column = -1;
    bool free() const { return component >= 0 && information <= limit; }
  };
  // Information about a common scale adds up over its components, whose scales are the same unknown.
  std::vector<Scale> scales(components.size());  // by the number of the group
  for (std::size_t c = 0; c < components.size(); ++c) {
    Scale& scale = scales[scale_group[c]];
    scale.information += freedoms[c].scale_information;
    scale.rounding = std::max(scale.rounding, freedoms[c].limit);
    scale.limit = std::max(determined, scale.rounding);
    if (freedoms[c].has_scale && scale.component < 0) scale.component = static_cast<std::int64_t>(c);
  }
  std::int64_t column = 0;
  for (std::size_t c = 0; c < components.size(); ++c) {
    BlockComponent& component = components[c];
    Scale& scale = scales[scale_group[c]];
    const Eigen::Index own = freedoms[c].directions.cols();
    component.directions.leftCols(own) = freedoms[c].directions;
    component.defect = own;
    if (scale.free() && scale.component == static_cast<std::int64_t>(c)) {
      scale.column = column + own;
      ++component.defect;
    }
    for (std::int64_t k = 0; k < own; ++k) component.columns.push_back(column + k);
    column += component.defect;
  }
  for (std::size_t c = 0; c < components.size(); ++c) {
    const Scale& scale = scales[scale_group[c]];
    if (!scale.free()) continue;
    components[c].directions.col(std::ssize(components[c].columns)) = freedoms[c].scaling;
    components[c].columns.push_back(scale.column);
    components[c].against_priors.scale = scale.information > scale.rounding;
  }
}

// Holds the lowest frame along all directions that it can hold, and the farthest frame along the rest. The position of
// a frame stands for its reference place: a direction near the free one holds the free one as well.
//
// `free` has combinations of the free directions as columns. The singular values of W^1/2 N_f `free` say how far each
// moves the frame. The frame holds those above kHeldDirection; the right singular vectors of the others are returned,
// and the second frame holds these. The scale, for example, hardly moves a frame near the centroid, but it moves one
// far from it.
void hold_frames(const PartGroup& group, const BlockComponent& c, std::vector<GaugeConstraint>& constraints) {
  const Vector6 unit = c.weights().cwiseSqrt();
  const auto hold = [&](std::int64_t frame, const Eigen::Vector3d& centre, const Eigen::MatrixXd& free) {
    const Eigen::MatrixXd moves = c.move_frame(centre, centre).leftCols(c.defect) * free;
    const SingularValues svd = singular_values(unit.asDiagonal() * moves);
    const double largest = svd.values.size() > 0 ? svd.values(0) : 0;
    std::int64_t rank = 0;
    while (rank < svd.values.size() && svd.values(rank) > kHeldDirection * largest) ++rank;
    if (rank > 0 && largest > 0) {
      GaugeConstraint constraint;
      constraint.frame = frame;
      if (c.against_priors.any()) constraint.weight = kFirmly;
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

BlockComponent::FreeMoves BlockComponent::free_part(const Matrix67& similarity) const {
  return similarity * directions.leftCols(std::ssize(columns));
}
BlockComponent::FreeMoves BlockComponent::move_frame(const Eigen::Vector3d& position,
                                                     const Eigen::Vector3d& reference) const {
  return free_part(similarity_of_frame(position, reference, centre, extent));
}
BlockComponent::FreeMoves BlockComponent::move_point(const Eigen::Vector3d& position) const {
  return similarity_of_point(position, centre, extent) * directions.leftCols(std::ssize(columns));
}
Matrix67 BlockComponent::similarity(const Eigen::Vector3d& position, const Eigen::Vector3d& reference) const {
  return similarity_of_frame(position, reference, centre, extent);
}
Vector6 BlockComponent::weights() const {
  Vector6 w = Vector6::Ones();
  w.tail<3>() /= extent * extent;
  return w;
}
Vector6 BlockComponent::position_weights() const {
  Vector6 w = weights();
  w.head<3>().setZero();
  return w;
}

std::int64_t BlockGauge::defect() const {
  std::int64_t sum = 0;
  for (const BlockComponent& c : components) sum += c.defect;
  return sum;
}

HeldAgainstPriors BlockGauge::against_priors() const {
  HeldAgainstPriors all;
  for (const BlockComponent& c : components) {
    all.rotations = std::max(all.rotations, c.against_priors.rotations);
    all.scale |= c.against_priors.scale;
  }
  return all;
}

std::vector<std::size_t> BlockGauge::free_components() const {
  std::vector<std::size_t> rows;
  for (std::size_t c = 0; c < components.size(); ++c)
    if (!components[c].columns.empty()) rows.push_back(c);
  return rows;
}

BlockGauge make_gauge(const std::vector<TileGauge>& tiles, const HeldAgainstPriors& held_before) {
  // Parts of different tiles belong to one component where they share a frame.
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

  std::vector<PartGroup> groups(all.size());  // at the first part of each component; the others stay empty
  for (std::size_t i = 0; i < all.size(); ++i) {
    PartGroup& group = groups[at(rows.find(static_cast<std::int32_t>(i)))];
    group.parts.push_back(&part_at(i));
    const std::int64_t lowest = part_at(i).lowest_frame;
    group.lowest_frame = group.lowest_frame < 0 ? lowest : std::min(group.lowest_frame, lowest);
  }
  BlockGauge gauge;
  std::vector<std::int64_t> component_of_group(all.size(), -1);
  std::int64_t components = 0;
  for (std::size_t g = 0; g < groups.size(); ++g)
    if (!groups[g].parts.empty()) component_of_group[g] = std::exchange(components, components + 1);
  std::erase_if(groups, [](const PartGroup& group) { return group.parts.empty(); });
  std::vector<Freedom> freedoms(groups.size());
  for (std::size_t c = 0; c < groups.size(); ++c)
    gauge.components.push_back(component_of(groups[c], held_before.rotations, freedoms[c]));
  number_columns(scale_groups(groups), freedoms, held_before.scale ? kReleased : kDetermined, gauge.components);
  for (std::size_t c = 0; c < groups.size(); ++c)
    if (gauge.components[c].defect > 0) hold_frames(groups[c], gauge.components[c], gauge.constraints);
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
    if (!c.columns.empty()) components[f] = &c;
  }
  return components;
}

TileDatum tile_datum(const BlockGauge& gauge, std::int64_t tile, const TileProblem& problem, const TilePlan& plan,
                     const TileState& state, DatumColumns wanted) {
  TileDatum datum;
  if (!gauge.free()) return datum;
  for (const GaugeConstraint& c : gauge.constraints) {
    const UnknownId id{UnknownKind::kFrame, 0, c.frame};
    if (find_unknown(plan.owned, id) >= 0) datum.holds.push_back({id, c.directions.leftCols(c.count), c.weight});
  }
  if (wanted != DatumColumns::kSimilarities) return datum;
  const auto components = free_component_of_frame(gauge, tile, plan);
  const std::vector<std::size_t> free = gauge.free_components();
  Step& columns = datum.columns;
  columns.columns = gauge.defect() + 7 * std::ssize(free);
  for (const Unknown& u : plan.owned)
    if (u.id.kind == UnknownKind::kFrame) columns.unknowns.push_back(u);
  // The rows W N and W_p N of the owned frames. The other unknowns have zero, because W weighs frames alone.
  const std::int64_t n = total_dimension(columns.unknowns);
  columns.values.assign(at(n * columns.columns), 0);
  for (std::size_t i = 0; i < columns.unknowns.size(); ++i) {
    const auto row = static_cast<std::size_t>(
        std::lower_bound(problem.frames.begin(), problem.frames.end(), FrameIndex(columns.unknowns[i].id.index)) -
        problem.frames.begin());
    const BlockComponent* c = components[row];
    if (c == nullptr) continue;
    const Eigen::Vector3d position = state.frames[row].centre, reference = reference_place(problem, state, row);
    const auto put = [&](const Vector6& weights, const Eigen::MatrixXd& moves, Eigen::Index k, std::int64_t column) {
      Eigen::Map<Vector6>(columns.values.data() + 6 * static_cast<std::int64_t>(i) + column * n) =
          weights.cwiseProduct(moves.col(k));
    };
    const Eigen::MatrixXd moves = c->move_frame(position, reference);
    for (Eigen::Index k = 0; k < moves.cols(); ++k) put(c->weights(), moves, k, c->columns[at(k)]);
    const std::int64_t first =
        gauge.defect() + 7 * (std::ranges::find(free, at(c - gauge.components.data())) - free.begin());
    const Eigen::MatrixXd similarity = c->similarity(position, reference);
    for (Eigen::Index k = 0; k < 7; ++k) put(c->position_weights(), similarity, k, first + k);
  }
  return datum;
}

Step unit_columns(const UnknownList& frames, const TilePlan& plan) {
  Step columns{{}, total_dimension(frames), {}};
  for (const Unknown& u : plan.owned)
    if (u.id.kind == UnknownKind::kFrame) columns.unknowns.push_back(u);
  const std::int64_t n = total_dimension(columns.unknowns);
  columns.values.assign(at(n * columns.columns), 0);
  for (std::size_t i = 0; i < columns.unknowns.size(); ++i) {
    const std::int64_t first = 6 * find_unknown(frames, columns.unknowns[i].id);
    for (std::int64_t r = 0; r < 6; ++r) columns.values[at(6 * static_cast<std::int64_t>(i) + r + (first + r) * n)] = 1;
  }
  return columns;
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
    std::int64_t directions = 0;
    for (const BlockComponent& c : gauge.components) {
      directions += std::ssize(c.columns);
      if (c.columns.empty() || ++free > kNamed) continue;
      report.text += (free > 1 ? ", defect " : " defect ") + std::to_string(c.columns.size()) +
                     " of the part that holds " + name({UnknownKind::kFrame, 0, c.lowest_frame});
    }
    if (free > kNamed) report.text += " and " + std::to_string(free - kNamed) + " more parts";
    if (directions > gauge.defect()) report.text += "; parts that share a rig have one scale";
  }
  if (report.undetermined > 0)
    report.text += "; " + std::to_string(report.undetermined) +
                   " parameters held because too few observations determine them, first of " +
                   name(root.held.front().id);
  if (root.held_points > 0)
    report.text += "; " + std::to_string(root.held_points) + " undetermined point coordinates held";
  return report;
}

}  // namespace megablock
