#include "merge/datum/inner_constraints.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/numbers/decompositions.h"
#include "merge/plan/unknowns.h"

namespace megablock {

namespace {

// The positions do not determine a similarity when an eigenvalue of N'W_p N is below this share of the largest one:
// they are then on one line to 1e-4 of its length.
constexpr double kOneLine = 1e-8;

Bytes bytes_of(const std::vector<Matrix77>& matrices) {
  std::vector<double> values;
  for (const Matrix77& matrix : matrices) values.insert(values.end(), matrix.data(), matrix.data() + matrix.size());
  ByteWriter out;
  out.values(values);
  return out.take();
}

std::vector<Matrix77> matrices_of(const Bytes& bytes) {
  const std::vector<double> values = ByteReader(bytes).values<double>();
  std::vector<Matrix77> matrices;
  for (std::size_t first = 0; first + 49 <= values.size(); first += 49)
    matrices.emplace_back(Eigen::Map<const Matrix77>(values.data() + first));
  return matrices;
}

// Z of a frame or mount: `count` columns of its rows from `first` on, [6 x count]. Column 0 of the step is no column of
// Z.
Eigen::MatrixXd columns_of(const Step& unknowns, const UnknownId& id, std::int64_t first, std::int64_t count) {
  Eigen::MatrixXd z(6, count);
  for (std::int64_t k = 0; k < count; ++k)
    z.col(k) = Eigen::Map<const Eigen::Matrix<double, 6, 1>>(unknowns.find(id, 1 + first + k));
  return z;
}

// The columns of M^-1 that belong to a component, and its block of M^-1 K M^-1.
struct ComponentSums {
  Eigen::MatrixXd inverse, k;
};

// Replaces C by C' (inner_constraints.h) in one diagonal block. N has the columns of the component alone, Z those that
// the rows of `inverse` belong to.
template <typename Block>
void transform(Block& c, const Eigen::MatrixXd& z, const Eigen::MatrixXd& n, const ComponentSums& sums) {
  const Eigen::MatrixXd cross = z * sums.inverse * n.transpose();
  c += n * sums.k * n.transpose() - cross - cross.transpose();
}

std::optional<ComponentSums> position_sums(const Matrix77& m, const Matrix77& k) {
  const Eigen::VectorXd values = symmetric_eigen(m).values;
  if (!(values.minCoeff() > kOneLine * values.maxCoeff())) return std::nullopt;
  const Eigen::MatrixXd whole = inverse(m);
  return ComponentSums{whole, whole * k * whole};
}

UnknownId frame_id(FrameIndex frame) { return {UnknownKind::kFrame, 0, frame.value}; }

}  // namespace

void InnerSums::add(const InnerSums& other) {
  m += other.m;
  k += other.k;
  for (std::size_t c = 0; c < position_m.size(); ++c) {
    position_m[c] += other.position_m[c];
    position_k[c] += other.position_k[c];
  }
}

Bytes InnerSums::to_bytes() const {
  ByteWriter out;
  for (const Eigen::MatrixXd* matrix : {&m, &k})
    out.values(std::vector<double>(matrix->data(), matrix->data() + matrix->size()));
  for (const std::vector<Matrix77>* matrices : {&position_m, &position_k}) out.bytes(bytes_of(*matrices));
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
  for (std::vector<Matrix77>* matrices : {&sums.position_m, &sums.position_k}) *matrices = matrices_of(in.bytes());
  if (!in.at_end() || sums.position_m.size() != sums.position_k.size())
    throw StoreError("merge: sums of the datum have the wrong size");
  return sums;
}

InnerSums inner_sums(const BlockGauge& gauge, std::int64_t tile, const TileProblem& problem, const TilePlan& plan,
                     const TileState& state, const Step& unknowns) {
  const std::int64_t d = gauge.defect();
  const std::vector<std::size_t> free = gauge.free_components();
  InnerSums sums{Eigen::MatrixXd::Zero(d, d), Eigen::MatrixXd::Zero(d, d),
                 std::vector<Matrix77>(free.size(), Matrix77::Zero()),
                 std::vector<Matrix77>(free.size(), Matrix77::Zero())};
  const auto components = free_component_of_frame(gauge, tile, plan);
  for (std::size_t f = 0; f < problem.frames.size(); ++f) {
    const UnknownId id = frame_id(problem.frames[f]);
    if (components[f] == nullptr || find_unknown(plan.owned, id) < 0) continue;
    const BlockComponent& c = *components[f];
    const Eigen::Vector3d position = state.frames[f].centre, reference = reference_place(problem, state, f);
    const Eigen::MatrixXd n = c.move_frame(position, reference);
    const Eigen::MatrixXd weighted = c.weights().asDiagonal() * n;
    sums.m(c.columns, c.columns) += weighted.transpose() * n;
    sums.k(c.columns, Eigen::all) += weighted.transpose() * columns_of(unknowns, id, 0, d);
    const auto number = std::ranges::find(free, at(&c - gauge.components.data())) - free.begin();
    const Matrix67 all = c.similarity(position, reference), weighted_all = c.position_weights().asDiagonal() * all;
    sums.position_m[at(number)] += weighted_all.transpose() * all;
    sums.position_k[at(number)] += weighted_all.transpose() * columns_of(unknowns, id, d + 7 * number, 7);
  }
  return sums;
}

void to_inner_constraints(const BlockGauge& gauge, const InnerSums& sums, std::int64_t tile, const TileProblem& problem,
                          const TilePlan& plan, const TileState& state, const Step& unknowns,
                          TileCovariance& covariance) {
  if (!gauge.free()) return;
  // M is inverted as a whole: components with a common scale share a column, and through it M couples them.
  const Eigen::MatrixXd whole = inverse(sums.m);
  std::vector<ComponentSums> of_component;
  for (const BlockComponent& c : gauge.components) {
    const Eigen::MatrixXd own = whole(Eigen::all, c.columns);
    of_component.push_back({own, own.transpose() * sums.k * own});
  }
  const auto components = free_component_of_frame(gauge, tile, plan);
  const auto number_of = [&](const BlockComponent* c) { return at(c - gauge.components.data()); };
  const auto sums_of = [&](const BlockComponent* c) -> const ComponentSums& { return of_component[number_of(c)]; };
  const std::vector<std::size_t> free = gauge.free_components();
  std::vector<std::optional<ComponentSums>> of_positions;
  for (std::size_t c = 0; c < free.size(); ++c)
    of_positions.push_back(position_sums(sums.position_m[c], sums.position_k[c]));
  covariance.aligned_frames.assign(problem.frames.size(),
                                   Eigen::Matrix<double, 6, 6>::Constant(std::numeric_limits<double>::quiet_NaN()));
  for (std::size_t f = 0; f < problem.frames.size(); ++f) {
    const BlockComponent* c = components[f];
    if (c == nullptr) continue;
    const UnknownId id = frame_id(problem.frames[f]);
    const Eigen::Vector3d position = state.frames[f].centre, reference = reference_place(problem, state, f);
    const auto number = std::ranges::find(free, number_of(c)) - free.begin();
    if (of_positions[at(number)]) {
      covariance.aligned_frames[f] = covariance.frames[f];
      transform(covariance.aligned_frames[f], columns_of(unknowns, id, gauge.defect() + 7 * number, 7),
                c->similarity(position, reference), *of_positions[at(number)]);
    }
    transform(covariance.frames[f], columns_of(unknowns, id, 0, gauge.defect()), c->move_frame(position, reference),
              sums_of(c));
  }
  for (const RowList& cell : plan.points)
    for (const std::int64_t p : cell.rows()) {
      const BlockComponent* c = components[at(frame_of_point(problem, p))];
      if (c == nullptr) continue;
      transform(covariance.points[at(p)], covariance.point_columns[at(p)].leftCols(gauge.defect()),
                c->move_point(state.points[at(p)]), sums_of(c));
    }
  // Free mounts move with the scale of the components that see them.
  std::vector<const BlockComponent*> of_mount(problem.mounts.size(), nullptr);
  for (const TileImage& image : problem.images)
    if (components[at(image.frame.value)] != nullptr) of_mount[at(image.mount)] = components[at(image.frame.value)];
  for (std::size_t m = 0; m < problem.mounts.size(); ++m) {
    const BlockComponent* c = of_mount[m];
    if (c == nullptr || plan.unknown_of_mount[m] < 0) continue;
    const UnknownId id{UnknownKind::kMount, problem.mounts[m].mount, problem.mounts[m].rig.value};
    transform(covariance.mounts[m], columns_of(unknowns, id, 0, gauge.defect()),
              c->free_part(similarity_of_mount(problem, state, m)), sums_of(c));
  }
}

Bytes FrameColumns::to_bytes() const {
  ByteWriter out;
  out.bytes(step.to_bytes());
  out.values(moves);
  out.values(weights);
  return out.take();
}

FrameColumns FrameColumns::from_bytes(const Bytes& bytes) {
  ByteReader in(bytes);
  FrameColumns columns;
  columns.step = Step::from_bytes(in.bytes());
  columns.moves = in.values<double>();
  columns.weights = in.values<double>();
  return columns;
}

FrameColumns frame_columns(const BlockGauge& gauge, std::int64_t tile, const TileProblem& problem, const TilePlan& plan,
                           const TileState& state, const Step& unknowns) {
  UnknownList owned;
  for (const Unknown& u : plan.owned)
    if (u.id.kind == UnknownKind::kFrame) owned.push_back(u);
  FrameColumns columns{unknowns.restricted_to(owned), {}, {}};
  const std::int64_t n = total_dimension(owned);
  Eigen::MatrixXd moves = Eigen::MatrixXd::Zero(n, gauge.defect());
  columns.weights.assign(at(n), 0);
  const auto components = free_component_of_frame(gauge, tile, plan);
  for (std::size_t f = 0; f < problem.frames.size(); ++f) {
    const std::int64_t row = 6 * find_unknown(owned, frame_id(problem.frames[f]));
    const BlockComponent* c = components[f];
    if (row < 0 || c == nullptr) continue;
    const Eigen::MatrixXd own = c->move_frame(state.frames[f].centre, reference_place(problem, state, f));
    for (std::size_t k = 0; k < c->columns.size(); ++k)
      moves.block<6, 1>(row, c->columns[k]) = own.col(static_cast<Eigen::Index>(k));
    Eigen::Map<Eigen::Matrix<double, 6, 1>>(columns.weights.data() + row) = c->weights();
  }
  columns.moves.assign(moves.data(), moves.data() + moves.size());
  return columns;
}

CovarianceMatrix frame_covariance(const BlockGauge& gauge, const UnknownList& frames,
                                  const std::vector<FrameColumns>& tiles) {
  const std::int64_t n = total_dimension(frames), d = gauge.defect();
  Eigen::MatrixXd c(n, n), moves(n, d);
  Eigen::VectorXd weights(n);
  for (const FrameColumns& tile : tiles) {
    const UnknownList& owned = tile.step.unknowns;
    const std::int64_t own = total_dimension(owned);
    const Eigen::Map<const Eigen::MatrixXd> step(tile.step.values.data(), own, tile.step.columns),
        own_moves(tile.moves.data(), own, d);
    const Eigen::Map<const Eigen::VectorXd> own_weights(tile.weights.data(), own);
    for (std::int64_t i = 0; i < std::ssize(owned); ++i) {
      const std::int64_t row = 6 * find_unknown(frames, owned[at(i)].id);
      c.middleRows<6>(row) = step.middleRows<6>(6 * i).rightCols(n);
      moves.middleRows<6>(row) = own_moves.middleRows<6>(6 * i);
      weights.segment<6>(row) = own_weights.segment<6>(6 * i);
    }
  }
  if (d > 0) {
    const Eigen::MatrixXd weighted = weights.asDiagonal() * moves;
    const Eigen::MatrixXd s =
        Eigen::MatrixXd::Identity(n, n) - moves * inverse(weighted.transpose() * moves) * weighted.transpose();
    c = (s * c * s.transpose()).eval();
  }
  c = (0.5 * (c + c.transpose())).eval();
  return {frames, {c.data(), c.data() + c.size()}};
}

}  // namespace megablock
