#include "match/verification/trusted_pair.h"

#include <cmath>
#include <numbers>

#include "io/text/plausible.h"

namespace megablock {

namespace {

constexpr int kLongestChain = 12;  // number of relative poses that are concatenated at most

double squared(double x) { return x * x; }

// Pose of `to` in the axes of `from`; both are given in the same frame.
Pose relative(const Pose& from, const Pose& to) {
  return {(to.rotation * from.rotation.conjugate()).normalized(), from.rotation * (to.centre - from.centre)};
}

// The pose `inner`, given in the axes of `outer`, in the frame that `outer` is given in.
Pose composed(const Pose& outer, const Pose& inner) {
  return {(inner.rotation * outer.rotation).normalized(), outer.centre + outer.rotation.conjugate() * inner.centre};
}

}  // namespace

void TrustOptions::check() const {
  require_within(max_seconds, {0, 1e9}, "trajectory_seconds");
  require_within(position_sigma_m, kSigmaMetres, "trajectory_position_sigma_m");
  require_within(rotation_sigma_deg, kSigmaDegrees, "trajectory_rotation_sigma_deg");
}

double TrustedPair::epipolar_sigma_px(double focal_px, double distance_m, double pixel_sigma) const {
  return std::sqrt(squared(pixel_sigma) + squared(focal_px * rotation_sigma_rad) +
                   squared(focal_px * position_sigma_m / std::max(1.0, std::abs(distance_m))));
  // The variance of the epipolar line: that of the observation, of the rotation, and of the base seen from the
  // distance.
}

TrustedPairs::TrustedPairs(const Block& block, const TrustOptions& options) : block_(block), options_(options) {
  options_.check();
  steps_.resize(block.frames.size());
  for (const RelativePose& r : block.relative_poses)
    if (r.from < r.to) steps_[r.from] = {r.pose, r.to, r.rotation_sigma_rad, r.position_sigma_m};
}

std::optional<TrustedPairs::Relative> TrustedPairs::along_chain(FrameIndex from, FrameIndex to) const {
  // Concatenates the observed relative poses of successive frames; their variances add up.
  Relative sum;
  FrameIndex at = from;
  double rotation = 0, position = 0;
  for (int length = 0; length < kLongestChain && at < to; ++length) {
    const Step& step = steps_[at];
    if (!step.next.valid()) return std::nullopt;
    sum.pose = composed(sum.pose, step.pose);
    rotation += squared(step.rotation_sigma_rad);
    position += squared(step.position_sigma_m);
    at = step.next;
  }
  if (at != to) return std::nullopt;
  sum.rotation_sigma_rad = std::sqrt(rotation);
  sum.position_sigma_m = std::sqrt(position);
  return sum;
}

std::optional<TrustedPairs::Relative> TrustedPairs::between(FrameIndex from, FrameIndex to) const {
  const Frame &a = block_.frames[from], &b = block_.frames[to];
  if (a.rig != b.rig || a.pass != b.pass) return std::nullopt;
  if (!(std::abs(a.time_s - b.time_s) <= options_.max_seconds)) return std::nullopt;  // unknown times are not trusted
  if (const auto chain = along_chain(from, to)) return chain;
  if (!a.given_pose || !b.given_pose) return std::nullopt;
  return Relative{relative(*a.given_pose, *b.given_pose), options_.rotation_sigma_deg * std::numbers::pi / 180,
                  options_.position_sigma_m};
}

std::optional<TrustedPair> TrustedPairs::relate(ImageIndex a, ImageIndex b) const {
  if (!options_.use_trajectory) return std::nullopt;
  const Image &image_a = block_.images[a], &image_b = block_.images[b];
  // Only rigs of several cameras are trusted.
  if (block_.rig_of(image_a.frame).cameras().size() < 2) return std::nullopt;
  std::optional<Relative> frames = Relative{};
  if (image_b.frame < image_a.frame) {
    auto turned = relate(b, a);
    if (turned) std::swap(turned->a, turned->b);
    return turned;
  }
  if (image_a.frame != image_b.frame) frames = between(image_a.frame, image_b.frame);
  if (!frames) return std::nullopt;
  const Mount &mount_a = block_.mount_of(a), &mount_b = block_.mount_of(b);
  double rotation = squared(frames->rotation_sigma_rad), position = squared(frames->position_sigma_m);
  if (image_a.mount != image_b.mount)  // errors of one and the same mount are in both images alike
    for (const Mount* mount : {&mount_a, &mount_b}) {
      rotation += squared(mount->rotation_sigma_rad);
      position += squared(mount->position_sigma_m);
    }
  return TrustedPair{mount_a.pose, camera_pose(frames->pose, mount_b.pose), std::sqrt(rotation), std::sqrt(position)};
}

}  // namespace megablock
