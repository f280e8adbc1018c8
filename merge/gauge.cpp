#include "merge/gauge.h"

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <numeric>

#include "adjust/linearise.h"

namespace megablock {

namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix37 = Eigen::Matrix<double, 3, 7>;

constexpr double kNullDirection = 1e-11;  // of the largest eigenvalue; the matrix itself carries errors of 1e-15
constexpr double kHeldDirection = 1e-6;   // of the largest singular value: what a frame can hold
constexpr double kScaleGiven = 1e6;       // weight of the scale where held mounts give it

std::size_t at(std::int64_t i) { return static_cast<std::size_t>(i); }

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

class DisjointRows {
 public:
  explicit DisjointRows(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0); }
  std::int64_t of(std::int64_t row) {
    while (parent_[at(row)] != row) row = parent_[at(row)] = parent_[at(parent_[at(row)])];
    return row;
  }
  void join(std::int64_t a, std::int64_t b) {
    a = of(a), b = of(b);
    parent_[at(std::max(a, b))] = std::min(a, b);
  }

 private:
  std::vector<std::int64_t> parent_;
};

std::int64_t frame_of_point(const TileProblem& problem, std::int64_t point) {
  for (std::int64_t row = problem.begin[point]; row < problem.begin[point + 1]; ++row)
    if (problem.kept[row]) return problem.images[problem.image[row].value].frame.value;
  return -1;
}

// Part number of every frame row of a tile (-1: untouched), parts by lowest frame.
std::vector<std::int64_t> part_of_frame(const TileProblem& problem, const TilePlan& plan) {
  DisjointRows rows(problem.frames.size());
  for (const auto& cell : plan.points)
    for (std::int64_t point : cell) {
      const std::int64_t first = frame_of_point(problem, point);
      for (std::int64_t row = problem.begin[point]; row < problem.begin[point + 1]; ++row)
        if (problem.kept[row]) rows.join(first, problem.images[problem.image[row].value].frame.value);
    }
  for (const auto& term : problem.relatives) rows.join(term.from.value, term.to.value);
  std::vector<std::int64_t> part(problem.frames.size(), -1);
  std::int64_t next = 0;
  for (std::size_t f = 0; f < part.size(); ++f) {
    if (plan.unknown_of_frame[f] < 0) continue;
    const auto root = rows.of(static_cast<std::int64_t>(f));
    part[f] = root == static_cast<std::int64_t>(f) ? next++ : part[at(root)];
  }
  return part;
}

// Two held mounts of a rig at different places give the scale.
bool rig_gives_scale(const TileProblem& problem, const TileState& state, std::size_t mount) {
  if (problem.mount_free[mount]) return false;
  for (std::size_t other = 0; other < mount; ++other)
    if (problem.mounts[other].rig == problem.mounts[mount].rig && !problem.mount_free[other] &&
        (state.mounts[other].centre - state.mounts[mount].centre).norm() > 1e-9)
      return true;
  return false;
}

// Fills the parts of a tile.
class PartBuilder {
 public:
  PartBuilder(const TileProblem& problem, const TilePlan& plan, const TileState& state)
      : problem_(problem), plan_(plan), state_(state), part_(part_of_frame(problem, plan)) {}

  std::vector<GaugePart> build() {
    parts_.resize(at(part_.empty() ? 0 : *std::max_element(part_.begin(), part_.end()) + 1));
    describe_frames();
    add_frame_priors();
    add_relatives();
    add_point_priors();
    add_mounts();
    return std::move(parts_);
  }

 private:
  void describe_frames() {
    for (std::size_t f = 0; f < part_.size(); ++f) {
      if (part_[f] < 0) continue;
      GaugePart& part = parts_[at(part_[f])];
      const std::int64_t id = problem_.frames[f].value;
      const Eigen::Vector3d& centre = state_.frames[f].centre;
      if (part.frames++ == 0) {
        part.lowest_frame = id;
        part.lowest_centre = centre;
        part.extreme_frames.fill(id);
        part.extreme_centres.colwise() = centre;
      }
      part.centre += centre;
      for (int axis = 0; axis < 3; ++axis) {
        const int low = 2 * axis, high = low + 1;
        if (centre[axis] < part.extreme_centres(axis, low)) set_extreme(part, low, id, centre);
        if (centre[axis] > part.extreme_centres(axis, high)) set_extreme(part, high, id, centre);
      }
      if (find_unknown(plan_.boundary, {UnknownKind::kFrame, 0, id}) >= 0) part.boundary_frames.push_back(id);
    }
    for (GaugePart& part : parts_) {
      part.centre /= static_cast<double>(part.frames);
      const double extent = (part.extreme_centres.colwise() - part.centre).colwise().norm().maxCoeff();
      if (extent > 0) part.extent = extent;
    }
  }
  static void set_extreme(GaugePart& part, int side, std::int64_t id, const Eigen::Vector3d& centre) {
    part.extreme_frames[static_cast<std::size_t>(side)] = id;
    part.extreme_centres.col(side) = centre;
  }

  template <typename Derived>
  static void add(GaugePart& part, const Eigen::MatrixBase<Derived>& residual_by_similarity) {
    part.normal += residual_by_similarity.transpose() * residual_by_similarity;
  }
  GaugePart& part_of(LocalFrame frame) { return parts_[at(part_[at(frame.value)])]; }
  Matrix67 move(const GaugePart& part, LocalFrame frame) const {
    return similarity_of_frame(state_.frames[at(frame.value)].centre, part.centre, part.extent);
  }

  void add_frame_priors() {
    for (const auto& term : problem_.positions) {
      GaugePart& part = part_of(term.frame);
      add(part, linearise_position(state_.frames[at(term.frame.value)], term.prior).by_frame * move(part, term.frame));
    }
    for (const auto& term : problem_.attitudes) {
      GaugePart& part = part_of(term.frame);
      add(part, linearise_attitude(state_.frames[at(term.frame.value)], term.prior).by_frame * move(part, term.frame));
    }
  }

  // Only the scale changes a relative pose; written out, as the other directions cancel by rounding alone.
  void add_relatives() {
    for (const auto& term : problem_.relatives) {
      const Eigen::Vector3d base = state_.frames[at(term.to.value)].centre - state_.frames[at(term.from.value)].centre;
      part_of(term.from).normal(6, 6) += base.squaredNorm() / (term.position_sigma_m * term.position_sigma_m);
    }
  }

  void add_point_priors() {
    for (const auto& term : problem_.point_priors) {
      const std::int64_t point = term.point.value;
      if (!problem_.active(point)) continue;
      GaugePart& part = parts_[at(part_[at(frame_of_point(problem_, point))])];
      add(part, term.sigma.cwiseInverse().asDiagonal() *
                    similarity_of_point(state_.points[at(point)], part.centre, part.extent));
    }
  }

  void add_mounts() {
    std::vector<std::pair<std::int64_t, std::int32_t>> seen;  // (part, mount)
    for (const TileImage& image : problem_.images)
      if (part_[at(image.frame.value)] >= 0) seen.emplace_back(part_[at(image.frame.value)], image.mount);
    std::sort(seen.begin(), seen.end());
    seen.erase(std::unique(seen.begin(), seen.end()), seen.end());
    for (const auto& [part, mount] : seen) {
      if (rig_gives_scale(problem_, state_, at(mount))) parts_[at(part)].normal(6, 6) += kScaleGiven;
      for (const auto& term : problem_.mount_priors) {
        if (term.mount != mount) continue;
        Vector6 scaled = Vector6::Zero();
        scaled.tail<3>() = state_.mounts[at(mount)].centre;
        parts_[at(part)].normal(6, 6) +=
            (linearise_mount(state_.mounts[at(mount)], term).by_mount * scaled).squaredNorm();
      }
    }
  }

  const TileProblem& problem_;
  const TilePlan& plan_;
  const TileState& state_;
  std::vector<std::int64_t> part_;
  std::vector<GaugePart> parts_;
};

// All parts of one component.
struct PartGroup {
  std::vector<const GaugePart*> parts;
  std::int64_t lowest_frame = -1;
};

// Similarity parameters about (to.centre, to.extent) in terms of those about the part's own centre and extent.
Matrix77 change_of_reference(const GaugePart& from, const FreeComponent& to) {
  const Eigen::Vector3d shift = from.centre - to.centre;
  Matrix77 change = Matrix77::Identity();
  change.block<3, 3>(3, 0) = -skew<double>(shift) / from.extent;
  change.block<3, 3>(3, 3) *= to.extent / from.extent;
  change.block<3, 1>(3, 6) = shift / from.extent;
  return change;
}

FreeComponent component_of(const PartGroup& group) {
  FreeComponent c;
  c.lowest_frame = group.lowest_frame;
  for (const GaugePart* part : group.parts) {
    c.frames += part->frames;
    c.centre += static_cast<double>(part->frames) * part->centre;
  }
  c.centre /= static_cast<double>(c.frames);
  double extent = 0;
  for (const GaugePart* part : group.parts)
    extent = std::max(extent, (part->extreme_centres.colwise() - c.centre).colwise().norm().maxCoeff());
  if (extent > 0) c.extent = extent;
  Matrix77 normal = Matrix77::Zero();
  for (const GaugePart* part : group.parts) {
    const Matrix77 change = change_of_reference(*part, c);
    normal += change.transpose() * part->normal * change;
  }
  const Eigen::SelfAdjointEigenSolver<Matrix77> eigen(normal);
  const double limit = kNullDirection * eigen.eigenvalues()(6);
  while (c.defect < 7 && eigen.eigenvalues()(c.defect) <= limit) ++c.defect;
  c.directions.leftCols(c.defect) = eigen.eigenvectors().leftCols(c.defect);
  return c;
}

// Holds the lowest frame along all directions it can hold, and the farthest one along the rest.
void hold_frames(const PartGroup& group, const FreeComponent& c, std::vector<GaugeConstraint>& constraints) {
  const Vector6 unit = c.weights().cwiseSqrt();
  const auto hold = [&](std::int64_t frame, const Eigen::Vector3d& centre, const Eigen::MatrixXd& free) {
    const Eigen::MatrixXd moves = c.move(centre).leftCols(c.defect) * free;
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(unit.asDiagonal() * moves, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const double largest = svd.singularValues().size() > 0 ? svd.singularValues()(0) : 0;
    std::int64_t rank = 0;
    while (rank < svd.singularValues().size() && svd.singularValues()(rank) > kHeldDirection * largest) ++rank;
    if (rank > 0 && largest > 0) {
      GaugeConstraint constraint;
      constraint.frame = frame;
      constraint.count = rank;
      constraint.directions.leftCols(rank) = moves * svd.matrixV().leftCols(rank);
      constraints.push_back(constraint);
    }
    return Eigen::MatrixXd(free * svd.matrixV().rightCols(free.cols() - rank));
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

// Component of every frame row of a tile, nullptr: complete datum.
std::vector<const FreeComponent*> component_of_frame(const BlockGauge& gauge, std::int64_t tile,
                                                     const TileProblem& problem, const TilePlan& plan) {
  std::vector<const FreeComponent*> components(problem.frames.size(), nullptr);
  if (!gauge.free()) return components;
  const std::vector<std::int64_t> part = part_of_frame(problem, plan);
  for (std::size_t f = 0; f < part.size(); ++f) {
    if (part[f] < 0) continue;
    const std::int64_t c = gauge.part_component[at(tile)][at(part[f])];
    if (c >= 0) components[f] = &gauge.components[at(c)];
  }
  return components;
}

}  // namespace

Matrix67 FreeComponent::move(const Eigen::Vector3d& centre_of_frame) const {
  return similarity_of_frame(centre_of_frame, centre, extent) * directions;
}
Matrix37 FreeComponent::move_point(const Eigen::Vector3d& position) const {
  return similarity_of_point(position, centre, extent) * directions;
}
Vector6 FreeComponent::weights() const {
  Vector6 w = Vector6::Ones();
  w.tail<3>() /= extent * extent;
  return w;
}

std::int64_t BlockGauge::defect() const {
  std::int64_t sum = 0;
  for (const FreeComponent& c : components) sum += c.defect;
  return sum;
}

Bytes TileGauge::to_bytes() const {
  ByteWriter out;
  out.value<std::uint64_t>(parts.size());
  for (const GaugePart& part : parts) {
    out.values(part.boundary_frames);
    out.value(part.frames);
    out.value(part.lowest_frame);
    out.value(part.extreme_frames);
    out.value(part.extent);
    for (const double* v : {part.lowest_centre.data(), part.centre.data()}) out.values(std::vector<double>(v, v + 3));
    out.values(std::vector<double>(part.extreme_centres.data(), part.extreme_centres.data() + 18));
    out.values(std::vector<double>(part.normal.data(), part.normal.data() + 49));
  }
  return out.take();
}

TileGauge TileGauge::from_bytes(const Bytes& bytes) {
  ByteReader in(bytes);
  TileGauge gauge;
  const auto count = in.value<std::uint64_t>();
  const auto fill = [&](double* target, std::size_t size) {
    const std::vector<double> values = in.values<double>();
    if (values.size() != size) throw StoreError("merge: a tile's datum has the wrong size");
    std::copy(values.begin(), values.end(), target);
  };
  for (std::uint64_t i = 0; i < count; ++i) {
    GaugePart part;
    part.boundary_frames = in.values<std::int64_t>();
    part.frames = in.value<std::int64_t>();
    part.lowest_frame = in.value<std::int64_t>();
    part.extreme_frames = in.value<std::array<std::int64_t, 6>>();
    part.extent = in.value<double>();
    fill(part.lowest_centre.data(), 3);
    fill(part.centre.data(), 3);
    fill(part.extreme_centres.data(), 18);
    fill(part.normal.data(), 49);
    gauge.parts.push_back(part);
  }
  if (!in.at_end()) throw StoreError("merge: a tile's datum has the wrong size");
  return gauge;
}

TileGauge tile_gauge(const TileProblem& problem, const TilePlan& plan, const TileState& state) {
  return {PartBuilder(problem, plan, state).build()};
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
  DisjointRows rows(all.size());
  for (std::size_t s = 1; s < shared.size(); ++s)
    if (shared[s].first == shared[s - 1].first)
      rows.join(static_cast<std::int64_t>(shared[s].second), static_cast<std::int64_t>(shared[s - 1].second));

  std::vector<PartGroup> groups(all.size());  // by first part; others stay empty
  for (std::size_t i = 0; i < all.size(); ++i) {
    PartGroup& group = groups[at(rows.of(static_cast<std::int64_t>(i)))];
    group.parts.push_back(&part_at(i));
    const std::int64_t lowest = part_at(i).lowest_frame;
    group.lowest_frame = group.lowest_frame < 0 ? lowest : std::min(group.lowest_frame, lowest);
  }
  BlockGauge gauge;
  std::vector<std::int64_t> component_of_group(all.size(), -1);
  std::int64_t column = 0;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    if (groups[g].parts.empty()) continue;
    FreeComponent component = component_of(groups[g]);
    if (component.defect == 0) continue;
    component.first_column = column;
    column += component.defect;
    hold_frames(groups[g], component, gauge.constraints);
    component_of_group[g] = static_cast<std::int64_t>(gauge.components.size());
    gauge.components.push_back(component);
  }
  for (const TileGauge& tile : tiles) gauge.part_component.emplace_back(tile.parts.size(), -1);
  for (std::size_t i = 0; i < all.size(); ++i)
    gauge.part_component[all[i].first][all[i].second] = component_of_group[at(rows.of(static_cast<std::int64_t>(i)))];
  return gauge;
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
  const auto components = component_of_frame(gauge, tile, problem, plan);
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
    const FreeComponent* c = components[row];
    if (c == nullptr) continue;
    const Matrix67 weighted = c->weights().asDiagonal() * c->move(state.frames[row].centre);
    for (std::int64_t k = 0; k < c->defect; ++k)
      for (std::int64_t r = 0; r < 6; ++r)
        columns.values[at(6 * static_cast<std::int64_t>(i) + r + (c->first_column + k) * n)] = weighted(r, k);
  }
  return datum;
}

void InnerSums::add(const InnerSums& other) {
  m += other.m;
  k += other.k;
}

Bytes InnerSums::to_bytes() const {
  ByteWriter out;
  for (const Eigen::MatrixXd* matrix : {&m, &k})
    out.values(std::vector<double>(matrix->data(), matrix->data() + matrix->size()));
  return out.take();
}

InnerSums InnerSums::from_bytes(const Bytes& bytes) {
  ByteReader in(bytes);
  InnerSums sums;
  for (Eigen::MatrixXd* matrix : {&sums.m, &sums.k}) {
    const std::vector<double> values = in.values<double>();
    const auto n = static_cast<Eigen::Index>(std::llround(std::sqrt(static_cast<double>(values.size()))));
    if (n * n != static_cast<Eigen::Index>(values.size()))
      throw StoreError("merge: sums of the datum have the wrong size");
    *matrix = Eigen::Map<const Eigen::MatrixXd>(values.data(), n, n);
  }
  if (!in.at_end()) throw StoreError("merge: sums of the datum have the wrong size");
  return sums;
}

namespace {

// Columns 1.. of an unknown's rows that belong to a component: [6 x defect].
Eigen::Matrix<double, 6, Eigen::Dynamic> columns_of(const Step& unknowns, const UnknownId& id, const FreeComponent& c) {
  Eigen::Matrix<double, 6, Eigen::Dynamic> z(6, c.defect);
  for (std::int64_t k = 0; k < c.defect; ++k)
    z.col(k) = Eigen::Map<const Vector6>(unknowns.find(id, 1 + c.first_column + k));
  return z;
}

// C' = C - Z M^-1 N' - N M^-1 Z' + N M^-1 K M^-1 N', for one diagonal block.
template <typename Block, typename Columns, typename Move>
void transform(Block& c, const Columns& z, const Move& n, const Eigen::MatrixXd& inverse, const Eigen::MatrixXd& k) {
  const Eigen::MatrixXd right = inverse * n.transpose();
  const Eigen::MatrixXd cross = z * right;
  c += -cross - cross.transpose() + right.transpose() * k * right;
}

}  // namespace

InnerSums inner_sums(const BlockGauge& gauge, std::int64_t tile, const TileProblem& problem, const TilePlan& plan,
                     const TileState& state, const Step& unknowns) {
  const std::int64_t d = gauge.defect();
  InnerSums sums{Eigen::MatrixXd::Zero(d, d), Eigen::MatrixXd::Zero(d, d)};
  const auto components = component_of_frame(gauge, tile, problem, plan);
  for (std::size_t f = 0; f < problem.frames.size(); ++f) {
    const UnknownId id{UnknownKind::kFrame, 0, problem.frames[f].value};
    if (components[f] == nullptr || find_unknown(plan.owned, id) < 0) continue;
    const FreeComponent& c = *components[f];
    const Eigen::MatrixXd n = c.move(state.frames[f].centre).leftCols(c.defect);
    const Eigen::MatrixXd weighted = c.weights().asDiagonal() * n;
    sums.m.block(c.first_column, c.first_column, c.defect, c.defect) += weighted.transpose() * n;
    sums.k.block(c.first_column, c.first_column, c.defect, c.defect) +=
        weighted.transpose() * columns_of(unknowns, id, c);
  }
  return sums;
}

void to_inner_constraints(const BlockGauge& gauge, const InnerSums& sums, std::int64_t tile, const TileProblem& problem,
                          const TilePlan& plan, const TileState& state, const Step& unknowns,
                          TileCovariance& covariance) {
  if (!gauge.free()) return;
  std::vector<Eigen::MatrixXd> inverse, k;
  for (const FreeComponent& c : gauge.components) {
    inverse.push_back(sums.m.block(c.first_column, c.first_column, c.defect, c.defect).inverse());
    k.push_back(sums.k.block(c.first_column, c.first_column, c.defect, c.defect));
  }
  const auto components = component_of_frame(gauge, tile, problem, plan);
  const auto row_of = [&](const FreeComponent* c) { return static_cast<std::size_t>(c - gauge.components.data()); };
  for (std::size_t f = 0; f < problem.frames.size(); ++f) {
    const FreeComponent* c = components[f];
    if (c == nullptr) continue;
    const UnknownId id{UnknownKind::kFrame, 0, problem.frames[f].value};
    transform(covariance.frames[f], columns_of(unknowns, id, *c),
              Eigen::MatrixXd(c->move(state.frames[f].centre).leftCols(c->defect)), inverse[row_of(c)], k[row_of(c)]);
  }
  for (const auto& cell : plan.points)
    for (std::int64_t p : cell) {
      const FreeComponent* c = components[at(frame_of_point(problem, p))];
      if (c == nullptr) continue;
      transform(covariance.points[at(p)],
                Eigen::MatrixXd(covariance.point_columns[at(p)].middleCols(c->first_column, c->defect)),
                Eigen::MatrixXd(c->move_point(state.points[at(p)]).leftCols(c->defect)), inverse[row_of(c)],
                k[row_of(c)]);
    }
  // Free mounts change with the scale of the component that sees them.
  std::vector<const FreeComponent*> of_mount(problem.mounts.size(), nullptr);
  for (const TileImage& image : problem.images) of_mount[at(image.mount)] = components[at(image.frame.value)];
  for (std::size_t m = 0; m < problem.mounts.size(); ++m) {
    const FreeComponent* c = of_mount[m];
    if (c == nullptr || plan.unknown_of_mount[m] < 0) continue;
    Matrix67 move = Matrix67::Zero();
    move.bottomRightCorner<3, 1>() = state.mounts[m].centre;
    const UnknownId id{UnknownKind::kMount, problem.mounts[m].mount, problem.mounts[m].rig.value};
    transform(covariance.mounts[m], columns_of(unknowns, id, *c),
              Eigen::MatrixXd((move * c->directions).leftCols(c->defect)), inverse[row_of(c)], k[row_of(c)]);
  }
}

GaugeReport judge_gauge(const SubtreeSums& root, const BlockGauge& gauge, const UnknownName& name) {
  GaugeReport report;
  report.defect = gauge.defect();
  for (const HeldUnknown& held : root.held) {
    // Without BlockGauge a free datum shows as vanished pivots.
    const bool datum = !gauge.free() && held.ratio != 0;
    (datum ? report.defect : report.undetermined) += 1;
  }
  if (!gauge.free() && report.defect > 0)
    report.text = "free: defect " + std::to_string(report.defect) + ", held at " + name(root.held.back().id);
  if (gauge.free()) {
    report.text = "free, inner constraints:";
    constexpr std::size_t kNamed = 5;
    for (std::size_t i = 0; i < std::min(kNamed, gauge.components.size()); ++i)
      report.text += (i > 0 ? ", defect " : " defect ") + std::to_string(gauge.components[i].defect) +
                     " of the part that holds " + name({UnknownKind::kFrame, 0, gauge.components[i].lowest_frame});
    if (gauge.components.size() > kNamed)
      report.text += " and " + std::to_string(gauge.components.size() - kNamed) + " more parts";
  }
  if (report.undetermined > 0)
    report.text += "; " + std::to_string(report.undetermined) + " parameters held that too little observes, first of " +
                   name(root.held.front().id);
  if (root.held_points > 0)
    report.text += "; " + std::to_string(root.held_points) + " undetermined point coordinates held";
  return report;
}

}  // namespace megablock
