#include "merge/inner_constraints.h"

#include <cmath>

#include "geometry/decompositions.h"
#include "merge/unknowns.h"

namespace megablock {

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
Eigen::Matrix<double, 6, Eigen::Dynamic> columns_of(const Step& unknowns, const UnknownId& id,
                                                    const BlockComponent& c) {
  Eigen::Matrix<double, 6, Eigen::Dynamic> z(6, c.defect);
  for (std::int64_t k = 0; k < c.defect; ++k)
    z.col(k) = Eigen::Map<const Eigen::Matrix<double, 6, 1>>(unknowns.find(id, 1 + c.first_column + k));
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
  const auto components = free_component_of_frame(gauge, tile, plan);
  for (std::size_t f = 0; f < problem.frames.size(); ++f) {
    const UnknownId id{UnknownKind::kFrame, 0, problem.frames[f].value};
    if (components[f] == nullptr || find_unknown(plan.owned, id) < 0) continue;
    const BlockComponent& c = *components[f];
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
  std::vector<Eigen::MatrixXd> inverses, k;
  for (const BlockComponent& c : gauge.components) {
    inverses.push_back(inverse(sums.m.block(c.first_column, c.first_column, c.defect, c.defect)));
    k.push_back(sums.k.block(c.first_column, c.first_column, c.defect, c.defect));
  }
  const auto components = free_component_of_frame(gauge, tile, plan);
  const auto row_of = [&](const BlockComponent* c) { return static_cast<std::size_t>(c - gauge.components.data()); };
  for (std::size_t f = 0; f < problem.frames.size(); ++f) {
    const BlockComponent* c = components[f];
    if (c == nullptr) continue;
    const UnknownId id{UnknownKind::kFrame, 0, problem.frames[f].value};
    transform(covariance.frames[f], columns_of(unknowns, id, *c),
              Eigen::MatrixXd(c->move(state.frames[f].centre).leftCols(c->defect)), inverses[row_of(c)], k[row_of(c)]);
  }
  for (const RowList& cell : plan.points)
    for (const std::int64_t p : cell.rows()) {
      const BlockComponent* c = components[at(frame_of_point(problem, p))];
      if (c == nullptr) continue;
      transform(covariance.points[at(p)],
                Eigen::MatrixXd(covariance.point_columns[at(p)].middleCols(c->first_column, c->defect)),
                Eigen::MatrixXd(c->move_point(state.points[at(p)]).leftCols(c->defect)), inverses[row_of(c)],
                k[row_of(c)]);
    }
  // Free mounts change with the scale of the component that sees them.
  std::vector<const BlockComponent*> of_mount(problem.mounts.size(), nullptr);
  for (const TileImage& image : problem.images) of_mount[at(image.mount)] = components[at(image.frame.value)];
  for (std::size_t m = 0; m < problem.mounts.size(); ++m) {
    const BlockComponent* c = of_mount[m];
    if (c == nullptr || plan.unknown_of_mount[m] < 0) continue;
    Matrix67 move = Matrix67::Zero();
    move.bottomRightCorner<3, 1>() = state.mounts[m].centre;
    const UnknownId id{UnknownKind::kMount, problem.mounts[m].mount, problem.mounts[m].rig.value};
    transform(covariance.mounts[m], columns_of(unknowns, id, *c),
              Eigen::MatrixXd((move * c->directions).leftCols(c->defect)), inverses[row_of(c)], k[row_of(c)]);
  }
}

}  // namespace megablock
