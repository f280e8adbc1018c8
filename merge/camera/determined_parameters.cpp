// The sample is adjusted with all parameters that are not fixed, each with its weak prior, and screened on the way. The
// forms of all images and of those without each group follow from the normal equations there.
#include "merge/camera/determined_parameters.h"

#include <algorithm>
#include <cmath>

#include "adjust/calibration/rig_observations.h"
#include "adjust/tile/rolling_start.h"
#include "io/base/error.h"
#include "io/project/inputs/camera_priors.h"
#include "merge/tree/tile_solver.h"

namespace megablock {

namespace {

class Determination {
 public:
  Determination(const Block& block, const BlockState& state, const TrackSet& tracks,
                const std::vector<CameraIndex>& cameras, const IndexedVector<CameraIndex, double>& readout_s,
                const AdjustOptions& adjustment, const ParameterChoiceOptions& options)
      : block_(block),
        wanted_(cameras),
        adjustment_(adjustment),
        options_(options),
        whole_(whole_block(block, state, tracks, adjustment.observations)) {
    free_all();
    if (std::any_of(readout_s.begin(), readout_s.end(), [](double t) { return t != 0; }))
      adjust_rolling(state, readout_s);
    else
      adjust_tile(whole_.problem, whole_.state, adjustment, solve_by_condensation);
  }

  std::vector<CameraChoice> run() {
    describe_rows();
    const MakeForms forms = [&](const std::vector<std::uint8_t>& free) { return forms_at(free); };
    const std::vector<CameraChoice> chosen = choose_parameters(forms, rows_, start_, prior_sigma_, options_);
    std::vector<CameraChoice> result;
    for (const CameraIndex camera : wanted_) {
      const auto found = std::find(row_camera_.begin(), row_camera_.end(), camera);
      if (found == row_camera_.end()) {
        result.push_back({0, "held: no image of it in the sample"});
        continue;
      }
      const auto row = static_cast<std::size_t>(found - row_camera_.begin());
      CameraChoice choice = chosen[row];
      choice.focal_px = whole_.state.cameras[row][kFocal];
      choice.focal_sigma_px = std::max(focal_sigma(rows_[row]), choice.focal_scatter_px);
      choice.focal_contradicted = contradicts_focal(block_.cameras[camera], choice);
      result.push_back(std::move(choice));
    }
    return result;
  }

 private:
  bool wanted(CameraIndex camera) const { return std::binary_search(wanted_.begin(), wanted_.end(), camera); }

  static bool contradicts_focal(const Camera& camera, const CameraChoice& choice) {
    constexpr double kSigmas = 3;
    const double sigma = default_intrinsic_sigmas(camera)[kFocal];
    return camera.focal_known && sigma > 0 &&
           std::abs(choice.focal_px - camera.intrinsics[kFocal]) > kSigmas * std::hypot(sigma, choice.focal_sigma_px);
  }

  // With all parameters of the last choice estimated; 0: it is held.
  double focal_sigma(const ChoiceCamera& row) const {
    const auto f = std::find(row.parameters.begin(), row.parameters.end(), kFocal);
    return f == row.parameters.end() ? 0 : sigmas_[row.first + (f - row.parameters.begin())];
  }

  void adjust_rolling(const BlockState& state, const IndexedVector<CameraIndex, double>& readout_s) {
    const FramePaths paths(block_);
    RollingShutters shutters{paths, {}, state};
    for (const CameraIndex c : whole_.problem.cameras)
      shutters.readouts.push_back({readout_s[c], static_cast<double>(block_.cameras[c].height)});
    adjust_moving_tile(shutters, whole_.problem, whole_.state, adjustment_, solve_by_condensation);
  }

  // All parameters of the cameras to choose for become unknowns with a weak prior.
  void free_all() {
    TileProblem& problem = whole_.problem;
    std::erase_if(problem.intrinsic_priors, [&](const TileProblem::IntrinsicTerm& term) {
      return wanted(problem.cameras[static_cast<std::size_t>(term.camera.value)]);
    });
    for (std::size_t c = 0; c < problem.cameras.size(); ++c) {
      if (!wanted(problem.cameras[c])) continue;
      const Camera& camera = block_.cameras[problem.cameras[c]];
      const ParameterMask all = candidates(camera);
      problem.camera_free[c] = all;
      problem.intrinsic_priors.push_back(
          {LocalCamera(static_cast<std::int32_t>(c)), camera.intrinsics, default_intrinsic_sigmas(camera, all)});
    }
    std::sort(problem.intrinsic_priors.begin(), problem.intrinsic_priors.end(),
              [](const auto& a, const auto& b) { return a.camera.value < b.camera.value; });
  }

  // The usual parameters, and those that the project asks for besides. An affinity is not asked for by itself: rows of
  // a moving camera that are read one after the other look like one (lund: b1 = 66, b2 = -69 px of 824), and pixels do
  // not.
  static ParameterMask candidates(const Camera& camera) {
    ParameterMask mask = usual_parameters(camera.intrinsics.model());
    for (int p = 0; p < camera.intrinsics.size(); ++p)
      if (camera.prior_sigma[static_cast<std::size_t>(p)] > 0) mask |= mask_of(p);
    return mask;
  }

  // Holds the other rows at their start values and adjusts again, unless all are free. Then it linearises with all.
  CameraForms forms_at(const std::vector<std::uint8_t>& free) {
    if (std::find(free.begin(), free.end(), 0) != free.end()) adjust_with_held(free);
    const auto all = condense_on_cameras(whole_.problem, whole_.state);
    if (!all) throw ComputeError("a camera has no observation that the adjustment keeps");
    sigmas_ = sigmas_of(*all, free);
    return {*all, forms_without_groups(all->minimum.size()), std::ssize(whole_.problem.frames)};
  }

  // [rows] of the free parameters with the others held; 0 for these.
  static Eigen::VectorXd sigmas_of(const CameraForm& form, const std::vector<std::uint8_t>& free) {
    std::vector<Eigen::Index> rows;
    for (std::size_t i = 0; i < free.size(); ++i)
      if (free[i]) rows.push_back(static_cast<Eigen::Index>(i));
    const Eigen::MatrixXd covariance = Eigen::MatrixXd(form.information(rows, rows))
                                           .ldlt()
                                           .solve(Eigen::MatrixXd::Identity(std::ssize(rows), std::ssize(rows)));
    Eigen::VectorXd sigmas = Eigen::VectorXd::Zero(form.minimum.size());
    sigmas(rows) = covariance.diagonal().cwiseMax(0).cwiseSqrt();
    return sigmas;
  }

  void adjust_with_held(const std::vector<std::uint8_t>& free) {
    const std::vector<ParameterMask> all = whole_.problem.camera_free;
    std::size_t row = 0;
    for (std::size_t c = 0; c < all.size(); ++c)
      for (int p = 0; p < whole_.state.cameras[c].size(); ++p) {
        if (!contains(all[c], p)) continue;
        if (!free[row]) {
          whole_.problem.camera_free[c] &= ~mask_of(p);
          whole_.state.cameras[c][static_cast<std::size_t>(p)] = start_[static_cast<Eigen::Index>(row)];
        }
        ++row;
      }
    adjust_tile(whole_.problem, whole_.state, adjustment_, solve_by_condensation);
    whole_.problem.camera_free = all;
  }

  // Groups of frames, or of tie points where there are few frames. Every n-th one, so that what is left holds together.
  std::vector<CameraForm> forms_without_groups(Eigen::Index rows) const {
    std::vector<CameraForm> forms;
    const auto frames = std::ssize(whole_.problem.frames);
    const bool few = frames < options_.fewest_images;
    const std::int64_t groups = few ? options_.groups : std::min<std::int64_t>(options_.groups, frames);
    for (std::int64_t g = 0; g < groups; ++g) {
      TileProblem problem = whole_.problem;
      for (std::int64_t point = 0; point < problem.point_count(); ++point)
        for (std::int64_t row = problem.begin[point]; row < problem.begin[point + 1]; ++row) {
          if (!problem.kept[row] || !problem.image[row].valid()) continue;
          const std::int64_t member = few ? point : problem.images[problem.image[row].value].frame.value;
          if (member % groups == g) problem.kept[row] = 0;
        }
      const auto form = condense_on_cameras(problem, whole_.state);
      if (form && form->minimum.size() == rows && form->minimum.allFinite()) forms.push_back(*form);
    }
    if (forms.empty()) throw ComputeError("what is left without some images says nothing of a camera");
    return forms;
  }

  // The rows of the forms: the cameras to choose for, and those that are estimated as the block says.
  void describe_rows() {
    const TileProblem& problem = whole_.problem;
    std::vector<double> start, sigma;
    for (std::size_t c = 0; c < problem.cameras.size(); ++c) {
      const Camera& camera = block_.cameras[problem.cameras[c]];
      const bool choose = wanted(problem.cameras[c]);
      const IntrinsicSigmas prior = default_intrinsic_sigmas(camera, candidates(camera));
      ChoiceCamera row{camera.intrinsics.model(), {}, static_cast<Eigen::Index>(start.size())};
      for (int p = 0; p < camera.intrinsics.size(); ++p) {
        if (!contains(problem.camera_free[c], p)) continue;
        if (choose) row.parameters.push_back(p);
        start.push_back(camera.intrinsics[static_cast<std::size_t>(p)]);
        sigma.push_back(prior[static_cast<std::size_t>(p)]);
      }
      rows_.push_back(std::move(row));
      row_camera_.push_back(problem.cameras[c]);
    }
    start_ = Eigen::Map<const Eigen::VectorXd>(start.data(), std::ssize(start));
    prior_sigma_ = Eigen::Map<const Eigen::VectorXd>(sigma.data(), std::ssize(sigma));
  }

  const Block& block_;
  const std::vector<CameraIndex>& wanted_;
  const AdjustOptions& adjustment_;
  const ParameterChoiceOptions& options_;
  WholeBlock whole_;
  std::vector<ChoiceCamera> rows_;
  std::vector<CameraIndex> row_camera_;  // [rows_]
  Eigen::VectorXd start_, prior_sigma_;
  Eigen::VectorXd sigmas_;  // of the last forms
};

}  // namespace

std::vector<CameraChoice> determined_parameters(const Block& block, const BlockState& state, const TrackSet& tracks,
                                                const std::vector<CameraIndex>& cameras,
                                                const IndexedVector<CameraIndex, double>& readout_s,
                                                const AdjustOptions& adjustment,
                                                const ParameterChoiceOptions& options) {
  options.check();
  return Determination(block, state, tracks, cameras, readout_s, adjustment, options).run();
}

}  // namespace megablock
