#include "adjust/orientation_parts.h"

#include <fmt/core.h>

#include <algorithm>
#include <limits>
#include <map>
#include <set>

#include "adjust/ground_alignment.h"
#include "adjust/model_assembly.h"
#include "adjust/orientation_graph.h"
#include "io/error.h"

namespace megablock {

namespace {

using PartLinks = std::vector<std::vector<std::int32_t>>;  // [frames by name] ascending

// Frames of `set` by their distance from `first`, then by name; what cannot be reached comes after it in the same way.
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
    if (next.empty() && !left.empty()) {
      next.push_back(*left.begin());
      left.erase(left.begin());
    }
    ring = std::move(next);
  }
  return order;
}

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

// Errors of a part's frames in units of its mean baseline and in radians: only their ratio matters, as assembly scales
// them to what it finds.
constexpr double kCentreSigma = 1e-3, kRotationSigma = 2e-4;

}  // namespace

std::vector<OrientationPart> orientation_parts(const Block& block, const std::vector<FrameIndex>& frames,
                                               const std::vector<VerifiedPair>& pairs, int part_frames) {
  std::vector<FrameIndex> by_name = frames;
  std::sort(by_name.begin(), by_name.end(),
            [&](FrameIndex a, FrameIndex b) { return block.frames[a].name < block.frames[b].name; });
  std::map<FrameIndex, std::int32_t> number;
  for (std::size_t f = 0; f < by_name.size(); ++f) number[by_name[f]] = static_cast<std::int32_t>(f);
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

class PartwiseOrientation {
 public:
  PartwiseOrientation(const Block& block, const BlockState& start, const std::vector<FrameIndex>& frames,
                      const std::vector<VerifiedPair>& pairs, const OrientationOptions& options)
      : block_(block), start_(start), frames_(frames), pairs_(pairs), options_(options) {
    options_.part_frames = 0;
  }

  OrientationResult run(const TrackSet& tracks, int part_frames) {
    orient_parts(tracks, part_frames);
    assemble();
    return result();
  }

 private:
  void orient_parts(const TrackSet& tracks, int part_frames) {
    for (OrientationPart& part : orientation_parts(block_, frames_, pairs_, part_frames)) {
      const std::set<FrameIndex> inside(part.frames.begin(), part.frames.end());
      std::vector<VerifiedPair> own;
      for (const VerifiedPair& pair : pairs_)
        if (inside.contains(block_.images[pair.a].frame) && inside.contains(block_.images[pair.b].frame))
          own.push_back(pair);
      try {
        oriented_.push_back(orient_component(block_, start_, part.frames, own, tracks, options_));
        parts_.push_back(std::move(part));
      } catch (const ComputeError&) {  // too little holds it together; its frames may be in others
      }
    }
    if (parts_.empty()) throw ComputeError("orientation: no part of the block could be oriented");
  }

  void assemble() {
    std::vector<Model> models;
    for (std::size_t p = 0; p < parts_.size(); ++p) {
      Model model{static_cast<std::int64_t>(p), {}, {}};
      for (const FrameIndex frame : parts_[p].frames)
        if (oriented_[p].state.oriented[frame])
          model.images.push_back({frame.value, oriented_[p].state.frames[frame], kCentreSigma, kRotationSigma});
      models.push_back(std::move(model));
    }
    AssemblyOptions options;
    options.covariances = false;
    options.links.scale_sigmas = true;
    assembled_ = assemble_models(models, options);
    std::map<std::int64_t, std::size_t> size;
    for (std::size_t p = 0; p < parts_.size(); ++p) size[assembled_.part[p]] += models[p].images.size();
    std::size_t largest = 0;
    for (const auto& [part, frames] : size)
      if (frames > largest) largest_ = part, largest = frames;
  }

  // A frame's pose comes from the part in whose core it is, else from the first that has it.
  void collect(BlockState& state) const {
    for (const bool core : {true, false})
      for (std::size_t p = 0; p < parts_.size(); ++p) {
        if (assembled_.part[p] != largest_) continue;
        for (std::size_t i = core ? 0 : parts_[p].core; i < (core ? parts_[p].core : parts_[p].frames.size()); ++i) {
          const FrameIndex frame = parts_[p].frames[i];
          if (state.oriented[frame] || !oriented_[p].state.oriented[frame]) continue;
          state.frames[frame] = assembled_.similarity[p](oriented_[p].state.frames[frame]);
          state.oriented[frame] = 1;
        }
      }
  }

  // Mean of the parts, by their frames.
  void average_cameras(BlockState& state) const {
    for (CameraIndex c(0); state.cameras.contains(c); ++c.value) {
      double weights = 0;
      std::vector<double> sums(static_cast<std::size_t>(state.cameras[c].size()), 0);
      for (std::size_t p = 0; p < parts_.size(); ++p) {
        if (assembled_.part[p] != largest_ || !used_in(p, c)) continue;
        const auto weight = static_cast<double>(parts_[p].core);
        weights += weight;
        for (int k = 0; k < state.cameras[c].size(); ++k)
          sums[static_cast<std::size_t>(k)] += weight * oriented_[p].state.cameras[c][k];
      }
      for (int k = 0; weights > 0 && k < state.cameras[c].size(); ++k)
        state.cameras[c][k] = sums[static_cast<std::size_t>(k)] / weights;
    }
  }
  bool used_in(std::size_t part, CameraIndex camera) const {
    return std::any_of(parts_[part].frames.begin(), parts_[part].frames.end(), [&](FrameIndex frame) {
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
    std::size_t count = 0;
    for (const FrameIndex frame : frames_) {
      count += result.state.oriented[frame];
      if (!result.state.oriented[frame])
        result.failed.emplace_back(frame, "no part that is joined to the largest holds it");
    }
    for (const OrientationResult& part : oriented_)
      for (const auto& [frame, reason] : part.failed)
        for (auto& [failed, why] : result.failed)
          if (failed == frame) why = reason;
    std::sort(result.failed.begin(), result.failed.end());
    const auto kept =
        std::count_if(assembled_.links.begin(), assembled_.links.end(), [](const auto& l) { return l.kept; });
    result.summary = fmt::format("{} of {} frames oriented in {} parts, {} of {} links between them kept, free block",
                                 count, frames_.size(), parts_.size(), kept, assembled_.links.size());
    return result;
  }

  void to_free_frame(BlockState& state) const {
    const OrientationGraph graph = make_orientation_graph(block_, start_, frames_, pairs_, TrackSet(), options_);
    OrientationValues values;
    bool metric = false;
    for (const auto& node : graph.frames)
      values.frames.push_back(state.oriented[node.index] ? std::optional(state.frames[node.index]) : std::nullopt);
    for (const auto& image : graph.images) metric |= image.mount.centre.norm() > 0;
    const Similarity similarity = similarity_to_free_frame(graph, values, known_angles(graph), metric);
    for (const FrameIndex frame : frames_)
      if (state.oriented[frame]) state.frames[frame] = similarity(state.frames[frame]);
  }

  const Block& block_;
  const BlockState& start_;
  const std::vector<FrameIndex>& frames_;
  const std::vector<VerifiedPair>& pairs_;
  OrientationOptions options_;  // of a part
  std::vector<OrientationPart> parts_;
  std::vector<OrientationResult> oriented_;  // [parts]
  AssembledModels assembled_;
  std::int64_t largest_ = 0;
};

}  // namespace

OrientationResult orient_in_parts(const Block& block, const BlockState& start, const std::vector<FrameIndex>& frames,
                                  const std::vector<VerifiedPair>& pairs, const TrackSet& tracks,
                                  const OrientationOptions& options) {
  return PartwiseOrientation(block, start, frames, pairs, options).run(tracks, options.part_frames);
}

}  // namespace megablock
