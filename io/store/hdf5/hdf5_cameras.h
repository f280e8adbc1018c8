// Writes and reads camera parameters in files, one row per camera: the names of models and parameters, and the values
// as a matrix. The matrix has as many columns as the largest model has parameters; after the last parameter of a
// smaller model follows NaN (docs/reference/file-formats.md, "Cameras"). Internal to io/.
#pragma once

#include <vector>

#include "geometry/camera/intrinsics.h"
#include "io/store/hdf5/hdf5_tables.h"

namespace megablock {

// Writes the datasets cameras/model and cameras/parameters.
void put_models(Hdf5Writer& file, const std::vector<CameraModel>& models);
// Reads the models. Throws StoreError for an unknown model, or if their number is not `rows` (any number if negative).
std::vector<CameraModel> get_models(const Hdf5Reader& file, std::int64_t rows = -1);

template <typename Cameras>
std::vector<CameraModel> models_of(const Cameras& cameras) {
  return column(cameras, [](const Intrinsics& k) { return k.model(); });
}

// Writes a matrix [cameras x parameters]. values[c] points to as many values as model c has parameters.
void put_parameters(Hdf5Writer& file, const std::string& name, const std::vector<CameraModel>& models,
                    const std::vector<const double*>& values, const std::string& description);
// Reads such a matrix. Throws StoreError if its shape does not fit the models.
void get_parameters(const Hdf5Reader& file, const std::string& name, const std::vector<CameraModel>& models,
                    const std::vector<double*>& values);

// Intrinsics together with their models.
template <typename Cameras>
void put_intrinsics(Hdf5Writer& file, const Cameras& cameras, const std::string& description) {
  put_parameters(file, "cameras/intrinsics", models_of(cameras),
                 column(cameras, [](const Intrinsics& k) { return k.data(); }), description);
}
std::vector<Intrinsics> get_intrinsics(const Hdf5Reader& file, std::int64_t rows = -1);

// Covariances as an array [cameras x parameters x parameters], in the dataset `name`.
void put_covariances(Hdf5Writer& file, const std::string& name, const std::vector<Eigen::MatrixXd>& covariances);
std::vector<Eigen::MatrixXd> get_covariances(const Hdf5Reader& file, const std::string& name,
                                             const std::vector<CameraModel>& models);

}  // namespace megablock
