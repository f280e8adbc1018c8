// Writes the headline with the main figures, and the assessment: the strengths and weaknesses of the result.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "io/evaluation/remarks/control_remarks.h"
#include "io/evaluation/remarks/remarks.h"
#include "io/report/drawing/html.h"
#include "io/report/sections/sections.h"
#include "io/result/result_option.h"

namespace megablock::report {

namespace {

std::string card(const std::string& value, const std::string& name, const std::string& note = "") {
  return "<div class=card><b>" + value + "</b><span>" + name + "</span>" +
         (note.empty() ? "" : "<small>" + note + "</small>") + "</div>\n";
}

std::string item(const char* state, const std::string& text) {
  return fmt::format("<li class={}>{}</li>\n", state, text);
}

bool not_converged(const BlockResult& result) {
  return result.decrement_limit > 0 && !(result.newton_decrement <= result.decrement_limit);
}

std::string convergence_item(const BlockResult& result) {
  if (!not_converged(result)) return "";
  return item("bad",
              fmt::format("The adjustment has <b>not converged</b>: the Newton decrement is {}, the limit {}. "
                          "Unknowns may lie {} of their own sigma from the optimum; poses, residuals and sigmas "
                          "are provisional.",
                          significant(result.newton_decrement, 2), significant(result.decrement_limit, 2),
                          std::isfinite(result.newton_decrement) ? "up to " + significant(result.newton_decrement, 2)
                                                                 : "any multiple"));
}

std::string images_item(const BlockResult& result, const Figures& f) {
  const auto images = static_cast<std::int64_t>(result.block.images.size());
  const std::int64_t lost = images - f.reprojection.oriented_images;
  if (images == 0) return item("look", "The block has no images.");
  if (lost == 0) return item("good", "All images are oriented.");
  return item("look", fmt::format("{} of {} images {} not oriented: see <a href=\"#failures\">below</a>.", count(lost),
                                  count(images), lost == 1 ? "is" : "are"));
}

std::string parts_item(const Figures& f) {
  if (f.parts.size() < 2) return "";
  const auto free = std::count_if(f.parts.begin(), f.parts.end(), [](const BlockPart& part) { return !part.placed(); });
  const std::string parts = count(static_cast<std::int64_t>(f.parts.size()));
  if (free == 0)
    return item("look", fmt::format("The block consists of {} parts that no tie point connects; only its own positions "
                                    "or control points place each of them.",
                                    parts));
  return item("bad", fmt::format("The block consists of {} parts that no tie point connects, and nothing places {} of "
                                 "them: their coordinates cannot be compared with those of other parts.",
                                 parts, count(free)));
}

std::string seams_item(const BlockResult& result) {
  if (result.seams.empty()) return "";
  std::int64_t tested = 0, alarmed = 0;
  double largest = 0;  // largest disagreement at an alarm, in sigmas
  for (const SeamCheck& seam : result.seams) {
    tested += seam.degrees > 0;
    if (!alarms(seam)) continue;
    ++alarmed;
    largest = std::max(largest, sigmas_apart(seam));
  }
  const auto untested = static_cast<std::int64_t>(result.seams.size()) - tested;
  const std::string rest = untested == 0
                               ? ""
                               : fmt::format(" {} more {} parts without common unknowns and cannot be tested.",
                                             count(untested), untested == 1 ? "joins" : "join");
  if (tested == 0)
    return item("look",
                fmt::format("The {} of the merge tree {} parts without common unknowns: there is no seam to test.",
                            untested == 1 ? "joint" : count(untested) + " joints", untested == 1 ? "joins" : "join"));
  if (alarmed > 0)
    return item(
        largest > kGrossRatio ? "bad" : "look",
        fmt::format("{} of {} joints of the merge tree raise an alarm: adjusted separately, their two sides would "
                    "differ by up to {} times what their sigmas explain. {} See <a href=\"#tiles\">tiles</a>.",
                    count(alarmed), count(tested), fixed(largest, 1),
                    largest > kGrossRatio
                        ? "A tile holds observations that do not fit its neighbours."
                        : "An imperfect camera model or sigmas that are too small cause such small differences; the "
                          "result itself is one adjustment without a step at the joints.") +
            rest);
  return item("good",
              (tested == 1 ? "No seam: the tiles agree at the joint of the merge tree that was tested."
                           : fmt::format("No seam: the tiles agree at the {} joints of the merge tree that were "
                                         "tested.",
                                         count(tested))) +
                  rest);
}

std::string residuals_item(const BlockResult& result, const Figures& f) {
  std::string list;
  for (const std::string& text : misstated_texts(result))
    list += item("look", escape(text) + ": see <a href=\"#observations\">observations</a>.");
  for (const std::string& text : contradicted_texts(result, f)) list += item("look", escape(text) + ".");
  if (const std::string text = near_limit_text(result, f); !text.empty()) list += item("look", escape(text) + ".");
  if (const std::string text = sigma_naught_text(result); !text.empty()) list += item("look", escape(text) + ".");
  if (result.degrees_of_freedom <= 0 || !(result.variance_factor > 0) || !list.empty()) return list;
  const double s0 = std::sqrt(result.variance_factor);
  const bool held = option_of(result, "adjustment.estimate_image_sigma") == "false";
  return item("good", "Residuals agree with their sigmas (σ₀ " + fixed(s0, 2) + "; the sigma of tie points is " +
                          (held ? "held" : "estimated") + ").");
}

std::string unused_points_item(const BlockResult& result) {
  std::string list;
  for (const PointRole role : {PointRole::kControl, PointRole::kCheck}) {
    const std::string text = unused_points_text(result, role);
    if (!text.empty()) list += item("bad", escape(text) + ": see <a href=\"#control\">control and check points</a>.");
  }
  for (const std::string& text : wrong_control_texts(result))
    list += item("look", escape(text) + ": see <a href=\"#control\">control and check points</a>.");
  return list;
}

std::string points_item(const BlockResult& result, const Figures& f, PointRole role) {
  std::int64_t known = 0, beyond = 0, all = 0;
  for (const PointResidual& r : f.points) {
    if (result.block.control_points[r.point].role != role) continue;
    ++all;
    known += std::isfinite(r.ratio);
    beyond += r.ratio > kGrossRatio;
  }
  const std::string name = role == PointRole::kCheck ? "check" : "control";
  if (all == 0) return "";
  if (known == 0) return item("look", fmt::format("None of the {} {} points could be compared.", count(all), name));
  if (beyond > 0)
    return item(
        role == PointRole::kCheck ? "bad" : "look",
        fmt::format("{} of {} {} points differ by more than {} sigma: see <a href=\"#control\">control and check "
                    "points</a>.",
                    count(beyond), count(known), name, fixed(kGrossRatio, 0)));
  return role == PointRole::kCheck ? item("good", fmt::format("The {} check points agree within {} sigma.",
                                                              count(known), fixed(kGrossRatio, 0)))
                                   : "";
}

}  // namespace

bool alarms(const SeamCheck& seam) { return seam.degrees > 0 && seam.statistic > seam.threshold; }

// T is the squared difference of the two sides in the metric of its covariance. Its mean is the number of degrees of
// freedom if the sides agree, so this root is then about 1.
double sigmas_apart(const SeamCheck& seam) {
  return std::sqrt(std::max(0.0, seam.statistic) / static_cast<double>(seam.degrees));
}

std::string headline(const BlockResult& result, const Figures& f) {
  const ReprojectionStatistics& r = f.reprojection;
  const auto images = static_cast<std::int64_t>(result.block.images.size());
  const bool measured = r.observations > 0;
  double seconds = 0, peak = 0;
  for (const StageStatistics& stage : result.stages) {
    seconds += stage.seconds;
    peak = std::max(peak, stage.peak_rss_mib);
  }
  std::string cards = card(count(r.oriented_images) + "<i> of\u00a0" + count(images) + "</i>", "images oriented",
                           images == r.oriented_images ? "" : count(images - r.oriented_images) + " not oriented");
  cards += card(count(r.points), "tie points",
                measured ? "seen in " + fixed(r.mean_track_length, 2) + " images on average" : "");
  cards += card(count(r.observations), "observations",
                f.all_observations > 0 ? percent(static_cast<double>(f.all_observations - r.observations),
                                                 static_cast<double>(f.all_observations)) +
                                             " rejected"
                                       : "");
  cards += card(measured ? fixed(r.mean_px, 3) + "<i> px</i>" : kMissing, "mean residual",
                measured ? "rms " + fixed(r.rms_px, 3) + " px" : "");
  cards += card(result.degrees_of_freedom > 0 ? fixed(std::sqrt(std::max(0.0, result.variance_factor)), 3) : kMissing,
                "σ₀ a posteriori",
                result.degrees_of_freedom > 0 ? "variance factor " + significant(result.variance_factor) + ", " +
                                                    count(result.degrees_of_freedom) + " degrees of freedom, " +
                                                    fixed(result.image_sigma_px, 3) + " px per tie point observation"
                                              : "");
  if (std::isfinite(f.ground_resolution_m)) {
    const LengthUnit unit = length_unit(f.ground_resolution_m, ground_unit(f));
    cards += card(significant(f.ground_resolution_m * unit.factor) + "<i> " + unit.name + "</i>",
                  "per pixel in object space", "median");
  }
  cards += card(count(result.tiles.tile_count), result.tiles.tile_count == 1 ? "tile" : "tiles",
                count(f.boundary_frames) + " separator frames");
  cards += card(count(result.global_iterations), "global iterations",
                result.global_iterations > 0 ? "Newton decrement " + significant(result.newton_decrement, 2) : "");
  if (seconds > 0) cards += card(duration(seconds), "all stages", "peak memory " + memory(peak) + " a rank");
  return "<div class=cards>" + cards + "</div>\n";
}

std::string assessment(const BlockResult& result, const Figures& f, const BlockDiagnostics* diagnostics) {
  std::string list = convergence_item(result) + images_item(result, f) + parts_item(f) + seams_item(result) +
                     unused_points_item(result) + residuals_item(result, f) +
                     points_item(result, f, PointRole::kCheck) + points_item(result, f, PointRole::kControl);
  for (const std::string& text : datum_texts(result, f)) list += item("look", escape(text) + ".");
  if (diagnostics)
    for (const std::string& text : loose_part_remarks(*diagnostics, result.block))
      list += item("look", escape(text) + ".");
  if (!result.gauge.empty()) list += item("plain", "Datum: " + escape(result.gauge) + ".");
  for (const std::string& note : result.notes) list += item("look", escape(note));
  return "<ul class=assessment>\n" + list + "</ul>\n";
}

}  // namespace megablock::report
