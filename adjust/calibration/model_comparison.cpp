// The order of run(): a sample of the block is adjusted with its own cameras; the richest candidate screens it; every
// candidate is then adjusted to the observations that are left.
//
// Why the richest model screens: residuals of a poor model at the corners look like outliers. A model that chose its
// own data would be tested on what it can describe.
//
// Why there is no robust loss in a trial: residual fields and RMS are compared between models, and a loss would weigh
// the observations differently for each of them.
//
// The degrees of freedom leave out the loose priors (loose_sigmas.h). They are numbers for the solver, not
// observations.
#include "adjust/calibration/model_comparison.h"

#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "adjust/calibration/camera_fit.h"
#include "adjust/calibration/loose_sigmas.h"
#include "adjust/calibration/rig_observations.h"
#include "adjust/terms/linearise.h"
#include "io/base/error.h"

namespace megablock {

namespace {

constexpr int kAllTerms = -1;

ModelCandidate candidate_of(const CameraModel& model, int terms) {
  ModelCandidate candidate{model, usual_parameters(model), model_name(model)};
  if (terms == kAllTerms) return candidate;
  candidate.name += "/" + std::to_string(terms);
  // All but the first `terms` radial terms are held, and so is decentring: the candidates are to grow by one thing at a
  // time.
  candidate.free &= ~radial_terms(model, kMaxIntrinsics) | radial_terms(model, terms);
  candidate.free &= ~parameters_with(model, ParameterRole::kTangential);
  return candidate;
}

void sort_by_size(std::vector<ModelCandidate>& candidates) {
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const ModelCandidate& a, const ModelCandidate& b) { return a.parameters() < b.parameters(); });
}

}  // namespace

ModelCandidate find_candidate(const std::string& name) {
  const std::size_t slash = name.find('/');
  const auto model = find_model(name.substr(0, slash));
  if (!model) throw InputError("'" + name + "' is not a camera model; the models are " + model_list());
  if (is_panorama(*model))
    throw InputError("'" + name + "' is no model of a lens: stitched panoramas have none to compare");
  if (slash == std::string::npos) return candidate_of(*model, kAllTerms);
  int terms = 0;
  const char* end = name.data() + name.size();
  const auto read = std::from_chars(name.data() + slash + 1, end, terms);
  const int most = count_of(radial_terms(*model, kMaxIntrinsics));
  if (read.ec != std::errc() || read.ptr != end || terms < 1 || terms > most)
    throw InputError("'" + name + "': the number after the slash is that of the estimated radial terms, 1 to " +
                     std::to_string(most) + " for " + model_name(*model));
  return candidate_of(*model, terms);
}

// Lenses that see 90 degrees off their axis have fisheyes as candidates alone, because perspective models have no pixel
// there.
std::vector<ModelCandidate> default_candidates(const CameraModel& given) {
  if (is_panorama(given))
    throw InputError("the camera is a stitched panorama (equirectangular), which has no lens to model");
  std::vector<std::string> names = {"opencv-fisheye/1", "opencv-fisheye/2", "opencv-fisheye/3", "opencv-fisheye"};
  if (!sees_sideways(given))
    names = {"pinhole",      "brown/1",    "brown/2",      "brown/3",       "brown",         "ign-radial/1",
             "ign-radial/2", "ign-radial", "odd-radial-4", "even-radial-2", "even-radial-4", "polynomial-3",
             "polynomial-5", "legendre-3", "legendre-5",   "fourier-1",     "fourier-2",     "opencv-fisheye"};
  std::vector<ModelCandidate> candidates;
  for (const std::string& name : names) candidates.push_back(find_candidate(name));
  sort_by_size(candidates);
  return candidates;
}

void ModelComparisonOptions::check() const {
  adjustment.check();
  sample.check();
  if (!(probability > 0 && probability < 0.5)) throw InputError("probability must lie in (0, 0.5)");
  if (max_iterations < 5) throw InputError("max_iterations must be at least 5");
}

namespace {

class Comparer {
 public:
  Comparer(const Block& block, const ModelComparisonOptions& options) : block_(block), options_(options) {}

  ModelComparison run(const BlockState& state, const TrackSet& tracks, std::vector<ModelCandidate> candidates) {
    prepare(state, tracks);
    sort_by_size(candidates);
    screen_with(candidates.back());
    for (const ModelCandidate& candidate : candidates) result_.trials.push_back(trial(candidate));
    choose();
    return std::move(result_);
  }

 private:
  // Adjusts a sample of the block with its own camera models and screens out outliers.
  void prepare(const BlockState& state, const TrackSet& tracks) {
    const BlockSample sample = sample_block(block_, state, tracks, options_.sample);
    WholeBlock whole = adjust_whole(block_, sample.state, sample.tracks, options_.adjustment);
    problem_ = std::move(whole.problem);
    start_ = std::move(whole.state);
    given_ = start_.cameras;
    result_.cameras = problem_.cameras;
    result_.frames = sample.frames;
    result_.images = sample.images;
    result_.probability = options_.probability;
  }

  const Camera& camera(std::size_t row) const { return block_.cameras[problem_.cameras[row]]; }

  // Returns the problem with all cameras of the candidate's model and weak priors for their parameters. `state` gets
  // cameras of this model that are fitted to the given ones.
  TileProblem problem_of(const ModelCandidate& candidate, TileState& state) const {
    TileProblem problem = problem_;
    problem.intrinsic_priors.clear();
    for (std::size_t c = 0; c < problem.cameras.size(); ++c) {
      state.cameras[c] =
          fit_camera(candidate.model, candidate.free, given_[c], camera(c).width, camera(c).height).camera;
      problem.camera_free[c] = candidate.free;
      TileProblem::IntrinsicTerm term{LocalCamera(static_cast<std::int32_t>(c)), state.cameras[c], {}};
      term.sigma = loose_sigmas(state.cameras[c], camera(c).width, camera(c).height);
      for (int p = 0; p < state.cameras[c].size(); ++p)
        if (!contains(candidate.free, p)) term.sigma[static_cast<std::size_t>(p)] = 0;
      problem.intrinsic_priors.push_back(term);
    }
    return problem;
  }

  void screen_with(const ModelCandidate& richest) {
    TileState state = start_;
    TileProblem problem = problem_of(richest, state);
    // A camera converted to the richest model may not reach all pixels. The observations then stay as they are.
    if (!projectable(problem, state)) return;
    // Two rounds: outliers bend the first solution, and good observations come back in the second.
    for (int round = 0; round < 2; ++round) {
      if (!solve_with_ceres(problem, state, {options_.max_iterations, 1e-7, {}}).usable) return;
      screen_observations(problem, state, screening_threshold(problem, state, options_.adjustment),
                          options_.adjustment);
    }
    problem_.kept = problem.kept;
    start_.frames = state.frames;
    start_.mounts = state.mounts;
    start_.points = state.points;
    // The fitted cameras of the richest model are the best description of the lenses. All candidates are converted from
    // them.
    given_ = state.cameras;
  }

  // Whether every kept observation has a finite residual.
  // Ceres refuses a start at which a residual cannot be computed.
  static bool projectable(const TileProblem& problem, const TileState& state) {
    for (std::int64_t p = 0; p < problem.point_count(); ++p) {
      if (!problem.active(p)) continue;
      for (std::int64_t row = problem.begin[p]; row < problem.begin[p + 1]; ++row)
        if (problem.kept[row] && !image_difference_px(problem, state, p, row).allFinite()) return false;
    }
    return true;
  }

  // Adjusts everything with the model of the candidate, from the same start and with the same observations as all
  // others.
  ModelTrial trial(const ModelCandidate& candidate) const {
    ModelTrial result;
    result.candidate = candidate;
    TileState state = start_;
    TileProblem problem = problem_of(candidate, state);
    problem.image_loss = {};
    if (!projectable(problem, state)) {
      result.failure = "cannot project all measurements";
      return result;
    }
    const AdjustSummary summary = solve_with_ceres(problem, state, {options_.max_iterations, 1e-9, {}});
    if (!summary.usable) {
      result.failure = "does not converge";
      return result;
    }
    result.degrees_of_freedom = summary.degrees_of_freedom - weak_priors(problem);
    figures(problem, state, result);
    return result;
  }

  // The number of priors that are too weak to count as observations.
  static std::int64_t weak_priors(const TileProblem& problem) {
    std::int64_t count = 0;
    for (const auto& term : problem.intrinsic_priors)
      for (int p = 0; p < term.value.size(); ++p) count += intrinsic_prior_weight(term, p) > 0;
    return count;
  }

  void figures(const TileProblem& problem, const TileState& state, ModelTrial& result) const {
    // Residuals are collected by camera, at the measured pixels: the structure of a lens is a function of the sensor.
    std::vector<std::vector<ResidualAtPixel>> residuals(problem.cameras.size());
    double squares = 0;
    std::int64_t observations = 0;
    for (std::int64_t p = 0; p < problem.point_count(); ++p) {
      if (!problem.active(p)) continue;
      for (std::int64_t row = problem.begin[p]; row < problem.begin[p + 1]; ++row) {
        if (!problem.kept[row]) continue;
        const Eigen::Vector2d residual = image_difference_px(problem, state, p, row);
        const auto c = static_cast<std::size_t>(problem.images[problem.image[row].value].camera.value);
        residuals[c].push_back({{problem.x[row], problem.y[row]}, residual});
        squares += residual.squaredNorm();
        ++observations;
      }
    }
    result.rms_px = std::sqrt(squares / static_cast<double>(std::max<std::int64_t>(1, observations)));
    result.sigma_px = std::sqrt(squares / static_cast<double>(std::max<std::int64_t>(1, result.degrees_of_freedom)));
    for (std::size_t c = 0; c < residuals.size(); ++c) {
      double own = 0;
      for (const ResidualAtPixel& r : residuals[c]) own += r.residual.squaredNorm();
      const double n = static_cast<double>(std::max<std::size_t>(1, residuals[c].size()));
      result.cameras.push_back(
          {state.cameras[c], std::sqrt(own / n),
           residual_structure(residuals[c], camera(c).width, camera(c).height, result.candidate.parameters())});
    }
  }

  // For each camera: the smallest model without structure, or, where every model leaves some, the smallest whose
  // structure is within a tenth of the least.
  void choose() {
    const auto adjusted = [](const ModelTrial& t) { return t.failure.empty(); };
    if (std::none_of(result_.trials.begin(), result_.trials.end(), adjusted))
      throw ComputeError("no model can be adjusted: " + result_.trials.front().candidate.name + " " +
                         result_.trials.front().failure);
    for (const std::uint8_t kept : problem_.kept) result_.observations += kept;
    for (std::int64_t p = 0; p < problem_.point_count(); ++p) result_.points += problem_.active(p);
    for (std::size_t c = 0; c < problem_.cameras.size(); ++c) {
      int best = -1, least = -1;
      for (int t = 0; t < static_cast<int>(std::ssize(result_.trials)); ++t) {
        if (!adjusted(result_.trials[t])) continue;
        const ResidualStructure& s = result_.trials[t].cameras[c].structure;
        const bool clean = s.degrees > 0 && s.probability >= options_.probability;
        if (clean && (best < 0 || better(t, best, c))) best = t;
        // Where every model leaves structure, a larger one must lower it by a tenth at least.
        constexpr double kWorthIt = 0.9;
        if (least < 0 || s.structure_px < kWorthIt * result_.trials[least].cameras[c].structure.structure_px) least = t;
      }
      result_.without_structure.push_back(best >= 0);
      result_.recommended.push_back(best >= 0 ? best : least);
    }
  }
  // Of two models without structure the one with fewer parameters is better, then the one with the lower RMS.
  bool better(int a, int b, std::size_t c) const {
    const ModelTrial &x = result_.trials[a], &y = result_.trials[b];
    if (x.candidate.parameters() != y.candidate.parameters())
      return x.candidate.parameters() < y.candidate.parameters();
    return x.cameras[c].rms_px < y.cameras[c].rms_px;
  }

  const Block& block_;
  const ModelComparisonOptions& options_;
  TileProblem problem_;
  TileState start_;
  std::vector<Intrinsics> given_;  // [problem cameras] the candidates are fitted to these
  ModelComparison result_;
};

}  // namespace

ModelComparison compare_models(const Block& block, const BlockState& state, const TrackSet& tracks,
                               const std::vector<ModelCandidate>& candidates, const ModelComparisonOptions& options) {
  options.check();
  if (candidates.empty()) throw InputError("there are no models to compare");
  return Comparer(block, options).run(state, tracks, candidates);
}

}  // namespace megablock
