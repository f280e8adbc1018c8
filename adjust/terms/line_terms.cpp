// The mathematics of the residual is in line_terms.h. The weight w is found here.
//
// The two ends of a segment are measured with sigma_px across the segment. The pixel beside an end, one pixel across,
// has a ray at the distance `radians_per_px` from the ray of the end, so that an end is good to sigma_px *
// radians_per_px radians. The residual is half the difference of two such distances, (a'n - b'n) / 2. Its sigma is that
// of an end divided by the square root of two, and w is the inverse of it.
#include "adjust/terms/line_terms.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "adjust/terms/automatic_terms.h"
#include "adjust/terms/terms.h"
#include "adjust/terms/vertical_terms.h"
#include "geometry/transform/rotation.h"

namespace megablock {

namespace {

constexpr double kSmallest = 1e-6;  // sine of the smallest angle that gives a plane

// A measured segment in the axes of the rig.
struct Segment {
  Eigen::Vector3d first, second, middle;
  double radians_per_px = 0;  // at the ends
};

std::optional<Segment> segment_of(const Block& block, const KnownLine::Measurement& measured) {
  const Mount& mount = block.mount_of(measured.image);
  const Intrinsics& camera = block.cameras[mount.camera].intrinsics;
  // One pixel at right angles to the segment. The scale of the camera is taken at both ends, because that of a
  // wide-angle image changes over the image.
  const Eigen::Vector2d across =
      Eigen::Vector2d(measured.first.y() - measured.second.y(), measured.second.x() - measured.first.x()).normalized();
  std::array<Eigen::Vector3d, 4> rays;
  const std::array<Eigen::Vector2d, 4> pixels{measured.first, measured.second, measured.first + across,
                                              measured.second + across};
  for (std::size_t i = 0; i < 4; ++i) {
    const auto ray = viewing_ray(camera, pixels[i]);
    if (!ray) return std::nullopt;
    rays[i] = mount.pose.rotation.conjugate() * *ray;
  }
  return Segment{rays[0], rays[1], (rays[0] + rays[1]).normalized(),
                 ((rays[2] - rays[0]).norm() + (rays[3] - rays[1]).norm()) / 2};
}

TileProblem::LineTerm term_of(const Segment& segment, double sigma_px) {
  TileProblem::LineTerm term;
  term.middle = segment.middle;
  term.across = (segment.first - segment.second).cross(segment.middle) / 2;
  term.weight = std::sqrt(2.0) / (sigma_px * segment.radians_per_px);
  return term;
}

// r and its derivative by the direction v.
struct OffDirection {
  double residual = 0;
  Eigen::RowVector3d by_direction = Eigen::RowVector3d::Zero();
};
OffDirection off_direction(const TileProblem::LineTerm& term, const Eigen::Vector3d& v) {
  const Eigen::Vector3d normal = term.middle.cross(v);
  const double length = normal.norm();
  if (length < kSmallest) return {};
  const double along = v.dot(term.across);
  return {term.weight * along / length,
          term.weight * (term.across.transpose() / length -
                         along / (length * length * length) * normal.transpose() * skew<double>(term.middle))};
}

}  // namespace

std::vector<BlockLineTerm> line_terms(const Block& block, const BlockState& state, const Tiles& tiles, TileIndex tile) {
  std::vector<BlockLineTerm> terms;
  if (block.lines.empty()) return terms;
  const GroundVertical ground(block.ground);
  for (const KnownLine& line : block.lines) {
    const bool vertical = line.direction == KnownLine::Direction::kVertical;
    // The last measurement in an oriented frame: for a horizontal line the frame that shows its plane.
    std::optional<Segment> before;
    FrameIndex before_frame;
    for (const KnownLine::Measurement& measured : line.measurements) {
      const FrameIndex frame = block.images[measured.image].frame;
      if (!state.oriented[frame] || !tiles.tile_of_frame[frame].valid()) continue;
      const auto segment = segment_of(block, measured);
      if (!segment) continue;
      const TileIndex owner = owner_tile(tiles, frame, !vertical && before ? before_frame : frame);
      // A vertical line gives one observation for each measurement. A horizontal one gives an observation for two
      // successive measurements in different frames, since a single image does not show the direction of a line.
      if (owner == tile && (vertical || (before && before_frame != frame))) {
        BlockLineTerm& added = terms.emplace_back();
        added.frame = frame;
        added.term = term_of(*segment, measured.sigma_px);
        added.term.up = -ground.down(state.frames[frame].centre);
        if (!vertical) {
          added.other = before_frame;
          added.term.other_normal = before->first.cross(before->second).normalized();
        }
      }
      before = segment;
      before_frame = frame;
    }
  }
  return terms;
}

// With R Exp(w), v = R d changes by -R [d]x w. With R_o Exp(w), N = R_o' n changes by [N]x w, u = N x z by -[z]x [N]x
// w, and d = u / |u| by (I - d d') / |u| times that.
LineResidual linearise_line(const Pose& frame, const Pose& other, const TileProblem::LineTerm& term) {
  const Eigen::Vector3d& up = term.up;
  const Eigen::Matrix3d rotation = frame.rotation.toRotationMatrix();
  LineResidual result;
  result.by_frame.setZero();
  result.by_other.setZero();
  Eigen::Vector3d direction = up;
  Eigen::Matrix3d by_other = Eigen::Matrix3d::Zero();
  if (term.other.valid()) {
    const Eigen::Vector3d normal = other.rotation.conjugate() * term.other_normal;
    const Eigen::Vector3d horizontal = normal.cross(up);
    const double length = horizontal.norm();
    if (length < kSmallest) return result;
    direction = horizontal / length;
    by_other = -(Eigen::Matrix3d::Identity() - direction * direction.transpose()) / length * skew<double>(up) *
               skew<double>(normal);
  }
  // dr/dw = (dr/dv)(-R [d]x) by the frame, and (dr/dv) R (dd/dw_o) by the other one.
  const OffDirection off = off_direction(term, rotation * direction);
  result.residual = off.residual;
  result.by_frame.head<3>() = -off.by_direction * rotation * skew<double>(direction);
  result.by_other.head<3>() = off.by_direction * rotation * by_other;
  return result;
}

namespace {

class KnownLines final : public ObservationType {
 public:
  std::size_t count(const TileProblem& problem) const override { return problem.lines.size(); }
  TermUnknowns unknowns(const TileProblem& problem, std::size_t row) const override {
    const TileProblem::LineTerm& term = problem.lines[row];
    return {{term.frame.value, term.other.value}, term.other.valid() ? 2 : 1};
  }
  void linearise(const TileProblem& problem, const TileState& state, std::size_t row,
                 const TermVisit& visit) const override {
    const TileProblem::LineTerm& term = problem.lines[row];
    const LineResidual r = linearise_line(state.frames[term.frame.value], state.frames[term.seen_by().value], term);
    LinearTerm out;
    out.set_residual(Eigen::Matrix<double, 1, 1>(r.residual));
    out.kinds.fill(ObservationKind::kLine);
    out.add_block(LinearTerm::By::kFrame, term.frame.value, r.by_frame);
    if (term.other.valid()) out.add_block(LinearTerm::By::kFrame, term.other.value, r.by_other);
    out.loss = problem.line_loss;
    visit(out);
  }
  // Lines depend on rotations alone, and a similarity turns both frames in the same way.
  TermDatum datum(const TileProblem& problem, const TileState& state, std::size_t row) const override {
    const TileProblem::LineTerm& term = problem.lines[row];
    const LineResidual r = linearise_line(state.frames[term.frame.value], state.frames[term.seen_by().value], term);
    TermDatum datum;
    datum.frame = term.frame.value;
    datum.by_frame = Eigen::Matrix<double, 1, 6>(r.by_frame + r.by_other);
    return datum;
  }
  RobustLoss loss(const TileProblem& problem, std::size_t) const override { return problem.line_loss; }
  ceres::CostFunction* automatic(const TileProblem& problem, std::size_t row) const override {
    const TileProblem::LineTerm& term = problem.lines[row];
    return term.other.valid() ? automatic_term<1, kPoseBlock, kPoseBlock>(residual::HorizontalLine{term})
                              : automatic_term<1, kPoseBlock>(residual::VerticalLine{term});
  }
};

}  // namespace

const ObservationType& line_observations() {
  static const KnownLines type;
  return type;
}

}  // namespace megablock
