#include <algorithm>
#include <filesystem>

#include "io/error.h"
#include "io/hdf5_types.h"

namespace megablock {

namespace {

Hdf5Handle open_dataset(hid_t file, const std::string& name) {
  return {H5Dopen2(file, name.c_str(), H5P_DEFAULT), &H5Dclose};
}

// "[12, 3]", "[any, 3]"
std::string shape_text(const std::vector<std::int64_t>& shape) {
  std::string text = "[";
  for (std::size_t d = 0; d < shape.size(); ++d)
    text += (d > 0 ? ", " : "") + (shape[d] < 0 ? "any" : std::to_string(shape[d]));
  return text + "]";
}

}  // namespace

Hdf5Reader::Hdf5Reader(const std::string& path) : path_(path) {
  silence_hdf5();
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored)) throw StoreError(path + ": is missing; run the stage that makes it");
  const Hdf5Handle access = file_access();
  file_ = Hdf5Handle(H5Fopen(path.c_str(), H5F_ACC_RDONLY, access.id()), &H5Fclose);
  if (file_.id() < 0)
    throw StoreError(path + ": cannot be opened as HDF5 (" + last_hdf5_failure() + "); delete it and run again");
  if (!has_attribute("/", "kind") || !has_attribute("/", "format_version"))
    throw StoreError(path + ": is no file of megablock (no attribute 'kind')");
  const auto version = attribute<std::uint32_t>("/", "format_version");
  if (version != kFormatVersion)
    throw StoreError(path + ": has format version " + std::to_string(version) + ", this program reads version " +
                     std::to_string(kFormatVersion) + "; make it again with this program");
}

Hdf5Reader::Hdf5Reader(const std::string& path, const std::string& kind) : Hdf5Reader(path) {
  const std::string found = this->kind();
  if (found != kind) throw StoreError(path + ": holds '" + found + "', not '" + kind + "'; check the file name");
}

std::string file_kind(const std::string& path) { return Hdf5Reader(path).kind(); }

bool Hdf5Reader::has(const std::string& name) const { return H5Lexists(file_.id(), name.c_str(), H5P_DEFAULT) > 0; }

std::vector<std::int64_t> Hdf5Reader::shape(const std::string& name) const {
  const Hdf5Handle set = open_dataset(file_.id(), name);
  checked(set.id(), name);
  const Hdf5Handle space(checked(H5Dget_space(set.id()), name), &H5Sclose);
  const int dimensions = H5Sget_simple_extent_ndims(space.id());
  checked(dimensions, name);
  std::vector<hsize_t> extent(static_cast<std::size_t>(dimensions));
  checked(H5Sget_simple_extent_dims(space.id(), extent.data(), nullptr), name);
  return {extent.begin(), extent.end()};
}

std::size_t Hdf5Reader::checked_size(const std::string& name, const std::vector<std::int64_t>& expected) const {
  const std::vector<std::int64_t> found = shape(name);
  bool agrees = found.size() == expected.size();
  std::size_t size = 1;
  for (std::size_t d = 0; agrees && d < found.size(); ++d) {
    agrees = expected[d] < 0 || found[d] == expected[d];
    size *= static_cast<std::size_t>(found[d]);
  }
  if (!agrees) fail(name, "has shape " + shape_text(found) + ", not " + shape_text(expected));
  return size;
}

void Hdf5Reader::read(const std::string& name, ElementType type, void* values) const {
  const Hdf5Handle set = open_dataset(file_.id(), name);
  checked(set.id(), name);
  checked(H5Dread(set.id(), memory_type(type), H5S_ALL, H5S_ALL, H5P_DEFAULT, values), name);
}

std::vector<std::string> Hdf5Reader::texts(const std::string& name, std::int64_t size) const {
  const auto rows = checked_size(name, {size});
  const Hdf5Handle set = open_dataset(file_.id(), name);
  const Hdf5Handle type(checked(H5Dget_type(set.id()), name), &H5Tclose);
  if (H5Tget_class(type.id()) != H5T_STRING || H5Tis_variable_str(type.id()) > 0)
    fail(name, "does not hold fixed-length strings");
  const std::size_t length = H5Tget_size(type.id());
  std::string padded(length * rows, '\0');
  checked(H5Dread(set.id(), type.id(), H5S_ALL, H5S_ALL, H5P_DEFAULT, padded.data()), name);
  std::vector<std::string> values(rows);
  for (std::size_t i = 0; i < rows; ++i) {
    values[i] = padded.substr(i * length, length);
    values[i].erase(values[i].find_last_not_of('\0') + 1);
  }
  return values;
}

bool Hdf5Reader::has_attribute(const std::string& object, const std::string& name) const {
  return H5Aexists_by_name(file_.id(), object.c_str(), name.c_str(), H5P_DEFAULT) > 0;
}

std::string Hdf5Reader::text_attribute(const std::string& object, const std::string& name) const {
  const std::string full = object + "@" + name;
  const Hdf5Handle found(
      checked(H5Aopen_by_name(file_.id(), object.c_str(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT), full), &H5Aclose);
  const Hdf5Handle type(checked(H5Aget_type(found.id()), full), &H5Tclose);
  if (H5Tget_class(type.id()) != H5T_STRING || H5Tis_variable_str(type.id()) > 0)
    fail(full, "does not hold a fixed-length string");
  std::string value(H5Tget_size(type.id()), '\0');
  checked(H5Aread(found.id(), type.id(), value.data()), full);
  value.erase(value.find_last_not_of('\0') + 1);
  return value;
}

void Hdf5Reader::scalar_attribute(const std::string& object, const std::string& name, ElementType type,
                                  void* value) const {
  const std::string full = object + "@" + name;
  const Hdf5Handle found(
      checked(H5Aopen_by_name(file_.id(), object.c_str(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT), full), &H5Aclose);
  checked(H5Aread(found.id(), memory_type(type), value), full);
}

std::int64_t Hdf5Reader::checked(std::int64_t result, const std::string& name) const {
  if (result < 0) fail(name, "cannot be read (" + last_hdf5_failure() + ")");
  return result;
}

void Hdf5Reader::fail(const std::string& name, const std::string& what) const {
  throw StoreError(path_ + ": " + name + ": " + what + "; delete the file and run again");
}

}  // namespace megablock
