// The points of a cell are worked on in batches of whole points, with about 64 observations (ObservationLanes::kUsual),
// so that everything stays in the first-level cache. A track of more observations is a batch of its own. linearise()
// goes through these stages, and each kernel (point_kernels.h) does one of them for the whole batch:
//
//     add_observations, lanes_.linearise   r, u, J_p of each observation
//     weigh                                weights of the loss; other camera models and shared unknowns one by one
//     normal                               records V, b, u of each observation
//     merge                                records of each group, where a frame has several observations of a point
//     sum_up                               V and b of each point, with its prior
//     factorise                            C^-1, z = C^-1 b and C^-T z of each point; vanished pivots are held
//
// reduce() then makes Y and the sums of the frames (sweep up, covariances), or steps() the steps of the points (sweep
// down). Where all observations of a batch have a frame of their own, the record of an observation is that of its
// group.
#include "merge/tile/point_equations.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "adjust/terms/prior_loss.h"
#include "merge/plan/unknowns.h"

namespace megablock {

// A calibration is a camera in a mount, where at least one of them is free. Images of all frames share its sums of
// J_s'J_s.
std::vector<ImageUnknowns> image_unknowns(const TileProblem& problem, const TilePlan& plan,
                                          const std::vector<LaneView>& views) {
  std::vector<ImageUnknowns> list;
  std::map<std::pair<std::int64_t, std::int64_t>, std::int64_t> calibrations;
  list.reserve(problem.images.size());
  for (const TileImage& image : problem.images) {
    ImageUnknowns u;
    u.frame = plan.unknown_of_frame[at(image.frame.value)];
    u.camera = plan.unknown_of_camera[at(image.camera.value)];
    u.mount = plan.unknown_of_mount[at(image.mount)];
    if (u.camera >= 0) u.free = plan.camera_free[at(image.camera.value)];
    u.camera_width = count_of(u.free);
    u.shared_width = u.camera_width + (u.mount >= 0 ? 6 : 0);
    u.plain = u.shared_width == 0 && views[list.size()].simple;
    if (u.shared_width > 0)
      u.calibration =
          calibrations.try_emplace({u.camera, u.mount}, static_cast<std::int64_t>(calibrations.size())).first->second;
    list.push_back(u);
  }
  return list;
}

std::vector<std::int64_t> prior_rows(const TileProblem& problem) {
  std::vector<std::int64_t> rows(problem.points.size(), -1);
  for (std::size_t i = 0; i < problem.point_priors.size(); ++i)
    rows[at(problem.point_priors[i].point.value)] = static_cast<std::int64_t>(i);
  return rows;
}

// Frames get eight values each, so that the kernels read whole vectors; the last two are zero.
UnknownMotions::UnknownMotions(const TilePlan& plan, const double* x)
    : x_(x), offsets_(row_offsets(plan.unknowns)), frames_(plan.unknowns.size()) {
  for (std::size_t u = 0; u < frames_.size(); ++u)
    if (plan.unknowns[u].id.kind == UnknownKind::kFrame) std::copy_n(x + offsets_[u], 6, frames_[u].begin());
}

namespace {

// The kernels of the same width as those of the lanes.
const point_kernels::Kernels& point_kernels_of_processor() {
  const lane_kernels::Kernels* kernels = &lane_kernels_of_processor();
  return kernels == lane_kernels_of_width(8)   ? point_kernels::kAvx512
         : kernels == lane_kernels_of_width(4) ? point_kernels::kAvx2
                                               : point_kernels::kPortable;
}

}  // namespace

using lane_kernels::kResidual;
using point_kernels::kB;
using point_kernels::kPointB;
using point_kernels::kPointInverse;
using point_kernels::kPointOwnStep;
using point_kernels::kPointV;
using point_kernels::kPointValueCount;
using point_kernels::kRecordSize;
using point_kernels::kV;
using point_kernels::kYSize;

PointTables::PointTables(const TileProblem& problem, const TilePlan& plan, const TileState& state)
    : images(problem, state), unknowns(image_unknowns(problem, plan, images.lanes)), prior(prior_rows(problem)) {
  frames.reserve(unknowns.size());
  for (const ImageUnknowns& u : unknowns) frames.push_back(static_cast<std::int32_t>(u.frame));
}

PointEquations::PointEquations(const TileProblem& problem, const TileState& state, const PointTables& tables)
    : problem_(problem),
      state_(state),
      kernels_(&point_kernels_of_processor()),
      usual_squares_(end_of_squares(problem.image_loss)),
      views_(tables.images.views),
      lane_views_(tables.images.lanes),
      unknowns_(tables.unknowns),
      frames_(tables.frames),
      prior_(tables.prior) {
  // The buffers are made once, with room for the longest track of the tile.
  int widest = 0;
  for (const ImageUnknowns& u : unknowns_) widest = std::max(widest, u.shared_width);
  all_plain_ = std::ranges::all_of(unknowns_, &ImageUnknowns::plain);
  std::int64_t room = ObservationLanes::kUsual;
  for (std::int64_t p = 0; p < problem.point_count(); ++p)
    room = std::max(room, problem.begin[at(p + 1)] - problem.begin[at(p)]);
  lanes_.reserve(room);
  room = lanes_.capacity();
  rows_.resize(at(room));
  lane_unknowns_.resize(at(room));
  shared_rows_.resize(at(room));
  squares_.resize(at(room));
  group_of_lane_.resize(at(room));
  group_frames_.resize(at(room));
  step_of_group_.resize(at(room));
  frame_sums_.resize(at(room));
  motions_.resize(at(room));
  begin_.resize(at(room + 1));
  y_.resize(room * kYSize);
  moved_.resize(room * 3);
  point_values_.resize(room * kPointValueCount);
  for (AlignedValues* records : {&records_, &sums_, &steps_}) records->resize(room * kRecordSize);
  store_.resize(at(room * 11 * widest));  // J_s, W_sk, W_s and Y
}

constexpr std::size_t kAhead = 8;  // points

std::size_t PointEquations::linearise(std::span<const std::int32_t> points, const Sweep& sweep) {
  clear();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::int64_t point = points[i];
    if (i + kAhead < points.size()) fetch_ahead(points[i + kAhead]);
    const std::int64_t more = problem_.begin[at(point + 1)] - problem_.begin[at(point)];
    // `more` counts rejected observations too: whether a batch is full is known without reading their flags.
    const bool room = lanes_.size() + more <= ObservationLanes::kUsual && std::ssize(points_) < lanes_.capacity();
    if (!points_.empty() && !room) break;
    add_observations(point);
  }
  lanes_.linearise();
  for (Point& point : points_) weigh(point, sweep.curvature);
  kernels_->normal(lanes_.values(), lanes_.capacity(), lanes_.padded_size(), records_.data());
  if (groups_ < lanes_.size()) kernels_->merge(lanes_.size(), group_of_lane_.data(), records_.data());
  sum_up(sweep.curvature);
  kernels_->factorise(padded_points(), sweep.lambda, kPivotTolerance * (1 + sweep.lambda), sums_.data(),
                      {point_values_.data(), lanes_.capacity()}, steps_.data());
  return points_.size();
}

void PointEquations::clear() {
  points_.clear();
  lanes_.clear();
  groups_ = 0;
  shared_.clear();
  taken_ = 0;
}

double* PointEquations::take(int count) {
  double* first = store_.data() + taken_;
  taken_ += static_cast<std::size_t>(count);
  return first;
}

// Fetches the observations of a point ahead of their use. The points of a cell lie apart from each other in memory, and
// the processor does not foresee which one is next.
void PointEquations::fetch_ahead(std::int64_t point) const {
  const std::size_t row = at(problem_.begin[at(point)]);
  if (row >= problem_.image.size()) return;
  __builtin_prefetch(&problem_.image[row]);
  __builtin_prefetch(&problem_.kept[row]);
  __builtin_prefetch(&problem_.x[row]);
  __builtin_prefetch(&problem_.y[row]);
  __builtin_prefetch(&problem_.inverse_sigma[row]);
  __builtin_prefetch(&state_.points[at(point)]);
}

void PointEquations::add_observations(std::int64_t point) {
  Point& added = points_.emplace_back();
  added.point = point;
  added.first = lanes_.size();
  added.first_group = groups_;
  const std::int64_t begin = problem_.begin[at(point)], end = problem_.begin[at(point + 1)];
  std::int64_t* rows = rows_.data() + added.first;
  // The loop has no branch: each row is written, and the place moves on only behind a kept one.
  const std::uint8_t* kept = problem_.kept.data();
  std::int64_t count = 0;
  for (std::int64_t row = begin; row < end; ++row) {
    rows[count] = row;
    count += kept[row];
  }
  if (!add_lanes(added.first, count, state_.points[at(point)])) {
    // Add them once more in the order of frames, so that the observations of one frame follow each other.
    const auto frame_of_row = [&](std::int64_t row) { return frames_[at(problem_.image[at(row)].value)]; };
    std::sort(rows, rows + count, [&](std::int64_t a, std::int64_t b) {
      return std::pair(frame_of_row(a), a) < std::pair(frame_of_row(b), b);
    });
    lanes_.clear_from(added.first);
    groups_ = added.first_group;
    add_lanes(added.first, count, state_.points[at(point)]);
  }
  added.last = lanes_.size();
  added.last_group = groups_;
}

// Adds the observations of the last point, whose rows are in rows_. Observations of one frame that follow each other
// form a group. The loop has no branch for it, because the processor could not predict it. Returns whether
// the frames are in ascending order.
bool PointEquations::add_lanes(std::int64_t first, std::int64_t count, const Eigen::Vector3d& point) {
  const double* step = steps_.data() + (std::ssize(points_) - 1) * kRecordSize;
  std::int64_t group = groups_ - 1;
  std::int32_t last = -1;
  bool ascending = true;
  for (std::int64_t lane = first; lane < first + count; ++lane) {
    const std::int64_t row = rows_[at(lane)], image = problem_.image[at(row)].value;
    const std::int32_t frame = frames_[at(image)];
    group += frame != last;
    ascending &= frame >= last;
    last = frame;
    lane_unknowns_[at(lane)] = &unknowns_[at(image)];
    group_of_lane_[at(lane)] = group;
    group_frames_[at(group)] = frame;
    step_of_group_[at(group)] = step;
    lanes_.add(lane_views_[at(image)], point, problem_.x[at(row)], problem_.y[at(row)],
               problem_.inverse_sigma[at(row)]);
  }
  groups_ = group + 1;
  return ascending;
}

// Sums rho and rho' |r|^2 of the point, and weighs its observations where the loss asks for it. Nearly all points have
// no observation in the tail, and the kernels have done everything for them.
void PointEquations::weigh(Point& point, bool curvature) {
  point.residual_count = 2 * point.observation_count();
  point.shared_begin = std::ssize(shared_);
  if (all_plain_) {
    const double* residual = lanes_.values() + kResidual * lanes_.capacity();
    double sum = 0;
    bool usual = true;
    for (std::int64_t lane = point.first; lane < point.last; ++lane) {
      const double x = residual[lane], y = residual[lane + lanes_.capacity()], squares = x * x + y * y;
      sum += squares;
      usual &= squares <= usual_squares_;
    }
    if (usual) {  // the usual case: all that remains is to add up
      point.rho = point.weighted_squares = sum;
      point.shared_end = point.shared_begin;
      return;
    }
  }
  weigh_each(point, curvature);
  point.shared_end = std::ssize(shared_);
}

void PointEquations::weigh_each(Point& point, bool curvature) {
  for (std::int64_t lane = point.first; lane < point.last; ++lane) {
    const ImageUnknowns& unknowns = unknowns_of(lane);
    const double squares = lanes_.residual(lane).squaredNorm();
    if (!unknowns.plain || !std::isfinite(squares)) {
      linearise_lane(point, lane, curvature);
    } else if (!problem_.image_loss.squares(squares)) {
      weigh_lane(point, lane, curvature);
    } else {
      point.rho += squares;
      point.weighted_squares += squares;
    }
  }
}

// Weighs an observation in the tail of the loss.
void PointEquations::weigh_lane(Point& point, std::int64_t lane, bool curvature) {
  const Eigen::Vector2d residual = lanes_.residual(lane);
  const double squares = residual.squaredNorm();
  const LossWeight weight(problem_.image_loss, squares, curvature);
  point.rho += weight.rho;
  point.weighted_squares += weight.first * squares;
  lanes_.set(lane, weight.residual_scale * residual, lanes_.from_frame(lane),
             weight.weighted(lanes_.by_point(lane), residual));
}

// Linearises an observation whose camera model or shared unknowns the kernels do not have. It goes through the same
// formulas (adjust/terms/linearise.h) for this observation alone, and overwrites its lane. An observation that is not
// finite comes here too, and is refused.
void PointEquations::linearise_lane(Point& point, std::int64_t lane, bool curvature) {
  const std::int64_t row = rows_[at(lane)], image = problem_.image[at(row)].value;
  const ImageView& view = views_[at(image)];
  const ImageUnknowns& unknowns = unknowns_of(lane);
  CameraResidual r;
  if (!linearise_in_camera(view, state_.points[at(point.point)], {problem_.x[at(row)], problem_.y[at(row)]},
                           problem_.inverse_sigma[at(row)], unknowns.camera >= 0, r))
    throw ComputeError("a kept observation of point " + std::to_string(problem_.points[at(point.point)].index) +
                       " lies behind image " + std::to_string(problem_.images[at(image)].image.value));
  const double squares = r.residual.squaredNorm();
  if (!std::isfinite(squares))  // a NaN pivot would look like a direction that nothing observes
    throw ComputeError("the observation of point " + std::to_string(problem_.points[at(point.point)].index) +
                       " in image " + std::to_string(problem_.images[at(image)].image.value) +
                       " or its sigma is not a finite number");
  const LossWeight weight(problem_.image_loss, squares, curvature);
  point.rho += weight.rho;
  point.weighted_squares += weight.first * squares;
  if (weight.root != 1) {
    r.by_camera = weight.weighted(r.by_camera, r.residual);
    if (unknowns.camera >= 0) r.by_intrinsics = weight.weighted(r.by_intrinsics, r.residual);
  }
  lanes_.set(lane, weight.residual_scale * r.residual, r.from_frame, r.by_camera * view.rotation);
  if (unknowns.shared_width > 0) add_shared(unknowns, view, r, lane, point);
}

// J_s of the free parameters of the camera, then of the mount, and W_sk. Both stay until the next batch, for the front
// and for redundancy numbers.
void PointEquations::add_shared(const ImageUnknowns& unknowns, const ImageView& view, const CameraResidual& r,
                                std::int64_t lane, Point& point) {
  const int width = unknowns.shared_width;
  double* rows = take(2 * width);
  Eigen::Map<Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>> jacobian(rows, 2, width);
  int column = 0;
  for (int k = 0; column < unknowns.camera_width; ++k)
    if (contains(unknowns.free, k)) jacobian.col(column++) = r.by_intrinsics.col(k);
  if (unknowns.mount >= 0) jacobian.rightCols<6>() = by_mount(view, r);

  // W_sk = J_sk'J_pk, [width x 3] column by column.
  double* w = take(3 * width);
  const Eigen::Matrix<double, 2, 3> by_point = lanes_.by_point(lane);
  for (int j = 0; j < 3; ++j) {
    const double first = by_point(0, j), second = by_point(1, j);
    for (int i = 0; i < width; ++i) w[i + j * width] = rows[i] * first + rows[i + width] * second;
  }
  shared_rows_[at(lane)] = {rows, w};
  if (unknowns.camera >= 0) add_to_shared(unknowns.camera, unknowns.camera_width, w, width, point);
  if (unknowns.mount >= 0) add_to_shared(unknowns.mount, 6, w + unknowns.camera_width, width, point);
}

// Adds W_sk to W_s of this camera or mount: the point may have several observations of it.
void PointEquations::add_to_shared(std::int64_t unknown, int dimension, const double* w, int rows, Point& point) {
  std::size_t slot = at(point.shared_begin);  // a point has a few of them at most
  while (slot < shared_.size() && shared_[slot].unknown != unknown) ++slot;
  if (slot == shared_.size()) {
    shared_.push_back({unknown, dimension, take(3 * dimension), take(3 * dimension)});
    std::fill_n(shared_.back().w, 3 * dimension, 0.0);
  }
  double* sum = shared_[slot].w;
  for (int j = 0; j < 3; ++j)
    for (int i = 0; i < dimension; ++i) sum[i + j * dimension] += w[i + j * rows];
}

// Sums V and b of the points, and adds their priors.
void PointEquations::sum_up(bool curvature) {
  for (std::size_t i = 0; i < points_.size(); ++i) begin_[i] = points_[i].first_group;
  begin_[points_.size()] = groups_;
  kernels_->sum(std::ssize(points_), begin_.data(), records_.data(), sums_.data());
  std::fill(sums_.data() + std::ssize(points_) * kRecordSize, sums_.data() + padded_points() * kRecordSize, 0.0);
  for (std::size_t i = 0; i < points_.size(); ++i)
    if (prior_[at(points_[i].point)] >= 0) add_prior(i, curvature);
}

void PointEquations::add_prior(std::size_t i, bool curvature) {
  Point& point = points_[i];
  const auto& term = problem_.point_priors[at(prior_[at(point.point)])];
  const Eigen::Vector3d inverse_sigma = term.sigma.cwiseInverse();  // 0 on a free axis
  const Eigen::Vector3d r = point_prior_residual(state_.points[at(point.point)], term);
  const LossWeight weight(loss_of(problem_, term), r.squaredNorm(), curvature);
  const Eigen::Matrix3d jacobian = weight.weighted(Eigen::Matrix3d(inverse_sigma.asDiagonal()), r);
  const Eigen::Matrix3d v = jacobian.transpose() * jacobian;
  const Eigen::Vector3d b = -weight.residual_scale * (jacobian.transpose() * r);
  double* sums = sums_.data() + static_cast<std::int64_t>(i) * kRecordSize;
  int entry = kV;  // of the lower triangle, row by row
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column <= row; ++column) sums[entry++] += v(row, column);
    sums[kB + row] += b[row];
  }
  point.rho += weight.rho;
  point.weighted_squares += weight.first * r.squaredNorm();
  point.residual_count += (inverse_sigma.array() > 0).count();
}

// Kernels work on whole groups of lanes. The lanes behind the last group of observations add to a sum that nobody
// reads.
void PointEquations::reduce(std::vector<FrameSum>& sums) {
  FrameSum unused;
  const std::int64_t padded = lane_kernels::padded(groups_);
  std::fill(step_of_group_.begin() + groups_, step_of_group_.begin() + padded, steps_.data());
  for (std::int64_t group = 0; group < padded; ++group)
    frame_sums_[at(group)] = group < groups_ ? sums[at(frame_of(group))].values.data() : unused.values.data();
  kernels_->reduce(records_.data(), padded, step_of_group_.data(), y_.data(), frame_sums_.data());
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Point& point = points_[i];
    for (std::int64_t k = point.shared_begin; k < point.shared_end; ++k) {
      const SharedPart& part = shared_[at(k)];
      Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 3>>(part.y, part.dimension, 3).noalias() =
          Rows3(part.w, part.dimension, 3).lazyProduct(inverse_factor(i).transpose());
    }
  }
}

void PointEquations::steps(const UnknownMotions& motions, std::vector<Eigen::Vector3d>& out) {
  // b - sum W_i'x_i: the frames by the kernel, V_f G x_f = -V_f (u x w + t), the shared unknowns here.
  const std::int64_t padded = lane_kernels::padded(groups_);
  for (std::int64_t group = 0; group < padded; ++group)
    motions_[at(group)] = motions.of_frame(frame_of(std::min(group, groups_ - 1)));
  kernels_->move(records_.data(), padded, motions_.data(), moved_.data(), lanes_.capacity());
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Point& point = points_[i];
    std::array<double, 3> rest{};
    for (std::int64_t group = point.first_group; group < point.last_group; ++group)  // -G x_f = u x w + t
      for (int k = 0; k < 3; ++k) rest[at(k)] += moved_.data()[k * lanes_.capacity() + group];
    for (std::int64_t s = point.shared_begin; s < point.shared_end; ++s) {
      const SharedPart& part = shared_[at(s)];
      const double* x = motions.of(part.unknown);
      for (int k = 0; k < 3; ++k)
        for (int j = 0; j < part.dimension; ++j) rest[at(k)] -= part.w[k * part.dimension + j] * x[j];
    }
    for (int k = 0; k < 3; ++k) point_value(kPointB + k, i) += rest[at(k)];
  }
  kernels_->solve(padded_points(), {point_values_.data(), lanes_.capacity()});
  for (std::size_t i = 0; i < points_.size(); ++i)
    for (int k = 0; k < 3; ++k) out[at(points_[i].point)][k] = point_value(kPointOwnStep + k, i);
}

// The measured coordinates are still in the lanes. Observations of other camera models are projected one by one
// afterwards, as in the sweep up.
std::span<const double> PointEquations::squares_of(const SeenImages& images,
                                                   const std::vector<Eigen::Vector3d>& points) {
  bool simple = true;
  for (const Point& point : points_) {
    const Eigen::Vector3d& position = points[at(point.point)];
    for (std::int64_t lane = point.first; lane < point.last; ++lane) {
      const LaneView& view = images.lanes[at(problem_.image[at(rows_[at(lane)])].value)];
      lanes_.see(lane, view, position);
      simple &= view.simple;
    }
  }
  lanes_.project();
  const double *x = lanes_.values() + kResidual * lanes_.capacity(), *y = x + lanes_.capacity();
  for (std::int64_t lane = 0; lane < lanes_.size(); ++lane) squares_[at(lane)] = x[lane] * x[lane] + y[lane] * y[lane];
  for (const Point& point : points_) {
    for (std::int64_t lane = point.first; lane < point.last && !simple; ++lane) {
      const std::size_t row = at(rows_[at(lane)]), image = at(problem_.image[row].value);
      if (images.lanes[image].simple) continue;
      squares_[at(lane)] =
          (problem_.inverse_sigma[row] *
           images.views[image].difference_px(points[at(point.point)], {problem_.x[row], problem_.y[row]}))
              .squaredNorm();
    }
  }
  return {squares_.data(), at(lanes_.size())};
}

Eigen::Matrix3d PointEquations::inverse_factor(std::size_t i) const {
  Eigen::Matrix3d result;
  const auto value = [&](int k) { return point_value(kPointInverse + k, i); };
  result << value(0), 0, 0, value(1), value(2), 0, value(3), value(4), value(5);
  return result;
}

Eigen::Vector3d PointEquations::diagonal(std::size_t i) const {
  return {point_value(kPointV, i), point_value(kPointV + 2, i), point_value(kPointV + 5, i)};
}

// One block for each group, not for each observation: a rig's images of a point in one frame share a block.
void PointEquations::blocks(std::size_t i, std::vector<Block>& list) const {
  const Point& point = points_[i];
  list.clear();
  for (std::int64_t group = point.first_group; group < point.last_group; ++group)
    list.push_back({frame_of(group), 6, y(group)});
  for (std::int64_t k = point.shared_begin; k < point.shared_end; ++k)
    list.push_back({shared_[at(k)].unknown, shared_[at(k)].dimension, shared_[at(k)].y});
}

int PointEquations::jacobians(std::int64_t lane, std::array<JacobianBlock<IntrinsicJacobian>, 3>& blocks) const {
  const ImageUnknowns& u = unknowns_of(lane);
  const Eigen::Map<const Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>> shared(
      shared_rows_[at(lane)].jacobian, 2, u.shared_width);
  int count = 0;
  blocks[at(count++)] = {u.frame, by_pose(by_point(lane), from_frame(lane))};
  if (u.camera >= 0) blocks[at(count++)] = {u.camera, shared.leftCols(u.camera_width)};
  if (u.mount >= 0) blocks[at(count++)] = {u.mount, shared.rightCols(6)};
  return count;
}

}  // namespace megablock
