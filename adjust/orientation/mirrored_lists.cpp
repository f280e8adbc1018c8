#include "adjust/orientation/mirrored_lists.h"

#include <fmt/core.h>

#include "adjust/orientation/steps/control_marks.h"
#include "geometry/numbers/median.h"
#include "io/block/held_priors.h"

namespace megablock {

namespace {

constexpr double kKnownTo = kUnknownHeightSigma / 2;  // metres

// Places in the state and as given, and the sigmas of the latter.
struct Compared {
  std::vector<Eigen::Vector3d> model, given;
  std::vector<double> sigmas;
  void add(const Eigen::Vector3d& in_model, const Eigen::Vector3d& as_given, const Eigen::Vector3d& sigma) {
    if (!as_given.allFinite() || !(sigma.maxCoeff() < kKnownTo)) return;
    model.push_back(in_model);
    given.push_back(as_given);
    sigmas.push_back(sigma.mean());
  }
};

std::string metres(double value) { return fmt::format("{:.{}f} m", value, value < 10 ? 2 : 0); }

const char* reflection_text(Reflection reflection) {
  if (reflection == Reflection::kExchanged) return "x and y exchanged";
  return reflection == Reflection::kFirstReversed ? "the sign of x reversed" : "the sign of y reversed";
}

// "fit with x and y exchanged (to 0.02 m, as given to 35 m): are east and north exchanged in the list?".
std::string fit_text(const MirroredLayout& found, bool in_place) {
  const char* cause = found.reflection != Reflection::kExchanged ? "does the axis point the other way in the list?"
                      : in_place                                 ? "are east and north exchanged in the list?"
                                 : "are east and north exchanged in the list, or has one of them the wrong sign?";
  return fmt::format("fit with {} (to {}, as given to {}): {}", reflection_text(found.reflection),
                     metres(found.mirrored_m), metres(found.given_m), cause);
}

}  // namespace

std::optional<MirroredLayout> find_mirrored_control(const Block& block, const BlockState& state,
                                                    const std::vector<FrameIndex>& frames, bool in_place) {
  Compared compared;
  for (const ControlPoint& point : block.control_points) {
    if (point.role != PointRole::kControl) continue;
    if (const SeenMarks seen = see_marks(block, state, frames, point); seen.place)
      compared.add(*seen.place, point.position, point.sigma);
  }
  if (in_place) return find_mirrored_layout_in_place(compared.model, compared.given);
  return find_mirrored_layout(compared.model, compared.given, median(compared.sigmas), mean_axes(block, state, frames));
}

std::optional<MirroredLayout> find_mirrored_positions(const std::vector<FramePosition>& positions,
                                                      const MeanAxes& axes) {
  Compared compared;
  for (const auto& [centre, prior] : positions) {
    if (held(prior) || prior.group.valid()) return std::nullopt;
    compared.add(centre, prior.position, prior.sigma);
  }
  return find_mirrored_layout(compared.model, compared.given, median(compared.sigmas), axes);
}

std::optional<MirroredLayout> find_mirrored_positions(const Block& block, const BlockState& state,
                                                      const std::vector<FrameIndex>& frames) {
  std::vector<FramePosition> positions;
  for (const FrameIndex f : frames)
    if (const auto& prior = block.frames[f].position_prior; prior && state.oriented[f])
      positions.push_back({state.frames[f].centre, *prior});
  return find_mirrored_positions(positions, mean_axes(block, state, frames));
}

void leave_out_control(Block& block) {
  for (ControlPoint& point : block.control_points) point.role = PointRole::kCheck;
}

void leave_out_positions(const std::vector<FrameIndex>& frames, Block& block) {
  for (const FrameIndex f : frames) block.frames[f].position_prior.reset();
}

std::string mirrored_control_text(const MirroredLayout& found, bool in_place) {
  return "the control points " + fit_text(found, in_place) +
         " They do not place the block, and count as check points; correct the list and run again";
}

std::string mirrored_positions_text(const MirroredLayout& found) {
  return "the positions " + fit_text(found, false) +
         " They are left out, and the images alone give the shape of the block; correct the list and run again";
}

}  // namespace megablock
