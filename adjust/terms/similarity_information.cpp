#include "adjust/terms/similarity_information.h"

#include <algorithm>
#include <type_traits>
#include <utility>

#include "adjust/terms/linearise.h"
#include "adjust/terms/terms.h"
#include "geometry/transform/rotation.h"

namespace megablock {

namespace {

// Weight of the scale in a part where held mounts fix it, as if a prior gave it to a thousandth.
constexpr double kScaleGiven = 1e6;

std::size_t at(std::int64_t row) { return static_cast<std::size_t>(row); }

class InformationSum {
 public:
  InformationSum(const TileProblem& problem, const TileState& state, const std::vector<std::int64_t>& part_of_frame,
                 const std::vector<SimilarityInformation*>& parts)
      : problem_(problem), state_(state), part_of_frame_(part_of_frame), parts_(parts) {}

  void add_terms() {
    for (const ObservationType* type : observation_types())
      for (std::size_t row = 0; row < type->count(problem_); ++row) add_term(type->datum(problem_, state_, row));
  }

  // Priors of control points. The point moves by dX, and its residual is divided by sigma on each axis; an infinite
  // sigma adds nothing.
  void add_point_priors() {
    for (const auto& term : problem_.point_priors) {
      const std::int64_t point = term.point.value;
      if (!problem_.active(point)) continue;
      SimilarityInformation& part = part_of(frame_of_point(problem_, point));
      add(part, term.sigma.cwiseInverse().asDiagonal() *
                    similarity_of_point(state_.points[at(point)], part.centre, part.extent));
    }
  }

  // Mounts tell the scale alone: a similarity of the ground turns and shifts no mount.
  void add_mounts() {
    std::vector<std::pair<std::int64_t, std::int32_t>> seen;  // (part, mount)
    for (const TileImage& image : problem_.images)
      if (part_of_frame_[at(image.frame.value)] >= 0)
        seen.emplace_back(part_of_frame_[at(image.frame.value)], image.mount);
    std::sort(seen.begin(), seen.end());
    seen.erase(std::unique(seen.begin(), seen.end()), seen.end());
    for (const auto& [part, mount] : seen) {
      double& scale = parts_[at(part)]->normal(6, 6);
      if (rig_gives_scale(problem_, state_, at(mount))) scale += kScaleGiven;
      for (const auto& term : problem_.mount_priors) {
        if (term.mount != mount) continue;
        const Matrix67 scaled = similarity_of_mount(problem_, state_, at(mount));
        scale += (linearise_mount(state_.mounts[at(mount)], term).by_mount * scaled.col(6)).squaredNorm();
      }
    }
  }

 private:
  template <typename Derived>
  static void add(SimilarityInformation& part, const Eigen::MatrixBase<Derived>& residual_by_similarity) {
    part.normal += residual_by_similarity.transpose() * residual_by_similarity;
  }
  SimilarityInformation& part_of(std::int64_t frame) { return *parts_[at(part_of_frame_[at(frame)])]; }
  Eigen::Vector3d reference(std::int64_t frame) const { return reference_place(problem_, state_, at(frame)); }

  void add_term(const TermDatum& term) {
    if (term.frame < 0) return;
    SimilarityInformation& part = part_of(term.frame);
    // The length of a base grows by its own length with the scale: d|b| / ds = |b|.
    if (term.base_to >= 0) {
      const Eigen::Vector3d base = reference(term.base_to) - reference(term.frame);
      part.normal(6, 6) += base.squaredNorm() / (term.base_sigma_m * term.base_sigma_m);
      return;
    }
    const Matrix67 moved =
        similarity_of_frame(state_.frames[at(term.frame)].centre, reference(term.frame), part.centre, part.extent);
    std::visit(
        [&](const auto& by_frame) {
          if constexpr (!std::is_same_v<std::decay_t<decltype(by_frame)>, std::monostate>) add(part, by_frame * moved);
        },
        term.by_frame);
    // The sigma of a held position does not matter here, only whether it moves.
    if (term.holds_place) part.held += moved.bottomRows<3>().transpose() * moved.bottomRows<3>();
  }

  const TileProblem& problem_;
  const TileState& state_;
  const std::vector<std::int64_t>& part_of_frame_;
  const std::vector<SimilarityInformation*>& parts_;
};

}  // namespace

Matrix37 similarity_of_point(const Eigen::Vector3d& position, const Eigen::Vector3d& centre, double extent) {
  const Eigen::Vector3d arm = position - centre;
  Matrix37 move;
  move << -skew<double>(arm), extent * Eigen::Matrix3d::Identity(), arm;
  return move;
}

Eigen::Vector3d reference_place(const TileProblem& problem, const TileState& state, std::size_t frame) {
  return state.frames[frame].centre + state.frames[frame].rotation.conjugate() * problem.reference_of_frame[frame];
}

Matrix67 similarity_of_frame(const Eigen::Vector3d& position, const Eigen::Vector3d& reference,
                             const Eigen::Vector3d& centre, double extent) {
  Matrix67 move = Matrix67::Zero();
  move.topLeftCorner<3, 3>() = -Eigen::Matrix3d::Identity();
  move.bottomRows<3>() = similarity_of_point(position, centre, extent);
  move.bottomRightCorner<3, 1>() = reference - centre;
  return move;
}

Matrix67 similarity_of_mount(const TileProblem& problem, const TileState& state, std::size_t mount) {
  Matrix67 move = Matrix67::Zero();
  move.bottomRightCorner<3, 1>() = state.mounts[mount].centre - problem.reference_of_mount[mount];
  return move;
}

void add_similarity_information(const TileProblem& problem, const TileState& state,
                                const std::vector<std::int64_t>& part_of_frame,
                                const std::vector<SimilarityInformation*>& parts) {
  InformationSum sum(problem, state, part_of_frame, parts);
  sum.add_terms();
  sum.add_point_priors();
  sum.add_mounts();
}

}  // namespace megablock
