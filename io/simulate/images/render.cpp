#include "io/simulate/images/render.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "io/base/error.h"

namespace megablock {

RayTable::RayTable(const Camera& camera, const Intrinsics& intrinsics)
    : rows_(2 * camera.height),
      columns_(2 * camera.width),
      rays_(static_cast<std::size_t>(rows_) * static_cast<std::size_t>(columns_)) {
  bool complete = true;
#pragma omp parallel for schedule(static) reduction(&& : complete)
  for (int r = 0; r < rows_; ++r)
    for (int c = 0; c < columns_; ++c) {
      // The samples lie at a quarter and three quarters of the pixel. (0, 0) is the upper left corner of the image.
      const auto ray = unproject(intrinsics, {0.25 + 0.5 * c, 0.25 + 0.5 * r});
      complete = complete && ray;
      if (ray)
        rays_[static_cast<std::size_t>(r) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(c)] =
            ray->cast<float>();
    }
  if (!complete)
    throw InputError("simulation: the distortion of camera '" + camera.name + "' cannot be inverted inside the image");
}

namespace {

constexpr float kNoise = 1.5f;           // sigma of the sensor noise, grey values
constexpr std::int64_t kOnVehicle = -3;  // number of the vehicle among the objects of the city

// Approximately normal: the sum of four uniform numbers has the variance 4/12, which sqrt 3 makes 1.
float sensor_noise(std::uint64_t bits) {
  float sum = 0;
  for (int k = 0; k < 4; ++k) sum += static_cast<float>(bits >> (16 * k) & 0xffff) / 65536.0f - 0.5f;
  return sum * 1.7320508f;
}

}  // namespace

cv::Mat render_image(const City& city, const RayTable& rays, const Pose& camera, double focal_px, std::uint64_t seed,
                     const SeenVehicle& vehicle) {
  cv::Mat image(rays.rows() / 2, rays.columns() / 2, CV_8UC3);
  const Eigen::Matrix3d to_ground = camera.rotation.toRotationMatrix().transpose();
#pragma omp parallel for schedule(dynamic, 8)
  for (int row = 0; row < image.rows; ++row) {
    auto* line = image.ptr<cv::Vec3b>(row);
    double guess = 0;
    for (int column = 0; column < image.cols; ++column) {
      std::array<Eigen::Vector3d, 4> direction;
      std::array<City::Hit, 4> hit;
      bool edge = false;
      for (std::size_t k = 0; k < 4; ++k) {
        const int r = 2 * row + static_cast<int>(k / 2), c = 2 * column + static_cast<int>(k % 2);
        const Eigen::Vector2f& ray = rays.at(r, c);
        direction[k] =
            (to_ground * Eigen::Vector3d(static_cast<double>(ray.x()), static_cast<double>(ray.y()), 1)).normalized();
        if (vehicle.view && vehicle.view->covers(r, c))
          hit[k].object = kOnVehicle;
        else
          hit[k] = city.cast(camera.centre, direction[k], guess);
        // Neighbours in a row meet the ground at almost the same distance. The guess begins anew in each row, so that
        // the image does not depend on the threads.
        if (hit[k].object == City::kGround) guess = hit[k].distance;
        edge = edge || hit[k].object != hit[0].object;
      }
      // Within one surface, two samples on the diagonal are enough, because texture finer than the pixel fades out.
      Eigen::Vector3f mean = Eigen::Vector3f::Zero();
      const std::size_t step = edge ? 1 : 3;
      for (std::size_t k = 0; k < 4; k += step) {
        const int r = 2 * row + static_cast<int>(k / 2), c = 2 * column + static_cast<int>(k % 2);
        mean += hit[k].object == kOnVehicle ? vehicle.view->colour(r, c, vehicle.light)
                                            : city.colour(hit[k], direction[k], 1 / focal_px);
      }
      mean /= edge ? 4 : 2;
      std::uint64_t bits =
          mix_bits(seed + static_cast<std::uint64_t>(row) * 0x9e3779b97f4a7c15ULL + static_cast<std::uint64_t>(column));
      for (int k = 0; k < 3; ++k) {
        bits = mix_bits(bits + 1);
        // OpenCV's order is blue, green, red.
        const float value = mean[2 - k] + kNoise * sensor_noise(bits);
        line[column][k] = static_cast<unsigned char>(std::clamp(value + 0.5f, 0.0f, 255.0f));
      }
    }
  }
  return image;
}

}  // namespace megablock
