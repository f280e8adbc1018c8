// Tie points and their observations.
//
// Every frame seeds points_per_frame / mean_track points on the surfaces in its images; a second round tops up the
// frames that got too few from their neighbours (the borders of the block). A point's observations are chosen among all
// images that see it: the seeding frame's and, at the wanted track length, others in random order (aerial) or nearest
// in time first, partly from another pass (street).
#include <algorithm>
#include <cmath>
#include <limits>

#include "io/simulate/scene.h"
#include "io/simulate/wrong_matches.h"

namespace megablock {

Observer::Observer(const Layout& layout, double margin_px) : layout_(layout), margin_px_(margin_px) {
  const Block& block = layout.block;
  for (std::size_t i = 0; i < block.images.size(); ++i) {
    const ImageIndex image(static_cast<std::int64_t>(i));
    const Image& entry = block.images[image];
    const Pose& mount = layout.truth.mounts[block.frames[entry.frame].rig][static_cast<std::size_t>(entry.mount)];
    const Pose pose = camera_pose(layout.truth.frames[entry.frame], mount);
    views_.push_back({pose.rotation.toRotationMatrix(), pose.centre, block.camera_of(image).value});
  }
  // The distortion polynomial turns back far outside the image; only rays inside the corners are projected.
  for (std::size_t c = 0; c < block.cameras.size(); ++c) {
    const Camera& camera = block.cameras[CameraIndex(static_cast<std::int64_t>(c))];
    double radius_sq = 0;
    for (const double u : {0.0, 1.0})
      for (const double v : {0.0, 1.0}) {
        const auto corner = unproject(layout.truth.cameras[CameraIndex(static_cast<std::int64_t>(c))],
                                      {u * camera.width, v * camera.height});
        if (corner) radius_sq = std::max(radius_sq, corner->squaredNorm());
      }
    const CameraModelKind kind = camera.intrinsics.model().kind;
    all_around_.push_back(kind == CameraModelKind::kFisheye || kind == CameraModelKind::kEquirectangular);
    max_radius_sq_.push_back(1.05 * radius_sq);
  }

  // Counting sort of the frames into cells as large as the range.
  cell_m_ = layout.scene->range_m();
  Eigen::Vector2d low = layout.truth.frames.front().centre.head<2>(), high = low;
  for (const Pose& pose : layout.truth.frames) {
    low = low.cwiseMin(pose.centre.head<2>());
    high = high.cwiseMax(pose.centre.head<2>());
  }
  origin_ = low;
  columns_ = static_cast<std::int64_t>((high.x() - low.x()) / cell_m_) + 1;
  rows_ = static_cast<std::int64_t>((high.y() - low.y()) / cell_m_) + 1;
  const auto cell_of = [&](const Pose& pose) {
    const Eigen::Vector2d place = (pose.centre.head<2>() - origin_) / cell_m_;
    return static_cast<std::int64_t>(place.y()) * columns_ + static_cast<std::int64_t>(place.x());
  };
  cell_begin_.assign(static_cast<std::size_t>(columns_ * rows_ + 1), 0);
  for (const Pose& pose : layout.truth.frames) ++cell_begin_[static_cast<std::size_t>(cell_of(pose) + 1)];
  for (std::size_t c = 1; c < cell_begin_.size(); ++c) cell_begin_[c] += cell_begin_[c - 1];
  cell_frames_.resize(layout.truth.frames.size());
  std::vector<std::int64_t> next(cell_begin_.begin(), cell_begin_.end() - 1);
  for (std::size_t f = 0; f < cell_frames_.size(); ++f) {
    const FrameIndex frame(static_cast<std::int64_t>(f));
    auto& row = next[static_cast<std::size_t>(cell_of(layout.truth.frames[frame]))];
    cell_frames_[static_cast<std::size_t>(row++)] = frame.value;
  }
}

void Observer::look(std::int64_t frame, const SurfacePoint& point, std::vector<Sighting>& seen) const {
  const Pose& pose = layout_.truth.frames[FrameIndex(frame)];
  if ((pose.centre - point.position).head<2>().norm() > layout_.scene->range_m()) return;
  if (!layout_.scene->visible(pose.centre, point)) return;
  const auto cameras = static_cast<std::int64_t>(layout_.block.rigs[RigIndex(0)].mounts.size());
  for (std::int64_t i = frame * cameras; i < (frame + 1) * cameras; ++i) {
    const ImageIndex image(i);
    if (const auto pixel = pixel_of(image, point.position)) seen.push_back({image, *pixel});
  }
}

std::optional<Eigen::Vector2d> Observer::pixel_of(ImageIndex image, const Eigen::Vector3d& place) const {
  const View& view = views_[static_cast<std::size_t>(image.value)];
  const Eigen::Vector3d inside = view.rotation * (place - view.centre);
  const bool all_around = all_around_[static_cast<std::size_t>(view.camera)] != 0;
  if ((all_around ? inside.norm() : inside.z()) < 0.5) return std::nullopt;
  const CameraIndex camera(view.camera);
  const double radius_sq = inside.head<2>().squaredNorm() / (inside.z() * inside.z());
  if (!all_around && radius_sq > max_radius_sq_[static_cast<std::size_t>(view.camera)]) return std::nullopt;
  const Eigen::Vector2d pixel = project(layout_.truth.cameras[camera], inside);
  if (!pixel.allFinite()) return std::nullopt;
  const Camera& size = layout_.block.cameras[camera];
  if (pixel.x() < margin_px_ || pixel.x() > size.width - margin_px_ || pixel.y() < margin_px_ ||
      pixel.y() > size.height - margin_px_)
    return std::nullopt;
  return pixel;
}

std::vector<Sighting> Observer::sightings(const SurfacePoint& point) const {
  std::vector<Sighting> seen;
  const Eigen::Vector2d place = (point.position.head<2>() - origin_) / cell_m_;
  const auto column = static_cast<std::int64_t>(std::floor(place.x())),
             row = static_cast<std::int64_t>(std::floor(place.y()));
  for (std::int64_t r = std::max<std::int64_t>(0, row - 1); r <= std::min(rows_ - 1, row + 1); ++r)
    for (std::int64_t c = std::max<std::int64_t>(0, column - 1); c <= std::min(columns_ - 1, column + 1); ++c) {
      const auto cell = static_cast<std::size_t>(r * columns_ + c);
      for (std::int64_t k = cell_begin_[cell]; k < cell_begin_[cell + 1]; ++k)
        look(cell_frames_[static_cast<std::size_t>(k)], point, seen);
    }
  std::sort(seen.begin(), seen.end(), [](const Sighting& a, const Sighting& b) { return a.image < b.image; });
  return seen;
}

namespace {

class TrackMaker {
 public:
  TrackMaker(const SimulationOptions& options, const Layout& layout, const Observer& observer, const TrackSink& sink,
             std::int64_t batch_observations)
      : options_(options),
        layout_(layout),
        observer_(observer),
        sink_(sink),
        batch_observations_(batch_observations),
        count_(layout.block.frames.size(), 0) {
    batch_.tracks.begin = {0};
  }

  void run() {
    const auto frames = static_cast<std::int64_t>(count_.size());
    for (const int round : {0, 1}) {
      for (std::int64_t f = 0; f < frames; ++f) {
        const std::int64_t item = 2 * f + round;
        Random random(options_.seed, Random::Purpose::kTracks, static_cast<std::uint64_t>(item));
        // Fractional parts are settled by chance, so that the mean comes out right.
        const double wanted = round == 0 ? options_.points_per_frame / options_.mean_track + random.uniform()
                                         : std::numeric_limits<double>::infinity();
        const double full = round == 0 ? std::numeric_limits<double>::infinity() : 0.97 * options_.points_per_frame;
        std::int64_t made = 0, tries = 0;
        const std::int64_t most_tries = 40 * static_cast<std::int64_t>(options_.points_per_frame);
        while (static_cast<double>(made + 1) <= wanted && static_cast<double>(count_of(f)) < full &&
               tries++ < most_tries)
          made += seed_point(FrameIndex(f), random);
      }
    }
    hand_over();
  }

 private:
  std::int64_t& count_of(std::int64_t frame) { return count_[static_cast<std::size_t>(frame)]; }

  bool seed_point(FrameIndex frame, Random& random) {
    const auto point = layout_.scene->sample(layout_.truth.frames[frame], random);
    if (!point) return false;
    std::vector<Sighting> seen = observer_.sightings(*point);
    const auto own = [&](const Sighting& s) { return layout_.block.images[s.image].frame == frame; };
    const auto in_frame = std::count_if(seen.begin(), seen.end(), own);
    if (in_frame == 0 || in_frame == std::ssize(seen)) return false;
    choose(frame, random, seen);
    store(*point, seen, random);
    return true;
  }

  // Keeps the seeding frame and as many others as the track length asks for. What tracks at the border of the block
  // lack is given to later ones.
  void choose(FrameIndex frame, Random& random, std::vector<Sighting>& seen) {
    const int wanted = 2 + random.poisson(options_.mean_track - 2), length = wanted + std::min(2, lacking_);
    const bool two_passes = layout_.scene->along_passes() && random.uniform() < 0.3;
    const std::int64_t pass = layout_.block.frames[frame].pass;
    struct Candidate {
      double rank;
      Sighting sighting;
    };
    std::vector<Candidate> candidates;
    bool owned = false;
    for (const Sighting& s : seen) {
      const FrameIndex other = layout_.block.images[s.image].frame;
      double rank = random.uniform();
      if (layout_.scene->along_passes()) {
        // Frames of another visit are ranked by distance: they meet the point anywhere in their drive.
        const bool same = layout_.block.frames[other].pass == pass &&
                          std::abs(other.value - frame.value) <= layout_.scene->visit_frames();
        rank += same ? static_cast<double>(std::abs(other.value - frame.value))
                     : (two_passes ? 0 : 1e6) +
                           (layout_.truth.frames[other].centre - layout_.truth.frames[frame].centre).norm() /
                               options_.frame_distance_m;
      } else if (count_of(other.value) >= options_.points_per_frame) {
        rank += 1;
      }
      if (other == frame && !owned) rank = -1;
      owned = owned || other == frame;
      candidates.push_back({rank, s});
    }
    std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
      return a.rank != b.rank ? a.rank < b.rank : a.sighting.image < b.sighting.image;
    });
    // The second of the list must be of another frame: two cameras of a rig make no track.
    const auto partner = std::find_if(candidates.begin() + 1, candidates.end(), [&](const Candidate& c) {
      return layout_.block.images[c.sighting.image].frame != frame;
    });
    std::rotate(candidates.begin() + 1, partner, partner + 1);
    const auto kept = std::min<std::ptrdiff_t>(length, std::ssize(candidates));
    lacking_ += wanted - static_cast<int>(kept);
    seen.clear();
    for (std::ptrdiff_t i = 0; i < kept; ++i) seen.push_back(candidates[static_cast<std::size_t>(i)].sighting);
    std::sort(seen.begin(), seen.end(), [](const Sighting& a, const Sighting& b) { return a.image < b.image; });
  }

  void store(const SurfacePoint& point, const std::vector<Sighting>& seen, Random& random) {
    TrackSet& tracks = batch_.tracks;
    tracks.id.emplace_back(next_track_++);
    const WrongGroup wrong = draw_wrong_group(options_, layout_, observer_, point, seen, random);
    for (std::size_t i = 0; i < seen.size(); ++i) {
      const ImageIndex image = seen[i].image;
      const Camera& camera = layout_.block.cameras[layout_.block.camera_of(image)];
      const bool agreed = i >= wrong.begin && i < wrong.begin + wrong.pixels.size();  // on a wrong place
      const bool stray = agreed ? !wrong.pixels[i - wrong.begin] : random.uniform() < wrong.stray_share;
      const Eigen::Vector2d place = agreed && !stray ? *wrong.pixels[i - wrong.begin] : seen[i].pixel;
      Eigen::Vector2d pixel;
      do {
        const double a = stray ? random.uniform() : random.normal(), b = stray ? random.uniform() : random.normal();
        pixel = stray ? Eigen::Vector2d(a * camera.width, b * camera.height)
                      : Eigen::Vector2d(place + options_.image_noise_px * Eigen::Vector2d(a, b));
      } while (pixel.x() < 0 || pixel.x() > camera.width || pixel.y() < 0 || pixel.y() > camera.height);
      tracks.image.push_back(image);
      tracks.x.push_back(to_fixed_pixel(pixel.x()));
      tracks.y.push_back(to_fixed_pixel(pixel.y()));
      tracks.feature.push_back(-1);
      batch_.outlier.push_back(static_cast<std::uint8_t>(stray    ? Verdict::kStray
                                                         : agreed ? wrong.verdict
                                                                  : Verdict::kRight));
      ++count_of(layout_.block.images[image].frame.value);
    }
    tracks.begin.push_back(tracks.observation_count());
    batch_.points.push_back(point.position);
    if (tracks.observation_count() >= batch_observations_) hand_over();
  }

  void hand_over() {
    if (!batch_.tracks.id.empty()) sink_(batch_);
    batch_ = {};
    batch_.tracks.begin = {0};
  }

  const SimulationOptions& options_;
  const Layout& layout_;
  const Observer& observer_;
  const TrackSink& sink_;
  std::int64_t batch_observations_;
  SimulatedTracks batch_;            // finished tracks that the sink has not got yet
  std::int64_t next_track_ = 0;      // index of the next track
  std::vector<std::int64_t> count_;  // observations of each frame so far
  int lacking_ = 0;                  // observations by which tracks fell short of their wanted length
};

}  // namespace

void simulate_tracks(const SimulationOptions& options, const Layout& layout, const Observer& observer,
                     const TrackSink& sink, std::int64_t batch_observations) {
  TrackMaker(options, layout, observer, sink, batch_observations).run();
}

}  // namespace megablock
