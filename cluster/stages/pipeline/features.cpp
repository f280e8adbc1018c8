#include "cluster/stages/pipeline/features.h"

#include <fmt/core.h>
#include <omp.h>

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "cluster/job/messages.h"
#include "cluster/job/work_queue.h"
#include "cluster/mpi/collective.h"
#include "cluster/process/save_times.h"
#include "cluster/stages/common/units.h"
#include "io/base/error.h"
#include "io/base/hash.h"
#include "io/images/image_codec.h"
#include "io/store/units/features_file.h"
#include "io/text/counted.h"
#include "match/features/features.h"

namespace megablock {

namespace {

std::uint64_t mask_hash(const std::string& path) { return path.empty() ? 0 : hash_file(path); }

struct Shard {
  std::string name;
  std::int64_t first = 0;                         // first image
  std::vector<std::uint64_t> image_fingerprints;  // of its images
};

std::uint64_t shard_fingerprint(const std::vector<std::uint64_t>& image_fingerprints) {
  Hasher hasher;
  for (const std::uint64_t fingerprint : image_fingerprints) hasher.add(fingerprint);
  return hasher.value();
}

std::vector<std::uint64_t> image_fingerprints(const Job& job, int algorithm) {
  IndexedVector<CameraIndex, std::uint64_t> masks;
  for (const Camera& camera : job.block.cameras) masks.push_back(mask_hash(camera.mask_path));
  std::vector<std::uint64_t> fingerprints;
  for (std::size_t i = 0; i < job.block.images.size(); ++i) {
    const ImageIndex image(static_cast<std::int64_t>(i));
    Hasher hasher;
    hasher.add(algorithm);
    add_to_hash(hasher, job.settings.features);
    hasher.add(job.block.images[image].file_hash).add(masks[job.block.camera_of(image)]);
    fingerprints.push_back(hasher.value());
  }
  return fingerprints;
}

// A shard to which images were added keeps the features of its first images, those from which the existing file was
// made.
std::vector<ImageFeatures> features_to_keep(const Job& job, const std::string& name,
                                            const std::vector<std::uint64_t>& fingerprints) {
  for (std::size_t count = fingerprints.size() - 1; count > 0; --count) {
    const std::uint64_t fingerprint = shard_fingerprint({fingerprints.begin(), fingerprints.begin() + count});
    if (job.store.up_to_date(name, fingerprint))
      return is_current(job, kFeatureStage, name, fingerprint) ? read_features(job.store.path(name))
                                                               : std::vector<ImageFeatures>();
  }
  return {};
}

// Collects the features of a shard while they are computed. From time to time the first images are saved as if the
// shard ended there, so that an interruption loses seconds and not the whole unit: existing features are kept
// (features_to_keep).
class GrowingShard {
 public:
  GrowingShard(const Job& job, const Shard& shard)
      : store_(job.store), shard_(shard), images_(features_to_keep(job, shard.name, shard.image_fingerprints)) {
    saved_ = images_.size();
    done_.assign(shard.image_fingerprints.size(), 0);
    std::fill_n(done_.begin(), saved_, 1);
    images_.resize(done_.size());
  }
  std::int64_t kept() const { return static_cast<std::int64_t>(saved_); }
  const std::vector<ImageFeatures>& images() const { return images_; }

  // Only one thread at a time may call it; others may work on later images.
  void add(std::int64_t image, ImageFeatures features) {
    images_[static_cast<std::size_t>(image)] = std::move(features);
    done_[static_cast<std::size_t>(image)] = 1;
  }
  // The same, on the main thread, which alone may use HDF5.
  void save_now_and_then() {
    const auto end = static_cast<std::size_t>(std::find(done_.begin(), done_.end(), 0) - done_.begin());
    if (end == saved_ || end == done_.size() || !times_.due()) return;
    times_.run([&] { save(end); });
  }

 private:
  void save(std::size_t count) {
    const auto end = images_.begin() + static_cast<std::ptrdiff_t>(count);
    std::vector<ImageFeatures> first(std::make_move_iterator(images_.begin()), std::make_move_iterator(end));
    const auto& fingerprints = shard_.image_fingerprints;
    const auto fingerprint =
        shard_fingerprint({fingerprints.begin(), fingerprints.begin() + static_cast<std::ptrdiff_t>(count)});
    try {
      store_.write(shard_.name, fingerprint, [&](const std::string& path) { write_features(path, first); });
      saved_ = count;
    } catch (const std::exception&) {
      // The unit itself will be written to the same disk, and that error says what is wrong.
    }
    std::move(first.begin(), first.end(), images_.begin());
  }

  const JobStore& store_;
  const Shard& shard_;
  std::vector<ImageFeatures> images_;
  std::vector<std::uint8_t> done_;
  std::size_t saved_ = 0;
  SaveTimes times_;
};

void write_shard(const Job& job, JobRecord& record, const Shard& shard, const std::string& path) {
  GrowingShard growing(job, shard);
  const std::int64_t kept = growing.kept();
  part_done(job, record, kept);
  const auto count = static_cast<std::int64_t>(shard.image_fingerprints.size());
  load_image_codecs();
#pragma omp parallel for schedule(dynamic, 1) num_threads(job.options.threads)
  for (std::int64_t i = kept; i < count; ++i) {
    const ImageIndex image(shard.first + i);
    const std::string& mask = job.block.cameras[job.block.camera_of(image)].mask_path;
    ImageFeatures features = detect_features(job.block.path_of(image), mask, image, job.settings.features);
#pragma omp critical(features_of_a_shard)
    {
      growing.add(i, std::move(features));
      if (omp_get_thread_num() == 0) growing.save_now_and_then();
      part_done(job, record);
    }
  }
  write_features(path, growing.images());
}

// Fewer keypoints than these hardly join an image to others.
constexpr std::size_t kFewKeypoints = 50;

// Images that were read, but have hardly any keypoint.
class PoorImages {
 public:
  void add(const std::string& name, const ImageFeatures& image) {
    constexpr int kNamed = 5;
    if (image.keypoints.size() >= kFewKeypoints) return;
    if (++count_ <= kNamed)
      named_ += fmt::format("{}{} ({}, grey values {:.6g} to {:.6g})", count_ > 1 ? ", " : "", name,
                            image.keypoints.size(), image.grey_range[0], image.grey_range[1]);
    else
      ++more_;
  }
  // "2 of 18 images have fewer than 50 keypoints: a.tif (3, grey values 12 to 14), ..."; empty if there are none.
  std::string text(std::size_t images) const {
    if (count_ == 0) return "";
    return fmt::format("{} of {} {} fewer than {} keypoints: {}{}; check exposure, focus and masks", count_,
                       counted(static_cast<std::int64_t>(images), "image"), count_ == 1 ? "has" : "have", kFewKeypoints,
                       named_, more_ > 0 ? fmt::format(" and {} more", more_) : "");
  }

 private:
  std::string named_;
  std::int64_t count_ = 0, more_ = 0;
};

// Records images without features as failures of the run, with their reasons, and names those with hardly any.
void list_unreadable(const Stage& stage, const Job& job, JobRecord& record, const FeatureStage& outcome) {
  const int most = job.settings.features.max_features;
  const bool few_are_asked = most > 0 && static_cast<std::size_t>(most) < kFewKeypoints;
  const std::string text = on_first_rank(job.ranks, [&] {
    nlohmann::json failed = nlohmann::json::array();
    PoorImages poor;
    for (const std::string& shard : outcome.shards)
      for (const ImageFeatures& image : read_keypoints(job.store.verified_path(shard))) {
        const std::string name = job.block.name_of(image.image);
        if (!image.failure.empty())
          failed.push_back({name, image.failure});
        else if (!few_are_asked)
          poor.add(name, image);
      }
    return nlohmann::json{{"failed", failed}, {"poor", poor.text(job.block.images.size())}}.dump(
        -1, ' ', false, nlohmann::json::error_handler_t::replace);
  });
  const nlohmann::json found = nlohmann::json::parse(text);
  std::vector<FailedUnit> failures;
  for (const auto& entry : found["failed"]) failures.push_back({stage.name, entry[0], entry[1]});
  add_failures(job, record, failures);
  if (const std::string poor = found["poor"]; !poor.empty()) add_note(job, record, stage.name, poor);
}

}  // namespace

FeatureStage run_features(const Stage& stage, const Job& job, JobRecord& record) {
  FeatureStage made;
  made.image_fingerprint = image_fingerprints(job, stage.algorithm);
  const auto images = static_cast<std::int64_t>(job.block.images.size());
  std::vector<Unit> units;
  for (std::int64_t first = 0; first < images; first += kShardImages) {
    const std::int64_t end = std::min(images, first + kShardImages);
    const Shard shard{unit_name(stage.folder(), first / kShardImages),
                      first,
                      {made.image_fingerprint.begin() + first, made.image_fingerprint.begin() + end}};
    Unit unit;
    unit.name = shard.name;
    unit.fingerprint = shard_fingerprint(shard.image_fingerprints);
    unit.parts = end - first;
    unit.cost = static_cast<double>(unit.parts);
    unit.write = [&job, &record, shard](const std::string& path) { write_shard(job, record, shard, path); };
    made.shards.push_back(unit.name);
    units.push_back(std::move(unit));
  }
  const StageOutcome outcome = run_stage(job, record, stage, units);
  if (!outcome.failures.empty())
    throw AgreedError<ComputeError>(std::string(stage.name) + ": " + outcome.failures.front().reason);
  list_unreadable(stage, job, record, made);
  return made;
}

std::string feature_unit(std::int64_t shard) { return unit_name(find_stage(kFeatureStage)->folder(), shard); }

const FeatureCache::Shard& FeatureCache::shard(std::int64_t number) {
  auto found = std::find_if(shards_.begin(), shards_.end(), [&](const Shard& s) { return s.number == number; });
  if (found == shards_.end()) {
    if (shards_.size() >= capacity_) shards_.erase(shards_.begin());
    shards_.push_back({number, read_features(store_.verified_path(feature_unit(number)))});
    return shards_.back();
  }
  std::rotate(found, found + 1, shards_.end());
  return shards_.back();
}

const ImageFeatures& FeatureCache::features(ImageIndex image) {
  return shard(image.value / kShardImages).images[static_cast<std::size_t>(image.value % kShardImages)];
}

void FeatureCache::load(const std::vector<ImageIndex>& images) {
  std::vector<std::int64_t> numbers;
  for (const ImageIndex image : images) numbers.push_back(image.value / kShardImages);
  std::sort(numbers.begin(), numbers.end());
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
  capacity_ = std::max(capacity_, numbers.size());
  for (const std::int64_t number : numbers) shard(number);
}

}  // namespace megablock
