// The mathematics is in vertical_terms.h. Names: `ground` is g, `seen` is d, `down` is v, `stretch` is s, `across` is W
// v, `in_rig` is u.
#include "adjust/terms/vertical_terms.h"

#include <Eigen/Cholesky>
#include <cmath>

#include "adjust/terms/automatic_terms.h"
#include "adjust/terms/terms.h"
#include "geometry/camera/camera.h"

namespace megablock {

GroundVertical::GroundVertical(const GroundFrame& ground) {
  if (ground.georeferenced) georeference_.emplace(ground);
}

Eigen::Vector3d GroundVertical::down(const Eigen::Vector3d& place) const {
  const Eigen::Vector3d own = -Eigen::Vector3d::UnitZ();
  if (!georeference_) return own;
  return georeference_->own_from_block(georeference_->to_geodetic(place)).conjugate() * own;
}

TileProblem::VerticalTerm vertical_term(const SeenVertical& seen, const GroundVertical& ground,
                                        const Eigen::Vector3d& centre) {
  TileProblem::VerticalTerm term;
  term.ground = ground.down(centre);
  term.seen = seen.down;
  // The covariance of a unit vector is singular along the vector. Only its part in the tangent plane B of d is
  // decomposed: L L' = B' S B and W = L^-1 B'.
  const Eigen::Matrix<double, 3, 2> plane = tangent_plane(seen.down);
  const Eigen::LLT<Eigen::Matrix2d> cholesky(plane.transpose() * seen.covariance * plane);
  term.weight = cholesky.matrixL().solve(plane.transpose());
  term.camera = seen.camera;
  term.by_camera = term.weight * seen.by_camera;
  return term;
}

void take_plumb_lines(const Block& block, const BlockState& places, TileProblem& problem) {
  if (problem.verticals.empty() && problem.lines.empty()) return;
  const GroundVertical ground(block.ground);
  const auto down = [&](LocalFrame frame) {
    return ground.down(places.frames[problem.frames[static_cast<std::size_t>(frame.value)]].centre);
  };
  for (TileProblem::VerticalTerm& term : problem.verticals)
    term.ground = down(problem.images[static_cast<std::size_t>(term.image.value)].frame);
  for (TileProblem::LineTerm& term : problem.lines) term.up = -down(term.frame);
}

VerticalResidual linearise_vertical(const Pose& frame, const Pose& mount, const Intrinsics& camera,
                                    const TileProblem::VerticalTerm& term) {
  // 1 + d'v vanishes where the image looks in the opposite direction. The bound keeps s finite there.
  constexpr double kOpposite = 1e-9;
  const Eigen::Matrix3d mount_rotation = mount.rotation.toRotationMatrix();
  const Eigen::Vector3d in_rig = frame.rotation * term.ground, down = mount_rotation * in_rig;
  const double sum = 1 + term.seen.dot(down), bounded = std::max(sum, kOpposite);
  const double stretch = std::sqrt(2 / bounded);
  const Eigen::Vector2d across = term.weight * down;
  VerticalResidual result;
  result.residual = stretch * across;
  if (term.camera.size() > 0)
    result.residual -=
        term.by_camera * (Eigen::Map<const Eigen::VectorXd>(camera.data(), term.camera.size()) - term.camera);
  Eigen::Matrix<double, 2, 3> by_down = stretch * term.weight;
  // ds/dv = -s / (2 (1 + d'v)) d', and zero where the bound holds s.
  if (sum > kOpposite) by_down -= stretch / (2 * bounded) * across * term.seen.transpose();
  const Eigen::Matrix3d turned = mount_rotation * frame.rotation.toRotationMatrix();
  // dr/dw = (dr/dv) (-R_m R_f [g]x), and with u = R_f g for the mount -(dr/dv) R_m [u]x. Centres do not matter.
  result.by_frame << -by_down * turned * skew(term.ground), Eigen::Matrix<double, 2, 3>::Zero();
  result.by_mount << -by_down * mount_rotation * skew(in_rig), Eigen::Matrix<double, 2, 3>::Zero();
  return result;
}

VerticalResidual linearise_vertical(const TileProblem& problem, const TileState& state,
                                    const TileProblem::VerticalTerm& term) {
  const TileImage& image = problem.images[static_cast<std::size_t>(term.image.value)];
  return linearise_vertical(state.frames[static_cast<std::size_t>(image.frame.value)],
                            state.mounts[static_cast<std::size_t>(image.mount)],
                            state.cameras[static_cast<std::size_t>(image.camera.value)], term);
}

namespace {

// For a camera of any model, or for none.
struct DynamicVertical {
  residual::VerticalSeen vertical;
  template <typename Scalar>
  bool operator()(const Scalar* const* blocks, Scalar* result) const {
    return vertical(blocks[0], blocks[1], vertical.term.camera.size() > 0 ? blocks[2] : nullptr, result);
  }
};

class SeenVerticals final : public ObservationType {
 public:
  std::size_t count(const TileProblem& problem) const override { return problem.verticals.size(); }
  TermUnknowns unknowns(const TileProblem& problem, std::size_t row) const override {
    const TileProblem::VerticalTerm& term = problem.verticals[row];
    const TileImage& image = image_of(problem, term);
    TermUnknowns unknowns{{image.frame.value}, 1};
    unknowns.mounts[0] = image.mount;
    if (term.camera.size() > 0) unknowns.camera = image.camera.value;
    return unknowns;
  }
  void linearise(const TileProblem& problem, const TileState& state, std::size_t row,
                 const TermVisit& visit) const override {
    const TileProblem::VerticalTerm& term = problem.verticals[row];
    const TileImage& image = image_of(problem, term);
    const VerticalResidual r = linearise_vertical(problem, state, term);
    LinearTerm out;
    out.set_residual(r.residual);
    out.kinds.fill(ObservationKind::kVertical);
    out.add_block(LinearTerm::By::kFrame, image.frame.value, r.by_frame);
    out.add_block(LinearTerm::By::kMount, image.mount, r.by_mount);
    if (term.camera.size() > 0) out.add_block(LinearTerm::By::kCamera, image.camera.value, -term.by_camera);
    out.loss = problem.vertical_loss;
    visit(out);
  }
  TermDatum datum(const TileProblem& problem, const TileState& state, std::size_t row) const override {
    const TileProblem::VerticalTerm& term = problem.verticals[row];
    TermDatum datum;
    datum.frame = image_of(problem, term).frame.value;
    // A mount turns with its rig, so that a similarity of the ground acts on the frame alone.
    datum.by_frame = linearise_vertical(problem, state, term).by_frame;
    return datum;
  }
  RobustLoss loss(const TileProblem& problem, std::size_t) const override { return problem.vertical_loss; }
  void scale_sigmas(TileProblem& problem, const SigmaScales& scales) const override {
    for (TileProblem::VerticalTerm& term : problem.verticals) {
      term.weight /= scales[ObservationKind::kVertical];
      term.by_camera /= scales[ObservationKind::kVertical];
    }
  }
  ceres::CostFunction* automatic(const TileProblem& problem, std::size_t row) const override {
    const TileProblem::VerticalTerm& term = problem.verticals[row];
    std::vector<int> blocks{kPoseBlock, kPoseBlock};
    if (term.camera.size() > 0) blocks.push_back(static_cast<int>(term.camera.size()));
    return automatic_dynamic_term(DynamicVertical{residual::VerticalSeen{term}}, 2, blocks);
  }

 private:
  static const TileImage& image_of(const TileProblem& problem, const TileProblem::VerticalTerm& term) {
    return problem.images[static_cast<std::size_t>(term.image.value)];
  }
};

}  // namespace

const ObservationType& vertical_observations() {
  static const SeenVerticals type;
  return type;
}

}  // namespace megablock
