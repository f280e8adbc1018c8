// With right perturbations R_i Exp(w) of the rotations, r = R'ray has the derivatives dr/dw = [r]x and dr/dk = R'
// dray/dk. The mean of a track with rows L_i A_i = U and L_i = H (L_i = B_i^-1) is eliminated by the projector
//
//     J = U - H (H'H)^-1 H'U,    e = L y - H (H'H)^-1 H'L y.
//
// Names in a row: `adjusted` is the pixel m at which the condition is linearised, `whiten` is L = B^-1, and `offset` is
// B (measured - m), so that y = T'R'ray(k, m) + B (measured - m) is the ray of the measured pixel to first order.
//
// The first linked image is held at its rotation, which fixes the panorama frame.
#include "adjust/calibration/panoramic_system.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "geometry/numbers/decompositions.h"
#include "geometry/transform/rotation.h"

namespace megablock {

// All rows of linked images start as kept. Columns are given to linked images in their order, except to the first.
PanoramicSystem::PanoramicSystem(const PanoramicTracks& tracks, const std::vector<std::uint8_t>& linked,
                                 const PanoramicPrior& prior)
    : tracks_(tracks), linked_(linked), prior_(prior), column_of_image_(linked.size(), -1) {
  bool first = true;
  for (std::size_t i = 0; i < linked.size(); ++i) {
    if (!linked[i]) continue;
    if (!first) {
      column_of_image_[i] = static_cast<int>(rotation_columns_);
      rotation_columns_ += 3;
    }
    first = false;
  }
  rows_.resize(tracks.image.size());
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    rows_[r].adjusted = tracks.pixel[r];
    rows_[r].kept = linked[static_cast<std::size_t>(tracks.image[r])] != 0;
  }
  planes_.resize(static_cast<std::size_t>(track_count()));
}

// A track with one row has no condition.
std::vector<std::int64_t> PanoramicSystem::kept_in(std::int64_t track) const {
  std::vector<std::int64_t> rows;
  for (std::int64_t r = tracks_.begin[track]; r < tracks_.begin[track + 1]; ++r)
    if (rows_[r].kept && rows_[r].usable) rows.push_back(r);
  if (rows.size() < 2) rows.clear();
  return rows;
}

void PanoramicSystem::linearise_at(const PanoramicState& state) {
  for (std::int64_t t = 0; t < track_count(); ++t) linearise_track(t, state);
}

// Finds, for every row of a track, the pixel m of the mean direction (the adjusted observation), B = T'R' dray/dm
// there, and the offset that takes the measured pixel into account. The tangent basis T of the mean is held until the
// next call.
void PanoramicSystem::linearise_track(std::int64_t track, const PanoramicState& state) {
  const std::int64_t begin = tracks_.begin[track], end = tracks_.begin[track + 1];
  // The mean direction of the kept pixels, or that of all usable rows where fewer than two are kept.
  Eigen::Vector3d kept = Eigen::Vector3d::Zero(), all = kept;
  int kept_count = 0;
  for (std::int64_t r = begin; r < end; ++r) {
    Row& row = rows_[r];
    const auto image = static_cast<std::size_t>(tracks_.image[r]);
    const auto ray = linked_[image] ? viewing_ray(state.camera, tracks_.pixel[r]) : std::nullopt;
    row.usable = ray.has_value();
    if (!row.usable) continue;
    const Eigen::Vector3d direction = state.rotations[image].conjugate() * *ray;
    all += direction;
    if (row.kept) kept += direction, ++kept_count;
  }
  // Rays are compared in the plane that touches the sphere at their mean, where their differences are small.
  const Eigen::Vector3d mean = (kept_count >= 2 ? kept : all).normalized();
  planes_[track] = tangent_plane(mean);
  for (std::int64_t r = begin; r < end; ++r) {
    Row& row = rows_[r];
    if (!row.usable) continue;
    const Eigen::Quaterniond& rotation = state.rotations[static_cast<std::size_t>(tracks_.image[r])];
    row.adjusted = project(state.camera, rotation * mean);
    RayJacobian ray;
    if (row.adjusted.allFinite()) ray = ray_with_jacobian(state.camera, row.adjusted);
    // The mean may fall where the camera has no pixel. The measured pixel then takes its place.
    if (!ray.valid) {
      row.adjusted = tracks_.pixel[r];
      ray = ray_with_jacobian(state.camera, row.adjusted);
    }
    if (!(row.usable = ray.valid)) continue;
    const Eigen::Matrix2d by_pixel =
        planes_[track].transpose() * rotation.toRotationMatrix().transpose() * ray.by_pixel;
    row.whiten = by_pixel.inverse();
    row.usable = row.whiten.allFinite();
    row.offset = by_pixel * (tracks_.pixel[r] - row.adjusted);
  }
}

bool PanoramicSystem::ray_in_plane(std::int64_t row, const Plane& plane, const PanoramicState& state,
                                   Eigen::Vector2d& y) const {
  const auto ray = viewing_ray(state.camera, rows_[row].adjusted);
  if (!ray) return false;
  const Eigen::Quaterniond& rotation = state.rotations[static_cast<std::size_t>(tracks_.image[row])];
  y = plane.transpose() * (rotation.conjugate() * *ray) + rows_[row].offset;
  return true;
}

// e_i = L_i (y_i - mu), mu = (sum W_i)^-1 sum W_i y_i, W_i = L_i'L_i.
bool PanoramicSystem::residuals_of(const std::vector<std::int64_t>& rows, std::int64_t track,
                                   const PanoramicState& state, std::vector<Eigen::Vector2d>& e) const {
  e.resize(rows.size());
  Eigen::Matrix2d weight = Eigen::Matrix2d::Zero();
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (!ray_in_plane(rows[i], planes_[track], state, e[i])) return false;
    const Eigen::Matrix2d w = rows_[rows[i]].whiten.transpose() * rows_[rows[i]].whiten;
    weight += w;
    sum += w * e[i];
  }
  const Eigen::Vector2d mean = weight.inverse() * sum;
  for (std::size_t i = 0; i < rows.size(); ++i) e[i] = rows_[rows[i]].whiten * (e[i] - mean);
  return true;
}

std::int64_t PanoramicSystem::screen(const PanoramicState& state, double threshold_px) {
  std::int64_t changed = 0;
  std::vector<Eigen::Vector2d> e;
  for (std::int64_t t = 0; t < track_count(); ++t) {
    std::vector<std::int64_t> rows;
    for (std::int64_t r = tracks_.begin[t]; r < tracks_.begin[t + 1]; ++r)
      if (rows_[r].usable) rows.push_back(r);
    // One outlier pulls the mean of a track. Only the worst row is left out before the rest is tested again.
    while (rows.size() >= 2) {
      if (!residuals_of(rows, t, state, e)) {
        rows.clear();
        break;
      }
      std::size_t worst = 0;
      for (std::size_t i = 1; i < e.size(); ++i)
        if (e[i].squaredNorm() > e[worst].squaredNorm()) worst = i;
      if (e[worst].norm() <= threshold_px) break;
      rows.erase(rows.begin() + static_cast<std::ptrdiff_t>(worst));
    }
    if (rows.size() < 2) rows.clear();
    for (std::int64_t r = tracks_.begin[t]; r < tracks_.begin[t + 1]; ++r) {
      const bool keep = std::binary_search(rows.begin(), rows.end(), r);
      changed += keep != rows_[r].kept;
      rows_[r].kept = keep;
    }
  }
  return changed;
}

double PanoramicSystem::prior_cost(const PanoramicState& state) const {
  double sum = 0;
  for (int p = 0; p < state.camera.size(); ++p) {
    const auto k = static_cast<std::size_t>(p);
    if (prior_.sigma[k] > 0) sum += std::pow((state.camera[k] - prior_.value[k]) / prior_.sigma[k], 2);
  }
  // The cost is in px^2, without the sigma of the pixels. The prior must be multiplied by it.
  return sum * prior_.image_sigma_px * prior_.image_sigma_px;
}

double PanoramicSystem::cost(const PanoramicState& state) const {
  double sum = prior_cost(state);
  std::vector<Eigen::Vector2d> e;
  for (std::int64_t t = 0; t < track_count(); ++t) {
    const std::vector<std::int64_t> rows = kept_in(t);
    if (rows.empty()) continue;
    if (!residuals_of(rows, t, state, e)) return std::numeric_limits<double>::infinity();
    for (const Eigen::Vector2d& residual : e) sum += residual.squaredNorm();
  }
  return sum;
}

std::vector<Eigen::Vector2d> PanoramicSystem::residuals(const PanoramicState& state) const {
  std::vector<Eigen::Vector2d> all(rows_.size(), no_pixel()), e;
  for (std::int64_t t = 0; t < track_count(); ++t) {
    const std::vector<std::int64_t> rows = kept_in(t);
    if (rows.empty() || !residuals_of(rows, t, state, e)) continue;
    for (std::size_t i = 0; i < rows.size(); ++i) all[rows[i]] = e[i];
  }
  return all;
}

// The columns of U of a row are those of the free parameters, L T'R' dray/dk, and the three of its image, L T'[r]x. The
// projector removes what the mean direction of the track explains; J'J and J'e are then added at the columns of the
// images.
bool PanoramicSystem::add_track(std::int64_t track, const PanoramicState& state, const std::vector<int>& parameters,
                                Normal& normal) const {
  const std::vector<std::int64_t> rows = kept_in(track);
  if (rows.empty()) return true;
  const auto p = static_cast<Eigen::Index>(parameters.size()), n = static_cast<Eigen::Index>(rows.size());
  const Plane& plane = planes_[track];
  Eigen::MatrixXd u = Eigen::MatrixXd::Zero(2 * n, p + 3 * n);
  Eigen::MatrixXd h(2 * n, 2);
  Eigen::VectorXd e(2 * n);
  std::vector<Eigen::Index> column;
  for (Eigen::Index i = 0; i < p; ++i) column.push_back(i);
  for (Eigen::Index i = 0; i < n; ++i) {
    const std::int64_t r = rows[static_cast<std::size_t>(i)];
    const auto image = static_cast<std::size_t>(tracks_.image[r]);
    const RayJacobian ray = ray_with_jacobian(state.camera, rows_[r].adjusted);
    if (!ray.valid) return false;
    const Eigen::Matrix3d back = state.rotations[image].toRotationMatrix().transpose();
    const Eigen::Vector3d direction = back * ray.ray;
    const Eigen::Matrix2d& whiten = rows_[r].whiten;
    const Eigen::Matrix<double, 2, 3> by_ray = whiten * plane.transpose() * back;
    for (Eigen::Index k = 0; k < p; ++k)
      u.block<2, 1>(2 * i, k) = by_ray * ray.by_intrinsics.col(parameters[static_cast<std::size_t>(k)]);
    u.block<2, 3>(2 * i, p + 3 * i) = whiten * plane.transpose() * skew<double>(direction);
    h.block<2, 2>(2 * i, 0) = whiten;
    e.segment<2>(2 * i) = whiten * (plane.transpose() * direction + rows_[r].offset);
    for (int axis = 0; axis < 3; ++axis)
      column.push_back(column_of_image_[image] < 0 ? -1 : p + column_of_image_[image] + axis);
  }
  const Eigen::Matrix2d weight = inverse(h.transpose() * h);
  u -= h * (weight * (h.transpose() * u)).eval();
  e -= h * (weight * (h.transpose() * e)).eval();
  const Eigen::MatrixXd square = u.transpose() * u;
  const Eigen::VectorXd gradient = u.transpose() * e;
  for (std::size_t a = 0; a < column.size(); ++a) {
    if (column[a] < 0) continue;
    normal.gradient[column[a]] += gradient[static_cast<Eigen::Index>(a)];
    for (std::size_t b = 0; b < column.size(); ++b)
      if (column[b] >= 0)
        normal.matrix(column[a], column[b]) += square(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b));
  }
  normal.cost += e.squaredNorm();
  return true;
}

namespace {

std::vector<int> parameters_in(ParameterMask mask) {
  std::vector<int> list;
  for (int p = 0; p < kMaxIntrinsics; ++p)
    if (contains(mask, p)) list.push_back(p);
  return list;
}

}  // namespace

// N = sum J'J and g = sum J'e over the tracks, plus the priors in px^2. An empty matrix says that a pixel has no ray at
// this state.
PanoramicSystem::Normal PanoramicSystem::normal(const PanoramicState& state, ParameterMask free) const {
  const std::vector<int> parameters = parameters_in(free);
  const std::int64_t size = unknowns(free);
  Normal normal{Eigen::MatrixXd::Zero(size, size), Eigen::VectorXd::Zero(size), prior_cost(state)};
  for (std::int64_t t = 0; t < track_count(); ++t)
    if (!add_track(t, state, parameters, normal)) return {};
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const auto p = static_cast<std::size_t>(parameters[i]);
    if (!(prior_.sigma[p] > 0)) continue;
    const auto column = static_cast<Eigen::Index>(i);
    const double weight = std::pow(prior_.image_sigma_px / prior_.sigma[p], 2);
    normal.matrix(column, column) += weight;
    normal.gradient[column] += weight * (state.camera[p] - prior_.value[p]);
  }
  return normal;
}

// Adds a step: parameters first, then R_i Exp(w_i).
PanoramicState PanoramicSystem::moved(const PanoramicState& state, ParameterMask free,
                                      const Eigen::VectorXd& step) const {
  PanoramicState result = state;
  Eigen::Index column = 0;
  for (const int p : parameters_in(free)) result.camera[static_cast<std::size_t>(p)] += step[column++];
  for (std::size_t i = 0; i < column_of_image_.size(); ++i)
    if (column_of_image_[i] >= 0)
      result.rotations[i] = rotation_update(state.rotations[i], step.segment<3>(column + column_of_image_[i]));
  return result;
}

std::int64_t PanoramicSystem::kept_rows() const {
  std::int64_t count = 0;
  for (std::int64_t t = 0; t < track_count(); ++t) count += std::ssize(kept_in(t));
  return count;
}

std::int64_t PanoramicSystem::kept_tracks() const {
  std::int64_t count = 0;
  for (std::int64_t t = 0; t < track_count(); ++t) count += !kept_in(t).empty();
  return count;
}

std::int64_t PanoramicSystem::unknowns(ParameterMask free) const { return count_of(free) + rotation_columns_; }

// With q = T (y - mu) and n = d x q, a residual along the displacement of s has n'(R_i' - R_mean')s = 0. With a = (R_i
// - R_mean) n this is a's = 0. M = sum aa' is compared with N, the value that follows from the covariance B (I -
// weight) B' of the residuals, by the smallest eigenvalue of M s = lambda N s. The scatter of its own terms shows how
// far this eigenvalue deviates from that of noise, which is the energy per degree of freedom.
Parallax PanoramicSystem::parallax(const PanoramicState& state) const {
  std::vector<Eigen::Vector3d> terms;
  std::vector<Eigen::Matrix3d> expected;
  std::vector<std::size_t> ends;  // ends of the tracks in `terms`; the terms of a track share their noise
  std::vector<Eigen::Vector2d> e;
  double squares = 0, redundancy = 0;
  for (std::int64_t t = 0; t < track_count(); ++t) {
    const std::vector<std::int64_t> rows = kept_in(t);
    if (rows.empty() || !residuals_of(rows, t, state, e)) continue;
    Eigen::Matrix3d mean = Eigen::Matrix3d::Zero();
    Eigen::Matrix2d weight = Eigen::Matrix2d::Zero();
    for (const std::int64_t r : rows) {
      mean += state.rotations[static_cast<std::size_t>(tracks_.image[r])].toRotationMatrix();
      weight += rows_[r].whiten.transpose() * rows_[r].whiten;
    }
    mean /= static_cast<double>(rows.size());
    // The covariance of mu for unit noise: a residual y_i - mu has the covariance B B' - W^-1.
    const Eigen::Matrix2d of_mean = weight.inverse();
    const Plane& plane = planes_[t];
    const Eigen::Vector3d direction = plane.col(0).cross(plane.col(1));
    for (std::size_t i = 0; i < rows.size(); ++i) {
      // B, which takes a residual in pixels back to the tangent plane.
      const Eigen::Matrix2d back = rows_[rows[i]].whiten.inverse();
      const Eigen::Matrix3d turned =
          state.rotations[static_cast<std::size_t>(tracks_.image[rows[i]])].toRotationMatrix() - mean;
      const Eigen::Matrix<double, 3, 2> across = turned * skew<double>(direction) * plane;
      terms.push_back(across * (back * e[i]));
      expected.push_back(across * (back * back.transpose() - of_mean) * across.transpose());
      squares += e[i].squaredNorm();
    }
    ends.push_back(terms.size());
    redundancy += 2 * static_cast<double>(rows.size()) - 2;
  }
  Parallax result;
  if (terms.empty() || !(squares > 0)) return result;
  Eigen::Matrix3d m = Eigen::Matrix3d::Zero(), n = m;
  for (std::size_t i = 0; i < terms.size(); ++i) {
    m += terms[i] * terms[i].transpose();
    n += expected[i];
  }
  // For a camera turned about one axis, a displacement along that axis has no effect.
  const SymmetricEigen scale = symmetric_eigen(n);
  Eigen::Index told = 0;
  while (told < 3 && scale.values[2 - told] > 1e-4 * scale.values[2]) ++told;
  const Eigen::MatrixXd root =
      scale.vectors.rightCols(told) * scale.values.tail(told).cwiseSqrt().cwiseInverse().asDiagonal();
  const SymmetricEigen energy = symmetric_eigen(root.transpose() * m * root);
  const Eigen::Vector3d s = root * energy.vectors.col(0);
  const double noise = squares / redundancy, across = energy.values[0];
  double scatter = 0;
  for (std::size_t t = 0, i = 0; t < ends.size(); ++t) {
    double excess = 0;
    for (; i < ends[t]; ++i) excess += std::pow(terms[i].dot(s), 2) - across * s.dot(expected[i] * s);
    scatter += excess * excess;
  }
  // Noise has the same energy along and across the lines: half of the squares lie across, and across / noise = 1.
  result.along = std::clamp(1 - 0.5 * across / noise, 0.0, 1.0);
  result.deviations = scatter > 0 ? (noise - across) / std::sqrt(scatter) : 0;
  return result;
}

}  // namespace megablock
