// HDF5 files behind two small classes: everything the project stores goes through them.
//
// Files are written with libver 'latest', without time stamps and in a fixed order of calls, so that equal contents
// give equal bytes. One writer per file; HDF5's own file locking is off (network file systems). Datasets of
// integers and texts above 16 KiB are chunked, shuffled and deflated. Every file carries the root attributes `kind` and
// `format_version`.
//
// Errors: StoreError naming file and dataset; a full disk, quota or read-only directory while writing is an InputError.
// One thread at a time.
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

// Of every file the project writes and of the trailer of units; raised when the meaning or layout of any file changes.
inline constexpr std::uint32_t kFormatVersion = 2;

// An HDF5 identifier with its closing function.
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

// Attributes `units` and `description` of a dataset; empty ones are not written.
struct DatasetNote {
  std::string units, description;
};

// Rows [first, first + count) of a dataset.
struct RowRange {
  std::int64_t first = 0, count = 0;
};

// HDF5 cannot recover from a disk that fills up under it, and crashes when the process ends. So a file is put together
// in memory (compressed) and written by close() in one go; one that is too large for that (kDisk) is written as its
// rows are appended, on disk space that is reserved before HDF5 needs it.
enum class Hdf5Storage { kMemory, kDisk };

class Hdf5Writer {
 public:
  Hdf5Writer(const std::string& path, const std::string& kind, Hdf5Storage storage = Hdf5Storage::kMemory);
  // Without close(), as after an exception, no file is left.
  ~Hdf5Writer();
  // Writes the file, in place of one that is there; nothing may follow.
  void close();
  // From now on behind every dataset that is written whole: what its values were taken from may leave memory.
  void after_datasets(std::function<void()> call) { after_dataset_ = std::move(call); }
  // The same, asked for while the values of one are taken from two large tables.
  void rest() const { after_dataset_(); }

  // Names are paths in the file, '/' between groups; a group must be made before what is in it.
  void group(const std::string& name, const std::string& description = {});

  template <typename T>
  void vector(const std::string& name, const std::vector<T>& values, const DatasetNote& note = {}) {
    dataset(name, element_type<T>(), values.data(), {static_cast<std::int64_t>(values.size())}, note);
  }
  // Row-major [rows x columns]; values.size() must be a multiple of columns.
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
  // Integers in the smallest signed type that holds them all; readers ask for any integer type.
  void integers(const std::string& name, const std::vector<std::int64_t>& values, const DatasetNote& note = {});
  // Fixed-length UTF-8 strings, padded with zero bytes to the longest.
  void texts(const std::string& name, const std::vector<std::string>& values, const DatasetNote& note = {});
  // The same of `count` rows, which `row` says twice each: a million of them are nowhere at once.
  void texts(const std::string& name, std::int64_t count, const std::function<std::string(std::int64_t)>& row,
             const DatasetNote& note = {});
  void dataset(const std::string& name, ElementType type, const void* values, const std::vector<std::int64_t>& shape,
               const DatasetNote& note);

  // A dataset that grows: no rows at first, each of this shape (none: one value), always in chunks.
  template <typename T>
  void growing(const std::string& name, const std::vector<std::int64_t>& row = {}, const DatasetNote& note = {}) {
    growing_dataset(name, element_type<T>(), row, note);
  }
  // Appends rows (row-major) to a growing dataset of this element type.
  template <typename T>
  void append(const std::string& name, const std::vector<T>& values) {
    append_rows(name, element_type<T>(), values.data(), static_cast<std::int64_t>(values.size()));
  }

  // A second name for a dataset (hard link).
  void link(const std::string& existing, const std::string& name);

  // Attribute of a group or dataset ("/" is the file's root).
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
  std::int64_t checked(std::int64_t result, const std::string& name) const;  // throws when result < 0

  struct Image;  // the file in memory
  struct Growing {
    Hdf5Handle set;  // kept open: the chunk that is being filled stays in its cache
    ElementType type;
    std::vector<std::int64_t> row;  // its shape
    std::int64_t values, rows;      // values per row
  };

  std::string path_;
  Hdf5Storage storage_;
  std::unique_ptr<Image> image_;  // kMemory
  Hdf5Handle file_;
  std::map<std::string, Growing> growing_;
  std::function<void()> after_dataset_ = [] {};
};

// Ascending rows as few ranges, each with all rows between its first and its last: rows closer than `gap` join.
std::vector<RowRange> ranges_of(const std::vector<std::int64_t>& rows, std::int64_t gap);

// What a file holds: its attribute `kind`. Errors as Hdf5Reader.
std::string file_kind(const std::string& path);

class Hdf5Reader {
 public:
  // Throws StoreError when the file is missing, no HDF5 file, of another kind or format version.
  Hdf5Reader(const std::string& path, const std::string& kind);

  const std::string& path() const { return path_; }
  std::string kind() const { return text_attribute("/", "kind"); }
  bool has(const std::string& name) const;  // group or dataset
  std::vector<std::int64_t> shape(const std::string& name) const;

  // Values converted to T; with `size` >= 0 a dataset of another length is an error.
  template <typename T>
  std::vector<T> vector(const std::string& name, std::int64_t size = -1) const {
    return array<T>(name, {size});
  }
  // Row-major values of a [rows x columns] dataset; the column count must agree, and the row count when rows >= 0.
  template <typename T>
  std::vector<T> matrix(const std::string& name, std::int64_t columns, std::int64_t rows = -1) const {
    return array<T>(name, {rows, columns});
  }
  // Row-major values of a dataset that must have this shape, -1: any length.
  template <typename T>
  std::vector<T> array(const std::string& name, const std::vector<std::int64_t>& expected) const {
    std::vector<T> values(checked_size(name, expected));
    read(name, element_type<T>(), values.data());
    return values;
  }
  std::vector<std::string> texts(const std::string& name, std::int64_t size = -1) const;

  // Of some rows only, range behind range (row-major); reads no chunk without any of them.
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

  // Throws StoreError "<file>: <dataset>: <what>; ..." for contents that contradict themselves.
  [[noreturn]] void fail(const std::string& name, const std::string& what) const;

 private:
  friend std::string file_kind(const std::string& path);
  explicit Hdf5Reader(const std::string& path);  // of any kind
  void read(const std::string& name, ElementType type, void* values) const;
  std::size_t size_of_rows(const std::string& name, const std::vector<RowRange>& ranges) const;  // number of values
  void read_rows(const std::string& name, ElementType type, const std::vector<RowRange>& ranges, void* values) const;
  // An error where integers are wanted of numbers that are none.
  void check_class(std::int64_t set, const std::string& name, ElementType type) const;
  Hdf5Handle text_type(std::int64_t set, const std::string& name) const;  // of fixed-length strings, else an error
  void scalar_attribute(const std::string& object, const std::string& name, ElementType type, void* value) const;
  // Number of values of a dataset, whose shape must be as expected.
  std::size_t checked_size(const std::string& name, const std::vector<std::int64_t>& expected) const;
  std::int64_t checked(std::int64_t result, const std::string& name) const;

  std::string path_;
  Hdf5Handle file_;
};

}  // namespace megablock
