// Writes and reads HDF5 files. All files that the project stores go through these two classes.
//
// Files are written with libver 'latest', without time stamps, and in a fixed order of calls; equal contents give equal
// bytes. The content hash of a unit therefore stands for its contents (job_store.h). A file has one writer. HDF5's own
// file locking is off, because it fails on network file systems. Datasets of integers and texts above 16 KiB are
// chunked, shuffled and deflated. Every file has the root attributes `kind` and `format_version`.
//
// Errors are StoreErrors that name file and dataset. A full disk, a quota or a read-only directory is an InputError
// while writing. The classes are for one thread at a time.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace megablock {

// Version of all file formats of the project, including the trailer of units. It rises when the meaning or layout of
// any file changes.
inline constexpr std::uint32_t kFormatVersion = 2;

// An HDF5 identifier with the function that closes it.
class Hdf5Handle {
 public:
  using Close = int (*)(std::int64_t);
  Hdf5Handle() = default;
  Hdf5Handle(std::int64_t id, Close close) : id_(id), close_(close) {}
  ~Hdf5Handle() { reset(); }
  Hdf5Handle(Hdf5Handle&& other) noexcept : id_(other.release()), close_(other.close_) {}
  Hdf5Handle& operator=(Hdf5Handle&& other) noexcept {
    reset();
    close_ = other.close_;
    id_ = other.release();
    return *this;
  }
  std::int64_t id() const { return id_; }
  std::int64_t release() {
    const std::int64_t id = id_;
    id_ = -1;
    return id;
  }
  void reset() {
    if (id_ >= 0) close_(id_);
    id_ = -1;
  }

 private:
  std::int64_t id_ = -1;
  Close close_ = nullptr;
};

enum class ElementType { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kInt64, kUint64, kFloat, kDouble };

template <typename T>
constexpr ElementType element_type() {
  static_assert(std::is_arithmetic_v<T> && !std::is_same_v<T, bool>);
  if constexpr (std::is_same_v<T, float>) return ElementType::kFloat;
  if constexpr (std::is_same_v<T, double>) return ElementType::kDouble;
  if constexpr (sizeof(T) == 1) return std::is_signed_v<T> ? ElementType::kInt8 : ElementType::kUint8;
  if constexpr (sizeof(T) == 2) return std::is_signed_v<T> ? ElementType::kInt16 : ElementType::kUint16;
  if constexpr (sizeof(T) == 4) return std::is_signed_v<T> ? ElementType::kInt32 : ElementType::kUint32;
  return std::is_signed_v<T> ? ElementType::kInt64 : ElementType::kUint64;
}

// The attributes `units` and `description` of a dataset; empty ones are not written.
struct DatasetNote {
  std::string units, description;
};

// The rows [first, first + count) of a dataset.
struct RowRange {
  std::int64_t first = 0, count = 0;
};

// HDF5 cannot recover when the disk fills up, and then crashes at the end of the process. A file is therefore made in
// memory (compressed) and written at once by close(). A file too large for that (kDisk) is written while its rows are
// appended, to disk space that is reserved before HDF5 needs it.
enum class Hdf5Storage { kMemory, kDisk };

class Hdf5Writer {
 public:
  Hdf5Writer(const std::string& path, const std::string& kind, Hdf5Storage storage = Hdf5Storage::kMemory);
  // Without close(), as after an exception, no file remains.
  ~Hdf5Writer();
  // Writes the file and replaces an existing one. Nothing may be called after it.
  void close();
  // Sets a function that is called after every dataset that is written as a whole. By then the memory of its source may
  // be released.
  void after_datasets(std::function<void()> call) { after_dataset_ = std::move(call); }
  // Calls that function; for use while the values of one dataset are collected from two large tables.
  void rest() const { after_dataset_(); }

  // Names are paths in the file with '/' between groups. A group must be made before its contents.
  void group(const std::string& name, const std::string& description = {});

  template <typename T>
  void vector(const std::string& name, const std::vector<T>& values, const DatasetNote& note = {}) {
    dataset(name, element_type<T>(), values.data(), {static_cast<std::int64_t>(values.size())}, note);
  }
  // A row-major matrix [rows x columns]. values.size() must be a multiple of `columns`.
  template <typename T>
  void matrix(const std::string& name, const std::vector<T>& values, std::int64_t columns,
              const DatasetNote& note = {}) {
    const auto rows = static_cast<std::int64_t>(values.size()) / columns;
    dataset(name, element_type<T>(), values.data(), {rows, columns}, note);
  }
  // Row-major values of any shape.
  template <typename T>
  void array(const std::string& name, const std::vector<T>& values, const std::vector<std::int64_t>& shape,
             const DatasetNote& note = {}) {
    dataset(name, element_type<T>(), values.data(), shape, note);
  }
  // Integers, stored in the smallest signed type that can hold them. Readers may ask for any integer type.
  void integers(const std::string& name, const std::vector<std::int64_t>& values, const DatasetNote& note = {});
  // Strings of fixed length in UTF-8, padded with zero bytes to the longest.
  void texts(const std::string& name, const std::vector<std::string>& values, const DatasetNote& note = {});
  // The same for `count` rows; row(i) is called twice for each. A million strings are thus never in memory together.
  void texts(const std::string& name, std::int64_t count, const std::function<std::string(std::int64_t)>& row,
             const DatasetNote& note = {});
  void dataset(const std::string& name, ElementType type, const void* values, const std::vector<std::int64_t>& shape,
               const DatasetNote& note);

  // A dataset that grows. It has no rows at first; each row has this shape (empty: one value). It is always chunked.
  template <typename T>
  void growing(const std::string& name, const std::vector<std::int64_t>& row = {}, const DatasetNote& note = {}) {
    growing_dataset(name, element_type<T>(), row, note);
  }
  // Appends rows (row-major) to a growing dataset with this element type.
  template <typename T>
  void append(const std::string& name, const std::vector<T>& values) {
    append_rows(name, element_type<T>(), values.data(), static_cast<std::int64_t>(values.size()));
  }

  // A second name of a dataset (a hard link).
  void link(const std::string& existing, const std::string& name);

  // An attribute of a group or dataset; "/" is the root of the file.
  template <typename T>
  void attribute(const std::string& object, const std::string& name, T value) requires std::is_arithmetic_v<T> {
    scalar_attribute(object, name, element_type<T>(), &value);
  }
  void attribute(const std::string& object, const std::string& name, const std::string& value);

 private:
  void scalar_attribute(const std::string& object, const std::string& name, ElementType type, const void* value);
  void write_dataset(const std::string& name, std::int64_t file_type, std::int64_t memory_type, const void* values,
                     const std::vector<std::int64_t>& shape, const DatasetNote& note);
  Hdf5Handle make_dataset(const std::string& name, std::int64_t file_type, const std::vector<std::int64_t>& shape);
  void write_rows(std::int64_t set, const std::string& name, std::int64_t memory_type, const void* values,
                  const std::vector<std::int64_t>& row, RowRange range);
  void describe(const std::string& name, const DatasetNote& note);
  void growing_dataset(const std::string& name, ElementType type, const std::vector<std::int64_t>& row,
                       const DatasetNote& note);
  void append_rows(const std::string& name, ElementType type, const void* values, std::int64_t count);
  void reserve_disk(std::int64_t bytes);
  std::int64_t checked(std::int64_t result, const std::string& name) const;  // throws if result < 0

  struct Image;  // the file in memory
  struct Growing {
    Hdf5Handle set;  // stays open, so that the chunk being filled stays in its cache
    ElementType type;
    std::vector<std::int64_t> row;  // shape of a row
    std::int64_t values, rows;      // values: number of values per row
  };

  std::string path_;
  Hdf5Storage storage_;
  std::unique_ptr<Image> image_;  // only for kMemory
  Hdf5Handle file_;
  std::map<std::string, Growing> growing_;
  std::function<void()> after_dataset_ = [] {};
};

// Joins ascending rows into few ranges that contain all rows from their first to their last. Rows closer than `gap`
// share a range.
std::vector<RowRange> ranges_of(const std::vector<std::int64_t>& rows, std::int64_t gap);

// The attribute `kind` of a file. Errors as in Hdf5Reader.
std::string file_kind(const std::string& path);

class Hdf5Reader {
 public:
  // Throws StoreError if the file is missing, is no HDF5 file, or has another kind or format version.
  Hdf5Reader(const std::string& path, const std::string& kind);

  const std::string& path() const { return path_; }
  std::string kind() const { return text_attribute("/", "kind"); }
  bool has(const std::string& name) const;  // whether there is such a group or dataset
  std::vector<std::int64_t> shape(const std::string& name) const;

  // Values converted to T. With size >= 0, a dataset of another length is an error.
  template <typename T>
  std::vector<T> vector(const std::string& name, std::int64_t size = -1) const {
    return array<T>(name, {size});
  }
  // Row-major values of a dataset [rows x columns]. The number of columns must agree, and that of rows if rows >= 0.
  template <typename T>
  std::vector<T> matrix(const std::string& name, std::int64_t columns, std::int64_t rows = -1) const {
    return array<T>(name, {rows, columns});
  }
  // Row-major values of a dataset that must have this shape; -1 stands for any length.
  template <typename T>
  std::vector<T> array(const std::string& name, const std::vector<std::int64_t>& expected) const {
    std::vector<T> values(checked_size(name, expected));
    read(name, element_type<T>(), values.data());
    return values;
  }
  std::vector<std::string> texts(const std::string& name, std::int64_t size = -1) const;

  // Values of some rows only, in the order of the ranges (row-major). Chunks without any of them are not read.
  template <typename T>
  std::vector<T> rows(const std::string& name, const std::vector<RowRange>& ranges) const {
    std::vector<T> values(size_of_rows(name, ranges));
    read_rows(name, element_type<T>(), ranges, values.data());
    return values;
  }
  std::vector<std::string> text_rows(const std::string& name, const std::vector<RowRange>& ranges) const;

  bool has_attribute(const std::string& object, const std::string& name) const;
  template <typename T>
  T attribute(const std::string& object, const std::string& name) const {
    T value{};
    scalar_attribute(object, name, element_type<T>(), &value);
    return value;
  }
  std::string text_attribute(const std::string& object, const std::string& name) const;

  // Throws StoreError "<file>: <dataset>: <what>; ..." for contents that contradict each other.
  [[noreturn]] void fail(const std::string& name, const std::string& what) const;

 private:
  friend std::string file_kind(const std::string& path);
  explicit Hdf5Reader(const std::string& path);  // a file of any kind
  void read(const std::string& name, ElementType type, void* values) const;
  std::size_t size_of_rows(const std::string& name, const std::vector<RowRange>& ranges) const;  // number of values
  void read_rows(const std::string& name, ElementType type, const std::vector<RowRange>& ranges, void* values) const;
  // Throws if integers are wanted from a dataset of floating-point numbers.
  void check_class(std::int64_t set, const std::string& name, ElementType type) const;
  // Type of fixed-length strings; throws for others.
  Hdf5Handle text_type(std::int64_t set, const std::string& name) const;
  void scalar_attribute(const std::string& object, const std::string& name, ElementType type, void* value) const;
  // Number of values of a dataset; throws if it does not have the expected shape.
  std::size_t checked_size(const std::string& name, const std::vector<std::int64_t>& expected) const;
  std::int64_t checked(std::int64_t result, const std::string& name) const;

  std::string path_;
  Hdf5Handle file_;
};

}  // namespace megablock
