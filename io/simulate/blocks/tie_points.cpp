// Simulates tie points and their observations.
//
// Every frame seeds points_per_frame / mean_track points on the surfaces in its images. A second loop adds points to
// frames that got too few observations from their neighbours (at the borders of the block). The observations of a point
// are chosen among all images that see it. The first one is in the seeding frame. The others, up to the wanted track
// length, are taken in random order (aerial blocks), or nearest in time first and partly from another pass (streets).
//
// The frames are processed in groups, in three steps. First, all threads find the points that the frames of a group
// propose; these depend only on the state before the group. Then, in the order of the frames, one thread decides on the
// number of observations and the index of each track. Last, all threads simulate the observations. Proposals draw from
// the random stream of the frame, observations from that of the track, and the groups do not depend on the number of
// threads. The block is therefore the same for any number of threads.
#include "io/simulate/blocks/tie_points.h"

#include <algorithm>
#include <cmath>

#include "geometry/threads/workers.h"
#include "io/simulate/blocks/wrong_matches.h"

namespace megablock {

namespace {

// The proposals of a group see the counts before it. In small groups these are recent.
constexpr std::int64_t kGroup = 64;  // frames
constexpr int kMostExtra = 2;        // a track gets at most so many observations in place of those that others lack
// A frame with a smaller share of the wanted observations gets more points.
constexpr double kEnough = 0.97;

// A point that a frame seeds.
struct Proposal {
  SurfacePoint point;
  int wanted = 0;                                  // number of observations
  std::vector<SimulatedObservation> observations;  // candidates by preference, later the chosen ones by image
};

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
    const auto frames = static_cast<std::int64_t>(count_.size()), groups = (frames + kGroup - 1) / kGroup;
    for (std::int64_t group = 0; group < groups; ++group) {
      std::vector<FrameIndex> members;
      for (std::int64_t f = group * kGroup; f < std::min(frames, (group + 1) * kGroup); ++f) members.emplace_back(f);
      make_tracks(members, [&](FrameIndex frame) { return seeds(frame); });
    }
    // The frames of a group are far from one another, so the points of one do not change the others.
    for (std::int64_t group = 0; group < groups; ++group) {
      std::vector<FrameIndex> members;
      for (std::int64_t f = group; f < frames; f += groups) members.emplace_back(f);
      make_tracks(members, [&](FrameIndex frame) { return topping_up(frame); });
    }
    hand_over();
  }

 private:
  std::int64_t& count_of(FrameIndex frame) { return count_[static_cast<std::size_t>(frame.value)]; }
  std::int64_t count_of(FrameIndex frame) const { return count_[static_cast<std::size_t>(frame.value)]; }
  FrameIndex frame_of(const SimulatedObservation& observation) const {
    return layout_.block.images[observation.image].frame;
  }
  Random stream_of(FrameIndex frame, int round) const {
    return {options_.seed, Random::Purpose::kTracks, static_cast<std::uint64_t>(2 * frame.value + round)};
  }
  int most_tries() const { return 40 * options_.points_per_frame; }

  template <typename Propose>
  void make_tracks(const std::vector<FrameIndex>& frames, const Propose& propose) {
    const std::int64_t count = std::ssize(frames);
    std::vector<std::vector<Proposal>> proposals(frames.size());
    visit_in_parallel(count, [&](std::int64_t i) {
      proposals[static_cast<std::size_t>(i)] = propose(frames[static_cast<std::size_t>(i)]);
    });
    std::vector<std::int64_t> first_track;
    for (std::vector<Proposal>& of_frame : proposals) {
      first_track.push_back(next_track_);
      next_track_ += std::ssize(of_frame);
      for (Proposal& proposal : of_frame) accept(proposal);
    }
    std::vector<SimulatedTracks> made(frames.size());
    visit_in_parallel(count, [&](std::int64_t i) {
      const auto row = static_cast<std::size_t>(i);
      made[row] = measured(proposals[row], first_track[row]);
    });
    for (const SimulatedTracks& tracks : made)
      for (std::size_t t = 0; t < tracks.points.size(); ++t) {
        append_tracks(batch_, tracks, t, t + 1);
        if (batch_.tracks.observation_count() >= batch_observations_) hand_over();
      }
  }

  std::vector<Proposal> seeds(FrameIndex frame) const {
    Random random = stream_of(frame, 0);
    // The number is rounded up or down at random, so that its mean is right.
    const auto points = static_cast<std::int64_t>(options_.points_per_frame / options_.mean_track + random.uniform());
    std::vector<Proposal> seeded;
    for (int tries = 0; std::ssize(seeded) < points && tries < most_tries(); ++tries)
      if (auto proposal = propose(frame, random)) seeded.push_back(*std::move(proposal));
    return seeded;
  }

  std::vector<Proposal> topping_up(FrameIndex frame) const {
    Random random = stream_of(frame, 1);
    std::int64_t observations = count_of(frame);
    std::vector<Proposal> added;
    for (int tries = 0; static_cast<double>(observations) < kEnough * options_.points_per_frame && tries < most_tries();
         ++tries) {
      auto proposal = propose(frame, random);
      if (!proposal) continue;
      const auto length = std::min<std::ptrdiff_t>(proposal->wanted, std::ssize(proposal->observations));
      observations += std::count_if(proposal->observations.begin(), proposal->observations.begin() + length,
                                    [&](const SimulatedObservation& s) { return frame_of(s) == frame; });
      added.push_back(*std::move(proposal));
    }
    return added;
  }

  // Empty if the draw met no surface, or if no other frame sees the point.
  std::optional<Proposal> propose(FrameIndex frame, Random& random) const {
    const auto point = layout_.scene->sample(layout_.truth.frames[frame], random);
    if (!point) return std::nullopt;
    std::vector<SimulatedObservation> seen = observer_.observations_of(*point);
    const auto in_frame =
        std::count_if(seen.begin(), seen.end(), [&](const SimulatedObservation& s) { return frame_of(s) == frame; });
    if (in_frame == 0 || in_frame == std::ssize(seen)) return std::nullopt;
    // Two plus Poisson: the mean is mean_track, and no track is shorter than two.
    const int wanted = 2 + random.poisson(options_.mean_track - 2);
    return Proposal{*point, wanted, first_choice(frame, seen, wanted + kMostExtra, random)};
  }

  // Selects `count` candidates: the seeding frame first, then the images with the highest preference.
  std::vector<SimulatedObservation> first_choice(FrameIndex frame, const std::vector<SimulatedObservation>& seen,
                                                 std::ptrdiff_t count, Random& random) const {
    // Three tracks in ten may join two visits. Such tracks tie the drives to each other; without them each drive would
    // be a block of its own.
    const bool two_passes = layout_.scene->along_passes() && random.uniform() < 0.3;
    const std::int64_t pass = layout_.block.frames[frame].pass;
    struct Candidate {
      double rank;
      SimulatedObservation observation;
    };
    std::vector<Candidate> candidates;
    candidates.reserve(seen.size());
    bool owned = false;
    for (const SimulatedObservation& s : seen) {
      const FrameIndex other = frame_of(s);
      // Aerial: the fraction decides, frames that have enough come last. Streets: the distance in frames decides, the
      // fraction only among the cameras of a frame.
      double rank = random.uniform();
      if (layout_.scene->along_passes()) {
        // Frames of another visit are ranked by distance, because their time has no relation to that of the first
        // visit.
        const bool same = layout_.block.frames[other].pass == pass &&
                          std::abs(other.value - frame.value) <= layout_.scene->visit_frames();
        rank += same ? static_cast<double>(std::abs(other.value - frame.value))
                     : (two_passes ? 0 : 1e6) +
                           (layout_.truth.frames[other].centre - layout_.truth.frames[frame].centre).norm() /
                               options_.frame_distance_m;
      } else if (count_of(other) >= options_.points_per_frame) {
        rank += 1;
      }
      if (other == frame && !owned) rank = -1;
      owned = owned || other == frame;
      candidates.push_back({rank, s});
    }
    std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
      return a.rank != b.rank ? a.rank < b.rank : a.observation.image < b.observation.image;
    });
    // The second candidate must belong to another frame: two cameras of one frame are not enough for a track.
    const auto partner = std::find_if(candidates.begin() + 1, candidates.end(),
                                      [&](const Candidate& c) { return frame_of(c.observation) != frame; });
    std::rotate(candidates.begin() + 1, partner, partner + 1);
    candidates.resize(static_cast<std::size_t>(std::min(count, std::ssize(candidates))));
    std::vector<SimulatedObservation> chosen;
    for (const Candidate& candidate : candidates) chosen.push_back(candidate.observation);
    return chosen;
  }

  // Decides on the observations of the track. Observations that tracks at the border of the block lack are added to
  // later tracks.
  void accept(Proposal& proposal) {
    const int length = proposal.wanted + std::min(kMostExtra, lacking_);
    std::vector<SimulatedObservation>& seen = proposal.observations;
    seen.resize(std::min(seen.size(), static_cast<std::size_t>(length)));
    lacking_ += proposal.wanted - static_cast<int>(seen.size());
    std::sort(seen.begin(), seen.end(),
              [](const SimulatedObservation& a, const SimulatedObservation& b) { return a.image < b.image; });
    for (const SimulatedObservation& s : seen) ++count_of(frame_of(s));
  }

  SimulatedTracks measured(const std::vector<Proposal>& proposals, std::int64_t track) const {
    SimulatedTracks result;
    result.tracks.begin = {0};
    for (const Proposal& proposal : proposals) {
      result.tracks.id.emplace_back(track);
      result.points.push_back(proposal.point.position);
      Random random(options_.seed, Random::Purpose::kNoise, static_cast<std::uint64_t>(track++));
      measure(proposal, random, result);
      result.tracks.begin.push_back(result.tracks.observation_count());
    }
    return result;
  }

  void measure(const Proposal& proposal, Random& random, SimulatedTracks& result) const {
    const std::vector<SimulatedObservation>& seen = proposal.observations;
    const WrongGroup wrong = draw_wrong_group(options_, layout_, observer_, proposal.point, seen, random);
    for (std::size_t i = 0; i < seen.size(); ++i) {
      const Camera& camera = layout_.block.cameras[layout_.block.camera_of(seen[i].image)];
      const bool agreed = i >= wrong.begin && i < wrong.begin + wrong.pixels.size();  // in a group of wrong matches
      const bool stray = agreed ? !wrong.pixels[i - wrong.begin] : random.uniform() < wrong.stray_share;
      const Eigen::Vector2d place = agreed && !stray ? *wrong.pixels[i - wrong.begin] : seen[i].pixel;
      Eigen::Vector2d pixel;
      // An observation outside the image is drawn again. The margin of the observations (image_margin()) makes this
      // rare, so that the noise keeps its distribution.
      do {
        const double a = stray ? random.uniform() : random.normal(), b = stray ? random.uniform() : random.normal();
        pixel = stray ? Eigen::Vector2d(a * camera.width, b * camera.height)
                      : Eigen::Vector2d(place + options_.image_noise_px * Eigen::Vector2d(a, b));
      } while (pixel.x() < 0 || pixel.x() > camera.width || pixel.y() < 0 || pixel.y() > camera.height);
      result.tracks.image.push_back(seen[i].image);
      result.tracks.x.push_back(to_fixed_pixel(pixel.x()));
      result.tracks.y.push_back(to_fixed_pixel(pixel.y()));
      result.tracks.feature.push_back(-1);
      result.outlier.push_back(static_cast<std::uint8_t>(stray    ? Verdict::kStray
                                                         : agreed ? wrong.verdict
                                                                  : Verdict::kRight));
    }
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
  SimulatedTracks batch_;            // finished tracks that were not yet passed to the sink
  std::int64_t next_track_ = 0;      // index of the next track
  std::vector<std::int64_t> count_;  // observations of each frame so far
  int lacking_ = 0;                  // observations by which tracks fell short of their wanted length
};

}  // namespace

void append_tracks(SimulatedTracks& to, const SimulatedTracks& from, std::size_t first, std::size_t last) {
  const auto append = [](auto& all, const auto& some, auto begin, auto end) {
    all.insert(all.end(), some.begin() + static_cast<std::ptrdiff_t>(begin),
               some.begin() + static_cast<std::ptrdiff_t>(end));
  };
  const std::int64_t before = to.tracks.observation_count(), begin = from.tracks.begin[first],
                     end = from.tracks.begin[last];
  for (std::size_t t = first; t < last; ++t) to.tracks.begin.push_back(before - begin + from.tracks.begin[t + 1]);
  append(to.tracks.id, from.tracks.id, first, last);
  append(to.points, from.points, first, last);
  append(to.tracks.image, from.tracks.image, begin, end);
  append(to.tracks.x, from.tracks.x, begin, end);
  append(to.tracks.y, from.tracks.y, begin, end);
  append(to.tracks.feature, from.tracks.feature, begin, end);
  append(to.outlier, from.outlier, begin, end);
}

void simulate_tracks(const SimulationOptions& options, const Layout& layout, const Observer& observer,
                     const TrackSink& sink, std::int64_t batch_observations) {
  TrackMaker(options, layout, observer, sink, batch_observations).run();
}

}  // namespace megablock
