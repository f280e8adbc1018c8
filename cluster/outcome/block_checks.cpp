#include "cluster/outcome/block_checks.h"

#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "cluster/job/job_options.h"
#include "cluster/job/job_so_far.h"
#include "cluster/outcome/result_tile.h"
#include "geometry/numbers/angles.h"
#include "io/base/error.h"
#include "io/block/track_rows.h"
#include "io/result/result.h"
#include "io/result/track_batches.h"
#include "merge/tree/tile_solver.h"
#include "partition/views/flight_lines.h"

namespace megablock {

namespace {

using OrderedJson = nlohmann::ordered_json;

std::vector<BlockChecks::Line> check_lines(const Block& block, const BlockState& state) {
  std::vector<BlockChecks::Line> lines;
  for (const FlightLine& line : flight_lines(acquisition_order(block, state), state)) {
    std::vector<Eigen::Vector3d> centres;
    for (const FrameIndex frame : line) centres.push_back(state.frames[frame].centre);
    lines.push_back({line.front(), line.back(), std::ssize(line), check_strip(centres)});
  }
  return lines;
}

std::optional<LevelCheck> check_level(const TrackBatches& tracks) {
  constexpr std::int64_t kEnough = 10'000;
  constexpr std::size_t kFewest = 10;  // fewer points show nothing
  const auto sample = sample_of(tracks, kEnough);
  if (sample.points.size() < kFewest) return std::nullopt;
  return check_one_level(sample.points);
}

// The tie point that most images see.
std::int64_t reference_point(const TileProblem& problem) {
  std::int64_t best = -1, most = 0;
  for (std::int64_t p = 0; p < problem.point_count(); ++p) {
    if (problem.points[static_cast<std::size_t>(p)].role != PointRole::kTie || !problem.active(p)) continue;
    const auto seen =
        std::count(problem.kept.begin() + problem.begin[static_cast<std::size_t>(p)],
                   problem.kept.begin() + problem.begin[static_cast<std::size_t>(p) + 1], std::uint8_t{1});
    if (seen > most) best = p, most = seen;
  }
  return best;
}

void check_subsets(const BlockResult& figures, const std::string& path, const ObservationOptions& options,
                   BlockChecks& checks) {
  constexpr int kSubsets = 5;
  constexpr std::int64_t kMostFrames = 200, kMostMeasurements = 200'000;
  const auto frames = std::count(figures.state.oriented.begin(), figures.state.oriented.end(), 1);
  if (!figures.free_parts.empty()) {
    checks.no_subsets = "its datum is free";
    return;
  }
  if (frames > kMostFrames) {
    checks.no_subsets = fmt::format("it has {} frames, more than {}", frames, kMostFrames);
    return;
  }
  const BlockResult result = read_result(path);
  if (result.tracks.observation_count() > kMostMeasurements) {
    checks.no_subsets =
        fmt::format("it has {} measurements, more than {}", result.tracks.observation_count(), kMostMeasurements);
    return;
  }
  const ResultTile tile = tile_of_result(result, options);
  const std::int64_t reference = reference_point(tile.problem);
  if (reference < 0) {
    checks.no_subsets = "no tie point takes part";
    return;
  }
  const std::vector<MotionReference> motion = motion_references(result.block, result.tiles);
  if (motion.size() > 1) {  // a rotation common to all attitudes belongs to one part only
    checks.no_subsets = fmt::format("it has {} parts", motion.size());
    return;
  }
  try {
    checks.subsets = check_point_subsets(tile.problem, tile.state, reference, kSubsets,
                                         motion.empty() ? MotionReference() : motion.front(), solve_by_condensation);
  } catch (const Error& error) {
    checks.no_subsets = error.what();
  }
}

std::vector<std::vector<ImageIndex>> indices_of(const Block& block,
                                                const std::vector<std::vector<std::string>>& subsets) {
  std::vector<std::vector<ImageIndex>> found;
  if (subsets.empty()) return found;
  std::map<std::string, ImageIndex> index;
  for (ImageIndex i(0); block.images.contains(i); ++i.value) index[block.name_of(i)] = i;
  for (const std::vector<std::string>& names : subsets) {
    found.emplace_back();
    for (const std::string& name : names) {
      const auto image = index.find(name);
      if (image == index.end()) throw InputError("--subset: the block has no image '" + name + "'");
      found.back().push_back(image->second);
    }
  }
  return found;
}

// Gathers the tie points that the images of the subsets see.
class SubsetTracks {
 public:
  SubsetTracks(const Block& block, const std::vector<std::vector<ImageIndex>>& subsets) : subsets_(subsets) {
    wanted_.assign(block.images.size(), 0);
    for (const auto& images : subsets)
      for (const ImageIndex image : images) wanted_[image] = 1;
    seen_.begin.push_back(0);
  }
  // `kept` has one entry for each observation, or is empty: all count.
  void add(const TrackSet& tracks, const std::vector<std::uint8_t>& kept) {
    for (std::int64_t t = 0; t < tracks.track_count(); ++t) {
      const std::size_t before = seen_.image.size();
      for (std::int64_t row = tracks.begin[t]; row < tracks.begin[t + 1]; ++row)
        if (wanted_[tracks.image[row]] && (kept.empty() || kept[static_cast<std::size_t>(row)]))
          seen_.image.push_back(tracks.image[row]);
      if (seen_.image.size() > before) seen_.begin.push_back(std::ssize(seen_.image));
    }
  }
  std::vector<ImageSubset> ranked() const { return rank_by_common_tracks(seen_, subsets_); }

 private:
  const std::vector<std::vector<ImageIndex>>& subsets_;
  IndexedVector<ImageIndex, std::uint8_t> wanted_;
  TrackSet seen_;  // the images of the tracks alone
};

std::vector<std::string> names_of(const ImageSubset& subset, const Block& block) {
  std::vector<std::string> names;
  for (const ImageIndex image : subset.images) names.push_back(block.name_of(image));
  return names;
}

OrderedJson number_or_null(double value) { return std::isfinite(value) ? OrderedJson(value) : OrderedJson(); }

}  // namespace

BlockChecks check_job(const JobStore& store, bool aerial, const std::vector<std::vector<std::string>>& subsets) {
  BlockChecks checks;
  if (!store.seal(kResult)) {
    const JobSoFar job = read_job_so_far(store);
    const std::vector<std::vector<ImageIndex>> images = indices_of(job.block, subsets);
    if (aerial) checks.lines = check_lines(job.block, job.state);
    checks.no_subsets = "there is no result yet";
    if (images.empty()) return checks;
    SubsetTracks tracks(job.block, images);
    visit_tracks(store, [&](const TrackSet& batch) { tracks.add(batch, {}); });
    checks.common = tracks.ranked();
    return checks;
  }
  const std::string path = store.verified_path(kResult);
  const BlockResult result = read_result_without_tracks(path);
  const StoredTracks stored(path);
  const std::vector<std::vector<ImageIndex>> images = indices_of(result.block, subsets);
  if (aerial) {
    checks.lines = check_lines(result.block, result.state);
    checks.level = check_level(stored);
  }
  check_subsets(result, path, options_of_job(store).adjustment.observations, checks);
  if (images.empty()) return checks;
  SubsetTracks tracks(result.block, images);
  stored.visit([&](const TrackResults& batch) { tracks.add(batch.tracks, batch.kept); });
  checks.common = tracks.ranked();
  return checks;
}

std::string to_json(const BlockChecks& checks, const Block& block) {
  OrderedJson json{{"flight_lines", OrderedJson::array()}, {"ground", nullptr}, {"point_subsets", nullptr}};
  for (const BlockChecks::Line& line : checks.lines)
    json["flight_lines"].push_back({{"frames", {block.frames[line.first].name, block.frames[line.last].name}},
                                    {"exposures", line.exposures},
                                    {"off_line", number_or_null(line.check.off_line)},
                                    {"uneven", number_or_null(line.check.uneven)},
                                    {"sound", line.check.sound()}});
  if (checks.level)
    json["ground"] = {{"separation", number_or_null(checks.level->separation)},
                      {"step_m", checks.level->step},
                      {"smaller_share", checks.level->smaller_share},
                      {"sound", checks.level->sound()}};
  if (checks.subsets)
    json["point_subsets"] = {{"subsets", checks.subsets->subsets},
                             {"rotation_spread_deg", checks.subsets->rotation_spread_rad * kDegreesPerRadian},
                             {"image_spread_px", checks.subsets->image_spread_px},
                             {"common_sigma_deg", checks.subsets->common_sigma_rad * kDegreesPerRadian},
                             {"rotation_sigma_deg", checks.subsets->rotation_sigma_rad() * kDegreesPerRadian}};
  json["point_subsets_omitted"] = checks.no_subsets;
  json["common_tracks"] = OrderedJson::array();
  for (const ImageSubset& subset : checks.common)
    json["common_tracks"].push_back({{"images", names_of(subset, block)}, {"tracks", subset.common_tracks}});
  return json.dump(1, ' ', false, OrderedJson::error_handler_t::replace);
}

std::string to_text(const BlockChecks& checks, const Block& block) {
  std::string text;
  if (!checks.lines.empty()) {
    const auto worst = [&](auto&& figure) {
      const auto line = std::max_element(checks.lines.begin(), checks.lines.end(), [&](const auto& a, const auto& b) {
        return figure(a.check) < figure(b.check);
      });
      return fmt::format("{:.3f} of a step at most ('{}' to '{}')", figure(line->check), block.frames[line->first].name,
                         block.frames[line->last].name);
    };
    const auto sound =
        std::count_if(checks.lines.begin(), checks.lines.end(), [](const auto& l) { return l.check.sound(); });
    text += fmt::format(
        "check of {} flight lines: off their line by {}, steps uneven by {}; {} of them below {}, as in an "
        "overpass of a satellite\n",
        checks.lines.size(), worst([](const StripCheck& c) { return c.off_line; }),
        worst([](const StripCheck& c) { return c.uneven; }), sound, StripCheck::kLimit);
  }
  if (checks.level)
    text += checks.level->sound()
                ? "check of the ground: the tie points do not lie on two levels\n"
                : fmt::format(
                      "check of the ground: the tie points lie on two levels {:.3g} m apart, {:.0f} % of them on the "
                      "smaller; if the ground is flat, parts of the block disagree\n",
                      checks.level->step, 100 * checks.level->smaller_share);
  if (checks.subsets) {
    const SubsetCheck& s = *checks.subsets;
    text += fmt::format(
        "check by {} subsets of the tie points: attitudes {:.2g} degrees apart, projections of a point {:.2g} px "
        "apart; sigma of the attitudes {:.2g} degrees",
        s.subsets, s.rotation_spread_rad * kDegreesPerRadian, s.image_spread_px,
        s.rotation_sigma_rad() * kDegreesPerRadian);
    if (s.common_sigma_rad > 0)
      text += fmt::format(", {:.2g} of it shared by all of them", s.common_sigma_rad * kDegreesPerRadian);
    text += "\n";
  } else {
    text += "check by subsets of the tie points: not made, " + checks.no_subsets + "\n";
  }
  for (const ImageSubset& subset : checks.common)
    text += fmt::format("{} tie points in all of {}\n", subset.common_tracks, fmt::join(names_of(subset, block), ", "));
  return text;
}

}  // namespace megablock
