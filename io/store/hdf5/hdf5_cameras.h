// Parameters of cameras in files, a row per camera: names of the models and their parameters, values as a matrix with
// as many columns as the largest model has, NaN behind the last parameter (docs/job-format.md, "Cameras"). Internal to
// io/.
#pragma once

#include <vector>

#include "geometry/camera/intrinsics.h"
#include "io/store/hdf5/hdf5_tables.h"

namespace megablock {

// Datasets cameras/model and cameras/parameters.
void put_models(Hdf5Writer& file, const std::vector<CameraModel>& models);
// Throws StoreError when a model is not known, or there are not `rows` of them (any number when negative).
std::vector<CameraModel> get_models(const Hdf5Reader& file, std::int64_t rows = -1);

template <typename Cameras>
std::vector<CameraModel> models_of(const Cameras& cameras) {
  return column(cameras, [](const Intrinsics& k) { return k.model(); });
}

// Matrices [cameras x parameters], row c from parameters(c), the first of as many values as model c has.
void put_parameters(Hdf5Writer& file, const std::string& name, const std::vector<CameraModel>& models,
                    const std::vector<const double*>& values, const std::string& description);
// Throws StoreError when the shape does not fit the models.
void get_parameters(const Hdf5Reader& file, const std::string& name, const std::vector<CameraModel>& models,
                    const std::vector<double*>& values);

// Intrinsics and their models.
template <typename Cameras>
void put_intrinsics(Hdf5Writer& file, const Cameras& cameras, const std::string& description) {
  put_parameters(file, "cameras/intrinsics", models_of(cameras),
                 column(cameras, [](const Intrinsics& k) { return k.data(); }), description);
}
std::vector<Intrinsics> get_intrinsics(const Hdf5Reader& file, std::int64_t rows = -1);

// Square matrices [cameras x parameters x parameters].
void put_covariances(Hdf5Writer& file, const std::vector<Eigen::MatrixXd>& covariances);
std::vector<Eigen::MatrixXd> get_covariances(const Hdf5Reader& file, const std::vector<CameraModel>& models);

}  // namespace megablock
