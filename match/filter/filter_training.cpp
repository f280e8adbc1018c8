#include "match/filter/filter_training.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/ml.hpp>
#include <random>

#include "io/base/error.h"
#include "io/simulate/blocks/simulate.h"

namespace megablock {

namespace {

// Grid of the cross-validation: penalties C and widths gamma of the radial basis functions.
constexpr double kPenalties[] = {1, 10, 100}, kWidths[] = {0.1, 0.4, 1.6, 6.4};
constexpr int kFolds = 5;

// The label of a match of two observations: true (right), false (wrong), or none. It is undefined for two observations
// of one moving object at one moment and for two of one place of a repeated facade.
std::optional<bool> label_of(std::uint8_t a, std::uint8_t b, bool same_frame) {
  constexpr auto kRight = static_cast<std::uint8_t>(Verdict::kRight),
                 kVehicle = static_cast<std::uint8_t>(Verdict::kVehicle);
  if (a == kRight && b == kRight) return true;
  if ((a == kRight) != (b == kRight)) return false;
  if (a == kVehicle && b == kVehicle && !same_frame) return false;
  return std::nullopt;
}

// std::shuffle depends on the standard library; this one gives the same order everywhere.
template <typename Value>
void shuffle(std::vector<Value>& values, std::mt19937_64& generator) {
  for (std::size_t i = values.size(); i > 1; --i) std::swap(values[i - 1], values[generator() % i]);
}

struct Matrix {
  cv::Mat values, labels;  // CV_32F [samples, features], CV_32S [samples, 1]
};

// Mean and standard deviation of each feature over the training samples.
struct Scaling {
  std::vector<double> mean, deviation;
};

Scaling scaling_of(const std::vector<const LabelledMatch*>& matches, const std::vector<MatchFeature>& features) {
  Scaling scaling;
  const auto count = static_cast<double>(matches.size());
  for (const MatchFeature feature : features) {
    double sum = 0, squares = 0;
    for (const LabelledMatch* m : matches) sum += value_of(feature, m->sample);
    for (const LabelledMatch* m : matches) squares += std::pow(value_of(feature, m->sample) - sum / count, 2);
    scaling.mean.push_back(sum / count);
    scaling.deviation.push_back(std::max(1e-9, std::sqrt(squares / count)));
  }
  return scaling;
}

Matrix matrix_of(const std::vector<const LabelledMatch*>& matches, const std::vector<MatchFeature>& features,
                 const Scaling& scaling) {
  const auto rows = static_cast<int>(matches.size()), columns = static_cast<int>(features.size());
  Matrix matrix{cv::Mat(rows, columns, CV_32F), cv::Mat(rows, 1, CV_32S)};
  for (int r = 0; r < rows; ++r) {
    const LabelledMatch& match = *matches[static_cast<std::size_t>(r)];
    for (int c = 0; c < columns; ++c) {
      const auto at = static_cast<std::size_t>(c);
      matrix.values.at<float>(r, c) =
          static_cast<float>((value_of(features[at], match.sample) - scaling.mean[at]) / scaling.deviation[at]);
    }
    matrix.labels.at<int>(r) = match.right;
  }
  return matrix;
}

cv::Ptr<cv::ml::SVM> trained(const Matrix& matrix, double penalty, double width) {
  const auto machine = cv::ml::SVM::create();
  machine->setType(cv::ml::SVM::C_SVC);
  machine->setKernel(cv::ml::SVM::RBF);
  machine->setC(penalty);
  machine->setGamma(width);
  machine->setTermCriteria({cv::TermCriteria::MAX_ITER + cv::TermCriteria::EPS, 20000, 1e-5});
  machine->train(matrix.values, cv::ml::ROW_SAMPLE, matrix.labels);
  return machine;
}

// Number of samples that the machine classifies correctly.
int count_right(const cv::ml::SVM& machine, const Matrix& matrix) {
  cv::Mat answers;
  machine.predict(matrix.values, answers);
  int right = 0;
  for (int r = 0; r < matrix.values.rows; ++r)
    right += (answers.at<float>(r) > 0.5f) == (matrix.labels.at<int>(r) == 1);
  return right;
}

// The samples of one fold, or all others.
Matrix part_of(const Matrix& all, int fold, bool inside) {
  Matrix part{cv::Mat(0, all.values.cols, CV_32F), cv::Mat(0, 1, CV_32S)};
  for (int r = 0; r < all.values.rows; ++r) {
    if ((r % kFolds == fold) != inside) continue;
    part.values.push_back(all.values.row(r));
    part.labels.push_back(all.labels.row(r));
  }
  return part;
}

// Chooses penalty and width by cross-validation and trains on all samples.
cv::Ptr<cv::ml::SVM> best_machine(const Matrix& matrix) {
  int most = -1;
  double penalty = 0, width = 0;
  for (const double c : kPenalties)
    for (const double g : kWidths) {
      int right = 0;
      for (int fold = 0; fold < kFolds; ++fold)
        right += count_right(*trained(part_of(matrix, fold, false), c, g), part_of(matrix, fold, true));
      if (right <= most) continue;  // of equal ones the first, which is the smoothest
      most = right;
      penalty = c, width = g;
    }
  return trained(matrix, penalty, width);
}

std::string to_yaml(const std::vector<MatchFeature>& features, const Scaling& scaling, const cv::ml::SVM& machine) {
  cv::FileStorage file("model.yaml", cv::FileStorage::WRITE | cv::FileStorage::MEMORY | cv::FileStorage::FORMAT_YAML);
  std::vector<int> numbers;
  for (const MatchFeature feature : features) numbers.push_back(static_cast<int>(feature));
  file << "features" << numbers << "mean" << scaling.mean << "deviation" << scaling.deviation << "machine"
       << "{";
  machine.write(file);
  file << "}";
  return file.releaseAndGetString();
}

}  // namespace

std::vector<LabelledMatch> labelled_matches(const Block& block, const TrackSet& tracks,
                                            const std::vector<std::uint8_t>& wrong, const TrustOptions& trust,
                                            std::uint64_t seed) {
  if (wrong.size() != tracks.image.size())
    throw InputError("match filter: " + std::to_string(wrong.size()) + " labels for " +
                     std::to_string(tracks.image.size()) + " observations; give one label per observation");
  const TrustedPairs trajectory(block, trust);
  std::mt19937_64 generator(seed);
  std::vector<LabelledMatch> matches;
  for (std::int64_t t = 0; t < tracks.track_count(); ++t) {
    std::vector<std::pair<std::int64_t, std::int64_t>> pairs;
    for (std::int64_t i = tracks.begin[t]; i < tracks.begin[t + 1]; ++i)
      for (std::int64_t j = i + 1; j < tracks.begin[t + 1]; ++j) pairs.emplace_back(i, j);
    shuffle(pairs, generator);
    // Wrong matches are rare, so a track with an outlier contributes a wrong match if it can.
    std::optional<LabelledMatch> chosen;
    for (const auto& [i, j] : pairs) {
      const ImageIndex a = tracks.image[static_cast<std::size_t>(i)], b = tracks.image[static_cast<std::size_t>(j)];
      const bool same_frame = block.images[a].frame == block.images[b].frame;
      const auto label = label_of(wrong[static_cast<std::size_t>(i)], wrong[static_cast<std::size_t>(j)], same_frame);
      if (!label || same_frame || (chosen && (*label || !chosen->right))) continue;
      const auto pair = trajectory.relate(a, b);
      if (!pair) continue;
      const auto pixel = [&](std::int64_t o) {
        const auto at = static_cast<std::size_t>(o);
        return Eigen::Vector2d(from_fixed_pixel(tracks.x[at]), from_fixed_pixel(tracks.y[at]));
      };
      const auto sample =
          match_sample(*pair, block.cameras[block.camera_of(a)], pixel(i), block.cameras[block.camera_of(b)], pixel(j));
      if (sample) chosen = LabelledMatch{*sample, *label};
    }
    if (chosen) matches.push_back(*chosen);
  }
  return matches;
}

TrainedFilter train_filter(const std::vector<LabelledMatch>& matches, const TrainingOptions& options) {
  std::vector<const LabelledMatch*> of_kind[2];
  for (const LabelledMatch& match : matches) of_kind[match.right].push_back(&match);
  // Training and testing use right and wrong matches in equal number. With their natural shares, a machine that accepts
  // everything would look good.
  const auto half = static_cast<std::size_t>(options.samples) / 2;
  for (const auto& kind : of_kind)
    if (half < kFolds || kind.size() <= half)
      throw InputError("match filter: " + std::to_string(of_kind[1].size()) + " right and " +
                       std::to_string(of_kind[0].size()) + " wrong matches are too few to train on " +
                       std::to_string(half) + " of each and to test on others; take a larger block or fewer samples");
  std::mt19937_64 generator(options.seed);
  for (auto& kind : of_kind) shuffle(kind, generator);
  std::vector<const LabelledMatch*> training;
  for (std::size_t i = 0; i < half; ++i)
    for (const auto& kind : of_kind) training.push_back(kind[i]);
  const Scaling scaling = scaling_of(training, options.features);
  const auto machine = best_machine(matrix_of(training, options.features, scaling));

  TrainedFilter result;
  // The test uses matches that were not trained on.
  constexpr std::size_t kMostTested = 5000;  // of each kind
  const std::size_t tested = std::min({of_kind[0].size() - half, of_kind[1].size() - half, kMostTested});
  for (const std::size_t kind : {0, 1}) {
    const auto first = of_kind[kind].begin() + static_cast<std::ptrdiff_t>(half);
    const std::vector<const LabelledMatch*> others(first, first + static_cast<std::ptrdiff_t>(tested));
    result.correct_of[kind] =
        count_right(*machine, matrix_of(others, options.features, scaling)) / static_cast<double>(tested);
  }
  result.correct = 0.5 * (result.correct_of[0] + result.correct_of[1]);
  result.tested = static_cast<std::int64_t>(2 * tested);
  result.yaml = to_yaml(options.features, scaling, *machine);
  return result;
}

}  // namespace megablock
