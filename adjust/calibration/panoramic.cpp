// Makes the start, the rounds and the tests of panoramic.h; the conditions themselves are in panoramic_system.h.
//
// The threshold. The length of a residual of two numbers has the median 1.1774 sigma. The residuals of an adjustment
// with the redundancy share q = f / 2n are shorter by sqrt(q), so that sigma = median / (1.1774 sqrt(q)). Observations
// beyond max_residual_sigmas of it are left out, times a width of 4 while the camera is rough, then of 64, 16, 4 and 1.
//
// The end of the iterations. The squared Newton decrement g' (N + lambda I)^-1 g is what a step promises to lower the
// cost by. It is compared with the squares of one degree of freedom.
#include "adjust/calibration/panoramic.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "adjust/calibration/loose_sigmas.h"
#include "adjust/calibration/panoramic_system.h"
#include "adjust/orientation/steps/rotation_averaging.h"
#include "geometry/numbers/chi_square.h"
#include "geometry/numbers/decompositions.h"
#include "geometry/numbers/median.h"
#include "geometry/transform/rotation_fit.h"
#include "io/base/error.h"

namespace megablock {

void PanoramicOptions::check() const {
  if (!(image_sigma_px > 0)) throw InputError("image_sigma_px must be positive");
  if (!(max_residual_sigmas >= 3)) throw InputError("max_residual_sigmas must be at least 3");
  if (min_common < 3) throw InputError("min_common must be at least 3");
}

namespace {

// Two images and the rows of their homologous pixels.
struct HomologousPair {
  int a = 0, b = 0;
  std::vector<std::pair<std::int64_t, std::int64_t>> rows;
};

// Every two images with enough common tracks, ascending, the lower image first in every row.
std::vector<HomologousPair> linked_pairs(const PanoramicTracks& tracks, int min_common) {
  std::map<std::pair<int, int>, std::vector<std::pair<std::int64_t, std::int64_t>>> common;
  for (std::size_t t = 0; t + 1 < tracks.begin.size(); ++t)
    for (std::int64_t i = tracks.begin[t]; i < tracks.begin[t + 1]; ++i)
      for (std::int64_t j = i + 1; j < tracks.begin[t + 1]; ++j) {
        const bool ordered = tracks.image[i] < tracks.image[j];
        common[{ordered ? tracks.image[i] : tracks.image[j], ordered ? tracks.image[j] : tracks.image[i]}].push_back(
            ordered ? std::pair(i, j) : std::pair(j, i));
      }
  std::vector<HomologousPair> pairs;
  for (auto& [images, rows] : common)
    if (std::ssize(rows) >= min_common) pairs.push_back({images.first, images.second, std::move(rows)});
  return pairs;
}

// The rotation a -> b, and the median length of the differences that it leaves, in pixels.
struct PairFit {
  Eigen::Quaterniond rotation;
  double median_px = 0;
  std::size_t count = 0;
};

PairFit fit_pair(const PanoramicTracks& tracks, const HomologousPair& pair, const Intrinsics& camera) {
  std::vector<Eigen::Vector3d> from, to;
  for (const auto& [i, j] : pair.rows) {
    const auto a = viewing_ray(camera, tracks.pixel[i]), b = viewing_ray(camera, tracks.pixel[j]);
    if (!a || !b) continue;
    from.push_back(*a);
    to.push_back(*b);
  }
  PairFit fit{fit_rotation_robust(from, to), 0, from.size()};
  std::vector<double> lengths;
  for (std::size_t i = 0; i < from.size(); ++i)
    // In pixels: differences of rays alone would shrink with a longer focal length, and the longest one would win.
    lengths.push_back(camera[kFocal] * (to[i] - fit.rotation * from[i]).norm());
  fit.median_px = median(lengths);
  return fit;
}

// The camera with the focal length with which pairs of images agree best.
Intrinsics with_best_focal(const PanoramicTracks& tracks, const std::vector<HomologousPair>& pairs,
                           const Intrinsics& start) {
  if (is_fixed(start.model(), kFocal)) return start;
  constexpr int kSteps = 8;  // steps for a factor of two
  Intrinsics best = start;
  double lowest = std::numeric_limits<double>::infinity();
  // Seventeen focal lengths in equal ratios. The best of them is at most 4.4 per cent off.
  for (int step = -kSteps; step <= kSteps; ++step) {
    Intrinsics camera = start;
    camera[kFocal] *= std::exp2(static_cast<double>(step) / kSteps);
    double sum = 0, count = 0;
    for (const HomologousPair& pair : pairs) {
      const PairFit fit = fit_pair(tracks, pair, camera);
      sum += static_cast<double>(fit.count) * fit.median_px;
      count += static_cast<double>(fit.count);
    }
    if (count > 0 && sum / count < lowest) {
      lowest = sum / count;
      best = camera;
    }
  }
  return best;
}

std::vector<std::optional<Eigen::Quaterniond>> start_rotations(const PanoramicTracks& tracks,
                                                               const std::vector<HomologousPair>& pairs,
                                                               const Intrinsics& camera) {
  constexpr double kLoosest = 0.5;  // rad: loops do not close before the camera is known
  std::vector<RelativeRotation> edges;
  for (const HomologousPair& pair : pairs) {
    const PairFit fit = fit_pair(tracks, pair, camera);
    edges.push_back({pair.a, pair.b, fit.rotation, static_cast<double>(fit.count)});
  }
  const auto images = static_cast<std::int32_t>(tracks.images.size());
  return average_rotations(images, edges, std::vector<std::optional<RotationPrior>>(tracks.images.size()), kLoosest)
      .rotation;
}

// Runs the Levenberg-Marquardt iterations, and the rounds around them.
class Calibration {
 public:
  Calibration(const PanoramicTracks& tracks, const std::vector<std::uint8_t>& linked, const PanoramicPrior& prior,
              const PanoramicOptions& options)
      : options_(options), system_(tracks, linked, prior) {}

  PanoramicSystem& system() { return system_; }

  // Linearises anew, screens at `width` times the threshold, and adjusts; repeats this until nothing changes.
  void adjust(PanoramicState& state, ParameterMask free, double width) {
    constexpr int kMaxRounds = 12;
    for (int round = 0; round < kMaxRounds; ++round) {
      system_.linearise_at(state);
      const std::int64_t changed = system_.screen(state, width * threshold(state, free));
      // The mean direction of a track changes with the rows that are kept.
      if (changed > 0) system_.linearise_at(state);
      if (solve(state, free) && changed == 0) return;
    }
  }
  void adjust_without_screening(PanoramicState& state, ParameterMask free) {
    for (int round = 0; round < 3; ++round) {
      system_.linearise_at(state);
      if (solve(state, free)) return;
    }
  }

  double noise_px(const PanoramicState& state, ParameterMask free) const {
    return std::sqrt(system_.cost(state) / static_cast<double>(std::max<std::int64_t>(1, freedom(free))));
  }
  // A row has two numbers, a track two unknowns (its mean direction in the tangent plane).
  std::int64_t freedom(ParameterMask free) const {
    return 2 * system_.kept_rows() - 2 * system_.kept_tracks() - system_.unknowns(free);
  }

  // The covariance of the free parameters and rotations for unit noise. The normal matrix is scaled to a unit diagonal
  // before it is inverted.
  Eigen::MatrixXd covariance(const PanoramicState& state, ParameterMask free) const {
    const Eigen::MatrixXd normal = system_.normal(state, free).matrix;
    if (normal.size() == 0)
      throw ComputeError("the images do not determine the model " + model_name(state.camera.model()) +
                         ": its correction folds the image; turn the camera by larger angles, or take a smaller model");
    const Eigen::VectorXd scale = scale_of(normal);
    return scale.asDiagonal() * inverse(scale.asDiagonal() * normal * scale.asDiagonal()) * scale.asDiagonal();
  }

 private:
  static Eigen::VectorXd scale_of(const Eigen::MatrixXd& normal) {
    return normal.diagonal().unaryExpr([](double d) { return d > 0 ? 1 / std::sqrt(d) : 1.0; });
  }

  // The threshold in pixels, from the median of the residuals; while nothing is left out, from that of all of them.
  double threshold(const PanoramicState& state, ParameterMask free) const {
    std::vector<double> lengths;
    for (const Eigen::Vector2d& e : system_.residuals(state))
      if (e.allFinite()) lengths.push_back(e.norm());
    const double share =
        static_cast<double>(freedom(free)) / (2 * static_cast<double>(std::max<std::size_t>(1, lengths.size())));
    constexpr double kRayleighMedian = 1.1774, kFinestPx = 0.02;
    return options_.max_residual_sigmas *
           std::max(kFinestPx, median(lengths) / (kRayleighMedian * std::sqrt(std::clamp(share, 0.05, 1.0))));
  }

  // Returns whether the state was at the minimum already.
  // Levenberg-Marquardt with the linearisation points held.
  bool solve(PanoramicState& state, ParameterMask free) {
    constexpr int kMaxSteps = 30;
    constexpr double kSettled = 1e-6;  // Newton decrement squared, in units of the noise
    double damping = 1e-4;
    bool settled_at_once = false;
    PanoramicSystem::Normal normal = system_.normal(state, free);
    // Some pixels have no ray. They are left out when the system is linearised anew.
    if (!std::isfinite(normal.cost)) return false;
    for (int step = 0; step < kMaxSteps; ++step) {
      const Eigen::VectorXd scale = scale_of(normal.matrix);
      const Eigen::MatrixXd scaled = scale.asDiagonal() * normal.matrix * scale.asDiagonal();
      const Eigen::VectorXd gradient = scale.asDiagonal() * normal.gradient;
      Eigen::MatrixXd damped = scaled;
      damped.diagonal().array() += damping;
      const Eigen::VectorXd scaled_move = -solve_symmetric(damped, gradient);
      if (!scaled_move.allFinite()) return false;
      const double decrement = -scaled_move.dot(gradient);
      // Squares of the noise per degree of freedom: decrements are measured in it, since the noise is not known
      // beforehand.
      const double unit = normal.cost / static_cast<double>(std::max<std::int64_t>(1, freedom(free)));
      if (decrement <= kSettled * unit) return settled_at_once = step == 0;
      const PanoramicState next = system_.moved(state, free, scale.asDiagonal() * scaled_move);
      if (system_.cost(next) < normal.cost) {
        state = next;
        normal = system_.normal(state, free);
        if (!std::isfinite(normal.cost)) return false;
        damping = std::max(1e-12, 0.1 * damping);
      } else {
        damping *= 10;
        if (damping > 1e8) return settled_at_once = step == 0;
      }
    }
    return settled_at_once;
  }

  const PanoramicOptions& options_;
  PanoramicSystem system_;
};

// A shift of the principal point of some models is nothing but a rotation of the camera, which is an unknown already.
ParameterMask estimated(const Intrinsics& start, ParameterMask held) { return usual_parameters(start.model()) & ~held; }

ParameterMask leading(const CameraModel& model, ParameterMask free) {
  ParameterMask mask = 0;
  for (int p = 0; p < parameter_count(model); ++p)
    if (contains(free, p) && parameter_rank(model, p) == ParameterRank::kLeading) mask |= mask_of(p);
  return mask;
}

double rms_of(const std::vector<Eigen::Vector2d>& residuals) {
  double sum = 0;
  std::int64_t count = 0;
  for (const Eigen::Vector2d& e : residuals)
    if (e.allFinite()) sum += e.squaredNorm(), ++count;
  return count > 0 ? std::sqrt(sum / static_cast<double>(count)) : 0;
}

// The first linked image keeps the identity.
PanoramicState start_state(const Intrinsics& camera, const std::vector<std::optional<Eigen::Quaterniond>>& rotations,
                           std::vector<std::uint8_t>& linked) {
  PanoramicState state{camera, std::vector<Eigen::Quaterniond>(rotations.size(), Eigen::Quaterniond::Identity())};
  std::optional<Eigen::Quaterniond> first;
  for (std::size_t i = 0; i < rotations.size(); ++i) {
    linked[i] = rotations[i].has_value();
    if (!linked[i]) continue;
    if (!first) first = rotations[i];
    // R_i R_0': the panorama frame becomes that of the first linked image.
    state.rotations[i] = (*rotations[i] * first->conjugate()).normalized();
  }
  return state;
}

void warn_of_left_out(const PanoramicTracks& tracks, const PanoramicOptions& options, PanoramicResult& result) {
  for (std::size_t i = 0; i < tracks.images.size(); ++i)
    if (!result.linked[i])
      result.warnings.push_back(
          fmt::format("{}: left out: it shares fewer than {} homologous points with the other images", tracks.images[i],
                      options.min_common));
}

void warn_of_centre(const PanoramicOptions& options, PanoramicResult& result) {
  if (result.parallax.deviations > options.parallax_deviations)
    result.warnings.push_back(fmt::format(
        "the camera was evidently not turned about its projection centre: {:.0f} % of the residuals lie along the "
        "lines "
        "of one displacement (noise: 50 %, {:.0f} deviations); turn it about its entrance pupil or keep to distant "
        "points",
        100 * result.parallax.along, result.parallax.deviations));
  if (result.chi2_probability < options.chi2_probability)
    result.warnings.push_back(fmt::format(
        "the residuals are {:.2f} times what a noise of {:.2f} px explains (chi-square test): the centre was not the "
        "same for all images, the model is too small, or the points are less exact than that",
        result.sigma_px / options.image_sigma_px, options.image_sigma_px));
}

void warn_of_structure(const PanoramicOptions& options, PanoramicResult& result) {
  const ResidualStructure& s = result.structure;
  if (s.degrees > 0 && s.probability < options.structure_probability)
    result.warnings.push_back(
        fmt::format("the residuals have structure over the sensor ({:.2f} px, probability {:.1g}): the model {} does "
                    "not describe the lens, or the centre was not the same; try a larger model",
                    s.structure_px, s.probability, model_name(result.camera.model())));
}

// A parameter that the images do not determine follows its prior alone, and the result is refused. The centre of
// symmetry is an exception, because it hardly matters for a lens with little distortion.
void check_determined(const PanoramicPrior& prior, PanoramicResult& result) {
  // With a posterior sigma of half that of the prior, the images give three times the information of the prior. A
  // parameter with less follows its prior too much.
  constexpr double kWeakFocal = 0.1, kWeakPrior = 0.5;
  const CameraModel& model = result.camera.model();
  for (int p = 0; p < result.camera.size(); ++p) {
    if (!contains(result.free, p)) continue;
    const double sigma = result.sigma(p);
    const double most =
        p == kFocal ? kWeakFocal * result.camera[kFocal] : kWeakPrior * prior.sigma[static_cast<std::size_t>(p)];
    if (std::isfinite(sigma) && sigma < most) continue;
    const std::string name = parameter_name(model, p);
    if (contains(parameters_with(model, ParameterRole::kSymmetry), p))
      result.warnings.push_back(
          fmt::format("the centre of symmetry is not determined ({} has sigma {:.0f} px): the lens distorts too little",
                      name, sigma));
    else
      throw ComputeError(fmt::format(
          "the images do not determine {} of the model {} (sigma {:.3g}); turn the camera by larger angles, also about "
          "its axis, cover the corners, or take a smaller model",
          name, model_name(model), sigma));
  }
}

void require_freedom(const PanoramicTracks& tracks, const Intrinsics& start, std::int64_t freedom) {
  if (freedom > 0) return;
  throw InputError(
      fmt::format("{} homologous points are too few for the model {} and a rotation per image ({} conditions are "
                  "missing); measure more or take a smaller model",
                  std::ssize(tracks.begin) - 1, model_name(start.model()), 1 - freedom));
}

// The covariance of all parameters: that of the free ones, and zero for the others.
Eigen::MatrixXd of_all_parameters(const Eigen::MatrixXd& covariance, ParameterMask free, int parameters) {
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(parameters, parameters);
  std::vector<int> rows;
  for (int p = 0; p < parameters; ++p)
    if (contains(free, p)) rows.push_back(p);
  for (std::size_t i = 0; i < rows.size(); ++i)
    for (std::size_t j = 0; j < rows.size(); ++j)
      all(rows[i], rows[j]) = covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
  return all;
}

void take_residuals(const PanoramicTracks& tracks, PanoramicSystem& system, const PanoramicState& state, int width,
                    int height, PanoramicResult& result) {
  result.residuals = system.residuals(state);
  result.rms_px = rms_of(result.residuals);
  result.observations = system.kept_rows();
  result.tracks = system.kept_tracks();
  std::vector<ResidualAtPixel> over_sensor;
  for (std::size_t r = 0; r < result.residuals.size(); ++r) {
    Eigen::Vector2d& residual = result.residuals[r];
    // The system has measured minus adjusted, the result adjusted minus measured.
    residual = -residual;
    if (residual.allFinite())
      over_sensor.push_back({tracks.pixel[r], residual});
    else
      result.rejected += result.linked[static_cast<std::size_t>(tracks.image[r])];
  }
  result.structure = residual_structure(over_sensor, width, height, count_of(result.free));
}

void take_statistics(const Calibration& calibration, const PanoramicState& state, const PanoramicOptions& options,
                     PanoramicResult& result) {
  result.degrees_of_freedom = calibration.freedom(result.free);
  // chi2 = squares / image_sigma^2. The covariance is scaled by the estimated noise, since the stated sigma is a guess.
  const auto degrees = static_cast<double>(result.degrees_of_freedom);
  result.sigma_px = calibration.noise_px(state, result.free);
  result.chi2 = degrees * std::pow(result.sigma_px / options.image_sigma_px, 2);
  result.chi2_probability = chi_square_exceeds(result.chi2, degrees);
  result.covariance = of_all_parameters(calibration.covariance(state, result.free), result.free, state.camera.size()) *
                      (result.sigma_px * result.sigma_px);
}

}  // namespace

PanoramicResult calibrate_panoramic(const PanoramicTracks& tracks, const Intrinsics& start, int width, int height,
                                    const PanoramicOptions& options, ParameterMask held) {
  options.check();
  if (tracks.images.size() < 2)
    throw InputError("panoramic calibration needs at least two images that overlap; give more images of the camera");
  const std::vector<HomologousPair> pairs = linked_pairs(tracks, options.min_common);
  if (pairs.empty())
    throw InputError(
        fmt::format("no two of the {} images share {} homologous points; turn the camera by less than its field of "
                    "view between images, or match them again",
                    tracks.images.size(), options.min_common));
  constexpr double kRough = 4;
  PanoramicResult result;
  result.free = estimated(start, held);
  result.linked.assign(tracks.images.size(), 0);
  const Intrinsics camera = contains(result.free, kFocal) ? with_best_focal(tracks, pairs, start) : start;
  PanoramicState state = start_state(camera, start_rotations(tracks, pairs, camera), result.linked);
  warn_of_left_out(tracks, options, result);

  const PanoramicPrior prior{start, loose_sigmas(start, width, height), options.image_sigma_px};
  Calibration calibration(tracks, result.linked, prior, options);
  calibration.system().linearise_at(state);
  require_freedom(tracks, start, calibration.freedom(result.free));
  // Where the images form a closed circle, even a small error of the focal length pulls correct observations far apart.
  // When the focal length is known they are tested again with wide limits, so that they can come back.
  // Rotations first, then the leading parameters with them, then all: a wrong focal length would bend the distortion.
  for (const ParameterMask free : {ParameterMask{0}, leading(start.model(), result.free), result.free})
    calibration.adjust(state, free, kRough);
  for (const double wider : {64.0, 16.0, 4.0, 1.0}) calibration.adjust(state, result.free, wider);
  require_freedom(tracks, start, calibration.freedom(result.free));

  result.camera = state.camera;
  result.rotations = state.rotations;
  take_residuals(tracks, calibration.system(), state, width, height, result);
  take_statistics(calibration, state, options, result);
  result.parallax = calibration.system().parallax(state);
  check_determined(prior, result);
  warn_of_centre(options, result);
  warn_of_structure(options, result);

  // The start is judged by the same observations, with its own best rotations.
  PanoramicState before{start, state.rotations};
  calibration.adjust_without_screening(before, 0);
  result.start_rms_px = rms_of(calibration.system().residuals(before));
  constexpr double kSame = 1 + 1e-6;  // a start that is the optimum already is accepted
  if (!(result.rms_px <= kSame * result.start_rms_px))
    throw ComputeError(
        fmt::format("the calibration (RMS {:.3f} px) is not better than its start ({:.3f} px), which is kept",
                    result.rms_px, result.start_rms_px));
  return result;
}

}  // namespace megablock
