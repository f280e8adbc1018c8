// Writes HDF5 files (Hdf5Writer), in memory or to reserved disk space.
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <limits>

#include "io/base/descriptor.h"
#include "io/base/error.h"
#include "io/base/file_error.h"
#include "io/store/hdf5/hdf5_types.h"

namespace megablock {

namespace {

constexpr std::size_t kCompressFrom = 16384;  // bytes; smaller datasets are not compressed
// Bytes of a chunk before compression, which is what a query for some rows reads.
constexpr hsize_t kChunkBytes = 1 << 16;
constexpr hsize_t kTextChunks = 16;           // number of chunks of text that are written at a time
constexpr std::size_t kMemoryStep = 1 << 20;  // bytes by which the file in memory grows
constexpr unsigned kDeflateLevel = 1;         // higher levels save a few per cent and take several times as long

// Position in the superblock (version 2 or 3, 8-byte addresses) of the end of the file: 8 bytes signature, 4 bytes
// version, sizes and flags, then the addresses of base and extension, 8 bytes each.
constexpr std::int64_t kEndOfFile = 28;

Hdf5Handle without_times(hid_t property_class) {
  Hdf5Handle properties(H5Pcreate(property_class), &H5Pclose);
  H5Pset_obj_track_times(properties.id(), false);
  return properties;
}

Hdf5Handle text_type(std::size_t length) {
  Hdf5Handle type(H5Tcopy(H5T_C_S1), &H5Tclose);
  H5Tset_size(type.id(), std::max<std::size_t>(length, 1));
  H5Tset_strpad(type.id(), H5T_STR_NULLPAD);
  H5Tset_cset(type.id(), H5T_CSET_UTF8);
  return type;
}

// All digits of floating-point values are significant: deflate would keep 87 % of them, at 60 MB/s.
bool worth_compressing(hid_t type) { return H5Tget_class(type) != H5T_FLOAT; }

void set_chunks(hid_t properties, int rank, const std::vector<hsize_t>& chunk, hid_t type) {
  H5Pset_chunk(properties, rank, chunk.data());
  if (!worth_compressing(type)) {
    H5Pset_fletcher32(properties);  // deflate has its own checksum
    return;
  }
  H5Pset_shuffle(properties);
  H5Pset_deflate(properties, kDeflateLevel);
}

hsize_t rows_of_chunk(std::size_t row_bytes) { return std::max<hsize_t>(1, kChunkBytes / row_bytes); }

// Chunks consist of whole rows; the first dimension is the longest.
void set_compression(hid_t properties, const std::vector<hsize_t>& extent, hid_t type) {
  if (!worth_compressing(type)) return;
  std::size_t row_bytes = H5Tget_size(type);
  for (std::size_t d = 1; d < extent.size(); ++d) row_bytes *= extent[d];
  if (row_bytes == 0 || row_bytes * extent[0] < kCompressFrom) return;
  std::vector<hsize_t> chunk = extent;
  chunk[0] = std::min(extent[0], rows_of_chunk(row_bytes));
  set_chunks(properties, static_cast<int>(chunk.size()), chunk, type);
}

template <typename T>
bool fits(std::int64_t lowest, std::int64_t highest) {
  return lowest >= std::numeric_limits<T>::min() && highest <= std::numeric_limits<T>::max();
}

// The shape of a number of rows.
std::vector<hsize_t> shape_of(hsize_t rows, const std::vector<std::int64_t>& row) {
  std::vector<hsize_t> shape = {rows};
  shape.insert(shape.end(), row.begin(), row.end());
  return shape;
}

// Releases the disk space that is reserved beyond the end of a closed file.
void give_back_disk(const std::string& path) {
  const Descriptor file(path, O_RDWR);
  std::uint64_t end = 0;
  if (file.id() < 0 || !read_fully(file.id(), &end, sizeof end, kEndOfFile) ||
      ::ftruncate(file.id(), static_cast<off_t>(end)) != 0)
    throw_file_error(path, "written", errno);
}

}  // namespace

// HDF5's memory driver asks these callbacks for its buffer and returns it when the file is closed.
struct Hdf5Writer::Image {
  void* data = nullptr;
  ~Image() { std::free(data); }

  static void* resize(void*, std::size_t size, H5FD_file_image_op_t, void* image) {
    auto* self = static_cast<Image*>(image);
    void* moved = std::realloc(self->data, size);
    if (moved) self->data = moved;
    return moved;
  }
  static void* allocate(std::size_t size, H5FD_file_image_op_t operation, void* image) {
    return resize(nullptr, size, operation, image);
  }
  static herr_t keep(void*, H5FD_file_image_op_t, void*) { return 0; }
  static void* share(void* image) { return image; }
  static herr_t unshare(void*) { return 0; }

  // The size of the file; the buffer is longer.
  std::size_t size() const {
    std::uint64_t end = 0;
    if (data) std::memcpy(&end, static_cast<const char*>(data) + kEndOfFile, sizeof end);
    return end;
  }
};

Hdf5Writer::Hdf5Writer(const std::string& path, const std::string& kind, Hdf5Storage storage)
    : path_(path), storage_(storage) {
  silence_hdf5();
  const Hdf5Handle creation = without_times(H5P_FILE_CREATE);
  const Hdf5Handle access = file_access();
  if (storage == Hdf5Storage::kMemory) {
    image_ = std::make_unique<Image>();
    checked(H5Pset_fapl_core(access.id(), kMemoryStep, false), "");
    H5FD_file_image_callbacks_t callbacks = {&Image::allocate, nullptr,         &Image::resize, &Image::keep,
                                             &Image::share,    &Image::unshare, image_.get()};
    checked(H5Pset_file_image_callbacks(access.id(), &callbacks), "");
  } else {
    const Descriptor file(path, O_WRONLY | O_CREAT | O_TRUNC);
    if (file.id() < 0) throw_file_error(path, "created", errno);
    reserve_disk(0);  // HDF5 must not find out that there is no space
  }
  file_ = Hdf5Handle(checked(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, creation.id(), access.id()), ""), &H5Fclose);
  reserve_disk(0);  // creating the file released it
  attribute("/", "kind", kind);
  attribute("/", "format_version", kFormatVersion);
}

Hdf5Writer::~Hdf5Writer() {
  const bool abandoned = file_.id() >= 0;
  growing_.clear();
  file_.reset();
  if (abandoned && storage_ == Hdf5Storage::kDisk) unlink(path_.c_str());
}

void Hdf5Writer::close() {
  growing_.clear();
  checked(H5Fclose(file_.release()), "");
  if (storage_ == Hdf5Storage::kDisk) {
    give_back_disk(path_);
    return;
  }
  const Descriptor file(path_, O_WRONLY | O_CREAT | O_TRUNC);
  if (file.id() < 0) throw_file_error(path_, "created", errno);
  write_fully(file.id(), path_, image_->data, image_->size());
}

// Reserves space for `bytes` of new rows, for chunks that are not yet full, and for HDF5's own tables.
void Hdf5Writer::reserve_disk(std::int64_t bytes) {
  if (storage_ == Hdf5Storage::kMemory) return;
  hsize_t written = 0;
  if (file_.id() >= 0) H5Fget_filesize(file_.id(), &written);
  const auto open_chunks = static_cast<std::int64_t>((2 * growing_.size() + 2) * kChunkBytes);
  // posix_fallocate fails with an error number where HDF5 would crash later.
  const std::int64_t needed = static_cast<std::int64_t>(written) + bytes + bytes / 8 + open_chunks;
  const Descriptor file(path_, O_WRONLY);
  if (file.id() < 0) throw_file_error(path_, "written", errno);
  if (const int error = posix_fallocate(file.id(), 0, needed)) throw_file_error(path_, "written", error);
}

void Hdf5Writer::group(const std::string& name, const std::string& description) {
  const Hdf5Handle creation = without_times(H5P_GROUP_CREATE);
  const Hdf5Handle made(checked(H5Gcreate2(file_.id(), name.c_str(), H5P_DEFAULT, creation.id(), H5P_DEFAULT), name),
                        &H5Gclose);
  if (!description.empty()) attribute(name, "description", description);
}

void Hdf5Writer::integers(const std::string& name, const std::vector<std::int64_t>& values, const DatasetNote& note) {
  // A small type is small in the file also without compression, and HDF5 converts it when it is read.
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  const std::int64_t lowest = values.empty() ? 0 : *low, highest = values.empty() ? 0 : *high;
  hid_t type = H5T_STD_I64LE;
  if (fits<std::int8_t>(lowest, highest)) {
    type = H5T_STD_I8LE;
  } else if (fits<std::int16_t>(lowest, highest)) {
    type = H5T_STD_I16LE;
  } else if (fits<std::int32_t>(lowest, highest)) {
    type = H5T_STD_I32LE;
  }
  write_dataset(name, type, H5T_NATIVE_INT64, values.data(), {static_cast<std::int64_t>(values.size())}, note);
}

void Hdf5Writer::texts(const std::string& name, const std::vector<std::string>& values, const DatasetNote& note) {
  texts(
      name, std::ssize(values), [&](std::int64_t i) { return values[static_cast<std::size_t>(i)]; }, note);
}

void Hdf5Writer::texts(const std::string& name, std::int64_t count, const std::function<std::string(std::int64_t)>& row,
                       const DatasetNote& note) {
  // Strings have a fixed length, so the longest must be known before the first is written: the first call of row().
  std::size_t length = 1;
  for (std::int64_t i = 0; i < count; ++i) length = std::max(length, row(i).size());
  const Hdf5Handle type = text_type(length), set = make_dataset(name, type.id(), {count});
  const auto batch = static_cast<std::int64_t>(kTextChunks * rows_of_chunk(length));
  std::string padded;
  for (std::int64_t first = 0; first < count; first += batch) {
    const std::int64_t rows = std::min(batch, count - first);
    padded.assign(length * static_cast<std::size_t>(rows), '\0');
    for (std::int64_t i = 0; i < rows; ++i) {
      const std::string text = row(first + i);
      std::memcpy(&padded[static_cast<std::size_t>(i) * length], text.data(), text.size());
    }
    write_rows(set.id(), name, type.id(), padded.data(), {}, {first, rows});
  }
  describe(name, note);
  after_dataset_();
}

void Hdf5Writer::dataset(const std::string& name, ElementType type, const void* values,
                         const std::vector<std::int64_t>& shape, const DatasetNote& note) {
  write_dataset(name, file_type(type), memory_type(type), values, shape, note);
}

void Hdf5Writer::write_dataset(const std::string& name, std::int64_t file_type, std::int64_t memory_type,
                               const void* values, const std::vector<std::int64_t>& shape, const DatasetNote& note) {
  const Hdf5Handle set = make_dataset(name, file_type, shape);
  if (std::find(shape.begin(), shape.end(), 0) == shape.end())
    checked(H5Dwrite(set.id(), memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values), name);
  describe(name, note);
  after_dataset_();
}

Hdf5Handle Hdf5Writer::make_dataset(const std::string& name, std::int64_t file_type,
                                    const std::vector<std::int64_t>& shape) {
  const std::vector<hsize_t> extent(shape.begin(), shape.end());
  const Hdf5Handle space(H5Screate_simple(static_cast<int>(extent.size()), extent.data(), nullptr), &H5Sclose);
  const Hdf5Handle creation = without_times(H5P_DATASET_CREATE);
  set_compression(creation.id(), extent, file_type);
  std::int64_t bytes = static_cast<std::int64_t>(H5Tget_size(file_type));
  for (const std::int64_t length : shape) bytes *= length;
  reserve_disk(bytes);
  return {checked(H5Dcreate2(file_.id(), name.c_str(), file_type, space.id(), H5P_DEFAULT, creation.id(), H5P_DEFAULT),
                  name),
          &H5Dclose};
}

// Writes rows that each have the shape `row`.
void Hdf5Writer::write_rows(std::int64_t set, const std::string& name, std::int64_t memory_type, const void* values,
                            const std::vector<std::int64_t>& row, RowRange range) {
  std::vector<hsize_t> start(row.size() + 1, 0);
  start[0] = static_cast<hsize_t>(range.first);
  const std::vector<hsize_t> extent = shape_of(static_cast<hsize_t>(range.count), row);
  const Hdf5Handle memory(H5Screate_simple(static_cast<int>(extent.size()), extent.data(), nullptr), &H5Sclose);
  const Hdf5Handle space(checked(H5Dget_space(set), name), &H5Sclose);
  checked(H5Sselect_hyperslab(space.id(), H5S_SELECT_SET, start.data(), nullptr, extent.data(), nullptr), name);
  checked(H5Dwrite(set, memory_type, memory.id(), space.id(), H5P_DEFAULT, values), name);
}

void Hdf5Writer::describe(const std::string& name, const DatasetNote& note) {
  if (!note.units.empty()) attribute(name, "units", note.units);
  if (!note.description.empty()) attribute(name, "description", note.description);
}

void Hdf5Writer::growing_dataset(const std::string& name, ElementType type, const std::vector<std::int64_t>& row,
                                 const DatasetNote& note) {
  std::int64_t values = 1;
  for (const std::int64_t length : row) values *= length;
  const std::vector<hsize_t> none = shape_of(0, row), most = shape_of(H5S_UNLIMITED, row);
  const int rank = static_cast<int>(none.size());
  const Hdf5Handle space(H5Screate_simple(rank, none.data(), most.data()), &H5Sclose);
  const Hdf5Handle creation = without_times(H5P_DATASET_CREATE);
  const std::size_t row_bytes = H5Tget_size(file_type(type)) * static_cast<std::size_t>(values);
  set_chunks(creation.id(), rank, shape_of(rows_of_chunk(row_bytes), row), file_type(type));
  Hdf5Handle set(checked(H5Dcreate2(file_.id(), name.c_str(), file_type(type), space.id(), H5P_DEFAULT, creation.id(),
                                    H5P_DEFAULT),
                         name),
                 &H5Dclose);
  growing_.insert_or_assign(name, Growing{std::move(set), type, row, values, 0});
  reserve_disk(0);
  describe(name, note);
}

void Hdf5Writer::append_rows(const std::string& name, ElementType type, const void* values, std::int64_t count) {
  const auto found = growing_.find(name);
  if (found == growing_.end() || found->second.type != type || count % found->second.values != 0)
    throw StoreError(path_ + ": " + name + ": no growing dataset of this type and width");
  Growing& growing = found->second;
  const std::int64_t rows = count / growing.values;
  if (rows == 0) return;
  reserve_disk(count * static_cast<std::int64_t>(H5Tget_size(file_type(type))));
  const std::vector<hsize_t> total = shape_of(static_cast<hsize_t>(growing.rows + rows), growing.row);
  checked(H5Dset_extent(growing.set.id(), total.data()), name);
  write_rows(growing.set.id(), name, memory_type(type), values, growing.row, {growing.rows, rows});
  growing.rows += rows;
}

void Hdf5Writer::link(const std::string& existing, const std::string& name) {
  checked(H5Lcreate_hard(file_.id(), existing.c_str(), file_.id(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT), name);
}

void Hdf5Writer::attribute(const std::string& object, const std::string& name, const std::string& value) {
  const Hdf5Handle type = text_type(value.size());
  const Hdf5Handle space(H5Screate(H5S_SCALAR), &H5Sclose);
  const Hdf5Handle made(checked(H5Acreate_by_name(file_.id(), object.c_str(), name.c_str(), type.id(), space.id(),
                                                  H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
                                object + "@" + name),
                        &H5Aclose);
  checked(H5Awrite(made.id(), type.id(), value.empty() ? "" : value.data()), object + "@" + name);
}

void Hdf5Writer::scalar_attribute(const std::string& object, const std::string& name, ElementType type,
                                  const void* value) {
  const Hdf5Handle space(H5Screate(H5S_SCALAR), &H5Sclose);
  const Hdf5Handle made(checked(H5Acreate_by_name(file_.id(), object.c_str(), name.c_str(), file_type(type), space.id(),
                                                  H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
                                object + "@" + name),
                        &H5Aclose);
  checked(H5Awrite(made.id(), memory_type(type), value), object + "@" + name);
}

std::int64_t Hdf5Writer::checked(std::int64_t result, const std::string& name) const {
  if (result >= 0) return result;
  throw StoreError(path_ + ": " + (name.empty() ? "" : name + ": ") + "cannot be made (" + last_hdf5_failure() +
                   "); is there enough memory for the file?");
}

}  // namespace megablock
