// Repeats the published simulations of panoramic self-calibration (Cannelle 2013, 2.3.3): four cameras, noise of 0 to 3
// px, a projection centre that is 1 mm to 10 cm off the axis of rotation along each axis of the camera, all points of a
// geodesic sphere of radius 10 m that is subdivided four times, and three closed rows of images. Prints mean absolute
// errors over the seeds as CSV.
//
//   compare_panoramic [seeds = 5] > panoramic.csv
//   tests/benchmark/panoramic_plot.py panoramic.csv docs/results/panoramic.svg
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <numbers>

#include "tests/support/adjust/panorama.h"

namespace megablock {
namespace {

struct Figures {
  PanoramicError error{};
  double focal_sigma_px = 0, rms_px = 0, seconds = 0, structure = 0, along = 0;
  int runs = 0, refused = 0;
};

std::int64_t closed_rows(const PublishedCamera& camera) {
  const double across = 2 * std::atan(0.5 * camera.width / camera.truth[kFocal]);
  return 3 * static_cast<std::int64_t>(std::ceil(2 * std::numbers::pi / (0.4 * across)));
}

void run(const PublishedCamera& camera, const PanoramaSimulation& simulation, Figures& figures) {
  const SimulatedPanorama panorama = simulate_panorama(camera.truth, camera.width, camera.height, simulation);
  const auto begin = std::chrono::steady_clock::now();
  try {
    const PanoramicResult result = calibrate_panoramic(
        panorama.tracks, published_start(camera.truth, camera.width, camera.height), camera.width, camera.height);
    const PanoramicError e = error_of(result.camera, camera.truth, camera.width, camera.height);
    figures.error.focal_px += e.focal_px;
    figures.error.principal_px += e.principal_px;
    figures.error.symmetry_px += e.symmetry_px;
    figures.error.edge_px += e.edge_px;
    figures.focal_sigma_px += result.sigma(kFocal);
    figures.rms_px += result.rms_px;
    figures.structure += result.structure.structure_px;
    figures.along += result.parallax.along;
    ++figures.runs;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", camera.name, error.what());
    ++figures.refused;
  }
  figures.seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

void print(const PublishedCamera& camera, const char* kind, double level, std::int64_t images, const Figures& f) {
  const double n = f.runs > 0 ? f.runs : 1;
  std::printf("%s,%s,%g,%lld,%d,%d,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,%.3f,%.2f\n", camera.name, kind, level,
              static_cast<long long>(images), f.runs, f.refused, f.error.focal_px / n, f.error.principal_px / n,
              f.error.symmetry_px / n, f.error.edge_px / n, f.focal_sigma_px / n, f.rms_px / n, f.structure / n,
              f.along / n, f.seconds / (f.runs + f.refused));
  std::fflush(stdout);
}

void all(int seeds) {
  std::printf(
      "camera,kind,level,images,runs,refused,focal_px,principal_px,symmetry_px,edge_px,focal_sigma_px,rms_px,"
      "structure_px,along,seconds\n");
  const std::array<const char*, 3> axes = {"off-centre x", "off-centre y", "off-centre z"};
  for (const PublishedCamera& camera : published_cameras()) {
    PanoramaSimulation simulation;
    simulation.images = closed_rows(camera);
    for (const double noise : {0.0, 0.1, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0}) {
      Figures figures;
      simulation.noise_px = noise;
      for (int seed = 1; seed <= (noise > 0 ? seeds : 1); ++seed) {
        simulation.seed = static_cast<std::uint64_t>(seed);
        run(camera, simulation, figures);
      }
      print(camera, "noise", noise, simulation.images, figures);
    }
    simulation.noise_px = 0.1;
    for (int axis = 0; axis < 3; ++axis)
      for (const double offset : {0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1}) {
        Figures figures;
        simulation.off_centre = offset * Eigen::Vector3d::Unit(axis);
        simulation.seed = 1;
        run(camera, simulation, figures);
        print(camera, axes[static_cast<std::size_t>(axis)], offset, simulation.images, figures);
      }
  }
}

}  // namespace
}  // namespace megablock

int main(int argc, char** argv) {
  megablock::all(argc > 1 ? std::atoi(argv[1]) : 5);
  return 0;
}
