// The similarity of tile t has seven parameters about the centroid c_t of its frames: the rotation vector phi
// (radians), the shift v (metres) and the relative scale s. It places a frame with centre C and attitude R at
//
//     S_t C = c_t + v + (1 + s) Exp(phi) (C - c_t),    S_t R = R Exp(phi)^-1.
//
// About the centroid, small changes of phi and s move the frames to all sides, and v alone moves the tile as a whole. p
// and a are in metres, r in radians. The last term of the head (tile_alignment.h) has the seven residuals v / a and e
// phi / a, e s / a, where e is the root mean square distance of the frames from c_t.
#include "merge/start/tile_alignment.h"

#include <ceres/autodiff_cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>

#include "geometry/transform/rotation.h"

namespace megablock {

namespace {

// The sigmas p and r come from the differences at the start of each round. They shrink as the tiles come together, and
// the loss then sees smaller outliers.
constexpr int kRounds = 3;
constexpr double kLeast = 1e-9;  // m and rad: smaller differences count as agreement to rounding

// The similarity of a tile about its centroid: rotation phi, shift, relative scale.
using Parameters = std::array<double, 7>;

template <typename Scalar>
using Vector3 = Eigen::Matrix<Scalar, 3, 1>;

template <typename Scalar>
Eigen::Quaternion<Scalar> turn_of(const Scalar* p) {
  return rotation_exp<Scalar>(Vector3<Scalar>(p[0], p[1], p[2]));
}

// A frame as a tile holds it, ready to be moved by the tile's parameters.
struct Placed {
  Eigen::Vector3d arm, centroid;  // arm: from the tile's centroid to the frame
  Eigen::Quaterniond rotation;

  template <typename Scalar>
  Vector3<Scalar> centre(const Scalar* p) const {
    const Vector3<Scalar> turned = turn_of(p) * arm.cast<Scalar>().eval();
    return centroid.cast<Scalar>() + Vector3<Scalar>(p[3], p[4], p[5]) + (Scalar(1) + p[6]) * turned;
  }
  template <typename Scalar>
  Eigen::Quaternion<Scalar> attitude(const Scalar* p) const {
    return rotation.cast<Scalar>() * turn_of(p).conjugate();
  }
};

// A frame that two tiles hold.
struct Common {
  std::size_t tile, home;
  Placed in_tile, in_home;

  template <typename Scalar>
  Vector3<Scalar> shift(const Scalar* tile_parameters, const Scalar* home_parameters) const {
    return in_tile.centre(tile_parameters) - in_home.centre(home_parameters);
  }
  template <typename Scalar>
  Vector3<Scalar> turn(const Scalar* tile_parameters, const Scalar* home_parameters) const {
    return rotation_log<Scalar>(in_tile.attitude(tile_parameters) * in_home.attitude(home_parameters).conjugate());
  }
};

struct ShiftResidual {
  Common common;
  double weight;
  template <typename Scalar>
  bool operator()(const Scalar* tile, const Scalar* home, Scalar* residual) const {
    Eigen::Map<Vector3<Scalar>>(residual, 3) = Scalar(weight) * common.shift(tile, home);
    return true;
  }
};

struct TurnResidual {
  Common common;
  double weight;
  template <typename Scalar>
  bool operator()(const Scalar* tile, const Scalar* home, Scalar* residual) const {
    Eigen::Map<Vector3<Scalar>>(residual, 3) = Scalar(weight) * common.turn(tile, home);
    return true;
  }
};

// The residuals of the last term of the head. This term has no loss: no tile is an outlier of the mean place of all.
struct StayResidual {
  double weight, extent;
  template <typename Scalar>
  bool operator()(const Scalar* p, Scalar* residual) const {
    for (int k = 0; k < 7; ++k) residual[k] = p[k] * Scalar(k >= 3 && k < 6 ? weight : weight * extent);
    return true;
  }
};

struct SharedFrame {  // by all tiles that hold it
  FrameIndex frame;
  std::int64_t observations;
  std::size_t tile, row;
};

class Aligner {
 public:
  explicit Aligner(const std::vector<AlignmentTile>& tiles) : tiles_(tiles), parameters_(tiles.size(), Parameters{}) {
    for (const AlignmentTile& tile : tiles) {
      Eigen::Vector3d mean = Eigen::Vector3d::Zero();
      for (const Pose& pose : tile.poses) mean += pose.centre;
      if (!tile.poses.empty()) mean /= static_cast<double>(tile.poses.size());
      double squares = 0;
      for (const Pose& pose : tile.poses) squares += (pose.centre - mean).squaredNorm();
      centroids_.push_back(mean);
      extents_.push_back(std::sqrt(squares / std::max<double>(1, static_cast<double>(tile.poses.size()))));
    }
    find_common_frames();
  }

  std::vector<Similarity> run() {
    if (!common_.empty()) {
      // This is a of the head, the first p. It stays, so that the tiles are held equally in all rounds.
      const double anchor = median_shift();
      for (int round = 0; round < kRounds; ++round) solve(median_shift(), median_turn(), anchor);
    }
    std::vector<Similarity> result;
    for (std::size_t t = 0; t < tiles_.size(); ++t) result.push_back(similarity(t));
    return result;
  }

 private:
  Placed placed(const SharedFrame& f) const {
    const Pose& pose = tiles_[f.tile].poses[f.row];
    return {pose.centre - centroids_[f.tile], centroids_[f.tile], pose.rotation};
  }

  // The tile with most observations of a frame is its home, h of the head; every other tile that holds it gives one
  // pair.
  void find_common_frames() {
    std::vector<SharedFrame> all;
    for (std::size_t t = 0; t < tiles_.size(); ++t)
      for (std::size_t row = 0; row < tiles_[t].frames.size(); ++row)
        if (tiles_[t].observations[row] >= kFewestAlignmentObservations)
          all.push_back({tiles_[t].frames[row], tiles_[t].observations[row], t, row});
    std::sort(all.begin(), all.end(), [](const SharedFrame& a, const SharedFrame& b) {
      if (a.frame != b.frame) return a.frame < b.frame;
      return a.observations != b.observations ? a.observations > b.observations : a.tile < b.tile;
    });
    for (std::size_t home = 0, i = 1; i < all.size(); ++i) {
      if (all[i].frame != all[home].frame)
        home = i;
      else
        common_.push_back({all[i].tile, all[home].tile, placed(all[i]), placed(all[home])});
    }
  }

  template <typename Length>
  double median(Length&& length) const {
    std::vector<double> lengths;
    for (const Common& c : common_) lengths.push_back(length(c));
    const auto middle = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2);
    std::nth_element(lengths.begin(), middle, lengths.end());
    return std::max(kLeast, *middle);
  }
  double median_shift() const {
    return median(
        [&](const Common& c) { return c.shift(parameters_[c.tile].data(), parameters_[c.home].data()).norm(); });
  }
  double median_turn() const {
    return median(
        [&](const Common& c) { return c.turn(parameters_[c.tile].data(), parameters_[c.home].data()).norm(); });
  }

  void solve(double shift_sigma, double turn_sigma, double stay_sigma) {
    ceres::Problem::Options ownership;
    ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    ceres::CauchyLoss loss(1);
    ceres::Problem problem(ownership);
    for (std::size_t t = 0; t < tiles_.size(); ++t)
      problem.AddResidualBlock(new ceres::AutoDiffCostFunction<StayResidual, 7, 7>(
                                   new StayResidual{1 / stay_sigma, std::max(kLeast, extents_[t])}),
                               nullptr, parameters_[t].data());
    for (const Common& c : common_) {
      double *tile = parameters_[c.tile].data(), *home = parameters_[c.home].data();
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<ShiftResidual, 3, 7, 7>(new ShiftResidual{c, 1 / shift_sigma}), &loss, tile,
          home);
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<TurnResidual, 3, 7, 7>(new TurnResidual{c, 1 / turn_sigma}), &loss, tile,
          home);
    }
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
    // The order of the sums in Ceres depends on the number of threads.
    options.num_threads = 1;
    options.max_num_iterations = 50;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
  }

  Similarity similarity(std::size_t t) const {
    const double* p = parameters_[t].data();
    Similarity s;
    s.scale = 1 + p[6];
    s.rotation = turn_of(p);
    s.translation = centroids_[t] + Eigen::Vector3d(p[3], p[4], p[5]) - s.scale * (s.rotation * centroids_[t]);
    return s;
  }

  const std::vector<AlignmentTile>& tiles_;
  std::vector<Parameters> parameters_;  // one allocation, because Ceres orders parameter blocks by their addresses
  std::vector<Eigen::Vector3d> centroids_;
  std::vector<double> extents_;
  std::vector<Common> common_;
};

}  // namespace

std::vector<Similarity> align_tiles(const std::vector<AlignmentTile>& tiles) { return Aligner(tiles).run(); }

}  // namespace megablock
