#include "io/store/hdf5/hdf5_cameras.h"

#include <algorithm>

namespace megablock {

namespace {

// Number of columns of a matrix of parameters; one if there is no camera.
std::size_t columns_of(const std::vector<CameraModel>& models) {
  int most = 1;
  for (const CameraModel& model : models) most = std::max(most, parameter_count(model));
  return static_cast<std::size_t>(most);
}

// Number of columns of a matrix of parameters in a file. Files from before a model had its rare parameters lack these;
// they are zero then.
std::size_t columns_in(const Hdf5Reader& file, const std::string& name, const std::vector<CameraModel>& models) {
  int least = 1;
  for (const CameraModel& model : models) least = std::max(least, count_without_rare(model));
  const std::vector<std::int64_t> shape = file.shape(name);
  const bool older = shape.size() > 1 && shape.back() == least;
  return older ? static_cast<std::size_t>(least) : columns_of(models);
}

std::size_t count(const CameraModel& model) { return static_cast<std::size_t>(parameter_count(model)); }

}  // namespace

void put_models(Hdf5Writer& file, const std::vector<CameraModel>& models) {
  file.texts("cameras/model", column(models, [](const CameraModel& m) { return model_name(m); }),
             {"", "docs/reference/file-formats.md, Cameras"});
  file.texts("cameras/parameters", column(models, [](const CameraModel& m) { return parameter_names(m); }),
             {"", "names of the parameters, in the order of the columns"});
}

std::vector<CameraModel> get_models(const Hdf5Reader& file, std::int64_t rows) {
  std::vector<CameraModel> models;
  for (const std::string& name : file.texts("cameras/model", rows)) {
    const auto model = find_model(name);
    if (!model) file.fail("cameras/model", "names an unknown camera model, '" + name + "'");
    models.push_back(*model);
  }
  return models;
}

void put_parameters(Hdf5Writer& file, const std::string& name, const std::vector<CameraModel>& models,
                    const std::vector<const double*>& values, const std::string& description) {
  const std::size_t columns = columns_of(models);
  // Each row has the values of its model at the left, and NaN behind them.
  std::vector<double> matrix(models.size() * columns, kAbsent);
  for (std::size_t c = 0; c < models.size(); ++c)
    std::copy_n(values[c], count(models[c]), matrix.begin() + static_cast<std::ptrdiff_t>(c * columns));
  file.matrix(name, matrix, static_cast<std::int64_t>(columns), {"", description});
}

void get_parameters(const Hdf5Reader& file, const std::string& name, const std::vector<CameraModel>& models,
                    const std::vector<double*>& values) {
  const std::size_t columns = columns_in(file, name, models);
  const auto matrix =
      file.matrix<double>(name, static_cast<std::int64_t>(columns), static_cast<std::int64_t>(models.size()));
  for (std::size_t c = 0; c < models.size(); ++c)
    std::copy_n(&matrix[c * columns], std::min(columns, count(models[c])), values[c]);
}

std::vector<Intrinsics> get_intrinsics(const Hdf5Reader& file, std::int64_t rows) {
  const std::vector<CameraModel> models = get_models(file, rows);
  std::vector<Intrinsics> cameras(models.begin(), models.end());
  std::vector<double*> values;
  for (Intrinsics& k : cameras) values.push_back(k.data());
  get_parameters(file, "cameras/intrinsics", models, values);
  return cameras;
}

void put_covariances(Hdf5Writer& file, const std::string& name, const std::vector<Eigen::MatrixXd>& covariances) {
  Eigen::Index size = 1;
  for (const Eigen::MatrixXd& c : covariances) size = std::max(size, c.rows());
  std::vector<double> values;
  for (const Eigen::MatrixXd& c : covariances)
    for (Eigen::Index i = 0; i < size; ++i)
      for (Eigen::Index j = 0; j < size; ++j) values.push_back(std::max(i, j) < c.rows() ? c(i, j) : kAbsent);
  file.array(name, values, {static_cast<std::int64_t>(covariances.size()), size, size},
             {"", "posterior, of the parameters; held: 0"});
}

std::vector<Eigen::MatrixXd> get_covariances(const Hdf5Reader& file, const std::string& name,
                                             const std::vector<CameraModel>& models) {
  const std::size_t size = columns_in(file, name, models);
  const auto n = static_cast<std::int64_t>(size);
  const auto values = file.array<double>(name, {static_cast<std::int64_t>(models.size()), n, n});
  std::vector<Eigen::MatrixXd> covariances;
  for (std::size_t c = 0; c < models.size(); ++c) {
    const Eigen::Map<const Eigen::MatrixXd> padded(&values[c * size * size], n, n);
    const Eigen::Index all = parameter_count(models[c]), there = std::min(n, all);
    covariances.emplace_back(Eigen::MatrixXd::Zero(all, all));
    covariances.back().topLeftCorner(there, there) = padded.topLeftCorner(there, there);
  }
  return covariances;
}

}  // namespace megablock
