// The mathematics is in common_motion.h. Here `known` is G (or R_f of a frame) without attitude priors, `all` is G_a,
// and `answer` is the sum over frames of the rotation w_f = -(R_f + A_f)^-1 W_f m of the best response to m, with A_f
// the attitude priors. The sigma of the common rotation in the direction v, v'G_a v = 1, is |answer v| / frames: m = v
// is a movement of one sigma, and the mean rotation of the frames is what the reader of the report can imagine.
//
// The points are taken along with the ground, so that no unknown of a point appears. The residual of an image changes
// by A_X S_X m for the movement S_X m of the point and by B dx for the response of the frame.
#include "adjust/checks/common_motion.h"

#include <fmt/core.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "adjust/terms/line_terms.h"
#include "adjust/terms/linearise.h"
#include "adjust/terms/prior_loss.h"
#include "adjust/terms/vertical_terms.h"
#include "geometry/numbers/angles.h"
#include "geometry/numbers/decompositions.h"
#include "geometry/numbers/straight_line.h"

namespace megablock {

namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Matrix67 = Eigen::Matrix<double, 6, 7>;
using Matrix37 = Eigen::Matrix<double, 3, 7>;

constexpr double kHalf = 0.5;  // share of the information: below it, the attitude priors give more than everything else

// The movement of a point by (phi, t, s).
Matrix37 moved(const Eigen::Vector3d& point, const MotionReference& reference) {
  const Eigen::Vector3d arm = point - reference.centre;
  Matrix37 move;
  move << -skew<double>(arm), reference.length * Eigen::Matrix3d::Identity(), arm;
  return move;
}

template <typename Residual>
double weight_of(const RobustLoss& loss, const Residual& residual) {
  return loss.evaluate(residual.squaredNorm())[1];
}

// The normal equations of a frame, and their coupling with the movement of the ground.
struct FrameEquations {
  Matrix6 known = Matrix6::Zero(), attitude = Matrix6::Zero();
  Matrix67 coupling = Matrix67::Zero();
  bool seen = false;
};

class MotionSummation {
 public:
  MotionSummation(const TileProblem& problem, const TileState& state, const MotionReference& reference)
      : problem_(problem), state_(state), reference_(reference), frames_(problem.frames.size()) {}

  // Collects the equations of all frames, then eliminates each of them. Frames that no image observes tell nothing.
  CommonMotion run() {
    add_images();
    add_priors();
    for (std::size_t f = 0; f < frames_.size(); ++f)
      if (frames_[f].seen) eliminate(frames_[f], state_.frames[f]);
    return sums_;
  }

 private:
  void add_images() {
    for (std::int64_t p = 0; p < problem_.point_count(); ++p) {
      const auto point = static_cast<std::size_t>(p);
      if (!problem_.active(p) || !state_.points[point].allFinite()) continue;
      const Matrix37 move = moved(state_.points[point], reference_);
      for (auto row = static_cast<std::size_t>(problem_.begin[point]);
           row < static_cast<std::size_t>(problem_.begin[point + 1]); ++row)
        if (problem_.kept[row]) add_image(row, state_.points[point], move);
    }
  }
  // A_X S_X: the derivative by the point times its movement. The products with B give R_f, W_f and M.
  void add_image(std::size_t row, const Eigen::Vector3d& point, const Matrix37& move) {
    const TileImage& image = problem_.images[static_cast<std::size_t>(problem_.image[row].value)];
    const auto frame = static_cast<std::size_t>(image.frame.value);
    const ImageResidual r = linearise_image(state_.frames[frame], state_.mounts[static_cast<std::size_t>(image.mount)],
                                            state_.cameras[static_cast<std::size_t>(image.camera.value)], point,
                                            {problem_.x[row], problem_.y[row]}, problem_.inverse_sigma[row]);
    if (!r.in_front) return;
    const double weight = weight_of(problem_.image_loss, r.residual);
    const Eigen::Matrix<double, 2, 7> by_motion = r.by_point * move;
    FrameEquations& equations = frames_[frame];
    equations.known += weight * r.by_frame.transpose() * r.by_frame;
    equations.coupling += weight * r.by_frame.transpose() * by_motion;
    motion_ += weight * by_motion.transpose() * by_motion;
    equations.seen = true;
  }
  void add_priors() {
    // Positions, lines and verticals stay where they are when the ground moves. They act on the response of the frame
    // alone.
    for (const auto& term : problem_.positions) {
      const auto frame = static_cast<std::size_t>(term.frame.value);
      const FrameResidual3 r = linearise_position(state_.frames[frame], prior_of(term, state_));
      frames_[frame].known += weight_of(loss_of(problem_, term), r.residual) * r.by_frame.transpose() * r.by_frame;
    }
    for (const auto& term : problem_.lines) {
      const auto frame = static_cast<std::size_t>(term.frame.value);
      const LineResidual r =
          linearise_line(state_.frames[frame], state_.frames[static_cast<std::size_t>(term.seen_by().value)], term);
      // Both frames of a horizontal line turn alike in a common rotation.
      const Eigen::Matrix<double, 1, 6> together = r.by_frame + r.by_other;
      const double weight = problem_.line_loss.evaluate(r.residual * r.residual)[1];
      frames_[frame].known += weight * together.transpose() * together;
    }
    for (const auto& term : problem_.verticals) {
      const auto frame =
          static_cast<std::size_t>(problem_.images[static_cast<std::size_t>(term.image.value)].frame.value);
      const VerticalResidual r = linearise_vertical(problem_, state_, term);
      frames_[frame].known += weight_of(problem_.vertical_loss, r.residual) * r.by_frame.transpose() * r.by_frame;
    }
    for (const auto& term : problem_.attitudes) {
      const auto frame = static_cast<std::size_t>(term.frame.value);
      const FrameResidual3 r = linearise_attitude(state_.frames[frame], prior_of(term, state_));
      frames_[frame].attitude += weight_of(loss_of(problem_, term), r.residual) * r.by_frame.transpose() * r.by_frame;
    }
    // A control point resists the movement of the ground itself: (S_X / sigma)'(S_X / sigma) is added to M.
    for (const auto& term : problem_.point_priors) {
      if (!problem_.active(term.point.value)) continue;
      const Eigen::Vector3d& point = state_.points[static_cast<std::size_t>(term.point.value)];
      const Matrix37 r = term.sigma.cwiseInverse().asDiagonal() * moved(point, reference_);
      motion_ += weight_of(loss_of(problem_, term), point_prior_residual(point, term)) * r.transpose() * r;
    }
    sums_.known = sums_.all = motion_;
  }

  // R^-1 W, computed with R scaled to a unit diagonal. Along a direction that its images do not determine, a frame does
  // not respond to the movement.
  static Matrix67 solved(const Matrix6& normal, const Matrix67& coupling) {
    const Eigen::Matrix<double, 6, 1> scale =
        normal.diagonal().unaryExpr([](double d) { return d > 0 ? 1 / std::sqrt(d) : 0.0; });
    const Matrix6 unit = scale.asDiagonal() * normal * scale.asDiagonal();
    constexpr double kUndetermined = 1e-14;
    const Matrix6 ridged = unit + kUndetermined * Matrix6::Identity();
    return scale.asDiagonal() * ridged.ldlt().solve(scale.asDiagonal() * coupling);
  }
  void eliminate(const FrameEquations& frame, const Pose& pose) {
    // M - W'R^-1 W: the frame responds so that its residuals grow least.
    sums_.known -= frame.coupling.transpose() * solved(frame.known, frame.coupling);
    const Matrix67 followed = solved(frame.known + frame.attitude, frame.coupling);
    sums_.all -= frame.coupling.transpose() * followed;
    sums_.answer -= followed.topRows<3>();
    const Eigen::Vector3d place = pose.centre - reference_.centre;
    sums_.frames += 1;
    sums_.places += place;
    sums_.squared_places += place * place.transpose();
  }

  const TileProblem& problem_;
  const TileState& state_;
  const MotionReference& reference_;
  std::vector<FrameEquations> frames_;
  CommonMotion::Matrix7 motion_ = CommonMotion::Matrix7::Zero();
  CommonMotion sums_;
};

// Eigenvalues mu of G v = mu G_a v, ascending, and vectors with v'G_a v = 1.
struct Shares {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};
Shares shares_of(const CommonMotion& motion) {
  // G_a = V D V'. With v = V D^-1/2 u the problem G v = mu G_a v becomes an ordinary one for u, and v'G_a v = u'u = 1.
  const SymmetricEigen all = symmetric_eigen(0.5 * (motion.all + motion.all.transpose()));
  constexpr double kNothing = 1e-15;
  const double least = kNothing * std::max(all.values(6), 0.0);
  const Eigen::VectorXd scale =
      all.values.unaryExpr([&](double value) { return value > least ? 1 / std::sqrt(value) : 0.0; });
  const Eigen::MatrixXd whiten = all.vectors * scale.asDiagonal();
  Eigen::MatrixXd known = whiten.transpose() * motion.known * whiten;
  for (int i = 0; i < 7; ++i)
    if (scale(i) == 0) known(i, i) = 1;  // a direction of the datum, which is judged elsewhere (datum.h)
  const SymmetricEigen shares = symmetric_eigen(0.5 * (known + known.transpose()));
  return {shares.values, whiten * shares.vectors};
}

// The line through the frames, if they lie on one; otherwise zero.
struct PlaceLine {
  Eigen::Vector3d direction = Eigen::Vector3d::Zero(), middle = Eigen::Vector3d::Zero();  // middle: relative to c
};
PlaceLine line_of(const CommonMotion& motion) {
  if (motion.frames < 2) return {};
  PlaceLine line;
  line.middle = motion.places / motion.frames;
  const auto direction = straight_line(motion.squared_places - motion.frames * line.middle * line.middle.transpose());
  if (!direction) return {};
  line.direction = *direction;
  return line;
}

}  // namespace

// The frames are read twice: for counts and means, then for the rms distances from these.
std::vector<MotionReference> motion_references(const Block& block, const Tiles& tiles) {
  std::vector<MotionReference> references;
  std::vector<double> positions, attitudes;
  const auto visit = [&](auto&& use) {
    for (FrameIndex f(0); block.frames.contains(f); ++f.value)
      if (const std::int32_t c = tiles.component[f]; c >= 0) {
        const auto part = static_cast<std::size_t>(c);
        if (part >= references.size())
          references.resize(part + 1), positions.resize(part + 1), attitudes.resize(part + 1);
        use(block.frames[f], part);
      }
  };
  visit([&](const Frame& frame, std::size_t part) {
    attitudes[part] += frame.attitude_prior.has_value();
    if (!frame.position_prior) return;
    positions[part] += 1;
    references[part].centre += frame.position_prior->position;
  });
  for (std::size_t part = 0; part < references.size(); ++part) {
    references[part].length = 0;
    if (positions[part] > 0) references[part].centre /= positions[part];
  }
  visit([&](const Frame& frame, std::size_t part) {
    if (frame.position_prior && positions[part] >= 2 && attitudes[part] > 0)
      references[part].length += (frame.position_prior->position - references[part].centre).squaredNorm();
  });
  for (std::size_t part = 0; part < references.size(); ++part)
    if (references[part].length > 0) references[part].length = std::sqrt(references[part].length / positions[part]);
  return references;
}

void CommonMotion::add(const CommonMotion& other) {
  known += other.known;
  all += other.all;
  answer += other.answer;
  frames += other.frames;
  places += other.places;
  squared_places += other.squared_places;
}

// A list of numbers for files and messages; from_values() reads them in the same order.
std::vector<double> CommonMotion::to_values() const {
  std::vector<double> values{frames};
  const auto append = [&](const auto& matrix) {
    values.insert(values.end(), matrix.data(), matrix.data() + matrix.size());
  };
  append(known), append(all), append(answer), append(places), append(squared_places);
  return values;
}

CommonMotion CommonMotion::from_values(const std::vector<double>& values) {
  CommonMotion motion;
  motion.frames = values.at(0);
  const double* next = values.data() + 1;
  const auto take = [&](auto& matrix) {
    std::copy(next, next + matrix.size(), matrix.data());
    next += matrix.size();
  };
  take(motion.known), take(motion.all), take(motion.answer), take(motion.places), take(motion.squared_places);
  return motion;
}

CommonMotion common_motion(const TileProblem& problem, const TileState& state, const MotionReference& reference) {
  return MotionSummation(problem, state, reference).run();
}

MotionVerdict judge(const CommonMotion& motion, const MotionReference& reference) {
  MotionVerdict verdict;
  if (reference.length <= 0 || motion.frames < 2) return verdict;
  const Shares shares = shares_of(motion);
  const auto sigma_of = [&](const Eigen::VectorXd& one_sigma) {
    return (motion.answer * one_sigma).norm() / motion.frames;
  };
  for (int i = 0; i < 7 && shares.values(i) < kHalf; ++i) {
    ++verdict.weak;
    // The eigenvalues ascend: the weak directions are the first ones. v has the length of one sigma of m.
    verdict.common_sigma_rad = std::max(verdict.common_sigma_rad, sigma_of(shares.vectors.col(i)));
  }
  const PlaceLine line = line_of(motion);
  if (verdict.weak == 0 || line.direction.isZero()) return verdict;
  Eigen::Matrix<double, 7, 1> turn;
  // The rotation about a line through c + middle: phi = u, L t = -u x middle, so that points on the line stay.
  turn << line.direction, -line.direction.cross(line.middle) / reference.length, 0;
  // The share of the rotation about the line: its information without and with the attitude priors.
  const double all = turn.dot(motion.all * turn), known = turn.dot(motion.known * turn);
  verdict.collinear = known < kHalf * all;
  if (!verdict.collinear) return verdict;
  verdict.line = line.direction;
  verdict.line_sigma_rad = sigma_of(turn / std::sqrt(all));
  return verdict;
}

std::vector<std::string> describe(const MotionVerdict& verdict) {
  const auto degrees = [](double sigma_rad) { return sigma_rad * kDegreesPerRadian; };
  std::vector<std::string> lines;
  if (verdict.collinear)
    lines.push_back(
        fmt::format("the positions lie on one straight line: mainly the attitude priors determine the rotation about "
                    "it (sigma {:.2g} degrees); add a control point away from the line, or a cross strip",
                    degrees(verdict.line_sigma_rad)));
  if (verdict.weak_common_rotation())
    lines.push_back(
        fmt::format("a common rotation of all frames is known mainly from the attitude priors (sigma {:.2g} degrees; "
                    "{} of the 7 parameters of rotation, shift and scale of the block depend{} on them); more tie "
                    "points do not help, add control points",
                    degrees(verdict.common_sigma_rad), verdict.weak - (verdict.collinear ? 1 : 0),
                    verdict.weak - (verdict.collinear ? 1 : 0) == 1 ? "s" : ""));
  return lines;
}

}  // namespace megablock
