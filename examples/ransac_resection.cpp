// Resects a camera with a RANSAC that the user writes around a minimal solver of the library.
//
// The pose of a camera follows from three points that are known in the ground frame (geometry/resection/p3p.h). Here a
// camera sees 200 points, but four in ten are matched to the wrong place. The loop draws three matches at a time,
// solves for the pose, counts the matches that agree with it, and keeps the best pose. The scene is simulated, so that
// the program can compare its pose with the truth; it ends with 1 when the pose is wrong.
//
// Conventions. A pose holds the rotation ground -> camera and the projection centre in the ground frame, metres; the
// camera looks along +z. A ray is a unit vector in camera axes.
#include <megablock/geometry/resection/p3p.h>

#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

namespace {

using megablock::Pose;

struct Match {
  Eigen::Vector3d ray;    // where the camera sees the point, camera axes, unit
  Eigen::Vector3d point;  // where the point is, ground frame, metres
};

constexpr double kFocalPx = 1400;
constexpr double kNoisePx = 0.5;
constexpr double kThresholdPx = 3 * kNoisePx;

Eigen::Vector3d ray_of_pixel(double x, double y) { return Eigen::Vector3d(x / kFocalPx, y / kFocalPx, 1).normalized(); }

// A camera 100 m above a hilly ground, turned about all three axes.
Pose true_pose() {
  const Eigen::Quaterniond down(0, 1, 0, 0);  // looks along -z of the ground
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.3, Eigen::Vector3d(0.1, -0.2, 1).normalized()));
  return {(turn * down).normalized(), {12, -7, 100}};
}

std::vector<Match> simulate(const Pose& pose, int count, double wrong_share, std::mt19937_64& random) {
  std::uniform_real_distribution<double> plan(-60, 60), height(-10, 10), pixel(-900, 900), share(0, 1);
  std::normal_distribution<double> noise(0, kNoisePx);
  std::vector<Match> matches;
  while (static_cast<int>(matches.size()) < count) {
    const Eigen::Vector3d point(plan(random), plan(random), height(random));
    const Eigen::Vector3d seen = megablock::to_inside(pose, point);
    double x = kFocalPx * seen.x() / seen.z() + noise(random), y = kFocalPx * seen.y() / seen.z() + noise(random);
    if (share(random) < wrong_share) x = pixel(random), y = pixel(random);
    matches.push_back({ray_of_pixel(x, y), point});
  }
  return matches;
}

// Distance of a match from where the pose expects it, px; behind the camera it is infinite.
double residual_px(const Pose& pose, const Match& match) {
  const Eigen::Vector3d seen = megablock::to_inside(pose, match.point);
  if (seen.z() <= 0) return INFINITY;
  return kFocalPx * (seen.head<2>() / seen.z() - match.ray.head<2>() / match.ray.z()).norm();
}

struct Consensus {
  Pose pose;
  int inliers = 0;
};

Consensus resect(const std::vector<Match>& matches, int draws, std::mt19937_64& random) {
  std::uniform_int_distribution<std::size_t> any(0, matches.size() - 1);
  Consensus best;
  for (int draw = 0; draw < draws; ++draw) {
    const std::size_t a = any(random), b = any(random), c = any(random);
    if (a == b || b == c || a == c) continue;
    const auto poses = megablock::solve_p3p({matches[a].ray, matches[b].ray, matches[c].ray},
                                            {matches[a].point, matches[b].point, matches[c].point});
    for (const Pose& pose : poses) {  // up to four
      Consensus candidate{pose, 0};
      for (const Match& match : matches) candidate.inliers += residual_px(pose, match) < kThresholdPx;
      if (candidate.inliers > best.inliers) best = candidate;
    }
  }
  return best;
}

}  // namespace

int main() {
  std::mt19937_64 random(1);
  const Pose truth = true_pose();
  const std::vector<Match> matches = simulate(truth, 200, 0.4, random);
  // A draw is free of wrong matches with probability 0.6^3 = 0.22: after 100 draws one is, but for one case in 10^10.
  const Consensus found = resect(matches, 100, random);
  const double position_m = (found.pose.centre - truth.centre).norm();
  const double rotation_deg = found.pose.rotation.angularDistance(truth.rotation) * 57.29577951308232;
  std::printf("%d of %zu matches agree; position off by %.3f m, rotation by %.3f degrees\n", found.inliers,
              matches.size(), position_m, rotation_deg);
  // Three points with 0.5 px of noise place a camera 100 m away to a decimetre or two.
  return found.inliers > 100 && position_m < 0.5 && rotation_deg < 0.3 ? 0 : 1;
}
