// The tracks may be far larger than memory, so every figure is a sum or histogram over one loop, or comes from a sample
// of every n-th track (medians, covariances). Sums per image, camera and tile are arrays of the size of these tables.
// The loops run in the order of the result, so equal results give equal reports.
#include "io/evaluation/figures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <map>
#include <set>

#include "geometry/numbers/angles.h"
#include "io/block/observed_poses.h"
#include "io/evaluation/parts.h"
#include "io/evaluation/reliability.h"
#include "io/evaluation/used_sigmas.h"
#include "io/result/result_option.h"

namespace megablock::report {

namespace {

constexpr std::int64_t kSampleLimit = 100000;  // medians are taken from a sample of at most so many points
constexpr std::int64_t kRayLimit = 24;         // at most so many rays of a track are compared for its largest angle

// Whether all columns have a row for each track or observation.
bool consistent(const TrackResults& tracks) {
  const std::size_t rows = tracks.tracks.image.size();
  return tracks.points.size() == tracks.tracks.id.size() && tracks.kept.size() == rows &&
         tracks.residual_x.size() == rows && tracks.residual_y.size() == rows;
}

// The kept observations of one triangulated point.
struct Track {
  std::vector<std::size_t> kept;
  std::int64_t all = 0;
};

Track track_of(const TrackResults& result, std::size_t row) {
  Track track;
  for (std::int64_t o = result.tracks.begin[row]; o < result.tracks.begin[row + 1]; ++o) {
    const auto i = static_cast<std::size_t>(o);
    ++track.all;
    if (result.kept[i] && std::isfinite(result.residual_x[i]) && std::isfinite(result.residual_y[i]))
      track.kept.push_back(i);
  }
  return track;
}

// Tests single observations with the limits that hold for the block, and keeps the largest test values.
struct Tests {
  double normal_limit = normal_critical_value(), tau_limit, sigma_0, shift = least_shift();

  explicit Tests(const BlockResult& result)
      : tau_limit(result.degrees_of_freedom > 1 ? tau_critical_value(result.degrees_of_freedom) : kUnknown),
        sigma_0(std::sqrt(std::max(0.0, result.variance_factor))) {}

  void add(const TestedMeasurement& test, Reliability& sums) const {
    constexpr std::size_t kListed = 10;
    ++sums.tested;
    sums.poorly_checked += test.redundancy < Reliability::kPoorRedundancy;
    sums.beyond_normal += test.normalised > normal_limit;
    // tau uses sigma naught from the residuals in place of the stated sigma.
    sums.beyond_tau += tau_statistic(test.normalised, sigma_0) > tau_limit;
    const auto larger = [](const TestedMeasurement& a, const TestedMeasurement& b) {
      return a.normalised > b.normalised;
    };
    // Counted above, but not listed.
    if (test.redundancy < Reliability::kListedRedundancy) return;
    auto& largest = sums.largest;
    if (largest.size() == kListed && !larger(test, largest.back())) return;
    // Sorted insertion. Of equal values, the one that was found first stays in front.
    largest.insert(std::upper_bound(largest.begin(), largest.end(), test, larger), test);
    if (largest.size() > kListed) largest.pop_back();
  }
};

// Counts the residuals near the limit of screening, which is a length of max_residual_sigmas sigmas. Only blocks with a
// free datum and several tiles are counted: no remark needs the number of others, and these may have 10^9 observations.
class LimitCounter {
 public:
  explicit LimitCounter(const BlockResult& result) {
    // limit_px_ stays 0, and nothing is counted.
    if (result.free_parts.empty() || result.tiles.tile_count < 2) return;
    const double sigmas = std::strtod(option_of(result, "adjustment.max_residual_sigmas").c_str(), nullptr);
    if (sigmas > NearLimit::kWidest) return;
    limit_px_ = sigmas * result.image_sigma_px;
    const auto beyond = [&](double factor) { return std::exp(-0.5 * factor * factor * sigmas * sigmas); };
    found_.expected = beyond(1 - NearLimit::kNear) - beyond(1 + NearLimit::kNear);
  }
  void add(const TrackResults& batch) {
    if (!counts()) return;
    for (std::size_t o = 0; o < batch.residual_x.size(); ++o) {
      const double length = std::hypot(batch.residual_x[o], batch.residual_y[o]);
      if (!std::isfinite(length)) continue;
      ++found_.tested;
      found_.near += std::abs(length - limit_px_) < NearLimit::kNear * limit_px_;
    }
  }
  bool counts() const { return limit_px_ > 0; }
  const NearLimit& found() const { return found_; }

 private:
  double limit_px_ = 0;
  NearLimit found_;
};

class Gatherer {
 public:
  Gatherer(const BlockResult& result, const TrackBatches& tracks, const std::function<void()>& after_reading)
      : result_(result), block_(result.block), tracks_(tracks), after_reading_(after_reading), tests_(result) {
    f_.reliability.normal_limit = tests_.normal_limit;
    f_.reliability.tau_limit = tests_.tau_limit;
  }

  Figures run() {
    const bool sound = complete();
    if (sound) f_.reprojection = reprojection_statistics(result_, tracks_);
    prepare();
    frames();
    if (sound) observations();
    find_parts(result_, tracks_, f_);
    after_reading_();
    find_prior_residuals(result_, f_);
    after_reading_();
    points();
    accuracy();
    after_reading_();
    return std::move(f_);
  }

 private:
  // Calls after_reading_ at regular intervals of a loop over all images, which reads their table and that of the
  // frames.
  void rest_at(ImageIndex image) const {
    if (image.value % kImagesAtATime == 0) after_reading_();
  }

  // Whether the state has values for all frames, cameras and rigs of the block.
  bool complete() const {
    return result_.state.oriented.size() == block_.frames.size() &&
           result_.state.frames.size() == block_.frames.size() &&
           result_.state.cameras.size() == block_.cameras.size() && result_.state.mounts.size() == block_.rigs.size();
  }
  void prepare() {
    // Lengths 2 to 14, and 15 and more; angles in steps of 5 degrees, the last bin from 90. A residual has rms / sqrt 2
    // per axis: 41 bins over four of these to both sides, an odd number, so that 0 is the middle of a bin.
    f_.track_length = {2, 1, std::vector<std::int64_t>(14, 0)};
    f_.intersection_deg = {0, 5, std::vector<std::int64_t>(19, 0)};
    const double rms = f_.reprojection.rms_px > 0 ? f_.reprojection.rms_px : 1;
    f_.residual_px = {-4 * rms / std::sqrt(2.0), 8 * rms / std::sqrt(2.0) / 41, std::vector<std::int64_t>(41, 0)};
    f_.observations.assign(block_.images.size(), 0);
    f_.measured.assign(block_.images.size(), 0);
    f_.image_squares.assign(block_.images.size(), 0);
    f_.camera_images.assign(block_.cameras.size(), 0);
    for (const Camera& camera : block_.cameras) f_.fields.push_back(ResidualField(camera));
    const auto tiles = static_cast<std::size_t>(result_.tiles.tile_count);
    f_.tile_frames.assign(tiles, 0);
    f_.tile_boundary.assign(tiles, 0);
    f_.tile_observations.assign(tiles, 0);
    f_.tile_rms_px.assign(tiles, 0);
  }

  TileIndex tile_of(FrameIndex frame) const {
    const auto& tiles = result_.tiles.tile_of_frame;
    return tiles.contains(frame) && tiles[frame].value < result_.tiles.tile_count ? tiles[frame] : TileIndex();
  }

  void frames() {
    f_.frames = static_cast<std::int64_t>(block_.frames.size());
    std::set<std::int32_t> components;
    for (FrameIndex frame(0); frame.value < f_.frames; ++frame.value) {
      const bool boundary = result_.boundary.contains(frame) && result_.boundary[frame];
      f_.oriented_frames += oriented(result_, frame);
      f_.boundary_frames += boundary;
      if (result_.tiles.component.contains(frame) && result_.tiles.component[frame] >= 0)
        components.insert(result_.tiles.component[frame]);
      if (!tile_of(frame).valid()) continue;
      const auto tile = static_cast<std::size_t>(tile_of(frame).value);
      ++f_.tile_frames[tile];
      f_.tile_boundary[tile] += boundary;
    }
    f_.components = static_cast<std::int64_t>(components.size());
    for (ImageIndex image(0); block_.images.contains(image); ++image.value) {
      rest_at(image);
      if (oriented(result_, block_.images[image].frame))
        ++f_.camera_images[block_.camera_of(image)];
      else
        f_.not_oriented.push_back(image);
    }
  }

  void observations() {
    // Every step-th track of the block, counted over the batches, so that the sample does not depend on their size.
    const auto step = static_cast<std::size_t>(1 + tracks_.track_count() / kSampleLimit);
    std::vector<double> resolution;
    std::size_t before = 0;  // number of tracks in earlier batches
    LimitCounter near_limit(result_);
    tracks_.visit([&](const TrackResults& batch) {
      near_limit.add(batch);
      for (const ImageIndex image : batch.tracks.image) ++f_.measured[image];
      for (std::size_t row = 0; row < batch.points.size(); ++row) {
        if (!batch.points[row].allFinite()) continue;
        const bool sampled = (before + row) % step == 0;
        if (sampled) point_accuracy(batch, row);
        const Track track = track_of(batch, row);
        f_.all_observations += track.all;
        if (track.kept.empty()) continue;
        f_.track_length.add(static_cast<double>(track.kept.size()));
        for (std::size_t o : track.kept) {
          observation(batch, o);
          reliability(batch, row, o, sampled);
        }
        if (sampled) intersection(batch, row, track, resolution);
      }
      before += batch.points.size();
    });
    f_.near_limit = near_limit.found();
    f_.reliability.detectable_px = spread(std::move(detectable_px_));
    if (f_.reliability.tested > 0)
      f_.reliability.worst_external = external_reliability(least_redundancy_, tests_.shift);
    f_.ground_resolution_m = spread(std::move(resolution)).median;
    for (std::size_t t = 0; t < f_.tile_rms_px.size(); ++t)
      f_.tile_rms_px[t] = f_.tile_observations[t]
                              ? std::sqrt(f_.tile_rms_px[t] / static_cast<double>(f_.tile_observations[t]))
                              : kUnknown;
    std::int64_t most = 1;
    for (std::int64_t n : f_.observations) most = std::max(most, n);
    f_.observations_per_image = {0, std::max(1.0, std::ceil(static_cast<double>(most + 1) / 25)),
                                 std::vector<std::int64_t>(25, 0)};
    for (ImageIndex image(0); block_.images.contains(image); ++image.value) {
      rest_at(image);
      if (oriented(result_, block_.images[image].frame))
        f_.observations_per_image.add(static_cast<double>(f_.observations[image]));
    }
  }

  void observation(const TrackResults& batch, std::size_t o) {
    const ImageIndex image = batch.tracks.image[o];
    const Eigen::Vector2d residual(batch.residual_x[o], batch.residual_y[o]);
    ++f_.observations[image];
    f_.image_squares[image] += residual.squaredNorm();
    f_.residual_px.add(residual.x());
    f_.residual_px.add(residual.y());
    const CameraIndex camera = block_.camera_of(image);
    const Eigen::Vector2d pixel(from_fixed_pixel(batch.tracks.x[o]), from_fixed_pixel(batch.tracks.y[o]));
    f_.fields[camera].add(block_.cameras[camera], pixel, residual);
    const TileIndex tile = tile_of(block_.images[image].frame);
    if (!tile.valid()) return;
    ++f_.tile_observations[static_cast<std::size_t>(tile.value)];
    f_.tile_rms_px[static_cast<std::size_t>(tile.value)] += residual.squaredNorm();
  }

  void intersection(const TrackResults& batch, std::size_t row, const Track& track, std::vector<double>& resolution) {
    std::vector<Eigen::Vector3d> rays;
    for (std::size_t o : track.kept) {
      if (static_cast<std::int64_t>(rays.size()) == kRayLimit) break;
      const ImageIndex image = batch.tracks.image[o];
      const Eigen::Vector3d ray = batch.points[row] - image_pose(result_, image).centre;
      // Size of a pixel on the ground: the distance over the focal length in pixels, metres per pixel.
      resolution.push_back(ray.norm() / result_.state.cameras[block_.camera_of(image)][kFocal]);
      rays.push_back(ray.normalized());
    }
    // The largest angle between two rays has the smallest cosine.
    double least = 1;
    for (std::size_t i = 0; i < rays.size(); ++i)
      for (std::size_t j = i + 1; j < rays.size(); ++j) least = std::min(least, rays[i].dot(rays[j]));
    if (rays.size() > 1) f_.intersection_deg.add(std::acos(std::clamp(least, -1.0, 1.0)) * kDegreesPerRadian);
  }

  void points() {
    for (std::size_t p = 0; p < block_.control_points.size() && p < result_.control.size(); ++p) {
      const BlockResult::ControlResult& control = result_.control[p];
      const ControlPoint& given = block_.control_points[p];
      PointResidual residual;
      residual.point = p;
      measurements(p, residual);
      residual.difference = control.adjusted - given.position;
      if (residual.images == 0) residual.difference.setConstant(kUnknown);  // it keeps its given position
      const bool check = given.role == PointRole::kCheck;
      // The residual of an observation has the variance Q_l - Q_adjusted, because it took part. A check point did not,
      // so both variances add.
      // The covariance of the result may be scaled; a variance that is subtracted from must have the same scale.
      const double factor = result_.sigma_scaled && !check ? result_.variance_factor : 1;
      const Eigen::Vector3d used = used_sigma(result_, given);
      for (int k = 0; k < 3; ++k) {
        const double given_variance = factor * used[k] * used[k];
        const double variance = given_variance + (check ? 1 : -1) * control.covariance(k, k);
        // An adjusted variance that almost equals the given one means that the block does not check the point. Their
        // difference would be rounding.
        if (variance > 1e-4 * given_variance) residual.sigma[k] = std::sqrt(variance);
        const double ratio = std::abs(residual.difference[k]) / residual.sigma[k];
        if (std::isfinite(ratio) && !(residual.ratio >= ratio)) residual.ratio = ratio;
      }
      f_.points.push_back(residual);
    }
    std::stable_sort(f_.measurements.begin(), f_.measurements.end(),
                     [](const auto& a, const auto& b) { return a.ratio > b.ratio; });
  }

  void measurements(std::size_t p, PointResidual& residual) {
    const ControlPoint& given = block_.control_points[p];
    double squares = 0, all_squares = 0;
    std::int64_t all = 0;
    for (std::size_t m = 0; m < std::min(given.measurements.size(), result_.control[p].residual_px.size()); ++m) {
      const Eigen::Vector2d& r = result_.control[p].residual_px[m];
      if (!r.allFinite()) continue;
      ++all;
      all_squares += r.squaredNorm();
      if (result_.control[p].takes_part(m)) {
        ++residual.images;
        squares += r.squaredNorm();
      }
      f_.measurements.push_back({p, m, r, r.cwiseAbs().maxCoeff() / given.measurements[m].sigma_px});
    }
    if (residual.images)
      residual.rms_px = std::sqrt(squares / residual.images);
    else if (all)
      residual.rms_px = std::sqrt(all_squares / static_cast<double>(all));
  }

  void accuracy() {
    std::array<std::vector<double>, 4> frame;
    for (FrameIndex i(0); i.value < f_.frames && result_.frame_covariance.contains(i); ++i.value) {
      if (!oriented(result_, i)) continue;
      const auto sigma = result_.frame_covariance[i].diagonal().cwiseMax(0).cwiseSqrt().eval();
      for (int k = 0; k < 3; ++k) frame[static_cast<std::size_t>(k)].push_back(sigma[3 + k]);
      frame[3].push_back(sigma.head<3>().maxCoeff());
    }
    f_.sigma_east = spread(std::move(frame[0]));
    f_.sigma_north = spread(std::move(frame[1]));
    f_.sigma_up = spread(std::move(frame[2]));
    f_.sigma_rotation = spread(std::move(frame[3]));
    f_.point_sigma_horizontal = spread(std::move(point_horizontal_));
    f_.point_sigma_up = spread(std::move(point_up_));
  }

  // Tests both coordinates of a kept observation.
  void reliability(const TrackResults& batch, std::size_t row, std::size_t o, bool sampled) {
    if (batch.redundancy_x.empty() || !(result_.image_sigma_px > 0)) return;
    const std::array<std::pair<float, std::uint8_t>, 2> axes = {std::pair(batch.residual_x[o], batch.redundancy_x[o]),
                                                                std::pair(batch.residual_y[o], batch.redundancy_y[o])};
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const auto [residual, stored] = axes[axis];
      // 0 of 255 stands for less than 1/510: no other observation checks this one.
      if (stored == 0) {
        ++f_.reliability.unchecked;
        continue;
      }
      const double redundancy = stored / 255.0;
      const double w = normalised_residual(residual, result_.image_sigma_px, redundancy);
      tests_.add({batch.tracks.id[row], batch.tracks.image[o], axis == 1, residual, redundancy, w}, f_.reliability);
      if (sampled) detectable_px_.push_back(minimal_detectable_error(result_.image_sigma_px, redundancy, tests_.shift));
      least_redundancy_ = std::min(least_redundancy_, redundancy);
    }
  }

  void point_accuracy(const TrackResults& batch, std::size_t row) {
    if (batch.point_covariance.empty()) return;
    const Eigen::Matrix3d& c = batch.point_covariance[row];
    if (!c.allFinite()) return;
    // The horizontal sigma of a point is the root of the sum of both variances (Helmert's point error), which does not
    // depend on the axes.
    point_horizontal_.push_back(std::sqrt(std::max(0.0, c(0, 0) + c(1, 1))));
    point_up_.push_back(std::sqrt(std::max(0.0, c(2, 2))));
  }

  const BlockResult& result_;
  const Block& block_;
  const TrackBatches& tracks_;
  const std::function<void()>& after_reading_;
  Tests tests_;
  std::vector<double> detectable_px_;  // smallest detectable errors, from a sample of the tracks
  double least_redundancy_ = 1;
  std::vector<double> point_horizontal_, point_up_;  // sigmas of a sample of the points, m
  Figures f_;
};

}  // namespace

void Histogram::add(double value) {
  if (!std::isfinite(value) || bins.empty()) return;
  const double bin = std::clamp(std::floor((value - low) / width), 0.0, static_cast<double>(bins.size() - 1));
  ++bins[static_cast<std::size_t>(bin)];
}

std::int64_t Histogram::total() const {
  std::int64_t sum = 0;
  for (std::int64_t bin : bins) sum += bin;
  return sum;
}

Spread spread(std::vector<double> values) {
  std::erase_if(values, [](double v) { return !std::isfinite(v); });
  if (values.empty()) return {};
  const auto at = [&](double share) {
    const auto n = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), n, values.end());
    return *n;
  };
  return {at(0.5), at(0.95), at(1)};
}

bool oriented(const BlockResult& result, FrameIndex frame) {
  return result.state.oriented.contains(frame) && result.state.oriented[frame] != 0;
}

std::vector<ImageIndex> first_images(const BlockResult& result, std::size_t count, const ImageOrder& before,
                                     const std::function<void()>& after_reading) {
  // O(n log count) time and memory for `count` images, where sorting all would need a list of them.
  std::vector<ImageIndex> first;  // a heap with the last of the selected images on top
  for (ImageIndex image(0); result.block.images.contains(image) && count > 0; ++image.value) {
    if (image.value % kImagesAtATime == 0) after_reading();
    if (!oriented(result, result.block.images[image].frame)) continue;
    if (first.size() == count) {
      if (!before(image, first.front())) continue;
      std::pop_heap(first.begin(), first.end(), before);
      first.pop_back();
    }
    first.push_back(image);
    std::push_heap(first.begin(), first.end(), before);
  }
  std::sort_heap(first.begin(), first.end(), before);
  return first;
}

double image_rms(const Figures& figures, ImageIndex image) {
  const std::int32_t n = figures.observations[image];
  return n ? std::sqrt(figures.image_squares[image] / static_cast<double>(n)) : kUnknown;
}

Pose image_pose(const BlockResult& result, ImageIndex image) {
  const Image& i = result.block.images[image];
  const std::vector<Pose>& mounts = result.state.mounts[result.block.frames[i.frame].rig];
  return camera_pose(result.state.frames[i.frame], mounts[static_cast<std::size_t>(i.mount)]);
}

Eigen::Vector3d root_mean_square(const std::vector<Eigen::Vector3d>& values) {
  Eigen::Vector3d result;
  for (int k = 0; k < 3; ++k) {
    double squares = 0;
    std::int64_t n = 0;
    for (const Eigen::Vector3d& v : values) {
      if (!std::isfinite(v[k])) continue;
      squares += v[k] * v[k];
      ++n;
    }
    result[k] = n ? std::sqrt(squares / static_cast<double>(n)) : kUnknown;
  }
  return result;
}

void find_near_limit(const BlockResult& result, const TrackBatches& tracks, Figures& figures) {
  LimitCounter counter(result);
  if (counter.counts()) tracks.visit([&](const TrackResults& batch) { counter.add(batch); });
  figures.near_limit = counter.found();
}

void find_prior_residuals(const BlockResult& result, Figures& figures) {
  for (FrameIndex f(0); result.state.oriented.contains(f); ++f.value) {
    if (!result.state.oriented[f]) continue;
    const Pose& pose = result.state.frames[f];
    const Frame& frame = result.block.frames[f];
    const auto as_corrected = [&](const auto& prior) {
      return corrected(prior, result.block, frame.rig, result.state.mounts);
    };
    if (const auto& prior = frame.position_prior)
      figures.positions.push_back({f, difference(pose, as_corrected(*prior)), used_sigma(result, *prior)});
    if (const auto& prior = frame.attitude_prior)
      figures.attitudes.push_back({f, difference(pose, as_corrected(*prior)), prior->sigma_rad});
  }
}

Figures figures_of(const BlockResult& result) {
  const TrackResults none;
  return figures_of(result, WholeTracks(consistent(result) ? result : none));
}

Figures figures_of(const BlockResult& result, const TrackBatches& tracks, const std::function<void()>& after_reading) {
  return Gatherer(result, tracks, after_reading).run();
}

}  // namespace megablock::report
