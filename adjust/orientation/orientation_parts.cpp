// Cuts a long block into parts. With d(f) the distance in links of frame f from a frame at the rim, the half of the
// frames with the smallest d is one part and the rest the other. The rim is the frame farthest from an arbitrary one,
// so that for a long block the cut goes across it. Both halves are cut again until they have at most `part_frames`
// frames. Every part then takes in the frames that are linked to its core; neighbouring parts share these, and the
// similarity between two parts follows from the poses that both have of them.
//
// The parts are independent models: each has a position, an attitude and a scale of its own. adjust/independent_models
// finds them. A frame keeps the pose of the part whose core holds it, because it lies at the rim of all other parts,
// where poses are worst.
#include "adjust/orientation/orientation_parts.h"

#include <fmt/core.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <optional>
#include <set>

#include "adjust/independent_models/model_assembly.h"
#include "adjust/orientation/steps/ground_alignment.h"
#include "adjust/orientation/steps/orientation_graph.h"
#include "geometry/numbers/decompositions.h"
#include "geometry/transform/rotation_fit.h"
#include "io/base/error.h"

namespace megablock {

namespace {

using PartLinks = std::vector<std::vector<std::int32_t>>;  // [frames by name] ascending

// The frames of `set` in the order of their distance in links from `first`, then of their names. Frames that cannot be
// reached follow, sorted in the same way.
std::vector<std::int32_t> by_distance(const PartLinks& links, const std::vector<std::int32_t>& set,
                                      std::int32_t first) {
  std::set<std::int32_t> left(set.begin(), set.end());
  std::vector<std::int32_t> order, ring{first};
  left.erase(first);
  while (!ring.empty()) {
    std::sort(ring.begin(), ring.end());
    order.insert(order.end(), ring.begin(), ring.end());
    std::vector<std::int32_t> next;
    for (const std::int32_t f : ring)
      for (const std::int32_t g : links[row(f)])
        if (left.erase(g) > 0) next.push_back(g);
    // A set that falls into pieces is searched piece by piece, so that every frame has its place in the order.
    if (next.empty() && !left.empty()) {
      next.push_back(*left.begin());
      left.erase(left.begin());
    }
    ring = std::move(next);
  }
  return order;
}

// Halves `set` until its pieces have at most `most` frames, and appends them to `cores`.
void cut(const PartLinks& links, const std::vector<std::int32_t>& set, std::size_t most,
         std::vector<std::vector<std::int32_t>>& cores) {
  if (set.size() <= most) {
    cores.push_back(set);
    return;
  }
  const std::int32_t rim = by_distance(links, set, *std::min_element(set.begin(), set.end())).back();
  const std::vector<std::int32_t> order = by_distance(links, set, rim);
  const auto middle = order.begin() + static_cast<std::ptrdiff_t>(order.size() / 2);
  cut(links, {order.begin(), middle}, most, cores);
  cut(links, {middle, order.end()}, most, cores);
}

// The errors of a part's frames, in units of its mean baseline and in radians. Only their ratio matters, because the
// assembly scales them to the misfits that it finds.
constexpr double kCentreSigma = 1e-3, kRotationSigma = 2e-4;

}  // namespace

std::vector<OrientationPart> orientation_parts(const Block& block, const std::vector<FrameIndex>& frames,
                                               const std::vector<VerifiedPair>& pairs, int part_frames) {
  std::vector<FrameIndex> by_name = frames;
  // Names, unlike indices, do not depend on the order in which images were listed.
  std::sort(by_name.begin(), by_name.end(),
            [&](FrameIndex a, FrameIndex b) { return block.frames[a].name < block.frames[b].name; });
  std::map<FrameIndex, std::int32_t> number;
  for (std::size_t f = 0; f < by_name.size(); ++f) number[by_name[f]] = static_cast<std::int32_t>(f);
  // Only pairs with a relative orientation link frames: a part must hold together by what orientation uses.
  PartLinks links(by_name.size());
  for (const VerifiedPair& pair : pairs) {
    if (pair.model == PairModel::kNone) continue;
    const auto a = number.find(block.images[pair.a].frame), b = number.find(block.images[pair.b].frame);
    if (a == number.end() || b == number.end() || a == b) continue;
    links[row(a->second)].push_back(b->second);
    links[row(b->second)].push_back(a->second);
  }
  for (auto& list : links) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
  }
  std::vector<std::int32_t> all(by_name.size());
  for (std::size_t f = 0; f < all.size(); ++f) all[f] = static_cast<std::int32_t>(f);
  std::vector<std::vector<std::int32_t>> cores;
  cut(links, all, static_cast<std::size_t>(std::max(1, part_frames)), cores);
  std::vector<OrientationPart> parts;
  for (const auto& core : cores) {
    const std::set<std::int32_t> inside(core.begin(), core.end());
    std::set<std::int32_t> around;
    for (const std::int32_t f : core)
      for (const std::int32_t g : links[row(f)])
        if (!inside.contains(g)) around.insert(g);
    OrientationPart part;
    for (const std::int32_t f : core) part.frames.push_back(by_name[row(f)]);
    for (const std::int32_t f : around) part.frames.push_back(by_name[row(f)]);
    part.core = core.size();
    parts.push_back(std::move(part));
  }
  return parts;
}

namespace {

// The result of one part, in a coordinate frame of its own.
struct OrientedPart {
  OrientationPart part;
  std::vector<std::optional<Pose>> poses;  // [part.frames]
  IndexedVector<CameraIndex, Intrinsics> cameras;
  std::vector<std::pair<FrameIndex, std::string>> failed;
  std::vector<SetAsideVertical> verticals_aside;
  GroundAngles known = GroundAngles::kNone;  // angles of its coordinate frame that are known
};

void leave_out(const std::vector<SetAsideVertical>& aside, OrientationGraph& graph) {
  std::set<ImageIndex> images;
  for (const SetAsideVertical& vertical : aside) images.insert(vertical.image);
  for (auto& image : graph.images)
    if (images.contains(image.index)) image.vertical = nullptr;
}

class PartwiseOrientation {
 public:
  PartwiseOrientation(const Block& block, const BlockState& start, const std::vector<FrameIndex>& frames,
                      const std::vector<VerifiedPair>& pairs, const TrackSet& tracks, const OrientationOptions& options)
      : block_(block), start_(start), frames_(frames), pairs_(pairs), tracks_(tracks), options_(options) {
    options_.part_frames = 0;
  }

  OrientationResult run(int part_frames) {
    orient_parts(orientation_parts(block_, frames_, pairs_, part_frames));
    if (parts_.empty()) return whole();
    assemble();
    OrientationResult in_parts = result();
    // Parts that fail or do not fit together lose frames that one orientation of the whole would keep.
    if (10 * in_parts.failed.size() <= frames_.size()) return in_parts;
    try {
      OrientationResult at_once = whole();
      return at_once.failed.size() < in_parts.failed.size() ? std::move(at_once) : std::move(in_parts);
    } catch (const ComputeError&) {
      return in_parts;
    }
  }

 private:
  OrientationResult whole() const {
    OrientationResult found = orient_component(block_, start_, frames_, pairs_, tracks_, options_);
    found.summary += ", as a whole, because parts did not fit together";
    return found;
  }

  void orient_parts(const std::vector<OrientationPart>& parts) {
    const std::vector<std::vector<std::size_t>> rows = rows_of_parts(parts);
    for (std::size_t p = 0; p < parts.size(); ++p) orient_part(parts[p], rows[p]);
  }

  void orient_part(const OrientationPart& part, const std::vector<std::size_t>& rows) {
    std::vector<VerifiedPair> own;
    own.reserve(rows.size());
    for (const std::size_t r : rows) own.push_back(pairs_[r]);
    try {
      OrientationResult found = orient_component(block_, start_, part.frames, own, tracks_, options_);
      OrientedPart oriented{
          part, {}, std::move(found.state.cameras), std::move(found.failed), std::move(found.verticals_aside)};
      for (const FrameIndex frame : part.frames)
        oriented.poses.push_back(found.state.oriented[frame] ? std::optional(found.state.frames[frame]) : std::nullopt);
      // The graph without tracks is made again, because orient_component() does not hand its own out. It tells what the
      // part knows of the ground.
      OrientationGraph graph = make_orientation_graph(block_, start_, part.frames, own, TrackSet(), options_);
      leave_out(oriented.verticals_aside, graph);
      oriented.known = known_angles(graph);
      parts_.push_back(std::move(oriented));
    } catch (const ComputeError&) {  // the part is too weak; other parts may hold its frames
    }
  }

  // The pairs of each part, ascending, found in one pass over all pairs.
  std::vector<std::vector<std::size_t>> rows_of_parts(const std::vector<OrientationPart>& parts) const {
    std::map<FrameIndex, std::vector<std::size_t>> parts_of;  // ascending
    for (std::size_t p = 0; p < parts.size(); ++p)
      for (const FrameIndex frame : parts[p].frames) parts_of[frame].push_back(p);
    // A pair belongs to every part that holds both of its frames.
    std::vector<std::vector<std::size_t>> rows(parts.size());
    std::vector<std::size_t> both;
    for (std::size_t r = 0; r < pairs_.size(); ++r) {
      const auto a = parts_of.find(block_.images[pairs_[r].a].frame),
                 b = parts_of.find(block_.images[pairs_[r].b].frame);
      if (a == parts_of.end() || b == parts_of.end()) continue;
      both.clear();
      std::set_intersection(a->second.begin(), a->second.end(), b->second.begin(), b->second.end(),
                            std::back_inserter(both));
      for (const std::size_t p : both) rows[p].push_back(r);
    }
    return rows;
  }

  // Only images are shared: the parts have points of their own. Their sigmas are known up to a factor, which the links
  // take from their misfits.
  void assemble() {
    std::vector<Model> models;
    for (const OrientedPart& oriented : parts_) {
      Model model{static_cast<std::int64_t>(models.size()), {}, {}};
      for (std::size_t i = 0; i < oriented.poses.size(); ++i)
        if (oriented.poses[i])
          model.images.push_back({oriented.part.frames[i].value, *oriented.poses[i], kCentreSigma, kRotationSigma});
      models.push_back(std::move(model));
    }
    AssemblyOptions options;
    // The poses are only start values; nobody reads their covariances.
    options.covariances = false;
    options.links.scale_sigmas = true;
    assembled_ = assemble_models(models, options);
    std::map<std::int64_t, std::size_t> size;
    for (std::size_t p = 0; p < parts_.size(); ++p) size[assembled_.part[p]] += models[p].images.size();
    std::size_t largest = 0;
    for (const auto& [part, frames] : size)
      if (frames > largest) largest_ = part, largest = frames;
  }
  bool joined(std::size_t p) const { return assembled_.part[p] == largest_; }

  // A frame takes its pose from the part whose core holds it, else from the first part that has a pose of it.
  void collect(BlockState& state) const {
    for (const bool core : {true, false})
      for (std::size_t p = 0; p < parts_.size(); ++p) {
        if (!joined(p)) continue;
        const OrientationPart& part = parts_[p].part;
        for (std::size_t i = core ? 0 : part.core; i < (core ? part.core : part.frames.size()); ++i) {
          const FrameIndex frame = part.frames[i];
          if (state.oriented[frame] || !parts_[p].poses[i]) continue;
          state.frames[frame] = assembled_.similarity[p](*parts_[p].poses[i]);
          state.oriented[frame] = 1;
        }
      }
  }

  // The cameras are the mean over the parts that use them, weighted by the frames of their cores.
  void average_cameras(BlockState& state) const {
    for (CameraIndex c(0); state.cameras.contains(c); ++c.value) {
      double weights = 0;
      std::vector<double> sums(static_cast<std::size_t>(state.cameras[c].size()), 0);
      for (std::size_t p = 0; p < parts_.size(); ++p) {
        if (!joined(p) || !used_in(p, c)) continue;
        const auto weight = static_cast<double>(parts_[p].part.core);
        weights += weight;
        for (int k = 0; k < state.cameras[c].size(); ++k)
          sums[static_cast<std::size_t>(k)] += weight * parts_[p].cameras[c][k];
      }
      for (int k = 0; weights > 0 && k < state.cameras[c].size(); ++k)
        state.cameras[c][k] = sums[static_cast<std::size_t>(k)] / weights;
    }
  }
  bool used_in(std::size_t p, CameraIndex camera) const {
    const std::vector<FrameIndex>& frames = parts_[p].part.frames;
    return std::any_of(frames.begin(), frames.end(), [&](FrameIndex frame) {
      const Rig& rig = block_.rigs[block_.frames[frame].rig];
      return std::any_of(rig.mounts.begin(), rig.mounts.end(),
                         [&](const Mount& mount) { return mount.camera == camera; });
    });
  }

  OrientationResult result() const {
    OrientationResult result;
    result.state = start_;
    collect(result.state);
    average_cameras(result.state);
    to_free_frame(result.state);
    std::map<FrameIndex, std::string> reasons;
    for (const OrientedPart& part : parts_)
      for (const auto& [frame, reason] : part.failed) reasons[frame] = reason;
    std::size_t count = 0;
    for (const FrameIndex frame : frames_) {
      count += result.state.oriented[frame];
      if (result.state.oriented[frame]) continue;
      const auto reason = reasons.find(frame);
      result.failed.emplace_back(
          frame, reason == reasons.end() ? "no part that is joined to the largest holds it" : reason->second);
    }
    std::sort(result.failed.begin(), result.failed.end());
    result.verticals_aside = verticals_aside();
    const auto kept =
        std::count_if(assembled_.links.begin(), assembled_.links.end(), [](const auto& l) { return l.kept; });
    result.summary = fmt::format("{} of {} frames oriented in {} parts, {} of {} links between them kept, free block",
                                 count, frames_.size(), parts_.size(), kept, assembled_.links.size());
    if (!assembled_.lost.empty()) result.summary += fmt::format(", {} parts fit no other one", assembled_.lost.size());
    if (!assembled_.converged)
      result.summary += fmt::format(", joined in {} iterations without converging", assembled_.iterations);
    return result;
  }

  // A vertical counts as the part judged it whose core holds the image's frame.
  std::vector<SetAsideVertical> verticals_aside() const {
    std::map<ImageIndex, SetAsideVertical> aside;
    for (const OrientedPart& part : parts_) {
      const auto core = part.part.frames.begin();
      const std::set<FrameIndex> own(core, core + static_cast<std::ptrdiff_t>(part.part.core));
      for (const SetAsideVertical& vertical : part.verticals_aside)
        if (own.contains(block_.images[vertical.image].frame)) aside.emplace(vertical.image, vertical);
    }
    std::vector<SetAsideVertical> result;
    for (const auto& [image, vertical] : aside) result.push_back(vertical);
    return result;
  }

  // The vertical or the attitude as the mean over the parts that know it, weighted by the frames of their cores. The
  // assembled coordinate frame alone is that of the first part.
  struct Ground {
    GroundAngles known = GroundAngles::kNone;
    Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();  // to it
  };
  Ground ground() const {
    Ground ground;
    for (std::size_t p = 0; p < parts_.size(); ++p)
      if (joined(p)) ground.known = std::max(ground.known, parts_[p].known);
    Eigen::Vector3d up = Eigen::Vector3d::Zero();
    Eigen::Matrix4d squares = Eigen::Matrix4d::Zero();
    for (std::size_t p = 0; p < parts_.size(); ++p) {
      if (!joined(p) || parts_[p].known != ground.known) continue;
      const auto weight = static_cast<double>(parts_[p].part.core);
      const Eigen::Quaterniond& rotation = assembled_.similarity[p].rotation;
      up += weight * (rotation * Eigen::Vector3d::UnitZ());
      // The mean of rotations is the eigenvector of the largest eigenvalue of sum w q q', which does not depend on the
      // signs of the quaternions (F. Markley, Y. Cheng, J. Crassidis and Y. Oshman, "Averaging quaternions", JGCD 30,
      // 2007).
      squares += weight * rotation.coeffs() * rotation.coeffs().transpose();
    }
    if (ground.known == GroundAngles::kLevel) ground.turn = rotation_between(up, Eigen::Vector3d::UnitZ());
    if (ground.known == GroundAngles::kAll) {
      ground.turn.coeffs() = symmetric_eigen(squares).vectors.col(3);
      // The similarities turn the axes of a part, which are those of the ground, into the assembled frame. The way back
      // is the conjugate.
      ground.turn = ground.turn.conjugate();
    }
    return ground;
  }

  void to_free_frame(BlockState& state) const {
    const Ground ground = this->ground();
    const OrientationGraph graph = make_orientation_graph(block_, start_, frames_, pairs_, TrackSet(), options_);
    // First the known angles, then the rest of the free frame: similarity_to_free_frame() keeps the angles that are
    // known.
    const Similarity level{1, ground.turn, Eigen::Vector3d::Zero()};
    OrientationValues values;
    bool metric = false;
    for (const auto& node : graph.frames)
      values.frames.push_back(state.oriented[node.index] ? std::optional(level(state.frames[node.index]))
                                                         : std::nullopt);
    for (const auto& image : graph.images) metric |= image.mount.centre.norm() > 0;
    const Similarity similarity = similarity_to_free_frame(graph, values, ground.known, metric) * level;
    for (const FrameIndex frame : frames_)
      if (state.oriented[frame]) state.frames[frame] = similarity(state.frames[frame]);
  }

  const Block& block_;
  const BlockState& start_;
  const std::vector<FrameIndex>& frames_;
  const std::vector<VerifiedPair>& pairs_;
  const TrackSet& tracks_;
  OrientationOptions options_;       // of a part
  std::vector<OrientedPart> parts_;  // what could be oriented
  AssembledModels assembled_;
  std::int64_t largest_ = 0;
};

}  // namespace

OrientationResult orient_in_parts(const Block& block, const BlockState& start, const std::vector<FrameIndex>& frames,
                                  const std::vector<VerifiedPair>& pairs, const TrackSet& tracks,
                                  const OrientationOptions& options) {
  return PartwiseOrientation(block, start, frames, pairs, tracks, options).run(options.part_frames);
}

}  // namespace megablock
