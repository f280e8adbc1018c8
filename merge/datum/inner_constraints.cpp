#include "merge/datum/inner_constraints.h"

#include <cmath>

#include "geometry/numbers/decompositions.h"
#include "merge/plan/unknowns.h"

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

// Z of a frame or mount: columns 1 and up of its rows, [6 x defect].
Eigen::MatrixXd columns_of(const Step& unknowns, const UnknownId& id, std::int64_t defect) {
  Eigen::MatrixXd z(6, defect);
  for (std::int64_t k = 0; k < defect; ++k)
    z.col(k) = Eigen::Map<const Eigen::Matrix<double, 6, 1>>(unknowns.find(id, 1 + k));
  return z;
}

// The columns of M^-1 that belong to a component, and its block of M^-1 K M^-1.
struct ComponentSums {
  Eigen::MatrixXd inverse, k;
};

// Replaces C by C' (inner_constraints.h) in one diagonal block. N has the columns of the component alone, Z those of
// the whole block.
template <typename Block>
void transform(Block& c, const Eigen::MatrixXd& z, const Eigen::MatrixXd& n, const ComponentSums& sums) {
  const Eigen::MatrixXd cross = z * sums.inverse * n.transpose();
  c += n * sums.k * n.transpose() - cross - cross.transpose();
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
    const Eigen::MatrixXd n = c.move_frame(state.frames[f].centre, reference_place(problem, state, f));
    const Eigen::MatrixXd weighted = c.weights().asDiagonal() * n;
    sums.m(c.columns, c.columns) += weighted.transpose() * n;
    sums.k(c.columns, Eigen::all) += weighted.transpose() * columns_of(unknowns, id, d);
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
  const auto sums_of = [&](const BlockComponent* c) -> const ComponentSums& {
    return of_component[at(c - gauge.components.data())];
  };
  for (std::size_t f = 0; f < problem.frames.size(); ++f) {
    const BlockComponent* c = components[f];
    if (c == nullptr) continue;
    const UnknownId id{UnknownKind::kFrame, 0, problem.frames[f].value};
    transform(covariance.frames[f], columns_of(unknowns, id, gauge.defect()),
              c->move_frame(state.frames[f].centre, reference_place(problem, state, f)), sums_of(c));
  }
  for (const RowList& cell : plan.points)
    for (const std::int64_t p : cell.rows()) {
      const BlockComponent* c = components[at(frame_of_point(problem, p))];
      if (c == nullptr) continue;
      transform(covariance.points[at(p)], covariance.point_columns[at(p)], c->move_point(state.points[at(p)]),
                sums_of(c));
    }
  // Free mounts move with the scale of the components that see them.
  std::vector<const BlockComponent*> of_mount(problem.mounts.size(), nullptr);
  for (const TileImage& image : problem.images)
    if (components[at(image.frame.value)] != nullptr) of_mount[at(image.mount)] = components[at(image.frame.value)];
  for (std::size_t m = 0; m < problem.mounts.size(); ++m) {
    const BlockComponent* c = of_mount[m];
    if (c == nullptr || plan.unknown_of_mount[m] < 0) continue;
    const UnknownId id{UnknownKind::kMount, problem.mounts[m].mount, problem.mounts[m].rig.value};
    transform(covariance.mounts[m], columns_of(unknowns, id, gauge.defect()),
              c->free_part(similarity_of_mount(problem, state, m)), sums_of(c));
  }
}

}  // namespace megablock
