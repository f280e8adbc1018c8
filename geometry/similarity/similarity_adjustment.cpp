#include "geometry/similarity/similarity_adjustment.h"

#include "geometry/transform/rotation.h"

namespace megablock {

namespace {

// The Gauss-Helmert model: s R x + t - y = 0 for every point.
struct SimilarityEquations {
  static constexpr int kUnknowns = 7, kEquations = 3, kMeasurements = 6, kConstraints = 0;
  using State = Similarity;

  void linearise(const State& s, const Eigen::Matrix<double, 6, 1>& l, std::size_t,
                 GroupEquations<SimilarityEquations>& out) const {
    const Eigen::Matrix3d turn = s.scale * s.rotation.toRotationMatrix();
    const Eigen::Vector3d from = l.head<3>(), turned = turn * from;
    out.value = turned + s.translation - l.tail<3>();
    out.by_unknowns << -turn * skew(from), turned, Eigen::Matrix3d::Identity();
    out.by_measurements << turn, -Eigen::Matrix3d::Identity();
  }
  void move(State& s, const SimilarityStep& step) const { s = similarity_update(s, step); }
};

}  // namespace

std::optional<AdjustedSimilarity> adjust_similarity(const Similarity& start, std::span<const PointPair> pairs) {
  if (pairs.size() < 3) return std::nullopt;
  // The coordinates are reduced to the two centroids; the result is moved back at the end.
  Eigen::Vector3d from_centre = Eigen::Vector3d::Zero(), to_centre = Eigen::Vector3d::Zero();
  for (const PointPair& pair : pairs) {
    from_centre += pair.from / static_cast<double>(pairs.size());
    to_centre += pair.to / static_cast<double>(pairs.size());
  }
  std::vector<Eigen::Matrix<double, 6, 1>> measured(pairs.size());
  std::vector<Eigen::Matrix<double, 6, 6>> covariances(pairs.size(), Eigen::Matrix<double, 6, 6>::Zero());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    measured[i] << pairs[i].from - from_centre, pairs[i].to - to_centre;
    covariances[i].topLeftCorner<3, 3>() = pairs[i].from_covariance;
    covariances[i].bottomRightCorner<3, 3>() = pairs[i].to_covariance;
  }
  Similarity reduced = start;
  reduced.translation = start(from_centre) - to_centre;
  const auto fit =
      fit_gauss_helmert(SimilarityEquations(), reduced, std::span<const Eigen::Matrix<double, 6, 1>>(measured),
                        std::span<const Eigen::Matrix<double, 6, 6>>(covariances));
  if (!fit) return std::nullopt;

  AdjustedSimilarity result{fit->state, {}, fit->weighted_squares, fit->redundancy};
  Similarity& s = result.similarity;
  s.translation += to_centre - s.scale * (s.rotation * from_centre);
  result.covariance = covariance_about_origin(s, from_centre, fit->covariance);
  return result;
}

}  // namespace megablock
