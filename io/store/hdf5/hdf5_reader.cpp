// Reads HDF5 files (Hdf5Reader).
#include <algorithm>
#include <filesystem>

#include "io/base/error.h"
#include "io/store/hdf5/hdf5_types.h"

namespace megablock {

namespace {

Hdf5Handle open_dataset(hid_t file, const std::string& name) {
  return {H5Dopen2(file, name.c_str(), H5P_DEFAULT), &H5Dclose};
}

std::vector<hsize_t> extent_of(hid_t space) {
  std::vector<hsize_t> extent(static_cast<std::size_t>(std::max(0, H5Sget_simple_extent_ndims(space))));
  H5Sget_simple_extent_dims(space, extent.data(), nullptr);
  return extent;
}

// Reads the ranges of an open dataset one after the other. Chunks that several ranges share stay in the dataset's
// cache.
bool read_ranges(hid_t set, hid_t memory_type, const std::vector<RowRange>& ranges, char* values) {
  const Hdf5Handle space(H5Dget_space(set), &H5Sclose);
  std::vector<hsize_t> extent = extent_of(space.id()), start(extent.size(), 0);
  std::size_t row_bytes = H5Tget_size(memory_type);
  for (std::size_t d = 1; d < extent.size(); ++d) row_bytes *= extent[d];
  for (const RowRange& range : ranges) {
    if (range.count == 0) continue;
    start[0] = static_cast<hsize_t>(range.first);
    extent[0] = static_cast<hsize_t>(range.count);
    const Hdf5Handle memory(H5Screate_simple(static_cast<int>(extent.size()), extent.data(), nullptr), &H5Sclose);
    if (H5Sselect_hyperslab(space.id(), H5S_SELECT_SET, start.data(), nullptr, extent.data(), nullptr) < 0 ||
        H5Dread(set, memory_type, memory.id(), space.id(), H5P_DEFAULT, values) < 0)
      return false;
    values += row_bytes * extent[0];
  }
  return true;
}

std::int64_t count_of(const std::vector<RowRange>& ranges) {
  std::int64_t count = 0;
  for (const RowRange& range : ranges) count += range.count;
  return count;
}

// Strings of fixed length without their padding.
std::vector<std::string> unpadded(const std::string& padded, std::size_t length) {
  std::vector<std::string> values(padded.size() / length);
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i] = padded.substr(i * length, length);
    values[i].erase(values[i].find_last_not_of('\0') + 1);
  }
  return values;
}

// A shape as text: "[12, 3]", "[any, 3]".
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
  // The version is tested before anything is read, so an old file gives one clear message and not a missing dataset.
  if (!has_attribute("/", "kind") || !has_attribute("/", "format_version"))
    throw StoreError(path + ": is not a file of megablock (it lacks the attribute 'kind' or 'format_version')");
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
  const std::vector<hsize_t> extent = extent_of(space.id());
  return {extent.begin(), extent.end()};
}

std::vector<RowRange> ranges_of(const std::vector<std::int64_t>& rows, std::int64_t gap) {
  std::vector<RowRange> ranges;
  for (const std::int64_t row : rows)
    if (!ranges.empty() && row < ranges.back().first + ranges.back().count + gap)
      ranges.back().count = row + 1 - ranges.back().first;
    else
      ranges.push_back({row, 1});
  return ranges;
}

std::size_t Hdf5Reader::size_of_rows(const std::string& name, const std::vector<RowRange>& ranges) const {
  const std::vector<std::int64_t> found = shape(name);
  for (const RowRange& range : ranges)
    if (range.first < 0 || range.count < 0 || found.empty() || range.first + range.count > found[0])
      fail(name, "has shape " + shape_text(found) + ", but rows beyond its end were requested");
  std::int64_t size = count_of(ranges);
  for (std::size_t d = 1; d < found.size(); ++d) size *= found[d];
  return static_cast<std::size_t>(size);
}

void Hdf5Reader::check_class(std::int64_t set, const std::string& name, ElementType type) const {
  const bool wants_integers = type != ElementType::kFloat && type != ElementType::kDouble;
  const Hdf5Handle found(checked(H5Dget_type(set), name), &H5Tclose);
  const H5T_class_t kind = H5Tget_class(found.id());
  // HDF5 would convert and cut off the decimals without a word.
  if (wants_integers && kind == H5T_FLOAT) fail(name, "holds floating-point numbers where integers are expected");
}

void Hdf5Reader::read_rows(const std::string& name, ElementType type, const std::vector<RowRange>& ranges,
                           void* values) const {
  const Hdf5Handle set = open_dataset(file_.id(), name);
  checked(set.id(), name);
  check_class(set.id(), name, type);
  checked(read_ranges(set.id(), memory_type(type), ranges, static_cast<char*>(values)) ? 0 : -1, name);
}

std::vector<std::string> Hdf5Reader::text_rows(const std::string& name, const std::vector<RowRange>& ranges) const {
  size_of_rows(name, ranges);
  const Hdf5Handle set = open_dataset(file_.id(), name);
  const Hdf5Handle type = text_type(set.id(), name);
  const std::size_t length = H5Tget_size(type.id());
  std::string padded(length * static_cast<std::size_t>(count_of(ranges)), '\0');
  checked(read_ranges(set.id(), type.id(), ranges, padded.data()) ? 0 : -1, name);
  return unpadded(padded, length);
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
  check_class(set.id(), name, type);
  checked(H5Dread(set.id(), memory_type(type), H5S_ALL, H5S_ALL, H5P_DEFAULT, values), name);
}

std::vector<std::string> Hdf5Reader::texts(const std::string& name, std::int64_t size) const {
  return text_rows(name, {{0, static_cast<std::int64_t>(checked_size(name, {size}))}});
}

Hdf5Handle Hdf5Reader::text_type(std::int64_t set, const std::string& name) const {
  Hdf5Handle type(checked(H5Dget_type(set), name), &H5Tclose);
  if (H5Tget_class(type.id()) != H5T_STRING || H5Tis_variable_str(type.id()) > 0)
    fail(name, "does not hold fixed-length strings");
  return type;
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
