#include "cluster/stages/pipeline/focal_lengths.h"

// A unit is a camera. Its file has one line with the members of Finding.

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <span>

#include "cluster/job/messages.h"
#include "cluster/job/work_queue.h"
#include "cluster/mpi/collective.h"
#include "io/base/error.h"
#include "io/base/hash.h"
#include "io/block/tracks.h"
#include "io/project/inputs/camera_priors.h"
#include "match/pairs/pair_matching.h"
#include "match/verification/focal_length.h"

namespace megablock {

namespace {

constexpr std::size_t kMostMatched = 120;  // pairs that are matched at most
// Pairs that are enough where fewer than so many of them contradict a focal length that is known.
constexpr int kSample = 16;
constexpr double kAgreement = 0.5;
constexpr std::size_t kFewestPairs = 20;  // pairs for which the first generations of a block are enough
constexpr std::int64_t kImages = 200;     // of a camera, the first ones
constexpr std::size_t kFeatures = 3000;   // of an image, the coarsest
// A focal length that is known is wrong where so many pairs contradict it, of all and at least, and where the better
// one differs by so much (in log f): errors of the lens move it by some per cent.
constexpr double kShareAgainst = 0.15, kFewestAgainst = 4, kContradiction = 0.2;
// It is also wrong where fewer pairs contradict it, but all together give another one, so many sigmas away.
constexpr double kDoubts = 2, kSigmas = 3;
// Where the pairs do not determine the focal length, one that is known must lie so many times outside of what they
// allow: look-alike facades deceive some pairs by less.
constexpr double kFarOutside = 2;
constexpr double kMostSigma = 0.1;  // relative sigma of a focal length that the images determine
constexpr double kKnown = 0.05;     // the same of one that counts as known
constexpr double kInset = 0.2;      // distance in log f that the usual focal length keeps from contradiction

// Whether the stage estimates the focal length of a camera: one that leaves its parameters to the block, and whose lens
// draws straight lines as far as is known.
bool asks(const Camera& camera) {
  const Intrinsics& k = camera.intrinsics;
  const auto straight = [&] {
    const Intrinsics plain = start_intrinsics(k.model(), k[kFocal], camera.width, camera.height);
    return std::equal(plain.begin() + kPrincipalY + 1, plain.end(), k.begin() + kPrincipalY + 1);
  };
  return camera.choose && camera.prior_sigma[kFocal] > 0 && !sees_sideways(k.model()) && straight();
}

std::uint64_t hash_of(const ImagePair& pair) { return Hasher().add(pair.a.value).add(pair.b.value).value(); }

// The pairs of one camera in the order in which they are asked: neighbours by name and pairs drawn from all of them in
// turn, because neighbours overlap more often and others have longer bases.
std::vector<ImagePair> in_order(const std::vector<ImagePair>& pairs) {
  std::vector<ImagePair> drawn = pairs, near = pairs;
  const auto by_hash = [](const ImagePair& p, const ImagePair& q) {
    return std::pair(hash_of(p), p) < std::pair(hash_of(q), q);
  };
  std::sort(drawn.begin(), drawn.end(), by_hash);
  std::sort(near.begin(), near.end(), [&](const ImagePair& p, const ImagePair& q) {
    const std::int64_t of_p = p.b.value - p.a.value, of_q = q.b.value - q.a.value;
    return of_p != of_q ? of_p < of_q : by_hash(p, q);
  });
  std::vector<ImagePair> order;
  std::set<ImagePair> taken;
  for (std::size_t i = 0; i < pairs.size() && order.size() < kMostMatched; ++i)
    for (const ImagePair& pair : {near[i], drawn[i]})
      if (taken.insert(pair).second) order.push_back(pair);
  order.resize(std::min(order.size(), kMostMatched));
  return order;
}

using PairsByCamera = std::map<CameraIndex, std::vector<ImagePair>>;

// The pairs of each camera come from its first images, and from the first generation of the block that has enough of
// them: images that are added later must not change the focal length, which would change everything that follows.
PairsByCamera pairs_to_ask(const Job& job, const CandidateGraph& graph) {
  const Block& block = job.block;
  PairsByCamera all;
  std::map<CameraIndex, std::int64_t> images;
  std::map<CameraIndex, ImageIndex> last;  // of the first kImages images
  for (CameraIndex c(0); block.cameras.contains(c); ++c.value)
    if (asks(block.cameras[c])) all[c];
  if (all.empty()) return all;
  for (ImageIndex i(0); block.images.contains(i); ++i.value)
    if (const CameraIndex c = block.camera_of(i); all.contains(c) && images[c]++ < kImages) last[c] = i;
  ImageIndex furthest(-1);
  for (const auto& [camera, image] : last) furthest = std::max(furthest, image);
  for (const ImagePair& pair : graph.pairs) {
    if (pair.a > furthest) break;  // the pairs are ascending
    const CameraIndex c = block.camera_of(pair.a);
    if (all.contains(c) && block.camera_of(pair.b) == c && pair.b <= last[c]) all[c].push_back(pair);
  }
  for (auto& [camera, pairs] : all) {
    for (const std::int64_t size : job.generations) {
      const auto later = [&](const ImagePair& pair) { return pair.b.value >= size; };
      if (pairs.size() - static_cast<std::size_t>(std::ranges::count_if(pairs, later)) < kFewestPairs) continue;
      std::erase_if(pairs, later);
      break;
    }
    pairs = in_order(pairs);
  }
  return all;
}

// The coarsest features of images, which stand first in their lists.
std::map<ImageIndex, ImageFeatures> coarsest_features(const Job& job, const std::set<ImageIndex>& images) {
  FeatureCache cache(job.store, 1);
  std::map<ImageIndex, ImageFeatures> coarsest;
  for (const ImageIndex image : images) {
    const ImageFeatures& all = cache.features(image);
    const auto count = static_cast<std::ptrdiff_t>(std::min(kFeatures, all.descriptors.size()));
    ImageFeatures& own = coarsest[image];
    own.keypoints.assign(all.keypoints.begin(), all.keypoints.begin() + count);
    own.descriptors.assign(all.descriptors.begin(), all.descriptors.begin() + count);
  }
  return coarsest;
}

// Matches of the coarsest features, in pixels from the principal point.
PointPairs matched_pixels(const ImageFeatures& a, const ImageFeatures& b, const Camera& camera,
                          const MatchOptions& options) {
  const Eigen::Vector2d principal(camera.intrinsics[kPrincipalX], camera.intrinsics[kPrincipalY]);
  const auto pixel = [&](const ImageFeatures& image, std::int32_t row) -> Eigen::Vector2d {
    const Keypoint& k = image.keypoints[static_cast<std::size_t>(row)];
    return Eigen::Vector2d(from_fixed_pixel(k.x), from_fixed_pixel(k.y)) - principal;
  };
  PointPairs pixels;
  for (const auto& [row_a, row_b] : match_descriptors(a.descriptors, b.descriptors, options)) {
    pixels.a.push_back(pixel(a, row_a));
    pixels.b.push_back(pixel(b, row_b));
  }
  return pixels;
}

std::vector<MatchedImages> match_coarsest(const Job& job, const Camera& camera, std::span<const ImagePair> pairs) {
  std::set<ImageIndex> images;
  for (const ImagePair& pair : pairs) images.insert({pair.a, pair.b});
  const auto features = coarsest_features(job, images);
  std::vector<MatchedImages> matched(pairs.size());
#pragma omp parallel for schedule(dynamic, 1) num_threads(job.options.threads)
  for (std::size_t i = 0; i < pairs.size(); ++i)
    matched[i] = {matched_pixels(features.at(pairs[i].a), features.at(pairs[i].b), camera, job.settings.matching),
                  hash_of(pairs[i])};
  return matched;
}

// What the stage says of a camera.
struct Finding {
  double focal_px = 0;  // with which the block starts; 0: the camera keeps its own
  double sigma = 0;     // relative; 0: the pairs only limit the focal length
  double against = 0;   // number of pairs that contradict the focal length of the camera
  int asked = 0;
  // Of the block that was oriented with the focal length above, pixels and relative; 0: it agrees.
  double block_focal_px = 0, block_sigma = 0;
};

// A point of the interval near the usual focal length, but away from the ends, where pairs begin to contradict.
double usual_within(const FocalLength& found, const Camera& camera) {
  const double inset = std::min(kInset, 0.5 * std::log(found.to_px / found.from_px));
  return std::clamp(usual_focal_px(camera.width, camera.height), found.from_px * std::exp(inset),
                    found.to_px * std::exp(-inset));
}

Finding judge(const FocalLength& found, const Camera& camera) {
  const double before = camera.intrinsics[kFocal];
  Finding finding{.against = found.against(before), .asked = found.asked};
  const bool determined = !found.open && found.sigma() <= kMostSigma;
  const double change = std::abs(std::log(found.focal_px / before));
  // How many times the focal length lies outside the interval.
  const double outside = std::max(before / found.to_px, found.from_px / before);
  const bool many = finding.against >= std::max(kFewestAgainst, kShareAgainst * found.asked),
             clearly = finding.against >= kDoubts && change >= kSigmas * found.sigma();
  const bool wrong = determined ? many || clearly : many && outside >= kFarOutside;
  if (wrong || (determined && !camera.focal_known)) {
    const double better = determined ? found.focal_px : usual_within(found, camera);
    if (camera.focal_known && std::abs(std::log(better / before)) < kContradiction) return finding;
    finding.focal_px = better;
    if (determined) finding.sigma = found.sigma();
  }
  return finding;
}

// Asks a sample of the pairs first where the focal length is known. In most blocks they agree with it. Where they do
// not, they are asked again with each distortion of the lens that they allow, until they agree.
std::optional<FocalLength> estimate(const Job& job, const Camera& camera, const std::vector<ImagePair>& pairs) {
  FocalLengthOptions options;
  options.max_residual_px = job.settings.matching.max_residual_px;
  options.threads = job.options.threads;
  std::vector<MatchedImages> matched;  // the first pairs, which are asked again where the sample does not agree
  const auto batch = [&](std::size_t first, std::size_t end) {
    if (end > matched.size()) {
      const auto next = std::span(pairs).subspan(matched.size(), end - matched.size());
      std::ranges::move(match_coarsest(job, camera, next), std::back_inserter(matched));
    }
    return std::vector(matched.begin() + static_cast<std::ptrdiff_t>(first),
                       matched.begin() + static_cast<std::ptrdiff_t>(end));
  };
  const auto ask = [&] { return focal_length_of(pairs.size(), batch, camera.width, camera.height, options); };
  const auto contradicted = [&](const FocalLength& found) { return judge(found, camera).focal_px > 0; };
  if (camera.focal_known) {
    options.max_pairs = kSample;
    auto found = ask();
    if (!found || (found->asked == kSample && found->against(camera.intrinsics[kFocal]) < kAgreement)) return found;
    options.max_pairs = FocalLengthOptions().max_pairs;
  }
  const auto all = ask();
  if (!camera.focal_known || !all || !contradicted(*all)) return all;
  for (const double q : likely_distortions(pairs.size(), batch, camera.width, camera.height, options, *all)) {
    options.distortion = q;
    if (auto other = ask(); other && !contradicted(*other)) return other;
  }
  return all;
}

void write_finding(const std::string& path, const Finding& finding) {
  std::ofstream out(path);
  out << fmt::format("{} {} {} {} {} {}\n", finding.focal_px, finding.sigma, finding.against, finding.asked,
                     finding.block_focal_px, finding.block_sigma);
  if (!out.flush()) throw InputError(path + ": cannot be written; check the disk");
}

Finding read_finding(const std::string& path) {
  std::ifstream in(path);
  Finding finding;
  if (!(in >> finding.focal_px >> finding.sigma >> finding.against >> finding.asked >> finding.block_focal_px >>
        finding.block_sigma))
    throw StoreError(path + ": is not an estimate of a focal length; delete it and run the job again");
  return finding;
}

// "640 px (29 mm of the 35 mm format) +- 1.2 % by 40 pairs of images".
std::string source_of(const Finding& finding, const Camera& camera) {
  if (finding.block_focal_px > 0)
    return fmt::format("{} +- {:.2g} % by a first orientation of the block",
                       focal_length_text(camera, finding.block_focal_px), 100 * finding.block_sigma);
  if (finding.sigma > 0)
    return fmt::format("{} +- {:.1f} % by {} pairs of images", focal_length_text(camera, finding.focal_px),
                       100 * finding.sigma, finding.asked);
  return fmt::format("about {}, which few pairs of images contradict", focal_length_text(camera, finding.focal_px));
}

std::string note_of(const Finding& finding, const Camera& camera) {
  const std::string found = source_of(finding, camera);
  if (!camera.focal_known)
    return fmt::format("camera '{}': the headers tell no focal length; the block starts with {}", camera.name, found);
  const std::string against = finding.block_focal_px > 0 ? "the block that was oriented with it contradicts it"
                                                         : fmt::format("{:.0f} of {} pairs of images contradict it",
                                                                       finding.against, finding.asked);
  return fmt::format(
      "camera '{}': the focal length of {} cannot be right: {}; the block starts with {}; check the header, and a lens "
      "or a crop of which it does not know; 'calibrate: true' keeps it",
      camera.name, focal_length_text(camera, camera.intrinsics[kFocal]), against, found);
}

// Takes what was found. Returns what to note; empty: nothing.
std::string take(const Finding& finding, Camera& camera) {
  const bool by_block = finding.block_focal_px > 0;
  const double focal = by_block ? finding.block_focal_px : finding.focal_px;
  const double sigma = by_block ? finding.block_sigma : finding.sigma;
  if (!(focal > 0)) return "";
  std::string note = note_of(finding, camera);
  camera.intrinsics[kFocal] = focal;
  camera.focal_known = sigma > 0 && sigma <= kKnown;
  ParameterMask estimated = 0;
  for (int p = 0; p < camera.intrinsics.size(); ++p)
    if (camera.prior_sigma[static_cast<std::size_t>(p)] > 0) estimated |= mask_of(p);
  camera.prior_sigma = default_intrinsic_sigmas(camera, estimated);
  return note;
}

std::string unit_of(const Stage& stage, CameraIndex camera) {
  return fmt::format("{}/{:06}.txt", stage.folder(), camera.value);
}

}  // namespace

std::string focal_length_text(const Camera& camera, double focal_px) {
  return fmt::format("{:.0f} px ({:.0f} mm of the 35 mm format)", focal_px,
                     36 * focal_px / std::max(camera.width, camera.height));
}

void run_focal_lengths(const Stage& stage, const Job& job, JobRecord& record, const FeatureStage& features,
                       const CandidateGraph& graph, Block& block) {
  const PairsByCamera asked = pairs_to_ask(job, graph);
  std::vector<Unit> units;
  std::vector<CameraIndex> cameras;
  for (const auto& [c, pairs] : asked) {
    const Camera& camera = block.cameras[c];
    Hasher hasher;
    hasher.add(stage.algorithm).add(camera.width).add(camera.height);
    hasher.add(camera.focal_known)
        .add(camera.intrinsics[kFocal])
        .add(camera.intrinsics[kPrincipalX])
        .add(camera.intrinsics[kPrincipalY]);
    const MatchOptions& matching = job.settings.matching;
    hasher.add(matching.k_best).add(matching.ratio).add(matching.max_residual_px);
    for (const ImagePair& pair : pairs)
      for (const ImageIndex image : {pair.a, pair.b})
        hasher.add(image.value).add(features.image_fingerprint[static_cast<std::size_t>(image.value)]);
    Unit unit;
    unit.name = unit_of(stage, c);
    unit.fingerprint = hasher.value();
    unit.write = [&job, &camera, &pairs](const std::string& path) {
      const auto found = estimate(job, camera, pairs);
      write_finding(path, found ? judge(*found, camera) : Finding());
    };
    units.push_back(std::move(unit));
    cameras.push_back(c);
  }
  if (units.empty()) {
    if (job.is_first_rank()) remove_record(job.store, stage.name);  // an earlier run may have needed the stage
    return;
  }
  run_stage(job, record, stage, units);
  for (std::size_t i = 0; i < units.size(); ++i) {
    if (!job.store.up_to_date(units[i].name, units[i].fingerprint)) continue;  // failed, and recorded so
    const std::string note = take(read_finding(job.store.verified_path(units[i].name)), block.cameras[cameras[i]]);
    if (!note.empty()) add_note(job, record, stage.name, note);
  }
}

bool keep_focal_length(const Stage& stage, const Job& job, CameraIndex camera, double focal_px, double sigma_px) {
  const std::string unit = unit_of(stage, camera);
  const std::string kept = on_first_rank(job.ranks, [&]() -> std::string {
    const std::optional<UnitSeal> seal = job.store.seal(unit);
    if (!seal || !asks(job.block.cameras[camera])) return "";
    Finding finding = read_finding(job.store.verified_path(unit));
    if (finding.block_focal_px > 0) return "";
    finding.block_focal_px = focal_px;
    finding.block_sigma = sigma_px / focal_px;
    job.store.write(unit, seal->fingerprint, [&](const std::string& path) { write_finding(path, finding); });
    return "kept";
  });
  return !kept.empty();
}

}  // namespace megablock
