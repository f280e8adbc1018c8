#include "io/block/block_diagnostics.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "io/base/error.h"
#include "io/block/crs.h"
#include "io/text/counted.h"
#include "io/text/plausible.h"

namespace megablock {

namespace {

using OrderedJson = nlohmann::ordered_json;

OrderedJson finite_number(double value) { return std::isfinite(value) ? OrderedJson(value) : OrderedJson(nullptr); }

constexpr std::size_t kMostListedFootprints = 10000;  // a million footprints would be half a gigabyte of text

class JsonWriter {
 public:
  JsonWriter(const BlockDiagnostics& d, const Block& block) : d_(d), block_(block) {
    if (block.ground.georeferenced) georeference_.emplace(block.ground);
  }

  OrderedJson write() const {
    OrderedJson json{{"aerial", d_.aerial},
                     {"requested", requested()},
                     {"flight_lines", d_.lines},
                     {"usual_step_m", finite_number(d_.usual_step_m)},
                     {"line_distance_m", finite_number(d_.line_distance_m)},
                     {"height_above_ground_m", finite_number(d_.height_m)}};
    json["gaps"] = list(d_.gaps, [&](const auto& gap) { return of(gap); });
    json["thin_ground"] = list(d_.thin_ground, [&](const auto& ground) {
      return OrderedJson{{"centre_m", {ground.centre.x(), ground.centre.y()}}, {"area_m2", ground.area_m2}};
    });
    // Only the pairs outside the requirements are listed; a large block has many.
    json["pair_count"] = d_.pairs.size();
    json["pairs"] = OrderedJson::array();
    for (const auto& pair : d_.pairs)
      if (d_.base_is_outside(pair) || d_.overlap_is_missing(pair)) json["pairs"].push_back(of(pair));
    json["links_known"] = d_.links_known;
    json["part_frames"] = d_.part_frames;
    json["smaller_parts"] = smaller_parts();
    json["weak_links"] = list(d_.weak_links, [&](const auto& link) { return of(link); });
    json["single_links"] = list(d_.single_links, [&](const auto& link) {
      OrderedJson row = of(link);
      row["frames_beyond"] = link.frames;
      return row;
    });
    json["loose_parts"] = list(d_.loose_parts, [&](const auto& part) {
      return OrderedJson{{"frames", names(part.frames)}, {"joints", names(part.joints)}, {"points", part.points}};
    });
    json["proposals"] = list(d_.proposals, [&](const auto& proposal) { return of(proposal); });
    json["footprints"] = OrderedJson::array();
    if (d_.footprints.size() <= kMostListedFootprints)
      json["footprints"] = list(d_.footprints, [&](const auto& footprint) { return of(footprint); });
    return json;
  }

 private:
  template <typename Rows, typename Write>
  static OrderedJson list(const Rows& rows, Write&& write) {
    OrderedJson array = OrderedJson::array();
    for (const auto& row : rows) array.push_back(write(row));
    return array;
  }
  const std::string& name(FrameIndex frame) const { return block_.frames[frame].name; }
  OrderedJson names(const std::vector<FrameIndex>& frames) const {
    return list(frames, [&](FrameIndex f) { return name(f); });
  }
  OrderedJson between(FrameIndex a, FrameIndex b) const { return OrderedJson::array({name(a), name(b)}); }

  OrderedJson requested() const {
    const DiagnosticsOptions& o = d_.requested;
    return {{"min_base_to_height", o.min_base_to_height},
            {"max_base_to_height", o.max_base_to_height},
            {"min_overlap", o.min_overlap},
            {"min_images", o.min_images},
            {"min_link_points", o.min_link_points},
            {"gap_factor", o.gap_factor}};
  }
  OrderedJson of(const BlockDiagnostics::Gap& gap) const {
    return {{"kind", gap.line ? "flight line" : "exposures"},
            {"frames", between(gap.before, gap.after)},
            {"missing", gap.missing},
            {"distance_m", gap.distance_m},
            {"from_m", {gap.from.x(), gap.from.y()}},
            {"to_m", {gap.to.x(), gap.to.y()}}};
  }
  OrderedJson of(const BlockDiagnostics::StereoPair& pair) const {
    return {{"frames", between(pair.a, pair.b)},
            {"base_m", pair.base_m},
            {"base_to_height", finite_number(pair.base_to_height)},
            {"outside", d_.base_is_outside(pair)},
            {"overlap", finite_number(pair.overlap)},
            {"overlap_missing", d_.overlap_is_missing(pair)}};
  }
  OrderedJson of(const BlockDiagnostics::Link& link) const {
    return {{"frames", between(link.a, link.b)}, {"points", link.points}};
  }
  OrderedJson of(const BlockDiagnostics::Proposal& proposal) const {
    const Eigen::Vector3d& c = proposal.centre;
    const Eigen::Quaterniond& q = proposal.rotation;
    OrderedJson json{{"centre_m", {c.x(), c.y(), c.z()}}, {"rotation_wxyz", {q.w(), q.x(), q.y(), q.z()}}};
    if (!georeference_) return json;
    const Geodetic place = georeference_->to_geodetic(c);
    json["latitude_deg"] = place.latitude_deg;
    json["longitude_deg"] = place.longitude_deg;
    json["height_m"] = place.height_m;
    return json;
  }
  OrderedJson of(const BlockDiagnostics::Footprint& footprint) const {
    OrderedJson corners = OrderedJson::array();
    for (const Eigen::Vector2d& corner : footprint.corners) corners.push_back({corner.x(), corner.y()});
    return {{"image", block_.name_of(footprint.image)}, {"corners_m", corners}};
  }
  // The frames of all parts except the largest.
  OrderedJson smaller_parts() const {
    OrderedJson parts = OrderedJson::array();
    for (std::size_t p = 1; p < d_.part_frames.size(); ++p) parts.push_back(OrderedJson::array());
    for (FrameIndex f(0); d_.part_of_frame.contains(f); ++f.value)
      if (d_.part_of_frame[f] > 0) parts[static_cast<std::size_t>(d_.part_of_frame[f]) - 1].push_back(name(f));
    return parts;
  }

  const BlockDiagnostics& d_;
  const Block& block_;
  std::optional<Georeference> georeference_;
};

}  // namespace

void DiagnosticsOptions::check() const {
  if (!(min_base_to_height >= 0 && min_base_to_height < max_base_to_height))
    throw InputError("min_base_to_height must be at least 0 and less than max_base_to_height");
  require_within(max_base_to_height, {0, 1e3}, "max_base_to_height");
  if (!(min_overlap >= 0 && min_overlap < 1))
    throw InputError("min_overlap must be a share of at least 0 and less than 1");
  if (min_images < 1 || min_images > 255) throw InputError("min_images must be from 1 to 255");
  if (min_link_points < 1) throw InputError("min_link_points must be at least 1");
  if (!(gap_factor > 1)) throw InputError("gap_factor must be above 1");
  require_within(gap_factor, {1, 1e3}, "gap_factor");
}

std::string to_json(const BlockDiagnostics& diagnostics, const Block& block) {
  return JsonWriter(diagnostics, block).write().dump(1, ' ', false, OrderedJson::error_handler_t::replace) + "\n";
}

std::string to_text(const BlockDiagnostics& d, const Block& block) {
  if (d.frames == 0)
    return "nothing could be examined, because no image has a pose: run the job as far as its initial orientation "
           "('megablock orient'), or give poses, or positions with attitudes\n";
  std::string text;
  const auto between = [&](const auto& a, const auto& b) {
    return "'" + block.frames[a].name + "' and '" + block.frames[b].name + "'";
  };
  for (const auto& gap : d.gaps)
    text += gap.line ? fmt::format("{} missing beside {}, {:.6g} m wide\n", counted(gap.missing, "flight line"),
                                   between(gap.before, gap.after), gap.distance_m)
                     : fmt::format("{} missing between {}, {:.6g} m apart\n", counted(gap.missing, "exposure"),
                                   between(gap.before, gap.after), gap.distance_m);
  for (const auto& ground : d.thin_ground)
    text += fmt::format("ground seen by fewer than {} images about {:.6g}, {:.6g}: {:.4g} m2\n", d.requested.min_images,
                        ground.centre.x(), ground.centre.y(), ground.area_m2);
  for (const auto& pair : d.pairs) {
    if (d.base_is_outside(pair))
      text += fmt::format("base to height {:.3f} between {}\n", pair.base_to_height, between(pair.a, pair.b));
    if (d.overlap_is_missing(pair))
      text += fmt::format("overlap {:.0f} % between {}\n", 100 * pair.overlap, between(pair.a, pair.b));
  }
  if (d.part_frames.size() > 1)
    text += fmt::format("{} parts without a good link between them\n", d.part_frames.size());
  for (const auto& link : d.weak_links)
    text += fmt::format("weak link of {} between {}\n", counted(link.points, "point"), between(link.a, link.b));
  for (const auto& link : d.single_links)
    text += fmt::format("{} to the rest of the block only by the link between {}\n",
                        counted(link.frames, "frame") + (link.frames == 1 ? " is connected" : " are connected"),
                        between(link.a, link.b));
  for (const auto& part : d.loose_parts) text += loose_part_text(part, d, block) + "\n";
  if (!d.proposals.empty())
    text += fmt::format("{} proposed\n", d.proposals.size() == 1 ? "1 exposure is"
                                                                 : fmt::format("{} exposures are", d.proposals.size()));
  if (text.empty()) text = "no weakness was found\n";
  if (!d.aerial)
    text +=
        "not examined, because the images do not look down or the vertical is unknown: flight lines, ground, bases, "
        "overlaps\n";
  if (!d.links_known) text += "not examined, because there are no matches or tie points yet: links\n";
  return text;
}

std::string loose_part_text(const BlockDiagnostics::LoosePart& part, const BlockDiagnostics& d, const Block& block) {
  const auto names = [&](const std::vector<FrameIndex>& frames) {
    constexpr std::size_t kNamed = 3;
    std::string text;
    for (std::size_t i = 0; i < std::min(kNamed, frames.size()); ++i)
      text += (i == 0 ? "'" : i + 1 == frames.size() ? " and '" : ", '") + block.frames[frames[i]].name + "'";
    return text + (frames.size() > kNamed ? fmt::format(" and {} more", frames.size() - kNamed) : "");
  };
  const std::string who = fmt::format("{} ({})", counted(std::ssize(part.frames), "frame"), names(part.frames));
  const bool one = part.frames.size() == 1;
  const std::string how =
      part.joints.empty()
          ? fmt::format("{} no link of {} tie points with the rest of the block; the best has {}", one ? "has" : "have",
                        d.requested.min_link_points, part.points)
          : fmt::format("{} only {} with the rest of the block; the best link past {} has {} of {} tie points",
                        one ? "shares" : "share", names(part.joints), part.joints.size() == 1 ? "it" : "them",
                        part.points, d.requested.min_link_points);
  return who + " " + how;
}

std::vector<std::string> loose_part_remarks(const BlockDiagnostics& d, const Block& block) {
  constexpr std::size_t kMost = 10;
  std::vector<std::string> remarks;
  std::size_t others = 0;
  for (const auto& part : d.loose_parts) {
    if (part.frames.size() < 2) continue;
    if (remarks.size() == kMost)
      ++others;
    else
      remarks.push_back(loose_part_text(part, d, block) +
                        ": nothing else tells the size of this part, which may be wrong, and with it its place; add "
                        "images that see both sides, positions or control points");
  }
  if (others > 0)
    remarks.push_back(fmt::format("{} more parts have no size of their own; 'diagnose' lists them", others));
  return remarks;
}

}  // namespace megablock
