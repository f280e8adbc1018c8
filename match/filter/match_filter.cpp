#include "match/filter/match_filter.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>
#include <opencv2/ml.hpp>
#include <sstream>

#include "io/base/error.h"
#include "io/base/hash.h"
#include "match/shipped_filter.h"

namespace megablock {

struct MatchFilter::Model {
  std::vector<int> features;  // MatchFeature
  std::vector<double> mean, deviation;
  cv::Ptr<cv::ml::SVM> machine;
};

std::optional<MatchSample> match_sample(const TrustedPair& pair, const Camera& camera_a, const Eigen::Vector2d& a,
                                        const Camera& camera_b, const Eigen::Vector2d& b) {
  const auto ray_a = ground_ray(pair.a, camera_a.intrinsics, a), ray_b = ground_ray(pair.b, camera_b.intrinsics, b);
  if (!ray_a || !ray_b) return std::nullopt;
  const double focal_a = camera_a.intrinsics[kFocal], focal_b = camera_b.intrinsics[kFocal];
  MatchSample sample{match_errors(*ray_a, *ray_b, focal_a, focal_b)};
  const double distance = std::min(std::abs(sample.errors.distance_a_m), std::abs(sample.errors.distance_b_m));
  sample.sigma_px = pair.epipolar_sigma_px(0.5 * (focal_a + focal_b), distance);
  return sample;
}

// The logarithms and asinh compress the long tails of the errors.
double value_of(MatchFeature feature, const MatchSample& sample) {
  const MatchErrors& e = sample.errors;
  switch (feature) {
    case MatchFeature::kReprojection:
      return std::log1p(e.reprojection_px / sample.sigma_px);
    case MatchFeature::kDistance:
      return std::asinh(std::min(e.distance_a_m, e.distance_b_m));
    case MatchFeature::kAngle:
      return std::log1p(e.angle_rad * 180 / std::numbers::pi);
    case MatchFeature::kRayDistance:
      break;
  }
  return std::log1p(100 * e.ray_distance_m);
}

MatchFilter::MatchFilter(const std::string& yaml) : model_(std::make_unique<Model>()) {
  try {
    const cv::FileStorage file(yaml, cv::FileStorage::READ | cv::FileStorage::MEMORY | cv::FileStorage::FORMAT_YAML);
    file["features"] >> model_->features;
    file["mean"] >> model_->mean;
    file["deviation"] >> model_->deviation;
    model_->machine = cv::ml::SVM::create();
    model_->machine->read(file["machine"]);
  } catch (const cv::Exception& error) {
    throw InputError("match filter: not a model of 'megablock train-filter': " + error.err);
  }
  // OpenCV accepts any YAML and leaves what is missing empty, so everything is checked here.
  const std::size_t count = model_->features.size();
  const bool known =
      std::all_of(model_->features.begin(), model_->features.end(), [](int f) { return f >= 0 && f <= 3; });
  if (count == 0 || !known || model_->mean.size() != count || model_->deviation.size() != count ||
      !model_->machine->isTrained() || model_->machine->getVarCount() != static_cast<int>(count))
    throw InputError("match filter: not a model of 'megablock train-filter'");
  hash_ = Hasher().add(yaml).value();
}

MatchFilter::~MatchFilter() = default;
MatchFilter::MatchFilter(MatchFilter&&) noexcept = default;

MatchFilter MatchFilter::shipped() { return MatchFilter(kShippedFilter); }

MatchFilter MatchFilter::load(const std::string& path) {
  std::ifstream in(path);
  if (!in) throw InputError(path + ": cannot be read; it must be a model of 'megablock train-filter'");
  std::ostringstream text;
  text << in.rdbuf();
  try {
    return MatchFilter(text.str());
  } catch (const InputError& error) {
    throw InputError(path + ": " + error.what());
  }
}

std::vector<std::uint8_t> MatchFilter::right(const std::vector<MatchSample>& samples) const {
  if (samples.empty()) return {};
  const auto rows = static_cast<int>(samples.size()), columns = static_cast<int>(model_->features.size());
  cv::Mat values(rows, columns, CV_32F), answers;
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) {
      const auto at = static_cast<std::size_t>(c);
      const double value =
          value_of(static_cast<MatchFeature>(model_->features[at]), samples[static_cast<std::size_t>(r)]);
      values.at<float>(r, c) = static_cast<float>((value - model_->mean[at]) / model_->deviation[at]);
    }
  model_->machine->predict(values, answers);
  std::vector<std::uint8_t> right(samples.size());
  for (int r = 0; r < rows; ++r) right[static_cast<std::size_t>(r)] = answers.at<float>(r) > 0.5f;
  return right;
}

}  // namespace megablock
